"""Fit the identified model of a section to one sensor's record of a passage, and test the fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from turnout.passage.impact_timing import ImpactTimes, impact_times
from turnout.passage.impulse_fit import joint_fit, whitener
from turnout.passage.model_tests import DirectionTest, NullBand, direction_test, null_bases, null_scores
from turnout.passage.scores import Scores, common_delay, delay_power, forecast, score
from turnout.passage.wheel_basis import apply_filter, band_pass, wheel_basis
from turnout.records import ModalModel
from turnout.signal.converter import converter_step

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout.config.settings.passage import PassageSettings
    from turnout.passage.wheel_basis import WheelBasis

ACCEPTED, NULL, NOT_AN_IMPULSE, REJECTED = "accepted", "null_explains", "not_an_impulse", "rejected"
PEAK_ONLY = "peak_only"  # not scored: by configuration, or without a model of the section
LEAD_TIME = 0.25  # s before the first wheel, in which the band-pass settles


MIN_QUIET_TIME = 0.1  # s without a train, from which the noise is estimated
FILTER_SETTLING_TIME = 0.02  # s, over which the band filter starts from zero


@dataclass(frozen=True)
class ChannelFit:
    """Fit of one model at one sensor.

    ``times`` (n_wheel,) [s] of the impacts with ``times_se`` and ``ambiguous`` flags; ``amplitudes`` (n_wheel,)
    along b with ``amplitudes_se`` [m/s² per unit of b c]; ``test`` the chi-squared test per wheel; ``scores`` of the
    model, ``null`` band of random models, ``other_skills`` the forecast skill of other sections' models by name;
    ``measured`` and ``predicted`` (n,) [m/s²] band-passed, from ``start`` [s] of the recording on;
    ``max_fit`` the fit that noise alone would leave [%]; ``peak`` [m/s²] of the band-passed acceleration while
    the train passes; ``parameters_per_second``.
    """

    status: str
    detail: str = ""
    times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    times_se: np.ndarray = field(default_factory=lambda: np.zeros(0))
    ambiguous: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    amplitudes: np.ndarray = field(default_factory=lambda: np.zeros(0))
    amplitudes_se: np.ndarray = field(default_factory=lambda: np.zeros(0))
    test: DirectionTest | None = None
    scores: Scores | None = None
    null: NullBand | None = None
    other_skills: dict = field(default_factory=dict)
    max_fit: float = float("nan")
    peak: float = float("nan")
    parameters_per_second: float = float("nan")
    measured: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)
    predicted: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)
    start: float = 0.0

    @property
    def skill(self) -> float:
        """Forecast skill on a scale from its null (0) to the limit set by the noise (1)."""
        if self.null is None or self.scores is None:
            return float("nan")
        return (self.scores.forecast - self.null.forecast) / (self.max_fit - self.null.forecast)


@dataclass(frozen=True)
class _Excerpt:
    """Part of a record with the train in it: ``samples`` and, behind the ``band_filter``, ``data`` [m/s²].

    ``expected`` are the samples at which the axles pass, ``start`` [s] is that of the excerpt in the recording.
    ``record`` is the whole recording, ``min_noise`` [m/s²] the least noise that its converter leaves.
    """

    record: np.ndarray
    samples: np.ndarray
    data: np.ndarray
    band_filter: np.ndarray
    expected: np.ndarray
    start: float
    min_noise: float


def find_peak(samples: np.ndarray, rate: float, axle_times: np.ndarray, settings: PassageSettings) -> ChannelFit:
    """Peak of one sensor while the train passes, without a model.

    Parameters
    ----------
    samples : (n_sample,) array of float
        Acceleration of the whole recording. [m/s²]
    rate : float
        [Hz]
    axle_times : (n_wheel,) array of float
        As for ``fit_channel``. [s]
    settings : PassageSettings
        Settings of the passage analysis.

    Returns
    -------
    ChannelFit
        "peak_only"; "rejected" without two wheels whose windows lie within the recording.
    """
    excerpt = _excerpt_of(samples, rate, axle_times, settings)
    if isinstance(excerpt, ChannelFit):
        return excerpt
    times = excerpt.expected / rate + excerpt.start
    return ChannelFit(PEAK_ONLY, times=times, peak=_peak_of_train(excerpt, rate, settings))


def fit_channel(
    samples: np.ndarray,
    rate: float,
    axle_times: np.ndarray,
    speed: float,
    model: ModalModel,
    settings: PassageSettings,
    other_models: Mapping[str, ModalModel] | None = None,
    with_null: bool = True,
) -> ChannelFit:
    """Fit ``model`` to one sensor.

    Parameters
    ----------
    samples : (n_sample,) array of float
        Acceleration of the whole recording. [m/s²]
    rate : float
        [Hz]
    axle_times : (n_wheel,) array of float
        When the axles pass this sensor; those without a whole window in the recording are left out. [s]
    speed : float
        Speed of the train. [m/s]
    model : ModalModel
        Of the sensor's section.
    settings : PassageSettings
        Settings of the passage analysis.
    other_models : mapping or None
        Name -> ModalModel of other sections, whose forecast skill is given for comparison.
    with_null : bool
        Also score random models. Without them "null_explains" cannot result.

    Returns
    -------
    ChannelFit
        "rejected" without two wheels whose windows lie within the recording.
    """
    excerpt = _excerpt_of(samples, rate, axle_times, settings)
    if isinstance(excerpt, ChannelFit):
        return excerpt
    data, expected = excerpt.data, excerpt.expected
    basis = _filtered_basis(model, rate, settings)
    delay = common_delay(delay_power(data, expected, basis, settings))
    near_wheels = _windows(data, rate, expected + delay, settings.score_window)
    quiet = _quiet_samples(excerpt.record, rate, axle_times, speed)
    times, test = _impacts_and_test(excerpt, expected + delay, quiet, speed, model, rate, settings)
    scores = score(data, expected, basis, settings)
    null = (
        NullBand.of(null_scores(data, expected, _cached_null_bases(model.order, rate, settings), settings))
        if with_null
        else None
    )
    other_skills = {
        name: forecast(data, expected, _filtered_basis(m, rate, settings), settings)[0]
        for name, m in (other_models or {}).items()
    }
    joint = joint_fit(data, times.times, basis)
    band_ratio = np.sqrt(2.0 * (min(settings.band_high, rate / 2) - settings.band_low) / rate)  # of white noise
    noise = _band_noise(quiet, rate, excerpt.band_filter, excerpt.min_noise * band_ratio)
    status, detail = _judge(scores, null, test, settings)
    return ChannelFit(
        status,
        detail,
        times.times / rate + excerpt.start,
        times.standard_errors / rate,
        times.ambiguous,
        joint.amplitudes[:, 0],
        joint.standard_errors(noise / band_ratio)[:, 0] if np.isfinite(noise) else np.full(expected.size, np.nan),
        test,
        scores,
        null,
        other_skills,
        100.0 * (1.0 - noise / max(float(np.std(near_wheels)), 1e-300)),
        _peak_of_train(excerpt, rate, settings),
        scores.n_parameter / (scores.n_value / rate),
        data,
        joint.prediction,
        excerpt.start,
    )


def _excerpt_of(
    samples: np.ndarray, rate: float, axle_times: np.ndarray, settings: PassageSettings
) -> _Excerpt | ChannelFit:
    """The part of a record with the train in it, or the rejection of the record."""
    record = np.asarray(samples, dtype=float)
    record = record - np.median(record)  # the filters start from zero: an offset would act as an impact
    excerpt, expected = _cut_excerpt(record, rate, axle_times, settings)
    if expected.size < 2:
        return ChannelFit(REJECTED, "fewer than two wheels with a whole window in the recording")
    band_filter = band_pass(settings.band_low, settings.band_high, settings.filter_order, rate)
    min_noise = converter_step(record) / np.sqrt(12.0)  # a record constant within one step has at least this noise
    if not min_noise > 0.0:
        return ChannelFit(REJECTED, "it never changes")
    data, start = apply_filter(excerpt, band_filter), _excerpt_start(record, rate, axle_times)
    return _Excerpt(record, excerpt, data, band_filter, expected, start, min_noise)


def _peak_of_train(excerpt: _Excerpt, rate: float, settings: PassageSettings) -> float:
    """Largest acceleration while the train passes. [m/s²]

    It is sought in one piece from the first to the last wheel. In a window for each wheel it would depend on the axle
    times, which err by milliseconds.
    """
    begin = int(excerpt.expected[0] - settings.delay_search * rate)
    end = int(excerpt.expected[-1] + (settings.delay_search + settings.score_window) * rate)
    return float(np.max(np.abs(excerpt.data[begin:end])))


def _band_noise(quiet: np.ndarray, rate: float, band_filter: np.ndarray, least: float) -> float:
    """Standard deviation of the samples without a train in the band, ``least`` or more; nan if they are too few."""
    if quiet.size <= MIN_QUIET_TIME * rate:
        return float("nan")
    return max(float(np.std(apply_filter(quiet, band_filter)[int(FILTER_SETTLING_TIME * rate) :])), least)


def _windows(data: np.ndarray, rate: float, begins: np.ndarray, length: float) -> np.ndarray:
    """Data of ``length`` [s] from each of the samples ``begins``, one behind the other."""
    return np.concatenate([data[int(begin) : int(begin + length * rate)] for begin in begins])


def _excerpt_start(samples: np.ndarray, rate: float, axle_times: np.ndarray) -> float:
    """Start of the excerpt that is analysed. [s]"""
    return max(int((np.min(axle_times) - LEAD_TIME) * rate), 0) / rate


def _cut_excerpt(
    samples: np.ndarray, rate: float, axle_times: np.ndarray, settings: PassageSettings
) -> tuple[np.ndarray, np.ndarray]:
    """The excerpt of the record with the train in it, and the axle times in its samples."""
    start = round(_excerpt_start(samples, rate, axle_times) * rate)
    stop = min(int((np.max(axle_times) + settings.score_window + 0.2) * rate), len(samples))
    expected = np.sort(np.asarray(axle_times, dtype=float)) * rate - start
    margin = (settings.time_search + settings.delay_search) * rate  # a wheel may appear that much earlier
    inside = (expected > margin + 2) & (expected < stop - start - settings.score_window * rate)
    return samples[start:stop], expected[inside]


def _quiet_samples(samples: np.ndarray, rate: float, axle_times: np.ndarray, speed: float) -> np.ndarray:
    """Record at least 15 m and 0.5 s from any wheel: before or after the train, whichever is longer."""
    away = max(15.0 / speed, 0.5) * rate
    before = samples[: max(int(np.min(axle_times) * rate - away), 0)]
    after = samples[int(np.max(axle_times) * rate + away) :]
    return before if before.size >= after.size else after


def _impacts_and_test(
    excerpt: _Excerpt,
    expected: np.ndarray,
    quiet: np.ndarray,
    speed: float,
    model: ModalModel,
    rate: float,
    settings: PassageSettings,
) -> tuple[ImpactTimes, DirectionTest]:
    """Impact times and the test of the jump's direction, both on whitened data."""
    taps, noise = whitener(quiet[: int(rate)] if quiet.size > 0.1 * rate else np.diff(excerpt.samples[: int(rate)]))
    noise = max(noise, excerpt.min_noise)
    basis = wheel_basis(model, taps, rate)
    white = apply_filter(excerpt.samples, taps)
    spread = max(min(settings.place_error / speed, settings.time_search) * rate, 1.0)
    search_range = settings.time_search * rate
    times = impact_times(white, expected, basis, search_range, noise, spread, settings.ambiguity_odds)
    return times, direction_test(white, np.sort(times.times), basis, noise, settings.chi_squared_level, True)


