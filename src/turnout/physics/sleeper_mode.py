"""Sleepers that bend: the first mode of every sleeper beside its rigid motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import Hypothesis, TrackSite
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.links import Link

if TYPE_CHECKING:
    from turnout.simulate.track import Track

SOURCE = "Grassie and Cox 1984, The dynamic response of railway track with flexible sleepers"
STARTS = tuple((0.25, f) for f in np.geomspace(85.0, 760.0, 20))  # [-, Hz], two widths of the resonance apart


@dataclass(frozen=True)
class SleeperMode(PhysicsTerm):
    r"""A share :math:`\mu` of each sleeper's mass on a spring on its rail seat, resonant at its bending frequency.

    The mode of a sleeper with fixed rail seats (Craig and Bampton). The total mass is still that of the sleeper.
    """

    share: float
    frequency: float = 180.0
    damping: float = 0.03

    name = "sleeper_mode"
    left_out = "sleepers bend at {frequency:.0f} Hz with a share of {share:.2f} of their mass"
    message = "The sleepers have a bending resonance at {frequency}"
    site_check = "Check the sleeper type in the track file"
    effect_type = "matrix"
    frame = "frequency"
    site_types = (TrackSite,)
    column_type = "track"
    smallest_reportable = 0.05
    prescreen_group = name  # common values of the base model change first to hide it
    parameters = (
        Parameter("share", "-", 0.0, (0.0, 0.95), "modal mass over half the sleeper's mass", SOURCE),
        Parameter("frequency", "Hz", 180.0, (80.0, 800.0), "resonance with the rail seats held", SOURCE),
    )

    @classmethod
    def example(cls) -> Self:
        """A quarter of the mass at 200 Hz."""
        return cls(0.25, 200.0)

    @classmethod
    def hypotheses(cls, site: TrackSite) -> Iterator[Hypothesis]:
        """A quarter of the mass at several frequencies."""
        yield Hypothesis(STARTS)

    def links(self, track: Track) -> Sequence[Link]:
        """Links of an additional degree of freedom for every sleeper."""
        self.check()
        if self.share == 0.0 or track.layers == 1:
            return []
        links, omega = [], 2.0 * np.pi * self.frequency
        for j in range(track.support.size):
            mass, node = self.share * track.sleeper_mass[j], ("sleeper_mode", j)
            spring = ((("sleeper", j), 1.0), (node, -1.0))
            links.append(Link(spring, mass * omega**2, 2.0 * self.damping * omega * mass, tag="sleeper_mode"))
            links.append(Link(((node, 1.0),), mass=mass, tag="sleeper_mode"))
            links.append(Link(((("sleeper", j), 1.0),), mass=-mass, tag="sleeper_mode"))
        return links
