"""Fit the position of each axle in the train to the level around it.

From one sensor's own record the same fit gives the times at which the axles pass that sensor.
"""

from __future__ import annotations

import numpy as np

from turnout.passage.axle_features import GRID_STEP, along_train
from turnout.passage.kinematics import Motion
from turnout.passage.sensor_stack import SensorEnvelopes

FIT_REACH = 2.0  # m compared on either side of an axle
CONTACT_ROUNDING = 0.12  # m: contact patch and sleepers round the cusp at a wheel
MAX_SHIFT = 0.6  # m that an axle may move in the fit
MIN_SEPARATION = 3.5  # m: axles further from each other are fitted one by one
GRID_STRIDE = 2  # every second point of the grid is compared


def fit_axle_positions(envelopes: SensorEnvelopes, motion: Motion, offsets) -> np.ndarray:
    r"""(n_axle,) offsets [m] of the model that comes closest to the level along the train.

    .. math:: L(s) = \ln\Bigl(1 + \sum_j e^{\alpha_j - 2 r_j/\ell}\Bigr), \qquad r_j = \sqrt{(s - d_j)^2 + \rho^2}

    Power decays from a wheel at the same rate in both directions; powers of wheels add. Peaks of a sharpened profile
    are biased outwards within a bogie, and each depends on little data. Here 4 m of record determine each axle. An
    axle that would move more than 0.6 m stays where it was.
    """
    offsets = np.asarray(offsets, dtype=float)
    start, stop = offsets[0] - FIT_REACH, offsets[-1] + FIT_REACH
    values, positions = envelopes.levels.values, envelopes.positions
    level = along_train(values, envelopes.levels.step, positions, motion, start, stop).mean(axis=0)
    grid, level = (start + np.arange(level.size) * GRID_STEP)[::GRID_STRIDE], level[::GRID_STRIDE]
    height = np.maximum(np.interp(offsets, grid, level), 0.1)
    new_offsets = offsets.copy()
    for group in np.split(np.arange(offsets.size), np.flatnonzero(np.diff(offsets) > MIN_SEPARATION) + 1):
        inside = slice(*np.searchsorted(grid, [offsets[group[0]] - FIT_REACH, offsets[group[-1]] + FIT_REACH]))
        initial = np.concatenate([offsets[group], height[group], [0.0]])
        candidates = _fit_positions(grid[inside], level[inside], initial, group.size)
        new_offsets[group] = np.where(np.abs(candidates - offsets[group]) <= MAX_SHIFT, candidates, offsets[group])
    return new_offsets if np.all(np.diff(new_offsets) > 0.5) else offsets


def _fit_positions(grid, level, x, n, passes=15):
    """(n,) positions by Levenberg and Marquardt from ``x``: positions, heights, logarithm of the decay length."""
    misfit, jacobian = _level_misfit(grid, level, x, n)
    cost, damping = misfit @ misfit, 1e-2
    for _ in range(passes):
        normal = jacobian.T @ jacobian
        normal[np.diag_indices_from(normal)] *= 1.0 + damping
        normal[np.diag_indices_from(normal)] += 1e-9
        trial = x - np.clip(np.linalg.solve(normal, jacobian.T @ misfit), -0.5, 0.5)
        new_misfit, new_jacobian = _level_misfit(grid, level, trial, n)
        new_cost = new_misfit @ new_misfit
        if new_cost >= cost:
            damping *= 10.0
            if damping > 1e6:
                break
            continue
        converged = cost - new_cost < 1e-4 * cost
        x, misfit, jacobian, cost, damping = trial, new_misfit, new_jacobian, new_cost, damping / 5.0
        if converged:
            break
    return x[:n]


def _level_misfit(grid, level, x, n):
    """Misfit (n_grid,) and its derivatives (n_grid, 2 n + 1)."""
    distance = grid[:, None] - x[:n]
    r, length = np.hypot(distance, CONTACT_ROUNDING), np.exp(x[-1])
    u = np.exp(np.minimum(x[n:-1] - 2.0 * r / length, 50.0))
    total = 1.0 + u.sum(axis=1, keepdims=True)
    share = u / total
    by_length = np.sum(share * 2.0 * r / length, axis=1, keepdims=True)
    return np.log(total[:, 0]) - level, np.hstack([share * 2.0 / length * distance / r, share, by_length])


def sensor_times(envelopes: SensorEnvelopes, motion: Motion, offsets) -> np.ndarray:
    """(n_sensor, n_axle) passing times [s]; nan where a sensor's axle position deviates much from the common one."""
    rows = []
    for i, x in enumerate(envelopes.positions):
        axle_positions = fit_axle_positions(envelopes.select([i]), motion, offsets)
        deviation = np.abs(axle_positions - offsets - np.median(axle_positions - offsets))
        rows.append(np.where(deviation < 0.7 * MAX_SHIFT, motion.passing(axle_positions, x), np.nan))
    return np.array(rows)
