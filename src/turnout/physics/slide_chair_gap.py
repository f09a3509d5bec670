"""A slide chair that a blade does not touch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from turnout.physics.hypothesis import BladeSite, Hypothesis
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.force_laws import Port, TableLaw

if TYPE_CHECKING:
    from turnout.simulate.track import Track

ONSET = 1e-5  # m, deflection over which the damping of the chair sets in
LIFT_OFF = 0.1  # m; no blade rises further
STARTS = ((5e-4,), (2e-3,))  # m; a train closes the first and hardly the second


@dataclass(frozen=True)
class SlideChairGap(PhysicsTerm):
    r"""Remove the reaction of one slide chair until the blade has closed the gap g.

    .. math:: F = \max(0, W + k (y - g)) - \max(0, W - k g) - k y - c \dot y\,[W + k (y - g) < 0]

    y is the displacement of the blade against the bearer from rest, down positive, W the weight of the blade over a
    bay. The base simulation has :math:`k y + c \dot y` there, and g = 0 its contact without pull. A worn, displaced or
    missing chair plate leaves the blade to its neighbours, which wear and break. Without a blade on this support it
    adds nothing.
    """

    support: int
    gap: float

    name = "slide_chair_gap"
    left_out = "the blade has a clearance of {gap:.4f} m over the slide chair on support {support}"
    message = "The blade has a clearance of {gap} over the slide chair at {place}"
    message_unbounded = "The blade does not touch the slide chair at {place} under any train here"
    site_check = "Look whether the blade touches this slide chair; adjust or replace the plate"
    separating_test = "a hammer test on the blade above this chair and above its neighbours"
    effect_type = "port"
    frame = "place"
    site_types = (BladeSite,)
    column_type = "link"
    prescreen_group = "chair"  # the base model changes ballast and pads first to hide it
    smallest_reportable = 2e-4
    component = "chair"
    nonlinear_in_size = True
    parameters = (
        Parameter("gap", "m", 0.0, (0.0, 6e-3), "clearance between unloaded blade and slide chair",
                  "Rama and Andrews 2013, A reliability analysis of railway switches; limits of 1 to 3 mm"),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """0.1 mm over support 20."""
        return cls(20, 1e-4)

    @classmethod
    def hypotheses(cls, site: BladeSite) -> Iterator[Hypothesis]:
        """A clearance at each slide chair near the sensors."""
        for support, place in site.slide_chairs:
            where = {"sleeper": support, "place": place}
            yield Hypothesis(STARTS, {"support": support}, where, len(site.slide_chairs))

    def ports(self, track: Track) -> Sequence[Port]:
        """One port between blade and bearer; it stands for the contact of this chair."""
        self.check()
        if self.gap == 0.0 or track.blade is None or self.support not in track.blade.slide_chairs(track):
            return ()
        chair = track.blade.chair_link(self.support)
        k, c = chair.stiffness, chair.damping
        load = track.blade.chair_load(track)
        closed, preload = self.gap - load / k, max(0.0, load - k * self.gap)
        deflection = (-LIFT_OFF, closed - ONSET, closed, closed + ONSET, LIFT_OFF)
        missing = tuple(max(0.0, k * (y - closed)) - preload - k * y for y in deflection)
        law = TableLaw(deflection, missing, (-c, -c, -0.5 * c, 0.0, 0.0))
        return (Port(chair.ends, law, label=f"gap over slide chair {self.support}"),)
