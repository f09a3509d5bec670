"""Reconstruction of an unknown force at a support from the residuals of passages, by regularised deconvolution."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout import passage_band
from turnout.mismatch.turnout.priors import PASSAGE, SIMULATION
from turnout.mismatch.turnout.pseudo_forces import green_functions, support_motion
from turnout.mismatch.turnout.wave_response import channel_responses

if TYPE_CHECKING:
    from typing import Any

    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.mismatch.turnout.passage_observation import AlignedPassage


def latent_force(case: TrackCase, fit: Fit) -> dict[str, Any] | None:
    r"""Force on the sleeper that explains most of the residual, with its covariates; None without passages.

    .. math:: \hat f_j = \frac{\sum_s G_{sj}^* r_s}{\sum_s |G_{sj}|^2 + \lambda}

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        A fit of the case.

    Returns
    -------
    dict or None
        Name of a covariate -> (n,), with ``force`` [N], ``unit`` and ``sleeper``; None without passages.
    """
    passages = [(o, r) for o, r in zip(case.observations, fit.residuals) if o.name in case.aligned_passages]
    if not passages:
        return None
    spectra = []
    for o, residual in passages:
        aligned = case.aligned_passages[o.name]
        frequency, g = green_functions(case.predictor, fit.values, case.all_terms(fit), aligned)
        g = g * channel_responses(fit.values, case.all_terms(fit), aligned, frequency)[:, :, None, None]
        rows = residual.reshape(len(aligned.sensors), -1)
        size = 1 << int(np.ceil(np.log2(2 * rows.shape[1])))
        grid = np.fft.rfftfreq(size, 1.0 / aligned.clock)
        inside = np.flatnonzero((grid >= PASSAGE.band_low) & (grid <= aligned.high))
        nearest = np.clip(np.searchsorted(frequency, grid[inside]), 0, frequency.size - 1)
        spectra.append((aligned, np.fft.rfft(rows, size)[:, inside].T, g[nearest, :, :, 1], inside, size))
    gains = []
    for k in range(len(case.predictor.zone.supports)):
        gains.append(sum(_explained_power(r, g[:, :, k]) for _, r, g, _, _ in spectra))
    best_support = int(np.argmax(gains))
    series: dict[str, list[np.ndarray]] = {
        name: [] for name in ("force", "displacement", "velocity", "position", "time", "temperature")
    }
    for aligned, r, g, inside, size in spectra:
        _append_series(
            case, fit, aligned, series, _force(r, g[:, :, best_support], inside, size, aligned.time.size), best_support
        )
    covariates = {name: np.concatenate(v) for name, v in series.items()}
    if not np.all(np.isfinite(covariates["temperature"])):
        del covariates["temperature"]
    return {
        **covariates,
        "unit": "N",
        "sleeper": np.full(covariates["force"].size, case.predictor.zone.first + best_support),
    }


def _power_and_ridge(g: np.ndarray) -> tuple[np.ndarray, float]:
    power = np.sum(np.abs(g) ** 2, axis=1)
    return power, PASSAGE.ridge_share * float(np.max(power))


def _explained_power(r: np.ndarray, g: np.ndarray) -> float:
    power, ridge = _power_and_ridge(g)
    projected = np.sum(g.conj() * r, axis=1)
    return float(np.sum(np.abs(projected) ** 2 / (power + ridge)))


def _force(r: np.ndarray, g: np.ndarray, inside: np.ndarray, size: int, n: int) -> np.ndarray:
    power, ridge = _power_and_ridge(g)
    spectrum = np.zeros(size // 2 + 1, dtype=complex)
    spectrum[inside] = np.sum(g.conj() * r, axis=1) / (power + ridge)
    return np.fft.irfft(spectrum, size)[:n]


def _append_series(
    case: TrackCase, fit: Fit, aligned: AlignedPassage, series: dict[str, list[np.ndarray]], force: np.ndarray, k: int
) -> None:
    _, sleeper = support_motion(case.predictor, fit.values, case.all_terms(fit), aligned)
    rate = case.predictor.solver.rate
    time = aligned.time - aligned.reference - fit.values[f"time@{aligned.name}"] + SIMULATION.lead_time
    y = passage_band.read_at(sleeper[k][None], rate, time)[0]
    position = case.predictor.track().support[case.predictor.zone.first + k]
    wheels = aligned.positions() - position
    nearest = wheels[np.argmin(np.abs(wheels), axis=0), np.arange(time.size)]
    series["force"].append(force)
    series["displacement"].append(y)
    series["velocity"].append(np.gradient(y, 1.0 / aligned.clock))
    series["position"].append(np.clip(nearest, -PASSAGE.max_wheel_distance, PASSAGE.max_wheel_distance))
    series["time"].append(aligned.time)
    temperature = aligned.passage.conditions.get("rail_temperature", np.nan)
    series["temperature"].append(np.full(time.size, float(temperature)))
