"""Curves of a diagnosis as rows: waveform, spectrum, receptance and latent force, before and after."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import welch

from turnout.constants import Z95
from turnout.mismatch.engine.reserved_data import reserved_fit

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
    def gain(self):
        """(n,) squared error before minus squared error after."""
        return (self.measured - self.before) ** 2 - (self.measured - self.after) ** 2


def channel_comparisons(case, diagnosis) -> list[ChannelComparison]:
    """Comparison of every passage at every sensor, held out passages first."""
    rival = _rival_fit(diagnosis)
    comparisons: list[ChannelComparison] = []
    if case.reserved:
        sets = [reserved_fit(case, fit)[0] for fit in _fits(diagnosis, rival)]
        sets = [predictions or sets[0] for predictions in sets]
        comparisons += _comparisons(case, case.reserved, sets, True) if sets[0] else []
    sets = [fit.predictions for fit in _fits(diagnosis, rival)]
    return comparisons + _comparisons(case, case.observations, sets, False)


def _rival_fit(diagnosis):
    names = diagnosis.verdict.names[:1]
    return next((s.fit for s in diagnosis.verdict.scores if s.family not in names), None)


def _fits(diagnosis, rival):
    return diagnosis.base, diagnosis.fit, rival or diagnosis.base


def _comparisons(case, observations, sets, held_out):
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


def best_comparison(comparisons, case, diagnosis):
    """The comparison to draw: held out if possible, at the position or sensor of the finding, with the largest gain."""
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


def _relative_gain(gain, measured):
    return float(np.sum(gain) / max(float(np.sum(measured**2)), 1e-30))


def spectra(comparison):
    """(frequency, measured, before, after, rival) one-sided power spectral density [(m/s²)²/Hz] by Welch's method."""
    rate = 1.0 / float(np.mean(np.diff(comparison.time)))
    size = min(comparison.time.size, round(WELCH_SEGMENT * rate))
    signals = (comparison.measured, comparison.before, comparison.after, comparison.rival)
    densities = [welch(s, rate, nperseg=size) for s in signals]
    return densities[0][0], *(d[1] for d in densities)


def band_of(comparison, changed):
    """(low, high) [Hz] of four fifths of the explained (else missing) power, None without a passage."""
    if comparison is None:
        return None
    rate = 1.0 / float(np.mean(np.diff(comparison.time)))
    size = min(comparison.time.size, round(WELCH_SEGMENT * rate))
    f, density = welch(comparison.measured - comparison.before, rate, nperseg=size)
    if changed:
        density = np.maximum(density - welch(comparison.measured - comparison.after, rate, nperseg=size)[1], 0.0)
    return _core_range(f, density)


def band_of_impacts(case, diagnosis):
    """The same from the hammer tests, None if they gain less than the passages."""
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


def _gain_in_sigma(o, diagnosis, k):
    """(n,) squared errors in units of sigma: explained by the term, else missing."""
    squares = ((o.data - diagnosis.base.predictions[k]) / o.sigma) ** 2
    if diagnosis.fit is diagnosis.base:
        return squares
    return squares - ((o.data - diagnosis.fit.predictions[k]) / o.sigma) ** 2


def reach_of(comparison, changed):
    """Distance of the nearest wheel [m] within which four fifths of the gain (else of the error) occur."""
    if comparison is None:
        return None
    gain = np.maximum(comparison.gain if changed else (comparison.measured - comparison.before) ** 2, 0.0)
    order = np.argsort(comparison.wheel)
    total = np.cumsum(gain[order])
    if not total[-1] > 0.0:
        return None
    return float(comparison.wheel[order][np.searchsorted(total, 0.8 * total[-1])])


def _core_range(x, weight):
    total = np.cumsum(weight)
    if not total[-1] > 0.0:
        return None
    low, high = (float(x[min(np.searchsorted(total, share * total[-1]), x.size - 1)]) for share in CORE_SHARES)
    return low, high


def curve_rows(case, diagnosis, comparison, identity) -> list[dict]:
    """Rows of ``mismatch_curves``."""
    rows = []
    if comparison is not None:
        window = _window(comparison, diagnosis.fit is not diagnosis.base)
        label = f"{comparison.recording} at {comparison.sensor}" + (
            ", never used in the fit" if comparison.held_out else ""
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


def _window(comparison, changed):
    """Slice of ``SHOWN_DURATION`` with the largest gain."""
    gain = comparison.gain if changed else (comparison.measured - comparison.before) ** 2
    n = min(comparison.time.size, round(SHOWN_DURATION / float(np.mean(np.diff(comparison.time)))))
    total = np.concatenate([[0.0], np.cumsum(gain)])
    start = int(np.argmax(total[n:] - total[:-n])) if n < comparison.time.size else 0
    return slice(start, start + n)


def _curve_row(curve, label, x, unit, lists, comparison=None):
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


def _receptance_rows(case, diagnosis):
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
    label = f"blows {pair.test.name}, felt by {pair.channel}"
    return [_curve_row("receptance", label, ("frequency", "Hz"), "m/N", [pair.frequency, *sizes])]


def _magnitude(value, pair):
    n = pair.frequency.size
    return np.hypot(value[:n], value[n:]) * pair.size


def _latent_rows(diagnosis):
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
