"""Hammer tests as observations: receptances of accepted blows, their prediction and derivatives."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from turnout.mismatch.case import Observation
from turnout.mismatch.track.base_model import COMMON, OWN
from turnout.mismatch.track.skeleton import FixedLinks, matrices_of
from turnout.receptance import find_impacts
from turnout.simulate.frequency import responses
from turnout.simulate.link import Link
from turnout.simulate.matrices import link_vector

LINES = np.unique(np.round(np.geomspace(35.0, 900.0, 44) / 2.0) * 2.0)  # [Hz]; two blows' worth of resolution
SWING = 1e-6  # motion of a blow for the tangent of a law [m]
# Rate of a joint under a blow: from that of a free one to that of one which is held, over so much force against it.
# Blows of 5 kN on a simulated track with friction of 0.3 to 8 kN are met best at 20, 13, 8, 3 and 1.5 mm/s.
FREE, HELD, HOLDING = 0.021, 1.5e-3, 2e3  # [m/s, m/s, N]
DELAY = 8e-6  # sd of a hammer pair's delay: 2 degrees at 700 Hz [s]
SHARE = 1e-3  # of a support's value, by which what follows it is found
FEWEST = 2
SMOOTH = 0.3  # octaves over which the errors of a model of the track hang together
FARTHER = 1.5  # m; over this way an error of the waves' speed and decay doubles the variance of a receptance's error
LINE_SHARE = 0.4  # of the tolerance that differs from line to line


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

    @property
    def lines(self):
        """(n,) index of its lines in ``LINES``."""
        return np.searchsorted(LINES, self.frequency)


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


@lru_cache(maxsize=4)
def _kernel(n, rate):
    """(n_line, n) of the transform at ``LINES``."""
    return np.exp(-2j * np.pi * LINES[:, None] * np.arange(n) / rate)


def _receptance(impacts):
    """H1 over whole blows and its standard error from blow to blow, both (n_line,)."""
    force, response = [], []
    for i in impacts:
        kernel = _kernel(i.force.size, i.rate)
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
    sigma = np.sqrt((spread / pair.size) ** 2 / 2.0 + (LINE_SHARE * tolerance * _around(pair)) ** 2)
    data = np.concatenate([h.real, h.imag]) / np.tile(pair.size, 2)
    octave = np.floor(np.log2(pair.frequency / 31.25)).astype(int)
    bands = np.unique(octave)
    cells = np.tile(np.searchsorted(bands, octave), 2)
    said = {"sensor": pair.channel, "place": f"{pair.test.place:.1f}", "condition": pair.test.visit}
    labels = {frame: np.array([level] * bands.size, dtype=object) for frame, level in said.items()}
    labels["frequency"] = np.array([f"{31.25 * 2.0**b:.0f} Hz" for b in bands], dtype=object)
    condition = f"blows at {pair.test.place:.1f} m {pair.test.visit}".strip()
    return Observation(
        pair.name, condition, data, np.tile(sigma, 2), 0.7, "hammer", dict(pair.conditions), cells, labels,
        tolerated(pair, h, tolerance),
    )  # fmt: skip


def _around(pair):
    """Root mean square of the magnitude over a third of an octave about each line, over its own (n,), at least 1:
    errors of a model fill the antiresonances."""
    near = np.abs(np.log2(pair.frequency[:, None] / pair.frequency)) < 0.34
    return np.maximum(np.sqrt(near @ pair.size**2 / near.sum(axis=1)) / pair.size, 1.0)


def tolerated(pair, h, tolerance):
    r"""(2n, m) modes of what a receptance may differ by without a cause worth a name.

    Gain, tilt over frequency and delay of the pair (hammer, calibration, mounting), and an error of the model that is
    smooth over :math:`\ell = 0.3` octaves: :math:`\epsilon h` with complex normal ε of covariance
    :math:`\tau^2 (1 + d^2 / d_0^2) \exp(-\Delta^2 / 2 \ell^2)`, Δ in octaves, d the way from blow to sensor.
    """
    octave = np.log2(pair.frequency)
    place = getattr(pair.sensor, "place", pair.test.place)
    size = tolerance * np.hypot(1.0, (place - pair.test.place) / FARTHER)
    kernel = np.exp(-0.5 * ((octave[:, None] - octave) / SMOOTH) ** 2)
    power, turn = np.linalg.eigh(kernel)
    keep = power > 1e-3
    smooth = size * turn[:, keep] * np.sqrt(power[keep])
    chain = np.column_stack([np.full(octave.size, tolerance), tolerance * (octave - np.log2(200.0)) / 2.0])
    unit = (h / np.abs(h) * _around(pair))[:, None]
    late = (-2j * np.pi * pair.frequency * DELAY * h / np.abs(h))[:, None]
    columns = np.column_stack([unit * smooth, 1j * unit * smooth, (h / np.abs(h))[:, None] * chain, late])
    return np.concatenate([columns.real, columns.imag])


def tangent(terms, track):
    """Links of the terms' ports as a blow finds them: their secant over a micrometre and the rate that they leave."""
    found = []
    for term in terms:
        for port in term.ports(track):
            law, d = port.law, -port.gap
            k = (float(law.force(d + SWING, 0.0)) - float(law.force(d - SWING, 0.0))) / (2.0 * SWING)
            rate = HELD + (FREE - HELD) * np.exp(-abs(_against(law, d, FREE)) / HOLDING)
            c = _against(law, d, rate) / rate
            found.append(Link(port.ends, k, c, tag="tangent"))
    return found


