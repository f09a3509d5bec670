"""Find rows of vehicles by dynamic programming.

One function finds the row that explains most of the profiles, once the tooth of one wheel is known. The other finds the
row of a pattern that is closest to given axle spacings.
"""

from __future__ import annotations

import numpy as np

from turnout.passage.axle_patterns import Pattern
from turnout.passage.comb import LEAD, STEP, TAPS, Profiles

SLACK = 1  # grid steps that a vehicle may deviate: rounding of lengths, error of the speed


def likeliest_row(profiles: Profiles, teeth, pattern: Pattern, first: float, reach: float = 30.0):
    r"""(row of vehicles, start [m]) of ``pattern`` with the smallest residual; None where there is none.

    .. math:: \|y - \sum_j k(s - d_j)\|^2 = \|y\|^2 - \sum_j \Bigl(2 m(d_j) - \sum_l a(d_j - d_l)\Bigr)

    with m the correlation of profile and tooth and a that of the tooth with itself: terms of a vehicle, and of a
    vehicle and the one before it. The first axle is sought within ``reach`` metres of ``first``, both behind the
    beginning of the audible part. ``teeth`` (n_sensor, N_TAPS), ``profiles`` of one motion.
    """
    values = profiles.values[:, 0]
    match = sum(np.correlate(np.pad(v, TAPS // 2), k, "valid") for v, k in zip(values, teeth))
    self_match = sum(np.correlate(np.pad(k, TAPS - 1), k, "valid") for k in teeth)
    n, inner = match.size, {}
    couplings = _Couplings(self_match)
    for group in pattern.groups:
        for v in group.vehicles:
            inner[v.name] = _gain(match, v, couplings)
    layers: dict[tuple, dict] = {}
    for node in pattern.following(0, 0):
        for v in pattern.groups[node[0]].vehicles:
            gain = np.full(n, -np.inf)
            at = round((first + LEAD - v.axles[0]) / STEP)
            part = slice(max(at - int(reach / STEP), 0), max(at + int(reach / STEP) + 1, 0))
            gain[part] = inner[v.name][part]
            layers.setdefault(node, {})[v.name] = (gain, ([None], np.zeros(n, int), np.zeros(n, int)), v)
    best = (-np.inf, None)
    for node in [(g, c) for g, group in enumerate(pattern.groups) for c in range(1, group.maximum + 1)]:
        for name, (score, _, v) in layers.get(node, {}).items():
            if not np.isfinite(score).any():
                continue
            if pattern.may_end(*node) and score.max() > best[0]:
                best = (float(score.max()), (node, name, int(score.argmax())))
            for following in pattern.following(*node):
                for w in pattern.groups[following[0]].vehicles:
                    _extend(layers, node, following, v, w, score, inner[w.name], couplings)
    return None if best[1] is None else _traced(layers, best[1])


class _Couplings:
    """What overlapping teeth subtract: -a(distance) twice, between axles."""

    def __init__(self, self_match):
        self.places = (np.arange(self_match.size) - TAPS + 1) * STEP
        self.values = self_match

    def at(self, distance):
        """Autocorrelation a of the tooth at ``distance`` [m]."""
        return np.interp(distance, self.places, self.values, left=0.0, right=0.0)

    def between(self, v, w):
        """Sum over all axles of ``v`` with those of ``w`` behind it."""
        apart = v.length + np.asarray(w.axles)[None] - np.asarray(v.axles)[:, None]
        return 2.0 * float(np.sum(self.at(apart)))


def _gain(match, v, couplings):
    """(n,) gain of vehicle ``v`` with its front coupler at each point of the grid."""
    place = np.arange(match.size)
    total = np.zeros(match.size)
    for axle in v.axles:
        total += 2.0 * np.interp(place + axle / STEP, place, match, right=0.0)
    axles = np.asarray(v.axles)
    return total - float(np.sum(couplings.at(axles[:, None] - axles[None])))


def _extend(layers, node, following, v, w, score, gain, couplings):
    """Couple ``w`` behind every row that ends with ``v``; of rows with the same end the better one stays."""
    n, length = score.size, round(v.length / STEP)
    reached, step = np.full(n, -np.inf), np.zeros(n, dtype=int)
    for shift in range(length - SLACK, length + SLACK + 1):
        here = np.full(n, -np.inf)
        here[min(shift, n) :] = score[: max(n - shift, 0)]
        better = here > reached
        reached, step = np.where(better, here, reached), np.where(better, shift, step)
    reached = reached + gain - couplings.between(v, w)
    known = layers.setdefault(following, {}).get(w.name)
    sources = [] if known is None else known[1][0]
    source = np.full(n, len(sources))
    if known is not None:
        better = reached > known[0]
        reached = np.where(better, reached, known[0])
        source, step = np.where(better, source, known[1][1]), np.where(better, step, known[1][2])
    layers[following][w.name] = (reached, ([*sources, (node, v.name)], source, step), w)


def _traced(layers, end):
    """(row, start [m]) of the best row, traced from its end to its beginning."""
    row, (node, name, place) = [], end
    while True:
        _, (sources, source, step), v = layers[node][name]
        row.append(v)
        before = sources[source[place]]
        if before is None:
            return tuple(reversed(row)), place * STEP - LEAD + v.axles[0]
        node, name, place = *before, place - int(step[place])


UNREACHED = (np.inf,)


def best_row(spacing, pattern: Pattern, tolerance: float):
    """(cost [nat], row of vehicles, its choices): axle spacings closest to ``spacing`` (n_axle - 1,) [m].

    Cost is half the squared deviation in units of ``tolerance`` [m], summed over the spacings, plus the logarithm of
    the number of vehicles to choose from; ``choices`` is the sum of these logarithms. None where the pattern cannot
    have this number of axles, or where no row is near.
    """
    n_axle = len(spacing) + 1
    low, high = pattern.axle_counts()
    if not low <= n_axle <= high:
        return None
    limit = 20.0 + 4.0 * n_axle  # above it the chi-squared test fails anyway
    # plain floats for speed: there are several 1e5 pairs, most of them rejected at the first spacing
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
