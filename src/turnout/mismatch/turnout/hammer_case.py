"""Hammer tests of a turnout as a case of their own, which is cheap to predict."""

from dataclasses import replace

import numpy as np

from turnout.mismatch.engine.case import Case
from turnout.mismatch.turnout.screening import screen_columns
from turnout.mismatch.turnout.sensitivity import pair_columns

ROUGHLY = 0.1  # relative error of a receptance in the first, broad fit


class Blows(Case):
    """The hammer tests of a TrackCase alone: cheap, with exact derivatives."""

    def __init__(self, case, observations=None):
        chosen = case.observations if observations is None else observations
        self.whole, self.observations = case, tuple(o for o in chosen if o.name in case.pairs)
        unheard = case.surface.names if case.surface else ()
        shared = [n for n in case.nuisances if n.owner is None and "_wave_" not in n.name]
        self.nuisances = tuple(n for n in shared if n.name not in unheard)
        self.predict, self.moved = case.predict, case.moved

    def roughened(self):
        """The same case with one broad, independent error for every line.

        Smoothly varying errors would excuse a resonance at the wrong frequency.
        """
        plain = [replace(o, sigma=np.hypot(o.sigma, ROUGHLY), modes=None) for o in self.observations]
        return Blows(self.whole, plain)

    def screen(self, fit):
        """Columns of all candidates that show in hammer tests."""
        return screen_columns(self.whole, fit, self.observations)

    def nuisance_jacobian(self, values, terms, observations, base):
        """Exact derivatives by all nuisances of the case."""
        index = {n.name: k for k, n in enumerate(self.nuisances)}
        found = [np.zeros((o.data.size, len(self.nuisances))) for o in observations]
        heard_by = self.whole.blow_models(values, terms)
        for o, predicted, jacobian in zip(observations, base, found):
            pair = self.whole.pairs[o.name]
            pair_columns(self.whole, values, terms, pair, heard_by(pair), predicted, jacobian, index)
        return found
