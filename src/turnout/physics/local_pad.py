"""A worn, missing or stiff pad on one sleeper."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import Hypothesis, Masking, SupportMotion, SupportSite
from turnout.physics.requirement import IMPACTS
from turnout.physics.term import Parameter, PhysicsTerm

if TYPE_CHECKING:
    from turnout.simulate.links import Link
    from turnout.simulate.track import Track

STARTS = ((0.4,), (2.5,))  # softer and stiffer


@dataclass(frozen=True)
class LocalPad(PhysicsTerm):
    r"""Pad stiffness of one support is :math:`r` times that of the base.

    The damping ratio is constant, so the damper :math:`c = 2 \zeta \sqrt{k m}` scales with :math:`\sqrt{r}`.
    """

    sleeper: int
    factor: float

    name = "local_pad"
    left_out = "the pad on sleeper {sleeper} has {factor:.2f} times its stiffness"
    message = "The rail pad on the sleeper at {place} is {factor} times as stiff as its neighbours'"
    site_check = "Remove and inspect the pad of this sleeper"
    separating_test = "a hammer test at this sleeper and at its neighbours"
    effect_type = "matrix"
    scales_track = True
    frame = "place"
    site_types = (SupportSite,)
    requirements = (IMPACTS,)
    column_type = "support"
    smallest_reportable = 0.15
    component = "pad"
    prescreen_group = "pad"
    parameters = (
        Parameter("factor", "-", 1.0, (0.05, 8.0), "pad stiffness over that of the base model",
                  "Oregui et al. 2016, Sensitivity analysis of railpad parameters on vertical railway track dynamics",
                  (1.0, 1.5)),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """A worn pad with three times the stiffness on sleeper 20."""
        return cls(20, 3.0)

    @classmethod
    def hypotheses(cls, site: SupportSite) -> Iterator[Hypothesis]:
        """A softer or stiffer pad on this sleeper; the base model may have fitted it as a scatter of supports."""
        masking = Masking(f"pad_{site.support}")
        yield Hypothesis(STARTS, {"sleeper": site.support}, site.where, site.n_sites, masking=masking)

    def links(self, track: Track) -> Sequence[Link]:
        """Links added to the spring and damper of the pad."""
        self.check()
        springs = [link for link in track.support_links(self.sleeper) if link.tag == "pad"]
        more = self.factor - 1.0
        slower = self.factor**0.5 - 1.0
        return [replace(k, stiffness=more * k.stiffness, damping=slower * k.damping, tag="local_pad") for k in springs]

    def pseudo_force(self, motion: SupportMotion) -> tuple[str, np.ndarray]:
        """The force of the added stiffness between rail and sleeper."""
        return "pad", -(self.factor - 1.0) * motion.pad_stiffness * (motion.rail - motion.sleeper)
