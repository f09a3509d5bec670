"""Wheels heavier or lighter than the vehicle file says."""

from dataclasses import dataclass, replace

from turnout.physics.term import Parameter, PhysicsTerm


@dataclass(frozen=True)
class UnsprungMass(PhysicsTerm):
    r"""All wheelsets have :math:`r` times their mass; the P2 frequency scales with :math:`1/\sqrt r`."""

    factor: float
    train: str = ""

    name = "unsprung_mass"
    left_out = "wheelsets of {who} have {factor:.2f} times their mass"
    effect_type = "vehicle"
    frame = "train"
    parameters = (
        Parameter("factor", "-", 1.0, (0.4, 2.5), "unsprung mass over that of the vehicle file",
                  "Jenkins et al. 1974, The effect of track and vehicle parameters on wheel/rail vertical forces",
                  (1.0, 0.3)),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """30 % more mass."""
        return cls(1.3)

    def sentence(self):
        """Sentence that states what was left out."""
        return self.left_out.format(factor=self.factor, who=self.train or "all trains")

    def under_conditions(self, conditions):
        """The same term; no effect in another train."""
        other_train = self.train and conditions.get("train", self.train) != self.train
        return replace(self, factor=1.0) if other_train else self

    def vehicle(self, vehicle):
        """The vehicle with changed wheel masses."""
        self.check()
        wheels = set(vehicle.wheels)
        bodies = tuple(
            replace(b, mass=self.factor * b.mass) if i in wheels else b for i, b in enumerate(vehicle.bodies)
        )
        return vehicle.with_(bodies=bodies)
