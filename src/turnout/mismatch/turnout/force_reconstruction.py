"""Reconstruction of an unknown force at a support from the residuals of passages, by regularised deconvolution."""

import numpy as np

from turnout.mismatch.turnout import passage_band, passage_model
from turnout.mismatch.turnout.pseudo_forces import green, support_forces
from turnout.mismatch.turnout.wave_response import shown_by


def latent_force(case, fit):
    r"""Force on the sleeper that explains most of the residual, with its covariates; None without passages.

    .. math:: \hat f_j = \frac{\sum_s G_{sj}^* r_s}{\sum_s |G_{sj}|^2 + \lambda}
    """
    passages = [(o, r) for o, r in zip(case.observations, fit.residuals) if o.name in case.rollings]
    if not passages:
        return None
    spectra = []
    for o, residual in passages:
        made = case.rollings[o.name]
        frequency, g = green(case, fit.values, fit.terms, made)
        g = g * shown_by(fit.values, fit.terms, made, frequency)[:, :, None, None]
        rows = residual.reshape(len(made.sensors), -1)
        size = 1 << int(np.ceil(np.log2(2 * rows.shape[1])))
        grid = np.fft.rfftfreq(size, 1.0 / made.clock)
        inside = np.flatnonzero((grid >= passage_band.LOW) & (grid <= made.high))
        nearest = np.clip(np.searchsorted(frequency, grid[inside]), 0, frequency.size - 1)
        spectra.append((made, np.fft.rfft(rows, size)[:, inside].T, g[nearest, :, :, 1], inside, size))
    gains = []
    for k in range(len(case.zone.supports)):
        gains.append(sum(_explained(r, g[:, :, k]) for _, r, g, _, _ in spectra))
    best = int(np.argmax(gains))
    parts = {name: [] for name in ("force", "displacement", "velocity", "position", "time", "temperature")}
    for made, r, g, inside, size in spectra:
        _append(case, fit, made, parts, _force(r, g[:, :, best], inside, size, made.time.size), best)
    found = {name: np.concatenate(v) for name, v in parts.items()}
    if not np.all(np.isfinite(found["temperature"])):
        del found["temperature"]
    return {**found, "unit": "N", "sleeper": np.full(found["force"].size, case.zone.first + best)}


def _weight(g):
    power = np.sum(np.abs(g) ** 2, axis=1)
    return power, 0.02 * float(np.max(power))


def _explained(r, g):
    power, ridge = _weight(g)
    projected = np.sum(g.conj() * r, axis=1)
    return float(np.sum(np.abs(projected) ** 2 / (power + ridge)))


def _force(r, g, inside, size, n):
    power, ridge = _weight(g)
    spectrum = np.zeros(size // 2 + 1, dtype=complex)
    spectrum[inside] = np.sum(g.conj() * r, axis=1) / (power + ridge)
    return np.fft.irfft(spectrum, size)[:n]


def _append(case, fit, made, parts, force, k):
    _, sleeper = support_forces(case, fit.values, fit.terms, made)
    rate = case.solver.rate
    time = made.time - made.reference - fit.values[f"time@{made.name}"] + passage_model.LEAD
    y = passage_band.read_at(sleeper[k][None], rate, time)[0]
    place = case.track().support[case.zone.first + k]
    wheels = made.places() - place
    nearest = wheels[np.argmin(np.abs(wheels), axis=0), np.arange(time.size)]
    parts["force"].append(force)
    parts["displacement"].append(y)
    parts["velocity"].append(np.gradient(y, 1.0 / made.clock))
    parts["position"].append(np.clip(nearest, -6.0, 6.0))
    parts["time"].append(made.time)
    temperature = made.passage.conditions.get("rail_temperature", np.nan)
    parts["temperature"].append(np.full(time.size, float(temperature)))
