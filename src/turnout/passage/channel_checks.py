"""Check each channel of a passage before axles are sought in it.

Channels are reported that are clipped, constant or not finite, or drop out, and sensors that are lost during the
passage: they fell off, or their cable broke.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from turnout.records import Recording, Rejection
from turnout.signal.converter import converter_step
from turnout.signal.drop_outs import drop_outs

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

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
    limit = _common_limit([recording.samples[i] for i in rows])
    return tuple(_channel_state(recording.channels[i], recording.samples[i], recording.rate, limit) for i in rows)


def _common_limit(signals: Sequence[np.ndarray]) -> float | None:
    """The value at which at least two channels, and half of them, are clipped: a range that no file states. [m/s²]

    One channel alone may have a fault of its own, which a comparison with the others shows better.
    """
    outcomes = [clipped_share(x, None) for x in signals if np.all(np.isfinite(x)) and np.ptp(x) > 0.0]
    levels = [level for share, level in outcomes if share > 0.0]
    if len(levels) < max(2, len(signals) / 2) or min(levels) < LIMIT_AGREEMENT * max(levels):
        return None
    return float(min(levels))


def _channel_state(channel: Channel, samples: np.ndarray, rate: float, common_limit: float | None) -> ChannelState:
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
    if share == 0.0 and common_limit is not None:
        share, level = clipped_share(samples, common_limit)
    findings = []
    if share > 0:
        text = f"{channel.name}: {100 * share:.3f} % of the samples at ±{level:.4g} m/s²"
        findings.append(Rejection("clipped", share, 0.0, text, channel.name))
    lost_at = silent_from(samples, rate)
    if lost_at is not None:
        text = f"{channel.name}: constant from {lost_at:.2f} s on"
        findings.append(Rejection("sensor_lost", lost_at, None, text, channel.name, time=lost_at))
    if (stretches := drop_outs(samples)).size:
        n, first = int(np.sum(stretches[:, 1] - stretches[:, 0])), float(stretches[0, 0] / rate)
        text = f"{channel.name}: {n} samples, the first at {first:.3f} s"
        findings.append(Rejection("drop_out", float(n), 0.0, text, channel.name, time=first))
    return ChannelState(channel.name, share < 0.2, not findings, tuple(findings), lost_at)


LIMIT_AGREEMENT = 0.98  # least ratio of the limits of channels that share one: gains differ by a percent or two
MIN_CLIPPED_RUN = 3  # equal extreme samples in a row that count as clipped
MIN_CONSTANT_TIME = 0.05  # s, shortest constant end that counts, and length of the start that it is compared with


def clipped_share(samples: np.ndarray, limit: float | None) -> tuple[float, float]:
    """Share of samples at the limit of the channel, and that limit. [-], [m/s²]

    The limit is the configured one (within 0.1 %). Without one it is an extreme value that is repeated
    ``MIN_CLIPPED_RUN`` times in a row, at least twice: noise does not do that, a saturated converter does.

    Parameters
    ----------
    samples : (n_sample,) array of float
        Acceleration. [m/s²]
    limit : float or None
        Range of the channel, None if it is not known. [m/s²]

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
    clipped = np.sum(lengths >= MIN_CLIPPED_RUN) >= 2
    return (float(at_limit.mean()), top) if clipped else (0.0, top)


def silent_from(samples: np.ndarray, rate: float) -> float | None:
    """Time from which a channel is constant up to its end [s], None where it changes to the end.

    A sensor that had this value before the train as well, within one step of its converter, is quiet and not lost.

    Parameters
    ----------
    samples : (n_sample,) array of float
        Acceleration. [m/s²]
    rate : float
        Sampling rate. [Hz]

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
    if len(samples) / rate - last <= MIN_CONSTANT_TIME:
        return None
    start = samples[: max(int(MIN_CONSTANT_TIME * rate), 1)]
    quiet = np.mean(np.abs(start - samples[-1]) < 1.5 * converter_step(samples)) > 0.9
    return None if changes.size and quiet else float(last)


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
