"""Curves of a diagnosis as rows: waveform, spectrum, receptance and latent force, before and after."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import welch

from turnout.mismatch.engine.reserved_data import fit_of_reserved

WINDOW = 0.8  # s of waveform in a row
SEGMENT = 0.5  # s: segment of Welch's estimate, 2 Hz lines
TELLS = 0.1  # least share of the latent force that a covariate explains
AGAINST = {  # covariate of the latent force -> (text, unit)
    "displacement": ("displacement of the sleeper", "m"),
    "velocity": ("velocity of the sleeper", "m/s"),
    "position": ("nearest wheel from the sleeper", "m"),
    "time": ("time of the recording", "s"),
    "temperature": ("rail temperature", "°C"),
}
CORE = (0.1, 0.9)  # shares of the cumulative gain between which a band is quoted


@dataclass(frozen=True)
class Shown:
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


def passages_shown(case, found) -> list[Shown]:
    """Comparison of every passage at every sensor, held out passages first."""
    rival = _rival(found)
    shown: list[Shown] = []
    if case.reserved:
        sets = [fit_of_reserved(case, fit)[0] for fit in _fits(found, rival)]
        sets = [predictions or sets[0] for predictions in sets]
        shown += _split(case, case.reserved, sets, True) if sets[0] else []
    sets = [fit.predictions for fit in _fits(found, rival)]
    return shown + _split(case, case.observations, sets, False)


def _rival(found):
    named = found.verdict.names[:1]
    return next((s.fit for s in found.verdict.scores if s.family not in named), None)


def _fits(found, rival):
    return found.base, found.fit, rival or found.base


def _split(case, observations, sets, held_out):
    found = []
    for k, o in enumerate(observations):
        made = case.rollings.get(o.name)
        if made is None:
            continue
        n = made.time.size
        rows = [np.reshape(values, (-1, n)) for values in (o.data, *(s[k] for s in sets))]
        places = made.places()
        for i, sensor in enumerate(made.sensors):
            wheel = np.min(np.abs(places - sensor.place), axis=0)
            measured, before, after, rival = (r[i] for r in rows)
            found.append(Shown(o.name, sensor.name, made.time, measured, before, after, rival, wheel, held_out))
    return found


def best_shown(shown, case, found):
    """The comparison to draw: held out if possible, at the position or sensor of the finding, with the largest gain."""
    if not shown:
        return None
    where = found.fit.candidates[0].where if found.fit.candidates else {}
    pool = [s for s in shown if s.held_out] or shown
    if where.get("sensor"):
        pool = [s for s in pool if s.sensor == where["sensor"]] or pool
    elif where.get("place") is not None:
        places = {s.name: s.place for s in case.campaign.sensors}
        nearest = min((s.sensor for s in pool), key=lambda name: (abs(places[name] - where["place"]), name))
        pool = [s for s in pool if s.sensor == nearest]
    changed = found.fit is not found.base
    return max(pool, key=lambda s: _share(s.gain if changed else (s.measured - s.before) ** 2, s.measured))


def _share(gain, measured):
    return float(np.sum(gain) / max(float(np.sum(measured**2)), 1e-30))


def spectra(shown):
    """(frequency, measured, before, after, rival) one-sided power spectral density [(m/s²)²/Hz] by Welch's method."""
    rate = 1.0 / float(np.mean(np.diff(shown.time)))
    size = min(shown.time.size, round(SEGMENT * rate))
    signals = (shown.measured, shown.before, shown.after, shown.rival)
    densities = [welch(s, rate, nperseg=size) for s in signals]
    return densities[0][0], *(d[1] for d in densities)


def band_of(shown, changed):
    """(low, high) [Hz] of four fifths of the explained (else missing) power, None without a passage."""
    if shown is None:
        return None
    rate = 1.0 / float(np.mean(np.diff(shown.time)))
    size = min(shown.time.size, round(SEGMENT * rate))
    f, left = welch(shown.measured - shown.before, rate, nperseg=size)
    if changed:
        left = np.maximum(left - welch(shown.measured - shown.after, rate, nperseg=size)[1], 0.0)
    return _core(f, left)


def band_of_blows(case, found):
    """The same from the hammer tests, None if they gain less than the passages."""
    lines, weights, rolling = [], [], 0.0
    for k, o in enumerate(case.observations):
        gain = _gain_in_sigma(o, found, k)
        pair = case.pairs.get(o.name)
        if pair is None:
            rolling += o.effective * float(gain.sum())
        else:
            lines.append(pair.frequency)
            weights.append(o.effective * gain.reshape(2, -1).sum(axis=0))
    if not lines or float(np.concatenate(weights).sum()) <= rolling:
        return None
    f, weight = np.concatenate(lines), np.maximum(np.concatenate(weights), 0.0)
    order = np.argsort(f, kind="stable")
    return _core(f[order], weight[order])


