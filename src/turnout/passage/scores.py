"""Score how much of a passage a model explains and how much it predicts.

The measures are the same for models and nulls.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from turnout.passage.impact_timing import best_times, gather, search_times
from turnout.passage.impulse_fit import joint_fit, onsets, predict
from turnout.passage.wheel_basis import WheelBasis

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.passage import PassageSettings


@dataclass(frozen=True)
class Scores:
    """Fit, forecast skill and leave-one-wheel-out score of one model at one sensor. [%]

    ``per_wheel`` (n_wheel, 3) holds the same three for each wheel, nan where a wheel has too little data of its
    own. ``n_value`` samples were scored in the fit, and ``n_parameter`` numbers were estimated for it.
    """

    fit: float
    forecast: float
    leave_one_out: float
    per_wheel: np.ndarray
    n_value: int
    n_parameter: int


def fit_percent(measured: np.ndarray, predicted: np.ndarray) -> float:
    r"""Amplitude fit of a prediction; 100 is perfect, 0 as good as the mean, without a lower limit.

    .. math:: 100\,(1 - \|y - \hat y\| / \|y - \bar y\|)

    Parameters
    ----------
    measured : (n,) array of float
        y, the measured samples. [any unit]
    predicted : (n,) array of float
        The prediction of them. [same unit]

    Returns
    -------
    float
        nan for no samples or constant ones. [%]

    References
    ----------
    Barkhordari et al., eq. 22, where the bracket is misplaced: as printed it depends on the unit.

    Examples
    --------
    A residual a tenth of the signal scores 90, in any unit:

    >>> y = np.array([1.0, -1.0, 1.0, -1.0])
    >>> round(fit_percent(1e3 * y, 0.9e3 * y), 9)
    90.0
    """
    measured = np.asarray(measured, dtype=float)
    if measured.size == 0:
        return float("nan")
    spread = np.linalg.norm(measured - measured.mean())
    if spread == 0:
        return float("nan")
    return float(100.0 * (1.0 - np.linalg.norm(measured - predicted) / spread))


def wheel_windows(expected: np.ndarray, n: int, length: int, lead: int) -> tuple[np.ndarray, np.ndarray]:
    """First sample and length of each wheel's own samples: up to the next wheel, at most ``length``. [samples]

    They start ``lead`` samples before the expected time, so that no model profits from a later onset.

    Parameters
    ----------
    expected : (n_wheel,) array of float
        Times of the impacts, increasing. [samples]
    n : int
        Samples of the recording.
    length : int
        Largest number of samples.
    lead : int
        Samples before the expected time.

    Returns
    -------
    first : (n_wheel,) array of int
        First sample.
    length : (n_wheel,) array of int
        Number of samples, 0 where there are none.
    """
    first = np.floor(np.asarray(expected, dtype=float)).astype(int) - lead
    following = np.append(first[1:], n)
    return first, np.clip(np.minimum(following, n) - first, 0, length)


def score(data: np.ndarray, expected: np.ndarray, basis: WheelBasis, settings: PassageSettings) -> Scores:
    """Scores of the model behind ``basis``; ``data`` (n_sample,) has passed its filter.

    ``expected`` (n_wheel,) are the detected axles [samples], increasing. Every model, true or random, first gets the
    one delay of all wheels that fits best. Then each impact is sought within ``settings.time_search``. The forecast
    uses only data before the predicted samples.

    Parameters
    ----------
    data : (n_sample,) array of float
        Acceleration behind the filter of ``basis``. [m/s²]
    expected : (n_wheel,) array of float
        Detected axles, increasing. [samples]
    basis : WheelBasis
        Responses of the model behind the filter of ``data``.
    settings : PassageSettings
        Windows and search ranges.

    Returns
    -------
    Scores
        [%]
    """
    rate, n = basis.rate, len(data)
    search_range, expected = settings.time_search * rate, np.asarray(expected, dtype=float)
    delays = delay_power(data, expected, basis, settings)
    times = np.sort(search_times(data, expected + common_delay(delays), basis, search_range))
    fitted = joint_fit(data, times, basis)
    first, length = wheel_windows(times, n, round(settings.score_window * rate), 2)
    windows = [slice(max(a, 0), a + k) for a, k in zip(first, length)]
    scored_samples = np.concatenate([np.arange(s.start, s.stop) for s in windows])
    fit_by_wheel = np.array([fit_percent(data[s], fitted.prediction[s]) for s in windows])
    forecast_skill, forecast_by_wheel = forecast(data, expected, basis, settings, delays)
    left_out_score, left_out_by_wheel = leave_one_out(data, times, basis, windows)
    return Scores(
        fit_percent(data[scored_samples], fitted.prediction[scored_samples]),
        forecast_skill,
        left_out_score,
        np.column_stack([fit_by_wheel, forecast_by_wheel, left_out_by_wheel]),
        len(scored_samples),
        2 * len(times),
    )


@dataclass(frozen=True)
class DelayPower:
    """``power`` (n_wheel, n_delay): power that each wheel's free jump explains at delays from -``reach`` by ``stride``.

    It is the largest value within the search range of the wheel. [samples]
    """

    power: np.ndarray
    stride: int
    reach: int


def delay_power(data: np.ndarray, expected: np.ndarray, basis: WheelBasis, settings: PassageSettings) -> DelayPower:
    """Power that each wheel explains at every delay against the detected axles.

    An envelope has its peak after an impact, and a sensor records a wheel before it arrives, alike for all wheels. Free
    jumps are compared, a few times per period of the band's upper edge: they do not depend on the phase.

    Parameters
    ----------
    data : (n_sample,) array of float
        Acceleration behind the filter of ``basis``. [m/s²]
    expected : (n_wheel,) array of float
        Expected times of the impacts, increasing. [samples]
    basis : WheelBasis
        Responses of the model behind the filter of ``data``.
    settings : PassageSettings
        Search ranges, and the upper edge of the band.

    Returns
    -------
    DelayPower
        One row per wheel.
    """
    stride = max(int(basis.rate / (12.0 * settings.band_high)), 1)
    reach = round(settings.delay_search * basis.rate / stride) * stride
    short = basis.truncate(300)
    rows = gather(data, np.round(expected).astype(int) - reach, 2 * reach + short.n_sample)
    inner = short.correlate(rows, 2 * reach + 1)[:, ::stride]
    power = np.sum((inner @ np.linalg.inv(short.whitening)) ** 2, axis=2)
    search_width = 2 * round(settings.time_search * basis.rate / stride) + 1
    return DelayPower(ndimage.maximum_filter1d(power, search_width, axis=1), stride, reach)


def common_delay(delays: DelayPower, leave_own_out: bool = False) -> np.ndarray:
    """(n_wheel,) delay of all wheels against the detected axles that explains most, the same for all. [samples]

    ``leave_own_out``: for every wheel the delay from the other wheels, so that its own future does not enter.

    Parameters
    ----------
    delays : DelayPower
        Power at every delay.
    leave_own_out : bool
        Whether a wheel's own power is left out.

    Returns
    -------
    (n_wheel,) array of float
        Delays. [samples]
    """
    power = delays.power
    total = np.broadcast_to(power.sum(axis=0), power.shape) - (power if leave_own_out and len(power) > 1 else 0.0)
    # middle of the range in which every wheel has its best time within its search range
    best_steps = [
        np.median(np.flatnonzero(row >= row.max() * (1 - 1e-9))) for row in (total if leave_own_out else total[:1])
    ]
    return np.broadcast_to(np.array(best_steps), len(power)) * delays.stride - delays.reach


def forecast(
    data: np.ndarray,
    expected: np.ndarray,
    basis: WheelBasis,
    settings: PassageSettings,
    delays: DelayPower | None = None,
) -> tuple[float, np.ndarray]:
    """Forecast skill [%], pooled and (n_wheel,) per wheel: jumps from the first milliseconds predict the next ones.

    The forecast is causal, as is the filter: nothing after ``forecast_train`` behind a wheel's expected impact enters
    its time and amplitude. The decay of earlier wheels is taken from their own forecasts. The delay between a sensor's
    record and the detected axles is taken from the other wheels. A wheel whose successor comes too soon is not scored.
    ``delays`` is ``delay_power`` of the same arguments, if it is known.

    Parameters
    ----------
    data : (n_sample,) array of float
        Acceleration behind the filter of ``basis``. [m/s²]
    expected : (n_wheel,) array of float
        Expected times of the impacts, increasing. [samples]
    basis : WheelBasis
        Responses of the model behind the filter of ``data``.
    settings : PassageSettings
        Length of the data before and of the prediction, and the search ranges.
    delays : DelayPower, optional
        ``delay_power`` of the same arguments.

    Returns
    -------
    skill : float
        Of all wheels; nan without one that can be scored. [%]
    skill_by_wheel : (n_wheel,) array of float
        nan for a wheel that is not scored. [%]
    """
    rate, n = basis.rate, len(data)
    train, test = round(settings.forecast_train * rate), round(settings.forecast_test * rate)
    search_range, expected = settings.time_search * rate, np.asarray(expected, dtype=float)
    delays = delays or delay_power(data, expected, basis, settings)
    expected = expected + common_delay(delays, leave_own_out=True)
    following = np.append(np.floor(expected[1:] - search_range).astype(int), n)
    end = np.round(expected).astype(int) + train
    prediction = _predict_from_training(data, expected, end, basis, search_range)
    measured, predicted, skill_by_wheel = [], [], np.full(len(expected), np.nan)
    for j, first in enumerate(end):
        tested = slice(first, min(first + test, following[j], n))
        if tested.stop - tested.start >= test // 2:
            measured.append(data[tested])
            predicted.append(prediction[tested])
            skill_by_wheel[j] = fit_percent(measured[-1], predicted[-1])
    if not measured:
        return float("nan"), skill_by_wheel
    return fit_percent(np.concatenate(measured), np.concatenate(predicted)), skill_by_wheel


def _predict_from_training(
    data: np.ndarray, expected: np.ndarray, end: np.ndarray, basis: WheelBasis, search_range: float
) -> np.ndarray:
    """Sum (n,) of the predicted responses, from the data of each wheel before its ``end``."""
    reach = int(np.ceil(search_range)) + 1
    first = np.round(expected).astype(int) - reach
    n_lag, span = 2 * reach + 1, int(end[0] - first[0])
    short = basis.truncate(span)
    n_observed = span - np.arange(n_lag)
    windows = np.pad(gather(data, first, span), ((0, 0), (0, n_lag - 1)))
    rows, onset, weight, prediction = windows, first, np.zeros((len(first), short.n_column)), np.zeros(len(data))
    gap = np.diff(expected).min(initial=np.inf) - search_range
    for sweep in range(3 if gap < basis.ring_length else 2 if gap < basis.n_sample else 1):
        if sweep:
            rows = windows - np.pad(gather(prediction, first, span), ((0, 0), (0, n_lag - 1)))
            for row, shift, response in zip(rows, onset - first, weight @ short.columns):
                row[shift:span] += response[: span - shift]
        onset, phi = onsets(best_times(rows, first, expected, short, search_range, n_observed))
        theta = short.coefficients(phi)
        unit = theta @ short.columns
        unit[np.arange(span) >= (span - (onset - first))[:, None]] = 0.0
        aligned_rows = rows[np.arange(len(rows))[:, None], (onset - first)[:, None] + np.arange(span)]
        weight = theta * (np.sum(unit * aligned_rows, axis=1) / np.sum(unit**2, axis=1))[:, None]
        prediction = predict(len(data), onset, weight, basis)
    return prediction


def leave_one_out(
    data: np.ndarray, times: np.ndarray, basis: WheelBasis, windows: Sequence[slice]
) -> tuple[float, np.ndarray]:
    """Score [%] with the jump's direction from the other wheels and one amplitude for the held-out wheel.

    Parameters
    ----------
    data : (n_sample,) array of float
        Acceleration behind the filter of ``basis``. [m/s²]
    times : (n_wheel,) array of float
        Times of the impacts, increasing. [samples]
    basis : WheelBasis
        Responses of the model behind the filter of ``data``.
    windows : sequence of slice
        Samples of each wheel that are scored.

    Returns
    -------
    score : float
        Of all wheels; nan for fewer than three wheels. [%]
    score_by_wheel : (n_wheel,) array of float
        nan for a wheel with fewer than eight samples. [%]
    """
    if len(times) < 3:
        return float("nan"), np.full(len(times), np.nan)
    free = joint_fit(data, times, basis, free=True)
    onset, phi = onsets(times)
    whitened = basis.advance(free.amplitudes, -phi) @ basis.whitening.T
    moment = whitened.T @ whitened - whitened[:, :, None] * whitened[:, None, :]
    direction = np.linalg.solve(basis.whitening, np.linalg.eigh(moment)[1][:, :, -1].T).T
    shapes = basis.advance(direction, phi) @ basis.columns
    own_responses = free.amplitudes @ basis.columns
    measured, predicted, score_by_wheel = [], [], np.full(len(times), np.nan)
    for j, window in enumerate(windows):
        n = min(window.stop - onset[j], basis.n_sample)
        if n < 8:
            continue
        samples = slice(onset[j], onset[j] + n)
        other_responses = free.prediction[samples] - own_responses[j, :n]
        scale = shapes[j, :n] @ (data[samples] - other_responses) / (shapes[j, :n] @ shapes[j, :n])
        measured.append(data[samples])
        predicted.append(other_responses + scale * shapes[j, :n])
        score_by_wheel[j] = fit_percent(measured[-1], predicted[-1])
    if not measured:
        return float("nan"), score_by_wheel
    return fit_percent(np.concatenate(measured), np.concatenate(predicted)), score_by_wheel
