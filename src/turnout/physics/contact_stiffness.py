"""A contact softer or stiffer than Hertz's for the nominal profiles."""

from dataclasses import dataclass, replace

from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.vehicle import one_or_all


@dataclass(frozen=True)
class ContactStiffness(PhysicsTerm):
    r"""The contact's constant is :math:`r k_H`: worn, conformal or sharp profiles."""

    factor: float

    name = "contact_stiffness"
    left_out = "the wheel-rail contact has {factor:.2f} times its stiffness"
    effect_type = "vehicle"
    frame = "train"
    parameters = (
        Parameter("factor", "-", 1.0, (0.1, 5.0), "contact constant over that of nominal profiles",
                  "Thompson 2009, Railway noise and vibration, ch. 3", (1.0, 0.5)),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """Half the stiffness."""
        return cls(0.5)

    def vehicle(self, vehicle):
        """The vehicle with another contact law."""
        self.check()
        laws = [replace(law, stiffness=self.factor * law.stiffness) for law in vehicle.wheel_values("contact")]
        return vehicle.with_(contact=one_or_all(laws))
