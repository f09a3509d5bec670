"""A sensor on a soft mounting."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import ChannelSite, Hypothesis
from turnout.physics.requirement import IMPACTS
from turnout.physics.term import Parameter
from turnout.physics.transfer import TransferTerm

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SOURCE = "ISO 5348:2021, mechanical mounting of accelerometers: magnets and studs resonate from some hundred Hz on"
STARTS = tuple((1.0 / f, 5.0) for f in np.geomspace(150.0, 1500.0, 12))  # [s, -], one half-power width apart


@dataclass(frozen=True)
class MountResonance(TransferTerm):
    r"""The sensor's mass on its mounting, :math:`T = 1 / (1 - (fT_0)^2 + i f T_0 / Q)`, period :math:`T_0 = 1/f_0`."""

    channel_name: str
    period: float
    quality: float = 10.0

    name = "mount_resonance"
    left_out = "the mounting of channel {channel_name} resonates at {frequency:.0f} Hz with Q {quality:.1f}"
    message = "Sensor {channel} is not fastened firmly: its mounting resonates"
    site_check = "Fasten this sensor again and repeat a hammer test on the rail beside it"
    separating_test = "a hammer test beside this sensor"
    site_types = (ChannelSite,)
    requirements = (IMPACTS,)
    column_type = "channel"
    smallest_reportable = 1 / 2000.0
    component = "channel"
    nonlinear_in_size = True
    parameters = (
        Parameter("period", "s", 0.0, (0.0, 1 / 80.0), "period of the mounting's resonance", SOURCE, (0.002, 0.002)),
        Parameter("quality", "-", 10.0, (1.5, 80.0), "quality factor of the resonance", SOURCE, has_open_ends=True),
    )

    @classmethod
    def example(cls) -> Self:
        """Sensor A resonates at 500 Hz."""
        return cls("A", 1 / 500.0, 8.0)

    @classmethod
    def hypotheses(cls, site: ChannelSite) -> Iterator[Hypothesis]:
        """A damped resonance of this mounting at several frequencies."""
        yield Hypothesis(STARTS, {"channel_name": site.name}, site.where, site.n_sites)

    def sentence(self) -> str:
        """Sentence that states what was left out."""
        frequency = 1.0 / self.period if self.period else np.inf
        return self.left_out.format(**vars(self), frequency=frequency)

    def transfer(self, frequency: ArrayLike) -> np.ndarray:
        """Recorded acceleration over acceleration of the rail."""
        ratio = np.asarray(frequency) * self.period
        return 1.0 / (1.0 - ratio**2 + 1j * ratio / self.quality)
