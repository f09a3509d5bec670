"""Auto- and cross-spectra averaged over records, and the interval of an averaged spectral density."""

import numpy as np
from scipy.fft import next_fast_len, rfft, rfftfreq
from scipy.stats import chi2


def cross_spectra(
    x: np.ndarray, y: np.ndarray, rate: float, n_fft: int | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    r"""Averaged one-sided spectral densities of two signals recorded together.

    .. math:: G_{xy}(f) = \frac{2}{f_s N K} \sum_{k=1}^{K} X_k^*(f)\, Y_k(f)

    The factor 2 is 1 at 0 Hz and at the Nyquist frequency. The conjugate stands on the *first* signal, so a
    response y that lags its cause x gives a negative phase and ``G_xy / G_xx`` is the H1 estimator.

    Parameters
    ----------
    x, y : (n_record, n_sample) array of float
        Records without window, or already windowed. [any unit u, v]
    rate : float
        Sampling rate. [Hz]
    n_fft : int, optional
        Transform length, at least n_sample; zeros are appended. Default: the next fast length.

    Returns
    -------
    frequency : (n_frequency,) array of float
        From 0 to half the rate. [Hz]
    g_xx, g_yy : (n_frequency,) array of float
        [u²/Hz], [v²/Hz]
    g_xy : (n_frequency,) array of complex
        [u v/Hz]

    Raises
    ------
    ValueError
        Shapes differ or the transform is shorter than the records.

    References
    ----------
    Barkhordari et al., eqs. 1 and 2, which leave open which signal is conjugated; Bendat and Piersol,
    Random Data, 4th ed., eq. 5.67.

    Examples
    --------
    Parseval: white noise of variance 4 sampled at 100 Hz has the density 4/50 per Hz.

    >>> x = 2.0 * np.random.default_rng(1).standard_normal((200, 500))
    >>> frequency, g_xx, _, _ = cross_spectra(x, x, rate=100.0)
    >>> print(f"{np.mean(g_xx[1:-1]):.2f}")
    0.08
    """
    x, y = np.atleast_2d(x), np.atleast_2d(y)
    if x.shape != y.shape:
        raise ValueError(f"need records of one shape, got {x.shape} and {y.shape}")
    n_record, n_sample = x.shape
    n_fft = next_fast_len(n_sample, real=True) if n_fft is None else int(n_fft)
    if n_fft < n_sample:
        raise ValueError(f"a transform of {n_fft} samples would cut records of {n_sample}")
    spectrum_x, spectrum_y = rfft(x, n_fft), rfft(y, n_fft)
    scale = np.full(spectrum_x.shape[1], 2.0 / (rate * n_sample * n_record))
    scale[0] /= 2.0
    if n_fft % 2 == 0:
        scale[-1] /= 2.0
    g_xx = scale * np.sum(spectrum_x.real**2 + spectrum_x.imag**2, axis=0)
    g_yy = scale * np.sum(spectrum_y.real**2 + spectrum_y.imag**2, axis=0)
    g_xy = scale * np.sum(spectrum_x.conj() * spectrum_y, axis=0)
    return rfftfreq(n_fft, 1.0 / rate), g_xx, g_yy, g_xy


def spectral_density(x: np.ndarray, rate: float, n_segment: int) -> tuple[np.ndarray, np.ndarray, int]:
    """One-sided power spectral density averaged over adjoining segments without window.

    Parameters
    ----------
    x : (n_sample,) array of float
        [any unit u]
    rate : float
        [Hz]
    n_segment : int
        Samples per segment; an incomplete last segment is dropped.

    Returns
    -------
    frequency, density : (n_frequency,) array of float
        [Hz], [u²/Hz]
    n : int
        Number of segments averaged: what ``density_interval`` needs.

    Examples
    --------
    A sine of amplitude 3 that fits its segment carries the power 9/2, all in one line of 5 Hz width.

    >>> t = np.arange(4000) / 1000.0
    >>> frequency, density, n = spectral_density(3.0 * np.sin(2 * np.pi * 50.0 * t), 1000.0, 200)
    >>> print(f"{density[10] * 5.0:.3f} at {frequency[10]:.0f} Hz from {n} segments")
    4.500 at 50 Hz from 20 segments
    """
    x = np.asarray(x, dtype=float)
    n = x.size // n_segment
    if n < 1:
        raise ValueError(f"{x.size} samples hold no segment of {n_segment}")
    segments = x[: n * n_segment].reshape(n, n_segment)
    frequency, density, _, _ = cross_spectra(segments, segments, rate, n_segment)
    return frequency, density, n


def density_interval(n: int, level: float = 0.95) -> tuple[float, float]:
    r"""Factors that turn an averaged spectral density into its confidence limits.

    .. math:: \left[\nu / \chi^2_\nu\big((1+p)/2\big),\ \nu / \chi^2_\nu\big((1-p)/2\big)\right],\quad \nu = 2K

    Parameters
    ----------
    n : int
        Number K of averaged records without window or overlap.
    level : float
        Probability p that the limits enclose the true density.

    Returns
    -------
    low, high : float
        Multiply the density by them; in decibel add 10 log10 of them.

    References
    ----------
    Barkhordari et al., eq. 18, which prints 10 ln instead of 10 log10.

    Examples
    --------
    Thirty impacts know a density to -1.4 and +1.7 dB.

    >>> print("{:+.1f} {:+.1f} dB".format(*10 * np.log10(density_interval(30))))
    -1.4 +1.7 dB
    """
    nu = 2 * n
    return float(nu / chi2.ppf(0.5 + level / 2, nu)), float(nu / chi2.ppf(0.5 - level / 2, nu))
