"""Roughness and profile of single wheels as error modes of a passage, which are integrated out.

Every wheel has its own waves round its tread, at an unknown angle, so that no other passage predicts them. The radius
is known to a few per cent only: within the range of the sensors the waves are those of any rough surface. Their effect
depends on the mass of the wheels. Where a fit finds another mass than the file, the modes are computed again.

At a nose, blade or joint each wheel takes its own path, whereas the file has one for all. Where a wheel leaves the wing
rail and how deep it falls depend on its profile, new or hollow worn (Palsson and Nielsen 2012, Vehicle System Dynamics
50), and the shape in the file is only approximate.
"""

import numpy as np
from scipy.linalg import eigh

from turnout.mismatch.engine.candidate_search import absorbed
from turnout.mismatch.turnout.rail_roughness import amplitude_sd
from turnout.mismatch.turnout.wave_response import Carrier

DEPTH, LENGTH = 0.2, 0.15  # relative sd of depth and length of a component from wheel to wheel
PLACE = 0.03  # m, sd of its position from wheel to wheel
SHARP = 0.5  # sd of its shape, as a share of the difference between powers 1.5 and 2
FAR = 1.0  # m to either side of the deepest point
LEAST = 1e-6  # m; shallower components are ignored


def profile_modes(case, values, made, carrier):
    """(n_sensor * n_time, n_mode) signals of one standard deviation of each wheel's path over each component."""
    way = carrier.course
    paths = [path for part in _parts(case, values, made) for path in _otherwise(part, way)]
    if not paths:
        return np.zeros((len(made.sensors) * made.time.size, 0))
    return np.concatenate([carrier.alone(w, np.array(paths)) for w in range(carrier.behind.size)], axis=1)


def _parts(case, values, made):
    """Components of a passage's route except waves, which are the same for all wheels."""
    parts = [part for parts in case.surface.surfaces(made.passage.route, values) for part in parts]
    return [part for part in parts if not hasattr(part, "wavelength")]


def _otherwise(part, way):
    """Standard deviations of a surface component at ``grid`` (n,) [m]: deeper, further, longer, sharper.

    A height step between its ends is the same for all wheels.
    """
    ends = getattr(part, "places", way)[0], getattr(part, "places", way)[-1]
    inside = (way >= ends[0]) & (way <= ends[1])
    dip = np.where(inside, part(way, 0) - np.interp(way, ends, part(np.array(ends), 0)), 0.0)
    deepest = np.max(np.abs(dip))
    if deepest < LEAST:
        return []
    slope = np.gradient(dip, way)
    from_middle = np.clip(way - way[np.argmax(np.abs(dip))], -FAR, FAR)
    share = np.abs(dip) / deepest
    sharper = np.sign(dip) * deepest * (share**0.75 - share)
    return [DEPTH * dip, PLACE * slope, LENGTH * from_middle * slope, SHARP * sharper]


TURNED = 1.5e-5  # m, first three harmonics of wheels in service (Johansson 2006, Vehicle System Dynamics 44)
WHEEL_LEVEL = -2.0  # dB over the limit curve of rails: disc-braked wheels
KEPT = 0.02  # share of a sample's own variance below which a mode is left out
FAINT = 0.1  # of that: single waves below this are left out before they are combined
BEYOND = 6.0  # m beyond the free waves; lightly damped track carries a wheel's noise that far


def wheel_modes(case, values, made, sigma):
    """(n_sensor * n_time, n_mode) signals of one standard deviation of the roughness and profile of all wheels.

    ``sigma`` (n,) is the error of the observation. In single precision: a long train over many sensors has a thousand
    modes of ten thousand samples each.
    """
    waves, scale = case.waves, sigma[:, None].astype(np.float32)
    radii, carrier = made.passage.vehicle.each("radius"), Carrier(case, values, made, beyond=BEYOND)
    treads = {radius: _amplitudes(waves, radius) for radius in radii}
    modes = [profile_modes(case, values, made, carrier).astype(np.float32)]
    for envelope, rail in zip(_stretches(waves, carrier.node), (0.0, waves.sd[::2], waves.sd[::2])):
        spectra = carrier.spectra(waves.lengths, envelope)
        for w, radius in enumerate(radii):
            sd = np.hypot(treads[radius], rail)
            columns = (carrier.shown(spectra, carrier.wheel(w)) * np.repeat(sd, 2)).astype(np.float32)
            modes.append(columns[:, np.sum((columns / scale) ** 2, axis=0) > FAINT * KEPT])
    modes = np.concatenate(modes, axis=1)
    scaled = modes / scale
    power, turn = eigh(scaled.T @ scaled, driver="evd", overwrite_a=True)  # scipy's: half the time of numpy's
    return modes @ turn[:, power > KEPT]


def _amplitudes(waves, radius):
    """(n_length,) standard deviation of the waves of a wheel [m]."""
    sd, circumference = amplitude_sd(waves.lengths, waves.length, WHEEL_LEVEL), 2.0 * np.pi * radius
    # out of round: the variance of an harmonic is spread over the waves up to half an order beside it
    turned = np.clip(np.round(circumference / waves.lengths), 1, 99) <= 3
    sd[turned] = np.maximum(sd[turned], TURNED * np.sqrt(circumference / waves.length))
    return sd


def _stretches(waves, node):
    """Envelopes (n_node,) of the region with free rail waves, of that before and of that behind it.

    In the latter two the roughness of the rail is an error of each wheel as well.
    """
    inside = (node >= waves.start - 0.3) & (node <= waves.end + 0.3)
    outside, ahead = 1.0 - waves.fade(node), node < 0.5 * (waves.start + waves.end)
    return inside.astype(float), outside * ahead, outside * ~ahead


def heavier(case, fit):
    """Logarithm of each train's unsprung mass in ``fit`` over that of the file, dict train -> float.

    Where it is a nuisance, the value is that without its narrow prior in the base model.
    """
    wheels = [(c.where["train"], start) for _, c, start, _ in absorbed(case, fit) if c.family == "unsprung_mass"]
    opened = {train: float(np.log(start[0])) for train, start in wheels}
    found = {}
    for made in case.rollings.values():
        said = case.said(made)
        file = vehicle = made.passage.vehicle
        for term in fit.terms:
            vehicle = term.under(said).vehicle(vehicle)
        wheel, train = file.wheels[0], said["train"]
        known = opened.get(train, fit.values[f"wheels_{train}"])
        found[train] = known + float(np.log(vehicle.bodies[wheel].mass / file.bodies[wheel].mass))
    return found
