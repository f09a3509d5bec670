"""Accelerations of all channels that are larger or smaller than simulated by one factor: a wrong unit.

In hammer tests the mass of the rail gives the level. In passages it is given by the axle loads and by the track that
the hammer tests show, so it is not judged without them. A fault of one sensor or of one train shows there alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnout.constants import STANDARD_GRAVITY
from turnout.mismatch.turnout.campaign import CampaignInput
from turnout.mismatch.turnout.channel_identity import Comparison, most_agree
from turnout.mismatch.turnout.priors import CHANNELS_CHECK
from turnout.records import Recording

# Ratio of two units that are easily taken for each other, or its inverse -> the two.
UNIT_FACTORS = {STANDARD_GRAVITY: "m/s² and g", 1000.0: "two units that differ by a prefix, as N and kN"}


@dataclass(frozen=True)
class WrongScale:
    """Channels of ``recordings`` ("passages" or "hammer tests") that differ from the simulation by one factor.

    ``ratios`` are recorded over simulated amplitudes by channel, medians over ``n`` recordings.
    """

    recordings: str
    n: int
    ratios: Mapping[str, float]

    @property
    def recording_type(self) -> str:
        """What is wrong, in a word or two."""
        return f"amplitudes of {self.recordings}"

    def __bool__(self) -> bool:
        return bool(self.ratios)

    @property
    def ratio(self) -> float:
        """Median of the ``ratios``. [-]"""
        return float(np.median(list(self.ratios.values())))

    @property
    def cause(self) -> str | None:
        """The two units whose ratio it is, or None."""
        factor = self._nearest_unit_factor
        return None if factor is None else UNIT_FACTORS[max(factor, 1.0 / factor)]

    @property
    def divisor(self) -> float:
        """By which accelerations are divided: the factor of two units that the ratio agrees with, or the ratio. [-]"""
        return self._nearest_unit_factor or self.ratio

    @property
    def _nearest_unit_factor(self) -> float | None:
        nearest = min(UNIT_FACTORS, key=lambda factor: abs(abs(np.log(self.ratio)) - np.log(factor)))
        nearest = nearest if self.ratio > 1.0 else 1.0 / nearest
        return nearest if abs(np.log(self.ratio / nearest)) <= np.log(CHANNELS_CHECK.unit_tolerance) else None

    def sentences(self) -> list[str]:
        """What was found, what was done, and what to do.

        Returns
        -------
        list of str
            One text without its full stop.
        """
        amplitudes = "accelerations over forces" if self.recordings == "hammer tests" else "accelerations"
        low, high = min(self.ratios.values()), max(self.ratios.values())
        loads = "" if self.cause or self.recordings == "hammer tests" else ", or the masses in the vehicle files"
        cause = f"That is the ratio of {self.cause}. " if self.cause else ""
        return [
            f"In the {self.recordings} the {amplitudes} of all {len(self.ratios)} channels are {self.ratio:.3g} times "
            f"those of the simulation (by channel {low:.3g} to {high:.3g}, {self.n} recordings). {cause}"
            f"The diagnosis divides them by {self.divisor:.3g}. "
            f"Correct the units or sensitivities in the layout{loads}"
        ]

    def correct(self, campaign: CampaignInput) -> CampaignInput:
        """The campaign with accelerations on the scale of the simulation.

        Parameters
        ----------
        campaign : CampaignInput
            As the layout describes it.

        Returns
        -------
        CampaignInput
        """
        return campaign.with_recordings(self.recordings, self._correct_recording)

    def _correct_recording(self, recording: Recording) -> Recording:
        is_acceleration = np.array([c.quantity == "acceleration" for c in recording.channels])
        return replace(recording, samples=recording.samples / np.where(is_acceleration, self.divisor, 1.0)[:, None])


def wrong_scale(recordings: str, comparisons: Sequence[Comparison]) -> WrongScale:
    """The factor between recorded and simulated amplitudes, if all channels and recordings share one far from 1.

    Recordings in which most channels do not agree with the simulation do not count.

    Parameters
    ----------
    recordings : str
        "passages" or "hammer tests".
    comparisons : sequence of Comparison
        One per recording.

    Returns
    -------
    WrongScale
        False if the scale is right, or channels or recordings differ.
    """
    comparisons = [c for c in comparisons if most_agree(c.at_best_lag({}), {})]
    values: dict[str, list[float]] = {}
    for comparison in comparisons:
        for channel, ratio in zip(comparison.channels, comparison.ratios):
            values.setdefault(channel, []).append(float(ratio))
    ratios = {channel: float(np.median(r)) for channel, r in values.items()}
    of_recordings = [float(np.median(c.ratios)) for c in comparisons]
    logs, least = np.log(np.maximum([*ratios.values(), *of_recordings], 1e-12)), np.log(_least_factor(recordings))
    is_common = len(ratios) > 1 and np.ptp(logs) <= 2.0 * np.log(CHANNELS_CHECK.scale_spread)
    is_far = is_common and (logs.min() >= least or logs.max() <= -least)
    return WrongScale(recordings, len(comparisons), ratios if is_far else {})


def _least_factor(recordings: str) -> float:
    return CHANNELS_CHECK.min_passage_scale if recordings == "passages" else CHANNELS_CHECK.min_impact_scale
