"""A visit's raw files as hammer tests and passages of the engine; what cannot be used is said.

What a diagnosis of a turnout needs beside its files: its track's file, vehicles, what the passage stage found.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from turnout.config.parameters import read_parameters
from turnout.config.turnout import TurnoutConfig
from turnout.content import sha256_of
from turnout.errors import ReadError, SimulationError, TurnoutError
from turnout.mismatch.turnout import HammerTest, Passage
from turnout.passage.channel_checks import without_pulses
from turnout.passage.second_train import ANOTHER
from turnout.readers import read
from turnout.records import LongRecording, Recording, Unit
from turnout.simulate import load_track
from turnout.simulate.parameters import extended
from turnout.stages import common
from turnout.stages.accepted_effects import accepted_of
from turnout.stages.common import rail_temperature
from turnout.stages.layout_checks import misplaced
from turnout.stages.mismatch_trains import TrainUnknownError, train_of
from turnout.stages.passage import PassageContext, passage_unit, sensors_of, trains_in
from turnout.stages.passage_context import known_patterns
from turnout.workflow.current_results import current_results
from turnout.workflow.scan import unit_id

HALF_BAY = 0.3  # m: an accelerometer "mid-span" sits this far from the sleeper struck
TOPS = 0.002  # share of samples at the range that leaves the band of the diagnosis as it is: tops of blows above it
MOST_ALIKE = 16  # passages of one train kept of a visit: twice as many as a case has of all
UNSOUND = ("clipped", "dead_channel", "not_finite", "sensor_lost", "channels_swapped")


@dataclass
class Gathered:
    """What can be used of a visit, and ``notes`` on what cannot; ``sections`` of each test, ``unsound`` channels."""

    tests: list[HammerTest] = field(default_factory=list)
    sections: dict[str, str] = field(default_factory=dict)
    passages: list[Passage] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def said(self) -> list:
        """All that notes and the passage stage said of the recordings: another word is another diagnosis."""
        tests = [[t.name, t.place, t.conditions] for t in self.tests]
        vehicles: list[Any] = [p.vehicle for p in self.passages]
        loads = [[float(load) for load in v.static_loads] for v in vehicles]
        trains = [[p.name, p.train, p.speed, p.direction, p.route, p.conditions] for p in self.passages]
        return [tests, trains, loads, self.notes]


def gather(units: Iterable[Unit], turnout: TurnoutConfig, raw_root, track, told: Mapping[str, dict]) -> Gathered:
    """Read all units of a visit. ``track`` is the TurnoutTrack, ``told`` the passage stage's tables by unit."""
    found = Gathered()
    for unit in units:
        if unit.kind == "hammer" and turnout.hammer is not None:
            _test(unit, turnout, raw_root, track, found)
        elif unit.kind == "passage" and turnout.passages is not None:
            tables = told.get(unit_id(unit)) or _analysed(unit, turnout, raw_root)
            _passages(unit, turnout, raw_root, track, tables, found)
    return found


def _read(unit, description, raw_root, notes, longest=None):
    """Recordings of a unit, those that stay in their file as well; what cannot be read goes to the notes."""
    for path, *_ in unit.files:
        try:
            result = read(path, raw_root, description, longest)
        except ReadError as error:
            notes.append(str(error))
            continue
        notes += [str(e) for e in result.errors]
        everything: list[Recording | LongRecording] = [*result.recordings, *result.long]
        yield from sorted(everything, key=lambda r: r.record)


def _test(unit, turnout, raw_root, track, found):
    recordings = tuple(_read(unit, turnout.hammer.descriptions[unit.section], raw_root, found.notes))
    if not recordings:
        return
    place = float(turnout.section(unit.section).position)
    if wrong := misplaced(unit.section, place, track):
        found.notes.append(wrong)
        return
    campaign = turnout.campaigns[unit.campaign]
    warm = rail_temperature(recordings) if campaign.rail_temperature is None else campaign.rail_temperature
    noted = {} if warm is None else {"rail_temperature": warm}
    name = f"{unit.section} {unit.campaign}"
    force = turnout.hammer.force[unit.section]
    seated = tuple(_seated(r, place) for r in recordings)
    judged = turnout.settings["receptance"]
    found.tests.append(HammerTest(name, place, seated, force, unit.campaign, noted, judged))
    found.sections[name] = unit.section


