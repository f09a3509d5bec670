"""Channels that show no more than so much under the hammer: harder blows, the same peak."""

import numpy as np

from turnout.receptance import find_impacts

FEWEST = 3  # blows of a test, so that its own level and the scatter about it are known
FLOOR = 0.02  # ln; peaks fall between samples, mountings ring and blows fall beside the mark
STRUCK = 0.3  # m, half a bay: so near the blow a channel shows what the rail does there
SHOWN = 0.9  # of the largest peak: no limit lies below what a channel has shown
STEP = 0.25 * FLOOR  # between limits that are tried


def blow_ceiling(hammer, sensor):
    """(limit [m/s²], gain [nats]) of a sensor's channel in the tests ``hammer``; (nan, 0.0) where blows show none.

    Each side of an amplifier for itself; the limit is the mean of those that hold. Where the rail is struck its peaks
    grow with the force: the plainer side speaks. Beside it waves of all lengths meet, which may hold one side while the
    pulse grows shorter, but not both: the lesser side speaks.
    """
    tests = [(test.place, _peaks(test, sensor.name)) for test in hammer]
    tests = [(x, peaks) for x, peaks in tests if peaks is not None]
    if not tests:
        return float("nan"), 0.0
    sides = [held([(force, side[k]) for _, (force, side) in tests]) for k in (0, 1)]
    gains = [gain for _, gain in sides]
    struck = not sensor.mounting.startswith("sleeper") and any(abs(x - sensor.place) < STRUCK for x, _ in tests)
    gain = max(gains) if struck else min(gains)
    if gain <= 0.0:
        return float("nan"), 0.0
    return float(np.mean([limit for limit, own in sides if own > 0.0])), gain


def _peaks(test, name):
    """(ln peak of the force (n,), ln peaks of the channel (2, n), upward and downward) of a test's sound blows, none of
    which reaches the range that its file states; None where there are too few."""
    heard = [r for r in test.recordings if any(c.name == name for c in r.channels)]
    blows = [i for i in find_impacts(heard, test.force, name, test.judged) if i.accepted]
    if len(blows) < FEWEST:
        return None
    sides = [[np.max(sign * i.acceleration) for i in blows] for sign in (1.0, -1.0)]
    return np.log([i.peak for i in blows]), np.log(np.maximum(sides, 1e-12))


def held(tests):
    r"""(limit, gain [nats]) of one limit over all ``tests``, pairs (ln forces (n,), ln peaks (n,)).

    .. math:: y = \min(c,\, a_t + b_t x) + e \quad\text{against}\quad y = a_t + b_t x + e,\ b_t \ge 1, \qquad
              g = \tfrac n2 \ln\frac{s_0^2 + f^2}{s_1^2 + f^2} - \tfrac12 \ln n

    with the mean squares s² of the residuals and the least scatter f. The tip of a hammer stiffens under a harder blow,
    which is shorter then: peaks of a linear track grow at least as the force. At least two blows must reach the limit.
    """
    n, top = sum(x.size for x, _ in tests), max(y.max() for _, y in tests)
    free = sum(_line(x, y)[1] for x, y in tests) / n
    best = -np.inf, top
    for c in np.arange(top, top + np.log(SHOWN), -STEP):
        left, reached = np.sum([_capped(x, y, c) for x, y in tests], axis=0)
        if reached >= 2:
            best = max(best, (0.5 * n * np.log((free + FLOOR**2) / (left / n + FLOOR**2)), c))
    return float(np.exp(best[1])), float(best[0] - 0.5 * np.log(n))


def _line(x, y):
    """(slope, squares left) of a line through peaks that grow at least as the force."""
    x, y = x - x.mean(), y - y.mean()
    slope = max(1.0, float(x @ y) / max(float(x @ x), 1e-12))
    return slope, float(np.sum((y - slope * x) ** 2))


def _capped(x, y, c):
    """(squares left, blows that reach it) of the best of: the weaker blows grow up to ``c``, the harder ones hold."""
    order = np.argsort(x)
    x, y = x[order], y[order]
    best = float(np.sum((y - c) ** 2)), x.size
    for below in range(1, x.size + 1):
        slope, left = _line(x[:below], y[:below])
        ends = y[:below].mean() + slope * (x - x[:below].mean())
        if ends[below - 1] <= c and np.all(ends[below:] >= c):
            best = min(best, (left + float(np.sum((y[below:] - c) ** 2)), x.size - below))
    return best
