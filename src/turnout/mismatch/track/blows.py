"""Hammer tests as observations: receptances of accepted blows, their prediction and derivatives."""

from dataclasses import dataclass, replace

import numpy as np

from turnout.mismatch.case import Nuisance, Observation
from turnout.mismatch.track.base_model import COMMON, OWN
from turnout.receptance import find_impacts
from turnout.simulate.frequency import responses
from turnout.simulate.link import Link
from turnout.simulate.matrices import assemble

LINES = np.unique(np.round(np.geomspace(35.0, 900.0, 44) / 2.0) * 2.0)  # [Hz]; two blows' worth of resolution
SWING, RATE = 1e-6, 0.02  # motion of a blow for the tangent of a law [m, m/s]
DELAY = 8e-6  # sd of a hammer pair's delay: 2 degrees at 700 Hz [s]
FEWEST = 2


@dataclass(frozen=True)
class Pair:
    """One response channel of one hammer test: ``frequency`` (n,) lines with a measured receptance."""

    name: str
    test: object
    channel: str
    sensor: object
    frequency: np.ndarray
    size: np.ndarray
    conditions: dict


def pairs_of(test, sensors, tolerance):
    """(Pair, Observation) of every response channel of a test; channels without sound blows are left out.

    The observation is Re and Im of the receptance over its own magnitude, so that all lines weigh alike; sigma is
    the blows' spread and ``tolerance``.
    """
    found = []
    for sensor in sensors:
        if not any(c.name == sensor.name for r in test.recordings for c in r.channels):
            continue
        impacts = find_impacts(test.recordings, test.force, sensor.name)
        used = [i for i in impacts if i.accepted]
        if len(used) < FEWEST:
            continue
        h, spread = _receptance(used)
        good = np.isfinite(spread) & (spread < 0.3 * np.abs(h)) & (LINES < 0.9 * np.median([i.band_edge for i in used]))
        if good.sum() < 8:
            continue
        name = f"{test.name}:{sensor.name}"
        pair = Pair(name, test, sensor.name, sensor, LINES[good], np.abs(h[good]), dict(test.conditions))
        found.append((pair, observed(pair, h[good], spread[good], tolerance)))
    return found


def _receptance(impacts):
    """H1 over whole blows and its standard error from blow to blow, both (n_line,)."""
    force, response = [], []
    for i in impacts:
        t = np.arange(i.force.size) / i.rate
        kernel = np.exp(-2j * np.pi * LINES[:, None] * t)
        force.append(kernel @ i.force)
        response.append(kernel @ i.acceleration)
    force, response = np.array(force), np.array(response)
    power = np.sum(np.abs(force) ** 2, axis=0)
    h = np.sum(response * force.conj(), axis=0) / power
    left = np.sum(np.abs(response - h * force) ** 2, axis=0) / max(len(impacts) - 1, 1)
    omega2 = (2.0 * np.pi * LINES) ** 2
    return -h / omega2, np.sqrt(left / power) / omega2


def sized(pair, size):
    """The pair with other magnitudes of its receptance."""
    return replace(pair, size=size)


def observed(pair, h, spread, tolerance):
    """Observation of a receptance (n,) with its standard error ``spread``."""
    sigma = np.sqrt((spread / pair.size) ** 2 / 2.0 + tolerance**2)
    data = np.concatenate([h.real, h.imag]) / np.tile(pair.size, 2)
    octave = np.floor(np.log2(pair.frequency / 31.25)).astype(int)
    bands = np.unique(octave)
    cells = np.tile(np.searchsorted(bands, octave), 2)
    said = {"sensor": pair.channel, "place": f"{pair.test.place:.1f}", "condition": pair.test.visit}
    labels = {frame: np.array([level] * bands.size, dtype=object) for frame, level in said.items()}
    labels["frequency"] = np.array([f"{31.25 * 2.0**b:.0f} Hz" for b in bands], dtype=object)
    condition = f"blows at {pair.test.place:.1f} m {pair.test.visit}".strip()
    return Observation(
        pair.name, condition, data, np.tile(sigma, 2), 0.7, "hammer", dict(pair.conditions), cells, labels
    )


def pair_nuisances(pair, tolerance):
    """Gain, tilt and delay of one pair: what a hammer, its calibration and a mounting leave open."""
    parts = (("gain", "-", tolerance), ("tilt", "-", tolerance), ("delay", "s", DELAY))
    return [Nuisance(f"{what}@{pair.name}", unit, 0.0, sd, pair.name) for what, unit, sd in parts]


