"""Stage hammer: registry rows of the hammer tests of one section and campaign."""

from __future__ import annotations

import unicodedata
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import scipy.signal  # noqa: F401 - each of the forked processes would load it at its first use otherwise

from turnout.config.filename_pattern import compile_pattern
from turnout.config.settings.identify import IdentifySettings
from turnout.config.settings.receptance import ReceptanceSettings
from turnout.config.turnout import HammerConfig, TurnoutConfig
from turnout.errors import ReadError
from turnout.hammer_test import find_impacts, receptance_of
from turnout.hammer_test.response_quality import find_track_impacts
from turnout.modal import identify
from turnout.records import Impact, ModalModel, RawDescription, Receptance, Recording, Rejection, Unit
from turnout.registry.ids import content_id
from turnout.signal.cleaning import is_notable, without_artefacts
from turnout.stages.filed_times import MAX_CAMPAIGN_OFFSET, MISFILED_REMEDY, time_contradiction
from turnout.stages.hammer_curve_rows import density_columns, receptance_row
from turnout.stages.hammer_responses import response_model, responses_of
from turnout.stages.hammer_rows import (
    impact_mode_row,
    impact_row,
    mode_row,
    mode_rows,
    model_row,
    shape_columns,
    validation_columns,
)
from turnout.stages.raw_files import quarantine_row, read_or_quarantine, recording_row
from turnout.stages.recording_notes import (
    rail_temperature,
)

# Largest value of the registry's column `test`.
MAX_TEST_NUMBER = 2**31 - 1
REMOVED_REMEDIES = {
    "spikes": "Nothing: they were replaced. Where they are frequent, look at the converter or the cable",
    "mains_hum": "Nothing: it was subtracted. Look at shields and earthing",
}


def hammer_unit(unit: Unit, turnout: TurnoutConfig, raw_root: str | Path, algo: str = "") -> dict[str, list[dict]]:
    """Rows by table for one section and campaign.

    An unreadable file or a damaged record becomes a quarantine row; the other records are used. A file whose time is
    not that of its campaign is used too, with a quarantine row. A rejected impact is a row with its reason. Too few
    impacts, a failed gate or no stable mode give a model row with status "rejected".

    Parameters
    ----------
    unit : Unit
        The test files of one section and campaign.
    turnout : TurnoutConfig
        Merged configuration of the turnout, with its campaigns.
    raw_root : path
        Folder that the paths of ``unit.files`` start from.
    algo : str
        Version of the code, part of the model's id.

    Returns
    -------
    dict of str to list of dict
        Table -> rows.

    Raises
    ------
    ValueError
        The unit has no section or campaign, or the turnout no hammer tests.
    """
    if unit.section is None or unit.campaign is None or turnout.hammer is None:
        raise ValueError(f"{unit.turnout}/{unit.label} is no unit of hammer tests")
    campaign = turnout.campaigns[unit.campaign]
    base = {
        "turnout_id": unit.turnout,
        "section_id": turnout.section_id(unit.section),
        "campaign_id": f"{unit.turnout}/{unit.campaign}",
    }
    rows: dict[str, list[dict]] = {"recordings": [], "impacts": [], "quarantine": []}
    force, response = turnout.hammer.force[unit.section], turnout.hammer.response[unit.section]
    description = turnout.hammer.descriptions[unit.section]
    recordings, ids = _read_recordings(unit, (campaign.started_at, description), raw_root, base, rows)
    if not rows["recordings"]:
        return _response_rows(unit, turnout, Path(raw_root), algo, base, rows)
    recordings = _with_common_rate(recordings, base, rows["quarantine"], ids)
    # all impacts of the campaign at once: a fault of a whole file shows in comparison with the others
    found = find_track_impacts(recordings, force, response, turnout.settings["receptance"])
    settings = turnout.settings
    second = _second_response(recordings, turnout.hammer, unit.section, settings["receptance"])
    is_joint = settings["identify"].second_response == settings["identify"].method == "joint"
    impacts, receptance, model = identify_accepted(
        found, settings["receptance"], settings["identify"], second if is_joint else {}
    )
    tests = {path: _test_number(turnout, unit, path) for path in ids}
    rows["impacts"] = [impact_row(i, base, tests[i.source], ids[i.source]) for i in impacts]
    temperature = campaign.rail_temperature
    if temperature is None:
        temperature = rail_temperature(recordings)
    identity = _identity(rows, unit, base, algo, campaign.started_at, temperature)
    # a response that took part in the identification validates nothing
    return rows | _model_rows(
        model, receptance, impacts, (base, identity, temperature), ids, second, turnout, validates=not is_joint
    )


