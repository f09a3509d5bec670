"""Derivatives of receptances and passages by the nuisances of a turnout: analytic where possible, else differences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.turnout import passage_band
from turnout.mismatch.turnout.chair_parameters import chair_gradients, chair_nuisances
from turnout.mismatch.turnout.priors import PASSAGE, RECEPTANCE, SIMULATION, TRACK
from turnout.mismatch.turnout.pseudo_forces import support_columns, support_motion
from turnout.mismatch.turnout.rail_roughness import wave_columns
from turnout.mismatch.turnout.site_model import drop_oldest
from turnout.mismatch.turnout.surface_priors import TOP_SHAPE
from turnout.mismatch.turnout.toe_position import TOE
from turnout.mismatch.turnout.wheel_line import has_blade

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator, Mapping, Sequence

    from turnout.mismatch.engine.nuisance import Nuisance
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.turnout.passage_observation import AlignedPassage
    from turnout.mismatch.turnout.prediction import Predictor
    from turnout.mismatch.turnout.predictions import Terms, Values
    from turnout.mismatch.turnout.receptance_samples import PairSamples


def nuisance_jacobian(
    predictor: Predictor,
    nuisances: Sequence[Nuisance],
    values: Values,
    terms: Terms,
    observations: Sequence[Observation],
    base: Sequence[np.ndarray],
) -> list[np.ndarray]:
    """Derivatives of ``observations`` by all ``nuisances``.

    Exact for receptances, gains and times. Of passages, those by support values come from pseudo-forces, those by
    wheels and running surface from differences.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    nuisances : sequence of Nuisance
        Those of the track first, in the order of ``track_value_names``.
    values : mapping
        All nuisances of the site, by name.
    terms : sequence of PhysicsTerm
        Effects beside the base model.
    observations : sequence of Observation
        Those that are predicted.
    base : sequence of (n,) array
        Predictions at ``values``.

    Returns
    -------
    list of (n, n_nuisance) array of float
        One per observation.
    """
    index = {n.name: k for k, n in enumerate(nuisances)}
    jacobians: dict[int, np.ndarray] = {}
    for numbers, samples in predictor.pair_samples(values, terms, observations):
        jacobians |= zip(numbers, pair_jacobians(predictor, values, terms, samples, [base[k] for k in numbers], index))
    passages = []
    for k, o in enumerate(observations):
        if k not in jacobians:
            jacobians[k] = np.zeros((o.data.size, len(nuisances)))
            passages.append((o, base[k], jacobians[k]))
    if passages:
        _fill_common_columns(predictor, values, terms, passages, index)
    for o, predicted, jacobian in passages:
        aligned = predictor.aligned_passages[o.name]
        for name, column in _passage_columns(predictor, values, terms, aligned, predicted):
            jacobian[:, index[name]] = column
        first = index[predictor.waves.names[0]]
        jacobian[:, first : first + len(predictor.waves.names)] = wave_columns(predictor, values, terms, aligned)
    return [jacobians[k] for k in range(len(observations))]


def pair_jacobians(
    predictor: Predictor,
    values: Values,
    terms: Terms,
    samples: PairSamples,
    predictions: Sequence[np.ndarray],
    index: Mapping[str, int],
) -> list[np.ndarray]:
    """Derivatives of receptances; the values of the track come first among the nuisances.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    terms : sequence of PhysicsTerm
        Effects beside the base model.
    samples : PairSamples
        The pairs.
    predictions : sequence of (2n,) array of float
        Prediction of each pair.
    index : mapping
        Nuisance -> column.

    Returns
    -------
    list of (2n, n_nuisance) array of float
        One per pair.
    """
    factors = samples.channel_factors(lambda pair: predictor.channel_response(values, terms, pair))
    sensitivity, stacked = samples.sensitivity, np.zeros((2 * factors.size, len(index)))
    gradients = samples.at(sensitivity.gradients) * factors[:, None]
    samples.write(gradients, stacked[:, : gradients.shape[1]])
    rail = np.empty((2 * factors.size, len(predictor.rail)))
    samples.write(samples.at(sensitivity.rail_gradients) * factors[:, None], rail)
    stacked[:, [index[name] for name in predictor.rail]] = rail
    for name, gradient in (chair_gradients(sensitivity) | {TOE: sensitivity.toe_gradients}).items():
        if name in index:
            samples.write(samples.at(gradient)[:, None] * factors[:, None], stacked[:, index[name] : index[name] + 1])
    seat_columns = samples.to_observations(samples.at(sensitivity.seat_gradients) * factors)
    jacobians = samples.split(stacked)
    for pair, jacobian, predicted, by_seat in zip(samples.pairs, jacobians, predictions, seat_columns):
        gain, seat = f"gain_{pair.channel}", f"seat_{pair.channel}"
        if gain in index:
            jacobian[:, index[gain]] = predicted / (1.0 + values[gain])
        if seat in index:
            jacobian[:, index[seat]] = by_seat
    return jacobians


def _fill_common_columns(
    predictor: Predictor,
    values: Values,
    terms: Terms,
    passages: Sequence[tuple[Observation, np.ndarray, np.ndarray]],
    index: dict[str, int],
) -> None:
    parameters: list[tuple[str, float, str | None]] = [
        (f"wheels_{train}", SIMULATION.log_step, train) for train in predictor.site.trains
    ]
    shapes = set(predictor.surface.shape_names)
    parameters += [
        (name, TOP_SHAPE.difference_step if name in shapes else SIMULATION.surface_step, None)
        for name in predictor.surface.names
    ]
    for name, step, train in parameters:
        for o, predicted, jacobian in passages:
            aligned = predictor.aligned_passages[o.name]
            if train in (None, aligned.train):
                jacobian[:, index[name]] = _difference(predictor, values, terms, aligned, predicted, name, step)


def is_in_switch(predictor: Predictor, aligned: AlignedPassage) -> bool:
    """Whether the wheels of a passage change to a blade.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    aligned : AlignedPassage
        The passage.

    Returns
    -------
    bool
    """
    return has_blade(predictor.surface.turnout.surfaces(aligned.passage.route))


def _difference(
    predictor: Predictor,
    values: Values,
    terms: Terms,
    aligned: AlignedPassage,
    predicted: np.ndarray,
    name: str,
    step: float,
) -> np.ndarray:
    """Derivative of a passage by one value, to the side that can be simulated.

    It is computed again only where a value that it depends on has moved, in a switch only a common one: there a passage
    costs three times as much.
    """
    in_switch = is_in_switch(predictor, aligned)
    paths = tuple(t.name for t in terms if t.effect_type == "path")
    key = (aligned.name, name, paths if in_switch else _kinds_of(terms))
    values_now = _in_units_of_reach(values, predictor.site.common_sds)
    if name in _of_vehicle(aligned):  # how it responds to waves of the rail
        values_now |= _in_units_of_reach(values, dict(zip(predictor.waves.names, predictor.waves.sd)))
    if not in_switch:
        values_now |= _in_units_of_reach(values, predictor.site.support_sds)
        values_now |= _own_values(values, terms, aligned)
    values_then, column = predictor.differences.get(key, ({}, predicted))
    if any(abs(v - values_then.get(n, np.inf)) > SIMULATION.difference_reach for n, v in values_now.items()):
        step = step * SIMULATION.switch_step_factor if in_switch else step
        column = _quotient(predictor, values, terms, aligned, predicted, name, step)
        predictor.differences[key] = values_now, column
        drop_oldest(predictor.differences, SIMULATION.difference_cache_size)
    return column


def _of_vehicle(aligned: AlignedPassage) -> tuple[str, str]:
    """Values of the vehicle of a passage, of one train or of this passage."""
    return f"wheels_{aligned.train}", f"load@{aligned.name}"


def _kinds_of(terms: Terms) -> tuple:
    """Effects and where they act, without their sizes; of channels, on which a column depends exactly, all."""
    return tuple(repr(t) if t.effect_type == "channel" else (t.name, tuple(t.supports)) for t in terms)


def _in_units_of_reach(values: Values, sds: Mapping[str, float]) -> dict[Hashable, float]:
    return {name: values.get(name, 0.0) / sd for name, sd in sds.items()}


def _own_values(values: Values, terms: Terms, aligned: AlignedPassage) -> dict[Hashable, float]:
    """Values of a passage and its effects on which a quotient depends, in the units of ``SIMULATION.difference_reach``.

    Those of the passage in prior standard deviations, logarithms of sizes in units of ``SIMULATION.difference_size``.
    """
    own_sds = {
        f"wheels_{aligned.train}": TRACK.wheels_sd,
        f"load@{aligned.name}": aligned.passage.load_sd,
        f"time@{aligned.name}": PASSAGE.time_sd * SIMULATION.clock_share,
        f"speed@{aligned.name}": PASSAGE.speed_sd * SIMULATION.clock_share,
    }
    own_values = _in_units_of_reach(values, own_sds)
    for k, term in enumerate(terms):
        for p in term.parameters if term.effect_type != "channel" else ():
            size = abs(getattr(term, p.name) - p.neutral)
            own_values[k, p.name] = np.log(max(size, 1e-12)) / SIMULATION.difference_size
    return own_values


def _quotient(
    predictor: Predictor,
    values: Values,
    terms: Terms,
    aligned: AlignedPassage,
    predicted: np.ndarray,
    name: str,
    step: float,
) -> np.ndarray:
    def predict(increment: float) -> np.ndarray:
        return predictor.predict_passage({**values, name: values[name] + increment}, terms, aligned, with_probes=False)

    try:
        return (predict(step) - predicted) / step
    except SimulationError:
        return (predicted - predict(-step)) / step


def own_columns(
    predictor: Predictor, values: Values, terms: Terms, aligned: AlignedPassage, predicted: np.ndarray
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield (name, column) of the derivatives of a passage by its own time, speed and load.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    terms : sequence of PhysicsTerm
        Effects beside the base model.
    aligned : AlignedPassage
        The passage.
    predicted : (n_sensor * n_time,) array of float
        Prediction of the passage. [m/s²]

    Returns
    -------
    name : str
        Of the nuisance.
    column : (n_sensor * n_time,) array of float
    """
    n = aligned.time.size
    moment = f"time@{aligned.name}"
    later = predictor.predict_passage(
        {**values, moment: values[moment] + SIMULATION.time_step}, terms, aligned
    )  # nothing is simulated again
    slope = -(later - predicted).reshape(-1, n) / SIMULATION.time_step
    yield moment, -slope.ravel()
    yield f"speed@{aligned.name}", (slope * (aligned.time - aligned.reference)).ravel()
    load = f"load@{aligned.name}"
    yield load, _difference(predictor, values, terms, aligned, predicted, load, SIMULATION.load_step)