def tangent(terms, track):
    """Links of the terms' ports as a blow finds them: their secant over a micrometre and 20 mm/s."""
    found = []
    for term in terms:
        for port in term.ports(track):
            law, d = port.law, -port.gap
            k = (float(law.force(d + SWING, 0.0)) - float(law.force(d - SWING, 0.0))) / (2.0 * SWING)
            c = (float(law.force(d, RATE)) - float(law.force(d, -RATE))) / (2.0 * RATE)
            found.append(Link(port.ends, k, c, tag="tangent"))
    return found


class _Tangent:
    """The ports of terms as matrix entries."""

    def __init__(self, links):
        self._links = links

    def links(self, track):
        return self._links

    def rail(self, track):
        return track


class BlowModel:
    """Receptances of one track with terms at given conditions; ``gradient`` by the supports' values."""

    def __init__(self, track, terms, frequency):
        self.track, self.frequency = track, frequency
        self.terms = terms
        self.matrices = assemble(track, (*terms, _Tangent(tangent(terms, track))))
        self.by_place = {}

    def displacement(self, place):
        """(n_line, n) of all degrees of freedom under a unit force at a place."""
        if place not in self.by_place:
            self.by_place[place] = responses(self.matrices, self.frequency, [place])[:, 0]
        return self.by_place[place]

    def place_of(self, sensor):
        """Place of a sensor on the model."""
        return sensor.probe(self.track).place

    def receptance(self, excited, measured):
        """(n_line,) complex [m/N]."""
        rows, weights = self.matrices.weights(measured)
        h = self.displacement(excited)[:, rows] @ weights
        if not isinstance(measured, tuple) and abs(excited - measured) < 1e-9:
            h = h + self.matrices.compliance(float(excited))
        return h

    def gradient(self, excited, measured, zone):
        """Derivative by the logarithm of each common and own value: name -> (n_line,)."""
        u, v = self.displacement(excited), self.displacement(measured)
        index, omega, found = self.matrices.index, 2.0 * np.pi * self.frequency, {}
        supports = np.arange(self.track.support.size)
        rail = [index[("rail", j)] for j in supports]
        sleeper = [index[("sleeper", j)] for j in supports]
        product = {
            "pad": (u[:, rail] - u[:, sleeper]) * (v[:, rail] - v[:, sleeper]),
            "ballast": u[:, sleeper] * v[:, sleeper],
        }
        product["sleeper"] = product["ballast"]
        factor = {"stiffness": -1.0 + 0.0 * omega, "damping": -1j * omega, "mass": omega**2}
        for name, tag, what, _ in COMMON:
            found[name] = factor[what] * (product[tag] @ getattr(self.track, name))
        for name, tag, what in OWN:
            for j in zone.supports:
                found[f"{tag}_{j}"] = factor[what] * product[tag][:, j] * getattr(self.track, name)[j]
        return found


def channel_factor(terms, sensor, frequency):
    """What linear channel terms make of a spectrum, (n,) complex."""
    factor = np.ones(frequency.size, dtype=complex)
    for term in terms:
        if hasattr(term, "transfer") and term.channel_name == sensor.name:
            factor = factor * term.transfer(frequency)
    return factor


def split(value):
    """Re and Im one behind the other."""
    return np.concatenate([value.real, value.imag])


def pair_chain(pair, values, h):
    """Receptance over its measured magnitude with the pair's own gain, tilt and delay, complex (n,)."""
    tilt = np.log(pair.frequency / 200.0) / np.log(4.0)
    gain = 1.0 + values[f"gain@{pair.name}"] + values[f"tilt@{pair.name}"] * tilt
    return h / pair.size * gain * np.exp(-2j * np.pi * pair.frequency * values[f"delay@{pair.name}"])


def pair_columns(pair, values, predicted):
    """Derivatives of a predicted pair by its own three nuisances, name -> (2n,)."""
    n = pair.frequency.size
    h = predicted[:n] + 1j * predicted[n:]
    tilt = np.log(pair.frequency / 200.0) / np.log(4.0)
    gain = 1.0 + values[f"gain@{pair.name}"] + values[f"tilt@{pair.name}"] * tilt
    return {
        f"gain@{pair.name}": split(h / gain),
        f"tilt@{pair.name}": split(h * tilt / gain),
        f"delay@{pair.name}": split(-2j * np.pi * pair.frequency * h),
    }
