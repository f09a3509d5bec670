"""A dip in the running surface: crossing nose, joint, weld, squat."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import ContactSite, Hypothesis
from turnout.physics.requirement import PASSAGES
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.wheel_path import Cosine, Kink

if TYPE_CHECKING:
    from turnout.simulate.track import Track
    from turnout.simulate.vehicle import Vehicle

SOURCE = "Jenkins et al. 1974, The effect of track and vehicle parameters on wheel/rail vertical dynamic forces"
STARTS = ((6e-4, 0.5, 0.5, 0.0), (-4e-4, 0.5, 0.5, 0.0))  # [m, m, -, m], a dip and a bump
POSITION_STEP = 0.6  # m, between dip positions; the shift parameter covers positions in between
SHAPE_ERROR = 0.15  # rms widths of a V, a cosine and a cusp are 0.204, 0.181 and 0.158 of their length: 29 % at most
START_MARGIN, STOP_MARGIN = 1.8, 1.81  # m, of positions beyond the sensors; the last step is included


@dataclass(frozen=True)
class SurfaceDip(PhysicsTerm):
    r"""Every wheel falls by :math:`d` over a length L, :math:`p = d[(1-s)\cos^2(\pi x/L) + s\,(1 - 2|x|/L)^2]`.

    ``sharpness`` s goes from a smooth cosine (0) to a kink (1), so that the data determine the shape.
    """

    place: float
    depth: float
    length: float = 0.6
    sharpness: float = 0.5
    shift: float = 0.0

    name = "surface_dip"
    left_out = "the running surface dips by {depth:.5f} m over {length:.2f} m near {place:.2f} m"
    left_out_negative = "the running surface rises by {depth_size:.5f} m over {length:.2f} m near {place:.2f} m"
    message = "The running surface has a dip of {depth} over {length} at {place}"
    message_negative = "The running surface has a hump of {depth_size} over {length} at {place}"
    site_check = "Measure the running surface there with a straightedge; weld or grind"
    separating_test = "passages at another speed"
    effect_type = "path"
    frame = "place"
    requirements = (PASSAGES,)
    site_types = (ContactSite,)
    column_type = "path"
    smallest_reportable = 3e-5
    parameters = (
        Parameter("depth", "m", 0.0, (-3e-3, 6e-3), "depth of the dip, negative a bump", SOURCE, (0.0, 1e-3)),
        Parameter("length", "m", 0.6, (0.1, 2.0), "length of the dip", SOURCE, model_error_share=SHAPE_ERROR),
        Parameter("sharpness", "-", 0.5, (0.0, 1.0), "share of a kink in its shape", SOURCE),
        Parameter("shift", "m", 0.0, (-0.5, 0.5), "shift from the tested position", SOURCE),
    )

    @classmethod
    def example(cls) -> Self:
        """1 mm over 0.5 m at 12 m."""
        return cls(12.0, 1e-3, 0.5)

    @classmethod
    def hypotheses(cls, site: ContactSite) -> Iterator[Hypothesis]:
        """A dip or a bump at positions all along the sensors."""
        positions = site.sensor_positions
        grid = np.arange(min(positions) - START_MARGIN, max(positions) + STOP_MARGIN, POSITION_STEP)
        for x in grid:
            yield Hypothesis(STARTS, {"place": float(x)}, {"place": round(float(x), 3)}, grid.size)

    @property
    def deepest_position(self) -> float:
        """Position of the lowest point [m]."""
        return self.place + self.shift

    def sentence(self) -> str:
        """Sentence that states what was left out."""
        return self._sentence_with(place=self.deepest_position)

    def paths(self, track: Track | None, vehicle: Vehicle | None) -> Sequence[Callable[..., np.ndarray]]:
        """A cosine and a kink of the same length."""
        self.check()
        if self.depth == 0.0:
            return ()
        smooth = Cosine(self.deepest_position, (1.0 - self.sharpness) * self.depth, self.length)
        return smooth, Kink(self.deepest_position, self.sharpness * self.depth, self.length)
