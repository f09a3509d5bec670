"""Check the quality of each impact: saturated channels, repeated impacts and outliers of the test.

A saturated channel reaches its range or repeats one extreme code. The same impact appears twice where a test was
exported again. Impacts are also compared with the test's medians: weak, out of range, noisy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import MAD_TO_SD
from turnout.records import Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.receptance import ReceptanceSettings
    from turnout.hammer_test.impact_window import Contact, Cut

# Steps: a parabola one step deep over m equal samples falls by 9 steps within as many samples again, and 1 by rounding.
MAX_NATURAL_FALL = 12.0
# Probability below which repeated codes are no chance event.
MAX_CHANCE = 1e-3


def value_out_of_range(x: np.ndarray, limit: float | None) -> float | None:
    """Largest absolute sample if it reaches a known range, else None.

    Parameters
    ----------
    x : (n,) array of float
        Recorded samples. [any unit]
    limit : float or None
        Range of the channel, None if it is not known. [same unit]

    Returns
    -------
    float or None
        [same unit]

    Examples
    --------
    >>> value_out_of_range(np.array([0.0, -5.0, 3.0]), 5.0), value_out_of_range(np.array([1.0]), None)
    (5.0, None)
    """
    size = float(np.max(np.abs(x)))
    return size if limit is not None and size >= 0.999 * limit else None


def rail_code(x: np.ndarray, resolution: float | None = None, noise: float = 0.0) -> tuple[int, float] | None:
    r"""Samples that repeat one extreme code in the way of a clipped signal: (number of samples, code), or None.

    A smooth top may repeat its highest code as well, on a quiet converter with few bits. Then it is nearly a
    parabola: m equal samples lie within one step (and the noise) of each other. Over as many samples again on
    either side it falls by less than ``MAX_NATURAL_FALL`` times that. A clipped signal has a slope there and falls
    faster. Noise of several steps seldom repeats a code, m times with the probability

    .. math:: \left(\frac{q}{2\sqrt{\pi}\,\sigma}\right)^{m-1} \quad (q \text{ step},\ \sigma \text{ noise}),

    and where that is below ``MAX_CHANCE`` only the step counts. Fewer than three equal samples are no evidence. Three
    are evidence only where the probability is ten times smaller still.

    Parameters
    ----------
    x : (n_sample,) array of float
        [any unit]
    resolution : float, optional
        One step of the converter; by default the smallest step that occurs.
    noise : float
        Standard deviation of the noise. [the same unit]

    Returns
    -------
    (int, float) or None
        Number of samples, and the code [the same unit].

    Examples
    --------
    >>> x = np.round(1000 * np.sin(np.pi * np.arange(61) / 60))
    >>> rail_code(x), rail_code(np.minimum(x, 900.0))
    (None, (17, 900.0))
    """
    for y, sign in ((x, 1.0), (-x, -1.0)):
        code = float(y.max())
        at_code = np.flatnonzero(y == code)
        if at_code.size < 3 or code <= 0.0:
            continue
        runs = [(first, last) for first, last in _runs(at_code) if last - first >= 2]
        step = (resolution or _smallest_step(y)) if runs else 0.0
        noisy = noise > step / 4.0
        for first, last in runs:
            m = last - first + 1
            reach = (m + 1) // 2
            chance = (step / (2.0 * np.sqrt(np.pi) * noise)) ** (m - 1) if noisy else 1.0
            if first < reach or last + reach >= y.size or (noisy and m == 3 and chance > MAX_CHANCE / 10.0):
                continue
            depth = step if chance < MAX_CHANCE else step + 3.0 * noise
            if code - max(y[first - reach], y[last + reach]) > MAX_NATURAL_FALL * depth:
                return int(sum(b - a + 1 for a, b in runs)), sign * code
    return None


def overload(cut: Cut, contact: Contact) -> Rejection | None:
    """Rejection for the first sign of an overload on either channel of an impact, or None.

    The range applies to the recorded samples, before the zero line is subtracted.

    Parameters
    ----------
    cut : Cut
        The impact.
    contact : Contact
        Contact of the hammer.

    Returns
    -------
    Rejection or None
        "overload", with the channel.
    """
    signals = (cut.force, contact.noise_force), (cut.acceleration, contact.noise_acceleration)
    for (x, noise), zero, channel in zip(signals, cut.zeros, cut.channels):
        if (size := value_out_of_range(x + zero, channel.limit)) is not None:
            detail = f"{channel.name} reaches {size:.4g}, its range ends at {channel.limit:.4g}"
            return Rejection("overload", size, channel.limit, detail, channel.name)
        if (rail := rail_code(x, channel.resolution, noise)) is not None:
            detail = f"{channel.name} repeats its highest code {rail[1]:.4g} in {rail[0]} samples"
            return Rejection("overload", float(rail[0]), 2.0, detail, channel.name)
    return None


def _runs(indices: np.ndarray) -> list[tuple[int, int]]:
    groups = np.split(indices, np.flatnonzero(np.diff(indices) > 1) + 1)
    return [(int(p[0]), int(p[-1])) for p in groups if p.size]


def _smallest_step(y: np.ndarray) -> float:
    steps = np.diff(np.unique(y))
    steps = steps[steps > 1e-12 * np.ptp(y)]
    return float(steps.min()) if steps.size else np.inf


# Largest difference of repeated records over their largest value: rounding to 16 bits. Two impacts differ far more.
MAX_REPEAT_DIFFERENCE = 1e-4


def judge_repeats(cuts: Sequence[Cut]) -> None:
    """Reject every impact whose force and acceleration are those of an earlier one.

    Counted twice it would make all errors too small. The windows are compared with their peaks aligned, over their
    common length.

    Parameters
    ----------
    cuts : sequence of Cut
        The impacts of a test in their order; the result is entered in them.
    """
    peaks = np.array([np.max(np.abs(c.force)) for c in cuts])
    order = np.argsort(peaks, kind="stable")
    for rank, k in enumerate(order):
        for later in order[rank + 1 :]:
            if peaks[later] - peaks[k] > 2.0 * MAX_REPEAT_DIFFERENCE * peaks[later]:
                break
            first, second = sorted((int(k), int(later)))
            if (
                not is_repeated(cuts[second])
                and (distance := difference(cuts[first], cuts[second])) <= MAX_REPEAT_DIFFERENCE
            ):
                earlier = cuts[first]
                detail = f"the same samples as record {earlier.record + 1} of {earlier.recording.source or 'the test'}"
                rejection = Rejection("duplicate", distance, MAX_REPEAT_DIFFERENCE, detail, record=earlier.record)
                cuts[second].rejections.append(rejection)


def difference(first: Cut, second: Cut) -> float:
    """Largest difference of force or acceleration over the largest value of either; inf for different rates.

    Parameters
    ----------
    first, second : Cut
        Two impacts.

    Returns
    -------
    float
        0 for equal ones. [-]
    """
    if first.rate != second.rate:
        return np.inf
    tops = [int(np.argmax(np.abs(c.force))) for c in (first, second)]
    lead = min(tops)
    n = lead + min(first.force.size - tops[0], second.force.size - tops[1])
    pairs = ((first.force, second.force), (first.acceleration, second.acceleration))
    largest = 0.0
    for a, b in pairs:
        a, b = a[tops[0] - lead :][:n], b[tops[1] - lead :][:n]
        top = max(np.max(np.abs(a)), np.max(np.abs(b)))
        largest = max(largest, float(np.max(np.abs(a - b)) / top) if top > 0.0 else 0.0)
    return largest


def is_repeated(cut: Cut) -> bool:
    """Whether ``judge_repeats`` found the impact to repeat an earlier one.

    Parameters
    ----------
    cut : Cut
        An impact.

    Returns
    -------
    bool
        True for a repeated record.
    """
    return any(r.reason == "duplicate" for r in cut.rejections)


# Noise over the peak acceleration that is never rejected by comparison with the test's median.
MIN_NOISE_LIMIT = 0.02
# Least peak response over its noise; a channel below it is dead.
MIN_SIGNAL_TO_NOISE = 5.0


# Largest change of the peak response over the peak force between impacts of one tip on a linear track.
MAX_RATIO_CHANGE = 1.3


def judge_against_median(cuts: Sequence[Cut], settings: ReceptanceSettings) -> None:
    """Add to each cut the rejections that only a comparison with the whole test can show.

    A number is an outlier if it lies ``deviation`` robust standard deviations *and* a given factor from the median of
    the test. The factor alone would reject uneven impacts, the deviation alone a test of very even impacts.

    Parameters
    ----------
    cuts : sequence of Cut
        The impacts of a test; the result is entered in them.
    settings : ReceptanceSettings
        Limits of the quality of an impact.
    """
    if not cuts:
        return
    force, response = (channel.name for channel in cuts[0].channels)
    peak = np.array([abs(c.contact.peak) for c in cuts])
    largest = np.array([_largest_response(c) for c in cuts])
    noise_before = np.array([c.contact.noise_acceleration for c in cuts])
    noise = noise_before / np.where(largest > 0.0, largest, np.inf)
    for k, cut in enumerate(cuts):
        if largest[k] <= MIN_SIGNAL_TO_NOISE * noise_before[k]:
            text = f"{response} answers with {largest[k]:.3g}, no more than its noise"
            _reject(cut, "dead_channel", largest[k], MIN_SIGNAL_TO_NOISE * noise_before[k], text, response)
        elif noise[k] > settings.noise:
            text = f"rms before the impact is {noise[k]:.3f} of the peak acceleration"
            _reject(cut, "noisy", noise[k], settings.noise, text, response)
    if len(cuts) < 3:
        return
    median_peak = float(np.median(peak))
    # Peaks scatter by ratios: half and double the typical force are equally unusual.
    spread = MAD_TO_SD * float(np.median(np.abs(np.log(peak / median_peak))))
    median_noise = float(np.median(noise))
    # A response that grew with the force shows that neither channel left its range: the hammer was swung harder.
    ratio = largest / peak
    is_proportional = np.abs(np.log(np.maximum(ratio, 1e-300) / np.median(ratio))) <= np.log(MAX_RATIO_CHANGE)
    for k, cut in enumerate(cuts):
        low = median_peak * min(settings.weak, np.exp(-settings.deviation * spread))
        high = median_peak * max(settings.out_of_range, np.exp(settings.deviation * spread))
        if peak[k] < low:
            _reject(cut, "weak", peak[k], low, f"{peak[k]:.4g} N, the test's median is {median_peak:.4g} N")
        elif peak[k] > high and not is_proportional[k]:
            _reject(cut, "overload", peak[k], high, f"{peak[k]:.4g} N, the test's median is {median_peak:.4g} N", force)
        limit = max(MIN_NOISE_LIMIT, settings.noise_over_median * median_noise)
        if noise[k] > limit and not cut.rejections:
            text = f"rms before the impact is {noise[k]:.3f} of the peak acceleration"
            _reject(cut, "noisy", noise[k], limit, f"{text}, {median_noise:.3f} in the median impact", response)


def _largest_response(cut: Cut) -> float:
    return float(np.max(np.abs(cut.acceleration[cut.contact.onset :] - cut.contact.zero_acceleration)))


def _reject(cut: Cut, reason: str, value: float, limit: float, detail: str, channel: str | None = None) -> None:
    cut.rejections.append(Rejection(reason, float(value), float(limit), detail, channel))
