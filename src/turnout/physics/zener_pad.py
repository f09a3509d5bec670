"""Pads that stiffen with frequency: a spring and damper in series beside each pad."""

from dataclasses import dataclass

import numpy as np

from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.links import Link

SOURCE = "Knothe and Grassie 1993, Modelling of railway track and vehicle/track interaction at high frequencies"


@dataclass(frozen=True)
class ZenerPad(PhysicsTerm):
    r"""A Maxwell branch parallel to every pad; its spring is a share of the pad stiffness.

    .. math:: \tilde k(\omega) = k_p + i \omega c_p + r k_p \frac{i \omega \tau}{1 + i \omega \tau}

    One additional degree of freedom per pad: the joint of damper :math:`r k_p \tau` and spring :math:`r k_p`.
    """

    ratio: float
    relaxation_time: float = 5e-4

    name = "zener_pad"
    left_out = "pads stiffen by {ratio:.2f} of their static stiffness above 1/(2 pi {relaxation_time:.2g} s)"
    effect_type = "matrix"
    frame = "frequency"
    parameters = (
        Parameter("ratio", "-", 0.0, (0.0, 10.0), "stiffness of the branch over the pad's static stiffness", SOURCE),
    )

    @classmethod
    def example(cls):
        """A branch with the stiffness of the pad."""
        return cls(1.0)

    def links(self, track):
        """Spring from sleeper to joint and damper from joint to rail, at every support."""
        self.check()
        if self.ratio == 0.0:
            return ()
        links = []
        for j in range(track.support.size):
            stiffness = self.ratio * track.pad_stiffness[j]
            joint = (("zener", j), 1.0)
            below = () if track.layers == 1 else ((("sleeper", j), -1.0),)
            links.append(Link((joint, *below), stiffness, tag="zener"))
            damping = stiffness * self.relaxation_time
            links.append(Link(((("rail", j), 1.0), (("zener", j), -1.0)), damping=damping, tag="zener"))
        return links

    def dynamic_stiffness(self, track, frequency, support=0):
        """(n,) complex stiffness of one pad with its branch [N/m]."""
        i_omega = 2j * np.pi * np.asarray(frequency)
        k, c = track.pad_stiffness[support], track.pad_damping[support]
        branch = self.ratio * k * i_omega * self.relaxation_time / (1.0 + i_omega * self.relaxation_time)
        return k + i_omega * c + branch
