"""What it costs that one explanation of the decays had to be chosen: how far the others put the same mode."""

import numpy as np


def choice_error(mode, others, farthest: float) -> np.ndarray:
    r"""Root mean square distance of a mode in all explanations from where the chosen one has it.

    .. math:: \sqrt{\frac{1}{J} \sum_{j=1}^{J} (\theta_j - \theta)^2}, \quad \theta_1 = \theta

    All explanations count alike. Their criteria would give nearly all weight to one: 18,000 samples tell two wrong
    models apart with certainty, and say nothing about which of them has this mode right.

    Parameters
    ----------
    mode : (2,) array of float
        ln f [Hz] and zeta in the chosen explanation.
    others : list of (n_mode, 2) arrays of float
        Modes of the others.
    farthest : float
        Distance in ln f beyond which it is another mode: an explanation without this one says nothing about it.

    Returns
    -------
    (2,) array of float
        Of ln f and zeta; 0 without others.

    References
    ----------
    Buckland, Burnham and Augustin 1997, Model selection: an integral part of inference, eq. 9, with equal weights.

    Examples
    --------
    >>> mode, other = np.array([4.60, 0.20]), np.array([[4.64, 0.17], [6.0, 0.05]])
    >>> print(choice_error(mode, [other, other, other], 0.15).round(3), choice_error(mode, [], 0.15))
    [0.035 0.026] [0. 0.]
    """
    square, n = np.zeros(2), 1
    for modes in others:
        away = np.abs(modes - mode)
        nearest = int(np.argmin(away @ [1.0, 0.5]))
        if away[nearest, 0] < farthest:
            square += away[nearest] ** 2
            n += 1
    return np.sqrt(square / n)
