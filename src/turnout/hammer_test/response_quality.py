"""Check the response of a hammer test on a track: scale, saturation behind a filter, and lag behind the force.

A rail has a mass and a stiffness that no factor of a unit leaves unchanged.

The force alone is judged by ``find_impacts``. A response in g under m/s², a force in lbf under N, millimetres or volts
change the ratio of response to force, and with it every stiffness, but no frequency.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.hammer_test.best_subset import select_best
from turnout.hammer_test.impacts import find_impacts
from turnout.records import Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.receptance import ReceptanceSettings
    from turnout.records import Impact, Recording

# kg, mass that an impact of 0.3 to 3 ms sets in motion: half a metre to some metres of a rail of 45 to 60 kg/m, with a
# part of the sleepers, or a cast crossing. Simulated intact sections have 26 to 120 kg.
MOVED_MASS = (15.0, 400.0)
# N/m, least dynamic stiffness of a rail on ballast around its ballast resonance. Simulated intact sections have 6 to 29
# MN/m. So soft a track cannot be told from a stiff one whose response is read four times too large.
BALLAST_STIFFNESS = (4e6, 300e6)
BALLAST_BAND = (80.0, 250.0)  # Hz, in which the largest receptance is looked for
ADVICE = (
    "the unit, sensitivity or gain of the response or of the force is wrong (g or m/s², lbf or N, mm or m, volts?); "
    "for another structure than a track set receptance.softest_blow: 0"
)


def find_track_impacts(
    recordings: Sequence[Recording], force: str, response: str, settings: ReceptanceSettings
) -> tuple[Impact, ...]:
    """``find_impacts`` of a hammer test on a track, with the scale of the response judged too.

    Parameters
    ----------
    recordings : sequence of Recording
        All recordings of the test together.
    force, response : str
        Names of the hammer's and the accelerometer's channel.
    settings : ReceptanceSettings
        Limits of the quality; a ``softest_blow`` of 0 says that the structure is no track.

    Returns
    -------
    tuple of Impact
        In the order of the recordings.

    Raises
    ------
    KeyError
        A recording has no channel of that name.
    """
    impacts = find_impacts(recordings, force, response, replace(settings, best_impacts=0))
    impacts = judge_causality(impacts, response)
    impacts = judge_saturation(impacts, response)
    impacts = judge_response_scale(impacts, response) if settings.softest_blow > 0.0 else impacts
    return select_best(impacts, settings)  # among those that no other test has rejected


def judge_response_scale(impacts: Sequence[Impact], response: str) -> tuple[Impact, ...]:
    """Reject all impacts of a test whose moved mass or dynamic stiffness no track has.

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
    used = [i for i in impacts if i.accepted]
    masses = [m for i in used if np.isfinite(m := moved_mass(i))]
    rejection = None
    if masses:
        mass, limits = float(np.median(masses)), MOVED_MASS
        stiffness = ballast_stiffness(used)
        if not limits[0] <= mass <= limits[1]:
            detail = f"the impacts move {mass:.3g} kg, a track {limits[0]:g} to {limits[1]:g} kg"
            bound = limits[0] if mass < limits[0] else limits[1]
            rejection = Rejection("out_of_scale", mass, bound, f"{detail}: {ADVICE}", response)
        elif stiffness is not None and not BALLAST_STIFFNESS[0] <= stiffness <= BALLAST_STIFFNESS[1]:
            low, high = (limit / 1e6 for limit in BALLAST_STIFFNESS)
            detail = f"the dynamic stiffness is {stiffness / 1e6:.3g} MN/m, that of a track {low:g} to {high:g} MN/m"
            bound = BALLAST_STIFFNESS[0] if stiffness < BALLAST_STIFFNESS[0] else BALLAST_STIFFNESS[1]
            rejection = Rejection("out_of_scale", stiffness, bound, f"{detail}: {ADVICE}", response)
    return tuple(impacts) if rejection is None else _with_rejection(impacts, rejection)


