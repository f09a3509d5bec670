"""Pads that stiffen under the train's weight."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

from turnout.physics.hypothesis import Hypothesis, TrackSite
from turnout.physics.requirement import PASSAGES
from turnout.physics.term import Parameter, PhysicsTerm

if TYPE_CHECKING:
    from turnout.simulate.links import Link
    from turnout.simulate.track import Track

SEAT_SHARE = 0.45  # share of a wheel load on the support below it, 60 kg/m rail on 0.6 m spacing
STARTS = ((3e3,),)  # N/m per N


@dataclass(frozen=True)
class PadPreload(PhysicsTerm):
    r"""All pads under a train: :math:`k_p = k_{p0} + b F`, F the mean seat load; F = 0 in a hammer test.

    The stiffness is the tangent at the mean load of the train: supports between bogies are as stiff as those under
    bogies.
    """

    slope: float
    load: float = 25e3

    name = "pad_preload"
    left_out = "pads stiffen by {slope:.0f} N/m per newton of seat load"
    left_out_negative = "pads soften by {slope_size:.0f} N/m per newton of seat load"
    message = "The rail pads stiffen under load"
    message_negative = "The rail pads soften under load"
    site_check = (
        "Do a hammer test on the rail beside a standing train: on unloaded track it shows pads that are too soft"
    )
    separating_test = "a hammer test beside a standing train, or passages of another axle load"
    effect_type = "matrix"
    frame = "condition"
    requirements = (PASSAGES,)
    site_types = (TrackSite,)
    smallest_reportable = 500.0
    parameters = (
        Parameter("slope", "N/m per N", 0.0, (-3e3, 2e4), "growth of pad stiffness with load",
                  "Wu and Thompson 1999, The effects of local preload on the foundation stiffness of railway track"),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """100 MN/m under 25 kN."""
        return cls(4e3)

    @classmethod
    def hypotheses(cls, site: TrackSite) -> Iterator[Hypothesis]:
        """Pads that stiffen under a train; a hammer test has no load."""
        if site.has_passages:
            yield Hypothesis(STARTS)

    def under_conditions(self, conditions: Mapping[str, Any]) -> Self:
        """The term at the load of a recording; without axle loads, as in a hammer test, the load is zero."""
        loads = conditions.get("axle_loads", ())
        mean = sum(loads) / len(loads) / 2.0 if len(loads) else 0.0
        return replace(self, load=SEAT_SHARE * mean)

    def links(self, track: Track) -> Sequence[Link]:
        """Links added to every pad."""
        self.check()
        more = self.slope * self.load
        if more == 0.0:
            return []
        pads = [k for j in range(track.support.size) for k in track.support_links(j) if k.tag == "pad"]
        return [
            replace(k, stiffness=max(more, -0.9 * k.stiffness), damping=0.0, loss_factor=0.0, tag="pad_preload")
            for k in pads
        ]
