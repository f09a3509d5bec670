"""Hammer tests of a turnout as a case of their own, which is cheap to predict."""

from dataclasses import replace

import numpy as np

from turnout.mismatch.engine.case import Case
from turnout.mismatch.turnout.screening import screen_columns
from turnout.mismatch.turnout.sensitivity import fill_pair_columns

BROAD_ERROR = 0.1  # relative error of a receptance in the first, broad fit


class HammerCase(Case):
    """The hammer tests of a TrackCase alone: cheap, with exact derivatives."""

    def __init__(self, case, observations=None):
        chosen = case.observations if observations is None else observations
        self.track_case, self.observations = case, tuple(o for o in chosen if o.name in case.frf_pairs)
        surface_names = case.surface.names if case.surface else ()
        shared = [n for n in case.nuisances if n.owner is None and "_wave_" not in n.name]
        self.nuisances = tuple(n for n in shared if n.name not in surface_names)
        self.predict, self.predict_near = case.predict, case.predict_near

    def with_broad_errors(self):
        """The same case with one broad, independent error for every line.

        Smoothly varying errors would excuse a resonance at the wrong frequency.
        """
        broad = [replace(o, sigma=np.hypot(o.sigma, BROAD_ERROR), modes=None) for o in self.observations]
        return HammerCase(self.track_case, broad)

    def screen(self, fit):
        """Columns of all candidates that show in hammer tests."""
        return screen_columns(self.track_case, fit, self.observations)

    def nuisance_jacobian(self, values, terms, observations, base):
        """Exact derivatives by all nuisances of the case."""
        index = {n.name: k for k, n in enumerate(self.nuisances)}
        jacobians = [np.zeros((o.data.size, len(self.nuisances))) for o in observations]
        sensitivity_of = self.track_case.pair_sensitivities(values, terms)
        for o, predicted, jacobian in zip(observations, base, jacobians):
            pair = self.track_case.frf_pairs[o.name]
            fill_pair_columns(self.track_case, values, terms, pair, sensitivity_of(pair), predicted, jacobian, index)
        return jacobians
