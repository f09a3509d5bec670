"""Gather the inputs of a diagnosis: hammer tests, passages, vehicles and the results of the passage stage.

Recordings that cannot be used are noted with the reason.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from turnout.config.turnout import TurnoutConfig
from turnout.errors import ReadError
from turnout.mismatch.turnout import HammerInput, PassageInput
from turnout.passage.cleaning import clean
from turnout.readers import read
from turnout.reasons import REASONS
from turnout.records import LongRecording, Recording, Rejection, Unit
from turnout.signal.cleaning import without_artefacts
from turnout.simulate.turnout_track import position_by_mounting
from turnout.stages.copied_files import without_copies
from turnout.stages.layout_checks import position_fault
from turnout.stages.mismatch_trains import TrainUnknownError, train_notes, train_of
from turnout.stages.passage import PassageContext, passage_unit, sensors_of, trains_in
from turnout.stages.passage_context import known_patterns
from turnout.stages.recording_notes import doubt_of_rail_temperature, noted_rail_temperature, rail_temperature
from turnout.workflow.current_results import current_results
from turnout.workflow.scan import unit_id

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from turnout.records import RawDescription
    from turnout.simulate import Track, TurnoutTrack

MAX_CLIPPED_SHARE = 0.002  # share of clipped samples that leaves the band of the diagnosis unchanged
MAX_SIMILAR_PASSAGES = 16  # similar passages per visit: twice the limit of a case
UNUSABLE_REASONS = ("clipped", "dead_channel", "not_finite", "sensor_lost", "drop_out", "channels_swapped")


@dataclass(frozen=True)
class Note:
    """Why something was not used or is doubted: ``text``, and the name of the ``passage`` if it concerns one.

    ``fault`` is the reason code of a fault in a file and the channel, "" for all: records may share a fault.
    ``contradicted_train`` is the train whose vehicle file the axles of the passage contradict, if any.
    """

    text: str
    passage: str | None = None
    fault: tuple[str, str] | None = None
    contradicted_train: str = ""

    def __str__(self) -> str:
        return self.text if self.passage is None else f"passage {self.passage}: {self.text}"


@dataclass
class VisitInputs:
    """Usable hammer ``tests`` and ``passages`` of a visit, and ``notes`` on the rest; ``sections`` by test name."""

    tests: list[HammerInput] = field(default_factory=list)
    sections: dict[str, str] = field(default_factory=dict)
    passages: list[PassageInput] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)

    def digest_content(self) -> list:
        """Content of the digest: all notes and passage results that a diagnosis depends on."""
        tests = [[t.name, t.place, t.conditions] for t in self.tests]
        vehicles: list[Any] = [p.vehicle for p in self.passages]
        loads = [[float(load) for load in v.static_loads] for v in vehicles]
        trains = [[p.name, p.train, p.speed, p.direction, p.route, p.conditions] for p in self.passages]
        return [tests, trains, loads, [str(note) for note in self.notes]]


def gather_inputs(
    units: Iterable[Unit],
    turnout: TurnoutConfig,
    raw_root: str | Path,
    track: TurnoutTrack,
    passage_tables: Mapping[str, dict],
) -> VisitInputs:
    """Read all units of a visit. Copies of a file are left out with a note.

    ``track`` is the TurnoutTrack, ``passage_tables`` are the tables of the passage stage by unit.

    Parameters
    ----------
    units : iterable of Unit
        Hammer tests and passages of the visit.
    turnout : TurnoutConfig
        Configuration of the turnout.
    raw_root : path
        Folder of all recordings.
    track : TurnoutTrack
        Its track file.
    passage_tables : mapping
        Tables of the passage stage by unit.

    Returns
    -------
    VisitInputs
    """
    distinct, copies = without_copies(units, raw_root)
    inputs = VisitInputs(notes=[Note(copy) for copy in copies])
    for unit in distinct:
        if unit.kind == "hammer" and turnout.hammer is not None:
            _add_test(unit, turnout, raw_root, track, inputs)
        elif unit.kind == "passage" and turnout.passages is not None:
            tables = passage_tables.get(unit_id(unit)) or _analyse_passages(unit, turnout, raw_root)
            _add_passages(unit, turnout, raw_root, track, tables, inputs)
    inputs.notes = _once_per_fault(inputs.notes)
    return inputs


def _once_per_fault(notes: Sequence[Note]) -> list[Note]:
    """The first note of each fault, with the number of other records that have it, and all notes without one."""
    counts, merged = Counter(note.fault for note in notes), dict[Any, Note]()
    for i, note in enumerate(notes):
        merged.setdefault(note.fault or i, note)
    return [
        replace(n, text=f"{n.text} Other records with this fault: {counts[n.fault] - 1}.")
        if n.fault is not None and counts[n.fault] > 1
        else n
        for n in merged.values()
    ]


def _recordings(
    unit: Unit, description: RawDescription, raw_root: str | Path, notes: list[Note], longest: float | None = None
) -> Iterator[Recording | LongRecording]:
    """Recordings of a unit, long ones included; read errors are added to ``notes``."""
    for path, *_ in unit.files:
        try:
            result = read(path, raw_root, description, longest)
        except ReadError as error:
            notes.append(_note_of(error))
            continue
        notes += [_note_of(e) for e in result.errors]
        records: list[Recording | LongRecording] = [*result.recordings, *result.long_recordings]
        yield from sorted(records, key=lambda r: r.record)


def _add_test(
    unit: Unit, turnout: TurnoutConfig, raw_root: str | Path, track: TurnoutTrack, inputs: VisitInputs
) -> None:
    section, day, hammer = str(unit.section), str(unit.campaign), turnout.hammer
    assert hammer is not None
    # any response will do: that of the section is not needed
    description = replace(hammer.descriptions[section], required=(hammer.force[section],))
    records = _recordings(unit, description, raw_root, inputs.notes)
    recordings = []
    for record in records:
        if isinstance(record, Recording):  # without a limit none is a long one
            clean_recording, removed = without_artefacts(record)
            recordings.append(clean_recording)
            inputs.notes += map(_note_of_removed, removed)
    if not recordings:
        return
    position = float(turnout.section(section).position)
    if fault := position_fault(section, position, track):
        inputs.notes.append(Note(fault))
        return
    campaign = turnout.campaigns[day]
    temperature = rail_temperature(recordings) if campaign.rail_temperature is None else campaign.rail_temperature
    conditions = {} if temperature is None else {"rail_temperature": temperature}
    name = f"{section} {day}"
    force = hammer.force[section]
    positioned = tuple(_with_positions(r, position, track.track) for r in recordings)
    receptance_settings = turnout.settings["receptance"]
    inputs.tests.append(HammerInput(name, position, positioned, force, day, conditions, receptance_settings))
    inputs.sections[name] = section


def _with_positions(recording: Recording, position: float, track: Track) -> Recording:
    """The recording with positions for accelerometers that have none: at the impact, or half a bay further."""
    channels = tuple(
        c
        if c.quantity != "acceleration" or c.position is not None
        else replace(c, position=position_by_mounting(track, position, c.mounting))
        for c in recording.channels
    )
    return replace(recording, channels=channels)


def _analyse_passages(unit: Unit, turnout: TurnoutConfig, raw_root: str | Path) -> dict[str, list[dict]]:
    """Tables that the passage stage would compute."""
    path = Path(turnout.settings["passage"].axle_patterns)
    if not path.is_file():
        path = Path(turnout.folder) / "vehicles" / path.name
    patterns = known_patterns(str(path)) if path.is_file() else ()
    return passage_unit(unit, turnout, raw_root, PassageContext(patterns=patterns))


def _add_passages(
    unit: Unit,
    turnout: TurnoutConfig,
    raw_root: str | Path,
    track: TurnoutTrack,
    tables: Mapping[str, list[dict]],
    inputs: VisitInputs,
) -> None:
    """Add the trains of a unit, each with its row of the passage stage.

    If the numbers of trains and rows differ, the rows are not used, with a note: they cannot be assigned.
    """
    rows, quarantine = tables["passages"], tables["quarantine"]
    unit_inputs, n = _read_passages(unit, turnout, raw_root, track, rows, quarantine)
    if n != len(rows):
        unit_inputs, _ = _read_passages(unit, turnout, raw_root, track, [{}] * n, quarantine)
        message = (
            f"{n} trains in it, {len(rows)} where passages were analysed: what was found of them there is not used"
        )
        unit_inputs.notes.insert(0, Note(f"{_passage_name(unit)}: {message}"))
    inputs.notes += [note for note in unit_inputs.notes if note.fault or note not in inputs.notes]
    for passage in unit_inputs.passages:
        inputs.passages.append(passage)
        _thin_out(inputs.passages)


def _passage_name(unit: Unit) -> str:
    return unit_id(unit).split("/", 2)[-1]


def _read_passages(
    unit: Unit,
    turnout: TurnoutConfig,
    raw_root: str | Path,
    track: TurnoutTrack,
    rows: Sequence[Mapping[str, Any]],
    quarantine: Sequence[Mapping[str, Any]],
) -> tuple[VisitInputs, int]:
    """(VisitInputs of a unit's trains, number of trains); a long recording is never loaded as a whole."""
    inputs, n = VisitInputs(), 0
    for recording in _trains(unit, turnout, raw_root, inputs.notes):
        name = _passage_name(unit) + (f":{n}" if len(rows) > 1 else "")
        row = rows[n] if n < len(rows) else {}
        rivals = [r for r in rows if r is not row]
        conditions = train_notes(row, rivals, recording, turnout, unit.files[0][0], raw_root)
        passage = _passage_input(name, recording, row, conditions, turnout, track, quarantine, inputs.notes)
        n += 1
        if passage is not None:
            inputs.passages.append(passage)
            _thin_out(inputs.passages)
    return inputs, n


def _passage_input(
    name: str,
    recording: Recording,
    row: Mapping[str, Any],
    conditions: Mapping[str, Any],
    turnout: TurnoutConfig,
    track: TurnoutTrack,
    quarantine: Sequence[Mapping[str, Any]],
    notes: list[Note],
) -> PassageInput | None:
    """Passage of a train, None if it cannot be used; reasons and doubts are added to ``notes``."""
    unusable = {channel for q in quarantine if _is_unusable(q) for channel in q.get("channels") or ()}
    unusable |= _misplaced_sensors(turnout, track, notes)
    if "two_trains" in (row.get("reason_codes") or ()):
        notes.append(Note("two trains at the same time, not used", name))
        return None
    try:
        train = train_of(row, conditions, Path(turnout.folder) / "vehicles")
    except TrainUnknownError as error:
        notes.append(Note(str(error), name, contradicted_train=error.train))
        return None
    has_diverging = any(s.track == "diverging" for s in turnout.sections)
    notes += [Note(doubt, name) for doubt in (*train.doubts, *(train.route_doubts if has_diverging else ()))]
    if doubt := doubt_of_rail_temperature(recording.conditions):
        notes.append(Note(doubt, name, fault=("condition_lost", "rail_temperature")))
    usable = _usable_channels(recording, turnout, train.route, unusable)
    if excluded := sorted(unusable & {c.name for c in recording.channels}):
        notes.append(Note(f"channels {', '.join(excluded)} not used{_reasons_text(quarantine)}", name))
    if not usable.channels:
        notes.append(Note(f"no usable channel on the {train.route} track", name))
        return None
    heading = train.direction, train.route
    return PassageInput(
        name, usable, train.vehicle, train.speed, train.name, *heading, _passage_conditions(row, usable), train.load_sd
    )


def _trains(unit: Unit, turnout: TurnoutConfig, raw_root: str | Path, notes: list[Note]) -> Iterator[Recording]:
    """Recordings of a unit, continuous ones cut into trains as in the passage stage."""
    settings, sensors = turnout.settings["passage"], sensors_of(turnout)
    assert turnout.passages is not None
    for recording in _recordings(unit, turnout.passages.description, raw_root, notes, settings.longest):
        try:
            for train_recording, *_ in trains_in(recording, settings):
                clean_recording, removed = clean(train_recording, sensors)
                notes += map(_note_of_removed, removed)
                yield clean_recording
        except ReadError as error:
            notes.append(_note_of(error))


def _note_of_removed(finding: Rejection) -> Note:
    return Note(f"{REASONS[finding.reason]} ({finding.detail}).", fault=(finding.reason, finding.channel or ""))


def _note_of(error: Exception) -> Note:
    fault = (error.reason, error.where.partition(", channel ")[2]) if isinstance(error, ReadError) else None
    return Note(str(error), fault=fault)


def _thin_out(passages: list[PassageInput]) -> None:
    """Remove the train of middle speed if there are too many similar ones: memory is limited."""
    new = passages[-1]
    similar = [p for p in passages if _similarity_key(p) == _similarity_key(new)]
    if len(similar) > MAX_SIMILAR_PASSAGES:
        similar.sort(key=lambda p: p.speed)
        surplus = similar[len(similar) // 2]
        passages[:] = [p for p in passages if p is not surplus]


def _similarity_key(passage: PassageInput) -> tuple:
    channels = tuple(c.name for c in passage.recording.channels)
    return passage.train, passage.route, passage.direction, len(passage.vehicle.wheels), channels


def _is_unusable(row: Mapping[str, Any]) -> bool:
    """Whether the channel of a quarantine row cannot be used; a slightly clipped one can."""
    slightly = row["reason_code"] == "clipped" and (row.get("measured_value") or 1.0) < MAX_CLIPPED_SHARE
    return row["reason_code"] in UNUSABLE_REASONS and not slightly


def _misplaced_sensors(turnout: TurnoutConfig, track: TurnoutTrack, notes: list[Note]) -> set[str]:
    """Names of sensors whose position contradicts the track, with notes."""
    faults = {s.name: fault for s in sensors_of(turnout) if (fault := position_fault(s.section, s.position, track))}
    notes += [note for note in map(Note, faults.values()) if note not in notes]
    return set(faults)


def _reasons_text(quarantine: Sequence[Mapping[str, Any]]) -> str:
    codes = ", ".join(sorted({q["reason_code"] for q in quarantine if _is_unusable(q)}))
    return f" ({codes})" if codes else ""


def _passage_conditions(row: Mapping[str, Any], recording: Recording) -> dict[str, float]:
    temperature = row.get("rail_temperature_c")
    temperature = noted_rail_temperature(recording.conditions) if temperature is None else temperature
    return {} if temperature is None else {"rail_temperature": float(temperature)}


def _usable_channels(recording: Recording, turnout: TurnoutConfig, route: str, unusable: set[str]) -> Recording:
    """The recording with the usable channels of this route only, at their positions."""
    sensors = {s.name: s for s in sensors_of(turnout) if s.track in ("both", route) and s.name not in unusable}
    indices = [i for i, c in enumerate(recording.channels) if c.name in sensors]
    channels = tuple(
        replace(recording.channels[i], position=sensors[recording.channels[i].name].position) for i in indices
    )
    return replace(recording, samples=recording.samples[indices], channels=channels)


def mismatch_context(turnout: str, settings: Any = None, work: str | Path = "work") -> tuple[str, dict[str, dict]]:
    """Results of the passage stage of a turnout.

    Parameters
    ----------
    turnout : str
        Id of the turnout.
    settings : object
        Not used: all contexts have it.
    work : path
        Folder of intermediate results.

    Returns
    -------
    token : str
        It changes with the results.
    tables : dict
        Unit -> table -> rows.
    """
    tables = {}
    for result in current_results(work, "passage", turnout):
        if any("reason_codes" not in row for row in result.tables.get("passages", [])):
            continue
        tables[result.unit] = {k: result.tables.get(k, []) for k in ("passages", "quarantine")}
    ids = sorted(str(r.get("passage_id")) + str(r.get("status")) for t in tables.values() for r in t["passages"])
    return hashlib.sha256(json.dumps(ids).encode()).hexdigest()[:16], tables
