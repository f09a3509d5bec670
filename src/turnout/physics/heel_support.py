"""Loose or stiff fastenings at the heel of a blade."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

from turnout.physics.hypothesis import BladeSite, Hypothesis
from turnout.physics.term import Parameter, PhysicsTerm

if TYPE_CHECKING:
    from turnout.simulate.links import Link
    from turnout.simulate.track import Track

N_SUPPORTS = 2  # fastenings behind the heel that are loose together


@dataclass(frozen=True)
class HeelSupport(PhysicsTerm):
    r"""The fastenings of the blade at its heel have :math:`r` times their stiffness; damping goes as :math:`\sqrt r`.

    A heel is the first place where a blade is held, so its fastenings and fishplates carry the moment of the free part
    and come loose. ``first`` to ``last`` are the supports; without a blade on them it adds nothing.
    """

    first: int
    last: int
    factor: float

    name = "heel_support"
    left_out = "the fastenings of the blade on supports {first} to {last} have {factor:.2f} times their stiffness"
    message = "The fastenings of the heel of the blade at {place} are {factor} times as stiff as they should be"
    site_check = "Check the fastenings, fishplates and pads at the heel of the blade"
    separating_test = "a hammer test on the blade at its heel"
    effect_type = "matrix"
    frame = "place"
    site_types = (BladeSite,)
    column_type = "link"
    prescreen_group = name  # the base model changes ballast and pads first to hide it
    smallest_reportable = 0.3
    component = "heel"
    parameters = (
        Parameter("factor", "-", 1.0, (0.02, 8.0), "stiffness of the heel's fastenings over that of the base model",
                  "Kassa and Nielsen 2009, Dynamic train-turnout interaction; range as of rail pads", (1.0, 1.5)),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """A tenth of the stiffness on supports 21 and 22."""
        return cls(21, 22, 0.1)

    @classmethod
    def hypotheses(cls, site: BladeSite) -> Iterator[Hypothesis]:
        """The first fastenings behind the heel."""
        fastened = site.heel_supports[:N_SUPPORTS]
        if fastened:
            numbers = sorted(support for support, _ in fastened)
            fixed = {"first": numbers[0], "last": numbers[-1]}
            yield Hypothesis(((0.3,),), fixed, {"place": fastened[0][1]})

    def links(self, track: Track) -> Sequence[Link]:
        """Links added to the spring and damper between blade and bearers."""
        self.check()
        if track.blade is None:
            return []
        chairs = [track.blade.chair_link(j) for j in track.blade.chairs(track) if self.first <= j <= self.last]
        more, slower = self.factor - 1.0, self.factor**0.5 - 1.0
        return [replace(k, stiffness=more * k.stiffness, damping=slower * k.damping, tag="heel") for k in chairs]
