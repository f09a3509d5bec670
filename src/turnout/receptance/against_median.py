"""A blow held against the others of its test: weak, out of range, noisy."""

import numpy as np

from turnout.receptance.cut import MAD_TO_SD
from turnout.records import Rejection

NOISE_FLOOR = 0.02
DEAD = 5.0


def judge_against_median(cuts, settings):
    """Add to each cut the rejections that only the test as a whole can show.

    A number is an outlier if it lies ``deviation`` robust standard deviations *and* a stated factor from the median of
    the test: the factor alone would fail a test of uneven blows, the deviation alone one of very even blows.
    """
    if not cuts:
        return
    peak = np.array([abs(c.contact.peak) for c in cuts])
    largest = np.array([_largest_response(c) for c in cuts])
    before = np.array([c.contact.noise_acceleration for c in cuts])
    noise = before / np.where(largest > 0.0, largest, np.inf)
    for k, cut in enumerate(cuts):
        if largest[k] <= DEAD * before[k]:
            _reject(cut, "dead_channel", largest[k], DEAD * before[k], (
                f"{cut.channels[1].name} answers with {largest[k]:.3g}, no more than its noise"))  # fmt: skip
        elif noise[k] > settings.noise:
            _reject(cut, "noisy", noise[k], settings.noise, "rms before the blow is {0:.3f} of the peak acceleration")
    if len(cuts) < 3:
        return
    middle = float(np.median(peak))
    # Peaks scatter by ratios: a blow of half and one of double the usual force are equally unusual.
    spread = MAD_TO_SD * float(np.median(np.abs(np.log(peak / middle))))
    usual = float(np.median(noise))
    for k, cut in enumerate(cuts):
        low = middle * min(settings.weak, np.exp(-settings.deviation * spread))
        high = middle * max(settings.out_of_range, np.exp(settings.deviation * spread))
        if peak[k] < low:
            _reject(cut, "weak", peak[k], low, f"{{0:.4g}} N, the test's median is {middle:.4g} N")
        elif peak[k] > high:
            _reject(cut, "overload", peak[k], high, f"{{0:.4g}} N, the test's median is {middle:.4g} N")
        limit = max(NOISE_FLOOR, settings.noise_over_median * usual)
        if noise[k] > limit and not cut.rejections:
            _reject(cut, "noisy", noise[k], limit, f"rms before the blow is {{0:.3f}} of the peak acceleration, "
                    f"{usual:.3f} in the median blow")  # fmt: skip


def _largest_response(cut):
    return float(np.max(np.abs(cut.acceleration[cut.contact.onset :] - cut.contact.zero_acceleration)))


def _reject(cut, reason, value, limit, words):
    cut.rejections.append(Rejection(reason, float(value), float(limit), words.format(float(value))))
