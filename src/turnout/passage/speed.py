r"""Speed and its change from axle times at several sensors, and from known axle distances."""

from __future__ import annotations

import numpy as np

from turnout.passage.findings import SpeedFinding
from turnout.passage.motion import Motion


def slowness_from_sensors(times, positions, direction: int, place_error: float, limit: float):
    r"""Slowness at the mean time [s/m], its change [s/m per s], and their standard errors.

    .. math:: t_{ij} = \tau_j + \frac{2 d\,x_i}{v_j + \sqrt{v_j^2 + 2 a\,d\,x_i}} + b_i q, \qquad
        v_j = \frac1q + a (\tau_j - \bar\tau), \quad a = -\frac{q'}{q^2}

    Every axle has its own free time, so the train need not be known. The b_i, where along the rail a sensor hears a
    wheel, do not average out over axles: their spread is estimated from the sensors where there are more than two,
    and is never taken below ``place_error`` [m].

    Parameters
    ----------
    times : (n_sensor, n_axle) array of float
        nan where a sensor has no time. [s]
    positions : (n_sensor,) array of float
        [m]
    limit : float
        Accelerations are a quarter as large, one standard deviation: two sensors alone would give any. [m/s²]
    """
    times, along = np.asarray(times, float), direction * np.asarray(positions, float)
    along = along - along.mean()
    centre = np.nanmean(times, axis=0)
    late = centre - centre.mean()
    sensor, axle = np.nonzero(np.isfinite(times))
    n_axle = times.shape[1]
    design = np.zeros((sensor.size, n_axle + 2))
    design[np.arange(sensor.size), axle] = 1.0
    design[:, -2] = along[sensor]
    design[:, -1] = along[sensor] * late[axle]
    target = times[sensor, axle]
    weight = np.ones(sensor.size)
    level = times - centre
    start = np.nansum(level * along[:, None]) / np.sum(np.isfinite(level) * along[:, None] ** 2)
    floor = 0.3 * place_error * abs(start)
    prior = np.zeros((1, n_axle + 2))
    scale, curved = floor, np.zeros(sensor.size)
    for _ in range(10):
        prior[0, -1] = scale / (0.25 * limit * start**2)
        rows = np.vstack([design * weight[:, None], prior])
        solution = np.linalg.lstsq(rows, np.append((target - curved) * weight, 0.0), rcond=None)[0]
        residual = target - curved - design @ solution
        scale = max(1.4826 * np.median(np.abs(residual)), floor)
        weight = np.sqrt(1.0 / np.maximum(1.0, np.abs(residual) / (2.5 * scale)))
        q, change = solution[-2:]
        if not q > 0.0:
            break
        curved = _by_motion(q, change, along[sensor], late[axle]) - along[sensor] * (q + change * late[axle])
    variance = max(np.sum((weight * residual) ** 2) / max(sensor.size - n_axle - 1, 1), floor**2)
    covariance = np.linalg.pinv(rows.T @ rows) * variance
    place = np.array([np.mean(residual[sensor == i]) for i in np.unique(sensor)])
    n_sensor = len(place)
    spread = np.sqrt(np.sum(place**2) / (n_sensor - 2)) if n_sensor > 2 else 0.0
    spread = max(spread, place_error * abs(q))
    extent = np.sum((along[np.unique(sensor)] - along[np.unique(sensor)].mean()) ** 2)
    return (
        q,
        change,
        float(np.hypot(np.sqrt(covariance[-2, -2]), spread / np.sqrt(extent))),
        float(np.sqrt(covariance[-1, -1])),
        float(solution[:-2].mean()),
        residual_by_sensor(times, residual, sensor, axle),
    )


def _by_motion(q, change, along, late):
    """Times from the middle of the sensors to places ``along``, of a slowness ``q`` that changes steadily in speed."""
    acceleration = -change / q**2
    speed = np.maximum(1.0 - change / q * late, 0.2) / q
    return 2.0 * along / (speed + np.sqrt(np.maximum(speed**2 + 2.0 * acceleration * along, 0.0)))


def residual_by_sensor(times, residual, sensor, axle):
    """(n_sensor, n_axle) residuals [s], nan where there is no time."""
    table = np.full(np.shape(times), np.nan)
    table[sensor, axle] = residual
    return table


def combine(from_sensors, from_type, at: float) -> SpeedFinding:
    """Speed at the time ``at`` [s] from both sources, weighted by their variances.

    Each source is (speed, se, acceleration, acceleration se, time its speed belongs to) or None.
    """
    carried = []
    for source in (from_sensors, from_type):
        if source is None:
            carried.append(None)
            continue
        v, se, a, a_se, time = source
        carried.append((v + a * (at - time), float(np.hypot(se, a_se * (at - time))), a, a_se))
    sensors, spacing = carried
    if sensors is None or spacing is None:
        v, se, a, a_se = sensors or spacing
        return SpeedFinding(v, se, a, a_se, "sensors" if sensors else "axle spacing", None, at)
    difference = (sensors[0] - spacing[0]) / np.hypot(sensors[1], spacing[1])
    if abs(difference) > 3.0:
        # distances in a train are known better than where along the rail a sensor hears it
        return SpeedFinding(*spacing, "axle spacing", float(difference), at)
    v, se = weighted(sensors[:2], spacing[:2])
    a, a_se = weighted(sensors[2:], spacing[2:])
    return SpeedFinding(v, se, a, a_se, "both", float(difference), at)


def weighted(first, second) -> tuple[float, float]:
    """Mean of two (value, standard error) by inverse variance.

    >>> weighted((10.0, 1.0), (20.0, 1e9))
    (10.0, 1.0)
    """
    (a, sa), (b, sb) = first, second
    wa, wb = 1 / sa**2, 1 / sb**2
    return round(float((wa * a + wb * b) / (wa + wb)), 12), float(1 / np.sqrt(wa + wb))


def motion_of(finding: SpeedFinding, start: float, direction: int) -> Motion:
    """Motion with the found speed, first axle at the origin at ``start`` [s]."""
    return Motion(finding.at(start), start, finding.acceleration, direction)
