"""Gather the inputs of a diagnosis: hammer tests, passages, track file, vehicles and the passage stage's results.

Recordings that cannot be used are noted with the reason.
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

HALF_BAY = 0.3  # m: distance of a "mid-span" accelerometer from the sleeper of the impact
TOPS = 0.002  # share of clipped samples that leaves the band of the diagnosis unchanged
MOST_ALIKE = 16  # similar passages per visit: twice the limit of a case
UNSOUND = ("clipped", "dead_channel", "not_finite", "sensor_lost", "channels_swapped")


@dataclass
class Gathered:
    """Usable hammer ``tests`` and ``passages`` of a visit, and ``notes`` on the rest; ``sections`` by test name."""

    tests: list[HammerTest] = field(default_factory=list)
    sections: dict[str, str] = field(default_factory=dict)
    passages: list[Passage] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def said(self) -> list:
        """Content of the digest: all notes and passage results that a diagnosis depends on."""
        tests = [[t.name, t.place, t.conditions] for t in self.tests]
        vehicles: list[Any] = [p.vehicle for p in self.passages]
        loads = [[float(load) for load in v.static_loads] for v in vehicles]
        trains = [[p.name, p.train, p.speed, p.direction, p.route, p.conditions] for p in self.passages]
        return [tests, trains, loads, self.notes]


def gather(units: Iterable[Unit], turnout: TurnoutConfig, raw_root, track, told: Mapping[str, dict]) -> Gathered:
    """Read all units of a visit.

    ``track`` is the TurnoutTrack, ``passage_tables`` are the tables of the passage stage by unit.
    """
    found = Gathered()
    for unit in units:
        if unit.kind == "hammer" and turnout.hammer is not None:
            _test(unit, turnout, raw_root, track, found)
        elif unit.kind == "passage" and turnout.passages is not None:
            tables = told.get(unit_id(unit)) or _analysed(unit, turnout, raw_root)
            _passages(unit, turnout, raw_root, track, tables, found)
    return found


def _read(unit, description, raw_root, notes, longest=None):
    """Recordings of a unit, long ones included; read errors are added to ``notes``."""
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
    """The recording with positions for accelerometers that have none: at the impact, or half a bay further."""
    channels = tuple(
        c
        if c.quantity != "acceleration" or c.position is not None
        else replace(c, position=place + (HALF_BAY if "mid-span" in c.mounting else 0.0))
        for c in recording.channels
    )
    return replace(recording, channels=channels)


def _analysed(unit, turnout, raw_root) -> dict[str, list[dict]]:
    """Tables that the passage stage would compute."""
    path = Path(turnout.settings["passage"].axle_patterns)
    if not path.is_file():
        path = Path(turnout.folder) / "vehicles" / path.name
    patterns = known_patterns(str(path)) if path.is_file() else ()
    return passage_unit(unit, turnout, raw_root, PassageContext(patterns=patterns))


def _passages(unit, turnout, raw_root, track, tables, found):
    """Add the trains of a unit, each with its row of the passage stage.

    If the numbers of trains and rows differ, the rows are not used, with a note: they cannot be assigned.
    """
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
    """(VisitInputs of a unit's trains, number of trains); a long recording is never loaded as a whole."""
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
    """Passage of a train, None if it cannot be used; reasons and doubts are added to ``notes``."""
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
    """Recordings of a unit, continuous ones cut into trains as in the passage stage."""
    settings, sensors = turnout.settings["passage"], sensors_of(turnout)
    for recording in _read(unit, turnout.passages.description, raw_root, notes, settings.longest):
        try:
            for part, *_ in trains_in(recording, settings):
                yield without_pulses(part, sensors)[0]
        except ReadError as error:
            notes.append(str(error))


def _thin_out(passages):
    """Remove the train of middle speed if there are too many similar ones: memory is limited."""
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
    """Channel names in a quarantine row: one, or two that are swapped."""
    return row["place"].split(", ")[-1].split(":")[0].split(" and ")


def _spoils(row):
    """Whether the channel of a quarantine row cannot be used; a slightly clipped one can."""
    slightly = row["reason_code"] == "clipped" and (row.get("measured_value") or 1.0) < TOPS
    return row["reason_code"] in UNSOUND and not slightly


def _misplaced_sensors(turnout, track, notes):
    """Names of sensors whose position contradicts the track, with notes."""
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
    """The recording with the usable channels of this route only, at their positions."""
    sensors = {s.name: s for s in sensors_of(turnout) if s.track in ("both", route) and s.name not in unsound}
    keep = [i for i, c in enumerate(recording.channels) if c.name in sensors]
    channels = tuple(
        replace(recording.channels[i], position=sensors[recording.channels[i].name].position) for i in keep
    )
    return replace(recording, samples=recording.samples[keep], channels=channels)


def track_file(turnout: TurnoutConfig, name: str | None = None) -> Path:
    """The turnout's own track file in the configuration, else that of its layout; SimulationError without one."""
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
    """Digest of the track and vehicle files of the configuration, "" without a track.

    For a track given by ``name``, all files in its folder count, since it may extend any of them.
    """
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
    """A track's file and the files that it extends, as far as they can be read.

    Errors in them are reported by the diagnosis.
    """
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
    """(token, tables by passage unit) from the results of the passage stage in ``work``."""
    found = {}
    for result in current_results(work, "passage", turnout):
        found[result.unit] = {k: result.tables.get(k, []) for k in ("passages", "quarantine")}
    ids = sorted(str(r.get("passage_id")) + str(r.get("status")) for t in found.values() for r in t["passages"])
    return hashlib.sha256(json.dumps(ids).encode()).hexdigest()[:16], found
