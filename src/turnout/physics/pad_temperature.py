"""Pads that soften when warm."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

from turnout.physics.hypothesis import Hypothesis, TrackSite
from turnout.physics.requirement import Requirement
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.links import Link

if TYPE_CHECKING:
    from turnout.simulate.track import Track

REFERENCE = 15.0  # °C, temperature of the pads of the base model
STARTS = ((0.01,),)  # 1/K
TWO_TEMPERATURES = Requirement(  # of 4 K: at 1 % per kelvin, 2 % of frequency
    "rail_temperature", "range", 4.0, "rail temperatures are not known, or within 4 K",
    "recordings at a rail temperature 15 K away",
)  # fmt: skip


@dataclass(frozen=True)
class PadTemperature(PhysicsTerm):
    r"""All pads: :math:`k_p(T) = k_{p0} [1 - \alpha (T - 15\,°C)]`. One temperature cannot separate it from k_p."""

    coefficient: float
    temperature: float = 30.0

    name = "pad_temperature"
    left_out = "pads lose a share of {coefficient:.4f} of their stiffness per kelvin"
    left_out_negative = "pads gain a share of {coefficient_size:.4f} of their stiffness per kelvin"
    message = "The rail pads soften by {coefficient} of rail temperature"
    message_negative = "The rail pads stiffen by {coefficient_size} of rail temperature"
    site_check = "No repair: compare only campaigns at the same temperature"
    separating_test = "a hammer test at another rail temperature, 15 K away"
    effect_type = "matrix"
    scales_track = True
    frame = "condition"
    site_types = (TrackSite,)
    column_type = "track"
    smallest_reportable = 1e-3
    prescreen_group = name  # common values of the base model change first to hide it
    requirements = (TWO_TEMPERATURES,)
    parameters = (
        Parameter("coefficient", "1/K", 0.0, (-0.01, 0.04), "relative loss of stiffness per kelvin",
                  "Othman 2022, Extrica 22293: rail pads lose up to 53 % when warm", (0.005, 0.01)),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """1 % per kelvin at 30 °C."""
        return cls(0.01)

    @classmethod
    def hypotheses(cls, site: TrackSite) -> Iterator[Hypothesis]:
        """Pads that soften by a hundredth per kelvin."""
        yield Hypothesis(STARTS)

    def under_conditions(self, conditions: Mapping[str, Any]) -> Self:
        """The term at the rail temperature of a recording; an unknown one is the reference temperature."""
        return replace(self, temperature=float(conditions.get("rail_temperature", REFERENCE)))

    def links(self, track: Track) -> Sequence[Link]:
        """Links added to every pad."""
        self.check()
        more = max(-self.coefficient * (self.temperature - REFERENCE), -0.95)
        if more == 0.0:
            return []
        pads = [track.pad_link(j) for j in range(track.support.size)]
        return [Link(k.ends, more * k.stiffness, 0.0, k.mass, k.loss_factor, "pad_temperature") for k in pads]

    def nuisance_change(self, conditions: Mapping[str, Any]) -> tuple[str, float] | None:
        """Change of the logarithm of the common pad stiffness; None without a known temperature."""
        if "rail_temperature" not in conditions:
            return None
        return "pad_stiffness", -self.coefficient * (conditions["rail_temperature"] - REFERENCE)
