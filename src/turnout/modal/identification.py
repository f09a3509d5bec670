"""Modal identification of one section from the free decays of its hammer tests."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import installation_error, is_infrastructure
from turnout.modal.joint import identify_joint
from turnout.modal.paper import identify_paper
from turnout.modal.state_space import no_model
from turnout.records import ModalModel, Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from turnout.config.settings.identify import IdentifySettings
    from turnout.records import Receptance

LOG = logging.getLogger("turnout.modal")
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
        Options of the method: ``leads`` (the samples before each decay) for "paper", ``second`` (the decays of a second
        response to the same impacts, which has the same modes) for "joint".

    Returns
    -------
    ModalModel
        ``status`` "rejected" with reasons where no mode is identified. Doubtful modes are rejected.

    Raises
    ------
    ValueError
        Unknown method or a decay that is not one-dimensional.

    Notes
    -----
    If the estimator itself fails, one impact at a time is left out, the least typical one first. The impact without
    which it succeeds is among ``rejected_impacts``. If there is none, the model is rejected with the failure.
    """
    method = settings.method if method is None else method
    if method not in METHODS:
        raise ValueError(f"no method {method!r}; there are {sorted(METHODS)}")
    for i, decay in enumerate(decays):
        if np.ndim(decay) != 1:
            raise ValueError(f"decay {i} has shape {np.shape(decay)}, need (n,)")
    try:
        return METHODS[method](decays, rate, settings, receptance, **options)
    except Exception as error:
        if is_infrastructure(error) or installation_error(error):
            raise
        LOG.warning("identification failed with all %d impacts", len(decays), exc_info=True)
        return _identify_without_one(decays, rate, settings, receptance, method, options, error)


MIN_IMPACTS_LEFT = 3  # impacts that must remain when one is left out


def _identify_without_one(
    decays: Sequence[np.ndarray],
    rate: float,
    settings: IdentifySettings,
    receptance: Receptance | None,
    method: str,
    options: dict[str, Any],
    error: Exception,
) -> ModalModel:
    """A model that reports the impact without which the estimator succeeds as rejected, else a rejected model.

    The caller fits again without the rejected impact, so the numbers of the impacts are those of the full list.
    """
    failure = f"{type(error).__name__}: {error}"
    for k in _least_typical_first(decays) if len(decays) > MIN_IMPACTS_LEFT else ():
        kept = [i for i in range(len(decays)) if i != k]
        per_impact = {name: [values[i] for i in kept] for name, values in options.items() if values is not None}
        try:
            model = METHODS[method]([decays[i] for i in kept], rate, settings, receptance, **per_impact)
        except Exception as repeated:
            if is_infrastructure(repeated) or installation_error(repeated):
                raise
            continue
        rejection = Rejection("odd_one_out", None, None, f"the identification fails with this impact ({failure})")
        return _with_test_numbers(model, kept, (k, rejection))
    reason = Rejection("not_identified", None, None, f"the identification failed ({failure})")
    return no_model(rate, method, (reason,), {"rejected_impacts": ()})


def _least_typical_first(decays: Sequence[np.ndarray]) -> list[int]:
    """Numbers of the decays by their correlation with the mean decay of unit energy, the lowest first."""
    n = min(len(d) for d in decays)
    unit = np.nan_to_num(np.array([np.asarray(d, float)[:n] for d in decays]))
    unit /= np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-300)
    return np.argsort(unit @ unit.mean(axis=0), kind="stable").tolist()


def _with_test_numbers(model: ModalModel, impacts: Sequence[int], rejected: tuple[int, Rejection]) -> ModalModel:
    """A model of some impacts of a test, with the numbers that the impacts have in the test.

    Parameters
    ----------
    model : ModalModel
        Model whose impacts are numbered from 0.
    impacts : sequence of int
        Number in the test of each of them.
    rejected : (int, Rejection)
        Number of the impact that was left out, and why.

    Returns
    -------
    ModalModel
        A copy.
    """
    per_impact = tuple({**row, "impact": impacts[row["impact"]]} for row in model.per_impact)
    diagnostics = dict(model.diagnostics)
    diagnostics["rejected_impacts"] = (
        *((impacts[i], rejection) for i, rejection in diagnostics.get("rejected_impacts", ())),
        rejected,
    )
    if "impacts" in diagnostics:
        diagnostics["impacts"] = tuple(impacts[i] for i in diagnostics["impacts"])
    if "impacts_without_mode" in diagnostics:
        diagnostics["impacts_without_mode"] = tuple((impacts[i], f) for i, f in diagnostics["impacts_without_mode"])
    return replace(model, per_impact=per_impact, diagnostics=diagnostics)
