"""Registry rows of a passage and its fits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from turnout.config import TurnoutConfig
from turnout.constants import KMH
from turnout.errors import ReadError
from turnout.passage.axle_load import LoadFinding
from turnout.passage.channel_fit import ChannelFit
from turnout.passage.result import Passage, PassageSensor
from turnout.passage.timetable import ListedTrain
from turnout.passage.train_type import UNKNOWN
from turnout.records import Rejection
from turnout.signal.cleaning import is_notable
from turnout.stages.raw_files import quarantine_row
from turnout.stages.recording_notes import noted_number, noted_rail_temperature

TIME_DIGITS = 5  # of a wheel's time in seconds: a fifth of a sample at 20 kHz

SUBJECTS = {"interference": "all channels", "mains_hum": "most channels"}
REMEDIES = {
    "no_train": "Delete the file, or look why the logger was triggered",
    "clipped": "Raise the range of the channel",
    "dead_channel": "Look at the sensor and its cable",
    "not_finite": "Export the file again without gaps",
    "sensor_lost": "Look at the sensor and its cable",
    "drop_out": "Look at the radio link, or at the buffer of the logger",
    "interference": "Nothing: they were cut out. Where they come with many trains, look at shields and earthing",
    "spikes": "Nothing: they were replaced. Where they come with many trains, look at the converter or radio link",
    "mains_hum": "Nothing: it was subtracted. Where it is strong, look at shields and earthing",
    "channels_swapped": "Exchange the two channels in the layout, or at the logger",
    "clock_drift": "Synchronise the loggers, or correct the sensor's position or channel in the layout",
    "two_trains": "Nothing: the passage is used as far as it is sound",
    "train_cut_off": "Let the logger start earlier or run longer",
}


def finding_rows(
    passage: Passage, base: Mapping[str, Any], path: str, record: int, recording_id: str
) -> list[dict[str, Any]]:
    """Rows of ``quarantine`` for unused data: the whole record, or single channels.

    Parameters
    ----------
    passage : Passage
        One passage.
    base : mapping of str to any
        Column turnout_id.
    path : str
        Path of the file.
    record : int
        Number of the record, from 0.
    recording_id : str
        Id of the file's content.

    Returns
    -------
    list of dict
        One row per finding.
    """
    rows: list[dict] = []
    for finding in passage.findings:
        is_whole_record = finding.reason in ("no_train", "two_trains", "train_cut_off")
        if (is_whole_record and passage.status != "rejected") or not is_notable(finding):
            continue
        place = f"record {record + 1}" if is_whole_record else f"record {record + 1}, {_subject(finding)}"
        remedy = REMEDIES.get(finding.reason, "Look at the recording")
        error = ReadError(path, place, finding.detail or finding.reason, remedy, finding.reason)
        row = quarantine_row(error, base, "passage", "passage", record, recording_id)
        row |= {"measured_value": _plain(finding.value), "threshold": _plain(finding.limit)}
        row["channels"] = list(finding.channels) or None
        row["quarantine_id"] = row["quarantine_id"][:-4] + f"{len(rows):04x}"
        rows.append(row)
    return rows


def _subject(finding: Rejection) -> str:
    """The part of a record that a finding concerns: its channels, all channels, or what is uncertain, in words."""
    if finding.channels:
        return " and ".join(finding.channels)
    return SUBJECTS.get(finding.reason, finding.detail)


def passage_row(
    passage: Passage,
    identity: Mapping[str, Any],
    listed: ListedTrain | None,
    load: LoadFinding | None,
    conditions: Mapping[str, Any],
) -> dict[str, Any]:
    """Row of ``passages``: values from the recording and the train data, and their differences.

    Parameters
    ----------
    passage : Passage
        One passage.
    identity : mapping of str to any
        Columns turnout_id, recording_id and passed_at_utc.
    listed : ListedTrain or None
        The train in the train data.
    load : LoadFinding or None
        Axle load measured by the sensors.
    conditions : mapping of str to any
        Notes of the recording.

    Returns
    -------
    dict of str to any
        The row, without passage_id.
    """
    speed, type_ = passage.speed, passage.type
    row = {
        **identity,
        "status": passage.status,
        "reason": passage.reason,
        "n_axles": passage.n_axle,
        "direction": passage.direction,
        "track": passage.track,
        "rail_temperature_c": noted_rail_temperature(conditions),
        "axle_load_source": "unavailable",
    }
    remarks = [f.detail or f.reason for f in passage.findings]
    rail_temperature = noted_number(conditions, "rail_temperature")
    if rail_temperature is not None and noted_rail_temperature(conditions) is None:
        remarks.append(f"rail temperature {rail_temperature:g} °C noted, not used")
    if speed is not None and type_ is not None:
        row |= {
            "speed_kmh": KMH * float(speed.speed),
            "speed_se_kmh": KMH * float(speed.se),
            "acceleration_ms2": float(np.clip(speed.acceleration, -5, 5)),
            "speed_source": "recording",
            "axle_times_s": np.asarray(passage.times, dtype=float),
            "train_type": type_.type,
            "train_type_probability": float(type_.probability),
            "train_type_source": "recording",
        }
    if load is not None:
        row |= {"axle_load_t": load.mean, "axle_load_se_t": load.se, "axle_load_source": "recording"}
    if listed is not None and speed is not None:
        remarks += _enter_listed(row, listed)
    row["detail"] = "; ".join(remarks) or None
    return row


def _enter_listed(row: dict[str, Any], listed: ListedTrain) -> list[str]:
    """Enter the values of the train data, and return their differences from the recording in words."""
    remarks = []
    if listed.speed is not None:
        row |= {"speed_listed_kmh": listed.speed, "speed_source": "both"}
        difference = abs(listed.speed - row["speed_kmh"])
        if difference > max(3.0 * row["speed_se_kmh"], 0.02 * listed.speed):
            remarks.append(f"speed {row['speed_kmh']:.1f} km/h here, {listed.speed:g} in the train data")
    if listed.train_type is not None:
        row["train_type_listed"] = listed.train_type
        if row["train_type"] == UNKNOWN:
            row |= {"train_type": listed.train_type, "train_type_source": "timetable"}
        else:
            row["train_type_source"] = "both"
            if row["train_type"] != listed.train_type:
                remarks.append(f"type {row['train_type']} here, {listed.train_type} in the train data")
    if listed.axle_load is not None:
        row["axle_load_listed_t"] = listed.axle_load
        if row["axle_load_source"] == "unavailable":
            row |= {"axle_load_t": listed.axle_load, "axle_load_source": "timetable"}
        else:
            row["axle_load_source"] = "both"
            if abs(row["axle_load_t"] - listed.axle_load) > 3.0 * row["axle_load_se_t"]:
                remarks.append(f"axle load {row['axle_load_t']:.1f} t here, {listed.axle_load:g} in the train data")
    if listed.track is not None:
        if row["track"] == "unknown":
            row["track"] = listed.track
        elif row["track"] != listed.track:
            remarks.append(f"track {row['track']} here, {listed.track} in the train data")
    return remarks


def fit_row(
    fit: ChannelFit | None, sensor: PassageSensor, model_id: str, turnout: TurnoutConfig, identity: Mapping[str, Any]
) -> dict[str, Any]:
    """Row of ``passage_fits``.

    Parameters
    ----------
    fit : ChannelFit or None
        Fit of the channel, None if it cannot be fitted.
    sensor : PassageSensor
        The channel.
    model_id : str
        Id of the section's model.
    turnout : TurnoutConfig
        Configuration of the turnout.
    identity : mapping of str to any
        Column passed_at_utc.

    Returns
    -------
    dict of str to any
        The row, without passage_id.
    """
    row = {
        "section_id": turnout.section_id(sensor.section),
        "channel": sensor.name,
        "model_id": model_id,
        "turnout_id": turnout.id,
        "passed_at_utc": identity["passed_at_utc"],
        "status": fit.status if fit else "rejected",
        "n_wheels": len(fit.times) if fit else 0,
    }
    if fit is None:
        return row
    row["peak_ms2"] = _plain(fit.peak)
    if fit.scores is None or fit.test is None:
        return row
    null = fit.null
    row |= {
        "fit_pct": _plain(fit.scores.fit),
        "forecast_pct": _plain(fit.scores.forecast),
        "leave_one_out_pct": _plain(fit.scores.leave_one_out),
        "parameters_per_s": _plain(fit.parameters_per_second),
        "chi_squared_failed_share": fit.test.failed_share,
        "along_b_share": _plain(fit.test.along_share),
        "wheel_times_s": _round(fit.times, TIME_DIGITS),
        "wheel_amplitudes": _significant(fit.amplitudes),
        "wheel_amplitudes_se": _significant(fit.amplitudes_se),
    }
    skills = [skill for skill in fit.other_skills.values() if np.isfinite(skill)]
    row["forecast_others_pct"] = float(max(skills)) if skills else None
    if null is not None:
        row |= {
            "fit_null_pct": _plain(null.fit),
            "forecast_null_pct": _plain(null.forecast),
            "leave_one_out_null_pct": _plain(null.leave_one_out),
        }
    return row


def _round(values: np.ndarray, digits: int) -> list[float] | None:
    """Values to some decimals, None if one is not finite: the registry holds whole lists alone."""
    return [float(v) for v in np.round(values, digits)] if np.all(np.isfinite(values)) else None


def _significant(values: np.ndarray) -> list[float] | None:
    """Four significant digits of each value, None if one is not finite."""
    return [float(f"{v:.4g}") for v in values] if np.all(np.isfinite(values)) else None


def _plain(value: float | None) -> float | None:
    """A float, None if it is not finite."""
    return float(value) if value is not None and np.isfinite(value) else None
