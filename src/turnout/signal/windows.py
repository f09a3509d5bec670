"""Windows of an impact test, and how they are taken out of the result again."""

import numpy as np


def force_window(n_sample: int, contact_end: int, taper: int) -> np.ndarray:
    """One until the end of contact, then a half-cosine down to zero over ``taper`` samples.

    It removes noise of the force channel where the hammer touches nothing. Shape (n_sample,), no unit.

    >>> print(force_window(6, 2, 2).round(2))
    [1.  1.  1.  0.5 0.  0. ]
    """
    k = np.arange(n_sample) - contact_end
    return 0.5 * (1.0 + np.cos(np.pi * np.clip(k / max(taper, 1), 0.0, 1.0)))


def exponential_window(n_sample: int, onset: int, decay: float, rate: float) -> np.ndarray:
    r"""Window :math:`e^{-a (t - t_0)}` for response *and* force alike, 1 up to :math:`t_0`.

    Nothing but noise is ahead of the blow, and must not become louder. The windowed pair obeys
    :math:`A_w(i\omega) = A(i\omega + a)`: the ratio of the two spectra is the frequency response taken on a line that
    lies ``decay`` to the right of the imaginary axis. Hence its scale is right as it stands, every pole appears shifted
    by -a (``correct_poles``), and displacement follows from acceleration by :math:`(i\omega + a)^2`, not by
    :math:`-\omega^2`.

    Parameters
    ----------
    n_sample, onset : int
        Length, and the last sample at which the window is 1.
    decay : float
        a, 0 or more, else ValueError. [1/s]
    rate : float
        [Hz]

    Examples
    --------
    >>> print(exponential_window(4, 1, np.log(2.0), 1.0))
    [1.   1.   0.5  0.25]
    """
    if decay < 0.0:
        raise ValueError(f"a window must decay, got a rate of {decay} 1/s")
    return np.exp(-decay * np.maximum(np.arange(n_sample) - onset, 0) / rate)


def correct_poles(poles: np.ndarray | complex, decay: float) -> np.ndarray:
    r"""Poles of the structure from poles seen through an exponential window: :math:`s = s_w + a`.

    Correct the pole and compute natural frequency and damping ratio from it; a damping ratio alone cannot be
    corrected, since the window moves the natural frequency too. Amplitudes (residues) are never rescaled.

    Parameters
    ----------
    poles : (n,) array of complex
        Continuous-time poles. [1/s]
    decay : float
        a of the window. [1/s]

    Examples
    --------
    An undamped 100 Hz oscillation behind a window of 50 1/s:

    >>> s = correct_poles(np.array([-50 + 2j * np.pi * 100]), 50.0)
    >>> print(f"{abs(s[0]) / (2 * np.pi):.1f} Hz, damping {abs(s[0].real):.1f}")
    100.0 Hz, damping 0.0
    """
    return np.asarray(poles) + decay
