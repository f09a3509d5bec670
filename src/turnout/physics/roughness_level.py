"""A rail rougher than the base model's."""

from collections.abc import Callable
from dataclasses import dataclass

from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.roughness import roughness

SEED_STREAM = 1  # second element of its seed; the roughness of the base model uses the seed alone


@dataclass(frozen=True)
class Scaled:
    """A path times a number."""

    path: Callable
    amount: float

    def __call__(self, x, wheel=0):
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
    effect_type = "path"
    frame = "place"
    parameters = (
        Parameter("amplitude", "-", 0.0, (0.0, 30.0), "amplitude over that of the limit curve",
                  "ISO 3095:2013, limit curve of rail roughness"),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """The amplitude of the limit curve."""
        return cls(1.0)

    def paths(self, track, vehicle):
        """One realisation."""
        self.check()
        if self.amplitude == 0.0:
            return ()
        return (Scaled(roughness(track.start - 5.0, track.end + 5.0, [self.seed, SEED_STREAM]), self.amplitude),)
