"""Which sensor each channel records: channels that are exchanged, and channels that record no train and no impact.

A channel is compared with the simulation at every sensor. It correlates by 0.6 or more with that of its own sensor,
also if track, wheels or sensors have any known fault, and by less than 0.5 with that of any other.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from turnout.mismatch.turnout.campaign import CampaignInput
from turnout.mismatch.turnout.priors import CHANNELS_CHECK
from turnout.records import Recording


@dataclass(frozen=True)
class Comparison:
    """Correlations of the channels of one recording with the simulation at the sensors.

    ``channels`` are the names of the rows of ``correlations`` (n_channel, n_sensor, n_lag), ``sensors`` those of its
    columns. A hammer test has one lag. ``ratios`` (n_channel,) are recorded over simulated amplitudes of each channel
    with its own sensor.
    """

    channels: tuple[str, ...]
    sensors: tuple[str, ...]
    correlations: np.ndarray
    ratios: np.ndarray

    def at_best_lag(self, sensor_of: Mapping[str, str]) -> dict[tuple[str, str], float]:
        """Correlation of each channel with each sensor, at the lag where the channels fit the ``sensor_of`` them best.

        Parameters
        ----------
        sensor_of : mapping of str to str
            Channel -> sensor that it records; itself where it is left out.

        Returns
        -------
        dict
            (channel, sensor) -> correlation.
        """
        rows = range(len(self.channels))
        columns = [self.sensors.index(sensor_of.get(c, c)) for c in self.channels]
        total = self.correlations[rows, columns].sum(axis=0)
        at_lag = self.correlations[:, :, int(np.argmax(total))]
        return {(c, s): float(at_lag[i, j]) for i, c in enumerate(self.channels) for j, s in enumerate(self.sensors)}


@dataclass(frozen=True)
class ChannelFaults:
    """Channels that do not record their sensor, in recordings of one ``recording_type`` ("passages" or "hammer tests").

    ``sensor_of`` are exchanged channels, each with the sensor that it records. ``unrelated`` are channels that record
    nothing of what the others do, with their correlation. ``inverted`` are channels of the wrong polarity, with theirs.
    ``n`` is the number of recordings compared.
    """

    recording_type: str
    n: int
    sensor_of: Mapping[str, str]
    unrelated: Mapping[str, float] = field(default_factory=dict)
    inverted: Mapping[str, float] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.sensor_of or self.unrelated or self.inverted)

    def sentences(self) -> list[str]:
        """What was found, what was done, and what to do.

        Returns
        -------
        list of str
            One text without its full stop for exchanged channels, and one for each unrelated or inverted one.
        """
        texts = []
        if self.sensor_of:
            pairs = ", ".join(f"{c} records sensor {s}" for c, s in sorted(self.sensor_of.items()))
            texts.append(
                f"In the {self.recording_type} channels are exchanged: {pairs}. The diagnosis names them by the "
                "sensors that they record. Correct the layout, or the cables at the logger"
            )
        texts += [
            f"In the {self.recording_type} channel {c} does not record what the other channels do: its correlation "
            f"with the simulation at its sensor is {r:.2f}, and at least {CHANNELS_CHECK.same_sensor:g} is usual. It "
            "was not used. Check the sensor, its cable and 'source' of this channel in the layout"
            for c, r in sorted(self.unrelated.items())
        ]
        texts += [
            f"In the {self.recording_type} channel {c} has the wrong polarity, and in other recordings the right one: "
            f"its correlation with the simulation at its sensor is {r:.2f}. The diagnosis inverts it. Check the cable "
            "of this channel, and the sign of its sensitivity in the layout"
            for c, r in sorted(self.inverted.items())
        ]
        return texts

    def correct(self, campaign: CampaignInput) -> CampaignInput:
        """The campaign with exchanged channels named by their sensors, inverted ones inverted, without unrelated ones.

        Parameters
        ----------
        campaign : CampaignInput
            As the layout describes it.

        Returns
        -------
        CampaignInput
        """
        position_of = {s.name: s.place for s in campaign.sensors}
        return campaign.with_recordings(self.recording_type, lambda r: self._correct_recording(r, position_of))

    def _correct_recording(self, recording: Recording, position_of: Mapping[str, float]) -> Recording:
        rows = [i for i, c in enumerate(recording.channels) if c.name not in self.unrelated]
        channels = [recording.channels[i] for i in rows]
        renamed = (
            replace(c, name=self.sensor_of[c.name], position=position_of[self.sensor_of[c.name]])
            if c.name in self.sensor_of
            else c
            for c in channels
        )
        signs = np.array([-1.0 if c.name in self.inverted else 1.0 for c in channels])
        return replace(recording, samples=signs[:, None] * recording.samples[rows], channels=tuple(renamed))


def channel_faults(
    recording_type: str, comparisons: Sequence[Comparison], upright: Container[str] = ()
) -> ChannelFaults:
    """Channels that do not record their sensor: exchanged ones, inverted ones, and those without a trace of the train.

    A channel that is inverted in all recordings is none of them: that is a fault of its sensor, which has a name.

    Parameters
    ----------
    recording_type : str
        Of the recordings: "passages".
    comparisons : sequence of Comparison
        One per recording.
    upright : container of str
        Channels that have the right polarity in other recordings.

    Returns
    -------
    ChannelFaults
        False if there are none.
    """
    exchanged = exchanged_channels(recording_type, comparisons)
    correlations = typical_correlations(comparisons, exchanged.sensor_of)
    unrelated = {
        c: r
        for (c, s), r in correlations.items()
        if c == s and c not in exchanged.sensor_of and abs(r) < CHANNELS_CHECK.other_sensor
    }
    inverted = {
        c: r
        for (c, s), r in correlations.items()
        if c == s and c not in exchanged.sensor_of and c in upright and r <= -CHANNELS_CHECK.same_sensor
    }
    return replace(exchanged, unrelated=unrelated, inverted=inverted)


def exchanged_channels(recording_type: str, comparisons: Sequence[Comparison]) -> ChannelFaults:
    """Channels that record each other's sensor.

    Parameters
    ----------
    recording_type : str
        Of the recordings: "passages" or "hammer tests".
    comparisons : sequence of Comparison
        One per recording.

    Returns
    -------
    ChannelFaults
        False if there are none.
    """
    sensor_of = _best_assignment(comparisons)
    correlations = typical_correlations(comparisons, sensor_of)
    is_certain = all(
        correlations.get((c, s), 0.0)
        >= max(CHANNELS_CHECK.same_sensor, correlations.get((c, c), 1.0) + CHANNELS_CHECK.min_gain)
        for c, s in sensor_of.items()
    )
    return ChannelFaults(recording_type, len(comparisons), sensor_of if is_certain else {})


def typical_correlations(
    comparisons: Sequence[Comparison], sensor_of: Mapping[str, str]
) -> dict[tuple[str, str], float]:
    """Median correlation of each (channel, sensor) over the recordings in which most channels agree with a sensor.

    Parameters
    ----------
    comparisons : sequence of Comparison
        One per recording.
    sensor_of : mapping of str to str
        Channel -> sensor that it records; itself where it is left out.

    Returns
    -------
    dict
        (channel, sensor) -> correlation.
    """
    values: dict[tuple[str, str], list[float]] = {}
    for comparison in comparisons:
        at_lag = comparison.at_best_lag(sensor_of)
        if most_agree(at_lag, sensor_of):
            for pair, r in at_lag.items():
                values.setdefault(pair, []).append(r)
    return {pair: float(np.median(r)) for pair, r in values.items()}


def most_agree(correlations: Mapping[tuple[str, str], float], sensor_of: Mapping[str, str]) -> bool:
    """Whether more than half of the channels, with either polarity, agree with their sensors: the train is known.

    Parameters
    ----------
    correlations : mapping
        (channel, sensor) -> correlation.
    sensor_of : mapping of str to str
        Channel -> sensor that it records; itself where it is left out.

    Returns
    -------
    bool
    """
    channels = {channel for channel, _ in correlations}
    agreeing = [c for c in channels if abs(correlations[c, sensor_of.get(c, c)]) >= CHANNELS_CHECK.same_sensor]
    return 2 * len(agreeing) > len(channels)


def _best_assignment(comparisons: Iterable[Comparison]) -> dict[str, str]:
    """Channel -> other sensor that it records, by exchanges of two that raise the sum of all correlations most."""
    comparisons = list(comparisons)
    compared_with_all = [set(c.sensors) for c in comparisons]
    names = sorted(set.intersection(*compared_with_all)) if comparisons else []
    sensor_of = dict[str, str]()
    best_total = _total(comparisons, sensor_of)
    while True:
        trials = []
        for a, b in combinations(names, 2):
            trial = sensor_of | {a: sensor_of.get(b, b), b: sensor_of.get(a, a)}
            trials.append((_total(comparisons, trial), trial))
        total, trial = max(trials, key=lambda t: t[0], default=(best_total, {}))
        if total <= best_total + CHANNELS_CHECK.min_gain * len(comparisons):
            return {c: s for c, s in sensor_of.items() if c != s}
        best_total, sensor_of = total, trial


def _total(comparisons: Iterable[Comparison], sensor_of: Mapping[str, str]) -> float:
    """Sum of the correlations of all channels with their sensors, each recording at its best lag."""
    total = 0.0
    for comparison in comparisons:
        at_lag = comparison.at_best_lag(sensor_of)
        total += sum(at_lag[c, sensor_of.get(c, c)] for c in comparison.channels)
    return total
