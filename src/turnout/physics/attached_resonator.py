"""A part attached to the rail that resonates: absorber, loose clip, guard rail, a mode the base model lacks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import BaySite, Hypothesis, SupportMotion, SupportSite
from turnout.physics.requirement import IMPACTS
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.links import Link

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from turnout.simulate.track import Track

SOURCE = "Den Hartog 1934, Mechanical vibrations, ch. 3: the auxiliary mass"
# [kg, Hz, -]: a light mass on a rail that yields little, and a heavy one that holds it, where its resonance is wider
FREQUENCY_ERROR = 0.02  # a mass between two tested positions; docs/decisions/marginalized-errors.md
NODE_TOLERANCE = 1e-9  # elements within which a position is a node
STARTS = tuple((mass, f, 0.03) for mass in (15.0, 60.0) for f in np.geomspace(60.0, 800.0, 23))


@dataclass(frozen=True)
class AttachedResonator(PhysicsTerm):
    r"""A mass on a spring on the rail, over one support or ``beyond`` it by that share of the bay behind it,
    :math:`\Delta K = -\omega^2 m\,(1 + 2i\zeta r)/(1 - r^2 + 2i\zeta r)`, :math:`r = f/f_0`.

    Between two nodes of the mesh it moves with their interpolated displacement.
    """

    support: int
    mass: float
    frequency: float = 300.0
    damping: float = 0.03
    beyond: float = 0.0

    name = "attached_resonator"
    left_out = "{mass:.1f} kg resonate at {frequency:.0f} Hz on the rail {where}"
    message = "A mass of {mass} on the track at {place} resonates at {frequency}"
    site_check = "Look for parts attached to the rail there: a box, a rod, a heater"
    separating_test = "a hammer test above and beside this place"
    effect_type = "matrix"
    frame = "frequency"
    site_types = (SupportSite, BaySite)
    requirements = (IMPACTS,)
    column_type = "support"
    smallest_reportable = 5.0
    min_significance = 1.0
    parameters = (
        Parameter("mass", "kg", 0.0, (0.0, 150.0), "mass attached to the rail", SOURCE),
        Parameter(
            "frequency",
            "Hz",
            300.0,
            (40.0, 850.0),
            "its resonance on a fixed rail, within the lines",
            SOURCE,
            model_error_share=FREQUENCY_ERROR,
        ),
        Parameter("damping", "-", 0.03, (0.005, 0.3), "its damping ratio", SOURCE),
    )

    @classmethod
    def example(cls) -> Self:
        """20 kg at 250 Hz over support 20."""
        return cls(20, 20.0, 250.0)

    @classmethod
    def hypotheses(cls, site: SupportSite | BaySite) -> Iterator[Hypothesis]:
        """A light and a heavy mass over this support, or at this place of the bay, at several frequencies."""
        if isinstance(site, SupportSite):  # the middles of the bays are tested as well
            yield Hypothesis(STARTS, {"support": site.support}, site.where, 2 * site.n_sites)
        else:
            fixed = {"support": site.support, "beyond": site.share}
            yield Hypothesis(STARTS, fixed, site.where, site.n_positions * site.n_sites)

    def links(self, track: Track) -> Sequence[Link]:
        """Links of an additional degree of freedom at the support."""
        self.check()
        if self.mass == 0.0:
            return []
        omega, node = 2.0 * np.pi * self.frequency, ("resonator", self.support)
        spring = (*self._rail_ends(track), (node, -1.0))
        return [
            Link(spring, self.mass * omega**2, 2.0 * self.damping * omega * self.mass, tag="resonator"),
            Link(((node, 1.0),), mass=self.mass, tag="resonator"),
        ]

    def _rail_ends(self, track: Track) -> tuple[tuple[tuple, float], ...]:
        """Names and weights of the one or two nodes of the rail that carry it."""
        steps = self.beyond * track.elements_per_bay
        first = int(steps + NODE_TOLERANCE)
        share = steps - first
        if share < NODE_TOLERANCE:
            return ((self._rail_node(first, track), 1.0),)
        return (self._rail_node(first, track), 1.0 - share), (self._rail_node(first + 1, track), share)

    def _rail_node(self, steps: int, track: Track) -> tuple:
        """Name of a node of the rail, by its elements from the support."""
        bays, in_bay = divmod(steps, track.elements_per_bay)
        return ("rail", self.support + bays, in_bay) if in_bay else ("rail", self.support + bays)

    @property
    def supports(self) -> range:
        """The support under it, or those on both sides."""
        return range(self.support, self.support + (2 if self.beyond else 1))

    def sentence(self) -> str:
        """Sentence that states what was left out, with the numbers of this term."""
        j = self.support
        where = f"between sleepers {j} and {j + 1}" if self.beyond else f"over sleeper {j}"
        return self._sentence_with(where=where)

    def dynamic_stiffness(self, frequency: ArrayLike) -> np.ndarray:
        """Stiffness that the mass on its spring adds at the rail.

        Parameters
        ----------
        frequency : (n,) array
            Frequencies; an imaginary part damps them. [Hz]

        Returns
        -------
        (n,) array of complex
            Dynamic stiffness. [N/m]
        """
        omega = 2.0 * np.pi * np.asarray(frequency)
        r = omega / (2.0 * np.pi * self.frequency)
        inner = 2j * self.damping * r
        return -(omega**2) * self.mass * (1.0 + inner) / (1.0 - r**2 + inner)

    def pseudo_force(self, motion: SupportMotion) -> tuple[str, np.ndarray]:
        """The inertia of the mass as if it were fixed to the rail, a half on both sides of a bay."""
        return "rail", -self.mass / len(self.supports) * np.gradient(np.gradient(motion.rail)) * motion.rate**2

    def condensed_links(self, track: Track, frequency: np.ndarray) -> list[tuple[tuple, np.ndarray]]:
        """The stiffness of mass and spring at the rail."""
        return [(self._rail_ends(track), self.dynamic_stiffness(frequency))]
