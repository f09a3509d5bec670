"""Assemble modes, residues and diagnostics into a modal model with a state space.

The state-space pairs have the balanced form in which the paper prints its models.
"""

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from turnout.modal.held_out import held_out_fit, random_mode_fits
from turnout.modal.poles import discrete_pole
from turnout.records import ModalModel, Rejection


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
    # Only hyperbolic rotations preserve diag(1, -1): rotate until the observability Gramian is diagonal.
    angle = -0.5 * np.arctanh(2.0 * gramian[0, 1] / (gramian[0, 0] + gramian[1, 1]))
    rotation = np.array([[np.cosh(angle), np.sinh(angle)], [np.sinh(angle), np.cosh(angle)]])
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
        block = slice(2 * i, 2 * i + 2)
        a[block, block], b[block], c[block] = balanced_pair(complex(pole), complex(residue))
    return a, b, c


def assemble(
    estimates,
    modes,
    residues,
    validation_set,
    rate: float,
    settings,
    *,
    method,
    status,
    diagnostics,
    scale,
    **model_fields,
) -> ModalModel:
    """Modal model of one section.

    Parameters
    ----------
    estimates : list of ImpactEstimates
        One for each mode.
    modes : tuple of Mode
        Their campaign values, in the order of the state vector.
    residues : (n_mode,) array of complex
        Residues of the response that ``scale`` names; ``b`` follows from them.
    validation_set : (theta, records)
        Modes (n_impact, n_mode, 2) and decays (n_impact, n) of the held-out fit.
    rate : float
        [Hz]
    settings : IdentifySettings
    model_fields
        ``rejections``, ``rejected_modes``, ``stabilisation`` of the model.
    """
    a, b, c = block_model([discrete_pole(m.frequency, m.damping, rate) for m in modes], residues)
    theta, records = validation_set
    fits = held_out_fit(theta, records, rate)
    edges = {name: (low, high) for name, low, high in settings.bands()}
    bands = [edges[mode.band] for mode in modes]
    random_fits = random_mode_fits(records, rate, bands, settings.null_draws) if len(records) else None
    fit_results = {
        "fit_per_impact": tuple(float(f) for f in fits),
        "fit_null": None if random_fits is None else float(np.quantile(random_fits, 0.95)),
        "fit_null_draws": settings.null_draws,
        "scale": scale,
    }
    return ModalModel(
        a=a,
        b=b,
        c=c,
        rate=rate,
        modes=modes,
        method=method,
        status=status,
        per_impact=tuple(row for e in estimates for row in e.rows()),
        fit=float(np.median(fits)) if len(fits) and np.all(np.isfinite(fits)) else None,
        diagnostics=diagnostics | fit_results,
        **model_fields,
    )


def no_model(rate, method, rejections, diagnostics, **extras) -> ModalModel:
    """A rejected model, with its reasons."""
    empty = np.empty(0)
    return ModalModel(
        np.empty((0, 0)), empty, empty, rate, (), method, "rejected", rejections, diagnostics=diagnostics, **extras
    )


def no_decays(rate, method, dropped) -> ModalModel:
    """A rejected model without a usable decay; ``dropped`` are (impact, Rejection)."""
    rejection = Rejection("not_identified", 0, 1, "no decay is long enough" if dropped else "no decays")
    return no_model(rate, method, (rejection, *(r for _, r in dropped)), {"dropped_impacts": tuple(dropped)})
