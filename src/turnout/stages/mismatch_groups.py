"""Neighbouring sections of one track are one case: what lies further apart does not feel the same effect.

Visits of a turnout: what was measured together is diagnosed together.
"""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from itertools import zip_longest
from pathlib import Path
from re import search

from turnout.config import Configuration
from turnout.config.merge import digest
from turnout.config.turnout import TurnoutConfig
from turnout.mismatch.turnout import Campaign
from turnout.records import Unit
from turnout.simulate import Sensor, TurnoutTrack
from turnout.stages.mismatch_inputs import Gathered, digest_of_model
from turnout.workflow.plan import Planned, read_plan

GAP = 6.0  # m: sections further apart than this do not hear the same sleeper
MOST_PASSAGES = 8  # of one case: each is simulated hundreds of times, and more of the same kind tell little more
MOST_AXLES = 96  # of all of them: the time of a simulation goes with the axles
RESERVED_EVERY = 5  # of so many recordings one is kept back from all fits
FEWEST_TO_RESERVE = 4


@dataclass(frozen=True)
class Group:
    """Sections ``labels`` on ``route`` with their ``campaign``."""

    labels: tuple[str, ...]
    route: str
    campaign: Campaign


def groups(turnout: TurnoutConfig, track: TurnoutTrack, found: Gathered, only: Sequence[str] = ()) -> Iterator[Group]:
    """The cases of a visit, by place; sections without any recording are left out."""
    for route, labels in _neighbours(turnout, only):
        campaign = _campaign(turnout, track, found, route, labels)
        if campaign is not None and route not in ("main", *track.routes):
            found.notes.append(f"sections {', '.join(labels)}: the track's file has no route {route}; not used")
        elif campaign is not None:
            yield Group(_measured(turnout, found, campaign, labels), route, campaign)


def _neighbours(turnout, only):
    """(route, labels) of sections that follow each other within ``GAP``, or of ``only`` these, all together."""
    for route in ("main", "diverging"):
        mine = [s for s in turnout.sections if _route(s) == route and (not only or s.label in only)]
        mine.sort(key=lambda s: s.position)
        part: list = []
        for section in mine:
            if part and not only and section.position - part[-1].position > GAP:
                yield route, tuple(s.label for s in part)
                part = []
            part.append(section)
        if part:
            yield route, tuple(s.label for s in part)


def _measured(turnout, found, campaign, labels):
    """The labels that have a recording in the campaign."""
    struck = {found.sections[t.name] for t in campaign.hammer}
    watched = {turnout.passages.sections[s.name] for s in campaign.sensors} if turnout.passages else set()
    return tuple(label for label in labels if label in struck | watched)


def _route(section):
    return "diverging" if section.track == "diverging" else "main"


def _campaign(turnout, track, found, route, labels):
    tests = tuple(t for t in found.tests if found.sections[t.name] in labels)
    sensors = _sensors(turnout, labels)
    names = {s.name for s in sensors}
    shared = all(turnout.section(label).track == "both" for label in labels)
    passages = [
        p for p in found.passages if (shared or p.route == route) and names & {c.name for c in p.recording.channels}
    ]
    passages = telling(formations(passages))
    heard = {c.name for p in passages for c in p.recording.channels} & names
    sensors = tuple(s for s in sensors if s.name in heard)
    if not tests and not passages:
        return None
    if route != "main" and route in track.routes:
        track, passages = _as_main(track, route, passages)
    return Campaign(track, sensors, tests, tuple(passages), reserved(passages, tests))


def _sensors(turnout, labels):
    if turnout.passages is None:
        return ()
    found = []
    for channel in turnout.passages.description.channels:
        label = turnout.passages.sections.get(channel.name)
        if label in labels and channel.quantity == "acceleration":
            position = channel.position if channel.position is not None else turnout.section(label).position
            found.append(Sensor(channel.name, float(position), channel.mounting or "rail head"))
    return tuple(found)


def _as_main(track, route, passages):
    """The turnout seen from another route: its track is the one that blows and trains of the case meet."""
    own = track.track_of(route)
    seen = replace(track, track=own, tracks={"main": own}, routes={"main": track.routes[route]})
    return seen, [replace(p, route="main") for p in passages]


def formations(passages):
    """The passages, trains of one type that came in several lengths as trains of their own: wheels are counted."""
    axles = {id(p): len(p.vehicle.wheels) for p in passages}
    lengths: dict[str, set] = {}
    for p in passages:
        lengths.setdefault(p.train, set()).add(axles[id(p)])
    several = {train for train, found in lengths.items() if train and len(found) > 1}
    return [replace(p, train=f"{p.train}, {axles[id(p)]} axles") if p.train in several else p for p in passages]