def _seat_columns(
    predictor: Predictor, values: Values, terms: Terms, aligned: AlignedPassage, predicted: np.ndarray
) -> Iterator[tuple[str, np.ndarray]]:
    shifted = predictor.signals_with_probes(values, terms, aligned)[
        len(aligned.sensors) + 2 * len(predictor.zone.supports) :
    ]
    shifted = passage_band.upsample(shifted)
    rows = predicted.reshape(-1, aligned.time.size)
    for k, sensor in enumerate(aligned.sensors):
        if not sensor.mounting.startswith("sleeper"):
            column = np.zeros_like(rows)
            column[k] = (
                predictor.channel_output(values, terms, aligned, sensor, shifted[k]) - rows[k]
            ) / RECEPTANCE.seat_step
            yield f"seat_{sensor.name}", column.ravel()


def _passage_columns(
    predictor: Predictor, values: Values, terms: Terms, aligned: AlignedPassage, predicted: np.ndarray
) -> Iterator[tuple[str, np.ndarray]]:
    yield from own_columns(predictor, values, terms, aligned, predicted)
    rows = predicted.reshape(-1, aligned.time.size)
    for k, sensor in enumerate(aligned.sensors):
        column = np.zeros_like(rows)
        column[k] = rows[k] / (1.0 + values[f"gain_{sensor.name}"])
        yield f"gain_{sensor.name}", column.ravel()
    yield from _seat_columns(predictor, values, terms, aligned, predicted)
    histories = support_motion(predictor, values, terms, aligned)
    columns = support_columns(predictor, values, terms, aligned, histories)
    # the wheels follow what all supports have in common as they move, those beyond the zone included
    simulated = ["pad_stiffness", "ballast_stiffness", "ballast_damping"]
    for name in (*simulated, *(n.name for n in chair_nuisances([predictor.track(aligned.passage.route)]))):
        columns[name] = _difference(predictor, values, terms, aligned, predicted, name, SIMULATION.log_step)
    yield from columns.items()
