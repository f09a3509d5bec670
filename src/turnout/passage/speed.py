"""Estimate speed and acceleration from axle times at several sensors and from known axle distances.

For a train that brakes or accelerates, the records of its first and its second half give the acceleration.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import MAD_TO_SD
from turnout.passage.kinematics import Motion
from turnout.passage.position_checks import half_shifts
from turnout.passage.result import SpeedFinding

if TYPE_CHECKING:
    from turnout.passage.sensor_envelopes import SensorEnvelopes


def slowness_from_sensors(
    times: np.ndarray, positions: np.ndarray, direction: int, position_error: float, limit: float
) -> tuple[float, float, float, float, float, np.ndarray]:
    r"""Slowness at the mean time [s/m], its change [s/m per s], and their standard errors.

    .. math:: t_{ij} = \tau_j + \frac{2 d\,x_i}{v_j + \sqrt{v_j^2 + 2 a\,d\,x_i}} + b_i q, \qquad
        v_j = \frac1q + a (\tau_j - \bar\tau), \quad a = -\frac{q'}{q^2}

    Every axle has its own free time, so the train need not be known. The b_i are the offsets along the rail between a
    sensor and a wheel in its record. They do not average out over axles. Their spread is estimated from the sensors
    where there are more than two, and is at least ``position_error`` [m]. So is the scatter of the single times about
    the fit: a few axles leave no residual that could show it.

    Parameters
    ----------
    times : (n_sensor, n_axle) array of float
        nan where a sensor has no time. [s]
    positions : (n_sensor,) array of float
        [m]
    direction : int
        +1 for a train towards larger positions, -1 against them.
    position_error : float
        Least standard deviation of the offsets b_i, and of the position of an axle in the record of a sensor. [m]
    limit : float
        Four standard deviations of the prior of the acceleration: two sensors alone leave it open. [m/s²]

    Returns
    -------
    q, change : float
        Slowness at the mean time [s/m], and its change [s/m per s].
    q_se, change_se : float
        Their standard errors.
    time : float
        Mean time. [s]
    residual : (n_sensor, n_axle) array of float
        Times less the fitted ones, nan where there is no time. [s]
    """
    times, travel = np.asarray(times, float), direction * np.asarray(positions, float)
    travel = travel - travel.mean()
    centre = np.nanmean(times, axis=0)
    elapsed = centre - centre.mean()
    sensor, axle = np.nonzero(np.isfinite(times))
    n_axle = times.shape[1]
    design = np.zeros((sensor.size, n_axle + 2))
    design[np.arange(sensor.size), axle] = 1.0
    design[:, -2] = travel[sensor]
    design[:, -1] = travel[sensor] * elapsed[axle]
    target = times[sensor, axle]
    weight = np.ones(sensor.size)
    level = times - centre
    start = np.nansum(level * travel[:, None]) / np.sum(np.isfinite(level) * travel[:, None] ** 2)
    min_scale = position_error * abs(start)
    prior = np.zeros((1, n_axle + 2))
    scale, curvature = min_scale, np.zeros(sensor.size)
    for _ in range(10):
        prior[0, -1] = scale / (0.25 * limit * start**2)
        rows = np.vstack([design * weight[:, None], prior])
        solution = np.linalg.lstsq(rows, np.append((target - curvature) * weight, 0.0), rcond=None)[0]
        residual = target - curvature - design @ solution
        scale = max(MAD_TO_SD * np.median(np.abs(residual)), min_scale)
        weight = np.sqrt(1.0 / np.maximum(1.0, np.abs(residual) / (2.5 * scale)))
        q, change = solution[-2:]
        if not q > 0.0:
            break
        curvature = _travel_times(q, change, travel[sensor], elapsed[axle]) - travel[sensor] * (
            q + change * elapsed[axle]
        )
    variance = max(np.sum((weight * residual) ** 2) / max(sensor.size - n_axle - 1, 1), min_scale**2)
    covariance = np.linalg.pinv(rows.T @ rows) * variance
    sensor_residual = np.array([np.mean(residual[sensor == i]) for i in np.unique(sensor)])
    n_sensor = len(sensor_residual)
    spread = np.sqrt(np.sum(sensor_residual**2) / (n_sensor - 2)) if n_sensor > 2 else 0.0
    spread = max(spread, position_error * abs(q))
    extent = np.sum((travel[np.unique(sensor)] - travel[np.unique(sensor)].mean()) ** 2)
    return (
        q,
        change,
        float(np.hypot(np.sqrt(covariance[-2, -2]), spread / np.sqrt(extent))),
        float(np.sqrt(covariance[-1, -1])),
        float(solution[:-2].mean()),
        residual_by_sensor(times, residual, sensor, axle),
    )


def _travel_times(q: float, change: float, travel: np.ndarray, elapsed: np.ndarray) -> np.ndarray:
    """Travel times from the middle of the sensors to positions ``travel``, at a slowness ``q`` with a steady change."""
    acceleration = -change / q**2
    speed = np.maximum(1.0 - change / q * elapsed, 0.2) / q
    return 2.0 * travel / (speed + np.sqrt(np.maximum(speed**2 + 2.0 * acceleration * travel, 0.0)))


def residual_by_sensor(times: np.ndarray, residual: np.ndarray, sensor: np.ndarray, axle: np.ndarray) -> np.ndarray:
    """(n_sensor, n_axle) residuals [s], nan where there is no time.

    Parameters
    ----------
    times : (n_sensor, n_axle) array of float
        Times, for their shape. [s]
    residual : (n,) array of float
        Residuals. [s]
    sensor, axle : (n,) array of int
        Row and column of each residual.

    Returns
    -------
    (n_sensor, n_axle) array of float
        The residuals in a table. [s]
    """
    table = np.full(np.shape(times), np.nan)
    table[sensor, axle] = residual
    return table


def combine_speeds(
    from_sensors: tuple[float, float, float, float, float] | None,
    from_type: tuple[float, float, float, float, float] | None,
    at: float,
) -> SpeedFinding:
    """Speed at the time ``at`` [s] from both sources, weighted by their variances.

    Each source is (speed, se, acceleration, acceleration se, time of its speed) or None.

    Parameters
    ----------
    from_sensors, from_type : tuple of five float, or None
        Speed and its standard error [m/s], acceleration and its standard error [m/s²], and time of the speed [s]; at
        least one of the two sources.
    at : float
        Time of the result. [s]

    Returns
    -------
    SpeedFinding
        Axle spacing alone where both differ by more than three standard errors.

    Raises
    ------
    ValueError
        Both sources are None.
    """
    at_time: list[tuple[float, float, float, float] | None] = []
    for source in (from_sensors, from_type):
        if source is None:
            at_time.append(None)
            continue
        v, se, a, a_se, time = source
        at_time.append((v + a * (at - time), float(np.hypot(se, a_se * (at - time))), a, a_se))
    sensors, spacing = at_time
    if sensors is None or spacing is None:
        single = spacing if sensors is None else sensors
        if single is None:
            raise ValueError("a speed needs at least one source")
        return SpeedFinding(*single, "axle spacing" if sensors is None else "sensors", None, at)
    difference = (sensors[0] - spacing[0]) / np.hypot(sensors[1], spacing[1])
    if abs(difference) > 3.0:
        # distances in a train are known better than the offset between sensor and wheel
        return SpeedFinding(*spacing, "axle spacing", float(difference), at)
    v, se = weighted_mean(sensors[:2], spacing[:2])
    a, a_se = weighted_mean(sensors[2:], spacing[2:])
    return SpeedFinding(v, se, a, a_se, "both", float(difference), at)


def weighted_mean(first: tuple[float, float], second: tuple[float, float]) -> tuple[float, float]:
    """Mean of two (value, standard error) by inverse variance.

    Parameters
    ----------
    first, second : (float, float)
        Value and standard error. [any unit]

    Returns
    -------
    mean, se : float
        [same unit]

    Examples
    --------
    Errors of 3 and 4 weigh as 16 to 9.

    >>> mean, se = weighted_mean((10.0, 3.0), (20.0, 4.0))
    >>> print(f"{mean:.2f} {se:.2f}")
    13.60 2.40
    """
    (a, sa), (b, sb) = first, second
    wa, wb = 1 / sa**2, 1 / sb**2
    return round(float((wa * a + wb * b) / (wa + wb)), 12), float(1 / np.sqrt(wa + wb))


def motion_of(finding: SpeedFinding, start: float, direction: int) -> Motion:
    """Motion with the speed of ``finding``, first axle at the origin at ``start`` [s].

    Parameters
    ----------
    finding : SpeedFinding
        Speed and acceleration.
    start : float
        Time of the first axle at the origin. [s]
    direction : int
        +1 for a train towards larger positions, -1 against them.

    Returns
    -------
    Motion
        With the speed at ``start``.
    """
    return Motion(finding.at(start), start, finding.acceleration, direction)


MAX_STEADY_SHIFT = 0.15  # m, largest mean difference between the halves of a steady train
MAX_PASSES, SLOPE_TOLERANCE = 6, 2e-3  # largest number of passes; slope at which they have converged


def with_acceleration(envelopes: SensorEnvelopes, motion: Motion, limit: float) -> Motion:
    """The motion with the acceleration that aligns all sensors in both halves of the train.

    If the train runs at v and is assumed to run at v', a sensor x metres on records it :math:`x (v'/v - 1)` metres too
    far back. The slope over the sensors gives the speed of each half. The acceleration is accepted where it more than
    halves the spread; a single wrong clock cannot do that. Equal wagons may hide a change of speed of a fifth or more.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of three sensors or more, else the motion stays as it is.
    motion : Motion
        At a steady speed.
    limit : float
        Largest acceleration. [m/s²]

    Returns
    -------
    Motion
        ``motion`` itself where the acceleration is not accepted, or the first axle would not pass the origin.
    """
    if len(envelopes.positions) < 3:
        return motion
    shifts = half_shifts(envelopes, motion)
    spread, adjusted = _half_spread(shifts), motion
    if spread < MAX_STEADY_SHIFT:
        return motion
    for _ in range(MAX_PASSES):
        slopes = [_slope(motion.direction * envelopes.positions, row) for row in shifts.T]
        adjusted = _with_half_slopes(adjusted, envelopes, np.clip(slopes, -0.3, 0.3))
        if abs(adjusted.acceleration) > limit:
            return motion
        shifts = half_shifts(envelopes, adjusted)
        if np.max(np.abs(slopes)) < SLOPE_TOLERANCE:
            break
    return adjusted if adjusted.speed > 0.0 and _half_spread(shifts) < 0.5 * spread else motion


def _half_spread(shifts: np.ndarray) -> float:
    """Mean over the sensors of the difference between the halves, against the median sensor. [m]"""
    change = shifts[:, 1] - shifts[:, 0]
    return float(np.mean(np.abs(change - np.median(change))))


def _slope(travel: np.ndarray, shift: np.ndarray) -> float:
    """Median slope over all pairs of sensors (Theil and Sen), except pairs at one position."""
    pairs = [(i, j) for i, j in combinations(range(len(travel)), 2) if abs(travel[j] - travel[i]) > 0.5]
    return float(np.median([(shift[j] - shift[i]) / (travel[j] - travel[i]) for i, j in pairs])) if pairs else 0.0


def _with_half_slopes(motion: Motion, envelopes: SensorEnvelopes, slopes: np.ndarray) -> Motion:
    """The motion with the speeds in the middles of both halves corrected by ``slopes``, by which they are too high."""
    begin, end = motion.distance(envelopes.begin), motion.distance(envelopes.end)
    times = motion.time(begin + np.array([0.25, 0.75]) * (end - begin))
    speeds = motion.speed_at(times) / (1.0 + slopes)
    middle, change = float(times.mean()), float(np.diff(speeds)[0] / np.diff(times)[0])
    middle_motion = Motion(float(speeds.mean()), middle, change, motion.direction)
    return middle_motion.relative_to_axle(-float(motion.distance(middle)))
