"""Derivatives of receptances and passages by the nuisances of a turnout: analytic where possible, else differences."""

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.turnout import passage_band, receptance_observation
from turnout.mismatch.turnout.priors import RECEPTANCE, SIMULATION
from turnout.mismatch.turnout.pseudo_forces import support_columns, support_motion
from turnout.mismatch.turnout.rail_roughness import wave_columns


def nuisance_jacobian(predictor, nuisances, values, terms, observations, base):
    """Derivatives of ``observations`` by all ``nuisances``.

    Exact for receptances, gains and times. Of passages, those by support values come from pseudo-forces, those by
    wheels and running surface from differences.
    """
    index = {n.name: k for k, n in enumerate(nuisances)}
    jacobians = [np.zeros((o.data.size, len(nuisances))) for o in observations]
    sensitivity_of = predictor.pair_sensitivities(values, terms)
    passages = [(o, p, j) for o, p, j in zip(observations, base, jacobians) if o.name in predictor.aligned_passages]
    for o, predicted, jacobian in zip(observations, base, jacobians):
        if o.name in predictor.frf_pairs:
            pair = predictor.frf_pairs[o.name]
            fill_pair_columns(predictor, values, terms, pair, sensitivity_of(pair), predicted, jacobian, index)
    if passages:
        _fill_common_columns(predictor, values, terms, passages, index)
    for o, predicted, jacobian in passages:
        aligned = predictor.aligned_passages[o.name]
        for name, column in _passage_columns(predictor, values, terms, aligned, predicted):
            jacobian[:, index[name]] = column
        first = index[predictor.waves.names[0]]
        jacobian[:, first : first + len(predictor.waves.names)] = wave_columns(predictor, values, terms, aligned)
    return jacobians


def fill_pair_columns(predictor, values, terms, pair, sensitivity, predicted, jacobian, index):
    """Fill the columns of a pair; the values of the track come first among the nuisances."""
    channel_response = predictor.channel_response(values, terms, pair)
    block = receptance_observation.scale_lines(pair, sensitivity.gradient(pair), channel_response)
    n, width = block.shape
    jacobian[:n, :width], jacobian[n:, :width] = block.real, block.imag
    rail = receptance_observation.split_complex(
        receptance_observation.scale_lines(pair, sensitivity.rail_gradient(pair), channel_response)
    )
    for k, name in enumerate(predictor.rail):
        jacobian[:, index[name]] = rail[:, k]
    gain, seat = f"gain_{pair.channel}", f"seat_{pair.channel}"
    if gain in index:
        jacobian[:, index[gain]] = predicted / (1.0 + values[gain])
    if seat in index:
        jacobian[:, index[seat]] = receptance_observation.split_complex(
            receptance_observation.scale_lines(pair, sensitivity.seat_gradient(pair), channel_response)
        )


def _fill_common_columns(predictor, values, terms, passages, index):
    parameters = [(f"wheels_{train}", SIMULATION.log_step, train) for train in predictor.site.trains]
    parameters += [(name, SIMULATION.surface_step, None) for name in predictor.surface.names]
    for name, step, train in parameters:
        for o, predicted, jacobian in passages:
            aligned = predictor.aligned_passages[o.name]
            if train in (None, aligned.train):
                jacobian[:, index[name]] = _difference(predictor, values, terms, aligned, predicted, name, step)


def _difference(predictor, values, terms, aligned, predicted, name, step):
    """Derivative of a passage by one value, to the side that can be simulated."""
    try:
        return (predictor.predict_passage({**values, name: values[name] + step}, terms, aligned) - predicted) / step
    except SimulationError:
        return (predicted - predictor.predict_passage({**values, name: values[name] - step}, terms, aligned)) / step


def own_columns(predictor, values, terms, aligned, predicted):
    """Yield (name, column) of the derivatives of a passage by its own time, speed and load."""
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


def _seat_columns(predictor, values, terms, aligned, predicted):
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


def _passage_columns(predictor, values, terms, aligned, predicted):
    yield from own_columns(predictor, values, terms, aligned, predicted)
    rows = predicted.reshape(-1, aligned.time.size)
    for k, sensor in enumerate(aligned.sensors):
        column = np.zeros_like(rows)
        column[k] = rows[k] / (1.0 + values[f"gain_{sensor.name}"])
        yield f"gain_{sensor.name}", column.ravel()
    yield from _seat_columns(predictor, values, terms, aligned, predicted)
    histories = support_motion(predictor, values, terms, aligned)
    yield from support_columns(predictor, values, terms, aligned, histories).items()
