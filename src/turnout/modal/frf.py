"""Find the modes of measured frequency responses without knowing their number or frequencies.

The band around each peak is turned into a decay. Realisations of several orders give the starting poles of the fit.
Also here: the response of damped modes to a smooth impact, in closed form and with its start between samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
from scipy.linalg import eigh
from scipy.ndimage import uniform_filter1d

from turnout.modal.frf_fit import FrfFit, fit_each
from turnout.modal.poles import continuous_pole
from turnout.modal.summary import Summary, summarise

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

ORDERS = range(1, 9)  # model orders at which the band around a peak is realised
MIN_ORDER_SHARE = 0.5  # share of the orders at which a pole must occur


def zoomed_poles(
    frequency: np.ndarray, frf: np.ndarray, centre: float, width: float, damping_maximum: float
) -> np.ndarray:
    r"""Modes near a peak: poles that recur over the orders, else the half-power one.

    The lines of the band, transformed back, are a complex decay sampled at the band's width B:
    :math:`h_k \propto \sum_m R_m \exp((s_m - i 2\pi f_0) k / B)`.

    Parameters
    ----------
    frequency : (n_line,) array of float
        Evenly spaced lines of the band. [Hz]
    frf : (n_frf, n_line) array of complex
        Responses in the band.
    centre : float
        Frequency of the peak. [Hz]
    width : float
        Half-power width of the peak. [Hz]
    damping_maximum : float
        Damping ratio from which a pole is ignored.

    Returns
    -------
    (n_mode, 2) array of float
        Ln f [Hz] and zeta of each mode.
    """
    n = len(frequency)
    rate = n * (frequency[1] - frequency[0])
    decay = np.fft.ifft(frf, axis=1)[:, 1 : max(8, (2 * n) // 3)]
    rows = decay.shape[1] // 2
    gram = _gram(decay, rows)
    order = min(max(ORDERS), rows - 1)
    _, u = eigh(gram, subset_by_index=(len(gram) - order, len(gram) - 1))
    u = u[:, ::-1]
    candidates = []
    for r in ORDERS[:order]:
        z = np.linalg.eigvals(np.linalg.lstsq(u[:-1, :r], u[1:, :r], rcond=None)[0])
        s = np.log(np.maximum(np.abs(z), 1e-12)) + 1j * np.mod(np.angle(z), 2.0 * np.pi)
        s = s * rate + 2j * np.pi * frequency[0]
        zeta = -s.real / np.abs(s)
        usable = (zeta > 0.0) & (zeta < damping_maximum) & (np.abs(s.imag / (2 * np.pi) - centre) < 1.5 * width)
        candidates += [(r, pole) for pole in s[usable]]
    starts = _recurring_poles(candidates, order)
    if not starts:
        starts = [2.0 * np.pi * (-0.5 * width + 1j * centre)]
    s = np.array(starts)
    return np.stack([np.log(np.abs(s) / (2.0 * np.pi)), -s.real / np.abs(s)], axis=1)


def _gram(decay: np.ndarray, rows: int) -> np.ndarray:
    columns = decay.shape[1] - rows
    windows = np.lib.stride_tricks.sliding_window_view(decay, columns, axis=1)
    return np.einsum("iak,ibk->ab", windows, windows.conj(), optimize=True)


def _recurring_poles(candidates: Sequence[tuple[int, complex]], n_order: int) -> list[complex]:
    """Medians of groups of poles closer than half their decay rate, if they occur at half of the orders."""
    starts, remaining = [], list(candidates)
    while remaining:
        groups = [[p for p in remaining if abs(p[1] - q[1]) < 0.5 * min(-p[1].real, -q[1].real)] for q in remaining]
        largest = max(groups, key=len)
        orders = {r for r, _ in largest}
        if len(orders) < MIN_ORDER_SHARE * (n_order - min(orders) + 1) or len(orders) < 3:
            break
        poles = np.array([p for _, p in largest])
        starts.append(complex(np.median(poles.real), np.median(poles.imag)))
        remaining = [p for p in remaining if p not in largest]
    return starts


BAND_WIDTHS = 12.0  # half-power widths in the band that is fitted around a peak
MIN_LINES = 40  # frequency lines of that band
MAX_LINES = 600


NEIGHBOUR_SHARE = 0.75  # share of the distance to the next peak to which a band may extend
SCALES = (1, 4, 16, 64)  # lines over which the power is averaged to find peaks that are wider
MIN_WIDTH = 4.0  # half-power width of a peak in averages of its scale: a narrower one is found at a finer scale


def level_responses(frequency: np.ndarray, frf: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    r"""Responses over the power of frequency that makes their level even, above 0 Hz.

    .. math:: G = H f^{-p}, \qquad \ln |H| \approx c + p \ln f

    Receptance, mobility and accelerance differ by a factor :math:`i\omega` each, which changes p by 1: their G are the
    same but for a constant factor, and so is all that follows. Poles stay where they are, since the factor is smooth.

    Parameters
    ----------
    frequency : (n_line,) array of float
        Rising. [Hz]
    frf : (n_frf, n_line) array of complex
        Responses of one kind, in any unit.

    Returns
    -------
    tuple of ((n,) array of float, (n_frf, n) array of complex, float)
        Frequencies above 0 Hz [Hz], the levelled responses there, and the power p [-].

    Examples
    --------
    >>> f = np.array([0.0, 1.0, 2.0, 4.0])
    >>> _, levelled, power = level_responses(f, 3j * f[None] ** 2)
    >>> levelled.imag.round(9), round(power, 9)
    (array([[3., 3., 3.]]), 2.0)
    """
    above = frequency > 0.0
    frequency, frf = frequency[above], frf[:, above]
    amplitude = np.sqrt(np.mean(np.abs(frf) ** 2, axis=0))
    usable = amplitude > 0.0
    if np.count_nonzero(usable) < 2:
        return frequency, frf, 0.0
    power = float(np.polyfit(np.log(frequency[usable]), np.log(amplitude[usable]), 1)[0])
    return frequency, frf * frequency**-power, power


def _peaks_and_widths(power: np.ndarray, prominence: float) -> tuple[np.ndarray, np.ndarray]:
    """Lines and half-power widths [lines] of the peaks, narrow ones first, then wider ones of averaged power.

    The random error of an average over m lines falls with the root of m, and so does the prominence that is asked for.
    A damped resonance rises less over its surroundings than a sharp one, and is found all the same.
    """
    found: list[tuple[int, float]] = []
    for n_line in SCALES:
        if 2.0 * MIN_WIDTH * n_line > len(power):
            break
        averaged = uniform_filter1d(power, n_line, mode="nearest")
        level = 10.0 * np.log10(np.maximum(averaged, 1e-30 * averaged.max()))
        peaks, _ = scipy.signal.find_peaks(level, prominence=prominence / np.sqrt(n_line))
        for peak, width in zip(peaks, scipy.signal.peak_widths(averaged, peaks, rel_height=0.5)[0], strict=True):
            is_wide = n_line == 1 or width >= MIN_WIDTH * n_line
            if is_wide and all(abs(peak - p) > 0.5 * max(w, n_line) for p, w in found):
                found.append((int(peak), float(width)))
    found.sort()
    return np.array([p for p, _ in found], dtype=int), np.array([w for _, w in found])


def _band(peaks: np.ndarray, widths: np.ndarray, k: int, n_line: int) -> slice:
    """Lines around peak ``k``, up to the next peak that is not a part of it."""
    peak, width = peaks[k], widths[k]
    half = int(np.clip(BAND_WIDTHS * width, MIN_LINES, MAX_LINES) / 2)
    distance = np.abs(peaks - peak)
    nearest = int(NEIGHBOUR_SHARE * distance[distance > 2.0 * width].min(initial=n_line))
    half = max(min(half, nearest), MIN_LINES // 2)
    return slice(max(0, peak - half), peak + half + 1)


@dataclass(frozen=True)
class FrfMode:
    """A mode of several responses: ``frequency`` [Hz] and ``damping`` over the responses, ``contrast`` [dB].

    ``residue`` (n_frf,) complex is that of :math:`R / (i\\omega - s)` in the response that was given, in its unit
    times 1/s.
    The contrast is the height of the resonance over the residual of the fit.
    """

    frequency: Summary
    damping: Summary
    residue: np.ndarray
    contrast: float


@dataclass(frozen=True)
class FrfModes:
    """``modes`` by frequency, and ``rejected``: mappings of frequency, damping, reason, value, limit."""

    modes: tuple[FrfMode, ...]
    rejected: tuple[dict, ...]


def modes_of_frf(
    frequency: ArrayLike,
    frf: ArrayLike,
    lowest: float = 0.0,
    highest: float = np.inf,
    prominence: float = 12.0,
    contrast: float = 15.0,
    damping_maximum: float = 0.3,
) -> FrfModes:
    """Resonances of one or several responses with common poles.

    The responses are levelled first, so that receptance, mobility and accelerance give the same modes. The bands are
    those around the peaks of the summed power. Each band is turned into a decay, and realisations of several orders
    propose poles. Those that recur are fitted by least squares, with a local polynomial for all other modes. Each
    response is fitted alone: a moved sensor or hammer shifts the poles by its mass. The mean and its errors come from
    the spread between responses.

    Parameters
    ----------
    frequency : (n_line,) array of float
        Evenly spaced. [Hz]
    frf : (n_line,) or (n_frf, n_line) array of complex
        Receptance, mobility or accelerance: the poles are the same.
    lowest, highest : float
        Frequency range of the peaks. [Hz]
    prominence : float
        Smallest prominence of a sharp peak in the summed power; wide ones are found in averages of it. [dB]
    contrast : float
        Smallest height of a mode over the residual of its fit. [dB]
    damping_maximum : float
        Largest damping ratio of a mode.

    Returns
    -------
    FrfModes
        A peak that is no resonance is among ``rejected``, with the reason. Doubtful peaks are rejected too.

    Raises
    ------
    ValueError
        Uneven or too few lines, or values that are not finite.

    Examples
    --------
    One mode at 100 Hz, 1 % damping, on a grid of 0.5 Hz.

    >>> f = np.arange(1.0, 1001.0) * 0.5
    >>> h = 1.0 / (100.0**2 - f**2 + 2j * 0.01 * 100.0 * f)
    >>> (mode,) = modes_of_frf(f, h).modes
    >>> print(f"{mode.frequency.mean:.2f} Hz, {100 * mode.damping.mean:.2f} %")
    100.00 Hz, 1.00 %
    """
    frequency, frf = np.asarray(frequency, float), np.atleast_2d(np.asarray(frf))
    _check_responses(frequency, frf)
    step = frequency[1] - frequency[0]
    frequency, frf, power = level_responses(frequency, frf)
    peaks, widths = _peaks_and_widths(np.mean(np.abs(frf) ** 2, axis=0), prominence)
    modes: list[FrfMode] = []
    rejected: list[dict] = []
    for k in np.flatnonzero((frequency[peaks] >= lowest) & (frequency[peaks] <= highest)):
        band = _band(peaks, widths, int(k), len(frequency))
        peak_and_width = (frequency[peaks[k]], max(widths[k], 1.0) * step)
        start = zoomed_poles(frequency[band], frf[:, band], *peak_and_width, damping_maximum)
        fits = fit_each(start, frequency[band], frf[:, band], peak_and_width)
        _sort_modes(fits, peak_and_width, contrast, damping_maximum, power, modes, rejected)
    modes.sort(key=lambda m: m.frequency.mean)
    return FrfModes(tuple(_without_duplicates(modes, rejected)), tuple(rejected))


def _check_responses(frequency: np.ndarray, frf: np.ndarray) -> None:
    if frf.shape[1] != len(frequency) or len(frequency) < MIN_LINES:
        raise ValueError(f"{frf.shape} responses over {len(frequency)} lines; need at least {MIN_LINES} lines")
    if not (np.all(np.isfinite(frf)) and np.all(np.isfinite(frequency))):
        raise ValueError("the responses or their frequencies hold values that are not finite")
    gap = np.diff(frequency)
    if not np.allclose(gap, gap[0], rtol=1e-3) or gap[0] <= 0.0:
        raise ValueError(f"need evenly spaced frequencies, the steps go from {gap.min():g} to {gap.max():g} Hz")


MIN_ERROR_SHARE = 1e-3  # of the median error: a fit that states less has no curvature, and would be weighted alone


def _sort_modes(
    fits: list[FrfFit],
    peak_and_width: tuple[float, float],
    min_contrast: float,
    damping_maximum: float,
    power: float,
    modes: list[FrfMode],
    rejected: list[dict],
) -> None:
    """Append every mode of a band to ``modes``, or to ``rejected`` with the reason."""
    theta = np.array([fit.theta for fit in fits])
    error = np.array([fit.error for fit in fits])
    error = np.maximum(error, MIN_ERROR_SHARE * np.median(error, axis=0))
    height = np.median([fit.contrast for fit in fits], axis=0)
    for m in range(theta.shape[1]):
        log_f, damping = (summarise(theta[:, m, p], error[:, m, p]) for p in range(2))
        frequency = _from_logarithm(log_f)
        checks = (
            ("damping not above zero", damping.mean, 1e-6, False),
            ("damping too high", damping.mean, damping_maximum, True),
            ("outside its peak", abs(frequency.mean - peak_and_width[0]), 2.0 * peak_and_width[1], True),
            ("too weak over the residual", height[m], min_contrast, False),
            ("damping too uncertain", damping.se / max(abs(damping.mean), 1e-300), 0.3, True),
        )
        failed = [(reason, v, limit) for reason, v, limit, upper in checks if ((v > limit) if upper else (v < limit))]
        if failed:
            reason, value, limit = failed[0]
            entry = {"frequency": frequency.mean, "damping": damping.mean, "reason": reason}
            rejected.append(entry | {"value": float(value), "limit": limit})
        else:
            pole = continuous_pole(frequency.mean, damping.mean)
            residue = np.array([fit.residue[m, 0] for fit in fits]) * (pole / 2j / np.pi) ** power
            modes.append(FrfMode(frequency, damping, residue, float(height[m])))


def _from_logarithm(s: Summary) -> Summary:
    """Summary of ln f as one of f."""
    mean = float(np.exp(s.mean))
    return Summary(
        mean, mean * s.se, float(np.exp(s.low)), float(np.exp(s.high)), mean * s.spread, s.n, mean * s.repeatability
    )


def _without_duplicates(modes: Sequence[FrfMode], rejected: list[dict]) -> list[FrfMode]:
    """One mode per resonance: of two closer than half their half-power width, the one with more contrast."""
    unique: list[FrfMode] = []
    for mode in modes:
        f, zeta = mode.frequency.mean, mode.damping.mean
        if unique and f - unique[-1].frequency.mean < 0.5 * zeta * f:
            weaker = min(unique[-1], mode, key=lambda m: m.contrast)
            if weaker is unique[-1]:
                unique[-1] = mode
            rejected.append(
                {
                    "frequency": weaker.frequency.mean,
                    "damping": weaker.damping.mean,
                    "reason": "the same resonance as a neighbour",
                    "value": weaker.contrast,
                    "limit": None,
                }
            )
        else:
            unique.append(mode)
    return unique