# Least number of impacts, and least standard deviation of the logarithm of their peak forces, for a slope.
MIN_SLOPE_IMPACTS, MIN_FORCE_SPREAD = 5, 0.03
MAX_SATURATED_SLOPE = 0.5  # slope of the logarithms of peaks: 1 for a linear track, 0 for a saturated channel


def judge_saturation(impacts: Sequence[Impact], response: str) -> tuple[Impact, ...]:
    r"""Reject a test whose response does not grow with the force: the channel saturates before its filter.

    Behind an anti-aliasing filter an overload has no flat top. The slope b of

    .. math:: \ln \max|a_i| = b \ln \max F_i + c

    is 1 on a linear track, and above it for a tip that hardens. A test is rejected if b lies below
    ``MAX_SATURATED_SLOPE`` by three standard errors. The same holds for the steepest slope of the response, which an
    amplifier may limit.

    Parameters
    ----------
    impacts : sequence of Impact
        All impacts of a test; the accepted ones are compared.
    response : str
        Name of the response's channel, for the message.

    Returns
    -------
    tuple of Impact
        The impacts, with a rejection "overload" in the accepted ones of a saturated test.
    """
    used = [i for i in impacts if i.accepted]
    if len(used) < MIN_SLOPE_IMPACTS:
        return tuple(impacts)
    x = np.log([abs(i.peak) for i in used])
    if np.std(x) < MIN_FORCE_SPREAD:
        return tuple(impacts)
    deviations = x - x.mean()
    for name in ("peak", "steepest slope"):
        with np.errstate(divide="ignore"):
            y = np.log(_largest_values(used, name == "steepest slope"))
        if not np.isfinite(y).all():
            continue
        slope = float(deviations @ y / (deviations @ deviations))
        residual = y - y.mean() - slope * deviations
        error = float(np.sqrt(residual @ residual / (len(used) - 2) / (deviations @ deviations)))
        if slope + 3.0 * error < MAX_SATURATED_SLOPE:
            largest = float(np.exp(np.median(y)))
            detail = (
                f"the {name} of {response} is about {largest:.4g} whatever the force: it grows with the force to the "
                f"power {slope:.2f}, not 1; the channel is limited before its filter, so choose a larger range"
            )
            return _with_rejection(impacts, Rejection("overload", slope, MAX_SATURATED_SLOPE, detail, response))
    return tuple(impacts)


def _largest_values(impacts: Sequence[Impact], is_slope: bool) -> np.ndarray:
    """Largest value of each response, or of its differences."""
    responses = (i.acceleration[i.onset :] for i in impacts)
    return np.array([np.max(np.abs(np.diff(x) if is_slope else x), initial=0.0) for x in responses])


# Share of its largest value at which a response has begun: a filter of linear phase rings before it with less.
ONSET_SHARE = 0.1
MAX_LEAD, MAX_LAG = 3, 5  # samples before the contact, and behind its end, that filters of two channels explain


def judge_causality(impacts: Sequence[Impact], response: str) -> tuple[Impact, ...]:
    """Reject a test whose response begins before its force or long after it, with the lag in samples.

    Parameters
    ----------
    impacts : sequence of Impact
        All impacts of a test; the accepted ones are measured.
    response : str
        Name of the response's channel, for the message.

    Returns
    -------
    tuple of Impact
        The impacts, with a rejection "not_simultaneous" in the accepted ones of such a test.
    """
    used = [i for i in impacts if i.accepted]
    lags = [lag for i in used if (lag := response_lag(i)) is not None]
    if not lags:
        return tuple(impacts)
    median_lag = float(np.median(lags))
    latest = float(np.median([i.contact * i.rate for i in used])) + MAX_LAG
    if -MAX_LEAD <= median_lag <= latest:
        return tuple(impacts)
    bound = -float(MAX_LEAD) if median_lag < 0.0 else latest
    word = "before" if median_lag < 0.0 else "after"
    detail = (
        f"{response} begins {abs(median_lag):.0f} samples ({1e3 * abs(median_lag) / used[0].rate:.3g} ms) {word} the "
        "force: the channels were not sampled together, or are not of one impact"
    )
    return _with_rejection(impacts, Rejection("not_simultaneous", median_lag, bound, detail, response))


