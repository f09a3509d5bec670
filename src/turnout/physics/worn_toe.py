"""A blade that is worn or chipped near its toe."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import BladeSite, Hypothesis
from turnout.physics.requirement import PASSAGES
from turnout.physics.term import Parameter, PhysicsTerm

if TYPE_CHECKING:
    from turnout.simulate.track import Track
    from turnout.simulate.vehicle import Vehicle

STARTS = ((1e-3, 0.8, 0.0),)  # [m, m, m]


@dataclass(frozen=True)
class BladeLoss:
    """Loss of height of the blade, full over half the length and faded with a cosine at both ends."""

    middle: float
    depth: float
    length: float
    on_blade = True

    def __call__(self, x: np.ndarray, wheel: int = 0) -> np.ndarray:
        s = np.clip(4.0 * np.abs(np.asarray(x) - self.middle) / self.length - 1.0, 0.0, 1.0)
        return 0.5 * self.depth * (1.0 + np.cos(np.pi * s))


@dataclass(frozen=True)
class WornToe(PhysicsTerm):
    r"""The top of the blade lies :math:`d` lower over a length L where wheels come onto it.

    A wheel then stays longer on the stock rail, sinks further and meets the blade at a larger angle. Short and deep is
    a chip, long and shallow is wear. Wheels on the stock rail are not affected, so the dip that they see is not d.
    """

    place: float
    depth: float
    length: float = 0.8
    shift: float = 0.0

    name = "worn_toe"
    left_out = "the blade has lost {depth:.5f} m of its height over {length:.2f} m near {place:.2f} m"
    message = "The blade is worn or chipped by {depth} over {length} at {place}"
    site_check = "Measure the profile of the blade there against the stock rail; grind, build up or replace it"
    separating_test = "passages at another speed"
    effect_type = "path"
    frame = "place"
    requirements = (PASSAGES,)
    site_types = (BladeSite,)
    smallest_reportable = 2e-4
    nonlinear_in_size = True
    parameters = (
        Parameter("depth", "m", 0.0, (0.0, 8e-3), "height that the top of the blade has lost",
                  "EN 13232-9 2006, limits of wear of switches; from memory", (0.0, 2e-3)),
        Parameter("length", "m", 0.8, (0.1, 3.0), "length of the worn part", "as the depth, EN 13232-9 2006"),
        Parameter("shift", "m", 0.0, (-1.0, 1.0), "shift from the tested position", "as the depth, EN 13232-9 2006"),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """2 mm over 1 m at 12 m."""
        return cls(12.0, 2e-3, 1.0)

    @classmethod
    def hypotheses(cls, site: BladeSite) -> Iterator[Hypothesis]:
        """Wear where wheels change to the blade."""
        if site.has_passages and site.transfer is not None:
            yield Hypothesis(STARTS, {"place": site.transfer}, {"place": round(site.transfer, 3)})

    @property
    def middle(self) -> float:
        """Middle of the worn part [m]."""
        return self.place + self.shift

    def sentence(self) -> str:
        """Sentence that states what was left out."""
        return self._sentence_with(place=self.middle)

    def paths(self, track: Track | None, vehicle: Vehicle | None) -> Sequence[Callable[..., np.ndarray]]:
        """One part of the path on the blade."""
        self.check()
        return () if self.depth == 0.0 else (BladeLoss(self.middle, self.depth, self.length),)
