r"""Find dips and corrugation of many lengths at any position, from the free waves of the rail.

The waves of every base fit absorb a dip of the running surface, at amplitudes that are improbable for intact rail. J
are the whitened derivatives by all nuisances, in prior standard deviations, and c the wave amplitudes of a shape. Of
height a, the shape itself has no prior penalty:

.. math:: g = \frac{(c^T r')^2}{c^T G c - c^T G (G + 1)^{-1} G c}, \quad G = J^T J

is the gain in chi-squared when the waves give way to the shape, without a simulation.

``scan_geometry`` collects these candidates and those of wheels and short corrugation, which no fixed grid could hold.
"""

from dataclasses import replace

import numpy as np

from turnout import physics
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.candidate_search import Projector
from turnout.mismatch.turnout.candidates.out_of_roundness import polygons, short_polygons
from turnout.mismatch.turnout.candidates.short_corrugation import short_waves
from turnout.mismatch.turnout.candidates.wheel_flats import flats
from turnout.mismatch.turnout.passage_band import SHORTEST_WAVE

PLACE_STEP, BEYOND = 0.1, 1.0  # m, between trial positions of a dip; margin beyond the sensors
LENGTHS, SHARPNESSES = (0.25, 0.4, 0.6, 0.9), (0.2, 0.9)  # m, -; trial values of a dip
APART = 0.3  # m; closer dips cannot be distinguished
DEPTH = 1e-3  # m, of a trial dip
WAVELENGTHS = np.geomspace(1.02 * SHORTEST_WAVE, 0.75, 34)  # m; shorter ones are no free waves
REACHES = (1.8, 3.2, 5.0)  # m, half the length of a corrugated stretch
HIGH = 3e-5  # m, prior sd of the amplitude: corrugation that is ground away
LINES = 12.0  # distinguishable wavelengths in that range for sensors 6 m apart


class RailScan:
    """Scores of shapes of the running surface, from the residual and the waves of ``fit``."""

    def __init__(self, case, fit):
        self.case, self.waves = case, case.waves
        projector = Projector(case, fit)
        names = [n.name for n in case.nuisances]
        first = names.index(self.waves.names[0])
        self.of_waves = slice(first, first + len(self.waves.names))
        gram = projector.scaled.T @ projector.scaled
        inner = projector.scaled.T @ projector.right - gram @ projector.shift
        self.normal, self.gram, self.inner = projector.normal, gram, inner[self.of_waves]
        self.theta = np.array([fit.values[n] for n in self.waves.names])
        self.shift = projector.shift[self.of_waves]
        self.sd = projector.joint.sd[self.of_waves]
        self.x = np.arange(self.waves.start, self.waves.end, 0.01)
        self.basis = 0.01 * 2.0 / self.waves.length * self.waves.shapes(self.x).T / self.sd

    def scored(self, shapes):
        """(slope (m,), size (m, m)) of shapes (m, n) at ``x``, with the waves free."""
        c = shapes @ self.basis
        across = self.gram[:, self.of_waves] @ c.T
        return c @ self.inner, c @ self.gram[self.of_waves, self.of_waves] @ c.T - across.T @ self.normal @ across

    def released(self, shape):
        """Wave amplitudes without ``shape`` (n,), which is an effect of its own: start of a joint fit."""
        c = shape @ self.basis
        moved = self.shift - (self.normal @ (self.gram[:, self.of_waves] @ c))[self.of_waves]
        return dict(zip(self.waves.names, (self.theta + self.sd * moved).tolist()))


def rail_scan(case, fit, families=None):
    """The likeliest dip and the likeliest corrugation as candidates."""
    scan = RailScan(case, fit)
    makers = {"surface_dip": _dip, "rail_corrugation": _corrugation}
    return tuple(make(case, scan) for name, make in makers.items() if families is None or name in families)


def _dip(case, scan):
    places = [s.place for s in case.campaign.sensors]
    grid = np.arange(min(places) - BEYOND, max(places) + BEYOND, PLACE_STEP)
    tried = [(x, length, sharp) for length in LENGTHS for sharp in SHARPNESSES for x in grid]
    shapes = np.array([_path(physics.SurfaceDip(x, DEPTH, *more), scan.x) for x, *more in tried])
    slope, size = scan.scored(shapes)
    size = np.maximum(np.diag(size), 1e-12)
    best = int(np.argmax(slope**2 / size))
    (x, length, sharp), depth = tried[best], DEPTH * slope[best] / size[best]
    depth = float(np.clip(depth, -2.5e-3, 5e-3))
    scanned = np.ptp(grid) / APART
    return Candidate(
        "surface_dip", _about(physics.SurfaceDip, shift=(0.0, APART)),
        lambda p: physics.SurfaceDip(float(x), **p),
        ((depth, length, sharp, 0.0),), {"place": round(float(x), 3)}, "place", scanned, least=3e-5,
        promise=float(0.5 * slope[best] ** 2 / size[best] - np.log(scanned)),
        begin=scan.released(shapes[best] * depth / DEPTH),
    )  # fmt: skip


def _corrugation(case, scan):
    places = [s.place for s in case.campaign.sensors]
    middles = np.arange(min(places), max(places) + 0.1, 0.75)
    tried = [(m, r, w) for m in middles for r in REACHES for w in WAVELENGTHS]
    best = None
    for middle, reach, wavelength in tried:
        a, b = middle - reach, middle + reach
        pair = np.array([_path(physics.RailCorrugation(a, b, *q, wavelength), scan.x) for q in ((1e-5, 0), (0, 1e-5))])
        slope, size = scan.scored(pair)
        amount = np.linalg.solve(size + 1e-9 * np.trace(size) * np.eye(2), slope)
        gain = float(slope @ amount)
        if best is None or gain > best[0]:
            best = gain, a, b, wavelength, amount, pair
    gain, a, b, wavelength, amount, pair = best
    sine, cosine = (float(v) for v in np.clip(1e-5 * amount, -2.5e-4, 2.5e-4))
    scanned = LINES * len(middles)
    priors = {"sine": (0.0, HIGH), "cosine": (0.0, HIGH), "wavelength": (float(wavelength), 0.03 * float(wavelength))}
    return Candidate(
        "rail_corrugation", _about(physics.RailCorrugation, **priors),
        lambda p: physics.RailCorrugation(a, b, **p),
        ((sine, cosine, float(wavelength)),), {"wavelength": round(float(wavelength), 3), "place": 0.5 * (a + b)},
        "wavelength", scanned, promise=float(0.5 * gain - np.log(scanned)),
        begin=scan.released(1e5 * np.array([sine, cosine]) @ pair),
    )  # fmt: skip


def _about(term, **priors):
    """Parameters of a term with priors about the values of a scan, whose cost is already counted."""
    return tuple(replace(p, prior=priors[p.name]) if p.name in priors else p for p in term.parameters)


def _path(term, x):
    return sum((part(x, 0) for part in term.paths(None, None)), np.zeros(x.size))


def geometry_scan(case, fit, families=None):
    """Candidates of ``families`` (None: all) for the residual of ``fit``."""
    found = list(rail_scan(case, fit, families))
    if families is None or "rail_corrugation" in families:
        found += short_waves(case, fit)
    if families is None or "wheel_flat" in families:
        found += flats(case, fit)
    if families is None or "out_of_round" in families:
        found += (*polygons(case, fit), *short_polygons(case, fit))
    return tuple(found)