def _read_recordings(
    unit: Unit,
    promised: tuple[datetime | None, RawDescription],
    raw_root: str | Path,
    base: dict[str, Any],
    rows: dict[str, list[dict]],
) -> tuple[list[Recording], dict[str, str]]:
    """Recordings of the files of a unit, and the id of each file that was read; adds their rows to ``rows``.

    ``promised`` holds the time of the campaign and the description of the files.
    """
    started_at, description = promised
    recordings: list[Recording] = []
    ids: dict[str, str] = {}
    for path, size, _ in unit.files:
        result = read_or_quarantine(path, raw_root, description, base, rows["quarantine"], "hammer", ids)
        if result is not None:
            ids[path] = result.sha256[:32]
            wrong = time_contradiction(
                path, result.recordings, started_at, MAX_CAMPAIGN_OFFSET, MISFILED_REMEDY, "start_unknown"
            )
            if wrong is not None:
                rows["quarantine"].append(quarantine_row(wrong, base, "hammer", "hammer", None, ids[path]))
            rows["recordings"].append(recording_row(result, path, size, description, base, "hammer"))
            for recording in result.recordings:
                clean_recording, removed = without_artefacts(recording)
                recordings.append(clean_recording)
                rows["quarantine"] += (_removed_row(r, recording, base, ids[path]) for r in removed if is_notable(r))
    return recordings, ids


def _removed_row(
    finding: Rejection, recording: Recording, base: Mapping[str, Any], recording_id: str
) -> dict[str, Any]:
    """Row of ``quarantine`` for what was removed from a record; the record is used."""
    where = f"record {recording.record + 1}" + (f", channel {finding.channel}" if finding.channel else "")
    error = ReadError(recording.source, where, finding.detail, REMOVED_REMEDIES[finding.reason], finding.reason)
    row = quarantine_row(error, base, "hammer", "hammer", recording.record, recording_id)
    return row | {"measured_value": finding.value, "channels": list(finding.channels) or None}


def _model_rows(
    model: ModalModel,
    receptance: Receptance | None,
    impacts: Sequence[Impact],
    identification: tuple[dict[str, Any], dict[str, Any], float | None],
    ids: Mapping[str, str],
    second: Mapping[tuple[str, int], Impact],
    turnout: TurnoutConfig,
    validates: bool,
) -> dict[str, list[dict]]:
    """Rows of a model, its modes and its receptance; ``validates`` if the second response took no part in it."""
    base, identity, temperature = identification
    used = [i for i in impacts if i.accepted]
    counts = len(used), len(impacts) - len(used)
    if receptance is None:
        return {"models": [model_row(model, base, identity, counts, None)], "modes": []}
    settings, required = turnout.settings["identify"], turnout.settings["receptance"].gate_level
    names = [f"{ids[i.source]}:{i.record}" for i in used]
    pairs = [(i, second[key]) for i in used if (key := (i.source, i.record)) in second]
    validation = [pair[1] for pair in pairs] if validates else []
    model_columns = model_row(model, base, identity, counts, _lowest_gate_level(receptance, model))
    receptance_columns = receptance_row(receptance, required, model, used[0].decay, base, identity)
    shapes = shape_columns(model, _cut_pairs(pairs, settings))
    modes = mode_rows(model, receptance, base, identity, temperature)
    return {
        "models": [model_columns | validation_columns(model, _cut(validation, settings))],
        "modes": [mode | shape for mode, shape in zip(modes, shapes, strict=True)],
        "impact_modes": [impact_mode_row(e, base, identity, names[e["impact"]]) for e in model.per_impact],
        "receptances": [receptance_columns | density_columns(used, receptance_columns["frequency_hz"])],
    }


