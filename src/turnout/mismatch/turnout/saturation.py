"""Saturated channels: their peaks stay at a limit while trains get louder, or impacts harder.

The limit is found from peaks of hammer tests and from peaks of passages, and both are combined.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.priors import PASSAGE, SATURATION

if TYPE_CHECKING:
    from collections.abc import Container, Sequence

    from turnout.mismatch.turnout.campaign import CampaignInput, HammerInput
    from turnout.records import Recording
    from turnout.simulate.sensor import Sensor


def limit_under_impacts(hammer: Sequence[HammerInput], sensor: Sensor) -> tuple[float, float]:
    """Limit of the channel of a sensor, and the evidence for it.

    Each side of an amplifier is tested by itself; the limit is the mean of those with a positive gain. Near the impact
    peaks grow with the force, and the larger gain counts. Elsewhere waves of all lengths meet. They may limit the peaks
    of one side as the pulse gets shorter, but not of both: the smaller gain counts. What the other side has exceeded is
    no limit of the channel: a part of the track that collides with another one cuts off one side.

    Parameters
    ----------
    hammer : sequence of HammerInput
        All hammer tests.
    sensor : Sensor
        The sensor.

    Returns
    -------
    limit : float
        nan without evidence. [m/s²]
    gain : float
        0 without evidence. [nats]
    """
    all_tests = [(test.place, _peaks(test, sensor.name)) for test in hammer]
    tests = [(x, peaks) for x, peaks in all_tests if peaks is not None]
    if not tests:
        return float("nan"), 0.0
    sides = [common_limit([(force, side[k]) for _, (force, side) in tests]) for k in (0, 1)]
    gains = [gain for _, gain in sides]
    is_near = not sensor.mounting.startswith("sleeper") and any(
        abs(x - sensor.place) < SATURATION.near_impact_distance for x, _ in tests
    )
    gain = max(gains) if is_near else min(gains)
    if gain <= 0.0:
        return float("nan"), 0.0
    limit = float(np.mean([limit for limit, side_gain in sides if side_gain > 0.0]))
    largest_peak = float(np.exp(max(np.max(side) for _, (_, side) in tests)))
    return (limit, gain) if limit >= lowest_limit(largest_peak) else (float("nan"), 0.0)


def lowest_limit(peak: float) -> float:
    """Lowest limit of a channel that has shown a peak. [m/s²]

    The filter of a recorder rings where a signal is cut off, and a limit need not be the same on both sides.

    Parameters
    ----------
    peak : float
        [m/s²]

    Returns
    -------
    float
    """
    return SATURATION.min_side_ratio * SATURATION.filter_ringing * peak


def _peaks(test: HammerInput, name: str) -> tuple[np.ndarray, np.ndarray] | None:
    """(ln force peaks (n,), ln channel peaks (2, n), upward and downward) of the accepted impacts of a test.

    None where they are too few. Impacts that reach the range stated in the file are not accepted.
    """
    impacts = test.accepted_impacts(name)
    if len(impacts) < SATURATION.min_impacts:
        return None
    sides = [[np.max(sign * i.acceleration) for i in impacts] for sign in (1.0, -1.0)]
    return np.log([i.peak for i in impacts]), np.log(np.maximum(sides, 1e-12))


def common_limit(tests: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[float, float]:
    r"""One limit over all ``tests``.

    .. math:: y = \min(c,\, a_t + b_t x) + e \quad\text{against}\quad y = a_t + b_t x + e,\ b_t \ge 1, \qquad
              g = \tfrac n2 \ln\frac{s_0^2 + f^2}{s_1^2 + f^2} - \tfrac12 \ln n

    with the mean squares s² of the residuals and the least scatter f. The tip of a hammer stiffens under a harder
    impact, which gets shorter: peaks of a linear track grow at least as the force. At least two impacts must reach the
    limit.

    Parameters
    ----------
    tests : sequence of ((n,) array, (n,) array)
        Logarithms of the peaks of force and of channel, by test.

    Returns
    -------
    limit : float
        [m/s²]
    gain : float
        [nats]
    """
    n, top = sum(x.size for x, _ in tests), max(y.max() for _, y in tests)
    free = sum(_fit_line(x, y)[1] for x, y in tests) / n
    best_fit = -np.inf, top
    for c in np.arange(top, top + np.log(SATURATION.min_limit_share), -SATURATION.limit_step):
        residual, reached = np.sum([_fit_capped(x, y, c) for x, y in tests], axis=0)
        if reached >= 2:
            best_fit = max(
                best_fit,
                (
                    0.5
                    * n
                    * np.log((free + SATURATION.scatter_floor**2) / (residual / n + SATURATION.scatter_floor**2)),
                    c,
                ),
            )
    return float(np.exp(best_fit[1])), float(best_fit[0] - 0.5 * np.log(n))


def _fit_line(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """(slope, residual sum of squares) of a line through peaks that grow at least as the force."""
    x, y = x - x.mean(), y - y.mean()
    slope = max(1.0, float(x @ y) / max(float(x @ x), 1e-12))
    return slope, float(np.sum((y - slope * x) ** 2))


def _fit_capped(x: np.ndarray, y: np.ndarray, c: float) -> tuple[float, int]:
    """(residual sum of squares, impacts at the limit) of the best split of the impacts.

    The peaks of the weaker ones grow up to ``c``, those of the harder ones stay there.
    """
    order = np.argsort(x)
    x, y = x[order], y[order]
    best_fit = float(np.sum((y - c) ** 2)), x.size
    for below in range(1, x.size + 1):
        slope, residual = _fit_line(x[:below], y[:below])
        ends = y[:below].mean() + slope * (x - x[:below].mean())
        if ends[below - 1] <= c and np.all(ends[below:] >= c):
            best_fit = min(best_fit, (residual + float(np.sum((y[below:] - c) ** 2)), x.size - below))
    return best_fit


@dataclass(frozen=True)
class SaturationLimit:
    """The ``limit`` of a channel [m/s²] and its evidence, ``gain`` [nats]."""

    limit: float
    gain: float


def saturated_channels(campaign: CampaignInput, threshold: float) -> dict[str, SaturationLimit]:
    """SaturationLimit of every sensor, by name, with evidence beyond ``threshold`` [nats] from passages and impacts.

    Reserved recordings count as well: whether a channel is usable is no prediction, and applies to them, too. A part of
    the track that collides with another one limits the peaks of several sensors, each at its own value. So channels
    with limits that differ are not at fault, nor are all at once.

    Parameters
    ----------
    campaign : CampaignInput
        The campaign.
    threshold : float
        Least evidence. [nats]

    Returns
    -------
    dict
        Sensor -> SaturationLimit; {} if it were all of them, or if their limits differed.
    """
    by_passages, saturated = _limits_in_passages(campaign), {}
    for sensor in campaign.sensors:
        by_impacts = SaturationLimit(*limit_under_impacts(campaign.hammer, sensor))
        limit = _combine_limits(by_passages.get(sensor.name, by_impacts), by_impacts)
        limit = replace(limit, gain=limit.gain - float(np.log(len(campaign.sensors))))
        if limit.gain > threshold and limit.limit >= lowest_limit(raw_peak(campaign, sensor.name)):
            saturated[sensor.name] = limit
    limits = np.log([s.limit for s in saturated.values()])
    differ = limits.size > 1 and bool(np.ptp(limits) > 2.0 * SATURATION.limit_sd)
    return {} if differ or limits.size == len(campaign.sensors) else saturated


def _combine_limits(by_passages: SaturationLimit, by_impacts: SaturationLimit) -> SaturationLimit:
    """The limit with more evidence; the sum of both gains where they agree on the limit."""
    stronger = max(by_passages, by_impacts, key=lambda c: c.gain)
    if by_passages is by_impacts or min(by_passages.gain, by_impacts.gain) <= 0.0:
        return stronger
    same_limit = abs(np.log(by_passages.limit / by_impacts.limit)) < 2.0 * SATURATION.limit_sd
    return replace(stronger, gain=by_passages.gain + by_impacts.gain) if same_limit else stronger


def _limits_in_passages(campaign: CampaignInput) -> dict[str, SaturationLimit]:
    """SaturationLimit of every sensor, by name, for which passages give evidence."""
    names = [s.name for s in campaign.sensors]
    recordings = [p.recording for p in campaign.passages]
    recordings = [r for r in recordings if set(names) <= {c.name for c in r.channels} and not _is_at_range(r)]
    if len(recordings) < SATURATION.min_passages or len(names) < SATURATION.min_sensors:
        return {}
    sizes = [np.abs(r.samples[[r.index(n) for n in names]]) for r in recordings]
    peaks, limits = np.log([np.maximum(np.max(x, axis=1), 1e-12) for x in sizes]), {}
    for k, name in enumerate(names):
        if not _follows_trains([x[k] for x in sizes], [np.delete(x, k, axis=0) for x in sizes], recordings):
            continue
        gain = saturation_gain(peaks[:, k], np.delete(peaks, k, axis=1).mean(axis=1))
        if gain > 0.0 and (limit := _dwell_limit([x[k] for x in sizes])):
            limits[name] = SaturationLimit(limit, gain)
    return limits


def _follows_trains(
    sizes: Sequence[np.ndarray], sizes_of_others: Sequence[np.ndarray], recordings: Sequence[Recording]
) -> bool:
    """Whether the level of a channel rises with that of others; peaks of noise stay alike without a limit."""
    correlations = []
    for x, of_others, recording in zip(sizes, sizes_of_others, recordings):
        length = max(round(SATURATION.level_time * recording.rate), 1)
        blocks = [y[: y.size - y.size % length].reshape(-1, length).mean(axis=1) for y in (x, of_others.mean(axis=0))]
        if all(b.size > 2 and np.std(b) > SATURATION.scatter_floor * np.mean(b) for b in blocks):
            correlations.append(np.corrcoef(*blocks)[0, 1])
    return not correlations or float(np.median(correlations)) >= SATURATION.min_level_correlation


def _is_at_range(recording: Recording) -> bool:
    """Whether a channel reaches the range stated in its file, beyond which it is known to be clipped."""
    limits = [np.inf if c.limit is None else PASSAGE.range_share * c.limit for c in recording.channels]
    return bool(np.any(np.max(np.abs(recording.samples), axis=1) >= limits))


def saturation_gain(peaks: np.ndarray, reference: np.ndarray) -> float:
    r"""Gain [nats] of a limit over peaks that follow ``reference``; both (n,) logarithms of peaks, one per passage.

    .. math:: y_k = \min(c,\, a + x_k) + e_k \quad\text{against}\quad y_k = a + x_k + e_k, \qquad
              g = \tfrac n2 \ln\frac{s_0^2 + f^2}{s_1^2 + f^2} - \tfrac12 \ln n

    with the mean squares s² of the residuals and the least scatter f. At least two passages must reach the limit.

    Parameters
    ----------
    peaks : (n,) array of float
        Logarithms of the peaks of a channel, one per passage.
    reference : (n,) array of float
        The same of the other channels, their mean.

    Returns
    -------
    float
        [nats]
    """
    order = np.argsort(reference)
    y, x = np.asarray(peaks)[order], np.asarray(reference)[order]
    n, follows = y.size, y - x
    free, capped = np.sum((follows - follows.mean()) ** 2), [np.sum((y - y.mean()) ** 2)]
    for below in range(1, n - 1):
        a, c = follows[:below].mean(), y[below:].mean()
        if a + x[below] >= c:
            capped.append(np.sum((y[below:] - c) ** 2) + np.sum((follows[:below] - a) ** 2))
    return float(
        0.5 * n * np.log((free / n + SATURATION.scatter_floor**2) / (min(capped) / n + SATURATION.scatter_floor**2))
        - 0.5 * np.log(n)
    )


def _dwell_limit(sizes: Sequence[np.ndarray]) -> float | None:
    """Median of the samples near the peak, in the passage that spends most of its time there [m/s²].

    None where that passage is not among the loudest. A clipped channel stays at its limit; a flat or a nose gives
    single peaks.
    """
    sizes_at_limit = max(sizes, key=lambda x: (np.mean(x > SATURATION.top_share * x.max()), x.max()))
    if sizes_at_limit.max() < SATURATION.top_share * max(x.max() for x in sizes):
        return None
    return float(np.median(sizes_at_limit[sizes_at_limit > SATURATION.top_share * sizes_at_limit.max()]))


def without_saturated(campaign: CampaignInput, saturated: Container[str]) -> CampaignInput:
    """The campaign without the ``saturated`` sensors, whose signals are no response of the track.

    Parameters
    ----------
    campaign : CampaignInput
        The campaign.
    saturated : container of str
        Names of the sensors.

    Returns
    -------
    CampaignInput
    """
    return replace(campaign, sensors=tuple(s for s in campaign.sensors if s.name not in saturated))


def raw_peak(campaign: CampaignInput, name: str) -> float:
    """Largest value of a channel in any passage at its full rate, reserved ones included; 0 where none has it. [m/s²]

    The channel cannot be clipped below that value.

    Parameters
    ----------
    campaign : CampaignInput
        The campaign.
    name : str
        Of the channel.

    Returns
    -------
    float
        [m/s²]
    """
    recordings = [p.recording for p in campaign.passages]
    signals = [r.samples[r.index(name)] for r in recordings if name in {c.name for c in r.channels}]
    return max((float(np.max(np.abs(x))) for x in signals), default=0.0)
