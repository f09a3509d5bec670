"""Corrugation on a stretch of rail."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import ContactSite, Hypothesis
from turnout.physics.requirement import PASSAGES, Requirement
from turnout.physics.term import Parameter, PhysicsTerm

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from turnout.simulate.track import Track
    from turnout.simulate.vehicle import Vehicle

SOURCE = "Grassie 2009, Rail corrugation: characteristics, causes and treatments"
WAVELENGTHS = (0.3, 0.6)  # m, of the starts
N_INDEPENDENT = 4  # distinguishable wavelengths in that range
START_AMPLITUDE, SENSOR_MARGIN = 3e-5, 3.0  # m; corrugated rail beyond the sensors
MIN_AMPLITUDE = 1e-5  # m, smallest reported amplitude of short waves: EN 13231-3 allows it on a ground rail up to 0.3 m
SHORT = "corrugation shorter than 0.3 m"  # found by its level, see docs/decisions/short-wave-corrugation.md
TWO_TRAINS = Requirement(  # they distinguish the rail from wheels
    "train", "count", 2, "all passages are of one train", "passages of another train", SHORT)  # fmt: skip
TWO_SPEEDS = Requirement(  # they distinguish a wavelength from a frequency
    "speed", "ratio", 1.25, "all trains had about one speed", "passages at speeds a quarter apart", SHORT)  # fmt: skip


@dataclass(frozen=True)
class Waves:
    """Two waves a quarter wave apart between two positions, faded at both ends; see ``RailCorrugation``."""

    start: float
    end: float
    sine: float
    cosine: float
    wavelength: float
    fade: float

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        x = np.asarray(x, dtype=float)
        phase = 2.0 * np.pi * (x - self.start) / self.wavelength
        return fade_envelope(x, self.start, self.end, self.fade) * (
            self.sine * np.sin(phase) + self.cosine * np.cos(phase)
        )


def fade_envelope(x: np.ndarray, start: float, end: float, length: float) -> np.ndarray:
    """Envelope of waves that grow and fade over a ``length`` [m] at both ends of a stretch.

    Parameters
    ----------
    x : (n,) array of float
        Positions. [m]
    start, end : float
        Of the stretch. [m]
    length : float
        [m]

    Returns
    -------
    (n,) array of float
        0 to 1.
    """
    share = np.clip(np.minimum(x - start, end - x) / length, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


@dataclass(frozen=True)
class RailCorrugation(PhysicsTerm):
    r"""Every wheel rolls over a wave :math:`a \sin 2\pi x/\lambda + b \cos 2\pi x/\lambda`: a line at v/λ."""

    start: float
    end: float
    sine: float
    cosine: float = 0.0
    wavelength: float = 0.3
    fade: float = 0.0  # m, over which its ends fade; 0: one wave

    name = "rail_corrugation"
    left_out = "corrugation of {wavelength:.3f} m and {amplitude:.2e} m from {start:.1f} to {end:.1f} m"
    message = "The rail is corrugated, wavelength {wavelength}"
    site_check = "Measure the roughness of the rail; grind"
    effect_type = "path"
    frame = "wavelength"
    site_types = (ContactSite,)
    requirements = (PASSAGES, TWO_TRAINS, TWO_SPEEDS)
    column_type = "path"
    parameters = (
        Parameter("sine", "m", 0.0, (-3e-4, 3e-4), "amplitude in phase with the start", SOURCE, (0.0, 6e-5)),
        Parameter("cosine", "m", 0.0, (-3e-4, 3e-4), "amplitude a quarter wave ahead", SOURCE, (0.0, 6e-5)),
        Parameter("wavelength", "m", 0.3, (0.02, 1.5), "length of a wave", SOURCE),
    )

    @classmethod
    def example(cls) -> Self:
        """50 µm over 0.3 m."""
        return cls(8.0, 16.0, 5e-5)

    @classmethod
    def hypotheses(cls, site: ContactSite) -> Iterator[Hypothesis]:
        """Waves of two lengths all along the sensors."""
        low, high = min(site.sensor_positions) - SENSOR_MARGIN, max(site.sensor_positions) + SENSOR_MARGIN
        for length in WAVELENGTHS:
            starts, where = ((START_AMPLITUDE, 0.0, length),), {"wavelength": length}
            yield Hypothesis(starts, {"start": low, "end": high}, where, N_INDEPENDENT)

    def sentence(self) -> str:
        """Sentence that states what was left out."""
        return self.left_out.format(**vars(self), amplitude=float(np.hypot(self.sine, self.cosine)))

    def paths(self, track: Track | None, vehicle: Vehicle | None) -> Sequence[Callable[..., np.ndarray]]:
        """The waves."""
        self.check()
        if self.sine == 0.0 and self.cosine == 0.0:
            return ()
        return (Waves(self.start, self.end, self.sine, self.cosine, self.wavelength, self.fade or self.wavelength),)
