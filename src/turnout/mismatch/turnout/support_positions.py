"""Supports that are not where the track file has them, as the hammer tests show.

A track file states where the first support is and how far apart they are. An error in either moves all supports among
the sensors by the same distance, of up to half a bay. Pads, sleepers and ballast cannot explain that.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from turnout.constants import Z95
from turnout.counts import count_of
from turnout.errors import SimulationError
from turnout.mismatch.engine.fit import Fit
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.mismatch.turnout.campaign import CampaignInput
from turnout.mismatch.turnout.hammer_case import HammerCase
from turnout.mismatch.turnout.observed_tests import HammerStart
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.priors import SUPPORT_POSITIONS


@dataclass(frozen=True)
class MisplacedSupports:
    """The positions of all supports are ``offset`` greater than in the track file [m]; 0: as in the file.

    ``n`` hammer tests show it.
    """

    offset: float
    n: int = 0
    recording_type = "positions of the supports"

    def __bool__(self) -> bool:
        return self.offset != 0.0

    def sentences(self) -> list[str]:
        """What was found, what was done, and what to do.

        Returns
        -------
        list of str
            One text without its full stop.
        """
        comparison, half_width = "greater" if self.offset > 0.0 else "smaller", Z95 * SUPPORT_POSITIONS.offset_sd
        low, high = (100.0 * (abs(self.offset) + sign * half_width) for sign in (-1.0, 1.0))
        return [
            f"The hammer tests agree better with supports at positions that are {100.0 * abs(self.offset):.0f} cm "
            f"({low:.0f} to {high:.0f}, 95 %, {count_of(self.n, 'test')}) {comparison} than in the track file. "
            "The diagnosis takes them there. Measure the distance of sensors and impacts to a sleeper. If sensors and "
            "impacts are where their files have them, change `from` of `extent` in the track file by "
            f"{self.offset:+z.2f} m"
        ]

    def correct(self, campaign: CampaignInput) -> CampaignInput:
        """The campaign on a track whose supports are where the hammer tests agree with them.

        Parameters
        ----------
        campaign : CampaignInput
            As the files describe it.

        Returns
        -------
        CampaignInput
        """
        return replace(campaign, turnout=campaign.turnout.with_moved_supports(self.offset))


class _OffsetFits:
    """Fits to hammer tests with all supports moved; all begin at the same values of the nuisances."""

    def __init__(self, start: HammerStart, reserved: Collection[str]):
        self.predictor, self.values = start.predictor, start.values
        self.pairs = start.tests.frf_pairs
        self.observations = [o for name, o in start.tests.observations if name not in reserved]
        self.fits: dict[float, Fit] = {}

    def fit(self, offset: float) -> Fit:
        """Fit with the supports moved by ``offset``, rounded to 1 cm. [m]"""
        offset = round(offset, 2)
        if offset not in self.fits:
            site = self.predictor.site
            turnout = site.nominal.turnout.with_moved_supports(offset)
            moved = replace(site, nominal=replace(site.nominal, turnout=turnout))
            predictor = Predictor(moved, self.predictor.solver).with_recordings(self.pairs, {})
            predictor.lifting = self.predictor.lifting
            case = HammerCase(predictor, self.observations, moved.shared_nuisances())
            self.fits[offset] = fit_jointly(case, values=self.values, iterations=THRESHOLDS.max_hammer_steps)
        return self.fits[offset]

    def gain(self, offset: float) -> float:
        """Evidence for this offset against none, without the channel that gains most. [nats]

        Supports elsewhere show in every channel. What shows in one is a fault of that channel.
        """
        filed, moved = self.fit(0.0), self.fit(offset)
        by_channel = self._fall_by_channel(offset)
        without_largest = sum(by_channel.values()) - max(by_channel.values())
        return 0.5 * min(filed.cost - moved.cost, without_largest / max(filed.scale.values()) ** 2)

    def _fall_by_channel(self, offset: float) -> dict[str, float]:
        """By how much the sum of squares of each channel falls with the supports moved by ``offset`` [m]."""
        by_channel: dict[str, float] = defaultdict(float)
        for o, before, after in zip(self.observations, self.fit(0.0).white, self.fit(offset).white):
            by_channel[self.pairs[o.name].channel] += float(before @ before - after @ after)
        return by_channel

    def is_shown_by_others(self, offset: float) -> bool:
        """Whether fits without the channel that gains most show this offset too [m].

        A faulty channel distorts the fit of all, so that others seem to agree with it.
        """
        by_channel = self._fall_by_channel(offset)
        leading = max(by_channel, key=lambda channel: by_channel[channel])
        others = copy(self)
        others.observations = [o for o in self.observations if self.pairs[o.name].channel != leading]
        others.fits = {}
        return 0.5 * (others.fit(0.0).cost - others.fit(offset).cost) >= SUPPORT_POSITIONS.min_gain


def misplaced_supports(start: HammerStart, reserved: Collection[str]) -> MisplacedSupports:
    r"""Where the hammer tests have the supports, if that is clearly not where the file has them.

    The evidence is the same for supports that move by a whole bay, so supports elsewhere give one wave in each bay:

    .. math:: E(d) \approx m + A \cos(2 \pi (d - d_0) / b)

    An effect that the fit lacks can give evidence for supports elsewhere as well, but not such a wave.

    Parameters
    ----------
    start : HammerStart
        Fit with the supports of the file.
    reserved : collection of str
        Names of the tests that no fit uses.

    Returns
    -------
    MisplacedSupports
        False if the supports are where the file has them, or if nothing shows where they are: no test, tests of one
        channel, or a blade that supports elsewhere do not carry.
    """
    with suppress(SimulationError):  # the track cannot be simulated with its supports elsewhere
        if start.values:
            fitted = {name for name, _ in start.tests.observations} - set(reserved)
            return MisplacedSupports(_offset(_OffsetFits(start, reserved)), len(fitted))
    return MisplacedSupports(0.0)


def _offset(fits: _OffsetFits) -> float:
    """Distance by which all supports are elsewhere; 0 where that is not clear. [m]"""
    n = SUPPORT_POSITIONS.n_positions
    bay = float(np.median(np.diff(fits.predictor.site.nominal.turnout.track.support)))
    step = bay / n
    if max(fits.gain(step), fits.gain(-step)) < SUPPORT_POSITIONS.min_gain:
        return 0.0
    turns = np.arange(n) / n
    evidence = np.array([fits.gain(bay * (x - round(x))) for x in turns])
    wave = 2.0 * np.mean(evidence * np.exp(2j * np.pi * turns))
    offset = bay * float(np.angle(wave)) / (2.0 * np.pi)
    explained = 0.5 * abs(wave) ** 2 / float(np.var(evidence))
    if explained < SUPPORT_POSITIONS.min_explained or abs(offset) < 0.5 * step:
        return 0.0
    return round(offset, 2) if fits.is_shown_by_others(offset) else 0.0
