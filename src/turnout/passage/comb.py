r"""Explain the sensor envelopes by one row of axles that all sound alike: a comb with a free tooth.

.. math:: y_i(s) = \sum_j k_i(s - d_j) + e

The tooth k_i is what sensor i records of one wheel within ``TOOTH_HALF_WIDTH`` metres. It is estimated from the
recording, for every row of axles again. So it contains impacts at a crossing's nose, welds and sleeper positions.
Nothing is cut into peaks. A fit of the vehicles' shape moves their axles alike in every vehicle of one type.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from turnout.passage.kinematics import passing_times

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.passage.axle_patterns import Vehicle
    from turnout.passage.kinematics import Motion
    from turnout.passage.sensor_envelopes import SensorEnvelopes

COMB_STEP = 0.2  # m, step of the grid along the train
TOOTH_HALF_WIDTH = 2.4  # m either side of a wheel: less than bogie and gap, else a tooth could be a bogie
N_TAPS = 25  # 2 TOOTH_HALF_WIDTH / COMB_STEP + 1
SLOW_WIDTH = 2.5  # m, standard deviation of the slow part that is subtracted
SLOW_REACH = int(4.0 * SLOW_WIDTH / COMB_STEP + 0.5)  # points either side that the slow part is a mean of
BLOCK = 16  # motions of which profiles are computed at once; more fill the processor's cache
RIDGE = 0.03  # ridge on the tooth, relative to its own power
LEAD_LENGTH, TAIL_LENGTH = 12.0, 24.0  # m kept before and after the audible length
CORRELATION_LENGTH = 0.5  # m, correlation length of the residual of a comb
SLOW_WEIGHTS = np.exp(-0.5 / (SLOW_WIDTH / COMB_STEP) ** 2 * np.arange(-SLOW_REACH, SLOW_REACH + 1) ** 2)
SLOW_WEIGHTS /= SLOW_WEIGHTS.sum()
LAGS = np.abs(np.subtract.outer(np.arange(N_TAPS), np.arange(N_TAPS)))  # between two taps of a tooth


@dataclass(frozen=True)
class Comb:
    """Axles ``offsets`` (n_axle,) [m] on the grid: ``teeth`` (n,) and the inverse of the tooth's normal matrix."""

    offsets: np.ndarray
    teeth: np.ndarray
    inverse: np.ndarray

    @classmethod
    def of(cls, offsets: np.ndarray, amplitudes: np.ndarray | float = 1.0) -> Comb:
        """For axle offsets that begin at 0. [m]

        Parameters
        ----------
        offsets : (n_axle,) array of float
            Distances of the axles behind the first; the first is 0. [m]
        amplitudes : float or (n_axle,) array of float
            Height of each axle's tooth. [-]

        Returns
        -------
        Comb
            On a grid of ``COMB_STEP``.
        """
        offsets = np.asarray(offsets, float)
        teeth = np.zeros(int(offsets[-1] / COMB_STEP) + 3)
        whole = np.floor(offsets / COMB_STEP).astype(int)
        fraction = offsets / COMB_STEP - whole
        np.add.at(teeth, whole, amplitudes * (1.0 - fraction))
        np.add.at(teeth, whole + 1, amplitudes * fraction)
        auto = np.correlate(np.concatenate([teeth, np.zeros(N_TAPS - 1)]), teeth, "valid")
        return cls(offsets, teeth, np.linalg.inv(auto[LAGS] + RIDGE * auto[0] * np.eye(N_TAPS)))


@dataclass(frozen=True)
class Profiles:
    """Record of each sensor along the train for some ``motions`` (n_motion,), on a grid of ``COMB_STEP`` metres.

    ``values`` (n_sensor, n_motion, n) start ``LEAD_LENGTH`` metres before the audible part. ``spectra`` are their
    transforms, ``power`` (n_motion,) the sum of their squares, ``length`` (n_motion,) the audible metres.
    ``origin`` (n_motion,) [m] is the start of the audible part in the motion's own coordinate.
    """

    motions: tuple
    values: np.ndarray
    spectra: np.ndarray
    power: np.ndarray
    length: np.ndarray
    origin: np.ndarray

    def select(self, k: int) -> Profiles:
        """Motion number ``k`` alone.

        Parameters
        ----------
        k : int
            Number of the motion.

        Returns
        -------
        Profiles
            With one motion.
        """
        row = slice(k, k + 1)
        values, spectra = self.values[:, row], self.spectra[:, row]
        return Profiles(self.motions[row], values, spectra, self.power[row], self.length[row], self.origin[row])


