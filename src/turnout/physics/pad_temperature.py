"""Pads that soften when warm."""

from dataclasses import dataclass, replace

from turnout.physics.term import Parameter, PhysicsTerm

REFERENCE = 15.0  # °C, temperature of the pads of the base model


@dataclass(frozen=True)
class PadTemperature(PhysicsTerm):
    r"""All pads: :math:`k_p(T) = k_{p0} [1 - \alpha (T - 15\,°C)]`. One temperature cannot separate it from k_p."""

    coefficient: float
    temperature: float = 30.0

    name = "pad_temperature"
    left_out = "pads lose a share of {coefficient:.4f} of their stiffness per kelvin"
    effect_type = "matrix"
    scales_track = True
    frame = "condition"
    parameters = (
        Parameter("coefficient", "1/K", 0.0, (-0.01, 0.04), "relative loss of stiffness per kelvin",
                  "Othman 2022, Extrica 22293: rail pads lose up to 53 % when warm", (0.005, 0.01)),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """1 % per kelvin at 30 °C."""
        return cls(0.01)

    def under_conditions(self, conditions):
        """The term at the rail temperature of a recording; an unknown one is the reference temperature."""
        return replace(self, temperature=float(conditions.get("rail_temperature", REFERENCE)))

    def links(self, track):
        """Links added to every pad."""
        self.check()
        more = max(-self.coefficient * (self.temperature - REFERENCE), -0.95)
        if more == 0.0:
            return []
        pads = [track.pad_link(j) for j in range(track.support.size)]
        return [replace(k, stiffness=more * k.stiffness, damping=0.0, tag="pad_temperature") for k in pads]
