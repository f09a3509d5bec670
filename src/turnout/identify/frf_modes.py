"""Modes of measured frequency responses, not told how many there are nor where."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks, peak_widths

from turnout.identify.frf_fit import FrfFit, fit_each
from turnout.identify.frf_poles import zoomed_poles
from turnout.identify.summary import Summary, summarise

WIDTHS = 12.0
FEWEST_LINES = 40
MOST_LINES = 600


@dataclass(frozen=True)
class FrfMode:
    """A mode of several responses: ``frequency`` [Hz] and ``damping`` over the responses, ``contrast`` [dB].

    ``residue`` (n_frf,) complex is that of :math:`R / (i\\omega - s)`, in the unit of the response times 1/s;
    the contrast is the height of the resonance over what the fit leaves.
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
    frequency,
    frf,
    lowest: float = 0.0,
    highest: float = np.inf,
    prominence: float = 12.0,
    contrast: float = 15.0,
    damping_maximum: float = 0.3,
) -> FrfModes:
    r"""Resonances of one or several responses with common poles.

    Peaks of the summed power say where to look. There the band is turned into a decay, realisations of several
    orders propose poles, and those that reappear are fitted by least squares with a local polynomial for all other
    modes. Each response is fitted alone, for a moved sensor or hammer shifts the poles by its mass; the mean and its
    errors come from the spread between responses.

    Parameters
    ----------
    frequency : (n_line,) array of float
        Evenly spaced. [Hz]
    frf : (n_line,) or (n_frf, n_line) array of complex
        Receptance, mobility or accelerance: the poles are the same.
    lowest, highest : float
        Where to look. [Hz]
    prominence : float
        Of a peak in the summed power. [dB]
    contrast : float
        Least height of a mode over the residual of its fit. [dB]
    damping_maximum : float

    Returns
    -------
    FrfModes
        Fewer modes rather than wrong ones: a peak that is no resonance is among ``rejected``, with the reason.

    Raises
    ------
    ValueError
        Uneven or too few lines, or values that are not finite.

    Examples
    --------
    One mode at 100 Hz, 1 % damping, seen on a grid of 0.5 Hz.

    >>> f = np.arange(1.0, 1001.0) * 0.5
    >>> h = 1.0 / (100.0**2 - f**2 + 2j * 0.01 * 100.0 * f)
    >>> (mode,) = modes_of_frf(f, h).modes
    >>> print(f"{mode.frequency.mean:.2f} Hz, {100 * mode.damping.mean:.2f} %")
    100.00 Hz, 1.00 %
    """
    frequency, frf = np.asarray(frequency, float), np.atleast_2d(np.asarray(frf))
    _check(frequency, frf)
    step = frequency[1] - frequency[0]
    power = np.mean(np.abs(frf) ** 2, axis=0)
    level = 10.0 * np.log10(np.maximum(power, 1e-30 * power.max()))
    peaks, _ = find_peaks(level, prominence=prominence)
    peaks = peaks[(frequency[peaks] >= lowest) & (frequency[peaks] <= highest)]
    widths = peak_widths(power, peaks, rel_height=0.5)[0]
    modes: list[FrfMode] = []
    rejected: list[dict] = []
    for peak, width in zip(peaks, widths, strict=True):
        half = int(np.clip(WIDTHS * width, FEWEST_LINES, MOST_LINES) / 2)
        band = slice(max(0, peak - half), peak + half + 1)
        near = (frequency[peak], max(width, 1.0) * step)
        start = zoomed_poles(frequency[band], frf[:, band], *near, damping_maximum)
        fits = fit_each(start, frequency[band], frf[:, band], near)
        _sort(fits, near, contrast, damping_maximum, modes, rejected)
    modes.sort(key=lambda m: m.frequency.mean)
    return FrfModes(tuple(_without_doubles(modes, rejected)), tuple(rejected))


def _check(frequency, frf):
    if frf.shape[1] != len(frequency) or len(frequency) < FEWEST_LINES:
        raise ValueError(f"{frf.shape} responses over {len(frequency)} lines; need at least {FEWEST_LINES} lines")
    if not (np.all(np.isfinite(frf)) and np.all(np.isfinite(frequency))):
        raise ValueError("the responses or their frequencies hold values that are not finite")
    gap = np.diff(frequency)
    if not np.allclose(gap, gap[0], rtol=1e-3) or gap[0] <= 0.0:
        raise ValueError(f"need evenly spaced frequencies, the steps go from {gap.min():g} to {gap.max():g} Hz")


def _sort(fits: list[FrfFit], near, least_contrast, damping_maximum, modes, rejected):
    """Every mode of a band to those accepted or to those rejected with the reason."""
    theta = np.array([fit.theta for fit in fits])
    error = np.array([fit.error for fit in fits])
    height = np.median([fit.contrast for fit in fits], axis=0)
    for m in range(theta.shape[1]):
        log_f, damping = (summarise(theta[:, m, p], error[:, m, p]) for p in range(2))
        frequency = _exponential(log_f)
        checks = (
            ("damping not above zero", damping.mean, 1e-6, False),
            ("damping too high", damping.mean, damping_maximum, True),
            ("outside its peak", abs(frequency.mean - near[0]), 2.0 * near[1], True),
            ("too weak over the residual", height[m], least_contrast, False),
            ("damping too uncertain", damping.se / max(abs(damping.mean), 1e-300), 0.3, True),
        )
        failed = [(why, v, limit) for why, v, limit, upper in checks if ((v > limit) if upper else (v < limit))]
        if failed:
            why, value, limit = failed[0]
            entry = {"frequency": frequency.mean, "damping": damping.mean, "reason": why}
            rejected.append(entry | {"value": float(value), "limit": limit})
        else:
            residue = np.array([fit.residue[m, 0] for fit in fits])
            modes.append(FrfMode(frequency, damping, residue, float(height[m])))


def _exponential(s: Summary) -> Summary:
    """Summary of ln f as one of f."""
    mean = float(np.exp(s.mean))
    return Summary(mean, mean * s.se, float(np.exp(s.low)), float(np.exp(s.high)), mean * s.spread, s.n)


def _without_doubles(modes, rejected):
    """One mode per resonance: of two that agree within their half widths, the one with more contrast."""
    kept: list[FrfMode] = []
    for mode in modes:
        f, zeta = mode.frequency.mean, mode.damping.mean
        if kept and f - kept[-1].frequency.mean < 0.5 * zeta * f:
            weaker = min(kept[-1], mode, key=lambda m: m.contrast)
            if weaker is kept[-1]:
                kept[-1] = mode
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
            kept.append(mode)
    return kept
