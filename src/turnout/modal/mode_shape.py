"""Two-point shape of each mode: its amplitude at a second response over that at the first one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.modal.least_squares import linearise
from turnout.modal.noise import Background

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.records import ModalModel

MIN_IMPACTS = 3  # with fewer the covariance of two numbers cannot be inverted


@dataclass(frozen=True)
class TwoPointShape:
    """``ratio`` complex, second over first response, and ``covariance`` (2, 2) of its real and imaginary part."""

    ratio: complex
    covariance: np.ndarray


def two_point_shapes(
    model: ModalModel, first: Sequence[np.ndarray], second: Sequence[np.ndarray]
) -> list[TwoPointShape] | None:
    r"""Ratio of the amplitudes of each mode of a model at two points, over the impacts.

    .. math:: r = \frac{\sum_i \bar\alpha_{1i} \alpha_{2i}}{\sum_i |\alpha_{1i}|^2}, \quad
              e_i = \frac{\bar\alpha_{1i} (\alpha_{2i} - r \alpha_{1i})}{\sum_i |\alpha_{1i}|^2}, \quad
              \mathrm{cov}(r) = \frac{n}{n-1} \sum_i e_i e_i^T

    All modes, drift and hum of the model's fit are fitted to both responses, with one set of poles. Both decays must
    start at the same sample: then the ratio depends neither on the size of an impact nor on this sample. The
    covariance comes from the spread over the impacts, so it holds for any noise.

    Parameters
    ----------
    model : ModalModel
        Model by joint identification.
    first, second : sequences of (n,) arrays of float
        Decay of each impact at the two responses. [m/s²]

    Returns
    -------
    list of TwoPointShape or None
        One for each mode of the model; None for another method, and with fewer than ``MIN_IMPACTS`` impacts.

    References
    ----------
    Ratio estimator with its linearised variance: Cochran 1977, Sampling Techniques, section 6.3.
    """
    if not model.modes or "modes_in_fit" not in model.diagnostics or len(first) < MIN_IMPACTS:
        return None
    n = min(len(decay) for decay in (*first, *second))
    fit = np.stack([np.log(model.diagnostics["modes_in_fit"]), model.diagnostics["damping_in_fit"]], axis=1)
    columns = Background(model.diagnostics["drift_degree"], model.diagnostics["hum"]).columns(n, model.rate)
    amplitude = [
        linearise(fit[None], np.array([np.asarray(d, dtype=float)[:n] for d in decays]), model.rate, columns).amplitude
        for decays in (first, second)
    ]
    named = np.array([[np.log(mode.frequency), mode.damping] for mode in model.modes])
    index = np.argmin(np.sum((named[:, None] - fit[None]) ** 2, axis=2), axis=1)
    return [amplitude_ratio(amplitude[0][:, m], amplitude[1][:, m]) for m in index]


def amplitude_ratio(first: np.ndarray, second: np.ndarray) -> TwoPointShape:
    """The ratio of :func:`two_point_shapes` for one mode.

    Parameters
    ----------
    first, second : (n_impact,) arrays of complex
        Amplitudes of the mode at both responses. [m/s²]

    Returns
    -------
    TwoPointShape
        Ratio and its covariance.

    Examples
    --------
    >>> amplitude_ratio(np.array([1.0, 2.0, 3.0]), np.array([-2.0, -4.0, -6.0])).ratio
    np.complex128(-2+0j)
    """
    first, second = np.asarray(first, dtype=complex), np.asarray(second, dtype=complex)
    power = np.sum(np.abs(first) ** 2)
    ratio = np.sum(first.conj() * second) / power
    error = first.conj() * (second - ratio * first) / power
    parts = np.stack([error.real, error.imag])
    return TwoPointShape(ratio, parts @ parts.T * len(first) / (len(first) - 1))
