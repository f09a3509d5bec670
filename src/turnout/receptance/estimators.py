"""Estimators of a frequency response from averaged spectra, and how well they agree."""

import numpy as np


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
    A mass of 2 kg that answers with half its force:

    >>> print(h1(np.array([4.0]), np.array([2.0 + 0.0j])))
    [0.5+0.j]
    """
    return _quotient(g_fa, g_ff)


def h2(g_aa: np.ndarray, g_fa: np.ndarray) -> np.ndarray:
    r"""Accelerance if the noise is on the force: :math:`H_2 = G_{aa} / G_{aF}`, with :math:`G_{aF} = G_{Fa}^*`.

    Always :math:`H_1 / \gamma^2`, so it lies above H1 and closes the bracket.

    References
    ----------
    Barkhordari et al., eq. 3, with the conjugate that makes the phase come out right.

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
    eigenvector of the matrix of spectra, each channel measured in its own noise:

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
    Equal spectra and equal noise on both leave no doubt that the response is one to one:

    >>> print(hv(np.array([5.0]), np.array([5.0]), np.array([4.0j]), 1.0))
    [0.+1.j]
    """
    if np.isinf(noise_ratio):
        return h1(g_ff, g_fa)
    if noise_ratio == 0.0:
        return h2(g_aa, g_fa)
    gap = g_aa - noise_ratio**2 * g_ff
    root = np.sqrt(gap**2 + 4.0 * noise_ratio**2 * np.abs(g_fa) ** 2)
    # Of the two equal forms each is used where it does not subtract neighbours.
    steep = _quotient(gap + root, 2.0 * np.conj(g_fa))
    flat = _quotient(2.0 * noise_ratio**2 * g_fa, root - gap)
    return np.where(gap > 0.0, steep, flat)


def coherence(g_ff: np.ndarray, g_aa: np.ndarray, g_fa: np.ndarray) -> np.ndarray:
    r"""Magnitude-squared coherence :math:`|G_{Fa}|^2 / (G_{FF} G_{aa})`, (n_frequency,), nan without power.

    Of one record it is 1 at every frequency and says nothing.

    References
    ----------
    Barkhordari et al., eq. 2.

    >>> print(coherence(np.array([4.0]), np.array([4.0]), np.array([2.0 + 2.0j])))
    [0.5]
    """
    return np.minimum(_quotient(np.abs(g_fa) ** 2, g_ff * g_aa), 1.0)


def _quotient(above, below):
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(below == 0.0, np.nan, above / np.where(below == 0.0, 1.0, below))