def _seated(recording, place):
    """The recording with places for accelerometers that have none: at the blow, or half a bay on if mid-span."""
    channels = tuple(
        c
        if c.quantity != "acceleration" or c.position is not None
        else replace(c, position=place + (HALF_BAY if "mid-span" in c.mounting else 0.0))
        for c in recording.channels
    )
    return replace(recording, channels=channels)


def _analysed(unit, turnout, raw_root) -> dict[str, list[dict]]:
    """What the passage stage would find."""
    path = Path(turnout.settings["passage"].axle_patterns)
    if not path.is_file():
        path = Path(turnout.folder) / "vehicles" / path.name
    patterns = known_patterns(str(path)) if path.is_file() else ()
    return passage_unit(unit, turnout, raw_root, PassageContext(patterns=patterns))


def _passages(unit, turnout, raw_root, track, tables, found):
    """The trains of a unit, each with its row of the passage stage; with none, which is said, where these are more or
    fewer: nobody could tell whose they are."""
    rows, bad = tables["passages"], tables["quarantine"]
    own, n = _taken(unit, turnout, raw_root, track, rows, bad)
    if n != len(rows):
        own, _ = _taken(unit, turnout, raw_root, track, [{}] * n, bad)
        said = f"{n} trains in it, {len(rows)} where passages were analysed: what was found of them there is not used"
        own.notes.insert(0, f"{_name(unit)}: {said}")
    found.notes += [note for note in own.notes if note not in found.notes]
    for passage in own.passages:
        found.passages.append(passage)
        _thin_out(found.passages)


def _name(unit):
    return unit_id(unit).split("/", 2)[-1]


def _taken(unit, turnout, raw_root, track, rows, bad):
    """(Gathered of a unit's trains, how many these are); a day of a logger never is in memory as a whole."""
    own, n = Gathered(), 0
    for recording in _trains(unit, turnout, raw_root, own.notes):
        name = _name(unit) + (f":{n}" if len(rows) > 1 else "")
        passage = _passage(name, recording, rows[n] if n < len(rows) else {}, turnout, track, bad, own.notes)
        n += 1
        if passage is not None:
            own.passages.append(passage)
            _thin_out(own.passages)
    return own, n


def _passage(name, recording, row: Mapping[str, Any], turnout, track, bad, notes):
    """Passage of a train, None where it cannot be used; why not, and what is doubtful, goes to the notes."""
    unsound = {name for q in bad if _spoils(q) for name in _channels_of(q)}
    unsound |= _misplaced_sensors(turnout, track, notes)
    if ANOTHER in (row.get("detail") or ""):
        notes.append(f"passage {name}: two trains at the same time, not used")
        return None
    try:
        train = train_of(row, recording.conditions, Path(turnout.folder) / "vehicles")
    except TrainUnknownError as error:
        notes.append(f"passage {name}: {error}")
        return None
    forks = any(s.track == "diverging" for s in turnout.sections)
    notes += [f"passage {name}: {d}" for d in train.doubts if forks or not d.startswith("track not known")]
    sound = _sound_channels(recording, turnout, train.route, unsound)
    if gone := sorted(unsound & {c.name for c in recording.channels}):
        notes.append(f"passage {name}: channels {', '.join(gone)} not used{_reasons(bad)}")
    if not sound.channels:
        notes.append(f"passage {name}: no sound channel on the {train.route} track")
        return None
    way = train.direction, train.route
    return Passage(name, sound, train.vehicle, train.speed, train.name, *way, _noted(row, sound), train.load_sd)


def _trains(unit, turnout, raw_root, notes):
    """The recordings of a unit, those of a logger that never stops cut into trains as the passage stage cuts them."""
    settings, sensors = turnout.settings["passage"], sensors_of(turnout)
    for recording in _read(unit, turnout.passages.description, raw_root, notes, settings.longest):
        try:
            for part, *_ in trains_in(recording, settings):
                yield without_pulses(part, sensors)[0]
        except ReadError as error:
            notes.append(str(error))


