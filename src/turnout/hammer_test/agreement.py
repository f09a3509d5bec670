"""Find the impact of a test that disagrees with all others, by pairwise coherence and by response gain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len, rfft, rfftfreq

from turnout.constants import MAD_TO_SD
from turnout.records import Rejection

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from turnout.config.settings.receptance import ReceptanceSettings
    from turnout.hammer_test.impact_window import Cut
    from turnout.records import Impact

# Least number of impacts among which one is an outlier. Of three, the median coherence of the two that agree is halfway
# between their own and that with the third: no value of ``agreement_factor`` then makes the third an outlier.
MIN_COMPARED = 4
# Least number of impacts from which the spread of a test is estimated.
MIN_IMPACTS = 5
# Share of the largest peak above which an impact may be clipped: sampling can miss a fifth of a short pulse's peak.
MIN_CLIPPED_PEAK = 0.8
# Share of an excess of the response that follows the force of a clipped impact. Of hum or noise nothing does, and a
# shifted resonance takes a part of it away.
MIN_FOLLOWING = 0.5


def pairwise_coherence(force: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    r"""Median over frequency of the coherence of every two impacts.

    .. math:: \gamma^2_{ij} = \frac{|F_i^* A_i + F_j^* A_j|^2}{(|F_i|^2 + |F_j|^2)(|A_i|^2 + |A_j|^2)}

    Parameters
    ----------
    force, acceleration : (n_impact, n_frequency) array of complex
        Spectra at the compared lines. [N s], [m/s]

    Returns
    -------
    (n_impact, n_impact) array of float
        1 on the diagonal.

    Examples
    --------
    Two impacts on one linear structure agree. A third with reversed sign agrees with none of equal force.

    >>> f = np.array([[1.0, 2.0, 1.0], [2.0, 1.0, 1.0], [2.0, 1.0, 1.0]], dtype=complex)
    >>> print(pairwise_coherence(f, f * 3j * np.array([[1], [1], [-1]])).round(2)[0])
    [1.   1.   0.36]
    """
    return _of_pairs(force, acceleration, lambda lines: np.median(lines, axis=1))


def mean_pairwise_coherence(force: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """As ``pairwise_coherence``, but the mean over frequency: it falls with a single resonance that differs.

    Parameters
    ----------
    force, acceleration : (n_impact, n_frequency) array of complex
        Spectra at the compared lines. [N s], [m/s]

    Returns
    -------
    (n_impact, n_impact) array of float
        1 on the diagonal.
    """
    return _of_pairs(force, acceleration, lambda lines: np.mean(lines, axis=1))


def _of_pairs(force: np.ndarray, acceleration: np.ndarray, average: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Average over frequency of the coherence of every two impacts, (n_impact, n_impact)."""
    cross = force.conj() * acceleration
    ff, aa = np.abs(force) ** 2, np.abs(acceleration) ** 2
    n = force.shape[0]
    result = np.ones((n, n))
    for i in range(n - 1):
        numerator = np.abs(cross[i] + cross[i + 1 :]) ** 2
        denominator = (ff[i] + ff[i + 1 :]) * (aa[i] + aa[i + 1 :])
        lines = numerator / np.where(denominator > 0.0, denominator, np.inf)
        result[i, i + 1 :] = result[i + 1 :, i] = average(lines)
    return result


