"""Compute the envelopes in which axles are sought, and find the sensors and the track on which the train is audible."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from turnout.passage.sensor_envelopes import SensorEnvelopes, levels

if TYPE_CHECKING:
    from collections.abc import Sequence


MIN_RANGE = 8.0  # of the level, over its scatter
MIN_POWER_RATIO = 0.01  # of the best third of the sensors; with less power a sensor is on the neighbouring track
MAX_LOUDNESS_LOSS = 1.0  # nepers of power above the quiet level, of a sensor that differs by its gain alone
QUIET_BLOCK = 0.05  # s over which a level is averaged


def sensor_envelopes(samples: np.ndarray, rate: float, positions: np.ndarray, step: float) -> SensorEnvelopes | None:
    """``SensorEnvelopes`` of the channels (n_sensor, n_sample), None where nothing is louder than the quiet parts.

    Parameters
    ----------
    samples : (n_sensor, n_sample) array of float
        Acceleration without offset. [m/s²]
    rate : float
        Sampling rate. [Hz]
    positions : (n_sensor,) array of float
        Positions of the sensors. [m]
    step : float
        Wanted length of a bin. [s]

    Returns
    -------
    SensorEnvelopes or None
        On one time grid.
    """
    band_levels = levels(samples, rate, step)
    step, n = band_levels.step, band_levels.n_bin
    per_bin = round(step * rate)
    slow = samples[:, : n * per_bin].reshape(samples.shape[0], n, per_bin).mean(axis=2)
    slow = slow - np.median(slow, axis=1, keepdims=True)
    is_audible = audible_bins(band_levels.values.mean(axis=0), step)
    if not is_audible.any():
        return None
    bins = np.flatnonzero(is_audible)
    return SensorEnvelopes(band_levels, slow, np.asarray(positions, float), bins[0] * step, (bins[-1] + 1) * step)


def audible_bins(level: np.ndarray, step: float) -> np.ndarray:
    """(n_bin,) bool: the level (n_bin,) over 50 ms is above a seventh of its range.

    All False where that range is below ``MIN_RANGE`` times the scatter of neighbouring blocks, or below half a neper:
    then only noise was recorded.

    Parameters
    ----------
    level : (n_bin,) array of float
        Level of a sensor, or the mean of several. [nepers of power]
    step : float
        Length of a bin. [s]

    Returns
    -------
    (n_bin,) array of bool
        True where the train is audible.
    """
    width = max(round(QUIET_BLOCK / step), 1)
    smooth = ndimage.uniform_filter1d(level, width)
    blocks = smooth[width // 2 :: width]
    low, high = np.quantile(blocks, 0.05), blocks.max()
    quiet = np.sort(blocks)[: max(len(blocks) // 3, 2)]
    scatter = np.median(np.abs(np.diff(blocks[np.isin(blocks, quiet)]))) / 0.954 if len(quiet) > 3 else 0.0
    if high - low < max(MIN_RANGE * scatter, 0.5):
        return np.zeros(len(level), dtype=bool)
    return smooth > low + (high - low) / 7.0


def restrict_to(envelopes: SensorEnvelopes, rows: np.ndarray) -> SensorEnvelopes:
    """Only the sensors ``rows``, with the begin and end of the train in their envelopes.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    rows : sequence of int
        Rows of the sensors.

    Returns
    -------
    SensorEnvelopes
        Begin and end as before where nothing is audible.
    """
    selected = envelopes.select(rows)
    bins = np.flatnonzero(audible_bins(selected.levels.values.mean(axis=0), selected.levels.step))
    if bins.size == 0:
        return selected
    return replace(selected, begin=bins[0] * selected.levels.step, end=(bins[-1] + 1) * selected.levels.step)


def loudness(envelopes: SensorEnvelopes) -> np.ndarray:
    """(n_sensor,) level over 50 ms that a tenth of the passage exceeds; 0 where a sensor records only noise.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.

    Returns
    -------
    (n_sensor,) array of float
        Level above the quiet one. [nepers of power]
    """
    step = envelopes.levels.step
    width = max(round(QUIET_BLOCK / step), 1)
    passage = slice(int(envelopes.begin / step), max(int(envelopes.end / step), 1))
    smooth = ndimage.uniform_filter1d(envelopes.levels.values, width, axis=1)
    loud = np.quantile(smooth[:, passage], 0.9, axis=1) - np.quantile(smooth, 0.05, axis=1)
    is_audible = np.array([audible_bins(row, step).any() for row in envelopes.levels.values])
    return np.where(is_audible, loud, 0.0)


def audible_sensors(envelopes: SensorEnvelopes, is_other_track: Sequence[bool] | None = None) -> np.ndarray:
    """Rows of the sensors that record the train: more than noise, and not from the neighbouring track.

    A sensor with a tenth of the amplitude of the best third is left out where it is also fainter over its own quiet
    level, or where the train is not on its track. A wrong gain alone is no reason: it changes the quiet level as much.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    is_other_track : (n_sensor,) sequence of bool or None
        True where a sensor measures only trains on the other track; None: not known, a faint sensor may do so.

    Returns
    -------
    (n,) array of int
        Rows, increasing.
    """
    loud = loudness(envelopes)
    is_loud = loud > 0.1
    if not is_loud.any():
        return np.flatnonzero(is_loud)
    power = envelopes.levels.loud_power
    best_power, best_loud = (np.quantile(values[is_loud], 0.7, method="higher") for values in (power, loud))
    is_remote = True if is_other_track is None else np.asarray(is_other_track) | (loud < best_loud - MAX_LOUDNESS_LOSS)
    return np.flatnonzero(is_loud & ~(is_remote & (power < MIN_POWER_RATIO * best_power)))


def train_track(envelopes: SensorEnvelopes, tracks: Sequence[str]) -> tuple[str, float]:
    """("main" | "diverging" | "unknown", difference): the track whose own sensors are the louder ones.

    The median of the sensors of a track counts, so that the gain of one of them alone does not decide.
    ``difference`` is in nepers of power; at least twice the amplitude, 1.4 nepers, is required. With sensors of one
    track only, that track is taken if they are not much fainter than the sensors of both tracks. If they record
    nothing, the other track is taken.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    tracks : sequence of str
        "main", "diverging" or "both" of each sensor.

    Returns
    -------
    track : str
        "main", "diverging" or "unknown".
    difference : float
        Difference between the tracks. [nepers of power]
    """
    track_names, is_audible = np.asarray(tracks), loudness(envelopes) > 0.1
    power = np.log(np.maximum(envelopes.levels.loud_power, 1e-300))
    mean = {
        name: float(np.median(audible)) if (audible := power[is_audible & (track_names == name)]).size else -np.inf
        for name in ("main", "diverging", "both")
        if np.any(track_names == name)
    }
    if "main" in mean and "diverging" in mean:
        difference = _difference(mean["main"], mean["diverging"])
        if abs(difference) < 1.4:
            return "unknown", difference
        return ("main" if difference > 0 else "diverging"), difference
    only = next((name for name in ("main", "diverging") if name in mean), None)
    if only is None:
        return "unknown", 0.0
    difference = _difference(mean[only], mean.get("both", mean[only]))
    if difference < -3.0:
        return ("diverging" if only == "main" else "main"), difference
    return only, difference


def _difference(first: float, second: float) -> float:
    """Difference of two logarithms, either of which may be that of silence."""
    return 0.0 if first == second else float(np.clip(first - second, -20.0, 20.0))
