"""A part on the rail that swings by itself: absorber, loose clip, guard rail, a mode the base model lacks."""

from dataclasses import dataclass

import numpy as np

from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.links import Link

SOURCE = "Den Hartog 1934, Mechanical vibrations, ch. 3: the auxiliary mass"


@dataclass(frozen=True)
class AttachedResonator(PhysicsTerm):
    r"""A mass on a spring on the rail over one support,
    :math:`\Delta K = -\omega^2 m\,(1 + 2i\zeta r)/(1 - r^2 + 2i\zeta r)`, :math:`r = f/f_0`."""

    support: int
    mass: float
    frequency: float = 300.0
    damping: float = 0.03

    name = "attached_resonator"
    left_out = "{mass:.1f} kg resonate at {frequency:.0f} Hz on the rail over sleeper {support}"
    effect_type = "matrix"
    frame = "frequency"
    parameters = (
        Parameter("mass", "kg", 0.0, (0.0, 150.0), "mass that swings on the rail", SOURCE),
        Parameter("frequency", "Hz", 300.0, (40.0, 1200.0), "its resonance on a fixed rail", SOURCE),
        Parameter("damping", "-", 0.03, (0.005, 0.3), "its damping ratio", SOURCE),
    )

    @classmethod
    def example(cls):
        """20 kg at 250 Hz over support 20."""
        return cls(20, 20.0, 250.0)

    def links(self, track):
        """Links of an additional degree of freedom at the support."""
        self.check()
        if self.mass == 0.0:
            return []
        omega, node = 2.0 * np.pi * self.frequency, ("resonator", self.support)
        spring = ((("rail", self.support), 1.0), (node, -1.0))
        return [
            Link(spring, self.mass * omega**2, 2.0 * self.damping * omega * self.mass, tag="resonator"),
            Link(((node, 1.0),), mass=self.mass, tag="resonator"),
        ]

    def dynamic_stiffness(self, frequency):
        """(n,) complex stiffness added at the rail [N/m]."""
        omega = 2.0 * np.pi * np.asarray(frequency)
        r = omega / (2.0 * np.pi * self.frequency)
        inner = 2j * self.damping * r
        return -(omega**2) * self.mass * (1.0 + inner) / (1.0 - r**2 + inner)
