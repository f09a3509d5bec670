"""Whether the vehicles of a row stand as the template has them: their axles moved alike in every vehicle of a kind."""

from __future__ import annotations

import numpy as np

from turnout.passage.comb import LEAD, STEP, TAPS, Comb, Profiles

STRIDES = (0.24, 0.12, 0.06, 0.03)  # m
BOGIE = 3.6  # m, axles closer than this are also moved against each other
WORTH = 1e-4  # share of the power that a move must explain
STARTS = np.arange(-2, 3) * STEP  # m by which the whole row may move


def reshaped(profiles: Profiles, vehicles, places, start: float, reach: float = 0.6):
    """(places, share before, share after): ``places`` changed until the comb explains most, alike in all vehicles.

    A train without template that looks like a known one differs from it in every vehicle: wheelbases, pivots. That
    shows here when the axles, each by itself, hide it: the tooth, estimated with them, blurs until they seem in place.

    Parameters
    ----------
    profiles : Profiles
        Of one motion.
    vehicles : sequence of Vehicle
        The row, its axles at ``places``.
    places : (n_axle,) array of float
        Metres behind the first axle.
    start : float
        Of the first axle, from where the hearing begins. [m]
    reach : float
        By how much an axle may move at most. [m]
    """
    kinds = [(v.name, i) for v in vehicles for i in range(len(v.axles))]
    names = list(dict.fromkeys(kinds))
    which = np.array([names.index(kind) for kind in kinds])
    change = np.zeros(len(names))
    best = first = _share(profiles, places, start)
    for stride in STRIDES:
        for _ in range(4):
            before = best
            for move in _moves(vehicles, names):
                for signed in (stride, -stride):
                    trial = np.clip(change + signed * move, -reach, reach)
                    share = _share(profiles, places + trial[which], start)
                    if share > best + WORTH:
                        best, change = share, trial
                        break
            if best - before < 4 * WORTH:
                break
    return places + change[which], first, best


def _moves(vehicles, names):
    """Each axle of a kind by itself, neighbours in a bogie against each other, and both bogies of a vehicle wider."""
    index, moves = {name: k for k, name in enumerate(names)}, list(np.eye(len(names)))
    for v in {v.name: v for v in vehicles}.values():
        own = np.array([index[v.name, i] for i in range(len(v.axles))])
        wide = np.zeros(len(names))
        for i, gap in enumerate(np.diff(v.axles)):
            if gap < BOGIE:
                stretch = np.zeros(len(names))
                stretch[own[i : i + 2]] = -0.5, 0.5
                moves.append(stretch)
                wide += stretch
        apart = np.zeros(len(names))
        apart[own] = np.where(np.asarray(v.axles) < 0.5 * v.length, -0.5, 0.5)
        moves += [wide, apart]
    return moves


def _share(profiles, places, start):
    """Share of the power that a comb at ``places`` explains, at the best of a few starts near ``start``."""
    first = places[0]
    if not np.all(np.diff(places) > 0.5):
        return -np.inf
    comb = Comb.of(places - first)
    lags = np.arange(TAPS) - TAPS // 2
    teeth = np.flatnonzero(comb.teeth)
    total = np.zeros(STARTS.size)
    for values in profiles.values[:, 0]:
        padded = np.pad(values, (TAPS, TAPS + comb.teeth.size))
        for k, shift in enumerate(STARTS):
            # whole steps: the tooth takes up the rest
            at = round((start + first + shift + LEAD) / STEP) + TAPS
            found = comb.teeth[teeth] @ padded[at + teeth[:, None] + lags]
            total[k] += found @ comb.inverse @ found
    return float(total.max() / profiles.power[0])
