r"""Errors of single wheels over the tops of a switch: each sinks deeper than the file says, or changes further.

The linear response :math:`L_w` of wheel w to its own path takes every slide chair as closed, which errs by half of the
size. The response Q when all wheels follow the same path is simulated, with chairs that open. What both differ by is
given to the wheels by the power of their linear responses about each sample,

.. math:: M_w = L_w + s_w \Big(Q - \sum_v L_v\Big), \quad s_w = \frac{\overline{L_w^2}}{\sum_v \overline{L_v^2}}

so that the modes of all wheels together are the simulated response.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.turnout.surface_priors import WHEELS
from turnout.physics.term import PhysicsTerm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.mismatch.turnout.passage_observation import AlignedPassage
    from turnout.mismatch.turnout.prediction import Predictor
    from turnout.mismatch.turnout.predictions import Values
    from turnout.mismatch.turnout.wave_response import WaveTransfer
    from turnout.simulate.track import Track
    from turnout.simulate.vehicle import Vehicle
    from turnout.simulate.wheel_path import PathPart


@dataclass(frozen=True)
class TopDeviation:
    """Path part: ``amount`` standard deviations of a wheel over a ``top``, deeper or ``is_shift``: further.

    ``on_blade``: it belongs to the blade, else to both lines.
    """

    top: PathPart
    is_shift: bool
    amount: float
    on_blade: bool

    def __call__(self, x: np.ndarray, wheel: int = 0) -> np.ndarray:
        if not self.is_shift:
            return self.amount * WHEELS.depth_sd * self.top(x, wheel)
        x = np.asarray(x, dtype=float)
        half = 0.5 * WHEELS.slope_length
        slope = (self.top(x + half, wheel) - self.top(x - half, wheel)) / WHEELS.slope_length
        return self.amount * WHEELS.position_sd * slope


@dataclass(frozen=True)
class TopChange(PhysicsTerm):
    """All wheels meet one top with a deviation; no effect of the library, but the path of a difference quotient."""

    top: PathPart
    is_shift: bool
    on_blade: bool
    amount: float = 1.0

    name = "top_change"
    asked = False
    effect_type = "path"
    parameters = ()

    @classmethod
    def example(cls) -> Self:
        """Of a blade that is 10 mm low at its toe."""
        from turnout.simulate.wheel_path import BladeTop

        return cls(BladeTop(9.0, 3.0, 0.01), False, True)

    def deviation(self, amount: float, on_blade: bool) -> TopDeviation:
        """The deviation on one line, or on both.

        Parameters
        ----------
        amount : float
            In standard deviations.
        on_blade : bool
            On the blade alone, else on both lines.

        Returns
        -------
        TopDeviation
        """
        return TopDeviation(self.top, self.is_shift, amount, on_blade)

    def paths(self, track: Track | None, vehicle: Vehicle | None) -> Sequence[PathPart]:
        """The deviation of the blade; that of the stock rail is one of both lines less one of the blade."""
        of_blade = self.deviation(self.amount if self.on_blade else -self.amount, True)
        return (of_blade,) if self.on_blade else (self.deviation(self.amount, False), of_blade)


def top_modes(
    predictor: Predictor,
    values: Values,
    aligned: AlignedPassage,
    transfer: WaveTransfer,
    tops: Sequence[tuple[PathPart, bool]],
) -> np.ndarray:
    """Signals of one standard deviation of each wheel over each top.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    aligned : AlignedPassage
        The passage.
    transfer : WaveTransfer
        Of the passage.
    tops : sequence of (path part, bool)
        Components of the tops, and whether each is on the blade.

    Returns
    -------
    (n_sensor * n_time, n_wheel * 2 n_top) array of float
        [m/s²]
    """
    changes = [
        TopChange(component, is_shift, on_blade)
        for component, on_blade in tops
        if np.max(np.abs(component(transfer.fine_grid, 0))) >= WHEELS.min_depth
        for is_shift in (False, True)
    ]
    if not changes:
        return np.zeros((len(aligned.sensors) * aligned.time.size, 0))
    grid, blank = transfer.fine_grid, 0.0 * transfer.fine_grid
    paths = [c.deviation(1.0, c.on_blade)(grid) for c in changes]
    on_stock = np.array([blank if c.on_blade else p for c, p in zip(changes, paths)])
    on_blade = np.array([p if c.on_blade else blank for c, p in zip(changes, paths)])
    linear = transfer.tops_response(on_stock, on_blade, transfer.wheels())
    common = _simulated_responses(predictor, values, aligned, changes)
    window = max(1, round(WHEELS.sharing_time * aligned.clock))
    modes = linear if common is None else share_difference(linear, common, len(aligned.sensors), window)
    return np.concatenate(list(modes), axis=1)


def share_difference(linear: np.ndarray, common: np.ndarray, n_row: int, window: int) -> np.ndarray:
    """Responses of single wheels whose sum is a given common one.

    Parameters
    ----------
    linear : (n_wheel, n_row * n, n_path) array of float
        Linear responses of each wheel.
    common : (n_row * n, n_path) array of float
        Response of all wheels.
    n_row : int
        Number of sensors, one after the other.
    window : int
        Samples over which the power of a response is averaged.

    Returns
    -------
    (n_wheel, n_row * n, n_path) array of float
    """
    return linear + power_shares(linear, n_row, window) * (common - linear.sum(axis=0))


def power_shares(linear: np.ndarray, n_row: int, window: int) -> np.ndarray:
    """Share of each wheel in the power of responses about each sample.

    Parameters
    ----------
    linear : (n_wheel, n_row * n, n_path) array of float
        Linear responses of each wheel.
    n_row : int
        Number of sensors, one after the other.
    window : int
        Samples to either side over which the power of a response is averaged.

    Returns
    -------
    (n_wheel, n_row * n, n_path) array of float
        Their sum over the wheels is 1.
    """
    n_wheel, size, n_path = linear.shape
    square = (linear**2).reshape(n_wheel, n_row, size // n_row, n_path)
    cumulated = np.cumsum(np.pad(square, ((0, 0), (0, 0), (window, window), (0, 0))), axis=2)
    power = (cumulated[:, :, 2 * window :] - cumulated[:, :, : -2 * window])[:, :, : size // n_row]
    power = np.maximum(power, 0.0).reshape(linear.shape) + np.finfo(float).tiny
    return power / power.sum(axis=0)


def _simulated_responses(
    predictor: Predictor, values: Values, aligned: AlignedPassage, changes: Sequence[TopChange]
) -> np.ndarray | None:
    """(n_sensor * n_time, n_change) response of a passage to each change; None if it cannot be simulated."""
    step = WHEELS.deviation_step
    try:
        base = predictor.predict_passage(values, (), aligned, with_probes=False)
        changed = [
            predictor.predict_passage(
                values, (TopChange(c.top, c.is_shift, c.on_blade, step),), aligned, with_probes=False
            )
            for c in changes
        ]
    except SimulationError:
        return None
    return np.column_stack([(predicted - base) / step for predicted in changed])
