"""Average auto- and cross-spectra over records, with the confidence interval of a spectral density.

The module also has the windows of an impact test and the correction of poles for the exponential window.
"""

import numpy as np
import scipy
from scipy.fft import next_fast_len, rfft, rfftfreq


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
    Thirty impacts determine a density to -1.4 and +1.7 dB.

    >>> print("{:+z.1f} {:+z.1f} dB".format(*10 * np.log10(density_interval(30))))
    -1.4 +1.7 dB
    """
    nu = 2 * n
    return float(nu / scipy.stats.chi2.ppf(0.5 + level / 2, nu)), float(nu / scipy.stats.chi2.ppf(0.5 - level / 2, nu))


def force_window(n_sample: int, contact_end: int, taper: int) -> np.ndarray:
    """One until the end of contact, then a half-cosine down to zero over ``taper`` samples.

    It removes noise of the force channel after the contact. Shape (n_sample,), no unit.

    Parameters
    ----------
    n_sample : int
        Length of the window.
    contact_end : int
        First sample after the contact.
    taper : int
        Samples of the half-cosine.

    Returns
    -------
    (n_sample,) array of float
        Factors. [-]

    Examples
    --------
    >>> print(force_window(6, 2, 2).round(2))
    [1.  1.  1.  0.5 0.  0. ]
    """
    k = np.arange(n_sample) - contact_end
    return 0.5 * (1.0 + np.cos(np.pi * np.clip(k / max(taper, 1), 0.0, 1.0)))


def exponential_window(n_sample: int, onset: int, decay: float, rate: float) -> np.ndarray:
    r"""Window :math:`e^{-a (t - t_0)}` for response *and* force alike, 1 up to :math:`t_0`.

    Before the impact there is only noise, which must not be amplified. The windowed pair obeys
    :math:`A_w(i\omega) = A(i\omega + a)`: the ratio of the two spectra is the frequency response on a line that lies
    ``decay`` to the right of the imaginary axis. Hence its scale needs no correction, every pole appears shifted by -a
    (``correct_poles``), and displacement follows from acceleration by :math:`(i\omega + a)^2`, not by
    :math:`-\omega^2`.

    Parameters
    ----------
    n_sample, onset : int
        Length, and the last sample at which the window is 1.
    decay : float
        a, 0 or more, else ValueError. [1/s]
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    (n_sample,) array of float
        Factors. [-]

    Raises
    ------
    ValueError
        ``decay`` is negative.

    Examples
    --------
    >>> print(exponential_window(4, 1, np.log(2.0), 1.0))
    [1.   1.   0.5  0.25]
    """
    if decay < 0.0:
        raise ValueError(f"a window must decay, got a rate of {decay} 1/s")
    return np.exp(-decay * np.maximum(np.arange(n_sample) - onset, 0) / rate)


def correct_poles(poles: np.ndarray | complex, decay: float) -> np.ndarray:
    """Poles of the structure from poles estimated behind an exponential window: :math:`s = s_w + a`.

    Correct the pole and compute natural frequency and damping ratio from it. A damping ratio alone cannot be
    corrected, since the window shifts the natural frequency too. Amplitudes (residues) are never rescaled.

    Parameters
    ----------
    poles : (n,) array of complex
        Continuous-time poles. [1/s]
    decay : float
        a of the window. [1/s]

    Returns
    -------
    (n,) array of complex
        Poles of the structure. [1/s]

    Examples
    --------
    An undamped 100 Hz oscillation behind a window of 50 1/s:

    >>> s = correct_poles(np.array([-50 + 2j * np.pi * 100]), 50.0)
    >>> print(f"{abs(s[0]) / (2 * np.pi):.1f} Hz, damping {abs(s[0].real):.1f}")
    100.0 Hz, damping 0.0
    """
    return np.asarray(poles) + decay