def _judge(scores: Scores, null: NullBand | None, test: DirectionTest, settings: PassageSettings) -> tuple[str, str]:
    """Status and reason: first whether the null explains the scores, then whether the load was an impulse.

    The chi-squared test alone cannot show that. At 40 dB it fails for a model 5 % off in one resonance, whose fit is
    97 %. A load that is no impulse leaves jumps in all directions.
    """
    if null is not None and not (scores.fit > null.fit and scores.forecast > null.forecast):
        return (
            NULL,
            f"fit {scores.fit:.1f} against {null.fit:.1f}, forecast {scores.forecast:.1f} against {null.forecast:.1f}",
        )
    if test.failed_share > settings.not_an_impulse_share and test.along_share < settings.along_b_minimum:
        return NOT_AN_IMPULSE, f"{test.along_share:.0%} of the jumps' power is along b"
    return ACCEPTED, "without null band" if null is None else ""


def _filtered_basis(model: ModalModel, rate: float, settings: PassageSettings) -> WheelBasis:
    """``wheel_basis`` behind the band-pass. It is cached: the same few models are used for every passage."""
    matrices = tuple(np.ascontiguousarray(x, dtype=float).tobytes() for x in (model.a, model.b, model.c))
    return _cached_basis(matrices, len(np.atleast_1d(model.b)), model.rate, rate, settings)


@lru_cache(maxsize=64)
def _cached_basis(
    matrices: tuple[bytes, bytes, bytes], n: int, model_rate: float, rate: float, settings: PassageSettings
) -> WheelBasis:
    a, b, c = (np.frombuffer(x) for x in matrices)
    model = ModalModel(a.reshape(n, n), b, c, model_rate, ())
    band_filter = band_pass(settings.band_low, settings.band_high, settings.filter_order, rate)
    return wheel_basis(model, band_filter, rate)


@lru_cache(maxsize=8)
def _cached_null_bases(order: int, rate: float, settings: PassageSettings) -> list[WheelBasis]:
    band_filter = band_pass(settings.band_low, settings.band_high, settings.filter_order, rate)
    return null_bases(order, band_filter, rate, settings)
