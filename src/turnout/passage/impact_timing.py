"""Estimate when each wheel's impact occurred, between two samples, and whether that interval is certain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnout.passage.impulse_fit import joint_fit, onsets
from turnout.passage.wheel_basis import FRACTIONS, WheelBasis


@dataclass(frozen=True)
class ImpactTimes:
    """Times of the wheels' impacts with their errors.

    ``times`` (n_wheel,) [samples], ``standard_errors`` (n_wheel,) [samples] over all intervals, ``odds`` (n_wheel,) of
    the best interval between samples against all others together, ``ambiguous`` (n_wheel,) bool: the odds are below the
    required ones, and the time may lie in another interval.
    """

    times: np.ndarray
    standard_errors: np.ndarray
    odds: np.ndarray
    ambiguous: np.ndarray


def gather(data: np.ndarray, first: np.ndarray, length: int) -> np.ndarray:
    """(n_wheel, length) samples from each ``first`` on; zero outside the recording.

    Parameters
    ----------
    data : (n_sample,) array of float
        Samples of the recording. [any unit]
    first : (n_wheel,) array of int
        First sample of each window.
    length : int
        Samples of each window.

    Returns
    -------
    (n_wheel, length) array of float
        One window per wheel. [same unit]
    """
    index = np.asarray(first)[:, None] + np.arange(length)
    inside = (index >= 0) & (index < len(data))
    return np.where(inside, np.asarray(data)[np.clip(index, 0, len(data) - 1)], 0.0)


def explained_power(
    windows: np.ndarray, basis: WheelBasis, allowed: np.ndarray, n_observed: np.ndarray | None = None
) -> np.ndarray:
    r"""(n_wheel, n_lag, n_fraction) reduction of the residual's sum of squares by one wheel at n - phi.

    .. math:: P_n(\varphi) = (b_n^T\theta(\varphi))^2 / \theta^T G \theta

    ``windows`` (n_wheel, n_lag - 1 + n_sample) is the data around each wheel, b_n their inner products with the
    columns. Wheels press in one direction: all amplitudes have the sign that explains more. Times that need the other
    sign are -inf, like those that ``allowed`` (n_wheel, n_lag, n_fraction) excludes. Without that rule a time half a
    period of a slow mode away fits equally well.

    Parameters
    ----------
    windows : (n_wheel, n_lag - 1 + n_sample) array of float
        Data around each wheel. [m/s²]
    basis : WheelBasis
        Responses of the model behind the filter of ``data``.
    allowed : (n_wheel, n_lag, n_fraction) array of bool
        Times that are searched.
    n_observed : (n_lag,) array of int, optional
        Samples of the response that are compared at each lag; by default all.

    Returns
    -------
    (n_wheel, n_lag, n_fraction) array of float
        Explained sum of squares; -inf where a time is excluded. [(m/s²)²]
    """
    n_lag = allowed.shape[1]
    inner = basis.correlate(windows, n_lag)
    if n_observed is None:
        signed = inner @ basis.unit_weights.T
    else:
        signed = np.einsum("jlp,lqp->jlq", inner, basis.truncated_unit_weights(n_observed))
    signed = np.where(allowed, signed, 0.0)
    positive, negative = signed.max(axis=(1, 2), initial=0.0), signed.min(axis=(1, 2), initial=0.0)
    sign = 1.0 if np.sum(positive**2) >= np.sum(negative**2) else -1.0
    signed *= sign
    # a wheel without any time of that sign keeps its time and explains nothing
    signed[signed <= 0.0] = -np.inf
    power = np.where(np.isfinite(signed), signed, 0.0) ** 2
    return np.where(allowed & (np.isfinite(signed) | (power.max(axis=(1, 2), keepdims=True) == 0)), power, -np.inf)


def best_times(
    windows: np.ndarray,
    first: np.ndarray,
    expected: np.ndarray,
    basis: WheelBasis,
    search_range: float,
    n_observed: np.ndarray | None = None,
) -> np.ndarray:
    """(n_wheel,) times within ``search_range`` of ``expected`` that explain most of ``windows`` from ``first`` on.

    Parameters
    ----------
    windows : (n_wheel, n) array of float
        Data around each wheel. [m/s²]
    first : (n_wheel,) array of int
        First sample of each window.
    expected : (n_wheel,) array of float
        Expected times of the impacts, increasing. [samples]
    basis : WheelBasis
        Responses of the model behind the filter of ``data``.
    search_range : float
        Range searched on either side. [samples]
    n_observed : (n_lag,) array of int, optional
        Samples of the response that are compared at each lag; by default all.

    Returns
    -------
    (n_wheel,) array of float
        Times of the impacts. [samples]
    """
    n_lag = windows.shape[1] - basis.n_sample + 1
    power = explained_power(windows, basis, _allowed_times(first, expected, search_range, n_lag), n_observed)
    lag, fraction = np.unravel_index(power.reshape(len(first), -1).argmax(axis=1), power.shape[1:])
    return _refine_times(power, lag, fraction, first)


def _allowed_times(first: np.ndarray, expected: np.ndarray, search_range: float, n_lag: int) -> np.ndarray:
    return np.abs(np.arange(n_lag)[:, None] - FRACTIONS - (expected - first)[:, None, None]) <= search_range + 0.5


def search_times(
    data: np.ndarray, expected: np.ndarray, basis: WheelBasis, search_range: float, length: int = 300, sweeps: int = 3
) -> np.ndarray:
    """(n_wheel,) impact times within ``search_range`` of ``expected`` that explain most. [samples]

    One amplitude along b per wheel. The neighbours' responses are subtracted as the joint fit of the previous sweep has
    them, unless no response reaches the next wheel. Only the first ``length`` samples of a response are compared.

    Parameters
    ----------
    data : (n_sample,) array of float
        Acceleration behind the filter of ``basis``. [m/s²]
    expected : (n_wheel,) array of float
        Expected times of the impacts, increasing. [samples]
    basis : WheelBasis
        Responses of the model behind the filter of ``data``.
    search_range : float
        Range searched on either side. [samples]
    length : int
        Samples of a response that are compared.
    sweeps : int
        Number of passes where responses reach the next wheel.

    Returns
    -------
    (n_wheel,) array of float
        Times of the impacts. [samples]
    """
    power, first = _search_power(data, expected, basis, search_range, length, sweeps)
    lag, fraction = np.unravel_index(power.reshape(len(first), -1).argmax(axis=1), power.shape[1:])
    return _refine_times(power, lag, fraction, first)


def impact_times(
    data: np.ndarray,
    expected: np.ndarray,
    basis: WheelBasis,
    search_range: float,
    noise: float,
    spread: float,
    odds: float = 100.0,
) -> ImpactTimes:
    r"""Impact times with their errors and a flag where the interval between samples is not certain.

    .. math:: p(n,\varphi) \propto \exp\{P_n(\varphi)/2\sigma^2 - (t-t_0)^2/2s^2\}, \qquad t = n - \varphi

    Parameters
    ----------
    data : (n_sample,) array of float
        Behind the filter of ``basis``; its noise must be white. [m/s²]
    expected : (n_wheel,) array of float
        Prior mean, from speed and axle spacing. [samples]
    basis : WheelBasis
        Responses of the model behind the filter of ``data``.
    search_range : float
        Range searched on either side. [samples]
    noise : float
        Standard deviation of the noise. [m/s²]
    spread : float
        Standard deviation of the prior. [samples]
    odds : float
        A time is ambiguous unless its interval has at least these odds against all others together.

    Returns
    -------
    ImpactTimes

    Raises
    ------
    ValueError
        ``noise`` or ``spread`` is not above 0.
    """
    if not noise > 0 or not spread > 0:
        raise ValueError(f"noise and spread must be above 0, got {noise} and {spread}")
    expected = np.asarray(expected, dtype=float)
    power, first = _search_power(data, expected, basis, search_range, basis.n_sample, 3)
    grid = (first - expected)[:, None, None] + np.arange(power.shape[1])[:, None] - FRACTIONS
    level = power / (2 * noise**2) - 0.5 * (grid / spread) ** 2
    lag, fraction = np.unravel_index(level.reshape(len(first), -1).argmax(axis=1), level.shape[1:])
    times = _refine_times(power, lag, fraction, first)
    weight = np.exp(level - level.max(axis=(1, 2), keepdims=True))
    weight /= weight.sum(axis=(1, 2), keepdims=True)
    share = weight[np.arange(len(lag)), lag].sum(axis=-1)
    other_share = np.maximum(1.0 - share, 1e-300)
    distance_squared = (grid + expected[:, None, None] - times[:, None, None]) ** 2
    between = np.sum(weight * distance_squared, axis=(1, 2))
    inside = _curvature_error(power, lag, fraction, noise)
    error = np.sqrt(between * other_share + inside**2)
    return ImpactTimes(times, error, share / other_share, share / other_share < odds)


def _search_power(
    data: np.ndarray, expected: np.ndarray, basis: WheelBasis, search_range: float, length: int, sweeps: int
) -> tuple[np.ndarray, np.ndarray]:
    """Explained power of every wheel and (n_wheel,) the sample of lag 0."""
    expected = np.asarray(expected, dtype=float)
    short = basis.truncate(min(length, basis.n_sample))
    reach = int(np.ceil(search_range)) + 1
    first, n_lag = np.round(expected).astype(int) - reach, 2 * reach + 1
    span = n_lag - 1 + short.n_sample
    allowed = _allowed_times(first, expected, search_range, n_lag)
    windows = gather(data, first, span)
    power = explained_power(windows, short, allowed)
    has_overlap = np.diff(expected).min(initial=np.inf) < basis.ring_length
    for _ in range(sweeps - 1 if has_overlap else 0):
        lag, fraction = np.unravel_index(power.reshape(len(first), -1).argmax(axis=1), power.shape[1:])
        windows = _without_neighbours(data, _refine_times(power, lag, fraction, first), basis, first, span)
        power = explained_power(windows, short, allowed)
    return power, first


def _without_neighbours(
    data: np.ndarray, times: np.ndarray, basis: WheelBasis, first: np.ndarray, span: int
) -> np.ndarray:
    """Data around each wheel, without the responses of all other wheels."""
    order = np.argsort(times, kind="stable")
    fit = joint_fit(data, times[order], basis)
    amplitude = np.empty(len(times))
    amplitude[order] = fit.amplitudes[:, 0]
    windows = gather(data - fit.prediction, first, span)
    onset, phi = onsets(times)
    for row, start, weight in zip(windows, onset - first, amplitude[:, None] * basis.coefficients(phi)):
        n = min(span - start, basis.n_sample)
        row[start : start + n] += weight @ basis.columns[:, :n]
    return windows


def _neighbours(power: np.ndarray, lag: np.ndarray, fraction: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Best fraction, not at an end of its interval, and the power there and on both sides."""
    wheel = np.arange(len(lag))
    inner = np.clip(fraction, 1, len(FRACTIONS) - 2)
    return inner, [power[wheel, lag, inner + step] for step in (-1, 0, 1)]


def _refine_times(power: np.ndarray, lag: np.ndarray, fraction: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Times n - phi from a parabola through the best fraction and its neighbours in the same interval."""
    inner, (low, mid, high) = _neighbours(power, lag, fraction)
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.nan_to_num(0.5 * (low - high) / (low - 2 * mid + high))
        shift = np.where(low - 2 * mid + high < 0, shift, np.sign(high - low) * 1.5)
    phi = FRACTIONS[inner] + np.clip(shift, -1.5, 1.5) / len(FRACTIONS)
    return first + lag - np.clip(np.nan_to_num(phi), 0.0, 1.0 - 1e-9)


def _curvature_error(power: np.ndarray, lag: np.ndarray, fraction: np.ndarray, noise: float) -> np.ndarray:
    """(n_wheel,) standard error within the interval from the curvature of the log-likelihood. [samples]"""
    _, (low, mid, high) = _neighbours(power, lag, fraction)
    with np.errstate(divide="ignore", invalid="ignore"):
        curvature = -(low - 2 * mid + high) * len(FRACTIONS) ** 2 / (2 * noise**2)
        return np.where(curvature > 12.0, 1 / np.sqrt(np.maximum(curvature, 1e-300)), 1 / np.sqrt(12.0))
