"""Find rows of vehicles by dynamic programming.

One function finds the row that explains most of the profiles, once the tooth of one wheel is known. The other finds the
row of a pattern that is closest to given axle spacings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.passage.axle_patterns import Pattern
from turnout.passage.comb import COMB_STEP, LEAD_LENGTH, N_TAPS, Profiles

if TYPE_CHECKING:
    from turnout.passage.axle_patterns import Vehicle

FIRST_AXLE_REACH = 30.0  # m, largest distance of the first axle from the expected one
LENGTH_SLACK = 1  # grid steps that a vehicle may deviate: rounding of lengths, error of the speed


def likeliest_row(
    profiles: Profiles, teeth: np.ndarray, pattern: Pattern, first: float
) -> tuple[tuple[Vehicle, ...], float] | None:
    r"""(row of vehicles, start [m]) of ``pattern`` with the smallest residual; None where there is none.

    .. math:: \|y - \sum_j k(s - d_j)\|^2 = \|y\|^2 - \sum_j \Bigl(2 m(d_j) - \sum_l a(d_j - d_l)\Bigr)

    with m the correlation of profile and tooth and a that of the tooth with itself: terms of a vehicle, and of a
    vehicle and the one before it. The first axle is sought within ``FIRST_AXLE_REACH`` of ``first``, both behind the
    beginning of the audible part. ``teeth`` (n_sensor, N_TAPS), ``profiles`` of one motion.

    Parameters
    ----------
    profiles : Profiles
        Records along the train for one motion.
    teeth : (n_sensor, N_TAPS) array of float
        What each sensor records of one wheel. [-]
    pattern : Pattern
        Axle pattern of a type of train.
    first : float
        Expected first axle, behind the beginning of the audible part. [m]

    Returns
    -------
    (tuple of Vehicle, float) or None
        The row, and its first axle behind the beginning of the audible part [m].
    """
    values = profiles.values[:, 0]
    match = sum((np.correlate(np.pad(v, N_TAPS // 2), k, "valid") for v, k in zip(values, teeth)), np.zeros(1))
    self_match = sum((np.correlate(np.pad(k, N_TAPS - 1), k, "valid") for k in teeth), np.zeros(1))
    n, gains = match.size, {}
    overlaps = _ToothOverlaps(self_match)
    for group in pattern.groups:
        for v in group.vehicles:
            gains[v.name] = _vehicle_gain(match, v, overlaps)
    layers: dict[tuple, dict] = {}
    reach = int(FIRST_AXLE_REACH / COMB_STEP)
    for node in pattern.next_vehicles(0, 0):
        for v in pattern.groups[node[0]].vehicles:
            gain = np.full(n, -np.inf)
            index = round((first + LEAD_LENGTH - v.axles[0]) / COMB_STEP)
            inside = slice(max(index - reach, 0), max(index + reach + 1, 0))
            gain[inside] = gains[v.name][inside]
            layers.setdefault(node, {})[v.name] = (gain, ([None], np.zeros(n, int), np.zeros(n, int)), v)
    best_end: tuple[float, tuple | None] = (-np.inf, None)
    for node in [(g, c) for g, group in enumerate(pattern.groups) for c in range(1, group.maximum + 1)]:
        for name, (score, _, v) in layers.get(node, {}).items():
            if not np.isfinite(score).any():
                continue
            if pattern.can_end(*node) and score.max() > best_end[0]:
                best_end = (float(score.max()), (node, name, int(score.argmax())))
            for successor in pattern.next_vehicles(*node):
                for w in pattern.groups[successor[0]].vehicles:
                    _extend_rows(layers, node, successor, v, w, score, gains[w.name], overlaps)
    return None if best_end[1] is None else _trace_back(layers, best_end[1])


class _ToothOverlaps:
    """What overlapping teeth subtract: -a(distance) twice, between axles."""

    def __init__(self, self_match: np.ndarray) -> None:
        self.distances = (np.arange(self_match.size) - N_TAPS + 1) * COMB_STEP
        self.values = self_match

    def at(self, distance: np.ndarray) -> np.ndarray:
        """Autocorrelation a of the tooth at ``distance`` [m]."""
        return np.interp(distance, self.distances, self.values, left=0.0, right=0.0)

    def between(self, v: Vehicle, w: Vehicle) -> float:
        """Sum over all axles of ``v`` with those of ``w`` behind it."""
        distance = v.length + np.asarray(w.axles)[None] - np.asarray(v.axles)[:, None]
        return 2.0 * float(np.sum(self.at(distance)))


def _vehicle_gain(match: np.ndarray, v: Vehicle, overlaps: _ToothOverlaps) -> np.ndarray:
    """(n,) gain of vehicle ``v`` with its front coupler at each point of the grid."""
    grid = np.arange(match.size)
    total = np.zeros(match.size)
    for axle in v.axles:
        total += 2.0 * np.interp(grid + axle / COMB_STEP, grid, match, right=0.0)
    axles = np.asarray(v.axles)
    return total - float(np.sum(overlaps.at(axles[:, None] - axles[None])))


def _extend_rows(
    layers: dict[tuple, dict],
    node: tuple[int, int],
    successor: tuple[int, int],
    v: Vehicle,
    w: Vehicle,
    score: np.ndarray,
    gain: np.ndarray,
    overlaps: _ToothOverlaps,
) -> None:
    """Couple ``w`` behind every row that ends with ``v``; of rows with the same end the better one stays."""
    n, length = score.size, round(v.length / COMB_STEP)
    reached, step = np.full(n, -np.inf), np.zeros(n, dtype=int)
    for shift in range(length - LENGTH_SLACK, length + LENGTH_SLACK + 1):
        shifted = np.full(n, -np.inf)
        shifted[min(shift, n) :] = score[: max(n - shift, 0)]
        better = shifted > reached
        reached, step = np.where(better, shifted, reached), np.where(better, shift, step)
    reached = reached + gain - overlaps.between(v, w)
    existing = layers.setdefault(successor, {}).get(w.name)
    sources = [] if existing is None else existing[1][0]
    source = np.full(n, len(sources))
    if existing is not None:
        better = reached > existing[0]
        reached = np.where(better, reached, existing[0])
        source, step = np.where(better, source, existing[1][1]), np.where(better, step, existing[1][2])
    layers[successor][w.name] = (reached, ([*sources, (node, v.name)], source, step), w)


def _trace_back(layers: dict[tuple, dict], end: tuple) -> tuple[tuple[Vehicle, ...], float]:
    """(row, start [m]) of the best row, traced from its end to its beginning."""
    row, (node, name, index) = [], end
    while True:
        _, (sources, source, step), v = layers[node][name]
        row.append(v)
        previous = sources[source[index]]
        if previous is None:
            return tuple(reversed(row)), index * COMB_STEP - LEAD_LENGTH + v.axles[0]
        (node, name), index = previous, index - int(step[index])


UNREACHED = (np.inf,)


def closest_row(
    spacing: np.ndarray, pattern: Pattern, tolerance: float
) -> tuple[float, tuple[Vehicle, ...], float] | None:
    """(cost [nat], row of vehicles, its choices): axle spacings closest to ``spacing`` (n_axle - 1,) [m].

    Cost is half the squared deviation in units of ``tolerance`` [m], summed over the spacings, plus the logarithm of
    the number of vehicles to choose from; ``choices`` is the sum of these logarithms. None where the pattern cannot
    have this number of axles, or where no row is near.

    Parameters
    ----------
    spacing : (n_axle - 1,) array of float
        Distances between neighbouring axles. [m]
    pattern : Pattern
        Axle pattern of a type of train.
    tolerance : float
        Standard deviation of a spacing. [m]

    Returns
    -------
    (float, tuple of Vehicle, float) or None
        Cost [nat], row and choices [nat].
    """
    n_axle = len(spacing) + 1
    low, high = pattern.axle_counts()
    if not low <= n_axle <= high:
        return None
    limit = 20.0 + 4.0 * n_axle  # above it the chi-squared test fails anyway
    # plain floats for speed: there are several 1e5 pairs, most of them rejected at the first spacing
    spacings, weight, own_spacings = np.asarray(spacing).tolist(), 0.5 / tolerance**2, pattern.spacings
    log_choices = pattern.log_n_choices
    # state: axles used, group, vehicles used of the group, last vehicle -> (cost, row, choices)
    layers: list[dict[tuple, tuple[float, tuple[Vehicle, ...], float]]] = [{} for _ in range(n_axle + 1)]
    layers[0][(0, 0, None)] = (0.0, (), 0.0)
    for n_axle_used in range(n_axle):
        for (g, count, _), (cost, row, free) in layers[n_axle_used].items():
            for group, n_used in pattern.next_vehicles(g, count):
                choices = pattern.groups[group].vehicles
                for vehicle in choices:
                    stop = n_axle_used + len(vehicle.axles)
                    if stop > n_axle:
                        continue
                    total = cost + log_choices[group]
                    if row:
                        total += weight * (spacings[n_axle_used - 1] - row[-1].rear - vehicle.axles[0]) ** 2
                    for k, expected in enumerate(own_spacings[vehicle.name], n_axle_used):
                        if total >= limit:
                            break
                        total += weight * (spacings[k] - expected) ** 2
                    key = (group, n_used, vehicle.name)
                    if total < limit and total < layers[stop].get(key, UNREACHED)[0]:
                        layers[stop][key] = (total, (*row, vehicle), free + log_choices[group])
    ends = [v for (g, count, _), v in layers[n_axle].items() if pattern.can_end(g, count)]
    return min(ends, key=lambda v: v[0], default=None)
