"""What a nuisance of the base model has taken in: an effect's size and evidence in closed form, from the base fit."""

import numpy as np


def absorbed(case, fit):
    """(gain [nats], candidate, start, values) of every candidate that has a ``twin`` among the nuisances.

    The twin's estimate is what the effect has been taken for, drawn towards its prior; ``values`` are all nuisances
    where they would lie with the twin back at its mean and the effect in its place.
    """
    index = {n.name: k for k, n in enumerate(case.nuisances)}
    found = []
    for candidate in case.candidates:
        k = index.get(candidate.twin)
        if k is None:
            continue
        twin = case.nuisances[k]
        m, s = fit.values[twin.name] - twin.mean, float(np.sqrt(fit.covariance[k, k]))
        opened = gain_when_opened(m, s, twin.sd, candidate.twin_sd)
        if opened is None:
            continue
        gain, size = opened
        shift = fit.covariance[: len(index), k] / s**2 * (size - m)
        values = {
            n.name: float(np.clip(fit.values[n.name] + d, *n.bounds)) for n, d in zip(case.nuisances, shift)
        }  # fmt: skip
        low, high = candidate.parameters[0].bounds
        start = np.clip([(candidate.from_twin or np.exp)(size)], low, high)
        found.append((gain - np.log(candidate.scanned), candidate, start, {**values, twin.name: twin.mean}))
    return found


def gain_when_opened(m, s, tau, wide):
    r"""(gain [nats], estimate) when a prior N(0, τ²), under which the posterior is N(m, s²), becomes N(0, T²).

    .. math:: s'^{-2} = s^{-2} - \tau^{-2}, \quad m' = m\, s'^2 / s^2, \quad
              g = \ln N(m'; 0, s'^2 + T^2) - \ln N(m'; 0, s'^2 + \tau^2)

    The estimate is that under the wide prior, :math:`m' T^2 / (s'^2 + T^2)`. None where the data say nothing.

    >>> gain_when_opened(0.0, 0.1, 0.1, 0.7) is None
    True
    """
    if s >= 0.999 * tau:
        return None
    own = 1.0 / (1.0 / s**2 - 1.0 / tau**2)
    free = m * own / s**2
    before, after = own + tau**2, own + wide**2
    gain = 0.5 * np.log(before / after) + 0.5 * free**2 * (1.0 / before - 1.0 / after)
    return float(gain), float(free * wide**2 / after)