def telling(passages, most=MOST_PASSAGES, axles=MOST_AXLES):
    """At most ``most`` passages and ``axles``: one train of each type in turn, short ones first, of each type the
    extremes of speed first."""
    kinds: dict[str, list] = {}
    for p in sorted(passages, key=lambda p: (len(p.vehicle.wheels), p.train, p.speed)):
        kinds.setdefault(p.train, []).append(p)
    queues = [_extremes_first(members) for members in kinds.values()]
    order = [p for turn in zip_longest(*queues) for p in turn if p is not None]
    chosen: list = []
    for p in order:
        total = sum(len(c.vehicle.wheels) for c in chosen) + len(p.vehicle.wheels)
        if len(chosen) < most and (total <= axles or not chosen):
            chosen.append(p)
    return [p for p in passages if any(p is c for c in chosen)]


def _extremes_first(members):
    """Slowest, fastest, second slowest, second fastest ... of passages in order of speed."""
    n = len(members)
    return [members[k // 2 if k % 2 == 0 else n - 1 - k // 2] for k in range(n)]


def reserved(passages, tests) -> tuple[str, ...]:
    """Names that no fit reads: of passages in order of speed every fifth, else of the tests. A train's only passage
    stays for the fits where another one, the nearest in speed, can be kept back in its place."""
    items = sorted(passages, key=lambda p: p.speed) or sorted(tests, key=lambda t: t.place)
    if len(items) < FEWEST_TO_RESERVE:
        return ()
    left, chosen = Counter(_train(item) for item in items), []
    for wanted in range(RESERVED_EVERY // 2, len(items), RESERVED_EVERY):
        near = sorted((k for k in range(len(items)) if k not in chosen), key=lambda k: abs(k - wanted))
        chosen.append(next((k for k in near if left[_train(items[k])] > 1), near[0]))
        left[_train(items[chosen[-1]])] -= 1
    return tuple(items[k].name for k in sorted(chosen))


def _train(item):
    """Type of a passage's train; all hammer tests are of one kind."""
    return getattr(item, "train", "")


NEAR_DAYS = 31  # a passage further than this from every campaign is a visit of its calendar month
NEWEST = 1  # visits of a turnout that the fleet's stage looks at: older ones were looked at when they were new


def visits(units: Iterable[Unit]) -> dict[str, list[Unit]]:
    """Units by visit, oldest first: the day of a campaign with the passages nearest to it, else a month.

    >>> def at(kind, label, campaign=None):
    ...     return Unit("t", kind, label, (), "", None, campaign)
    >>> found = visits([at("hammer", "A7/2026-07-25", "2026-07-25"), at("passage", "20260722T084238Z.h5"),
    ...                 at("passage", "20260301T084238Z.h5")])
    >>> {name: len(members) for name, members in found.items()}
    {'2026-03': 1, '2026-07-25': 2}
    """
    units = list(units)
    days = sorted({date.fromisoformat(u.campaign) for u in units if u.campaign})
    found: dict[str, list[Unit]] = {}
    for unit in units:
        label = unit.campaign or _visit_of(unit.label, days)
        if label:
            found.setdefault(label, []).append(unit)
    return dict(sorted(found.items()))


def _visit_of(label: str, days: Sequence[date]) -> str:
    stamp = search(r"(\d{4})(\d\d)(\d\d)T\d{6}Z", label)
    if not stamp:
        return ""
    day = date(*map(int, stamp.groups()))
    near = min(days, key=lambda d: abs((d - day).days), default=None)
    if near is not None and abs((near - day).days) <= NEAR_DAYS:
        return near.isoformat()
    return f"{day:%Y-%m}"


def enabled_visit(plan: Path, configuration: Configuration) -> Iterator[Planned]:
    """Newest visits, as units, of the turnouts whose settings say ``mismatch: enabled: true``."""
    for planned in every_visit(plan, configuration):
        if configuration.turnout(planned.unit.turnout).settings["mismatch"].enabled:
            yield planned


def every_visit(plan: Path, configuration: Configuration) -> Iterator[Planned]:
    """Newest visits of all turnouts of a plan; the note changes with notes, track and vehicles."""
    by_turnout: dict[str, list[Planned]] = {}
    for planned in read_plan(plan):
        by_turnout.setdefault(planned.unit.turnout, []).append(planned)
    hashes = {e["turnout"]: e["hashes"] for e in json.loads(Path(plan).read_text(encoding="utf-8"))["turnouts"]}
    for turnout, members in by_turnout.items():
        notes = {id(p.unit): p.note for p in members}
        model = digest_of_model(configuration.turnout(turnout))
        for label, units in list(visits(p.unit for p in members).items())[-NEWEST:]:
            note = digest([model, *(notes[id(u)] for u in units)])[:16]
            yield Planned(unit_of(turnout, label, units, hashes[turnout].get("mismatch", "")), note)


def unit_of(turnout: str, label: str, units: Sequence[Unit], config_hash: str) -> Unit:
    """One unit of all files of a visit."""
    files = tuple(sorted(f for u in units for f in u.files))
    return Unit(turnout, "mismatch", label, files, config_hash)


def members_of(unit: Unit, scanned: Iterable[Unit]) -> list[Unit]:
    """The hammer tests and passages, as scanned, whose files a visit's unit holds."""
    wanted = {f[0] for f in unit.files}
    found = []
    for u in scanned:
        files = tuple(f for f in u.files if f[0] in wanted)
        if files:
            found.append(replace(u, files=files))
    return found
