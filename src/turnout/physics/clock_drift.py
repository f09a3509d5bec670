"""A channel whose clock runs fast or slow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from turnout.physics.hypothesis import ChannelSite, Hypothesis
from turnout.physics.requirement import PASSAGES
from turnout.physics.term import Parameter, PhysicsTerm

if TYPE_CHECKING:
    from turnout.simulate.sensor import Sensor

DRIFTS = (2.5e-4, 5e-4, 1e-3, 2e-3, 4e-3)  # relative; a train passes within some seconds
STARTS = tuple((sign * d,) for d in DRIFTS for sign in (1.0, -1.0))


@dataclass(frozen=True)
class ClockDrift(PhysicsTerm):
    r"""The channel shows :math:`y(t(1+\epsilon))`: its lag grows during the record.

    A hammer test is too short to show it.

    ``start`` is the time from the start of the record to the first sample of the signal [s].
    """

    channel_name: str
    drift: float
    start: float = 0.0

    name = "clock_drift"
    left_out = "the clock of channel {channel_name} is off by a share of {drift:.2e}"
    message = "The clock of channel {channel} drifts"
    site_check = "Check the clock of this channel"
    effect_type = "channel"
    frame = "clock"
    requirements = (PASSAGES,)
    site_types = (ChannelSite,)
    column_type = "channel"
    smallest_reportable = 2e-4
    nonlinear_in_size = True
    must_reach_control_level = True
    parameters = (
        Parameter("drift", "-", 0.0, (-5e-3, 5e-3), "relative error of the sampling rate",
                  "IEEE 1139:2008, quartz oscillators: 1e-4 to 1e-6; failing ones more", (0.0, 1e-3)),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """A drift of one in a thousand."""
        return cls("A", 1e-3)

    @classmethod
    def hypotheses(cls, site: ChannelSite) -> Iterator[Hypothesis]:
        """A clock of this channel that is fast or slow; a hammer test is too short to show it."""
        if site.has_passages:
            yield Hypothesis(STARTS, {"channel_name": site.name}, site.where, site.n_sites)

    def under_conditions(self, conditions: Mapping[str, Any]) -> Self:
        """The term with the start time of the signal of this recording."""
        return replace(self, start=float(conditions.get("start", 0.0)))

    def channel(self, signal: np.ndarray, rate: float, sensor: Sensor) -> np.ndarray:
        """The signal at the wrong times, by cubic interpolation."""
        self.check()
        if sensor.name != self.channel_name or self.drift == 0.0:
            return signal
        from scipy.interpolate import CubicSpline

        t = np.arange(np.size(signal))
        return CubicSpline(t, signal)(np.clip(t + self.drift * (self.start * rate + t), 0.0, t[-1]))
