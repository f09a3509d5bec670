r"""Supports that press and pull with different stiffness, under the impacts of a hammer test.

Receptances are linear: such a support has the mean of both stiffnesses. Its rail does not move up and down alike, since
it is thrown up further than it is pressed down, and the support rectifies what it transmits. What this changes is
simulated in time, once with both stiffnesses and once with their mean, under the measured force of a typical impact:

.. math:: \Delta H = -\frac{A_\mathrm{both} - A_\mathrm{mean}}{\omega^2 F}

Both stiffnesses change at rest, so the change does not depend on the size of the impact.

References
----------
Shaw and Holmes 1983, A periodically forced piecewise linear oscillator, Journal of Sound and Vibration 90.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.lifting_chairs import receptance_change
from turnout.mismatch.turnout.matrix_cache import FixedLinks, matrices_of
from turnout.mismatch.turnout.priors import RECEPTANCE, SIMULATION
from turnout.mismatch.turnout.receptance_model import linear_matrices, tangent_links
from turnout.simulate.preparation import prepare

if TYPE_CHECKING:
    from turnout.mismatch.turnout.receptance_model import ReceptanceModel
    from turnout.mismatch.turnout.receptance_observation import FrfPair
    from turnout.physics.term import PhysicsTerm
    from turnout.simulate.matrices import TrackMatrices
    from turnout.simulate.preparation import Prepared
    from turnout.simulate.run import Probe
    from turnout.simulate.track import Track


def bilinear_terms(terms: Sequence[PhysicsTerm], track: Track) -> tuple[PhysicsTerm, ...]:
    """Terms with a port that presses and pulls with different stiffness about rest.

    Parameters
    ----------
    terms : sequence of PhysicsTerm
        Effects on the track.
    track : Track
        The track.

    Returns
    -------
    tuple of PhysicsTerm
    """
    d = RECEPTANCE.tangent_motion

    def is_bilinear(term: PhysicsTerm) -> bool:
        laws = [port.law for port in term.ports(track) if port.gap == 0.0]
        changes = [(float(law.force(d) - law.force(0.0)), float(law.force(0.0) - law.force(-d))) for law in laws]
        return any(abs(press - pull) > RECEPTANCE.bilinear_share * abs(press + pull) for press, pull in changes)

    return tuple(term for term in terms if is_bilinear(term))


def bilinear_changes(model: ReceptanceModel, pairs: Sequence[FrfPair], probes: Sequence[Probe]) -> list[np.ndarray]:
    """Changes of receptances by supports that press and pull differently; the model keeps them.

    Parameters
    ----------
    model : ReceptanceModel
        A track with ``bilinear_terms``.
    pairs : sequence of FrfPair
        Response channels of hammer tests.
    probes : sequence of Probe
        Of their sensors.

    Returns
    -------
    list of (n_line,) array of complex
        On the lines of hammer tests. [m/N]

    Raises
    ------
    SimulationError
        If an impact cannot be simulated.
    """
    by_position: dict[float, dict[tuple, tuple[FrfPair, Probe]]] = {}
    for pair, probe in zip(pairs, probes):
        if (pair.test.place, pair.seat) not in model.bilinear_changes:
            by_position.setdefault(pair.test.place, {})[pair.seat] = pair, probe
    if by_position:
        bilinear_track, linear_track = _with_both_stiffnesses(model), _with_their_mean(model)
    for position, by_seat in by_position.items():
        (first, _), *_ = by_seat.values()
        change = receptance_change(
            bilinear_track, linear_track, first.typical_impact, position, [p for _, p in by_seat.values()]
        )
        model.bilinear_changes |= {(position, seat): c for seat, c in zip(by_seat, change)}
    return [model.bilinear_changes[pair.test.place, pair.seat] for pair in pairs]


def _with_both_stiffnesses(model: ReceptanceModel) -> Prepared:
    """The track of a model whose bilinear supports press and pull as they do; other ports are linear."""
    bilinear = bilinear_terms(model.terms, model.track)
    linear_ports = tangent_links([term for term in model.terms if term not in bilinear], model.track)
    return _prepare_impact(model.track, bilinear, matrices_of(model.track, (*model.terms, FixedLinks(linear_ports))))


def _with_their_mean(model: ReceptanceModel) -> Prepared:
    """The linear track of a model."""
    return _prepare_impact(model.track, (), linear_matrices(model.track, model.terms))


def _prepare_impact(track: Track, terms: tuple[PhysicsTerm, ...], matrices: TrackMatrices) -> Prepared:
    prepared = prepare(track, 1.0 / RECEPTANCE.lifting_rate, "radau", terms, SIMULATION.decay_exponent, matrices)
    return replace(prepared, track=track.with_(blade=None), terms=terms)  # slide chairs are linear here
