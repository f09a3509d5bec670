"""What each channel of a passage is worth before anything is sought in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnout.records import Recording, Rejection


@dataclass(frozen=True)
class ChannelState:
    """``usable`` for timing and axles; ``sound`` also for fits. ``until`` [s] is where a lost sensor fell silent."""

    name: str
    usable: bool
    sound: bool
    findings: tuple[Rejection, ...] = ()
    until: float | None = None


def channel_states(recording: Recording) -> tuple[ChannelState, ...]:
    """State of every acceleration channel, in the order of ``recording.of_quantity("acceleration")``."""
    rows = recording.of_quantity("acceleration")
    return tuple(_state(recording.channels[i], recording.samples[i], recording.rate) for i in rows)


def _state(channel, samples, rate) -> ChannelState:
    if not np.all(np.isfinite(samples)):
        bad = np.flatnonzero(~np.isfinite(samples))
        found = Rejection("not_finite", float(bad.size), 0.0, f"{channel.name}: first at {bad[0] / rate:.3f} s")
        return ChannelState(channel.name, False, False, (found,))
    spread = float(np.ptp(samples))
    if spread == 0.0:
        return ChannelState(channel.name, False, False, (Rejection("dead_channel", 0.0, 0.0, channel.name),))
    share, level = clipped_share(samples, channel.limit)
    findings = []
    if share > 0:
        text = f"{channel.name}: {100 * share:.3f} % of the samples at ±{level:.4g} m/s²"
        findings.append(Rejection("clipped", share, 0.0, text))
    silent = silent_from(samples, rate)
    if silent is not None:
        text = f"{channel.name}: constant from {silent:.2f} s on"
        findings.append(Rejection("sensor_lost", silent, None, text))
    return ChannelState(channel.name, share < 0.2, not findings, tuple(findings), silent)


def clipped_share(samples, limit: float | None, run: int = 3) -> tuple[float, float]:
    """Share of samples at the rail, and the rail. [-], [m/s²]

    At the configured ``limit`` (within 0.1 %), or, where none is given, at an extreme value that is repeated
    ``run`` times in a row at least twice: noise does not do that, a converter at its end does.

    >>> y = np.sin(np.linspace(0, 20, 400))
    >>> share, level = clipped_share(np.clip(y, -0.8, 0.8), None)
    >>> print(f"{share:.2f} at {level:.1f}")
    0.40 at 0.8
    >>> clipped_share(y, None)[0]
    0.0
    """
    top = float(np.max(np.abs(samples)))
    if limit is not None:
        at = np.abs(samples) >= 0.999 * limit
        return float(at.mean()), float(limit)
    at = np.abs(samples) >= top * (1 - 1e-6)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(int), [0]])))
    lengths = edges[1::2] - edges[::2]
    clipped = np.sum(lengths >= run) >= 2
    return (float(at.mean()), top) if clipped else (0.0, top)


def silent_from(samples, rate: float, block: float = 0.05) -> float | None:
    """Time from which a channel is constant up to its end [s], None where it lives to the end.

    A sensor that already stood there before the train, within one step of its converter, is quiet and not lost.

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


def converter_step(samples) -> float:
    """Smallest change from one sample to the next: a converter's step, or next to nothing; 0 where nothing changes."""
    change = np.abs(np.diff(samples))
    return float(np.min(change, where=change > 0, initial=np.inf)) if change.any() else 0.0
