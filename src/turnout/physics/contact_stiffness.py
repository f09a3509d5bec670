"""A wheel-rail contact softer or stiffer than the Hertz contact of the nominal profiles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

from turnout.physics.hypothesis import ContactSite, Hypothesis
from turnout.physics.requirement import PASSAGES
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.vehicle import one_or_all

if TYPE_CHECKING:
    from turnout.simulate.vehicle import Vehicle

STARTS = ((0.5,),)  # times the stiffness


@dataclass(frozen=True)
class ContactStiffness(PhysicsTerm):
    r"""The contact's constant is :math:`r k_H`: worn, conformal or sharp profiles."""

    factor: float

    name = "contact_stiffness"
    left_out = "the wheel-rail contact has {factor:.2f} times its stiffness"
    message = "The contact of wheel and rail is {factor} times as stiff as that of the nominal profiles"
    site_check = "Measure the profiles of rail and wheels"
    effect_type = "vehicle"
    frame = "train"
    requirements = (PASSAGES,)
    site_types = (ContactSite,)
    smallest_reportable = 0.1
    parameters = (
        Parameter("factor", "-", 1.0, (0.1, 5.0), "contact constant over that of nominal profiles",
                  "Thompson 2009, Railway noise and vibration, ch. 3", (1.0, 0.5)),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """Half the stiffness."""
        return cls(0.5)

    @classmethod
    def hypotheses(cls, site: ContactSite) -> Iterator[Hypothesis]:
        """A softer contact of all wheels."""
        yield Hypothesis(STARTS)

    def vehicle(self, vehicle: Vehicle) -> Vehicle:
        """The vehicle with another contact law."""
        self.check()
        laws = [replace(law, stiffness=self.factor * law.stiffness) for law in vehicle.wheel_values("contact")]
        return vehicle.with_(contact=one_or_all(laws))