def response_lag(impact: Impact) -> int | None:
    """Samples from the onset of the force to the first response of ``ONSET_SHARE`` times its largest value.

    Parameters
    ----------
    impact : Impact
        An impact.

    Returns
    -------
    int or None
        Negative for a response before the force; None if noise hides its beginning.

    Examples
    --------
    >>> from turnout.records import Impact
    >>> f, a = np.zeros(50), np.zeros(50)
    >>> f[20:25], a[28:40] = 100.0, 3.0
    >>> response_lag(Impact(f, a, 10_000.0, 20, 24, 25, 100.0, 5e-4, 0.05, 0.0, 0.0, 500.0))
    8
    """
    size = np.abs(impact.acceleration)
    level = ONSET_SHARE * float(size.max())
    if not level > 4.0 * impact.noise_acceleration:
        return None
    return int(np.argmax(size >= level)) - impact.onset


def _with_rejection(impacts: Sequence[Impact], rejection: Rejection) -> tuple[Impact, ...]:
    return tuple(replace(i, rejections=(rejection,)) if i.accepted else i for i in impacts)


def moved_mass(impact: Impact) -> float:
    r"""Impulse over the largest change of the velocity until one contact time after the contact.

    .. math:: m = \frac{\int F\,dt}{\max_t |\int a\,dt|}

    Parameters
    ----------
    impact : Impact
        An impact with its contact.

    Returns
    -------
    float
        [kg], infinite without any response.

    Examples
    --------
    A free mass of 5 kg after 2 N s of a half-sine moves with 0.4 m/s.

    >>> from turnout.records import Impact
    >>> f = np.pad(np.sin(np.pi * np.arange(40) / 40), 20) * 100.0
    >>> impact = Impact(f, f / 5.0, 10_000.0, 20, 59, 60, 100.0, 4e-3, f.sum() / 1e4, 0.0, 0.0, 500.0)
    >>> round(moved_mass(impact), 6)
    5.0
    """
    n_contact = max(2, round(impact.contact * impact.rate))
    velocity = np.cumsum(impact.acceleration[impact.onset : impact.onset + 2 * n_contact]) / impact.rate
    largest = float(np.max(np.abs(velocity))) if velocity.size else 0.0
    return abs(float(impact.impulse)) / largest if largest > 0.0 else float("inf")


def ballast_stiffness(impacts: Sequence[Impact]) -> float | None:
    r"""Least dynamic stiffness of the averaged receptance in the band of the ballast resonance.

    .. math:: k = \min_f \left|\frac{(2\pi f)^2 \sum |F|^2}{\sum F^* A}\right|

    Parameters
    ----------
    impacts : sequence of Impact
        Accepted impacts.

    Returns
    -------
    float or None
        [N/m]; None without impacts, or if the record has no line in the band.
    """
    if not impacts:
        return None
    rate = impacts[0].rate
    n_fft = max(int(rate / 4.0), max(i.force.size for i in impacts))
    frequency = np.fft.rfftfreq(n_fft, 1.0 / rate)
    in_band = (frequency >= BALLAST_BAND[0]) & (frequency <= BALLAST_BAND[1])
    cross, power = np.zeros(in_band.sum(), complex), np.zeros(in_band.sum())
    for impact in impacts:
        if impact.rate != rate:
            continue
        # without its contact the force is noise, and that before the impact is no response
        contact = np.zeros(impact.force.size)
        contact[impact.onset : impact.contact_end + 1] = impact.force[impact.onset : impact.contact_end + 1]
        force, response = (np.fft.rfft(x, n_fft)[in_band] for x in (contact, impact.acceleration))
        cross += force.conj() * response
        power += np.abs(force) ** 2
    if not in_band.any() or not np.all(np.abs(cross) > 0.0):
        return None
    return float(np.min((2.0 * np.pi * frequency[in_band]) ** 2 * power / np.abs(cross)))
