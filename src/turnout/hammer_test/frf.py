"""Estimate the receptance of a section from its accepted impacts, with coherence limits and gate.

The estimators H1, H2 and Hv and the coherence are functions of averaged spectra.
"""

from collections.abc import Sequence

import numpy as np
from scipy.fft import next_fast_len

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.records import Impact, Receptance
from turnout.signal.coherence import coherence_limits, lower_coherence_limit
from turnout.signal.spectra import cross_spectra, exponential_window, force_window


def h1(g_ff: np.ndarray, g_fa: np.ndarray) -> np.ndarray:
    r"""Accelerance if the noise is on the response: :math:`H_1 = G_{Fa} / G_{FF}`.

    Parameters
    ----------
    g_ff : (n_frequency,) array of float
        [N²/Hz]
    g_fa : (n_frequency,) array of complex
        Mean over impacts of conj(force) * acceleration. [N m/s²/Hz]

    Returns
    -------
    (n_frequency,) array of complex
        nan where there is no force. [m/s²/N]

    References
    ----------
    Bendat and Piersol, Random Data, 4th ed., eq. 6.37.

    Examples
    --------
    A mass of 2 kg, whose acceleration is half the force:

    >>> print(h1(np.array([4.0]), np.array([2.0 + 0.0j])))
    [0.5+0.j]
    """
    return _quotient(g_fa, g_ff)


def h2(g_aa: np.ndarray, g_fa: np.ndarray) -> np.ndarray:
    r"""Accelerance if the noise is on the force: :math:`H_2 = G_{aa} / G_{aF}`, with :math:`G_{aF} = G_{Fa}^*`.

    Always :math:`H_1 / \gamma^2`, so it lies above H1 and is the upper bound.

    Parameters
    ----------
    g_aa : (n_frequency,) array of float
        Auto-spectrum of the acceleration. [(m/s²)²/Hz]
    g_fa : (n_frequency,) array of complex
        Mean over impacts of conj(force) * acceleration. [N m/s²/Hz]

    Returns
    -------
    (n_frequency,) array of complex
        nan where force and acceleration share no power. [m/s²/N]

    References
    ----------
    Barkhordari et al., eq. 3, with the conjugate that gives the correct phase.

    Examples
    --------
    A damper's acceleration leads the force by 90°, and so must its H2:

    >>> force, accelerance = 2.0, 3.0j
    >>> a = accelerance * force
    >>> print(h2(np.array([abs(a) ** 2]), np.array([np.conj(force) * a])).imag)
    [3.]
    """
    return _quotient(g_aa, np.conj(g_fa))


def hv(g_ff: np.ndarray, g_aa: np.ndarray, g_fa: np.ndarray, noise_ratio: float) -> np.ndarray:
    r"""Accelerance by total least squares, for noise on both channels.

    With :math:`g = r^2 G_{FF}` and r the ratio of the two noise densities' roots, it is the direction of the larger
    eigenvector of the matrix of spectra, each channel in units of its own noise:

    .. math:: H_v = \frac{G_{aa} - g + \sqrt{(G_{aa} - g)^2 + 4 r^2 |G_{Fa}|^2}}{2\, G_{Fa}^*}

    Parameters
    ----------
    g_ff, g_aa : (n_frequency,) array of float
        [N²/Hz], [(m/s²)²/Hz]
    g_fa : (n_frequency,) array of complex
        [N m/s²/Hz]
    noise_ratio : float
        r, noise of the acceleration over noise of the force: infinite gives H1, 0 gives H2. [m/s²/N]

    Returns
    -------
    (n_frequency,) array of complex
        Between H1 and H2 in magnitude, with their phase. [m/s²/N]

    References
    ----------
    Rocklin, Crowley and Vold 1985, A comparison of H1, H2 and Hv frequency response functions, IMAC III.

    Examples
    --------
    With equal spectra and equal noise on both channels the response is one to one:

    >>> print(hv(np.array([5.0]), np.array([5.0]), np.array([4.0j]), 1.0))
    [0.+1.j]
    """
    if np.isinf(noise_ratio):
        return h1(g_ff, g_fa)
    if noise_ratio == 0.0:
        return h2(g_aa, g_fa)
    gap = g_aa - noise_ratio**2 * g_ff
    root = np.sqrt(gap**2 + 4.0 * noise_ratio**2 * np.abs(g_fa) ** 2)
    # Two equal forms: each is used where it has no cancellation.
    steep = _quotient(gap + root, 2.0 * np.conj(g_fa))
    flat = _quotient(2.0 * noise_ratio**2 * g_fa, root - gap)
    return np.where(gap > 0.0, steep, flat)


def coherence(g_ff: np.ndarray, g_aa: np.ndarray, g_fa: np.ndarray) -> np.ndarray:
    """Magnitude-squared coherence :math:`|G_{Fa}|^2 / (G_{FF} G_{aa})`, (n_frequency,), nan without power.

    For one record it is 1 at every frequency and has no meaning.

    Parameters
    ----------
    g_ff, g_aa : (n_frequency,) array of float
        Auto-spectra of force and acceleration. [N²/Hz], [(m/s²)²/Hz]
    g_fa : (n_frequency,) array of complex
        Cross-spectrum. [N m/s²/Hz]

    Returns
    -------
    (n_frequency,) array of float
        Coherence. [-]

    References
    ----------
    Barkhordari et al., eq. 2.

    Examples
    --------
    >>> print(coherence(np.array([4.0]), np.array([4.0]), np.array([2.0 + 2.0j])))
    [0.5]
    """
    return np.minimum(_quotient(np.abs(g_fa) ** 2, g_ff * g_aa), 1.0)


