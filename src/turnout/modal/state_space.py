"""Assemble modes, residues and diagnostics into a modal model with a state space.

The state-space pairs have the balanced form in which the paper prints its models.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from turnout.modal.decay_fit import held_out_fit, random_mode_fits
from turnout.modal.poles import discrete_pole
from turnout.records import ModalModel, Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from turnout.config.settings.identify import IdentifySettings
    from turnout.modal.summary import ImpactEstimates
    from turnout.records import Mode


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


def block_model(
    poles: Sequence[complex] | Sequence[np.ndarray] | np.ndarray, residues: Sequence[complex] | np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Block-diagonal state matrix of several modes in turn.

    Parameters
    ----------
    poles : (m,) array of complex
        Poles in the upper half plane, inside the unit circle.
    residues : (m,) array of complex
        Residue of each pole, not 0.

    Returns
    -------
    (2m, 2m), (2m,) and (2m,) arrays of float
        State matrix, input and output vector.
    """
    order = 2 * len(poles)
    a, b, c = np.zeros((order, order)), np.zeros(order), np.zeros(order)
    for i, (pole, residue) in enumerate(zip(poles, residues, strict=True)):
        block = slice(2 * i, 2 * i + 2)
        a[block, block], b[block], c[block] = balanced_pair(complex(pole), complex(residue))
    return a, b, c


def assemble(
    estimates: Sequence[ImpactEstimates],
    modes: tuple[Mode, ...],
    residues: np.ndarray,
    validation_set: tuple[np.ndarray, np.ndarray],
    rate: float,
    settings: IdentifySettings,
    *,
    method: str,
    status: str,
    diagnostics: dict[str, Any],
    scale: str,
    **model_fields: Any,
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
        Bands, and number of random mode sets.
    method : str
        Name of the method, "joint" or "paper".
    status : str
        "accepted" or "second_order_only".
    diagnostics : dict
        Diagnostics of the fit, to which those of the model are added.
    scale : str
        What the residues are the response to, with their unit.
    model_fields
        ``rejections``, ``rejected_modes``, ``stabilisation`` of the model.

    Returns
    -------
    ModalModel
        The model, with its fits in ``diagnostics``.
    """
    a, b, c = block_model([discrete_pole(m.frequency, m.damping, rate) for m in modes], residues)
    theta, records = validation_set
    fits = held_out_fit(theta, records, rate)
    edges = {name: (low, high) for name, low, high in settings.bands()}
    bands = [edges[mode.band] for mode in modes]
    random_fits = random_mode_fits(records, rate, bands, settings.null_draws) if len(records) else None
    fit_results = {
        "fit_per_impact": tuple(float(f) for f in fits),
        "fit_null": None if random_fits is None else float(np.quantile(random_fits, 0.95, method="weibull")),
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


def no_model(
    rate: float, method: str, rejections: tuple[Rejection, ...], diagnostics: dict[str, Any], **extras: Any
) -> ModalModel:
    """A rejected model, with its reasons.

    Parameters
    ----------
    rate : float
        Sampling rate. [Hz]
    method : str
        Name of the method.
    rejections : tuple of Rejection
        Reasons.
    diagnostics : dict
        Diagnostics of the fit.
    **extras : Any
        Further fields of ``ModalModel``.

    Returns
    -------
    ModalModel
        Model of order 0.
    """
    empty = np.empty(0)
    return ModalModel(
        np.empty((0, 0)), empty, empty, rate, (), method, "rejected", rejections, diagnostics=diagnostics, **extras
    )


def no_decays(rate: float, method: str, rejected: Sequence[tuple[int, Rejection]]) -> ModalModel:
    """A rejected model without a usable decay.

    Parameters
    ----------
    rate : float
        Sampling rate. [Hz]
    method : str
        Name of the method.
    rejected : sequence of (int, Rejection)
        Number of each impact, and why its decay is not usable.

    Returns
    -------
    ModalModel
        Model of order 0.
    """
    rejection = Rejection("not_identified", 0, 1, "no decay is long enough" if rejected else "no decays")
    return no_model(rate, method, (rejection, *(r for _, r in rejected)), {"rejected_impacts": tuple(rejected)})
