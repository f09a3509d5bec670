"""Derivatives of receptances and passages by the nuisances of a turnout: analytic where possible, else differences."""

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.case import Case
from turnout.mismatch.turnout import passage_band, receptance_observation
from turnout.mismatch.turnout.pseudo_forces import FURTHER, columns_of, support_forces
from turnout.mismatch.turnout.rail_roughness import wave_columns
from turnout.mismatch.turnout.running_surface import STEP as SURFACE_STEP

STEP = 0.04  # difference of a logarithm


def own_jacobian(case, values, terms, observation, predicted, names):
    """Derivatives of a passage by its own time, speed and load."""
    if observation.name in case.pairs:
        return Case.own_jacobian(case, values, terms, observation, predicted, names)
    found = dict(_own_columns(case, values, terms, case.rollings[observation.name], predicted))
    return np.column_stack([found[name] for name in names])


def nuisance_jacobian(case, values, terms, observations, base):
    """Derivatives of ``observations`` by all nuisances.

    Exact for receptances, gains and times. Of passages, those by support values come from pseudo-forces, those by
    wheels and running surface from differences.
    """
    index = {n.name: k for k, n in enumerate(case.nuisances)}
    found = [np.zeros((o.data.size, len(case.nuisances))) for o in observations]
    heard_by = case.blow_models(values, terms)
    passages = [(o, p, j) for o, p, j in zip(observations, base, found) if o.name in case.rollings]
    for o, predicted, jacobian in zip(observations, base, found):
        if o.name in case.pairs:
            pair = case.pairs[o.name]
            pair_columns(case, values, terms, pair, heard_by(pair), predicted, jacobian, index)
    if passages:
        _common_columns(case, values, terms, passages, index)
    for o, predicted, jacobian in passages:
        made = case.rollings[o.name]
        for name, column in _passage_columns(case, values, terms, made, predicted):
            jacobian[:, index[name]] = column
        first = index[case.waves.names[0]]
        jacobian[:, first : first + len(case.waves.names)] = wave_columns(case, values, terms, made)
    return found


def pair_columns(case, values, terms, pair, heard, predicted, jacobian, index):
    """Fill the columns of a pair; the values of the track come first among the nuisances."""
    chain = case.chain(values, terms, pair)
    block = receptance_observation.scaled(pair, heard.gradient(pair), chain)
    n, width = block.shape
    jacobian[:n, :width], jacobian[n:, :width] = block.real, block.imag
    rail = receptance_observation.split(receptance_observation.scaled(pair, heard.rail_gradient(pair), chain))
    for k, name in enumerate(case.rail):
        jacobian[:, index[name]] = rail[:, k]
    gain, seat = f"gain_{pair.channel}", f"seat_{pair.channel}"
    if gain in index:
        jacobian[:, index[gain]] = predicted / (1.0 + values[gain])
    if seat in index:
        jacobian[:, index[seat]] = receptance_observation.split(
            receptance_observation.scaled(pair, heard.seat_gradient(pair), chain)
        )


def _common_columns(case, values, terms, passages, index):
    shared = [f"wheels_{train}" for train in case.trains]
    for name, step in (*((name, STEP) for name in shared), *((name, SURFACE_STEP) for name in case.surface.names)):
        for o, predicted, jacobian in passages:
            made = case.rollings[o.name]
            if name.startswith("wheels_") and name != f"wheels_{made.passage.train or made.passage.name}":
                continue
            jacobian[:, index[name]] = _difference(case, values, terms, made, predicted, name, step)


def _difference(case, values, terms, made, predicted, name, step):
    """Derivative of a passage by one value, to the side that can be simulated."""
    try:
        return (case.passage_of({**values, name: values[name] + step}, terms, made) - predicted) / step
    except SimulationError:
        return (predicted - case.passage_of({**values, name: values[name] - step}, terms, made)) / step


def _own_columns(case, values, terms, made, predicted):
    n = made.time.size
    moment = f"time@{made.name}"
    later = case.passage_of({**values, moment: values[moment] + 1e-5}, terms, made)  # nothing is simulated again
    slope = -(later - predicted).reshape(-1, n) / 1e-5
    yield moment, -slope.ravel()
    yield f"speed@{made.name}", (slope * (made.time - made.reference)).ravel()
    load = f"load@{made.name}"
    yield load, _difference(case, values, terms, made, predicted, load, 0.03)


def _seat_columns(case, values, terms, made, predicted):
    further = case.marched(values, terms, made)[len(made.sensors) + 2 * len(case.zone.supports) :]
    further = passage_band.finer(further)
    rows = predicted.reshape(-1, made.time.size)
    for k, sensor in enumerate(made.sensors):
        if not sensor.mounting.startswith("sleeper"):
            column = np.zeros_like(rows)
            column[k] = (case.shown(values, terms, made, sensor, further[k]) - rows[k]) / FURTHER
            yield f"seat_{sensor.name}", column.ravel()


def _passage_columns(case, values, terms, made, predicted):
    yield from _own_columns(case, values, terms, made, predicted)
    rows = predicted.reshape(-1, made.time.size)
    for k, sensor in enumerate(made.sensors):
        column = np.zeros_like(rows)
        column[k] = rows[k] / (1.0 + values[f"gain_{sensor.name}"])
        yield f"gain_{sensor.name}", column.ravel()
    yield from _seat_columns(case, values, terms, made, predicted)
    histories = support_forces(case, values, terms, made)
    yield from columns_of(case, values, terms, made, histories).items()
