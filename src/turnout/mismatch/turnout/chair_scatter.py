r"""Slide chairs and fastenings that differ from each other, as errors of receptances.

All chairs have a common factor (``chair_parameters``). Each differs from it, as a rail pad does from its neighbours. To
first order the receptance of a pair then errs by

.. math:: \delta H_{pq} = \sum_l \frac{\partial H_{pq}}{\partial \ln k_l} \xi_l
          + \frac{\partial H_{pq}}{\partial \ln c_l} \eta_l

with independent normal deviations :math:`\xi_l, \eta_l` of each chair. Each is one random error of the observation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.chair_parameters import chair_columns
from turnout.mismatch.turnout.priors import TRACK
from turnout.mismatch.turnout.receptance_observation import scale_lines, split_complex

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.turnout.prediction import Predictor
    from turnout.mismatch.turnout.predictions import Values
    from turnout.mismatch.turnout.receptance_observation import FrfPair

# Field of a Blade, scatter of its logarithm from chair to chair: as of pads, since a plate of this kind carries.
CHAIR_SCATTER = {
    "chair_stiffness": TRACK.support_stiffness_sd,
    "chair_damping": TRACK.support_damping_sd,
}


def chair_errors(predictor: Predictor, values: Values, pairs: Sequence[FrfPair]) -> Mapping[str, np.ndarray]:
    """Errors of receptances by single chairs, at one standard deviation each.

    Parameters
    ----------
    predictor : Predictor
        Of the site.
    values : mapping
        Nuisances of track and sensors.
    pairs : sequence of FrfPair
        Response channels of the hammer tests.

    Returns
    -------
    dict
        Name of a pair -> (n_line, n_error) array of complex [m/N]; {} without a blade.
    """
    errors, sensitivity_of = {}, predictor.pair_sensitivities(values, ())
    by_sensitivity: dict[int, np.ndarray | None] = {}
    for pair in pairs:
        sensitivity = sensitivity_of(pair)
        if id(sensitivity) not in by_sensitivity:
            columns = [CHAIR_SCATTER[name] * c for name, c in chair_columns(sensitivity).items()]
            by_sensitivity[id(sensitivity)] = np.concatenate(columns, axis=1) if columns else None
        if (all_errors := by_sensitivity[id(sensitivity)]) is not None:
            errors[pair.name] = all_errors[sensitivity.row_of(pair)].T
    return errors


def with_chair_errors(observation: Observation, pair: FrfPair, errors: np.ndarray, n_alike: int = 1) -> Observation:
    """The observation with the errors by single chairs as modes, which several tests have in common.

    Parameters
    ----------
    observation : Observation
        Of the pair.
    pair : FrfPair
        Response channel of a hammer test.
    errors : (n_line, n_error) array of complex
        As of ``chair_errors``. [m/N]
    n_alike : int
        Tests with impacts at this position and this sensor.

    Returns
    -------
    Observation
    """
    return observation.with_errors(split_complex(scale_lines(pair, errors)), n_alike)
