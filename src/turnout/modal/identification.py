"""Modal identification of one section from the free decays of its hammer tests."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout.modal.joint import identify_joint
from turnout.modal.paper import identify_paper
from turnout.records import ModalModel

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    import numpy as np

    from turnout.config.settings.identify import IdentifySettings
    from turnout.records import Receptance

METHODS = {"joint": identify_joint, "paper": identify_paper}


def identify(
    decays: Sequence[np.ndarray],
    rate: float,
    settings: IdentifySettings,
    receptance: Receptance | None = None,
    method: str | None = None,
    **options: Any,
) -> ModalModel:
    r"""Modes of a section with their errors, and the state-space model built from them.

    .. math:: y_k = \mathrm{Re} \sum_m \alpha_{im} z_{im}^k + \text{drift} + \text{noise}, \qquad
              x_{k+1} = A x_k, \quad y_k = c x_k

    Parameters
    ----------
    decays : sequence of (n,) arrays of float
        Acceleration after the end of contact, unfiltered, one per accepted impact. [m/s²]
    rate : float
        Sampling rate. [Hz]
    settings : IdentifySettings
        Bands, limits and the method.
    receptance : Receptance, optional
        Its coherence gate rejects modes. Its H1 gives b and c for a unit impulse.
    method : "joint" or "paper", optional
        ``settings.method`` by default.
    options
        Options of the method: ``leads`` (the samples before each decay) for "paper".

    Returns
    -------
    ModalModel
        ``status`` "rejected" with reasons where no mode is identified. Doubtful modes are rejected.

    Raises
    ------
    ValueError
        Unknown method or a decay that is not one-dimensional.
    """
    method = settings.method if method is None else method
    if method not in METHODS:
        raise ValueError(f"no method {method!r}; there are {sorted(METHODS)}")
    return METHODS[method](decays, rate, settings, receptance, **options)
