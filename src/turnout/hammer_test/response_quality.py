"""Check the response of a hammer test on a track: quantity, scale, saturation behind a filter, lag behind the force.

The force alone is judged by ``find_impacts``, the quantity by ``response_order``, the scale by ``response_scale``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.hammer_test.best_subset import select_best
from turnout.hammer_test.impacts import find_impacts
from turnout.hammer_test.limited_response import contact_spectra, judge_limited_impacts, transfer_function
from turnout.hammer_test.response_order import judge_response_order
from turnout.hammer_test.response_scale import judge_response_scale
from turnout.records import Rejection

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from turnout.config.settings.receptance import ReceptanceSettings
    from turnout.records import Impact, Recording


def find_track_impacts(
    recordings: Sequence[Recording], force: str, response: str, settings: ReceptanceSettings
) -> tuple[Impact, ...]:
    """``find_impacts`` of a hammer test on a track, with quantity and scale of the response judged too.

    Parameters
    ----------
    recordings : sequence of Recording
        All recordings of the test together.
    force, response : str
        Names of the hammer's and the accelerometer's channel.
    settings : ReceptanceSettings
        Limits of the quality; a ``minimum_peak_force`` of 0 says that the structure is no track.

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
    is_track = settings.minimum_peak_force > 0.0
    impacts = judge_causality(impacts, response, is_track)
    impacts = judge_saturation(impacts, response)
    impacts = judge_limited_impacts(impacts, response)
    if is_track:
        impacts = judge_response_order(impacts, response)
        impacts = judge_response_scale(impacts, response)
    return select_best(impacts, settings)  # among those that no other test has rejected


# Least number of impacts, and least standard deviation of the logarithm of what their forces predict, for a slope.
MIN_SLOPE_IMPACTS, MIN_FORCE_SPREAD = 5, 0.03
MAX_NOISE = 0.33  # of a largest value, before the impact: noise does not grow with the force either
MAX_SATURATED_SLOPE = 0.5  # slope of the logarithms of peaks: 1 for a linear track, 0 for a saturated channel


def judge_saturation(impacts: Sequence[Impact], response: str) -> tuple[Impact, ...]:
    r"""Reject a test whose response does not grow with the force: the channel saturates before its filter.

    Behind an anti-aliasing filter an overload has no flat top. The slope b of

    .. math:: \ln \max|a_i| = b \ln \max|\hat a_i| + c

    is 1 on a linear track. The prediction is the force through the mean transfer function of the test. It contains the
    shape of each pulse: the response to a short one follows its impulse, and samples may miss its peak. A saturated
    test has a smaller transfer function, but a prediction that grows with the force. A test is rejected if b lies below
    ``MAX_SATURATED_SLOPE`` by three standard errors. The same holds for its highest and for its lowest value, as a
    channel may be limited on one side, and for its steepest slope, which an amplifier may limit. A value is not
    compared if that of the noise before the impact is more than ``MAX_NOISE`` of it.

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
    if len(used) < MIN_SLOPE_IMPACTS or len({i.rate for i in used}) > 1:
        return tuple(impacts)
    spectra = contact_spectra(used)
    predicted = np.fft.irfft(transfer_function(spectra, np.arange(len(used))) * spectra[0])
    predictions = [x[: i.acceleration.size] for x, i in zip(predicted, used)]
    for name, largest in LARGEST_VALUES.items():
        with np.errstate(divide="ignore"):
            x, y = (
                np.log([largest(a[i.onset :]) for i, a in zip(used, responses)])
                for responses in (predictions, [i.acceleration for i in used])
            )
        noise = np.median([largest(i.acceleration[: i.onset]) for i in used])
        if not np.isfinite([x, y]).all() or np.std(x) < MIN_FORCE_SPREAD or noise > MAX_NOISE * np.exp(np.median(y)):
            continue
        slope, error = _slope(x, y)
        if slope + 3.0 * error < MAX_SATURATED_SLOPE:
            detail = (
                f"the {name} of {response} is about {np.exp(np.median(y)):.4g} whatever the force: it grows with the "
                f"force to the power {slope:.2f}, not 1; the channel is limited before its filter, so choose a larger "
                "range"
            )
            return _with_rejection(impacts, Rejection("overload", slope, MAX_SATURATED_SLOPE, detail, response))
    return tuple(impacts)


def _highest(x: np.ndarray) -> float:
    return float(np.max(x, initial=0.0))


# What a limited amplifier holds of a response: both sides or one, or the change from sample to sample.
LARGEST_VALUES: dict[str, Callable[[np.ndarray], float]] = {
    "peak": lambda x: _highest(np.abs(x)),
    "steepest slope": lambda x: _highest(np.abs(np.diff(x))),
    "highest value": _highest,
    "lowest value": lambda x: _highest(-x),
}


def _slope(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Slope of y over x and its standard error. [-]"""
    deviations = x - x.mean()
    slope = float(deviations @ y / (deviations @ deviations))
    residual = y - y.mean() - slope * deviations
    return slope, float(np.sqrt(residual @ residual / (len(x) - 2) / (deviations @ deviations)))


