"""Where two effects show: how much of one is seen by the sensors and in the recordings that the other changes."""

import numpy as np

from turnout.errors import SimulationError


def changed(case, fit, candidate):
    """What ``candidate``, of those in ``fit``, changes in each observation at its nuisances, whitened; [] where the
    simulation cannot go without it."""
    others = tuple(t for c, t in zip(fit.candidates, fit.terms) if c.key != candidate.key)
    try:
        without = case.predict(fit.values, others, case.observations)
    except SimulationError:
        return []
    return [o.whitened(p - q) for o, p, q in zip(case.observations, fit.predictions, without)]


def shared(case, fit, first, second):
    r"""How far two effects show at the same sensors in the same recordings: 0 apart, 1 alike.

    .. math:: \sum_k \sqrt{p_k q_k}

    with p and q the shares of the energy that each changes in the samples k of one sensor in one recording
    (Bhattacharyya 1943). 1 where the simulation cannot go without one of them.
    """
    parts = [_energies(case.observations, changed(case, fit, c)) for c in (first, second)]
    if any(p is None for p in parts):
        return 1.0
    return float(np.sum(np.sqrt(parts[0] * parts[1])))


def _energies(observations, changes):
    """(n_sensor_and_recording,) shares of the energy of ``changes``, None where there is none."""
    found = [e for o, d in zip(observations, changes) for e in _by_sensor(o, o.effective * np.square(d))]
    total = float(np.sum(found))
    return np.array(found) / total if total > 0.0 else None


def _by_sensor(observation, energy):
    """Sums of ``energy`` (n,) by sensor, of all where the observation tells none."""
    if observation.cells is None or "sensor" not in observation.labels:
        return [float(np.sum(energy))]
    level, code = np.unique(observation.labels["sensor"].astype(str), return_inverse=True)
    inside = observation.cells >= 0
    return np.bincount(code[observation.cells[inside]], energy[inside], minlength=level.size)
