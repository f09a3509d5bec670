"""A channel that clips."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import ChannelSite, Hypothesis, SaturatedChannelSite
from turnout.physics.term import Parameter, PhysicsTerm

if TYPE_CHECKING:
    from turnout.simulate.sensor import Sensor

START_SHARES = (0.05, 0.2, 0.5)  # from the largest recorded value (0) to twice the band's peak (1)
LIMIT_SD = 0.4  # prior sd of a limit in use, as a share of the band's peak


@dataclass(frozen=True)
class Clipping(PhysicsTerm):
    r"""The channel shows :math:`\mathrm{clip}(y, -L, L)` without a warning."""

    channel_name: str
    limit: float

    name = "clipping"
    left_out = "channel {channel_name} clips at {limit:.3g} m/s²"
    message = "Channel {channel} is cut off at {limit}"
    site_check = "Increase the range of this channel"
    effect_type = "channel"
    frame = "sensor"
    site_types = (ChannelSite, SaturatedChannelSite)
    column_type = "channel"
    model_error_share = 0.0
    nonlinear_in_size = True
    parameters = (
        Parameter("limit", "m/s²", 1e5, (0.01, 1e5), "largest recorded value",
                  "IEC 61260-1:2014 and data sheets of accelerometers: 50 to 5000 g"),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """Clips at 2 m/s²."""
        return cls("A", 2.0)

    @classmethod
    def hypotheses(cls, site: ChannelSite | SaturatedChannelSite) -> Iterator[Hypothesis]:
        """A limit below the peak of this channel in the band, or that of a channel which is not used for it.

        At twice the peak a limit has no effect. It is never below a value that the channel has recorded. The limit of a
        saturated channel is known from its peaks, not from a fit.
        """
        (limit,) = cls.parameters
        fixed = {"channel_name": site.name}
        if isinstance(site, SaturatedChannelSite):
            parameters = (replace(limit, prior=(site.limit, site.limit_sd)),)
            yield Hypothesis(
                ((site.limit,),),
                fixed,
                site.where,
                parameters=parameters,
                promise=site.evidence,
                external_evidence=site.evidence,
            )
            return
        peak, lowest, unlimited = site.band_peak, site.lowest_limit, 2.0 * site.band_peak
        if not site.has_passages or peak <= 0.0 or lowest >= unlimited:
            return
        prior = (peak, LIMIT_SD * peak)
        parameters = (replace(limit, neutral=unlimited, bounds=(lowest, unlimited), prior=prior),)
        starts = tuple((lowest + share * (unlimited - lowest),) for share in START_SHARES)
        yield Hypothesis(starts, fixed, site.where, site.n_sites, parameters)

    def channel(self, signal: np.ndarray, rate: float, sensor: Sensor) -> np.ndarray:
        """The clipped signal."""
        self.check()
        return np.clip(signal, -self.limit, self.limit) if sensor.name == self.channel_name else signal
