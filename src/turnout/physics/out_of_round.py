"""A wheel that is not round."""

from dataclasses import dataclass

from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.wheel_path import OutOfRound as Wave

SOURCE = "Nielsen and Johansson 2000, Out-of-round railway wheels - a literature survey"


@dataclass(frozen=True)
class OutOfRound(PhysicsTerm):
    r"""One wheel has n waves around it, :math:`p = a \cos(n x/R) + b \sin(n x/R)`."""

    wheel: int
    cosine: float
    sine: float = 0.0
    order: int = 3
    radius: float = 0.43

    name = "out_of_round"
    left_out = "wheel {number} has {order} waves around it with an amplitude of {amplitude:.2e} m"
    kind = "path"
    frame = "wheel"
    parameters = (
        Parameter("cosine", "m", 0.0, (-1e-3, 1e-3), "amplitude in phase with the place", SOURCE),
        Parameter("sine", "m", 0.0, (-1e-3, 1e-3), "amplitude a quarter wave on", SOURCE),
    )

    @classmethod
    def example(cls):
        """0.2 mm of order 3 on the first wheel."""
        return cls(0, 2e-4, 1e-4)

    def sentence(self):
        """What was left out, in words."""
        amplitude = (self.cosine**2 + self.sine**2) ** 0.5
        return self.left_out.format(number=self.wheel + 1, order=self.order, amplitude=amplitude)

    def paths(self, track, vehicle):
        """Two waves a quarter apart."""
        self.check()
        quarter = 0.5 * 3.141592653589793 * self.radius / self.order
        return (
            Wave(self.wheel, self.cosine, self.order, self.radius),
            Wave(self.wheel, self.sine, self.order, self.radius, phase=quarter),
        )
