"""Curves of a diagnosis as rows: waveform, spectrum, receptance and latent force, before and after."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from turnout.constants import Z95
from turnout.mismatch.engine.reserved_data import reserved_fit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from turnout.mismatch.engine.diagnose import Diagnosis
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.mismatch.turnout.receptance_observation import FrfPair

SHOWN_DURATION = 0.8  # s of waveform in a row
WELCH_SEGMENT = 0.5  # s: segment of Welch's estimate, 2 Hz lines
MIN_EXPLAINED_SHARE = 0.1  # least share of the latent force that a covariate explains
COVARIATES = {  # covariate of the latent force -> (text, unit)
    "displacement": ("displacement of the sleeper", "m"),
    "velocity": ("velocity of the sleeper", "m/s"),
    "position": ("nearest wheel from the sleeper", "m"),
    "time": ("time of the recording", "s"),
    "temperature": ("rail temperature", "°C"),
}
CORE_SHARES = (0.1, 0.9)  # shares of the cumulative gain between which a band is quoted


@dataclass(frozen=True)
class ChannelComparison:
    """One recording at one sensor, measured and predicted.

    ``time`` [s]; ``measured`` and the predictions ``before``, ``after``, ``rival`` [m/s²]; ``wheel``, the distance of
    the nearest wheel [m]; all (n,). ``held_out``: no fit used it.
    """

    recording: str
    sensor: str
    time: np.ndarray
    measured: np.ndarray
    before: np.ndarray
    after: np.ndarray
    rival: np.ndarray
    wheel: np.ndarray
    held_out: bool

    @property
    def gain(self) -> np.ndarray:
        """(n,) squared error before minus squared error after."""
        return (self.measured - self.before) ** 2 - (self.measured - self.after) ** 2


def channel_comparisons(case: TrackCase, diagnosis: Diagnosis) -> list[ChannelComparison]:
    """Comparison of every passage at every sensor, held out passages first.

    Parameters
    ----------
    case : TrackCase
        The case.
    diagnosis : Diagnosis
        Result of the engine.

    Returns
    -------
    list of ChannelComparison
        Held out passages first.
    """
    rival = _rival_fit(diagnosis)
    comparisons: list[ChannelComparison] = []
    if case.reserved:
        before, *further = (reserved_fit(case, fit)[0] for fit in _fits(diagnosis, rival))
        if before:
            comparisons += _comparisons(
                case, case.reserved, [before, *(predictions or before for predictions in further)], True
            )
    fitted = [fit.predictions for fit in _fits(diagnosis, rival)]
    return comparisons + _comparisons(case, case.observations, fitted, False)


def _rival_fit(diagnosis: Diagnosis) -> Fit | None:
    names = diagnosis.verdict.names[:1]
    return next((s.fit for s in diagnosis.verdict.scores if s.family not in names), None)


def _fits(diagnosis: Diagnosis, rival: Fit | None) -> tuple[Fit, Fit, Fit]:
    return diagnosis.base, diagnosis.fit, rival or diagnosis.base


def _comparisons(
    case: TrackCase, observations: Sequence[Observation], sets: Sequence[Sequence[np.ndarray]], held_out: bool
) -> list[ChannelComparison]:
    comparisons = []
    for k, o in enumerate(observations):
        aligned = case.aligned_passages.get(o.name)
        if aligned is None:
            continue
        n = aligned.time.size
        by_sensor = [np.reshape(values, (-1, n)) for values in (o.data, *(s[k] for s in sets))]
        wheel_positions = aligned.positions()
        for i, sensor in enumerate(aligned.sensors):
            wheel = np.min(np.abs(wheel_positions - sensor.place), axis=0)
            measured, before, after, rival = (r[i] for r in by_sensor)
            comparisons.append(
                ChannelComparison(o.name, sensor.name, aligned.time, measured, before, after, rival, wheel, held_out)
            )
    return comparisons


def best_comparison(
    comparisons: Sequence[ChannelComparison], case: TrackCase, diagnosis: Diagnosis
) -> ChannelComparison | None:
    """The comparison to draw: held out if possible, at the position or sensor of the finding, with the largest gain.

    Parameters
    ----------
    comparisons : sequence of ChannelComparison
        Every passage at every sensor.
    case : TrackCase
        The case.
    diagnosis : Diagnosis
        Result of the engine.

    Returns
    -------
    ChannelComparison or None
        None without passages.
    """
    if not comparisons:
        return None
    where = diagnosis.fit.candidates[0].where if diagnosis.fit.candidates else {}
    pool = [s for s in comparisons if s.held_out] or comparisons
    if where.get("sensor"):
        pool = [s for s in pool if s.sensor == where["sensor"]] or pool
    elif where.get("place") is not None:
        positions = {s.name: s.place for s in case.campaign.sensors}
        nearest = min((s.sensor for s in pool), key=lambda name: (abs(positions[name] - where["place"]), name))
        pool = [s for s in pool if s.sensor == nearest]
    changed = diagnosis.fit is not diagnosis.base
    return max(pool, key=lambda s: _relative_gain(s.gain if changed else (s.measured - s.before) ** 2, s.measured))


def _relative_gain(gain: np.ndarray, measured: np.ndarray) -> float:
    return float(np.sum(gain) / max(float(np.sum(measured**2)), 1e-30))


def spectra(comparison: ChannelComparison) -> tuple[np.ndarray, ...]:
    """One-sided power spectral densities by Welch's method.

    Parameters
    ----------
    comparison : ChannelComparison
        The recording and sensor that are drawn.

    Returns
    -------
    frequency : (n,) array of float
        [Hz]
    measured, before, after, rival : (n,) array of float
        [(m/s²)²/Hz]
    """
    rate = 1.0 / float(np.mean(np.diff(comparison.time)))
    size = min(comparison.time.size, round(WELCH_SEGMENT * rate))
    signals = (comparison.measured, comparison.before, comparison.after, comparison.rival)
    densities = [scipy.signal.welch(s, rate, nperseg=size) for s in signals]
    return densities[0][0], *(d[1] for d in densities)


def band_of(comparison: ChannelComparison | None, changed: bool) -> tuple[float, float] | None:
    """Band of four fifths of the explained power, else of the missing one.

    Parameters
    ----------
    comparison : ChannelComparison or None
        The recording and sensor that are drawn.
    changed : bool
        Whether an effect was fitted: then its gain counts, else the whole residual.

    Returns
    -------
    (float, float) or None
        Lowest and highest frequency [Hz]; None without a passage.
    """
    if comparison is None:
        return None
    rate = 1.0 / float(np.mean(np.diff(comparison.time)))
    size = min(comparison.time.size, round(WELCH_SEGMENT * rate))
    f, density = scipy.signal.welch(comparison.measured - comparison.before, rate, nperseg=size)
    if changed:
        density = np.maximum(
            density - scipy.signal.welch(comparison.measured - comparison.after, rate, nperseg=size)[1], 0.0
        )
    return _core_range(f, density)


def band_of_impacts(case: TrackCase, diagnosis: Diagnosis) -> tuple[float, float] | None:
    """The same band from the hammer tests.

    Parameters
    ----------
    case : TrackCase
        The case.
    diagnosis : Diagnosis
        Result of the engine.

    Returns
    -------
    (float, float) or None
        Lowest and highest frequency [Hz]; None if they gain less than the passages.
    """
    lines, weights, passage_gain = [], [], 0.0
    for k, o in enumerate(case.observations):
        gain = _gain_in_sigma(o, diagnosis, k)
        pair = case.frf_pairs.get(o.name)
        if pair is None:
            passage_gain += o.effective * float(gain.sum())
        else:
            lines.append(pair.frequency)
            weights.append(o.effective * gain.reshape(2, -1).sum(axis=0))
    if not lines or float(np.concatenate(weights).sum()) <= passage_gain:
        return None
    f, weight = np.concatenate(lines), np.maximum(np.concatenate(weights), 0.0)
    order = np.argsort(f, kind="stable")
    return _core_range(f[order], weight[order])


def _gain_in_sigma(o: Observation, diagnosis: Diagnosis, k: int) -> np.ndarray:
    """(n,) squared errors in units of sigma: explained by the term, else missing."""
    squares = ((o.data - diagnosis.base.predictions[k]) / o.sigma) ** 2
    if diagnosis.fit is diagnosis.base:
        return squares
    return squares - ((o.data - diagnosis.fit.predictions[k]) / o.sigma) ** 2


def reach_of(comparison: ChannelComparison | None, changed: bool) -> float | None:
    """Distance of the nearest wheel [m] within which four fifths of the gain (else of the error) occur.

    Parameters
    ----------
    comparison : ChannelComparison or None
        The recording and sensor that are drawn.
    changed : bool
        Whether an effect was fitted: then its gain counts, else the whole residual.

    Returns
    -------
    float or None
        [m]; None without a passage, or without a gain.
    """
    if comparison is None:
        return None
    gain = np.maximum(comparison.gain if changed else (comparison.measured - comparison.before) ** 2, 0.0)
    order = np.argsort(comparison.wheel)
    total = np.cumsum(gain[order])
    if not total[-1] > 0.0:
        return None
    return float(comparison.wheel[order][np.searchsorted(total, 0.8 * total[-1])])


def _core_range(x: np.ndarray, weight: np.ndarray) -> tuple[float, float] | None:
    total = np.cumsum(weight)
    if not total[-1] > 0.0:
        return None
    low, high = (float(x[min(np.searchsorted(total, share * total[-1]), x.size - 1)]) for share in CORE_SHARES)
    return low, high


def curve_rows(
    case: TrackCase, diagnosis: Diagnosis, comparison: ChannelComparison | None, identity: Mapping[str, Any]
) -> list[dict]:
    """Rows of ``mismatch_curves``.

    Parameters
    ----------
    case : TrackCase
        The case.
    diagnosis : Diagnosis
        Result of the engine.
    comparison : ChannelComparison or None
        The recording and sensor that are drawn.
    identity : mapping
        Columns that all rows have.

    Returns
    -------
    list of dict
    """
    rows = []
    if comparison is not None:
        window = _window(comparison, diagnosis.fit is not diagnosis.base)
        label = f"{comparison.recording} at {comparison.sensor}" + (
            ", held out of the fit" if comparison.held_out else ""
        )
        signals = (comparison.time, comparison.measured, comparison.before, comparison.after, comparison.rival)
        rows.append(_curve_row("waveform", label, ("time", "s"), "m/s²", [v[window] for v in signals], comparison))
        f, *densities = spectra(comparison)
        inside = (f >= 4.0) & (f <= 200.0)
        lines = [v[inside] for v in (f, *densities)]
        rows.append(_curve_row("spectrum", label, ("frequency", "Hz"), "(m/s²)²/Hz", lines, comparison))
    rows += _receptance_rows(case, diagnosis)
    rows += _latent_rows(diagnosis)
    return [{**identity, "curve_no": k, **r} for k, r in enumerate(rows)]


def _window(comparison: ChannelComparison, changed: bool) -> slice:
    """Slice of ``SHOWN_DURATION`` with the largest gain."""
    gain = comparison.gain if changed else (comparison.measured - comparison.before) ** 2
    n = min(comparison.time.size, round(SHOWN_DURATION / float(np.mean(np.diff(comparison.time)))))
    total = np.concatenate([[0.0], np.cumsum(gain)])
    start = int(np.argmax(total[n:] - total[:-n])) if n < comparison.time.size else 0
    return slice(start, start + n)


def _curve_row(
    curve: str,
    label: str,
    x: tuple[str, str],
    unit: str,
    lists: Sequence[np.ndarray],
    comparison: ChannelComparison | None = None,
) -> dict[str, Any]:
    names = ("x", "measured", "before", "after", "rival")
    values = {name: np.asarray(v, dtype=np.float32) for name, v in zip(names, lists)}
    values = {name: v for name, v in values.items() if v.size}
    return {
        "curve": curve,
        "label": label,
        "channel": comparison.sensor if comparison else None,
        "recording": comparison.recording if comparison else None,
        "x_label": x[0],
        "x_unit": x[1],
        "y_unit": unit,
        **values,
    }


def _receptance_rows(case: TrackCase, diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Receptance magnitude of the pair that the term improves most, else that fits worst."""
    chosen, largest_gain = None, -1.0
    for k, o in enumerate(case.observations):
        pair = case.frf_pairs.get(o.name)
        if pair is None:
            continue
        before, after = diagnosis.base.predictions[k], diagnosis.fit.predictions[k]
        squares = (o.data - before) ** 2 - ((o.data - after) ** 2 if diagnosis.fit is not diagnosis.base else 0.0)
        gain = float(np.sum(squares / o.sigma**2))
        if gain > largest_gain:
            chosen, largest_gain = (k, pair), gain
    if chosen is None:
        return []
    k, pair = chosen
    fits = _fits(diagnosis, _rival_fit(diagnosis))
    sizes = [_magnitude(v, pair) for v in (case.observations[k].data, *(f.predictions[k] for f in fits))]
    label = f"impacts {pair.test.name}, felt by {pair.channel}"
    return [_curve_row("receptance", label, ("frequency", "Hz"), "m/N", [pair.frequency, *sizes])]


def _magnitude(value: np.ndarray, pair: FrfPair) -> np.ndarray:
    n = pair.frequency.size
    return np.hypot(value[:n], value[n:]) * pair.size


def _latent_rows(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Latent force against the covariate that explains most of it."""
    if diagnosis.latent is None or not diagnosis.latent.best_covariate:
        return []
    name = diagnosis.latent.best_covariate
    if diagnosis.latent.r2[name] < MIN_EXPLAINED_SHARE:
        return []
    centre, mean, error = diagnosis.latent.curves[name]
    label = f"missing force against {name}: it explains {100.0 * diagnosis.latent.r2[name]:.0f} %"
    x_axis = COVARIATES.get(name, (name, ""))
    limits = [centre, mean, mean - Z95 * error, mean + Z95 * error]
    return [_curve_row("latent", label, x_axis, diagnosis.latent.unit, limits)]
