"""Pads that stiffen with frequency: a spring and damper in series beside each pad."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import Hypothesis, TrackSite
from turnout.physics.requirement import IMPACTS
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.links import Link

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from turnout.simulate.track import Track

SOURCE = "Knothe and Grassie 1993, Modelling of railway track and vehicle/track interaction at high frequencies"
STARTS = ((0.4,),)  # of the static stiffness


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
    message = "The rail pads are stiffer at high frequency than at low"
    site_check = "Obtain the dynamic stiffness of these pads; test one in the laboratory"
    separating_test = "a hammer test with a hard tip up to 1.2 kHz"
    effect_type = "matrix"
    frame = "frequency"
    site_types = (TrackSite,)
    requirements = (IMPACTS,)
    column_type = "track"
    smallest_reportable = 0.1
    prescreen_group = name  # common values of the base model change first to hide it
    parameters = (
        Parameter(
            "ratio",
            "-",
            0.0,
            (0.0, 10.0),
            "stiffness added at high frequency, over the static one",
            SOURCE,
        ),
    )

    @classmethod
    def example(cls) -> Self:
        """A branch with the stiffness of the pad."""
        return cls(1.0)

    @classmethod
    def hypotheses(cls, site: TrackSite) -> Iterator[Hypothesis]:
        """A branch of some tenths of the pad's stiffness."""
        yield Hypothesis(STARTS)

    def links(self, track: Track) -> Sequence[Link]:
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

    def dynamic_stiffness(self, track: Track, frequency: ArrayLike, support: int = 0) -> np.ndarray:
        """Stiffness of one pad with its branch.

        Parameters
        ----------
        track : Track
            The track without the effect.
        frequency : (n,) array of float
            Frequencies. [Hz]
        support : int
            Number of the support.

        Returns
        -------
        (n,) array of complex
            Dynamic stiffness. [N/m]
        """
        i_omega = 2j * np.pi * np.asarray(frequency)
        k, c = track.pad_stiffness[support], track.pad_damping[support]
        branch = self.ratio * k * i_omega * self.relaxation_time / (1.0 + i_omega * self.relaxation_time)
        return k + i_omega * c + branch
