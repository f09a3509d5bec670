"""A wheel that is not round."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

from turnout.physics.requirement import PASSAGES
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.wheel_path import OutOfRound as Wave

if TYPE_CHECKING:
    import numpy as np

    from turnout.simulate.track import Track
    from turnout.simulate.vehicle import Vehicle

SOURCE = "Nielsen and Johansson 2000, Out-of-round railway wheels - a literature survey"
MIN_AMPLITUDE = 2e-5  # m, smallest reported amplitude


@dataclass(frozen=True)
class OutOfRound(PhysicsTerm):
    r"""One wheel has n waves around it, :math:`p = a \cos(n (x - x_0)/R) + b \sin(n (x - x_0)/R)`.

    ``train`` names the trains that have it ("" all). ``phases`` are the rolling distances :math:`x_0` [m] by recording:
    the angle of a wheel differs between passages. In a recording that is not among them the term has no effect.
    """

    wheel: int
    cosine: float
    sine: float = 0.0
    order: int = 3
    radius: float = 0.43
    train: str = ""
    phases: tuple = ()
    turned: float = 0.0

    name = "out_of_round"
    left_out = "wheel {number} of {who} has {order} waves around it with an amplitude of {amplitude:.2e} m"
    message = "A wheel on {wheel} is out of round: {order} waves around it with an amplitude of {cosine_size}"
    site_check = "Measure the run-out of this wheelset; no work on the track"
    effect_type = "path"
    frame = "wheel"
    requirements = (PASSAGES,)
    parameters = (
        Parameter("cosine", "m", 0.0, (-1e-3, 1e-3), "cosine amplitude of the out-of-roundness", SOURCE),
        Parameter("sine", "m", 0.0, (-1e-3, 1e-3), "sine amplitude of the out-of-roundness", SOURCE),
        Parameter("turned", "-", 0.0, (-0.03, 0.03), "relative error of the nominal radius", SOURCE, (0.0, 0.005)),
    )

    @classmethod
    def example(cls) -> Self:
        """0.2 mm of order 3 on the first wheel."""
        return cls(0, 2e-4, 1e-4)

    def sentence(self) -> str:
        """Sentence that states what was left out."""
        amplitude = (self.cosine**2 + self.sine**2) ** 0.5
        who = self.train or "every train"
        return self.left_out.format(number=self.wheel + 1, who=who, order=self.order, amplitude=amplitude)

    def under_conditions(self, conditions: Mapping[str, Any]) -> Self:
        """The term with the phase of a recording; no effect in another train or if the phase is unknown."""
        phases, name = dict(self.phases), conditions.get("name")
        if (self.train and conditions.get("train", self.train) != self.train) or (phases and name not in phases):
            return replace(self, cosine=0.0, sine=0.0)
        return replace(self, phases=((name, phases[name]),)) if phases else self

    def paths(self, track: Track | None, vehicle: Vehicle | None) -> Sequence[Callable[..., np.ndarray]]:
        """Two waves a quarter wave apart."""
        self.check()
        if self.cosine == 0.0 and self.sine == 0.0:
            return ()
        radius = self.radius * (1.0 + self.turned)
        quarter = 0.5 * 3.141592653589793 * radius / self.order
        start = self.phases[0][1] if self.phases else 0.0
        return (
            Wave(self.wheel, self.cosine, self.order, radius, start),
            Wave(self.wheel, self.sine, self.order, radius, start + quarter),
        )
