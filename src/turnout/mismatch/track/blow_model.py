"""Receptances of a track as blows find it: its matrices with terms in them, solved once per place."""

from functools import cached_property

import numpy as np

from turnout.mismatch.track.base_model import OWN
from turnout.mismatch.track.blows import LINES, SHIFTED
from turnout.mismatch.track.skeleton import FixedLinks, matrices_of
from turnout.simulate.frequency_response import responses
from turnout.simulate.links import Link, links_of, ports_of
from turnout.simulate.matrices import link_vector

SWING = 1e-6  # motion of a blow for the tangent of a law [m]
# Rate of a joint under a blow: from that of a free one to that of one which is held, over so much force against it.
# Blows of 5 kN on a simulated track with friction of 0.3 to 8 kN are met best at 20, 13, 8, 3 and 1.5 mm/s.
FREE, HELD, HOLDING = 0.021, 1.5e-3, 2e3  # [m/s, m/s, N]
SHARE = 1e-3  # of a support's value, by which what follows it is found


def tangent(terms, track):
    """Links of the terms' ports as a blow finds them: their secant over a micrometre and the rate that they leave."""
    found = []
    for port in ports_of(terms, track):
        law, d = port.law, -port.gap
        k = (float(law.force(d + SWING, 0.0)) - float(law.force(d - SWING, 0.0))) / (2.0 * SWING)
        rate = HELD + (FREE - HELD) * np.exp(-abs(_against(law, d, FREE)) / HOLDING)
        c = _against(law, d, rate) / rate
        found.append(Link(port.ends, k, c, tag="tangent"))
    return found


def linear(track, terms):
    """Matrices of a track with ``terms`` in it, their ports by ``tangent``."""
    return matrices_of(track, (*terms, FixedLinks(tangent(terms, track))))


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
    """Receptances of one track with terms at given conditions on ``LINES``."""

    def __init__(self, track, terms):
        self.track, self.terms = track, terms
        self.matrices = linear(track, terms)
        self.own_shear = _own_shear(track, terms)
        self.by_place, self.weight = {}, {}

    def solve(self, places):
        """Remember the displacements under unit forces at these places: together they need one factorisation."""
        new = [p for p in dict.fromkeys(places) if p not in self.by_place]
        if new:
            found = responses(self.matrices, SHIFTED, new)
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
        return h if isinstance(measured, tuple) else h + self.matrices.compliance(float(excited), float(measured))

    def seat_gradient(self, excited, measured, way=0.01):
        """Derivative by the sensor's place on the rail, (n_line,) [1/N]; 0 on a sleeper."""
        if isinstance(measured, tuple):
            return np.zeros(LINES.size, dtype=complex)
        return (self.receptance(excited, measured + way) - self.receptance(excited, measured - way)) / (2.0 * way)

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
        return [*links_of(terms, track), *tangent(terms, track)]