def _quotient(numerator: np.ndarray, denominator: np.ndarray) -> np.ndarray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(denominator == 0.0, np.nan, numerator / np.where(denominator == 0.0, 1.0, denominator))


def receptance_of(impacts: Sequence[Impact], settings: ReceptanceSettings | None = None) -> Receptance:
    r"""Average the accepted impacts into receptance and coherence.

    .. math:: H_{1,d} = \frac{G_{Fa}}{(i\omega + a)^2\, G_{FF}}, \qquad
        H_{2,d} = \frac{G_{aa}}{(i\omega + a)^2\, G_{aF}}, \qquad a = 0 \text{ without exponential window}

    Parameters
    ----------
    impacts : sequence of Impact
        Those with rejections are left out. Records of unequal length are padded with zeros, since an accepted decay
        is complete.
    settings : ReceptanceSettings, optional
        Windows, gate and highest frequency; the defaults without one.

    Returns
    -------
    Receptance
        Frequencies above 0 Hz (a hammer test shows no static receptance) up to ``highest_frequency``. With fewer
        than ``minimum_impacts`` nothing passes the gate; without any impact the arrays are empty.

    Raises
    ------
    ValueError
        Impacts of different sampling rates.

    References
    ----------
    Barkhordari et al., eqs. 1-3.

    Examples
    --------
    A free mass of 4 kg has the receptance -1 / (m w²):

    >>> from turnout.records import Impact
    >>> f = np.zeros(1000); f[10:40] = np.sin(np.pi * np.arange(30) / 30)
    >>> impact = Impact(f, f / 4.0, 1000.0, 10, 39, 40, 1.0, 0.03, 0.019, 0.0, 0.0, 40.0)
    >>> result = receptance_of([impact, impact, impact])
    >>> print((result.h1 * (2 * np.pi * result.frequency) ** 2).real[:3].round(9), result.n)
    [-0.25 -0.25 -0.25] 3
    """
    settings = settings or ReceptanceSettings()
    accepted = [i for i in impacts if i.accepted]
    if not accepted:
        return _empty_receptance(settings)
    rate = accepted[0].rate
    if any(i.rate != rate for i in accepted):
        raise ValueError(f"impacts of one section need one sampling rate, got {sorted({i.rate for i in accepted})} Hz")
    force, acceleration = _records(accepted, settings)
    n_fft = next_fast_len(force.shape[1], real=True)
    frequency, g_ff, g_aa, g_fa = cross_spectra(force, acceleration, rate, n_fft)
    keep = (frequency > 0.0) & (frequency <= min(settings.highest_frequency, rate / 2))
    frequency, g_ff, g_aa, g_fa = frequency[keep], g_ff[keep], g_aa[keep], g_fa[keep]
    to_displacement = 1.0 / (2j * np.pi * frequency + settings.exponential_window) ** 2
    n = len(accepted)
    estimate = coherence(g_ff, g_aa, g_fa)
    low, high = coherence_limits(estimate, n)
    level = lower_coherence_limit(estimate, n)
    compared = level if settings.gate == "limit" else estimate
    return Receptance(
        frequency=frequency,
        h1=to_displacement * h1(g_ff, g_fa),
        h2=to_displacement * h2(g_aa, g_fa),
        hv=to_displacement * hv(g_ff, g_aa, g_fa, _noise_ratio(accepted)),
        coherence=estimate,
        coherence_low=low,
        coherence_high=high,
        gate_level=level,
        passed=(compared >= settings.gate_level) & (n >= settings.minimum_impacts),
        n=n,
        valid_to=float(np.median([i.band_edge for i in accepted])),
        gate=settings.gate,
        decay=settings.exponential_window,
    )


def _records(impacts: Sequence[Impact], settings: ReceptanceSettings) -> tuple[np.ndarray, np.ndarray]:
    """(n_impact, n_sample) force and acceleration, windowed and padded to the longest."""
    n_sample = max(i.force.size for i in impacts)
    force, acceleration = np.zeros((2, len(impacts), n_sample))
    for k, impact in enumerate(impacts):
        n = impact.force.size
        force[k, :n], acceleration[k, :n] = impact.force, impact.acceleration
        if settings.force_window:
            force[k, :n] *= force_window(n, impact.contact_end + 1, round(settings.decay_gap * impact.rate))
        if settings.exponential_window:
            window = exponential_window(n, impact.onset, settings.exponential_window, impact.rate)
            force[k, :n] *= window
            acceleration[k, :n] *= window
    return force, acceleration


def _noise_ratio(impacts: Sequence[Impact]) -> float:
    """Noise of the acceleration over noise of the force; infinite where the force has none."""
    force = float(np.sqrt(np.mean([i.noise_force**2 for i in impacts])))
    acceleration = float(np.sqrt(np.mean([i.noise_acceleration**2 for i in impacts])))
    return acceleration / force if force > 0.0 else np.inf


def _empty_receptance(settings: ReceptanceSettings) -> Receptance:
    no_values, no_complex = np.empty(0), np.empty(0, dtype=complex)
    return Receptance(
        no_values,
        no_complex,
        no_complex,
        no_complex,
        no_values,
        no_values,
        no_values,
        no_values,
        np.empty(0, dtype=bool),
        0,
        float("nan"),
        settings.gate,
    )
