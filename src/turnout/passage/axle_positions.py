"""Fit the position of each axle in the train to the level around it.

From one sensor's own record the same fit gives the times at which the axles pass that sensor.
"""

from __future__ import annotations

import numpy as np

from turnout.passage.axle_features import GRID, along_train
from turnout.passage.kinematics import Motion
from turnout.passage.sensor_stack import Listening

REACH = 2.0  # m compared on either side of an axle
ROUND = 0.12  # m: contact patch and sleepers round the cusp at a wheel
MOST = 0.6  # m that an axle may move in the fit
APART = 3.5  # m: axles further from each other are fitted one by one
EVERY = 2  # every second point of the grid is compared


def axle_places(listening: Listening, motion: Motion, offsets) -> np.ndarray:
    r"""(n_axle,) offsets [m] of the model that comes closest to the level along the train.

    .. math:: L(s) = \ln\Bigl(1 + \sum_j e^{\alpha_j - 2 r_j/\ell}\Bigr), \qquad r_j = \sqrt{(s - d_j)^2 + \rho^2}

    Power decays from a wheel at the same rate in both directions; powers of wheels add. Peaks of a sharpened profile
    are biased outwards within a bogie, and each depends on little data. Here 4 m of record determine each axle. An
    axle that would move more than 0.6 m stays where it was.
    """
    offsets = np.asarray(offsets, dtype=float)
    start, stop = offsets[0] - REACH, offsets[-1] + REACH
    values, positions = listening.levels.values, listening.positions
    level = along_train(values, listening.levels.step, positions, motion, start, stop).mean(axis=0)
    place, level = (start + np.arange(level.size) * GRID)[::EVERY], level[::EVERY]
    height = np.maximum(np.interp(offsets, place, level), 0.1)
    moved = offsets.copy()
    for part in np.split(np.arange(offsets.size), np.flatnonzero(np.diff(offsets) > APART) + 1):
        inside = slice(*np.searchsorted(place, [offsets[part[0]] - REACH, offsets[part[-1]] + REACH]))
        first = np.concatenate([offsets[part], height[part], [0.0]])
        found = _fitted(place[inside], level[inside], first, part.size)
        moved[part] = np.where(np.abs(found - offsets[part]) <= MOST, found, offsets[part])
    return moved if np.all(np.diff(moved) > 0.5) else offsets


def _fitted(place, level, x, n, passes=15):
    """(n,) positions by Levenberg and Marquardt from ``x``: positions, heights, logarithm of the decay length."""
    misfit, jacobian = _model(place, level, x, n)
    square, damping = misfit @ misfit, 1e-2
    for _ in range(passes):
        normal = jacobian.T @ jacobian
        normal[np.diag_indices_from(normal)] *= 1.0 + damping
        normal[np.diag_indices_from(normal)] += 1e-9
        trial = x - np.clip(np.linalg.solve(normal, jacobian.T @ misfit), -0.5, 0.5)
        new_misfit, new_jacobian = _model(place, level, trial, n)
        new_square = new_misfit @ new_misfit
        if new_square >= square:
            damping *= 10.0
            if damping > 1e6:
                break
            continue
        done = square - new_square < 1e-4 * square
        x, misfit, jacobian, square, damping = trial, new_misfit, new_jacobian, new_square, damping / 5.0
        if done:
            break
    return x[:n]


def _model(place, level, x, n):
    """Misfit (n_grid,) and its derivatives (n_grid, 2 n + 1)."""
    distance = place[:, None] - x[:n]
    r, length = np.hypot(distance, ROUND), np.exp(x[-1])
    u = np.exp(np.minimum(x[n:-1] - 2.0 * r / length, 50.0))
    total = 1.0 + u.sum(axis=1, keepdims=True)
    share = u / total
    by_length = np.sum(share * 2.0 * r / length, axis=1, keepdims=True)
    return np.log(total[:, 0]) - level, np.hstack([share * 2.0 / length * distance / r, share, by_length])


def sensor_times(listening: Listening, motion: Motion, offsets) -> np.ndarray:
    """(n_sensor, n_axle) passing times [s]; nan where a sensor's axle position deviates much from the common one."""
    rows = []
    for i, x in enumerate(listening.positions):
        places = axle_places(listening.only([i]), motion, offsets)
        moved = np.abs(places - offsets - np.median(places - offsets))
        rows.append(np.where(moved < 0.7 * MOST, motion.passing(places, x), np.nan))
    return np.array(rows)
