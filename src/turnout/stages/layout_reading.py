"""Compare layouts with their raw files: one file of every section, and one of the passages, is read and judged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from turnout.config import TurnoutConfig
from turnout.counts import count_of, first_texts
from turnout.errors import ReadError
from turnout.hammer_test import receptance_of
from turnout.hammer_test.response_quality import find_track_impacts
from turnout.readers import read
from turnout.records import Impact, LongRecording, RawDescription, ReadResult, Recording, Rejection, Unit
from turnout.stages.filed_times import (
    MAX_CAMPAIGN_OFFSET,
    MAX_NAME_OFFSET,
    MISFILED_REMEDY,
    TIME_REMEDY,
    time_contradiction,
    time_of_label,
)
from turnout.stages.recording_notes import rail_temperature
from turnout.units import SI

STIFFNESS_BAND = (80.0, 300.0)  # Hz, of the printed dynamic stiffness
# Rejections of impacts that a wrong layout may cause.
LAYOUT_REASONS = ("out_of_scale", "sign_reversed", "dead_channel", "no_impact", "not_simultaneous", "overload")
MAX_NAMED_DAYS = 3  # in a message
MAX_TEMPERATURE_DIFFERENCE = 15.0  # °C, of one rail within the day of a campaign
MAX_TRAIN_ACCELERATION = 5e4  # m/s²: more than any sensor on a rail withstands
MIN_TRAIN_ACCELERATION = 0.05  # m/s²: less than the quiet trains at the farthest sensor
SCALE_REMEDY = "Look at unit, sensitivity and sensitivity_unit of {channels}"


@dataclass(frozen=True)
class FileReading:
    """What the reading of one file by its layout gave: ``faults`` is empty where both agree."""

    turnout: str
    section: str
    path: str
    text: str
    faults: tuple[str, ...]


def file_readings(
    turnout: TurnoutConfig, raw_root: Path, units: Sequence[Unit], paths_by_content: dict[str, str] | None = None
) -> Iterator[FileReading]:
    """Read the newest file of every section and of the passages, and compare it with the layout.

    Parameters
    ----------
    turnout : TurnoutConfig
        Merged configuration of the turnout.
    raw_root : Path
        Folder that the paths of the units start from.
    units : sequence of Unit
        Units of the turnout, from ``turnout.workflow.scan``.
    paths_by_content : dict of str to str or None
        Files read before, by sha256, to which these are added: the same bytes again are a fault.

    Yields
    ------
    FileReading
        One per section of hammer tests with files, and one of the passages.
    """
    hammer = {u.section: u for u in sorted(units, key=lambda u: str(u.campaign)) if u.kind == "hammer"}
    paths_by_content = {} if paths_by_content is None else paths_by_content
    for section, unit in hammer.items():
        if section is not None and turnout.hammer is not None and section in turnout.hammer.descriptions:
            description = turnout.hammer.descriptions[section]
            yield _read(turnout, section, unit, raw_root, description, paths_by_content)
    passages = [u for u in units if u.kind == "passage" and u.files]
    if passages and turnout.passages is not None:
        newest = max(passages, key=lambda u: u.label)
        yield _read(turnout, "passages", newest, raw_root, turnout.passages.description, paths_by_content)


def sections_without_files(turnout: TurnoutConfig, units: Sequence[Unit]) -> list[str]:
    """Labels of the sections of which no hammer test was found.

    Parameters
    ----------
    turnout : TurnoutConfig
        Merged configuration of the turnout.
    units : sequence of Unit
        Units of the turnout.

    Returns
    -------
    list of str
        In the order of the layout.
    """
    found = {u.section for u in units if u.kind == "hammer"}
    return [label for label in (turnout.hammer.descriptions if turnout.hammer else ()) if label not in found]


def _read(
    turnout: TurnoutConfig,
    section: str,
    unit: Unit,
    raw_root: Path,
    description: RawDescription,
    paths_by_content: dict[str, str],
) -> FileReading:
    """The reading of the first file of a unit; ``paths_by_content`` are the files that were read before."""
    path = unit.files[0][0]
    try:
        result = read(path, raw_root, description, turnout.settings["passage"].longest)
    except ReadError as error:
        return FileReading(turnout.id, section, path, "", (str(error),))
    faults = grouped_errors([*result.errors, *_filing_errors(turnout, unit, path, result)])
    if (same := paths_by_content.setdefault(result.sha256, path)) != path:
        faults.append(f"{path}, the file: same bytes as {same}. Put the file of each section in its place.")
    text = _contents_text(result)
    if description.kind == "hammer":
        more, found_events = _hammer_faults(turnout, section, path, result.recordings)
    else:
        more, found_events = _passage_faults(path, [*result.recordings, *result.long_recordings])
    return FileReading(turnout.id, section, path, f"{text}{found_events}", (*faults, *more))


@dataclass(frozen=True)
class LackOfTemperature:
    """A turnout without any rail temperature, as ``error``; certain if its newest recordings state none either."""

    error: ReadError
    is_certain: bool


def lack_of_temperature(turnout: TurnoutConfig, raw_root: Path, units: Sequence[Unit]) -> LackOfTemperature | None:
    """Whether no chart of a turnout can be evaluated, as none of its campaigns has a rail temperature.

    One file of the newest campaign is read if campaigns.csv has no temperature of a campaign with files.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout with its notes.
    raw_root : Path
        Folder that the paths of the units start from.
    units : sequence of Unit
        Units of the turnout.

    Returns
    -------
    LackOfTemperature or None
        None if a temperature is noted or recorded, or there is no hammer test.
    """
    descriptions = turnout.hammer.descriptions if turnout.hammer else {}
    tests = [unit for unit in units if unit.kind == "hammer" and unit.section in descriptions]
    days = {str(unit.campaign) for unit in tests}
    days_with_temperature = [
        day for day, campaign in turnout.campaigns.items() if campaign.rail_temperature is not None
    ]
    if not days or days.intersection(days_with_temperature):
        return None
    newest = max(tests, key=lambda unit: (str(unit.campaign), unit.label))
    is_certain = False
    try:
        recordings = read(newest.files[0][0], raw_root, descriptions[str(newest.section)]).recordings
        if rail_temperature(recordings) is not None:
            return None
        is_certain = bool(recordings)
    except ReadError:
        pass  # the nightly run puts the file into quarantine
    problem = "no column rail_temperature_c with values"
    if days_with_temperature:
        days_noted = first_texts(sorted(days_with_temperature), MAX_NAMED_DAYS)
        problem = f"it has a rail temperature of {days_noted} only, and no hammer file is of such a campaign"
    elif not (raw_root / turnout.raw / "campaigns.csv").is_file():
        problem = "there is no such file"
    if is_certain:
        problem += f", and the recordings of {newest.campaign} state no rail temperature"
    problem += ": charts do not evaluate a campaign without one"
    remedy = "Note them there" + ("" if is_certain else ", unless the recordings state them")
    return LackOfTemperature(
        ReadError(f"{turnout.raw}/campaigns.csv", "rail temperatures", problem, remedy), is_certain
    )


def _filing_errors(turnout: TurnoutConfig, unit: Unit, path: str, result: ReadResult) -> Iterator[ReadError]:
    """Errors where time and temperature in a file are not those that it is filed under."""
    records: list[Recording | LongRecording] = [*result.recordings, *result.long_recordings]
    if unit.kind != "hammer":
        if error := time_contradiction(path, records, time_of_label(unit.label), MAX_NAME_OFFSET, TIME_REMEDY):
            yield error
        return
    campaign = turnout.campaigns[str(unit.campaign)]
    if error := time_contradiction(path, records, campaign.started_at, MAX_CAMPAIGN_OFFSET, MISFILED_REMEDY):
        yield error
    temperature = rail_temperature(result.recordings)
    if temperature is None or campaign.rail_temperature is None:
        return
    if abs(temperature - campaign.rail_temperature) > MAX_TEMPERATURE_DIFFERENCE:
        problem = f"its rail temperature is {temperature:g} °C, that in campaigns.csv {campaign.rail_temperature:g} °C"
        yield ReadError(path, "the file", problem, "The one in campaigns.csv is used: correct what is wrong")


def grouped_errors(errors: Sequence[Exception]) -> list[str]:
    """Errors of a file as text; records with the same problem share one.

    Parameters
    ----------
    errors : sequence of Exception
        Errors of the reading of one file.

    Returns
    -------
    list of str
        One text for each problem, with its first place and the number of further ones.
    """
    groups: dict[tuple[str, str], list[ReadError]] = {}
    texts = [str(error) for error in errors if not isinstance(error, ReadError)]
    for error in errors:
        if isinstance(error, ReadError):
            groups.setdefault((error.problem, error.remedy), []).append(error)
    for (problem, remedy), group in groups.items():
        more = f" and {len(group) - 1} more" if len(group) > 1 else ""
        texts.append(f"{group[0].path}, {group[0].where}{more}: {problem}. {remedy}.")
    return texts


def _contents_text(result: ReadResult) -> str:
    records: list[Recording | LongRecording] = [*result.recordings, *result.long_recordings]
    if not records:
        return "no record"
    channels = ", ".join(f"{c.name} [{SI.get(c.quantity, '-')}]" for c in records[0].channels)
    return f"{count_of(len(records), 'record')} of {records[0].n_sample} samples at {records[0].rate:g} Hz, {channels}"


def _hammer_faults(
    turnout: TurnoutConfig, section: str, path: str, recordings: Sequence[Recording]
) -> tuple[list[str], str]:
    """(faults, what was found) of a hammer test that was read."""
    if turnout.hammer is None or not recordings:
        return [], ""
    force, response = turnout.hammer.force[section], turnout.hammer.response[section]
    settings = turnout.settings["receptance"]
    impacts = find_track_impacts(list(recordings), force, response, settings)
    first: dict[tuple[str, str], Rejection] = {}
    numbers: dict[tuple[str, str], list[int]] = {}
    for k, impact in enumerate(impacts, 1):
        for rejection in impact.rejections:
            if rejection.reason in LAYOUT_REASONS:
                key = rejection.reason, rejection.channel or ""
                first.setdefault(key, rejection)
                numbers.setdefault(key, []).append(k)
    faults = []
    for key, rejection in first.items():
        detail = rejection.detail or rejection.reason
        counted = f"{detail} (impact {numbers[key][0]})" if len(numbers[key]) > 1 else detail
        faults.append(f"{path}, {_impact_numbers(numbers[key])}: {counted}. {_remedy(rejection, force, response)}.")
    # the scale of the response is wrong in all impacts at once: the stiffness shows by which factor
    measured = [replace(i, rejections=tuple(r for r in i.rejections if r.channel != response)) for i in impacts]
    stiffness = median_stiffness(measured)
    low, high = STIFFNESS_BAND
    band_text = f", dynamic stiffness (median of {low:g} to {high:g} Hz)"
    stiffness_text = "" if stiffness is None else f"{band_text} {stiffness / 1e6:.3g} MN/m"
    return faults, f", {count_of(len(impacts), 'impact')}{stiffness_text}"


def _impact_numbers(numbers: Sequence[int]) -> str:
    return f"impact {numbers[0]}" if len(numbers) == 1 else f"impacts {', '.join(map(str, numbers))}"


def _remedy(rejection: Rejection, force: str, response: str) -> str:
    """What to look at in the layout; the sign of a channel that is reversed, else the scale of both."""
    if rejection.reason == "sign_reversed":
        return f"Look at 'sign' of {rejection.channel or force!r}: -1 reverses it"
    return SCALE_REMEDY.format(channels=f"{force!r} and {response!r}")


def median_stiffness(impacts: Sequence[Impact]) -> float | None:
    """Median dynamic stiffness over the band of the ballast resonance.

    Parameters
    ----------
    impacts : sequence of Impact
        Impacts of one section; rejected ones are left out.

    Returns
    -------
    float or None
        [N/m]; None without an accepted impact or a line in the band.
    """
    used = [impact for impact in impacts if impact.accepted]
    if not used:
        return None
    receptance = receptance_of(used)
    band = (receptance.frequency >= STIFFNESS_BAND[0]) & (receptance.frequency <= STIFFNESS_BAND[1])
    size = np.abs(receptance.h1[band])
    size = size[np.isfinite(size) & (size > 0.0)]
    return float(np.median(1.0 / size)) if size.size else None


def _passage_faults(path: str, records: Sequence[Recording | LongRecording]) -> tuple[list[str], str]:
    """(faults, what was found) of a passage that was read."""
    faults: list[str] = []
    peaks: dict[str, float] = {}
    for record in records:
        rows = record.of_quantity("acceleration")
        for block in record.blocks(10.0):
            for row in rows:
                name = record.channels[row].name
                peaks[name] = max(peaks.get(name, 0.0), float(np.max(np.abs(block[row]), initial=0.0)))
    for name, peak in peaks.items():
        if not MIN_TRAIN_ACCELERATION <= peak <= MAX_TRAIN_ACCELERATION:
            limits = f"{MIN_TRAIN_ACCELERATION:g} to {MAX_TRAIN_ACCELERATION:g}"
            remedy = SCALE_REMEDY.format(channels=repr(name))
            faults.append(f"{path}, channel {name!r}: its peak is {peak:.3g} m/s², trains cause {limits}. {remedy}.")
    shown = ", ".join(f"{name} {peak:.3g}" for name, peak in peaks.items())
    return faults, f", peaks [m/s²] {shown}" if shown else ""
