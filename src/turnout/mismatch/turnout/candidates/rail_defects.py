r"""Find dips and corrugation of many lengths at any position, from the free waves of the rail.

The waves of every base fit absorb a dip of the running surface, at amplitudes that are improbable for intact rail. J
are the whitened derivatives by all nuisances, in prior standard deviations, and c the wave amplitudes of a shape. Of
height a, the shape itself has no prior penalty:

.. math:: g = \frac{(c^T r')^2}{c^T G c - c^T G (G + 1)^{-1} G c}, \quad G = J^T J

is the gain in chi-squared when the waves give way to the shape, without a simulation.

``scan_geometry`` collects these candidates and those of wheels and short corrugation, which no fixed grid could hold.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from turnout import physics
from turnout.mismatch.engine.projector import Projector
from turnout.mismatch.turnout.candidates.catalogue import candidate_of, parameters_with
from turnout.mismatch.turnout.candidates.out_of_roundness import polygon_candidates
from turnout.mismatch.turnout.candidates.short_corrugation import short_corrugation_candidates
from turnout.mismatch.turnout.candidates.short_polygons import short_polygon_candidates
from turnout.mismatch.turnout.candidates.wheel_flats import flat_candidates
from turnout.mismatch.turnout.defect_priors import GEOMETRY
from turnout.mismatch.turnout.surface_priors import ROUGHNESS
from turnout.physics.hypothesis import Hypothesis

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.case import TrackCase

WAVELENGTHS = np.geomspace(
    GEOMETRY.wavelength_ratio * ROUGHNESS.shortest_wave, GEOMETRY.longest_wave, GEOMETRY.n_wavelengths
)  # m; shorter ones are no free waves


class RailScan:
    """Scores of shapes of the running surface, from the residual and the waves of ``fit``."""

    def __init__(self, case: TrackCase, fit: Fit):
        self.case, self.waves = case, case.predictor.waves
        projector = Projector(case, fit)
        names = [n.name for n in case.nuisances]
        first = names.index(self.waves.names[0])
        self.wave_slice = slice(first, first + len(self.waves.names))
        gram = projector.scaled.T @ projector.scaled
        inner = projector.scaled.T @ projector.right - gram @ projector.shift
        self.normal, self.gram, self.inner = projector.normal, gram, inner[self.wave_slice]
        self.theta = np.array([fit.values[n] for n in self.waves.names])
        self.shift = projector.shift[self.wave_slice]
        self.sd = projector.joint.sd[self.wave_slice]
        self.x = np.arange(self.waves.start, self.waves.end, 0.01)
        self.basis = 0.01 * 2.0 / self.waves.length * self.waves.shapes(self.x).T / self.sd

    def score(self, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gradient and negative curvature of the log likelihood by the sizes of shapes, with the waves free.

        Parameters
        ----------
        shapes : (m, n) array of float
            Deviations of the rail surface at ``x``. [m]

        Returns
        -------
        slope, size : (m,) array of float, (m, m) array of float
        """
        c = shapes @ self.basis
        across = self.gram[:, self.wave_slice] @ c.T
        return c @ self.inner, c @ self.gram[self.wave_slice, self.wave_slice] @ c.T - across.T @ self.normal @ across

    def waves_without(self, shape: np.ndarray) -> dict[str, float]:
        """Wave amplitudes without ``shape``, which is an effect of its own: start of a joint fit.

        Parameters
        ----------
        shape : (n,) array of float
            Deviation of the rail surface at ``x``. [m]

        Returns
        -------
        dict of str to float
            Name of each wave -> amplitude. [m]
        """
        c = shape @ self.basis
        released = self.shift - (self.normal @ (self.gram[:, self.wave_slice] @ c))[self.wave_slice]
        return dict(zip(self.waves.names, (self.theta + self.sd * released).tolist()))


def scan_rail(
    case: TrackCase, fit: Fit, families: Collection[str] | None = None, scan: RailScan | None = None
) -> tuple[Candidate, ...]:
    """The likeliest dip and the likeliest corrugation as candidates.

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        A fit of the case.
    families : collection of str or None
        Effects that are searched for; None: all.
    scan : RailScan or None
        That of the fit; None: a new one.

    Returns
    -------
    tuple of Candidate
        At most one of each effect.
    """
    scan = scan or RailScan(case, fit)
    scans = ((physics.SurfaceDip, _dip), (physics.RailCorrugation, _corrugation))
    chosen = [(effect, find) for effect, find in scans if families is None or effect.name in families]
    return tuple(candidate_of(effect, find(case, scan)) for effect, find in chosen)