def profiles_at(envelopes: SensorEnvelopes, motions: Sequence[Motion]) -> Profiles:
    """Profiles of all sensors for ``motions``, a sequence of ``Motion``.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motions : sequence of Motion
        Motions for which the records are put on the grid.

    Returns
    -------
    Profiles
        In the order of ``motions``.
    """
    step, amplitude, positions = envelopes.levels.step, envelopes.levels.amplitude, envelopes.positions
    extents = np.array([[m.distance(t) for t in (envelopes.begin, envelopes.end)] for m in motions])
    middle = np.array([m.direction * np.mean(positions) for m in motions])
    origin, length = (
        extents[:, 0] - middle,
        np.maximum(extents[:, 1] - extents[:, 0], 0.0),
    )  # 0: the train would have reversed
    n_points = ((length + LEAD_LENGTH + TAIL_LENGTH) / COMB_STEP).astype(int) + 1
    n = int(n_points.max())
    values = np.zeros((len(positions), len(motions), n))
    edges = np.arange(amplitude.shape[1] + 1) * step
    totals = [np.concatenate([[0.0], np.cumsum(row)]) * step for row in amplitude]
    # a few motions at once, of profiles about as long
    for k in np.split(np.argsort(n_points, kind="stable"), range(BLOCK, len(motions), BLOCK)):
        stop = n_points[k].max()
        grid = (origin[k] - LEAD_LENGTH)[:, None] + (np.arange(stop + 1) - 0.5) * COMB_STEP
        reflected, of_block = _reflected_indices(n_points[k], stop), [motions[j] for j in k]
        for i, x in enumerate(positions):
            borders = passing_times(of_block, grid, x)
            mean = np.diff(np.interp(borders, edges, totals[i]), axis=1) / np.maximum(np.diff(borders, axis=1), 1e-9)
            extended = np.take_along_axis(mean, reflected, axis=1)
            slow = ndimage.correlate1d(extended, SLOW_WEIGHTS, axis=1, mode="constant")[:, SLOW_REACH:-SLOW_REACH]
            values[i, k, :stop] = np.where(np.arange(stop) < n_points[k][:, None], mean - slow, 0.0)
    # every sensor has the same weight, at any level
    values /= np.maximum(np.sqrt(np.mean(values**2, axis=2, keepdims=True)), 1e-12)
    size = 2 ** int(np.ceil(np.log2(n + N_TAPS + 8)))
    power = np.maximum(np.sum(values**2, axis=(0, 2)), 1e-12)
    return Profiles(tuple(motions), values, np.fft.rfft(values, size, axis=2), power, length, origin)


def _reflected_indices(n_points: np.ndarray, stop: int) -> np.ndarray:
    """(n_row, stop + 2 SLOW_REACH) indices of rows that go on behind both ends as if mirrored there.

    Only the first ``n_points`` (n_row,) of each row count.
    """
    period = 2 * n_points[:, None]
    index = np.arange(-SLOW_REACH, stop + SLOW_REACH) % period
    return np.minimum(index, period - 1 - index)


