"""A rail rougher than the base model's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.roughness import roughness

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike

    from turnout.simulate.track import Track
    from turnout.simulate.vehicle import Vehicle

SEED_STREAM = 1  # second element of its seed; the roughness of the base model uses the seed alone


@dataclass(frozen=True)
class Scaled:
    """A path times a number."""

    path: Callable
    amount: float

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        return self.amount * self.path(x, wheel)


@dataclass(frozen=True)
class RoughnessLevel(PhysicsTerm):
    r"""Additional roughness with the spectrum of ISO 3095, its amplitude :math:`a` times that of the limit curve.

    A random effect, not a defect: it widens the null distribution, and only its level is reported.
    """

    amplitude: float
    seed: int = 0

    name = "roughness_level"
    left_out = "rail roughness has {amplitude:.2f} times the amplitude of the limit curve on top"
    message = "The rail is {amplitude} times as rough as the limit curve"
    site_check = "Measure the roughness of the rail; grind"
    effect_type = "path"
    frame = "place"
    asked = False
    parameters = (
        Parameter("amplitude", "-", 0.0, (0.0, 30.0), "amplitude over that of the limit curve",
                  "ISO 3095:2013, limit curve of rail roughness"),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """The amplitude of the limit curve."""
        return cls(1.0)

    def paths(self, track: Track | None, vehicle: Vehicle | None) -> Sequence[Callable[..., np.ndarray]]:
        """One realisation."""
        self.check()
        if self.amplitude == 0.0:
            return ()
        assert track is not None
        return (Scaled(roughness(track.start - 5.0, track.end + 5.0, [self.seed, SEED_STREAM]), self.amplitude),)