def _against(law, d, rate):
    """Half of what the force of a law changes by when the rate turns round [N]."""
    return 0.5 * (float(law.force(d, rate)) - float(law.force(d, -rate)))


def _own_shear(track, terms):
    """Share of the rail's flexibility in shear that is the file's, the rest being that of ``terms``."""
    if track.rail.beam == "euler":
        return 0.0
    changed = track
    for term in terms:
        changed = term.rail(changed)
    return changed.rail.shear_stiffness / track.rail.shear_stiffness


class BlowModel:
    """Receptances of one track with terms at given conditions on ``LINES``; ``gradient`` by the supports' values."""

    def __init__(self, track, terms):
        self.track, self.terms = track, terms
        self.added = (*terms, FixedLinks(tangent(terms, track)))
        self.matrices = matrices_of(track, self.added)
        self.own_shear = _own_shear(track, terms)
        self.by_place, self.strain, self.support, self.weight = {}, {}, {}, {}

    def solve(self, places):
        """Remember the displacements under unit forces at these places: together they need one factorisation."""
        new = [p for p in dict.fromkeys(places) if p not in self.by_place]
        if new:
            found = responses(self.matrices, LINES, new)
            self.by_place |= {p: found[:, k] for k, p in enumerate(new)}

    def displacement(self, place):
        """(n_line, n) of all degrees of freedom under a unit force at a place."""
        self.solve([place])
        return self.by_place[place]

    def moved(self, excited, measured):
        """(n_line,) displacement at one place under a unit force at another, nodes' motion alone. [m/N]"""
        if measured not in self.weight:
            self.weight[measured] = self.matrices.weights(measured)
        rows, weights = self.weight[measured]
        return self.displacement(excited)[:, rows] @ weights

    def place_of(self, sensor):
        """Place of a sensor on the model."""
        return sensor.probe(self.track).place

    def receptance(self, excited, measured):
        """(n_line,) complex [m/N]."""
        h = self.moved(excited, measured)
        if not isinstance(measured, tuple) and abs(excited - measured) < 1e-9:
            h = h + self.matrices.compliance(float(excited))
        return h

    def seat_gradient(self, excited, measured, way=0.01):
        """Derivative by the sensor's place on the rail, (n_line,) [1/N]; 0 on a sleeper."""
        if isinstance(measured, tuple):
            return np.zeros(LINES.size, dtype=complex)
        return (self.moved(excited, measured + way) - self.moved(excited, measured - way)) / (2.0 * way)

    def strains(self, place):
        """(n_line, n_element) bending and shearing of the rail's elements under a unit force at a place."""
        if place not in self.strain:
            u, row, h = self.displacement(place), self.matrices.node_index, self.matrices.elements[0]
            w, turn = u[:, row], u[:, row + 1]
            self.strain[place] = np.diff(turn), np.diff(w) / h - 0.5 * (turn[:, :-1] + turn[:, 1:])
        return self.strain[place]

    def rail_gradient(self, excited, measured):
        r"""Derivatives by the logarithms of the rail's bending and shear stiffness, (n_line, 2).

        .. math:: -\sum_e \frac{EI}{h} s_u s_v + \frac{12 EI}{h (1+P)^2} a_u a_v, \quad
                  -\sum_e \frac{12 EI P}{h (1+P)^2} a_u a_v

        with :math:`s = \theta_2 - \theta_1`, :math:`a = (w_2 - w_1)/h - (\theta_1 + \theta_2)/2` of each element and P
        its share of shear: the element's two modes (Przemieniecki 1968, ch. 11). Its mass hardly hangs on them.
        """
        (s_u, a_u), (s_v, a_v) = self.strains(excited), self.strains(measured)
        h, p, ei, _ = self.matrices.elements
        sheared = 12.0 * ei / (h * (1.0 + p) ** 2)
        a = a_u * a_v
        shear = self.own_shear * (a @ (sheared * p))
        return -np.stack([(s_u * s_v) @ (ei / h) + a @ sheared, shear], axis=1)

    def gradient(self, excited, measured, zone):
        """Derivatives by the logarithm of each common and own value, (n_line, n) in the order of ``inner_names``."""
        omega, inside = 2.0 * np.pi * LINES[:, None], slice(zone.first, zone.last + 1)
        (pad_u, sleeper_u), (pad_v, sleeper_v) = self.at_supports(excited), self.at_supports(measured)
        product = {"pad": pad_u * pad_v, "ballast": sleeper_u * sleeper_v}
        product["sleeper"] = product["ballast"]
        factor = {"stiffness": -1.0 + 0.0 * omega, "damping": -1j * omega, "mass": omega**2}
        common, own = {}, {}
        for o in OWN:
            value = getattr(self.track, o.field)
            common[o.field] = factor[o.what] * (product[o.link] @ value)[:, None]
            own[o.field] = factor[o.what] * (product[o.link][:, inside] * value[inside])
        u, v = self.displacement(excited), self.displacement(measured)
        for field, support, rows, weights, (stiffness, damping, mass) in self.following:
            change = (mass * omega**2 - 1j * omega * damping - stiffness)[:, 0]
            change = change * (u[:, rows] @ weights) * (v[:, rows] @ weights)
            common[field][:, 0] += change
            if zone.first <= support <= zone.last:
                own[field][:, support - zone.first] += change
        return np.concatenate([*(common[name] for name, *_ in COMMON), *(own[o.field] for o in OWN)], axis=1)

    def at_supports(self, place):
        """Stretch of every pad and motion of every sleeper under a unit force at a place, each (n_line, n_support)."""
        if place not in self.support:
            u, (rail, sleeper) = self.displacement(place), self.rows
            moved = u[:, sleeper]
            self.support[place] = u[:, rail] - moved, moved
        return self.support[place]

    @cached_property
    def rows(self):
        """Rows of the rail and of the sleeper at every support, each (n_support,)."""
        index, supports = self.matrices.index, range(self.track.support.size)
        return tuple(np.array([index[kind, j] for j in supports]) for kind in ("rail", "sleeper"))

    @cached_property
    def following(self):
        """Links of the terms that follow a value of their support: [(field, support, rows, weights, (k, c, m) per
        logarithm of the value)]. Soft ballast has a share of it, a pad's branch goes with the pad, a gap has none."""
        if not self.terms:
            return []
        found, known = [], self.links(self.terms)
        for field in dict.fromkeys(o.field for o in OWN):
            moved = self.links(self.terms, self.track.with_(**{field: getattr(self.track, field) * (1.0 + SHARE)}))
            for a, b in zip(known, moved):
                change = tuple((getattr(b, w) - getattr(a, w)) / SHARE for w in ("stiffness", "damping", "mass"))
                if any(change):
                    found.append((field, a.ends[0][0][1], *link_vector(a, self.matrices.index), change))
        return found

    def links(self, terms, track=None):
        """Links of ``terms`` on this track or another, tangents of their ports behind."""
        track = track or self.track
        return [*(link for term in terms for link in term.links(track)), *tangent(terms, track)]


def shown(terms, conditions):
    """Those of ``terms`` that are in a track's receptances, as they are under ``conditions``."""
    return tuple(t.under(conditions) for t in terms if t.kind in ("matrix", "port"))


def channel_factor(terms, sensor, frequency):
    """What linear channel terms make of a spectrum, (n,) complex."""
    factor = np.ones(frequency.size, dtype=complex)
    for term in terms:
        if hasattr(term, "transfer") and term.channel_name == sensor.name:
            factor = factor * term.transfer(frequency)
    return factor


def split(value):
    """Re and Im one behind the other, along the first axis."""
    return np.concatenate([value.real, value.imag])


def scaled(pair, h):
    """The pair's lines of a receptance on ``LINES`` over its measured magnitude, complex (n,) or (n, k)."""
    return h[pair.lines] / (pair.size if h.ndim == 1 else pair.size[:, None])
