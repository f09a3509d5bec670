"""Predictions a small step of the effects away: receptances follow links whose values change, to first order."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from turnout.mismatch.turnout import receptance_observation
from turnout.mismatch.turnout.bilinear_supports import bilinear_terms
from turnout.physics.term import PhysicsTerm
from turnout.simulate.matrices import link_vector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.turnout.prediction import Predictor
    from turnout.mismatch.turnout.predictions import Terms, Values
    from turnout.mismatch.turnout.receptance_model import ReceptanceModel
    from turnout.mismatch.turnout.receptance_sensitivity import ReceptanceSensitivity

LINK_VALUES = ("stiffness", "damping", "mass")


def predict_near(
    predictor: Predictor,
    values: Values,
    terms: Terms,
    new: Terms,
    observations: Sequence[Observation],
    predictions: Sequence[np.ndarray],
) -> list[np.ndarray]:
    """Predictions of a ``Predictor`` with ``new`` terms, a small step from ``terms``.

    Passages are simulated. Receptances follow the links where these differ by their values alone.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    terms : sequence of PhysicsTerm
        Effects beside the base model.
    new : sequence of PhysicsTerm
        The terms a small step away.
    observations : sequence of Observation
        Those that are predicted.
    predictions : sequence of (n,) array
        Predictions with ``terms``.

    Returns
    -------
    list of (n,) array
        One per observation.
    """
    predicted: dict[int, np.ndarray] = {}
    if not any(a != b and b.effect_type == "channel" for a, b in zip(terms, new)):
        predicted = _receptances_near(predictor, values, terms, new, observations, predictions)
    for k, o in enumerate(observations):
        if o.name in predictor.aligned_passages:
            aligned = predictor.aligned_passages[o.name]
            predicted[k] = predictor.predict_passage(values, new, aligned, with_probes=False)
    missing = [k for k in range(len(observations)) if k not in predicted]
    predicted |= zip(missing, predictor.predict(values, new, [observations[k] for k in missing]))
    return [predicted[k] for k in range(len(observations))]


def _receptances_near(
    predictor: Predictor,
    values: Values,
    terms: Terms,
    new: Terms,
    observations: Sequence[Observation],
    predictions: Sequence[np.ndarray],
) -> dict[int, np.ndarray]:
    """Predictions of ``predict_near`` of those receptances that differ by values of links alone, by number."""
    near: dict[int, np.ndarray] = {}
    for numbers, samples in predictor.pair_samples(values, terms, observations, new):
        conditions = samples.pairs[0].conditions
        difference = changed_links(samples.sensitivity.model, receptance_observation.track_terms(new, conditions))
        if difference is None:
            continue
        factors = samples.channel_factors(lambda pair: predictor.channel_response(values, terms, pair))
        change = samples.at(receptance_changes(samples.sensitivity, *difference)) * factors
        near |= {k: predictions[k] + d for k, d in zip(numbers, samples.to_observations(change))}
    return near


def changed_links(model: ReceptanceModel, terms: Sequence[PhysicsTerm]) -> tuple[csr_array, np.ndarray] | None:
    """Links by which ``terms`` differ from those of the model.

    Parameters
    ----------
    model : ReceptanceModel
        Model with the old terms.
    terms : sequence of PhysicsTerm
        The new terms.

    Returns
    -------
    ends : (n_link, n) sparse array
        Weights of the degrees of freedom at the ends of each link.
    impedance : (n_link, n_line) array of complex
        Their change. [N/m] The whole is None where more than values differ: another rail, a link that the model
        has not, or a support that presses and pulls differently.
    """
    pairs = list(zip(model.terms, terms))
    if any(type(a) is not type(b) or (a != b and type(b).rail is not PhysicsTerm.rail) for a, b in pairs):
        return None
    if bilinear_terms((*model.terms, *terms), model.track):
        return None
    old, new = model.links(model.terms), model.links(terms)
    if [k.ends for k in old] != [k.ends for k in new] or any(k.loss_factor for k in (*old, *new)):
        return None
    differs = [(a, b) for a, b in zip(old, new) if a != b]
    values = np.array([[getattr(b, name) - getattr(a, name) for name in LINK_VALUES] for a, b in differs]).reshape(
        -1, 3
    )
    omega = 2.0 * np.pi * receptance_observation.SHIFTED_LINES
    impedance = values @ np.array([np.ones(omega.size), 1j * omega, -(omega**2)])
    vectors = [link_vector(a, model.matrices.index) for a, _ in differs]
    first = np.cumsum([0, *(rows.size for rows, _ in vectors)])
    rows = np.concatenate([np.zeros(0, dtype=int), *(rows for rows, _ in vectors)])
    weights = np.concatenate([np.zeros(0), *(weights for _, weights in vectors)])
    return csr_array((weights, rows, first), shape=(len(differs), model.matrices.n)), impedance


def receptance_changes(sensitivity: ReceptanceSensitivity, ends: csr_array, impedance: np.ndarray) -> np.ndarray:
    r"""Changes of the receptances of all pairs [m/N] by links whose impedance changes by z.

    Each is :math:`-\sum z\,u_w v_w` with u and v the motion of their ends under unit forces at impact and sensor.

    Parameters
    ----------
    sensitivity : ReceptanceSensitivity
        Receptances and their derivatives.
    ends : (n_link, n) sparse array
        Weights of the degrees of freedom at the ends of each link.
    impedance : (n_link, n_line) array of complex
        Change of each link. [N/m]

    Returns
    -------
    (n_pair, n_line) array of complex
        [m/N]
    """
    u, v = sensitivity.motions(ends)
    return -np.einsum("pwl,pwl,wl->pl", u, v, impedance)
