"""Ballast under one sleeper that is softer or stiffer than the rest."""

from dataclasses import dataclass, replace

from turnout.physics.term import Parameter, PhysicsTerm


@dataclass(frozen=True)
class LocalBallast(PhysicsTerm):
    r"""Ballast stiffness of one sleeper is :math:`r` times that of the base; linear, unlike a gap.

    The damping ratio is constant, so the damper :math:`c = 2 \zeta \sqrt{k m}` scales with :math:`\sqrt{r}`.
    """

    sleeper: int
    factor: float

    name = "local_ballast"
    left_out = "the ballast under sleeper {sleeper} has {factor:.2f} times its stiffness"
    effect_type = "matrix"
    scales_track = True
    frame = "place"
    parameters = (
        Parameter("factor", "-", 1.0, (0.05, 8.0), "ballast stiffness over that of the base model",
                  "Oscarsson 2002, Dynamic train-track interaction: variability attributable to scatter in properties",
                  (1.0, 1.5)),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """A third of the stiffness under sleeper 20."""
        return cls(20, 0.3)

    def links(self, track):
        """Links added to the spring and damper of the ballast."""
        self.check()
        springs = [link for link in track.support_links(self.sleeper) if link.tag == "ballast"]
        more = self.factor - 1.0
        slower = self.factor**0.5 - 1.0
        return [
            replace(k, stiffness=more * k.stiffness, damping=slower * k.damping, tag="local_ballast") for k in springs
        ]
