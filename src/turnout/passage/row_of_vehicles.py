"""The row of vehicles of a pattern that comes closest to a row of axles, by dynamic programming."""

from __future__ import annotations

import numpy as np

from turnout.passage.patterns import Pattern

UNREACHED = (np.inf,)


def best_row(spacing, pattern: Pattern, tolerance: float):
    """(cost [nat], row of vehicles, its choices): axle spacings closest to ``spacing`` (n_axle - 1,) [m].

    Cost is half the squared deviation in units of ``tolerance`` [m], summed over the spacings, plus the logarithm of
    the number of vehicles that stood to choice; ``choices`` is the sum of these. None where the pattern cannot have
    this number of axles, or where no row comes near.
    """
    n_axle = len(spacing) + 1
    low, high = pattern.axle_counts()
    if not low <= n_axle <= high:
        return None
    limit = 20.0 + 4.0 * n_axle  # beyond it the chi-squared test fails whatever follows
    # plain floats: a train has hundreds of thousands of pairs, most of them given up at the first spacing
    seen, weight, within = np.asarray(spacing).tolist(), 0.5 / tolerance**2, pattern.spacings
    chance = pattern.log_choices
    # state: axles used, group, vehicles used of the group, last vehicle -> (cost, row, choices)
    layers = [{} for _ in range(n_axle + 1)]
    layers[0][(0, 0, None)] = (0.0, (), 0.0)
    for used in range(n_axle):
        for (g, count, _), (cost, row, free) in layers[used].items():
            for group, taken in pattern.following(g, count):
                choices = pattern.groups[group].vehicles
                for vehicle in choices:
                    stop = used + len(vehicle.axles)
                    if stop > n_axle:
                        continue
                    total = cost + chance[group]
                    if row:
                        total += weight * (seen[used - 1] - row[-1].rear - vehicle.axles[0]) ** 2
                    for k, expected in enumerate(within[vehicle.name], used):
                        if total >= limit:
                            break
                        total += weight * (seen[k] - expected) ** 2
                    key = (group, taken, vehicle.name)
                    if total < limit and total < layers[stop].get(key, UNREACHED)[0]:
                        layers[stop][key] = (total, (*row, vehicle), free + chance[group])
    ends = [v for (g, count, _), v in layers[n_axle].items() if pattern.may_end(g, count)]
    return min(ends, key=lambda v: v[0], default=None)