def _second_response(
    recordings: Sequence[Recording], hammer: HammerConfig, section: str, settings: ReceptanceSettings
) -> dict[tuple[str, int], Impact]:
    """The accepted impacts on the second response by source and record; empty where the layout or a file has none."""
    channel = hammer.validation.get(section)
    if channel is None or any(channel not in [c.name for c in r.channels] for r in recordings):
        return {}
    impacts = find_impacts(recordings, hammer.force[section], channel, settings)
    return {(i.source, i.record): i for i in impacts if i.accepted}


def _cut(impacts: Sequence[Impact], settings: IdentifySettings) -> list[Impact]:
    """The impacts whose decay is long enough, cut at the length that the identification uses."""
    shortest = settings.shortest_decay
    ends = [(i, i.decay_start + round(settings.duration * i.rate)) for i in impacts]
    return [replace(i, acceleration=i.acceleration[:end]) for i, end in ends if len(i.decay) >= shortest * i.rate]


def _cut_pairs(pairs: Sequence[tuple[Impact, Impact]], settings: IdentifySettings) -> list[tuple[Impact, Impact]]:
    """The pairs of which both decays are long enough, cut at the length that the identification uses."""
    cuts = (_cut(pair, settings) for pair in pairs)
    return [(cut[0], cut[1]) for cut in cuts if len(cut) == 2]


def _identity(
    rows: Mapping[str, list[dict]],
    unit: Unit,
    base: Mapping[str, Any],
    algo: str,
    started_at: datetime | None,
    temperature: float | None,
) -> dict[str, Any]:
    """Columns that a model and its modes share."""
    inputs = sorted(r["recording_id"] for r in rows["recordings"])
    return {
        "model_id": content_id("model", *inputs, base["section_id"], unit.config_hash, algo, started_at, temperature),
        "measured_at_utc": started_at,
        "code_version": algo,
        "config_hash": unit.config_hash,
    }


def _response_rows(
    unit: Unit, turnout: TurnoutConfig, raw_root: Path, algo: str, base: dict[str, Any], rows: dict[str, list[dict]]
) -> dict[str, list[dict]]:
    """Rows of a unit without recordings: with a model where its files hold frequency responses."""
    files = [(path, size) for path, size, _ in unit.files]
    responses, rows["recordings"] = responses_of(files, raw_root, base, rows["quarantine"])
    if responses is None:
        return rows
    campaign = turnout.campaigns[str(unit.campaign)]
    model, detail = response_model(responses, turnout.settings["identify"])
    identity = _identity(rows, unit, base, algo, campaign.started_at, campaign.rail_temperature)
    row = model_row(model, base, identity, (0, 0), None) | {"sampling_rate_hz": None, "detail": detail}
    return rows | {
        "models": [row],
        "modes": [mode_row(mode, base, identity, campaign.rail_temperature) for mode in model.modes],
    }


def hammer_config(turnout: TurnoutConfig) -> HammerConfig:
    """The hammer configuration of a turnout.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.

    Returns
    -------
    HammerConfig
        Files and channels of its hammer tests.

    Raises
    ------
    ValueError
        It has no hammer tests.
    """
    if turnout.hammer is None:
        raise ValueError(f"{turnout.id} has no hammer tests in its configuration")
    return turnout.hammer


def _with_common_rate(
    recordings: Sequence[Recording], base: Mapping[str, Any], quarantine: list[dict[str, Any]], ids: Mapping[str, str]
) -> list[Recording]:
    """Recordings of the most common sampling rate; a quarantine row for each file of another rate."""
    rates = Counter(_round_rate(r.rate) for r in recordings)
    common_rate = max(rates, key=lambda rate: (rates[rate], rate))
    for path in sorted({r.source for r in recordings if _round_rate(r.rate) != common_rate}):
        rate = next(r.rate for r in recordings if r.source == path and _round_rate(r.rate) != common_rate)
        observation, remedy = (
            f"{rate:g} Hz, the others {common_rate:g} Hz",
            "Record all tests of a campaign at one rate",
        )
        error = ReadError(path, "the file", observation, remedy, "wrong_rate")
        quarantine.append(quarantine_row(error, base, "hammer", "hammer", None, ids[path]))
    selected = [r for r in recordings if _round_rate(r.rate) == common_rate]
    rate = float(np.median([r.rate for r in selected]))
    return [r if r.rate == rate else replace(r, rate=rate) for r in selected]