# Share of its largest value at which a response has begun: a filter of linear phase rings before it with less.
ONSET_SHARE = 0.1
MAX_LEAD, MAX_LAG = 3, 5  # samples by which filters of two channels move a response forwards and backwards
# Quantile of the magnitudes before the force: it is noise even if a response fills up to half of that time.
QUIET_QUANTILE = 0.25
NORMAL_QUANTILE = 0.31864  # magnitude below which a quarter of a normal distribution lies, in standard deviations
MIN_QUIET_SAMPLES = 8  # before the force; with fewer the noise is that of the end of the record
# A response that begins before the force lies in the samples from which the noise is measured.
CONSEQUENCES_OF_A_LEAD = {"dead_channel", "noisy"}


def judge_causality(impacts: Sequence[Impact], response: str, is_track: bool = False) -> tuple[Impact, ...]:
    """Reject a test whose response begins before its force or long after it, with the lag in samples.

    Everywhere on a structure the response begins by the end of the contact. Beside the hammer it begins at once: the
    acceleration of a mass follows the force, that of a rail the change of the force, which is largest at half of the
    rise. Where a later vibration is less than five times as large, a tenth of it is reached by then.

    Parameters
    ----------
    impacts : sequence of Impact
        All impacts of a test. The accepted ones are measured, and those that only their noise rejects: a response
        before the force is taken for noise. The latter decide only where none is accepted, as it may be noise.
    response : str
        Name of the response's channel, for the message.
    is_track : bool
        Whether the accelerometer is beside the hammer.

    Returns
    -------
    tuple of Impact
        The impacts, with a rejection "not_simultaneous" in those of such a test that were measured.
    """
    measured = [i for i in impacts if all(r.reason in CONSEQUENCES_OF_A_LEAD for r in i.rejections)]
    lags = [(i, lag) for i in measured if (lag := response_lag(i)) is not None]
    if not lags:
        return tuple(impacts)
    deciding = [(i, lag) for i, lag in lags if i.accepted] or lags
    median_lag = float(np.median([lag for _, lag in deciding]))
    times = [0.5 * _rise(i) if is_track else i.contact * i.rate for i, _ in deciding]
    latest = float(np.median(times)) + MAX_LAG
    if -MAX_LEAD <= median_lag <= latest:
        return tuple(impacts)
    bound = -float(MAX_LEAD) if median_lag < 0.0 else latest
    word = "before" if median_lag < 0.0 else "after"
    detail = (
        f"{response} begins {abs(median_lag):.0f} samples ({1e3 * abs(median_lag) / lags[0][0].rate:.3g} ms) {word} "
        "the force: the channels were not sampled together, or are not of one impact"
    )
    rejection = Rejection("not_simultaneous", median_lag, bound, detail, response)
    ids = {id(i) for i, _ in lags} | {id(i) for i in impacts if i.accepted}
    return tuple(replace(i, rejections=(rejection,)) if id(i) in ids else i for i in impacts)


def _rise(impact: Impact) -> int:
    """Samples from the onset of the force to its peak."""
    return int(np.argmax(np.abs(impact.force[impact.onset : impact.contact_end + 1])))


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
    if not level > 4.0 * _quiet_noise(impact):
        return None
    return int(np.argmax(size >= level)) - impact.onset


def _quiet_noise(impact: Impact) -> float:
    """Standard deviation of the response before the force, from its quieter samples. [m/s²]

    It is at least that of rounding to the smallest step: of a channel that changes by single steps, most samples are
    equal.
    """
    before = impact.acceleration[: impact.onset]
    if before.size < MIN_QUIET_SAMPLES:
        return impact.noise_acceleration
    rounding = float(np.min(np.diff(np.unique(before)), initial=np.ptp(before))) / np.sqrt(12.0)
    return max(float(np.quantile(np.abs(before - np.median(before)), QUIET_QUANTILE)) / NORMAL_QUANTILE, rounding)


def _with_rejection(impacts: Sequence[Impact], rejection: Rejection) -> tuple[Impact, ...]:
    return tuple(replace(i, rejections=(rejection,)) if i.accepted else i for i in impacts)
