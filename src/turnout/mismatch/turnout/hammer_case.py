"""Hammer tests of a turnout as a case of their own, which needs no simulation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.mismatch.turnout.predicted_case import PredictedCase
from turnout.mismatch.turnout.priors import RECEPTANCE

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.accepted_effects import AcceptedEffects
    from turnout.mismatch.turnout.case_data import CaseData
    from turnout.mismatch.turnout.prediction import PredictionCache, Predictor


class HammerCase(PredictedCase):
    """The hammer tests of a site alone, with exact derivatives."""

    def with_broad_errors(self) -> HammerCase:
        """The same case with one broad, independent error for every line.

        Smoothly varying errors would tolerate a resonance at the wrong frequency.
        """
        broad = copy(self)
        broad.observations = tuple(
            replace(o, sigma=np.hypot(o.sigma, RECEPTANCE.broad_error), modes=None) for o in self.observations
        )
        return broad

    def fit_from_priors(self) -> Fit:
        """Fit of the nuisances in the deepest of several minima.

        A fit with broad errors leads to the first, and is continued with the actual ones. The cost has further minima,
        in which neighbouring pads share out what they explain together in another way. So fits begin at draws of the
        priors as well: ``RECEPTANCE.n_drawn_starts``, always the same.
        """
        steps = THRESHOLDS.max_hammer_steps
        rough_fit = fit_jointly(self.with_broad_errors(), iterations=steps)
        fits = [fit_jointly(self, values=rough_fit.values, iterations=steps)]
        for start in self._drawn_starts():
            with suppress(SimulationError):  # it cannot be simulated there
                fits.append(fit_jointly(self, values=start, iterations=steps))
        return min(fits, key=lambda f: f.cost)

    def _drawn_starts(self) -> Iterator[dict[str, float]]:
        """Draws of the priors of all nuisances, within their bounds."""
        rng = np.random.default_rng(RECEPTANCE.n_drawn_starts)
        for _ in range(RECEPTANCE.n_drawn_starts):
            drawn = [n.mean + n.sd * float(rng.normal()) for n in self.nuisances]
            yield {n.name: float(np.clip(v, *n.bounds)) for n, v in zip(self.nuisances, drawn)}


def hammer_case(
    data: CaseData,
    predictor: Predictor,
    candidates: Sequence[Candidate],
    accepted: AcceptedEffects,
    cache: PredictionCache,
) -> HammerCase:
    """Case of the fitted hammer tests alone.

    Parameters
    ----------
    data : CaseData
        Observations and site.
    predictor : Predictor
        Predicts the recordings of the site.
    candidates : sequence of Candidate
        Effects that have columns in hammer tests.
    accepted : AcceptedEffects
        Part of every prediction.
    cache : callable
        Makes the cache around the predictor.

    Returns
    -------
    HammerCase
        It has the start values of its own fits, the means of its nuisances.
    """
    observations = [o for o in data.observations if o.name in data.frf_pairs]
    nuisances = data.site.shared_nuisances()
    return HammerCase(predictor, observations, nuisances, candidates, accepted, cache(predictor, True))
