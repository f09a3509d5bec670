"""Wheelsets heavier or lighter than in the vehicle file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from turnout.physics.hypothesis import Hypothesis, Masking, TrainSite
from turnout.physics.requirement import PASSAGES
from turnout.physics.term import Parameter, PhysicsTerm

if TYPE_CHECKING:
    from turnout.simulate.vehicle import Vehicle

STARTS = ((1.4,), (0.7,))  # times the mass of the file
MASKING_SD = 0.3  # of the logarithm of the mass


@dataclass(frozen=True)
class UnsprungMass(PhysicsTerm):
    r"""All wheelsets have :math:`r` times their mass; the P2 frequency scales with :math:`1/\sqrt r`."""

    factor: float
    train: str = ""

    name = "unsprung_mass"
    left_out = "wheelsets of {who} have {factor:.2f} times their mass"
    message = "The wheelsets of {train} are {factor} times as heavy as in the vehicle file"
    site_check = "Check the vehicle file of this train"
    effect_type = "vehicle"
    frame = "train"
    requirements = (PASSAGES,)
    site_types = (TrainSite,)
    column_type = "track"
    smallest_reportable = 0.07
    distant_starts = (0.65, 1.3, 1.6, 2.0)  # the P2 frequency changes by an eighth from one to the next
    parameters = (
        Parameter("factor", "-", 1.0, (0.4, 2.5), "unsprung mass over that of the vehicle file",
                  "Jenkins et al. 1974, The effect of track and vehicle parameters on wheel/rail vertical forces",
                  (1.0, 0.3)),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """30 % more mass."""
        return cls(1.3)

    @classmethod
    def hypotheses(cls, site: TrainSite) -> Iterator[Hypothesis]:
        """Heavier or lighter wheelsets of this train; the base model may have fitted them in a narrow range."""
        masking = Masking(f"wheels_{site.train}", MASKING_SD, same_quantity=True)
        yield Hypothesis(STARTS, {"train": site.train}, site.where, site.n_sites, masking=masking)

    def sentence(self) -> str:
        """Sentence that states what was left out."""
        return self.left_out.format(factor=self.factor, who=self.train or "all trains")

    def under_conditions(self, conditions: Mapping[str, Any]) -> Self:
        """The same term; no effect in another train."""
        other_train = self.train and conditions.get("train", self.train) != self.train
        return replace(self, factor=1.0) if other_train else self

    def vehicle(self, vehicle: Vehicle) -> Vehicle:
        """The vehicle with changed wheel masses."""
        self.check()
        wheels = set(vehicle.wheels)
        bodies = tuple(
            replace(b, mass=self.factor * b.mass) if i in wheels else b for i, b in enumerate(vehicle.bodies)
        )
        return vehicle.with_(bodies=bodies)

    def nuisance_change(self, conditions: Mapping[str, Any]) -> tuple[str, float] | None:
        """Change of the logarithm of the train's wheel masses; None in another train."""
        if conditions["train"] != self.train:
            return None
        return f"wheels_{self.train}", np.log(self.factor)  # double precision, and so its product with a column
