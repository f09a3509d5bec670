"""Mains or traction current in a channel."""

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

MAINS = 50.0  # [Hz]
START_SHARE = 0.1  # of the channel's peak in the band


@dataclass(frozen=True)
class Hum(PhysicsTerm):
    r"""A spectral line at the mains frequency, also without a train.

    .. math:: a \sin(2 \pi f t + \varphi) + b \cos(2 \pi f t + \varphi)

    ``start`` is the time from the start of the record to the first sample of the signal [s]. ``phase`` is the phase of
    the line at the start of the record [rad], which differs from record to record.
    """

    channel_name: str
    sine: float
    cosine: float = 0.0
    frequency: float = MAINS
    start: float = 0.0
    phase: float = 0.0

    name = "hum"
    left_out = "channel {channel_name} hums at {frequency:.1f} Hz with an amplitude of {amplitude:.3g} m/s²"
    message = "Channel {channel} contains hum of mains or traction current"
    site_check = "Check shielding and grounding of this channel"
    effect_type = "channel"
    frame = "clock"
    requirements = (PASSAGES,)
    site_types = (ChannelSite,)
    column_type = "channel"
    n_size_parameters = 2
    parameters = (
        Parameter("sine", "m/s²", 0.0, (-50.0, 50.0), "part in phase with the line where no wheel is near",
                  "EN 50163:2004, supply voltages of traction systems: 50 Hz and 16.7 Hz"),
        Parameter("cosine", "m/s²", 0.0, (-50.0, 50.0), "part a quarter period ahead", "EN 50163:2004"),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """1 m/s² at 50 Hz."""
        return cls("A", 0.8, 0.6)

    @classmethod
    def hypotheses(cls, site: ChannelSite) -> Iterator[Hypothesis]:
        """A line of a tenth of this channel's peak in the passages."""
        if site.has_passages and site.band_peak > 0.0:
            yield Hypothesis(
                ((START_SHARE * site.band_peak, 0.0),),
                {"channel_name": site.name},
                site.where,
                site.n_sites,
                smallest_reportable=site.material_amplitude,
            )

    def sentence(self) -> str:
        """Sentence that states what was left out."""
        return self.left_out.format(**vars(self), amplitude=float(np.hypot(self.sine, self.cosine)))

    def under_conditions(self, conditions: Mapping[str, Any]) -> Self:
        """The term with the start time of the signal of this recording, and the line of its channel there.

        ``conditions["hum_lines"]`` has the frequency [Hz] and phase [rad] of each channel; others have the nominal
        frequency and phase 0.
        """
        frequency, phase = conditions.get("hum_lines", {}).get(self.channel_name, (self.frequency, 0.0))
        return replace(self, start=float(conditions.get("start", 0.0)), frequency=frequency, phase=phase)

    def channel(self, signal: np.ndarray, rate: float, sensor: Sensor) -> np.ndarray:
        """The signal with the line added."""
        self.check()
        if sensor.name != self.channel_name:
            return signal
        phase = 2.0 * np.pi * self.frequency * (self.start + np.arange(np.size(signal)) / rate) + self.phase
        return signal + self.sine * np.sin(phase) + self.cosine * np.cos(phase)
