"""Check each channel of a passage before axles are sought in it.

Electrical pulses are removed: they appear at all sensors at one moment. The fastest wave in a rail takes 0.4 ms over
the two metres between neighbouring sensors, and a wheel takes 100 times as long. Sensors that are lost during the
passage are reported: they fell off, or their cable broke.

Find sensors whose records disagree with their positions: swapped channels, drifting or offset clocks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from turnout.passage.axles import GRID_STEP, along_train
from turnout.passage.kinematics import Motion, coarsen, pair_correlations, slowness_grid, stack_correlations
from turnout.records import Recording, Rejection

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from turnout.config.settings.passage import PassageSettings
    from turnout.passage.result import PassageSensor
    from turnout.passage.sensor_envelopes import SensorEnvelopes
    from turnout.records import Channel


@dataclass(frozen=True)
class ChannelState:
    """``usable`` for timing and axles; ``fit_for_model`` also for fits of a model.

    ``lost_at`` [s] is the time at which a lost sensor became constant.
    """

    name: str
    usable: bool
    fit_for_model: bool
    findings: tuple[Rejection, ...] = ()
    lost_at: float | None = None


def channel_states(recording: Recording) -> tuple[ChannelState, ...]:
    """State of every acceleration channel, in the order of ``recording.of_quantity("acceleration")``.

    Parameters
    ----------
    recording : Recording
        Recording of the passage.

    Returns
    -------
    tuple of ChannelState
        One per acceleration channel.
    """
    rows = recording.of_quantity("acceleration")
    return tuple(_channel_state(recording.channels[i], recording.samples[i], recording.rate) for i in rows)


def _channel_state(channel: Channel, samples: np.ndarray, rate: float) -> ChannelState:
    if not np.all(np.isfinite(samples)):
        bad = np.flatnonzero(~np.isfinite(samples))
        first = float(bad[0] / rate)
        text = f"{channel.name}: first at {first:.3f} s"
        finding = Rejection("not_finite", float(bad.size), 0.0, text, channel.name, time=first)
        return ChannelState(channel.name, False, False, (finding,))
    spread = float(np.ptp(samples))
    if spread == 0.0:
        finding = Rejection("dead_channel", 0.0, 0.0, channel.name, channel.name)
        return ChannelState(channel.name, False, False, (finding,))
    share, level = clipped_share(samples, channel.limit)
    findings = []
    if share > 0:
        text = f"{channel.name}: {100 * share:.3f} % of the samples at ±{level:.4g} m/s²"
        findings.append(Rejection("clipped", share, 0.0, text, channel.name))
    lost_at = silent_from(samples, rate)
    if lost_at is not None:
        text = f"{channel.name}: constant from {lost_at:.2f} s on"
        findings.append(Rejection("sensor_lost", lost_at, None, text, channel.name, time=lost_at))
    return ChannelState(channel.name, share < 0.2, not findings, tuple(findings), lost_at)


def clipped_share(samples: np.ndarray, limit: float | None, run: int = 3) -> tuple[float, float]:
    """Share of samples at the limit of the channel, and that limit. [-], [m/s²]

    The limit is the configured one (within 0.1 %). Without one it is an extreme value that is repeated ``run`` times
    in a row, at least twice: noise does not do that, a saturated converter does.

    Parameters
    ----------
    samples : (n_sample,) array of float
        Acceleration. [m/s²]
    limit : float or None
        Range of the channel, None if it is not known. [m/s²]
    run : int
        Equal extreme samples in a row that count as clipped.

    Returns
    -------
    share, level : float
        Share of the samples at the limit [-], and the limit or the largest value [m/s²].

    Examples
    --------
    >>> y = np.sin(np.linspace(0, 20, 400))
    >>> share, level = clipped_share(np.clip(y, -0.8, 0.8), None)
    >>> print(f"{share:.2f} at {level:.1f}")
    0.40 at 0.8
    >>> clipped_share(y, None)[0]
    0.0
    """
    top = float(np.max(np.abs(samples)))
    if limit is not None:
        at_limit = np.abs(samples) >= 0.999 * limit
        return float(at_limit.mean()), float(limit)
    at_limit = np.abs(samples) >= top * (1 - 1e-6)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at_limit.astype(int), [0]])))
    lengths = edges[1::2] - edges[::2]
    clipped = np.sum(lengths >= run) >= 2
    return (float(at_limit.mean()), top) if clipped else (0.0, top)


def silent_from(samples: np.ndarray, rate: float, block: float = 0.05) -> float | None:
    """Time from which a channel is constant up to its end [s], None where it changes to the end.

    A sensor that had this value before the train as well, within one step of its converter, is quiet and not lost.

    Parameters
    ----------
    samples : (n_sample,) array of float
        Acceleration. [m/s²]
    rate : float
        Sampling rate. [Hz]
    block : float
        Shortest constant end that counts, and length of the start that it is compared with. [s]

    Returns
    -------
    float or None
        Time of the last change. [s]

    Examples
    --------
    >>> y = np.sin(np.arange(100.0))
    >>> silent_from(np.r_[y, np.full(900, 0.1)], 1000.0), silent_from(np.r_[np.zeros(60), y, np.zeros(900)], 1000.0)
    (0.1, None)
    """
    changes = np.flatnonzero(np.diff(samples))
    last = (changes[-1] + 1) / rate if changes.size else 0.0
    if len(samples) / rate - last <= block:
        return None
    start = samples[: max(int(block * rate), 1)]
    quiet = np.mean(np.abs(start - samples[-1]) < 1.5 * converter_step(samples)) > 0.9
    return None if changes.size and quiet else float(last)


def converter_step(samples: np.ndarray) -> float:
    """Smallest change from one sample to the next: a converter's step, or nearly 0; 0 where nothing changes.

    Parameters
    ----------
    samples : (n_sample,) array of float
        Acceleration. [m/s²]

    Returns
    -------
    float
        [m/s²]
    """
    change = np.abs(np.diff(samples))
    return float(np.min(change, where=change > 0, initial=np.inf)) if change.any() else 0.0


PULSE_FACTOR = 8.0  # least height of a pulse, in units of the 99.9 % quantile of the channel
MAX_PULSE_DELAY, MIN_SENSOR_SPAN = 2e-4, 2.0  # s: largest delay between sensors; m: least span of the sensors
PULSE_MARGIN, MAX_PULSE_DURATION = 3e-3, 1e-2  # s: filter ringing on both sides of a pulse; longest pulse


def without_pulses(recording: Recording, sensors: Sequence[PassageSensor]) -> tuple[Recording, tuple[Rejection, ...]]:
    """The recording with straight lines in place of its electrical pulses, and the findings.

    ``sensors`` are PassageSensors. Nothing is cut where the live ones are less than 2 m from each other. A channel
    that is constant or not finite stays as it is and is not asked.

    Parameters
    ----------
    recording : Recording
        Recording of the passage.
    sensors : sequence of PassageSensor
        What the channels are.

    Returns
    -------
    recording : Recording
        The same object where nothing is cut.
    findings : tuple of Rejection
        One finding "interference", or none.
    """
    positions = {s.name: s.position for s in sensors}
    rows = [i for i, c in enumerate(recording.channels) if c.name in positions and _is_live(recording.samples[i])]
    if len(rows) < 2 or np.ptp([positions[recording.channels[i].name] for i in rows]) < MIN_SENSOR_SPAN:
        return recording, ()
    window = 2 * max(round(MAX_PULSE_DELAY * recording.rate), 1) + 1
    is_pulse = np.ones(recording.n_sample, dtype=bool)
    for i in rows:
        magnitude = np.abs(recording.samples[i] - np.median(recording.samples[i]))
        is_pulse &= ndimage.maximum_filter1d(magnitude, window) > PULSE_FACTOR * np.quantile(magnitude, 0.999)
        if not is_pulse.any():
            return recording, ()
    cut, n = _pulse_regions(is_pulse, recording.rate)
    if not n:
        return recording, ()
    samples, in_pulse, valid = recording.samples.copy(), np.flatnonzero(cut), np.flatnonzero(~cut)
    for i in rows:
        samples[i, in_pulse] = np.interp(in_pulse, valid, samples[i, valid])
    first = float(in_pulse[0] / recording.rate)
    text = f"all channels: {n} electrical pulse{'s' * (n > 1)} cut out, the first at {first:.3f} s"
    return replace(recording, samples=samples), (Rejection("interference", float(n), 0.0, text, time=first),)


def _is_live(samples: np.ndarray) -> bool:
    return bool(np.isfinite(samples).all()) and np.ptp(samples) > 0.0


def _pulse_regions(is_pulse: np.ndarray, rate: float) -> tuple[np.ndarray, int]:
    """((n_sample,) bool to cut, number of pulses): pulses with their ringing; longer events are not pulses."""
    label, _n = ndimage.label(ndimage.maximum_filter1d(is_pulse, 2 * round(PULSE_MARGIN * rate) + 1))
    runs = ndimage.find_objects(label)
    short = [run for (run,) in runs if run.stop - run.start <= (MAX_PULSE_DURATION + 2 * PULSE_MARGIN) * rate]
    cut = np.zeros(is_pulse.size, dtype=bool)
    for run in short:
        cut[run] = True
    return cut, len(short)


MIN_RELATIVE_LEVEL = 0.2  # of a sensor's typical log level at axles: below it an axle is not audible
AXLE_REACH = 0.5  # m around an axle in which its level is taken


def lost_sensors(
    envelopes: SensorEnvelopes, names: Sequence[str], at_sensor: Mapping[str, np.ndarray], speed: float
) -> list[Rejection]:
    """A finding "sensor_lost" for every sensor that records the first half of the train and not its last two axles.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Levels of the sensors ``names``, in that order.
    names : sequence of str
        Names of the sensors of ``envelopes``.
    at_sensor : mapping
        Channel -> (n_axle,) times of the axles there. [s]
    speed : float
        Speed of the train. [m/s]

    Returns
    -------
    list of Rejection
        With the time of the last audible sample as their value. [s]
    """
    step, findings = envelopes.levels.step, []
    reach = max(int(AXLE_REACH / speed / step), 1)
    loudest = ndimage.maximum_filter1d(envelopes.levels.values, 2 * reach + 1, axis=1)
    for name, level, row in zip(names, envelopes.levels.values, loudest):
        times = np.asarray(at_sensor.get(name, ()))
        inside = times[(times > 0) & (times < len(row) * step)]
        if inside.size < 4:
            continue
        at_axles = row[(inside / step).astype(int)]
        typical = np.median(at_axles[: inside.size // 2])
        is_silent = at_axles < MIN_RELATIVE_LEVEL * typical
        if typical <= 0 or not is_silent[-2:].all() or is_silent[: inside.size // 2].mean() > 0.25:
            continue
        first_silent = int(np.flatnonzero(~is_silent)[-1]) + 1
        stop = int(inside[first_silent] / step)
        lost_at = float((np.flatnonzero(level[:stop] >= MIN_RELATIVE_LEVEL * typical)[-1] + 1) * step)
        text = f"{name}: records nothing from {lost_at:.2f} s on, {inside.size - first_silent} axles before the last"
        findings.append(Rejection("sensor_lost", lost_at, None, text, name, time=lost_at))
    return findings


MAX_POSITION_SHIFT = 0.7  # m, largest shift between a wheel's position in a record and the sensor
MAX_NOSE_SHIFT = 2.5  # m, the same in the crossing panel, where the impact at the nose may be louder than the wheel
MIN_CONSISTENT_SHARE, MIN_REPAIRED_SHARE = (
    0.85,
    0.95,
)  # of the correlation with free shifts: below is inconsistent, above is consistent
SMOOTHING_TIME = 0.02  # s, smoothing of the levels


def inconsistent_channels(
    envelopes: SensorEnvelopes, sensors: Sequence[PassageSensor], settings: PassageSettings
) -> tuple[list[Rejection], np.ndarray]:
    """Findings and (n_sensor,) bool of the sensors to keep: channels that make all others disagree.

    They are sought only where no speed correlates the sensors' levels nearly as well as free shifts do. Then every
    exchange of two channels is tried, and every sensor is left out once. The one that helps decisively is reported.
    Fewer than four sensors cannot show which one is wrong.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    sensors : sequence of PassageSensor
        The sensors of ``envelopes``.
    settings : PassageSettings
        Settings of the passage analysis.

    Returns
    -------
    findings : list of Rejection
        "channels_swapped" or "clock_drift", or none.
    keep : (n_sensor,) array of bool
        False for the channels of the finding.
    """
    n = len(sensors)
    keep = np.ones(n, dtype=bool)
    if n < 4:
        return [], keep
    positions = envelopes.positions
    values, step = coarsen(envelopes.levels.values, envelopes.levels.step, 0.005)
    correlations = pair_correlations(values, step, SMOOTHING_TIME)
    slowness = slowness_grid(settings)
    free_correlation = np.mean([p.max() for p in correlations.values()])
    best_correlation = stack_correlations(correlations, step, positions, slowness).max()
    if best_correlation >= MIN_CONSISTENT_SHARE * free_correlation:
        return [], keep
    trials: list[tuple[float, tuple[int, ...]]] = []
    for i, j in correlations:
        changed = positions.astype(float).copy()
        changed[[i, j]] = changed[[j, i]]
        trials.append((stack_correlations(correlations, step, changed, slowness).max(), (i, j)))
    for i in range(n):
        changed = positions.astype(float).copy()
        changed[i] = np.nan
        trials.append((stack_correlations(correlations, step, changed, slowness).max(), (i,)))
    correlation, suspects = max(trials)
    if correlation < MIN_REPAIRED_SHARE * free_correlation:
        return [], keep
    keep[list(suspects)] = False
    names, share = [sensors[i].name for i in suspects], float(best_correlation / free_correlation)
    if len(suspects) == 2:
        text = f"{' and '.join(names)}: each records the train at the other's position"
        return [Rejection("channels_swapped", share, MIN_CONSISTENT_SHARE, text, names[0], names[1])], keep
    text = f"{names[0]}: records the train at another time than its position states"
    return [Rejection("clock_drift", share, MIN_CONSISTENT_SHARE, text, names[0])], keep


def inconsistent_positions(
    envelopes: SensorEnvelopes, motion: Motion, sensors: Sequence[PassageSensor]
) -> tuple[list[Rejection], np.ndarray]:
    """Findings and (n_sensor,) bool of the sensors to keep: small offsets, once the motion is known.

    Each sensor's level along the train is compared with the median of the others, in the first and in the second half.
    A shift that changes is a drifting clock; a constant one is an error of the clock or of the configured position. In
    the crossing panel a constant shift below ``MAX_NOSE_SHIFT`` is no finding: it may be the distance to the nose.
    Fewer than four sensors cannot show which one is wrong.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the train.
    sensors : sequence of PassageSensor
        The sensors of ``envelopes``.

    Returns
    -------
    findings : list of Rejection
        One "clock_drift" per inconsistent sensor.
    keep : (n_sensor,) array of bool
        False for the sensors of the findings.
    """
    n = len(sensors)
    keep = np.ones(n, dtype=bool)
    if n < 4:
        return [], keep
    shifts = half_shifts(envelopes, motion)
    shifts = shifts - np.median(shifts, axis=0)
    mean_shift = shifts.mean(axis=1)
    limits = np.array([MAX_NOSE_SHIFT if s.panel == "CP" else MAX_POSITION_SHIFT for s in sensors])
    is_drifting = np.abs(shifts[:, 1] - shifts[:, 0]) > MAX_POSITION_SHIFT
    suspects = np.flatnonzero((np.abs(mean_shift) > limits) | is_drifting)
    if suspects.size == 0 or suspects.size > n // 2:
        return [], keep
    findings = []
    for i in suspects.tolist():
        first, last = shifts[i] / motion.speed * 1e3
        if is_drifting[i]:
            text = f"{sensors[i].name}: its clock drifts, from {first:.0f} to {last:.0f} ms against the others"
        else:
            text = (
                f"{sensors[i].name}: its clock is off, {mean_shift[i] / motion.speed * 1e3:.0f} ms against the others"
            )
        findings.append(Rejection("clock_drift", float(mean_shift[i]), float(limits[i]), text, sensors[i].name))
        keep[i] = False
    return findings, keep


def half_shifts(envelopes: SensorEnvelopes, motion: Motion, reach: float = 20.0) -> np.ndarray:
    """(n_sensor, 2) shift [m] of each sensor against the others, in the first and second half of the train.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the train.
    reach : float
        Largest shift that is tried, to either side. [m]

    Returns
    -------
    (n_sensor, 2) array of float
        Shift in the first and the second half. [m]
    """
    extent = motion.distance(np.array([envelopes.begin, envelopes.end]))
    middle = motion.direction * np.mean(envelopes.positions)
    start, stop = extent[0] - middle - 30.0, extent[1] - middle + 30.0
    values = along_train(envelopes.levels.values, envelopes.levels.step, envelopes.positions, motion, start, stop)
    values = values - values.mean(axis=1, keepdims=True)
    n, shifts = values.shape[1], np.zeros((len(values), 2))
    lags = np.arange(-int(reach / GRID_STEP), int(reach / GRID_STEP) + 1)
    for k, half in enumerate((slice(0, n // 2), slice(n // 2, n))):
        rows = values[:, half]
        size = 2 ** int(np.ceil(np.log2(2 * rows.shape[1])))
        spectra = np.fft.rfft(rows, size, axis=1)
        for i in range(len(rows)):
            # the median of the others: a second wrong sensor must not affect it
            median_of_others = np.median(np.delete(rows, i, axis=0), axis=0)
            correlation = np.fft.irfft(spectra[i] * np.fft.rfft(median_of_others, size).conj(), size)
            shifts[i, k] = lags[np.argmax(correlation[lags])] * GRID_STEP
    return shifts
