r"""Polygonal wheels, sought in the residual: which wheel of which train, and how long the waves round its tread are.

One wheel's wave is a line at v/λ in every passage of its train, at an angle that nobody knows. With C its two signals,
a quarter wave apart, whitened, and amplitudes of standard deviation a, the same in all passages, each passage gives

.. math:: \ln \Lambda = \tfrac12 s^T (M + a^{-2})^{-1} s - \tfrac12 \ln |1 + a^2 M|, \quad s = C^T r, \; M = C^T C

with the angle integrated out. M is that of the first wheel: all wheels of a train are alike in it.
"""

import numpy as np

from turnout import physics
from turnout.mismatch.candidate import Candidate
from turnout.mismatch.track.bands import SHORTEST_WAVE
from turnout.mismatch.track.rolled_waves import Carrier

WAVELENGTHS = np.geomspace(SHORTEST_WAVE, 1.0, 100)  # m; neighbours differ by a third of a period over 10 m
FINER = np.linspace(0.985, 1.015, 13)
AMPLITUDES = np.geomspace(1e-5, 4e-4, 5)  # m
TURNS = 12.0  # angles that a passage can tell from each other


def polygons(case, fit):
    """The likeliest polygonal wheel as a candidate, () where none is likelier than a round one."""
    found = [s for train in case.trains for s in of_train(case, fit, train)]
    if not found:
        return ()
    nats, train, wheel, wavelength, _ = max(found, key=lambda f: f[0])
    if nats <= 0.0:
        return ()
    closer = of_train(case, fit, train, wavelength * FINER)
    _, _, _, wavelength, parts = next(f for f in closer if f[2] == wheel)
    return (_candidate(case, train, wheel, wavelength, parts, nats, len(found)),)


def of_train(case, fit, train, wavelengths=WAVELENGTHS):
    """(nats, train, wheel, wavelength, [(recording, cosine, sine)]) of each wheel, 0 first."""
    members = [(o, w) for o, w in zip(case.observations, fit.white) if o.name in case.rollings]
    members = [(o, w) for o, w in members if case.said(case.rollings[o.name])["train"] == train]
    if not members:
        return
    n_wheel = len(case.rollings[members[0][0].name].passage.vehicle.wheels)
    parts = [_slopes(case, fit, o, white, n_wheel, wavelengths) for o, white in members]
    for wheel in range(n_wheel):
        nats = sum(_evidence(slope[wheel], size) for slope, size in parts)  # (n_amplitude, n_wavelength)
        a, k = np.unravel_index(int(np.argmax(nats)), nats.shape)
        prior = np.eye(2) / AMPLITUDES[a] ** 2
        best = [np.linalg.solve(size[k] + prior, slope[wheel][k]) for slope, size in parts]
        together = float(_log_mean(nats))
        yield together, train, wheel, float(wavelengths[k]), [(o.name, *b) for (o, _), b in zip(members, best)]


def _slopes(case, fit, o, white, n_wheel, wavelengths):
    """(n_wheel, n_wavelength, 2) slopes and (n_wavelength, 2, 2) sizes of one passage."""
    made = case.rollings[o.name]
    carrier = Carrier(case, fit.values, made, fit.terms)
    spectra = carrier.spectra(wavelengths, np.ones(carrier.node.size))
    weight = o.effective / fit.scale[o.kind]
    twice = o.whitened(np.asarray(white) * o.sigma) / o.sigma  # the whitening is symmetric: columns need not pass it
    slopes = []
    for wheel in range(n_wheel):
        columns = carrier.shown(spectra, carrier.wheel(wheel))
        slopes.append(weight * (columns.T @ twice).reshape(-1, 2))
        if wheel == 0:
            seen = o.whitened(columns).reshape(o.data.size, -1, 2)
    return np.array(slopes), weight * np.einsum("nki,nkj->kij", seen, seen)


def _evidence(slope, size):
    """(n_amplitude, n_wavelength) nats of one passage."""
    found = []
    for a in AMPLITUDES:
        inside = size + np.eye(2) / a**2
        along = np.einsum("ki,ki->k", slope, np.linalg.solve(inside, slope[..., None])[..., 0])
        found.append(0.5 * along - 0.5 * np.linalg.slogdet(a**2 * inside)[1])
    return np.array(found)


def _log_mean(nats):
    top = nats.max()
    return top + np.log(np.mean(np.exp(nats - top)))


def _candidate(case, train, wheel, wavelength, parts, nats, scanned):
    passage = next(case.rollings[name].passage for name, *_ in parts)
    order = max(1, round(2.0 * np.pi * passage.vehicle.each("radius")[wheel] / wavelength))
    radius = order * wavelength / (2.0 * np.pi)
    middle = np.mean([s.place for s in case.campaign.sensors])  # a wave a little longer then fits there at least
    phases = [(name, np.arctan2(s, c) * radius / order) for name, c, s in parts]
    phases = tuple((name, float(x + wavelength * np.round((middle - x) / wavelength))) for name, x in phases)
    amplitude = float(np.clip(np.median([np.hypot(c, s) for _, c, s in parts]), 0.0, 9e-4))

    def make(p):
        return physics.OutOfRound(wheel, order=order, radius=radius, train=train, phases=phases, **p)

    return Candidate(
        "out_of_round", physics.OutOfRound.parameters, make, ((amplitude, 0.0, 0.0),),
        {"train": train, "axle": wheel + 1}, "wheel", scanned * TURNS ** len(phases), least=2e-5,
        promise=float(nats - np.log(scanned)),
    )  # fmt: skip