def _dip(case: TrackCase, scan: RailScan) -> Hypothesis:
    positions = [s.place for s in case.campaign.sensors]
    grid = np.arange(
        min(positions) - GEOMETRY.sensor_margin, max(positions) + GEOMETRY.sensor_margin, GEOMETRY.position_step
    )
    trials = [(x, length, sharp) for length in GEOMETRY.lengths for sharp in GEOMETRY.sharpnesses for x in grid]
    shapes = np.array([_path(physics.SurfaceDip(x, GEOMETRY.unit_depth, *more), scan.x) for x, *more in trials])
    slope, size = scan.score(shapes)
    size = np.maximum(np.diag(size), 1e-12)
    best_index = int(np.argmax(slope**2 / size))
    (x, length, sharp), depth = trials[best_index], GEOMETRY.unit_depth * slope[best_index] / size[best_index]
    depth = float(np.clip(depth, -2.5e-3, 5e-3))
    scanned = np.ptp(grid) / GEOMETRY.resolution
    return Hypothesis(
        starts=((depth, length, sharp, 0.0),),
        fixed={"place": float(x)},
        where={"place": round(float(x), 3)},
        n_scanned=scanned,
        parameters=parameters_with(physics.SurfaceDip, shift=(0.0, GEOMETRY.resolution)),
        promise=float(0.5 * slope[best_index] ** 2 / size[best_index] - np.log(scanned)),
        start_nuisances=scan.waves_without(shapes[best_index] * depth / GEOMETRY.unit_depth),
    )


def _corrugation(case: TrackCase, scan: RailScan) -> Hypothesis:
    positions = [s.place for s in case.campaign.sensors]
    middles = np.arange(min(positions), max(positions) + 0.1, 0.75)
    trials = [(m, r, w) for m in middles for r in GEOMETRY.half_lengths for w in WAVELENGTHS]
    best_fit: tuple | None = None
    for middle, reach, wavelength in trials:
        a, b = middle - reach, middle + reach
        pair = np.array(
            [_path(physics.RailCorrugation(a, b, s, c, wavelength), scan.x) for s, c in GEOMETRY.unit_waves]
        )
        slope, size = scan.score(pair)
        amount = np.linalg.solve(size + 1e-9 * np.trace(size) * np.eye(2), slope)
        gain = float(slope @ amount)
        if best_fit is None or gain > best_fit[0]:
            best_fit = gain, a, b, wavelength, amount, pair
    assert best_fit is not None
    gain, a, b, wavelength, amount, pair = best_fit
    sine, cosine = (float(v) for v in np.clip(1e-5 * amount, -2.5e-4, 2.5e-4))
    scanned = GEOMETRY.n_independent_waves * len(middles)
    priors = {
        "sine": (0.0, GEOMETRY.amplitude_sd),
        "cosine": (0.0, GEOMETRY.amplitude_sd),
        "wavelength": (float(wavelength), 0.03 * float(wavelength)),
    }
    return Hypothesis(
        starts=((sine, cosine, float(wavelength)),),
        fixed={"start": a, "end": b},
        where={"wavelength": round(float(wavelength), 3), "place": 0.5 * (a + b)},
        n_scanned=scanned,
        parameters=parameters_with(physics.RailCorrugation, **priors),
        promise=float(0.5 * gain - np.log(scanned)),
        start_nuisances=scan.waves_without(1e5 * np.array([sine, cosine]) @ pair),
    )


def _path(term: physics.PhysicsTerm, x: np.ndarray) -> np.ndarray:
    return sum((component(x, 0) for component in term.paths(None, None)), np.zeros(x.size))


# Searches in the sound level and in the waves of single wheels: (effect, case and fit -> candidates), in this order.
SCANS = (
    (physics.WheelFlat, flat_candidates),
    (physics.OutOfRound, polygon_candidates),
    (physics.OutOfRound, short_polygon_candidates),
)


def scan_geometry(case: TrackCase, fit: Fit, families: Collection[str] | None = None) -> tuple[Candidate, ...]:
    """Candidates of ``families`` (None: all) for the residual of ``fit``.

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        A fit of the case.
    families : collection of str or None
        Effects that are searched for; None: all.

    Returns
    -------
    tuple of Candidate
    """
    scan = RailScan(case, fit)
    candidates = list(scan_rail(case, fit, families, scan))
    if families is None or physics.RailCorrugation.name in families:
        candidates += short_corrugation_candidates(case, fit, scan)
    for effect, find in SCANS:
        if families is None or effect.name in families:
            candidates += find(case, fit)
    return tuple(candidates)
