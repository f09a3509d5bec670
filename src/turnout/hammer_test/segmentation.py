"""Cut impacts out of recordings, one window each, whether a record holds one impact or many."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import MAD_TO_SD
from turnout.hammer_test.impact_window import Cut
from turnout.records import Recording, Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.receptance import ReceptanceSettings


def cut_impacts(recordings: Sequence[Recording], force: str, response: str, settings: ReceptanceSettings) -> list[Cut]:
    """Every impact of a test, in order; a recording without one gives one cut with that rejection.

    The number ``record`` is the recording's own where each record of its file holds one impact, else the impact's
    number within the file.

    Parameters
    ----------
    recordings : sequence of Recording
        All recordings of the test.
    force, response : str
        Names of the hammer's and the accelerometer's channel.
    settings : ReceptanceSettings
        Trigger, separation and length of the windows.

    Returns
    -------
    list of Cut
        In the order of the recordings.

    Raises
    ------
    KeyError
        A recording has no channel of that name.
    """
    per_recording = [_cut_recording(r, force, response, settings) for r in recordings]
    sources_with_many = {r.source for r, cuts in zip(recordings, per_recording) if len(cuts) > 1}
    count: dict[str, int] = {}
    for recording, cuts in zip(recordings, per_recording):
        for cut in cuts:
            number = count.get(recording.source, 0)
            count[recording.source] = number + 1
            cut.record = number if recording.source in sources_with_many else recording.record
    return [cut for cuts in per_recording for cut in cuts]


def _cut_recording(recording: Recording, force: str, response: str, settings: ReceptanceSettings) -> list[Cut]:
    force_index, response_index = recording.index(force), recording.index(response)
    channels = recording.channels[force_index], recording.channels[response_index]
    f, a = recording.samples[force_index], recording.samples[response_index]
    finite = np.isfinite([f, a])
    if not finite.all():
        f, a = np.where(finite[0], f, 0.0), np.where(finite[1], a, 0.0)
    record = Cut(f, a, recording.rate, 0, 0, 1, 0.0, recording, channels)
    if f.size == 0 or np.ptp(f) == 0.0:
        dead = Rejection("dead_channel", 0.0, None, f"{force} is constant", force)
        record.rejections.append(_not_finite(finite, record) or dead)
        return [record]
    usable = finite.all(axis=0)
    zero = float(np.median(f[usable]))
    f = f - zero
    noise = MAD_TO_SD * float(np.median(np.abs(f[usable])))
    impacts, level = find_triggers(f, noise, recording.rate, settings)
    if not impacts:
        detail = f"the force reaches {np.max(np.abs(f)):.3g} N, an impact would exceed {level:.3g} N"
        silent = Rejection("no_impact", float(np.max(np.abs(f))), level, detail)
        record.rejections.append(_not_finite(finite, record) or silent)
        return [record]
    before = int(settings.pre_trigger * recording.rate)
    after = int(settings.window * recording.rate)
    starts = [max(0, first - before) for first, _ in impacts]
    cuts = []
    for k, (first, last) in enumerate(impacts):
        start = starts[k] if k == 0 else max(starts[k], impacts[k - 1][1] + 1)
        end = min(f.size, first + after, starts[k + 1] if k + 1 < len(impacts) else f.size)
        end = max(end, min(last + 1, f.size))
        window = slice(start, end)
        polarity = 1 if f[first : last + 1].max() >= -f[first : last + 1].min() else -1
        trigger_span = first - start, last - start
        cut = Cut(
            f[window], a[window], recording.rate, *trigger_span, polarity, noise, recording, channels, (zero, 0.0)
        )
        if (rejection := _not_finite(finite[:, window], record, start)) is not None:
            cut.rejections.append(rejection)
        cuts.append(cut)
    return cuts


def _not_finite(finite: np.ndarray, record: Cut, start: int = 0) -> Rejection | None:
    """Rejection of a window from sample ``start`` on in which the force or the response is not finite, else None."""
    bad = np.flatnonzero(~finite.all(axis=0))
    if bad.size == 0:
        return None
    channel, first = record.channels[0 if not finite[0].all() else 1], int(start + bad[0])
    detail = f"{bad.size} samples from {first} on are no numbers"
    return Rejection("not_finite", float(bad.size), 0.0, detail, channel.name, time=first / record.rate)


def find_triggers(
    f: np.ndarray, noise: float, rate: float, settings: ReceptanceSettings
) -> tuple[list[tuple[int, int]], float]:
    """Samples above the trigger of each impact.

    The typical peak is the upper quartile of all candidates, so that neither handling noise nor one overflow shifts
    the trigger.

    Parameters
    ----------
    f : (n_sample,) array of float
        Force without its zero line. [N, or any unit of a force]
    noise : float
        Standard deviation of its noise. [unit of ``f``]
    rate : float
        Sampling rate. [Hz]
    settings : ReceptanceSettings
        Trigger and separation of impacts.

    Returns
    -------
    tuple of (list of (int, int), float)
        First and last sample above the trigger for each impact, and the trigger [unit of ``f``].
    """
    size = np.abs(f)
    level = max(settings.trigger * noise, settings.contact_level * size.max() / 4, np.finfo(float).tiny)
    above = np.flatnonzero(size > level)
    if size.max() <= settings.trigger * noise or above.size == 0:
        return [], settings.trigger * noise
    breaks = np.flatnonzero(np.diff(above) > settings.separation * rate) + 1
    groups = np.split(above, breaks)
    peaks = np.array([size[g].max() for g in groups])
    typical_peak = np.quantile(peaks, 0.75)
    return [
        (int(g[0]), int(g[-1])) for g, p in zip(groups, peaks) if p >= settings.minimum_peak_share * typical_peak
    ], level