def _thin_out(passages):
    """Of more trains alike than anybody will ask for the one of middling speed goes: a month of them fills a memory."""
    new = passages[-1]
    alike = [p for p in passages if _kind(p) == _kind(new)]
    if len(alike) > MOST_ALIKE:
        alike.sort(key=lambda p: p.speed)
        gone = alike[len(alike) // 2]
        passages[:] = [p for p in passages if p is not gone]


def _kind(passage):
    channels = tuple(c.name for c in passage.recording.channels)
    return passage.train, passage.route, passage.direction, len(passage.vehicle.wheels), channels


def _channels_of(row):
    """Names of the channels that a quarantine row is about: one, or two that are swapped."""
    return row["place"].split(", ")[-1].split(":")[0].split(" and ")


def _spoils(row):
    """A channel that this quarantine row speaks of is of no use: one that cut off the very top of some blows is."""
    slightly = row["reason_code"] == "clipped" and (row.get("measured_value") or 1.0) < TOPS
    return row["reason_code"] in UNSOUND and not slightly


def _misplaced_sensors(turnout, track, notes):
    """Sensors whose section lies elsewhere in the layout than on the track."""
    found = {s.name: wrong for s in sensors_of(turnout) if (wrong := misplaced(s.section, s.position, track))}
    notes += [wrong for wrong in found.values() if wrong not in notes]
    return set(found)


def _reasons(bad):
    found = ", ".join(sorted({q["reason_code"] for q in bad if _spoils(q)}))
    return f" ({found})" if found else ""


def _noted(row, recording):
    temperature = row.get("rail_temperature_c")
    temperature = common.temperature(recording.conditions) if temperature is None else temperature
    return {} if temperature is None else {"rail_temperature": float(temperature)}


def _sound_channels(recording, turnout, route, unsound):
    """The recording with those channels alone that feel trains of this route and are sound, at their places."""
    sensors = {s.name: s for s in sensors_of(turnout) if s.track in ("both", route) and s.name not in unsound}
    keep = [i for i, c in enumerate(recording.channels) if c.name in sensors]
    channels = tuple(
        replace(recording.channels[i], position=sensors[recording.channels[i].name].position) for i in keep
    )
    return replace(recording, samples=recording.samples[keep], channels=channels)


def track_file(turnout: TurnoutConfig, name: str | None = None) -> Path:
    """The turnout's own file in the configuration's tracks, else that of its layout; SimulationError without one."""
    if name and name.endswith((".yaml", ".yml")):
        return Path(name)
    folder = Path(turnout.folder) / "tracks"
    for stem in (name,) if name else (turnout.id, turnout.layout):
        if (folder / f"{stem}.yaml").is_file():
            return folder / f"{stem}.yaml"
    said = name or f"{turnout.id}.yaml nor {turnout.layout}"
    raise SimulationError(
        f"{turnout.id}: no file {folder}/{said}.yaml; without a track nothing can be simulated "
        "(docs/simulation.md, 'A track of your own')."
    )


def track_of(turnout: TurnoutConfig, name: str | None = None):
    """(TurnoutTrack, accepted effects) of a turnout."""
    path = track_file(turnout, name)
    track = load_track(str(path), folder=path.parent)
    return track, accepted_of(track.terms)


def digest_of_model(turnout: TurnoutConfig, name: str | None = None) -> str:
    """Changes when a track's or a vehicle's file of the configuration does, "" where there are none; beside a track
    that is asked for by ``name`` all in its folder count, since it may extend any of them."""
    folder = Path(turnout.folder)
    try:
        own = track_file(turnout, name)
    except SimulationError:
        return ""
    used = [*_extended(own), *sorted((folder / "tracks").glob(f"{turnout.layout}.yaml"))]
    used += sorted((folder / "vehicles").glob("*"))
    used += sorted(own.parent.glob("*.y*ml")) if name else []
    parts = [[path.name, sha256_of(path)] for path in dict.fromkeys(used) if path.is_file()]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


def _extended(path: Path) -> list[Path]:
    """A track's file and those that it extends, one after the other, as far as they can be read: the diagnosis says
    what is wrong with the rest."""
    found = [path]
    try:
        while "extends" in (own := read_parameters(found[-1])):
            base = extended(own, found[-1], path.parent)
            if base in found:
                break
            found.append(base)
    except (TurnoutError, OSError):
        pass
    return found


def mismatch_context(turnout: str, settings=None, work="work") -> tuple[str, dict[str, dict]]:
    """(token, tables of each passage unit by its id) as the passage stage left them in ``work``."""
    found = {}
    for result in current_results(work, "passage", turnout):
        found[result.unit] = {k: result.tables.get(k, []) for k in ("passages", "quarantine")}
    ids = sorted(str(r.get("passage_id")) + str(r.get("status")) for t in found.values() for r in t["passages"])
    return hashlib.sha256(json.dumps(ids).encode()).hexdigest()[:16], found