def explained_share(profiles: Profiles, comb: Comb, rows: np.ndarray, stride: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """(n_row, n_start) share of the profiles' power that the comb explains in the motions ``rows``, and the starts [m].

    A start is the position of the first axle, in metres behind the beginning of the audible part.

    Parameters
    ----------
    profiles : Profiles
        Records of the sensors along the train.
    comb : Comb
        Axles of the row.
    rows : (n_row,) array of int
        Numbers of the motions.
    stride : int
        Every how many grid points a start is tried.

    Returns
    -------
    share : (n_row, n_start) array of float
        Explained share of the power. [-]
    starts : (n_start,) array of float
        Position of the first axle. [m]
    """
    size, half = 2 * (profiles.spectra.shape[2] - 1), N_TAPS // 2
    teeth = np.fft.rfft(comb.teeth, size).conj()
    last = max(float(profiles.length[rows].max() - comb.offsets[-1]), 0.0) + 4.0
    first, stop = int((LEAD_LENGTH - 4.0) / COMB_STEP), int((LEAD_LENGTH + last) / COMB_STEP) + 1
    total = np.zeros((len(rows), 1))
    for spectra in profiles.spectra:
        correlation = np.fft.irfft(spectra[rows] * teeth, size, axis=1)
        windows = np.lib.stride_tricks.sliding_window_view(correlation[:, first - half : stop + half], N_TAPS, axis=1)
        windows = windows[:, ::stride]
        total = total + np.einsum("rsk,rsk->rs", windows @ comb.inverse, windows)
    starts = np.arange(first, stop)[::stride] * COMB_STEP - LEAD_LENGTH
    return total / profiles.power[rows][:, None], starts[: total.shape[1]]


def evidence(share: np.ndarray | float, length: np.ndarray | float, n_sensor: int) -> np.ndarray:
    r"""Log Bayes factor of the comb against no comb: :math:`-\frac n2 \ln(1 - R^2)` less the Schwarz penalty.

    The penalty is what the free numbers of the teeth gain by chance. ``share`` is R², ``length`` [m] the audible
    length.

    Parameters
    ----------
    share : float or (...) array of float
        R², the explained share of the power. [-]
    length : float or (...) array of float
        Audible length, broadcast against ``share``. [m]
    n_sensor : int
        Number of independent sensors.

    Returns
    -------
    (...) array of float
        Log Bayes factor. [nat]

    References
    ----------
    Schwarz 1978, Estimating the dimension of a model, Annals of Statistics 6, 461-464.
    """
    n = np.maximum(length / CORRELATION_LENGTH, 2.0) * n_sensor
    return -0.5 * n * np.log(np.maximum(1.0 - share, 1e-6)) - 0.5 * N_TAPS * n_sensor * np.log(n)


def teeth_of(profiles: Profiles, comb: Comb, start: float) -> tuple[np.ndarray, np.ndarray]:
    """(n_sensor, N_TAPS) tooth of each sensor, (n_sensor, n) residual of the comb; ``profiles`` of one motion.

    Parameters
    ----------
    profiles : Profiles
        Records along the train for one motion.
    comb : Comb
        Axles of the row.
    start : float
        First axle behind the beginning of the audible part. [m]

    Returns
    -------
    teeth : (n_sensor, N_TAPS) array of float
        What each sensor records of one wheel. [-]
    residuals : (n_sensor, n) array of float
        Profiles without the comb. [-]
    """
    low = round((start + LEAD_LENGTH) / COMB_STEP) - N_TAPS // 2
    n_model = comb.teeth.size + N_TAPS - 1
    before, after = max(-low, 0), max(low + n_model - profiles.values.shape[2], 0)
    teeth, residuals = [], []
    for values in profiles.values[:, 0]:
        residual = np.pad(values, (before, after))  # a wheel may have passed before the record
        inside = residual[low + before :][:n_model]
        tooth = comb.inverse @ np.correlate(inside, comb.teeth, "valid")
        inside -= np.convolve(comb.teeth, tooth)
        teeth.append(tooth)
        residuals.append(residual[before : before + values.size])
    return np.array(teeth), np.array(residuals)


MAX_CENTRING_PASSES = 4  # of a tooth that is shifted and estimated again


def centred_start(profiles: Profiles, comb: Comb, start: float) -> float:
    """Start of the comb at which the teeth lie about their middle; ``profiles`` of one motion. [m]

    A tooth that is narrower than its window explains as much at many starts, as it moves within the window. A wheel's
    vibration decays alike on both sides, so the wheel is where the teeth are most symmetric.

    Parameters
    ----------
    profiles : Profiles
        Records along the train for one motion.
    comb : Comb
        Axles of the row.
    start : float
        First axle behind the beginning of the audible part, up to ``TOOTH_HALF_WIDTH`` from the wheel. [m]

    Returns
    -------
    float
        The first axle behind the beginning of the audible part. [m]
    """
    grid_start, shift = round(start / COMB_STEP) * COMB_STEP, 0.0
    for _ in range(MAX_CENTRING_PASSES):
        teeth, _ = teeth_of(profiles, comb, grid_start)
        symmetry = np.sum([np.convolve(tooth, tooth) for tooth in teeth], axis=0)
        shift = 0.5 * COMB_STEP * (int(np.argmax(symmetry)) - (N_TAPS - 1))
        if abs(shift) <= 0.5 * COMB_STEP:
            break
        grid_start += round(shift / COMB_STEP) * COMB_STEP
    return grid_start + shift


SHAPE_STRIDES = (0.24, 0.12, 0.06, 0.03)  # m, by which axles are moved, coarse to fine
MAX_BOGIE_WHEELBASE = 3.6  # m: axles of one bogie are also moved against each other
MAX_MOVE = 0.6  # m, of an axle
MIN_SHARE_GAIN = 1e-4  # least gain of the explained share by a move
START_SHIFTS = np.arange(-2, 3) * COMB_STEP  # m by which the whole row may be shifted


def fit_shape(
    profiles: Profiles, vehicles: Sequence[Vehicle], positions: np.ndarray, start: float
) -> tuple[np.ndarray, float, float]:
    """(positions, share before, share after): ``positions`` moved until the comb explains most, alike in all vehicles.

    A train without template that resembles a known one differs in wheelbases or pivots of every vehicle. Axles that
    move one by one do not show that: the estimated tooth becomes wider until they seem to be right.

    Parameters
    ----------
    profiles : Profiles
        Of one motion.
    vehicles : sequence of Vehicle
        The row, its axles at ``positions``.
    positions : (n_axle,) array of float
        Metres behind the first axle.
    start : float
        First axle behind the beginning of the audible part. [m]

    Returns
    -------
    positions : (n_axle,) array of float
        Moved positions. [m]
    share_before, share_after : float
        Explained share of the power with ``positions`` as given and as moved. [-]
    """
    axle_keys = [(v.name, i) for v in vehicles for i in range(len(v.axles))]
    unique_keys = list(dict.fromkeys(axle_keys))
    key_index = np.array([unique_keys.index(key) for key in axle_keys])
    change = np.zeros(len(unique_keys))
    share_after = share_before = _best_share(profiles, positions, start)
    for stride in SHAPE_STRIDES:
        for _ in range(4):
            previous = share_after
            for move in _shape_moves(vehicles, unique_keys):
                for signed in (stride, -stride):
                    trial = np.clip(change + signed * move, -MAX_MOVE, MAX_MOVE)
                    share = _best_share(profiles, positions + trial[key_index], start)
                    if share > share_after + MIN_SHARE_GAIN:
                        share_after, change = share, trial
                        break
            if share_after - previous < 4 * MIN_SHARE_GAIN:
                break
    return positions + change[key_index], share_before, share_after


def _shape_moves(vehicles: Sequence[Vehicle], unique_keys: list[tuple[str, int]]) -> list[np.ndarray]:
    """Moves of each axle of a vehicle type: alone, against its neighbour in a bogie, and bogies against each other."""
    index, moves = {key: k for k, key in enumerate(unique_keys)}, list(np.eye(len(unique_keys)))
    for v in {v.name: v for v in vehicles}.values():
        axle_indices = np.array([index[v.name, i] for i in range(len(v.axles))])
        all_bogies = np.zeros(len(unique_keys))
        for i, gap in enumerate(np.diff(v.axles)):
            if gap < MAX_BOGIE_WHEELBASE:
                stretch = np.zeros(len(unique_keys))
                stretch[axle_indices[i : i + 2]] = -0.5, 0.5
                moves.append(stretch)
                all_bogies += stretch
        pivots = np.zeros(len(unique_keys))
        pivots[axle_indices] = np.where(np.asarray(v.axles) < 0.5 * v.length, -0.5, 0.5)
        moves += [all_bogies, pivots]
    return moves


def _best_share(profiles: Profiles, positions: np.ndarray, start: float) -> float:
    """Share of the power that a comb at ``positions`` explains, at the best of a few starts near ``start``."""
    first = positions[0]
    if not np.all(np.diff(positions) > 0.5):
        return -np.inf
    comb = Comb.of(positions - first)
    teeth = np.flatnonzero(comb.teeth)
    # whole steps: the tooth takes up the remainder
    index = np.rint((start + first + START_SHIFTS + LEAD_LENGTH) / COMB_STEP).astype(int) + N_TAPS
    taps = (index - N_TAPS // 2)[:, None, None] + teeth[:, None] + np.arange(N_TAPS)
    total = np.zeros(START_SHIFTS.size)
    for values in profiles.values[:, 0]:
        padded = np.zeros(values.size + 2 * N_TAPS + comb.teeth.size)
        padded[N_TAPS : N_TAPS + values.size] = values
        correlation = comb.teeth[teeth] @ padded[taps]
        total += np.sum(correlation @ comb.inverse * correlation, axis=1)
    return float(total.max() / profiles.power[0])
