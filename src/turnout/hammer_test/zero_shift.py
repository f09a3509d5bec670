"""Find a response whose zero shifts at the impact: an overloaded sensor or amplifier, a moving cable.

The modes come from the decay beside a drift and hardly move. The receptance has no drift: a step of its zero adds its
own spectrum, which grows towards low frequencies, to every stiffness of the ballast.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from turnout.records import Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.records import Impact

# 1/s, decay rates that weight a response: far below every resonance of a track, and that of 100 Hz.
SLOW_RATE, BALLAST_RATE = 2.0 * np.pi * 10.0, 2.0 * np.pi * 100.0
# Share of a step in the response at ``BALLAST_RATE``. A track has at most 0.005: its response to the slow weight is
# (0.1)³ of that to the other, times the ratio of the receptances, which is 5 for a resonance at 50 Hz. A share q moves
# the stiffness at a resonance of damping ratio z by q / (1 - q) z / (1 + z): with 0.25 by 5 % at z = 0.2.
MAX_SHARE = 0.25
SIGNIFICANCE = 1e-3  # probability of the scatter between impacts alone, one-sided
MIN_IMPACTS = 3


def judge_zero_shift(impacts: Sequence[Impact], response: str) -> tuple[Impact, ...]:
    """Reject a test on a track whose response has a slow part that follows the force.

    A slow part that is random from impact to impact, as of wind or a drifting zero, averages out and lowers the
    coherence; it does not count here.

    Parameters
    ----------
    impacts : sequence of Impact
        All impacts of a test; the accepted ones are measured.
    response : str
        Name of the response's channel, for the message.

    Returns
    -------
    tuple of Impact
        The impacts, with a rejection "zero_shift" in the accepted ones of such a test.
    """
    share, error = step_share([i for i in impacts if i.accepted])
    if not abs(share) - error > MAX_SHARE:
        return tuple(impacts)
    detail = (
        f"the zero of {response} shifts at the impact: a step is {100.0 * abs(share):.0f} % of its response near "
        f"100 Hz, and no supported rail has one; the sensor or its amplifier is overloaded, or its cable moves"
    )
    rejection = Rejection("zero_shift", share, MAX_SHARE, detail, response)
    return tuple(replace(i, rejections=(rejection,)) if i.accepted else i for i in impacts)


def step_share(impacts: Sequence[Impact]) -> tuple[float, float]:
    r"""Share of a step in the response at ``BALLAST_RATE``, and what the scatter between the impacts leaves open of it.

    .. math:: q = \frac{s\,\overline{A(s)/J}}{s'\,\overline{A(s')/J}}, \qquad
        A(s) = \int_0^\infty a(t)\,e^{-s t}\,dt, \qquad J = \int F\,dt

    with the slow rate s and the rate s' of the ballast. For a step at the impact :math:`A(s) = \Delta / s`, so q is 1.
    For a track :math:`A(s) = s^2 H(s) F(s)`, where the receptance H at a real s is positive and falls with s: q is
    :math:`(s/s')^3` times their ratio.

    Parameters
    ----------
    impacts : sequence of Impact
        Accepted impacts.

    Returns
    -------
    (float, float)
        q and its one-sided error. [-] (0, infinite) with fewer than ``MIN_IMPACTS``.
    """
    n = len(impacts)
    if n < MIN_IMPACTS:
        return 0.0, np.inf
    slow, ballast = (
        np.array([rate * _transform(i, rate) / i.impulse for i in impacts]) for rate in (SLOW_RATE, BALLAST_RATE)
    )
    mean = float(np.mean(ballast))
    if mean == 0.0:
        return 0.0, np.inf
    error = float(np.std(slow, ddof=1)) / np.sqrt(n) * float(scipy.stats.t.ppf(1.0 - SIGNIFICANCE, n - 1))
    return float(np.mean(slow)) / mean, error / abs(mean)


def _transform(impact: Impact, s: float) -> float:
    """Laplace transform of the response from the contact on. [m/s]"""
    a = impact.acceleration[impact.onset :]
    return float(a @ np.exp(-s * np.arange(a.size) / impact.rate)) / impact.rate
