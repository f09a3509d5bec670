"""Judge the scale of a hammer test on a track: every impact first meets a rail, whose mass and stiffness are known.

A response in g under m/s², a force in lbf under N, millimetres or volts change the ratio of response to force, and with
it every stiffness, but no frequency. Stiffnesses of tracks spread by far more than such a factor. The first moments of
an impact do not: they meet the rail alone, before the pads and the ballast answer.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from turnout.records import Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.records import Impact

# Rail 54E1 (EN 13674-1), the middle of the rails in use.
MASS, AREA, SECOND_MOMENT = 54.77, 69.77e-4, 2337.9e-8  # kg/m, m², m⁴
YOUNGS_MODULUS, SHEAR_MODULUS, SHEAR_COEFFICIENT = 210e9, 80.77e9, 0.39  # Pa, Pa, -
# 1/s, decay rates that weight an impact: at the first the rail dominates the track, at the second still more.
RATES = 5_000.0, 8_000.0
# Rails 54E1 that resist an impact. From below: a free rail of 45 kg/m has 0.79, and supports only add. From above: a
# cast crossing of twice the mass and four times the bending stiffness of 60E1, on the stiffest pads and with the
# accelerometer up to 0.2 m beside the hammer, has 5.2.
RAILS = (0.78, 5.4)
# Ratio of the two values of ``RATES``: supports count less at the higher rate, by a quarter on the stiffest pads.
RATE_RATIO = (0.74, 1.0)
# Beyond this ratio the response lacks what a rail does at high frequency: it is delayed, filtered, or a sum of few
# modes. It then looks heavier than it is, and so the upper limit is higher: a single mode of 250 kg has 5.3.
MAX_RAIL_RATIO, MAX_INCOMPLETE = 1.2, 6.9
NOISE_DEVIATIONS = 3.0  # by which noise may move a mobility
LEAD = 2  # samples before the contact, for what filters move before it; more would add noise with large weights
ADVICE = (
    "the unit, sensitivity or gain of the response or of the force is wrong (g or m/s², lbf or N, mm or m, volts?), "
    "or the response is late, or the accelerometer is more than 0.2 m beside the hammer; for another structure than a "
    "track set receptance.minimum_peak_force: 0"
)


def judge_response_scale(impacts: Sequence[Impact], response: str) -> tuple[Impact, ...]:
    """Reject all impacts of a test that meet less than a rail, or more than a crossing.

    Parameters
    ----------
    impacts : sequence of Impact
        All impacts of a test; the accepted ones are measured.
    response : str
        Name of the response's channel, for the message.

    Returns
    -------
    tuple of Impact
        The impacts, with a rejection "out_of_scale" in the accepted ones if the test is out of scale.
    """
    measured = equivalent_free_rails([i for i in impacts if i.accepted])
    if measured is None or measured.is_track:
        return tuple(impacts)
    rails, limits = measured.rails, measured.limits
    bound = limits[0] if rails < limits[0] else limits[1]
    detail = (
        f"in its first moments an impact meets the resistance of {rails:.3g} rails 54E1, "
        f"that of a track is {limits[0]:g} to {limits[1]:g}: {ADVICE}"
    )
    rejection = Rejection("out_of_scale", rails, bound, detail, response)
    return tuple(replace(i, rejections=(rejection,)) if i.accepted else i for i in impacts)


class Resistance(NamedTuple):
    """Number of rails 54E1 that resist an impact [-], the limits of a track [-], and whether noise leaves it inside."""

    rails: float
    limits: tuple[float, float]
    is_track: bool


def equivalent_free_rails(impacts: Sequence[Impact]) -> Resistance | None:
    r"""Mobility of a free rail 54E1 over that of the impacts, at a real Laplace variable.

    .. math:: \frac{Y_{54E1}(s)}{Y(s)}, \qquad Y(s) = \frac{\sum F(s) A(s)}{s \sum F(s)^2}, \qquad
        X(s) = \int x(t)\,e^{-s t}\,dt, \quad s \in \mathbb{R}^+

    At a real s the matrix :math:`K + s C + s^2 M` of a passive track is positive, so each support lowers the mobility,
    and a free rail is its upper bound. A delay d of the response multiplies the result by :math:`e^{s d}`. The least
    delay or lead that makes the values at both ``RATES`` possible for a rail is taken out.

    Parameters
    ----------
    impacts : sequence of Impact
        Accepted impacts.

    Returns
    -------
    Resistance or None
        None without impacts, without any response, or with a sampling rate [Hz] below the second of ``RATES``: the
        decay of its weight is then shorter than a sample.
    """
    if not impacts or impacts[0].rate < RATES[1]:
        return None
    (low, low_error), (high, high_error) = (_mobility(impacts, s) for s in RATES)
    if not min(low, high) > 0.0:
        return None
    rails, limits = _resistance(low, high)
    shifts = np.array([-NOISE_DEVIATIONS, 0.0, NOISE_DEVIATIONS])
    pairs = [(a, b) for a in low + shifts * low_error for b in high + shifts * high_error if min(a, b) > 0.0]
    possible = [_resistance(a, b) for a, b in pairs]
    return Resistance(rails, limits, any(bounds[0] <= r <= bounds[1] for r, bounds in possible))


def _resistance(low: float, high: float) -> tuple[float, tuple[float, float]]:
    """Rails and limits from the mobilities [m/s/N] at the lower and the higher of ``RATES``."""
    low, high = (free_rail_mobility(s) / y for s, y in zip(RATES, (low, high)))
    excess = np.log(high / low) - np.log(np.clip(high / low, *RATE_RATIO))
    rails = float(low * np.exp(-RATES[0] * excess / (RATES[1] - RATES[0])))
    return rails, (RAILS[0], MAX_INCOMPLETE if high > MAX_RAIL_RATIO * low else RAILS[1])


def _mobility(impacts: Sequence[Impact], s: float) -> tuple[float, float]:
    """Size of the mobility at a real Laplace variable, averaged over impacts, and its error from noise. [m/s/N]"""
    cross = power = variance = 0.0
    for i in impacts:
        first = max(0, i.onset - LEAD)
        weights = np.exp(-s * (np.arange(first, i.force.size) - i.onset) / i.rate)
        force = float(i.force[i.onset : i.contact_end + 1] @ weights[i.onset - first : i.contact_end + 1 - first])
        cross += force * float(i.acceleration[first:] @ weights)
        variance += (force * i.noise_acceleration) ** 2 * float(weights @ weights)
        power += force**2
    return (abs(cross) / (s * power), float(np.sqrt(variance)) / (s * power)) if power > 0.0 else (0.0, 0.0)


def free_rail_mobility(s: float, foundation: float = 0.0, mass: float = 1.0, stiffness: float = 1.0) -> float:
    r"""Point mobility of an infinite Timoshenko rail at a real Laplace variable.

    .. math:: Y(s) = \frac{s}{2\,GA\,EI\,(P+Q)} \left(\frac{GA + \rho I s^2}{PQ} + EI\right), \quad
        (PQ)^2 = \frac{b\,(GA + \rho I s^2)}{GA\,EI}, \quad P^2 + Q^2 = \frac{b\,EI + GA\,\rho I s^2}{GA\,EI}

    with :math:`b = m s^2 + k`, from the integral over the wave number.

    Parameters
    ----------
    s : float
        Laplace variable. [1/s]
    foundation : float
        Stiffness k of continuous supports at this s. [N/m²]
    mass, stiffness : float
        Mass per metre, with the area, and second moment over those of 54E1. [-]

    Returns
    -------
    float
        [m/s/N]

    References
    ----------
    Grassie, Gregory, Harrison and Johnson 1982, The dynamic response of railway track to high frequency vertical
    excitation, Journal of Mechanical Engineering Science 24, 77-90: beam and supports.

    Examples
    --------
    Slow changes bend the rail as an Euler beam: :math:`1 / (\sqrt{8 s}\, m^{3/4} (EI)^{1/4})`.

    >>> euler = 1.0 / (np.sqrt(8.0 * 10.0) * MASS**0.75 * (YOUNGS_MODULUS * SECOND_MOMENT) ** 0.25)
    >>> print(f"{free_rail_mobility(10.0) / euler:.2f}")
    1.00
    """
    shear = SHEAR_COEFFICIENT * SHEAR_MODULUS * AREA * mass
    bending = YOUNGS_MODULUS * SECOND_MOMENT * stiffness
    rotation = MASS / AREA * SECOND_MOMENT * stiffness * s**2
    b = MASS * mass * s**2 + foundation
    product = np.sqrt(b * (shear + rotation) / (shear * bending))
    total = np.sqrt((b * bending + shear * rotation) / (shear * bending) + 2.0 * product)
    return float(s / (2.0 * shear * bending * total) * ((shear + rotation) / product + bending))
