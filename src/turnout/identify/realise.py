"""State-space pairs in the balanced form in which the paper prints its models."""

import numpy as np
from scipy.linalg import solve_discrete_lyapunov


def balanced_pair(pole: complex, residue: complex) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""Real pair with a12 = -a21, b = diag(1, -1) c^T and diagonal Gramians for :math:`y_k = \mathrm{Re}(R z^k)`.

    The Hankel matrix of a scalar decay is symmetric, H = U diag(w) U^T, so one state enters with each sign.
    Signs of the states are chosen so that a12 < 0 and c2 > 0.

    Parameters
    ----------
    pole : complex
        z in the upper half plane, inside the unit circle.
    residue : complex
        R, not 0.

    Returns
    -------
    a (2, 2), b (2,), c (2,)

    References
    ----------
    Barkhordari et al., eq. 20; Moore 1981 for balancing.

    Examples
    --------
    >>> a, b, c = balanced_pair(0.99 + 0.03j, 1.0 - 0.4j)
    >>> bool(np.isclose(a[0, 1], -a[1, 0])), bool(np.allclose(b, c * [1, -1]))
    (True, True)
    """
    root = np.sqrt(residue / 2.0)
    a = np.array([[pole.real, -pole.imag], [pole.imag, pole.real]])
    c = np.sqrt(2.0) * np.array([root.real, -root.imag])
    gramian = solve_discrete_lyapunov(a.T, np.outer(c, c))
    # diag(1, -1) survives hyperbolic rotations only: turn until the observability Gramian is diagonal.
    turn = -0.5 * np.arctanh(2.0 * gramian[0, 1] / (gramian[0, 0] + gramian[1, 1]))
    rotation = np.array([[np.cosh(turn), np.sinh(turn)], [np.sinh(turn), np.cosh(turn)]])
    a = np.linalg.solve(rotation, a @ rotation)
    c = c @ rotation
    signs = np.array([1.0, 1.0])
    if a[0, 1] > 0.0:
        signs[0] = -1.0
    if c[1] < 0.0:
        signs = -signs
    a, c = a * np.outer(signs, signs), c * signs
    return a, c * (1.0, -1.0), c


def block_model(poles, residues) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A block-diagonal, b and c of several modes in turn: (2m, 2m), (2m,), (2m,)."""
    order = 2 * len(poles)
    a, b, c = np.zeros((order, order)), np.zeros(order), np.zeros(order)
    for i, (pole, residue) in enumerate(zip(poles, residues, strict=True)):
        part = slice(2 * i, 2 * i + 2)
        a[part, part], b[part], c[part] = balanced_pair(complex(pole), complex(residue))
    return a, b, c