def _round_rate(rate: float) -> float:
    """Sampling rate rounded to six digits: times printed in a file are no more exact."""
    return float(f"{rate:.6g}")


def identify_accepted(
    impacts: Sequence[Impact],
    receptance_settings: ReceptanceSettings,
    identify_settings: IdentifySettings,
    second: Mapping[tuple[str, int], Impact] | None = None,
) -> tuple[Sequence[Impact], Receptance | None, ModalModel]:
    """Receptance and modes of one section from its accepted impacts.

    Impacts that the model does not describe are rejected, and the rest is fitted again.

    Parameters
    ----------
    impacts : sequence of Impact
        All impacts of the section, rejected ones included.
    receptance_settings : ReceptanceSettings
    identify_settings : IdentifySettings
    second : mapping of (str, int) to Impact, optional
        A second response to the impacts by source and record. It is used where all used impacts have it.

    Returns
    -------
    impacts : sequence of Impact
        The same, with the further rejections.
    receptance : Receptance or None
        None with fewer accepted impacts than ``minimum_impacts``.
    model : ModalModel
        Rejected where there are too few impacts or no modes.
    """
    n_required = receptance_settings.minimum_impacts
    while True:
        used = [i for i in impacts if i.accepted]
        if len(used) < n_required:
            return impacts, None, _rejected_model(len(used), n_required, impacts)
        receptance = receptance_of(used, receptance_settings)
        options: dict[str, Any] = {}
        if identify_settings.method == "paper":
            options = {"leads": [i.acceleration[: i.decay_start] for i in used]}
        elif second and all((i.source, i.record) in second for i in used):
            options = {"second": [second[i.source, i.record].decay for i in used]}
        model = identify([i.decay for i in used], used[0].rate, identify_settings, receptance, **options)
        rejected = {id(used[k]): rejection for k, rejection in model.diagnostics.get("rejected_impacts", ())}
        if not rejected:
            return impacts, receptance, model
        impacts = [replace(i, rejections=(rejected[id(i)],)) if id(i) in rejected else i for i in impacts]


def _test_number(turnout: TurnoutConfig, unit: Unit, path: str) -> int:
    """Number of the test from the file's name; 0 if the name has no number there."""
    inside = str(PurePosixPath(path).relative_to(turnout.raw))
    labels = tuple(s.label for s in turnout.sections)
    match = compile_pattern(hammer_config(turnout).files, "hammer", labels).fullmatch(
        unicodedata.normalize("NFC", inside)
    )
    number = (match.groupdict().get("test") or "0") if match else "0"
    return int(number) if number.isdigit() and int(number) <= MAX_TEST_NUMBER else 0


def _rejected_model(n: int, n_required: int, impacts: Sequence[Impact]) -> ModalModel:
    """A rejected model without modes, with the number of accepted impacts and the reasons of the others."""
    reasons = sorted({r.reason for i in impacts for r in i.rejections})
    detail = f"{n} of {len(impacts)} impacts accepted, {n_required} needed"
    if reasons:
        detail += f"; rejected for {', '.join(reasons)}"
    rejection = Rejection("too_few_impacts", float(n), float(n_required), detail)
    empty = np.zeros(0)
    return ModalModel(
        np.zeros((0, 0)), empty, empty, impacts[0].rate if impacts else 1.0, (), status="rejected",
        rejections=(rejection,),
    )  # fmt: skip


def _lowest_gate_level(receptance: Receptance, model: ModalModel) -> float | None:
    """Lowest gate level within the half-power bandwidths of the modes, None without modes."""
    lowest = []
    for mode in model.modes:
        half_bandwidth = max(mode.damping, 0.02) * mode.frequency
        in_band = np.abs(receptance.frequency - mode.frequency) <= half_bandwidth
        if in_band.any():
            lowest.append(float(np.nanmin(receptance.gate_level[in_band])))
    return min(lowest) if lowest else None