def _gain_in_sigma(o, found, k):
    """(n,) squared errors in units of sigma: explained by the term, else missing."""
    left = ((o.data - found.base.predictions[k]) / o.sigma) ** 2
    if found.fit is found.base:
        return left
    return left - ((o.data - found.fit.predictions[k]) / o.sigma) ** 2


def reach_of(shown, changed):
    """Distance of the nearest wheel [m] within which four fifths of the gain (else of the error) occur."""
    if shown is None:
        return None
    gain = np.maximum(shown.gain if changed else (shown.measured - shown.before) ** 2, 0.0)
    order = np.argsort(shown.wheel)
    total = np.cumsum(gain[order])
    if not total[-1] > 0.0:
        return None
    return float(shown.wheel[order][np.searchsorted(total, 0.8 * total[-1])])


def _core(x, weight):
    total = np.cumsum(weight)
    if not total[-1] > 0.0:
        return None
    low, high = (float(x[min(np.searchsorted(total, share * total[-1]), x.size - 1)]) for share in CORE)
    return low, high


def curve_rows(case, found, shown, identity) -> list[dict]:
    """Rows of ``mismatch_curves``."""
    rows = []
    if shown is not None:
        keep = _window(shown, found.fit is not found.base)
        named = f"{shown.recording} at {shown.sensor}" + (", never used in the fit" if shown.held_out else "")
        signals = (shown.time, shown.measured, shown.before, shown.after, shown.rival)
        rows.append(_row("waveform", named, ("time", "s"), "m/s²", [v[keep] for v in signals], shown))
        f, *densities = spectra(shown)
        inside = (f >= 4.0) & (f <= 200.0)
        lines = [v[inside] for v in (f, *densities)]
        rows.append(_row("spectrum", named, ("frequency", "Hz"), "(m/s²)²/Hz", lines, shown))
    rows += _receptance(case, found)
    rows += _latent(found)
    return [{**identity, "curve_no": k, **r} for k, r in enumerate(rows)]


def _window(shown, changed):
    """Slice of ``SHOWN_DURATION`` with the largest gain."""
    gain = shown.gain if changed else (shown.measured - shown.before) ** 2
    n = min(shown.time.size, round(WINDOW / float(np.mean(np.diff(shown.time)))))
    total = np.concatenate([[0.0], np.cumsum(gain)])
    start = int(np.argmax(total[n:] - total[:-n])) if n < shown.time.size else 0
    return slice(start, start + n)


def _row(curve, label, x, unit, lists, shown=None):
    names = ("x", "measured", "before", "after", "rival")
    values = {name: np.asarray(v, dtype=np.float32) for name, v in zip(names, lists)}
    values = {name: v for name, v in values.items() if v.size}
    return {
        "curve": curve,
        "label": label,
        "channel": shown.sensor if shown else None,
        "recording": shown.recording if shown else None,
        "x_label": x[0],
        "x_unit": x[1],
        "y_unit": unit,
        **values,
    }


def _receptance(case, found):
    """Receptance magnitude of the pair that the term improves most, else that fits worst."""
    best, worst = None, -1.0
    for k, o in enumerate(case.observations):
        pair = case.pairs.get(o.name)
        if pair is None:
            continue
        before, after = found.base.predictions[k], found.fit.predictions[k]
        left = (o.data - before) ** 2 - ((o.data - after) ** 2 if found.fit is not found.base else 0.0)
        gain = float(np.sum(left / o.sigma**2))
        if gain > worst:
            best, worst = (k, pair), gain
    if best is None:
        return []
    k, pair = best
    fits = _fits(found, _rival(found))
    sizes = [_magnitude(v, pair) for v in (case.observations[k].data, *(f.predictions[k] for f in fits))]
    label = f"blows {pair.test.name}, felt by {pair.channel}"
    return [_row("receptance", label, ("frequency", "Hz"), "m/N", [pair.frequency, *sizes])]


def _magnitude(value, pair):
    n = pair.frequency.size
    return np.hypot(value[:n], value[n:]) * pair.size


def _latent(found):
    """Latent force against the covariate that explains most of it."""
    if found.latent is None or not found.latent.best:
        return []
    name = found.latent.best
    if found.latent.r2[name] < TELLS:
        return []
    centre, mean, error = found.latent.curves[name]
    label = f"missing force against {name}: it explains {100.0 * found.latent.r2[name]:.0f} %"
    across = AGAINST.get(name, (name, ""))
    limits = [centre, mean, mean - 1.96 * error, mean + 1.96 * error]
    return [_row("latent", label, across, found.latent.unit, limits)]
