r"""Single supports beside their position in the track file, as errors of receptances.

A sleeper lies a centimetre or two from its place in the drawing. To first order the receptance of a pair then errs by

.. math:: \delta H_{pq} = \sum_j \frac{\partial H_{pq}}{\partial x_j} \xi_j

with independent normal deviations :math:`\xi_j` of each support. Each is one random error of the observation. Without
them, a bay that is a few centimetres shorter looks like a small mass on the rail.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.priors import TRACK

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.turnout.predictions import Values


def support_errors(predictor: Predictor, values: Values, observations: Sequence[Observation]) -> list[np.ndarray]:
    """Errors of receptances by the positions of single supports, at one standard deviation each.

    Parameters
    ----------
    predictor : Predictor
        Of the site, with the pairs of the observations.
    values : mapping
        Nuisances of track and sensors.
    observations : sequence of Observation
        Receptances.

    Returns
    -------
    list of (n, n_support) array of float
        One for each observation, in its unit. Supports that cannot be moved in the simulation have none.
    """
    filed = predictor.predict(values, (), observations)
    columns: list[list[np.ndarray]] = [[] for _ in observations]
    for support in predictor.site.nominal.effect_supports:
        with suppress(SimulationError):
            moved = _with_moved_support(predictor, support).predict(values, (), observations)
            for column, before, after in zip(columns, filed, moved):
                column.append((after - before) * TRACK.support_position_sd / TRACK.support_position_step)
    return [np.column_stack(c) if c else np.zeros((o.data.size, 0)) for c, o in zip(columns, observations)]


def _with_moved_support(predictor: Predictor, support: int) -> Predictor:
    site = predictor.site
    turnout = site.nominal.turnout.with_moved_support(support, TRACK.support_position_step)
    moved = replace(site, nominal=replace(site.nominal, turnout=turnout))
    return Predictor(moved, predictor.solver).with_recordings(predictor.frf_pairs, {})
