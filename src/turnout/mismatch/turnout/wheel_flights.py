r"""Errors of wheels that leave the rail: how single wheels depart from the path of the file, by simulation.

A wheel that falls fast over a deep nose loses the rail and lands some decimetres further. Where and how hard it lands
depends on its own path, far more than linearly. At a nose 1.6 mm deep, under a locomotive at 37 m/s, a standard
deviation of depth changes the signal by four times the linear response, with another shape. With the simulated
signals :math:`y_\pm` of all wheels that deviate by plus and minus one standard deviation, and the signal y of none,

.. math:: y(\eta) \approx y + a\,\eta + b\,\eta^2, \quad a = \tfrac12 (y_+ - y_-), \quad b = \tfrac12 (y_+ + y_-) - y

For a standard normal deviation η the second moment of the last term is :math:`3 b^2`. Both are given to the wheels by
the power of their linear responses (``wheel_tops``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.turnout.surface_priors import WHEELS
from turnout.mismatch.turnout.wheel_tops import power_shares, share_difference

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from turnout.mismatch.turnout.passage_observation import AlignedPassage
    from turnout.mismatch.turnout.prediction import Predictor
    from turnout.mismatch.turnout.predictions import Values


@dataclass(frozen=True)
class Deviation:
    """Path part: ``dips`` (n,) [m] at increasing ``positions`` (n,) [m], linear between them, 0 outside."""

    positions: np.ndarray
    dips: np.ndarray

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        return np.interp(np.asarray(x, dtype=float), self.positions, self.dips, 0.0, 0.0)


def flight_modes(
    predictor: Predictor,
    values: Values,
    aligned: AlignedPassage,
    deviations: tuple[np.ndarray, np.ndarray],
    linear: np.ndarray,
) -> np.ndarray | None:
    """Signals of one standard deviation of each wheel's path, where wheels leave the rail.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    aligned : AlignedPassage
        The passage.
    deviations : (n_x,) and (n_path, n_x) array of float
        Positions, and one standard deviation of each way in which wheels depart there. [m]
    linear : (n_wheel, n_sensor * n_time, n_path) array of float
        Linear responses of each wheel to them. [m/s²]

    Returns
    -------
    (n_wheel, n_sensor * n_time, 2 n_path) array of float or None
        None if no wheel leaves the rail, on the path of the file or with the first deviation, or if the passage cannot
        be simulated. [m/s²]
    """
    positions, paths = deviations
    deviating = [(Deviation(positions, sign * path),) for path in paths for sign in (1.0, -1.0)]
    try:
        signal, forces = predictor.predict_over(values, aligned, ())
        first, first_forces = predictor.predict_over(values, aligned, deviating[0])
        if min(forces.min(), first_forces.min()) > 0.0:
            return None
        signals = [first, *(predictor.predict_over(values, aligned, further)[0] for further in deviating[1:])]
    except SimulationError:
        return None
    plus, minus = np.column_stack(signals[::2]), np.column_stack(signals[1::2])
    odd, even = 0.5 * (plus - minus), 0.5 * (plus + minus) - signal[:, None]
    n_row, window = len(aligned.sensors), max(1, round(WHEELS.sharing_time * aligned.clock))
    shares = power_shares(linear, n_row, window)
    return np.concatenate([share_difference(linear, odd, n_row, window), np.sqrt(3.0) * shares * even], axis=2)
