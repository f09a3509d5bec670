"""Visits of a turnout: what was measured together is diagnosed together."""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from re import search

from turnout.chains.mismatch_context import digest_of_model
from turnout.config import Configuration
from turnout.config.merge import digest
from turnout.fleet.plan import Planned, read_plan
from turnout.records import Unit

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