def response_gain(force: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    r"""Response of each impact over the prediction of the test's mean power ratio from its force.

    .. math:: g_i^2 = \frac{\sum_f |A_i|^2}{\sum_f |F_i|^2 W}, \quad
        W(f) = \frac{\sum_j |A_j|^2}{\sum_j |F_j|^2}, \quad g_i \leftarrow g_i / \mathrm{median}(g)

    Powers without phases: a slightly shifted resonance in one impact must not appear as a change of gain.

    Parameters
    ----------
    force, acceleration : (n_impact, n_frequency) array of complex
        [N s], [m/s]

    Returns
    -------
    (n_impact,) array of float
        1 for an impact that agrees; above 1 the recorded force is too small for its response.

    Examples
    --------
    >>> f = np.outer([1.0, 2.0, 3.0, 1.0, 2.0], [1.0 + 1j, 2.0])
    >>> a = 3j * f
    >>> f[4] *= 0.8
    >>> print(response_gain(f, a).round(2))
    [1.   1.   1.   1.   1.25]
    """
    ff, aa = np.abs(force) ** 2, np.abs(acceleration) ** 2
    total = np.sum(ff, axis=0)
    predicted = ff @ (np.sum(aa, axis=0) / np.where(total > 0.0, total, np.inf))
    gain = np.sqrt(np.sum(aa, axis=1) / np.where(predicted > 0.0, predicted, np.inf))
    median_gain = np.median(gain)
    return gain / median_gain if median_gain > 0.0 else np.ones_like(gain)


def following_gain(force: np.ndarray, acceleration: np.ndarray, usual: np.ndarray) -> np.ndarray:
    r"""Part of each response that follows its force, over the prediction from the usual impacts of the test.

    .. math:: c_i = \frac{\mathrm{Re} \sum_f P_i^* A_i}{\sum_f |P_i|^2}, \quad
        P_i = F_i\, \frac{\sum_j F_j^* A_j}{\sum_j |F_j|^2} \quad (j \text{ usual})

    Parameters
    ----------
    force, acceleration : (n_impact, n_frequency) array of complex
        [N s], [m/s]
    usual : (n_impact,) array of bool
        Impacts that predict.

    Returns
    -------
    (n_impact,) array of float
        1 for an impact that agrees, also with hum or noise in its response.

    Examples
    --------
    >>> f = np.outer([1.0, 2.0, 3.0, 1.0, 2.0], [1.0 + 1j, 2.0])
    >>> a = 3j * f
    >>> a[0] *= 1.0 + 0.5j  # half as much again, a quarter of a period behind: it does not follow the force
    >>> print(following_gain(f, a, np.arange(5) > 0)[0].round(2), response_gain(f, a)[0].round(2))
    1.0 1.12
    """
    cross, power = np.sum(force[usual].conj() * acceleration[usual], axis=0), np.sum(np.abs(force[usual]) ** 2, axis=0)
    predicted = force * cross / np.where(power > 0.0, power, np.inf)
    size = np.sum(np.abs(predicted) ** 2, axis=1)
    return np.sum((predicted.conj() * acceleration).real, axis=1) / np.where(size > 0.0, size, np.inf)


def judge_agreement(cuts: Sequence[Cut], settings: ReceptanceSettings) -> None:
    """Reject impacts that disagree with the others of the test, first in shape (coherence), then in gain.

    Parameters
    ----------
    cuts : sequence of Cut
        The impacts of one test with one sampling rate; the result is entered in them.
    settings : ReceptanceSettings
        Limits of the quality of an impact.
    """
    cuts = [c for c in cuts if not c.rejections]
    if len(cuts) < MIN_COMPARED:
        return
    force, acceleration = spectra_of(cuts, settings)
    _judge_coherence(cuts, force, acceleration, settings)
    agreeing = [k for k, c in enumerate(cuts) if not c.rejections]
    _judge_gain([cuts[k] for k in agreeing], force[agreeing], acceleration[agreeing], settings)


def _judge_coherence(
    cuts: Sequence[Cut], force: np.ndarray, acceleration: np.ndarray, settings: ReceptanceSettings
) -> None:
    """Reject, one at a time, the impact that agrees with no other although the others agree among themselves.

    The worst impact is an outlier under two conditions. Its median pairwise coherence lies ``agreement_gap`` below the
    others' median, and its incoherence is ``agreement_factor`` times theirs. The detail gives the coherence of the test
    with and without it. With fewer than ``MIN_COMPARED`` impacts there is no majority that could call one an outlier.
    """
    pairs = pairwise_coherence(force, acceleration)
    remaining = list(range(len(cuts)))
    while len(remaining) >= MIN_COMPARED:
        remaining_pairs = pairs[np.ix_(remaining, remaining)]
        np.fill_diagonal(remaining_pairs, np.nan)
        medians = np.nanmedian(remaining_pairs, axis=1)
        worst = int(np.argmin(medians))
        other_median = float(np.median(np.delete(medians, worst)))
        limit = min(other_median - settings.agreement_gap, 1.0 - settings.agreement_factor * (1.0 - other_median))
        if medians[worst] >= limit:
            return
        outlier = remaining.pop(worst)
        detail = (
            f"coherence with each other impact {medians[worst]:.3f}, among those {other_median:.3f}; of the whole test "
            f"{_test_coherence(force, acceleration, [*remaining, outlier]):.3f} with it, "
            f"{_test_coherence(force, acceleration, remaining):.3f} without"
        )
        common = np.sum(force[remaining].conj() * acceleration[remaining], axis=0)
        if np.sum((force[outlier].conj() * acceleration[outlier] * common.conj()).real) < 0.0:
            detail += "; its response has the opposite sign"
        cuts[outlier].rejections.append(Rejection("odd_one_out", float(medians[worst]), float(limit), detail))


def _judge_gain(cuts: Sequence[Cut], force: np.ndarray, acceleration: np.ndarray, settings: ReceptanceSettings) -> None:
    """Report a response too large or too small for its force, in a test with enough impacts to estimate the spread.

    A clipped hammer channel records a force too small for its response, and yet among the largest of the test. In a
    pulse of a few samples clipping shows in no other way. The excess follows the force, which that of hum or noise does
    not. Any other gain is only noted, as it does not affect poles.
    """
    n = len(cuts)
    if n < MIN_IMPACTS:
        return
    gain = response_gain(force, acceleration)
    # The median deviation of a few impacts is itself uncertain by about 1/sqrt(n).
    spread = MAD_TO_SD * float(np.median(np.abs(gain - 1.0))) * (1.0 + 1.2 / np.sqrt(n))
    limit = max(settings.gain, settings.deviation * spread)
    following = following_gain(force, acceleration, np.abs(gain - 1.0) <= limit)
    peak = np.array([abs(c.contact.peak) for c in cuts])
    for k, cut in enumerate(cuts):
        if abs(gain[k] - 1.0) > limit:
            follows = following[k] - 1.0 >= MIN_FOLLOWING * (gain[k] - 1.0)
            clipped = gain[k] > 1.0 and follows and peak[k] > MIN_CLIPPED_PEAK * np.max(np.delete(peak, k))
            detail = f"the response is {gain[k]:.3f} of what the other impacts predict from the force"
            bound = 1.0 + (limit if gain[k] > 1.0 else -limit)
            if clipped:
                channel = cut.channels[0].name
                cut.rejections.append(Rejection("overload", float(gain[k]), float(bound), detail, channel))
            else:
                cut.notes.append(Rejection("odd_one_out", float(gain[k]), float(bound), detail))


def spectra_of(cuts: Sequence[Cut | Impact], settings: ReceptanceSettings) -> tuple[np.ndarray, np.ndarray]:
    """Spectra of impacts at the lines at which they are compared.

    Parameters
    ----------
    cuts : sequence of Cut or Impact
        Impacts of one sampling rate.
    settings : ReceptanceSettings
        Limits of the compared frequencies.

    Returns
    -------
    force, acceleration : (n_impact, n_frequency) array of complex
        [N s], [m/s]
    """
    n_fft = next_fast_len(max(c.force.size for c in cuts), real=True)
    rate = cuts[0].rate
    frequency = rfftfreq(n_fft, 1.0 / rate)
    high = min(settings.agreement_high, float(np.median([c.band_edge for c in cuts])))
    keep = np.flatnonzero((frequency >= settings.agreement_low) & (frequency <= high))
    keep = keep[:: max(1, keep.size // 400)]
    stacked = np.zeros((2, len(cuts), n_fft))
    for k, cut in enumerate(cuts):
        stacked[0, k, : cut.force.size], stacked[1, k, : cut.force.size] = cut.force, cut.acceleration
    spectra = rfft(stacked)[:, :, keep]
    return spectra[0], spectra[1]


def _test_coherence(force: np.ndarray, acceleration: np.ndarray, impacts: list[int]) -> float:
    f, a = force[impacts], acceleration[impacts]
    cross = np.abs(np.sum(f.conj() * a, axis=0)) ** 2
    power = np.sum(np.abs(f) ** 2, axis=0) * np.sum(np.abs(a) ** 2, axis=0)
    return float(np.median(cross / np.where(power > 0.0, power, np.inf)))
