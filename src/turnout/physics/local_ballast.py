"""Ballast under one sleeper that is softer or stiffer than the rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import Hypothesis, Masking, SupportMotion, SupportSite
from turnout.physics.term import Parameter, PhysicsTerm

if TYPE_CHECKING:
    from turnout.simulate.links import Link
    from turnout.simulate.track import Track

STARTS = ((0.4,), (2.5,))  # softer and stiffer


@dataclass(frozen=True)
class LocalBallast(PhysicsTerm):
    r"""Ballast stiffness of one sleeper is :math:`r` times that of the base; linear, unlike a gap.

    The damping ratio is constant, so the damper :math:`c = 2 \zeta \sqrt{k m}` scales with :math:`\sqrt{r}`.
    """

    sleeper: int
    factor: float

    name = "local_ballast"
    left_out = "the ballast under sleeper {sleeper} has {factor:.2f} times its stiffness"
    message = "The ballast under the sleeper at {place} is {factor} times as stiff as its neighbours'"
    site_check = "Compare the ballast of this sleeper with its neighbours'; tamp or drain"
    separating_test = "passages of a lighter and a heavier train"
    effect_type = "matrix"
    scales_track = True
    frame = "place"
    site_types = (SupportSite,)
    column_type = "support"
    smallest_reportable = 0.15
    component = "ballast"
    prescreen_group = "ballast"
    limit_form = "hanging_sleeper"  # without stiffness it acts as a gap that no train closes
    parameters = (
        Parameter("factor", "-", 1.0, (0.05, 8.0), "ballast stiffness over that of the base model",
                  "Oscarsson 2002, Dynamic train-track interaction: variability attributable to scatter in properties",
                  (1.0, 1.5)),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """A third of the stiffness under sleeper 20."""
        return cls(20, 0.3)

    @classmethod
    def hypotheses(cls, site: SupportSite) -> Iterator[Hypothesis]:
        """Softer or stiffer ballast under this sleeper; the base model may have fitted it as a scatter of supports."""
        masking = Masking(f"ballast_{site.support}")
        yield Hypothesis(STARTS, {"sleeper": site.support}, site.where, site.n_sites, masking=masking)

    def links(self, track: Track) -> Sequence[Link]:
        """Links added to the spring and damper of the ballast."""
        self.check()
        springs = [link for link in track.support_links(self.sleeper) if link.tag == "ballast"]
        more = self.factor - 1.0
        slower = self.factor**0.5 - 1.0
        return [
            replace(k, stiffness=more * k.stiffness, damping=slower * k.damping, tag="local_ballast") for k in springs
        ]

    def pseudo_force(self, motion: SupportMotion) -> tuple[str, np.ndarray]:
        """The force of the added stiffness on the sleeper."""
        return "sleeper", -(self.factor - 1.0) * motion.ballast_stiffness * motion.sleeper
