"""Hammer tests of a turnout as a case of their own, which is cheap to predict."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.mismatch.turnout.predicted_case import PredictedCase
from turnout.mismatch.turnout.priors import RECEPTANCE


class HammerCase(PredictedCase):
    """The hammer tests of a site alone: cheap, with exact derivatives."""

    def with_broad_errors(self) -> HammerCase:
        """The same case with one broad, independent error for every line.

        Smoothly varying errors would excuse a resonance at the wrong frequency.
        """
        broad = copy(self)
        broad.observations = tuple(
            replace(o, sigma=np.hypot(o.sigma, RECEPTANCE.broad_error), modes=None) for o in self.observations
        )
        return broad

    def fit_from_priors(self) -> dict[str, float]:
        """Values of the nuisances from a fit with broad errors, continued with the actual ones."""
        steps = THRESHOLDS.max_cheap_steps
        rough_fit = fit_jointly(self.with_broad_errors(), iterations=steps)
        return fit_jointly(self, values=rough_fit.values, iterations=steps).values
