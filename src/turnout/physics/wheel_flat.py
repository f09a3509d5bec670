"""A flat on one wheel."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

from turnout.physics.requirement import PASSAGES
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.wheel_path import WheelFlat as FlatPath

if TYPE_CHECKING:
    import numpy as np

    from turnout.simulate.track import Track
    from turnout.simulate.vehicle import Vehicle

SOURCE = "Newton and Clark 1979, An investigation into the dynamic effects on the track of wheelflats"


@dataclass(frozen=True)
class WheelFlat(PhysicsTerm):
    r"""One wheel drops by :math:`l^2/16R` once per revolution; the phase differs between passages.

    ``train`` names the trains that have it ("" all). ``phases`` are the rolling distances to the first flat by
    recording. In a recording that is not among them the phase is unknown, and the term has no effect.
    """

    wheel: int
    length: float
    radius: float = 0.43
    phase: float = 0.0
    train: str = ""
    phases: tuple = ()

    name = "wheel_flat"
    left_out = "wheel {number} of {who} has a flat of {length:.3f} m"
    message = "A wheel on {wheel} has a flat of {length}"
    site_check = "Reprofile the wheelset; no work on the track"
    separating_test = "another passage of this train"
    effect_type = "path"
    frame = "wheel"
    requirements = (PASSAGES,)
    evidence_suffices = True  # that of the impacts in the sound level
    parameters = (
        Parameter("length", "m", 0.0, (0.0, 0.15), "length of the flat along the tread", SOURCE, (0.04, 0.04)),
    )

    @classmethod
    def example(cls) -> Self:
        """50 mm on the first wheel."""
        return cls(0, 0.05)

    def sentence(self) -> str:
        """Sentence that states what was left out."""
        return self.left_out.format(length=self.length, number=self.wheel + 1, who=self.train or "every train")

    def under_conditions(self, conditions: Mapping[str, Any]) -> Self:
        """The term with the phase of a recording; no flat in another train or if the phase is unknown."""
        phases, name = dict(self.phases), conditions.get("name")
        if (self.train and conditions.get("train", self.train) != self.train) or (phases and name not in phases):
            return replace(self, length=0.0)
        return replace(self, phase=phases.get(name, self.phase))

    def paths(self, track: Track | None, vehicle: Vehicle | None) -> Sequence[Callable[..., np.ndarray]]:
        """The path part of that wheel."""
        self.check()
        if self.length == 0.0:
            return ()
        return (FlatPath(self.wheel, self.length, self.radius, self.phase),)
