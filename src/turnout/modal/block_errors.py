"""Errors of the state matrix and the output vector of a mode, as the paper prints them in its Tables 1 and 2."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.modal.poles import discrete_pole
from turnout.modal.state_space import balanced_pair

if TYPE_CHECKING:
    from turnout.records import ModalModel

STEP = 1e-3  # of the standard errors, for the derivatives


def residue_of_block(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> complex:
    r"""Residue R of the response :math:`c A^k b = \mathrm{Re}(R z^k)` of a second-order block.

    Parameters
    ----------
    a, b, c : (2, 2), (2,) and (2,) arrays of float
        State matrix with a complex pair of eigenvalues, input and output vector.

    Returns
    -------
    complex
        The residue of the eigenvalue z in the upper half plane.

    Examples
    --------
    >>> print(f"{residue_of_block(*balanced_pair(0.99 + 0.03j, 1.0 - 0.4j)):.3f}")
    1.000-0.400j
    """
    pole = complex(np.linalg.eigvals(a)[0])
    pole = pole if pole.imag > 0.0 else pole.conjugate()
    real = float(c @ b)
    return complex(real, (real * pole.real - float(c @ a @ b)) / pole.imag)


def blocks_with_errors(model: ModalModel) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    r"""Entries a11, a12, a21, a22, c1, c2 of each mode's block, with standard errors.

    .. math:: \mathrm{var}(x) = \sum_p \left(\frac{\partial x}{\partial p}\right)^2 \mathrm{var}(p), \quad
              p = \ln f, \zeta, \mathrm{Re} R, \mathrm{Im} R

    Parameters
    ----------
    model : ModalModel
        Its modes with standard errors; the errors of the residues come from its fitted receptance.

    Returns
    -------
    tuple of ((6,) array of float, (6,) array of float)
        Values and standard errors of each mode, in the order of ``model.modes``. The errors of c are nan without a
        fitted receptance, all are nan without errors of the mode.

    References
    ----------
    Barkhordari et al., Tables 1 and 2, which do not define their ±.
    """
    result = []
    for k, mode in enumerate(model.modes):
        block = slice(2 * k, 2 * k + 2)
        a, b, c = model.a[block, block], model.b[block], model.c[block]
        residue = residue_of_block(a, b, c)
        fitted = model.fitted_receptance
        is_from_receptance = fitted is not None and str(model.diagnostics.get("scale", "")).startswith("unit impulse")
        residue_se = (
            complex(fitted.residue_se[k]) if fitted is not None and is_from_receptance else complex(np.nan, np.nan)
        )
        value = np.array([np.log(mode.frequency), mode.damping, residue.real, residue.imag])
        error = np.array([
            np.nan if mode.frequency_se is None else mode.frequency_se / mode.frequency,
            np.nan if mode.damping_se is None else mode.damping_se,
            residue_se.real,
            residue_se.imag,
        ])  # fmt: skip
        entries = np.concatenate([a.ravel(), c])
        result.append((entries, _propagate(value, error, model.rate)))
    return tuple(result)


def _propagate(value: np.ndarray, error: np.ndarray, rate: float) -> np.ndarray:
    """Standard errors (6,) of the entries; those of a without errors of the residue neglect them."""
    variance = np.zeros(6)
    for p in range(4):
        if np.isnan(error[p]) and p >= 2:
            variance[4:] = np.nan
            continue
        step = np.zeros(4)
        step[p] = max(STEP * error[p], 1e-9 * max(1.0, abs(value[p]))) if np.isfinite(error[p]) else 1e-9
        slope = (_entries(value + step, rate) - _entries(value - step, rate)) / (2.0 * step[p])
        variance = variance + (slope * error[p]) ** 2
    return np.sqrt(variance)


def _entries(value: np.ndarray, rate: float) -> np.ndarray:
    pole = complex(discrete_pole(np.exp(value[0]), value[1], rate))
    a, _, c = balanced_pair(pole, complex(value[2], value[3]))
    return np.concatenate([a.ravel(), c])
