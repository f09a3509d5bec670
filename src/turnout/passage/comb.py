r"""Explain the sensor envelopes by one row of axles that all sound alike: a comb with a free tooth.

.. math:: y_i(s) = \sum_j k_i(s - d_j) + e

The tooth k_i is what sensor i records of one wheel within ``TOOTH_HALF_WIDTH`` metres. It is estimated from the
recording, for every row of axles again. So it contains impacts at a crossing's nose, welds and sleeper positions.
Nothing is cut into peaks. A fit of the vehicles' shape moves their axles alike in every vehicle of one type.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, ndimage

STEP = 0.2  # m, step of the grid along the train
HALF = 2.4  # m either side of a wheel: less than bogie and gap, else a tooth could be a bogie
TAPS = 25  # 2 TOOTH_HALF_WIDTH / COMB_STEP + 1
WIDE = 2.5  # m, standard deviation of the slow part that is subtracted
STIFF = 0.03  # ridge on the tooth, relative to its own power
LEAD, TAIL = 12.0, 24.0  # m kept before and after the audible length
ALIKE = 0.5  # m, correlation length of the residual of a comb


@dataclass(frozen=True)
class Comb:
    """Axles ``offsets`` (n_axle,) [m] on the grid: ``teeth`` (n,) and the inverse of the tooth's normal matrix."""

    offsets: np.ndarray
    teeth: np.ndarray
    inverse: np.ndarray

    @classmethod
    def of(cls, offsets) -> Comb:
        """For axle offsets that begin at 0. [m]"""
        offsets = np.asarray(offsets, float)
        teeth = np.zeros(int(offsets[-1] / STEP) + 3)
        whole = np.floor(offsets / STEP).astype(int)
        part = offsets / STEP - whole
        np.add.at(teeth, whole, 1.0 - part)
        np.add.at(teeth, whole + 1, part)
        padded = np.pad(teeth, (0, TAPS))
        auto = np.array([teeth @ padded[lag : lag + teeth.size] for lag in range(TAPS)])
        return cls(offsets, teeth, np.linalg.inv(linalg.toeplitz(auto) + STIFF * auto[0] * np.eye(TAPS)))


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

    def part(self, k: int) -> Profiles:
        """Motion number ``k`` alone."""
        one = slice(k, k + 1)
        values, spectra = self.values[:, one], self.spectra[:, one]
        return Profiles(self.motions[one], values, spectra, self.power[one], self.length[one], self.origin[one])


def profiles_at(listening, motions) -> Profiles:
    """Profiles of all sensors for ``motions``, a sequence of ``Motion``."""
    step, amplitude, positions = listening.levels.step, listening.levels.amplitude, listening.positions
    ends = np.array([[m.way(t) for t in (listening.begin, listening.end)] for m in motions])
    middle = np.array([m.direction * np.mean(positions) for m in motions])
    origin, length = ends[:, 0] - middle, np.maximum(ends[:, 1] - ends[:, 0], 0.0)  # 0: the train would have reversed
    n = int((length.max() + LEAD + TAIL) / STEP) + 1
    values = np.zeros((len(positions), len(motions), n))
    edges = np.arange(amplitude.shape[1] + 1) * step
    for i, x in enumerate(positions):
        total = np.concatenate([[0.0], np.cumsum(amplitude[i])]) * step
        for k, motion in enumerate(motions):
            m = min(int((length[k] + LEAD + TAIL) / STEP) + 1, n)
            borders = motion.passing(origin[k] - LEAD + (np.arange(m + 1) - 0.5) * STEP, x)
            mean = np.diff(np.interp(borders, edges, total)) / np.maximum(np.diff(borders), 1e-9)
            values[i, k, :m] = mean - ndimage.gaussian_filter1d(mean, WIDE / STEP)
    # every sensor has the same weight, at any level
    values /= np.maximum(np.sqrt(np.mean(values**2, axis=2, keepdims=True)), 1e-12)
    size = 2 ** int(np.ceil(np.log2(n + TAPS + 8)))
    power = np.maximum(np.sum(values**2, axis=(0, 2)), 1e-12)
    return Profiles(tuple(motions), values, np.fft.rfft(values, size, axis=2), power, length, origin)


def explained(profiles: Profiles, comb: Comb, rows, every: int = 1):
    """(n_row, n_start) share of the profiles' power that the comb explains in the motions ``rows``, and the starts [m].

    A start is the position of the first axle, in metres behind the beginning of the audible part.
    """
    size, half = 2 * (profiles.spectra.shape[2] - 1), TAPS // 2
    teeth = np.fft.rfft(comb.teeth, size).conj()
    last = max(float(profiles.length[rows].max() - comb.offsets[-1]), 0.0) + 4.0
    first, stop = int((LEAD - 4.0) / STEP), int((LEAD + last) / STEP) + 1
    total = 0.0
    for spectra in profiles.spectra:
        found = np.fft.irfft(spectra[rows] * teeth, size, axis=1)
        windows = np.lib.stride_tricks.sliding_window_view(found[:, first - half : stop + half], TAPS, axis=1)
        windows = windows[:, ::every]
        total = total + np.einsum("rsk,rsk->rs", windows @ comb.inverse, windows)
    starts = np.arange(first, stop)[::every] * STEP - LEAD
    return total / profiles.power[rows][:, None], starts[: total.shape[1]]


def evidence(share, length, n_sensor: int):
    r"""Log Bayes factor of the comb against no comb: :math:`-\frac n2 \ln(1 - R^2)` less the Schwarz penalty.

    The penalty is what the free numbers of the teeth gain by chance. ``share`` is R², ``length`` [m] the audible
    length.
    """
    n = np.maximum(length / ALIKE, 2.0) * n_sensor
    return -0.5 * n * np.log(np.maximum(1.0 - share, 1e-6)) - 0.5 * TAPS * n_sensor * np.log(n)


def teeth_of(profiles: Profiles, comb: Comb, start: float):
    """(n_sensor, N_TAPS) tooth of each sensor, (n_sensor, n) residual of the comb; ``profiles`` of one motion."""
    size, half = 2 * (profiles.spectra.shape[2] - 1), TAPS // 2
    at = round((start + LEAD) / STEP)
    teeth, rest = [], []
    for spectrum, values in zip(profiles.spectra[:, 0], profiles.values[:, 0]):
        found = np.fft.irfft(spectrum * np.fft.rfft(comb.teeth, size).conj(), size)
        tooth = comb.inverse @ found[at - half : at + half + 1]
        model, low = np.convolve(comb.teeth, tooth), at - half
        left, part = values.copy(), slice(max(low, 0), min(low + model.size, values.size))
        left[part] -= model[part.start - low : part.stop - low]
        teeth.append(tooth)
        rest.append(left)
    return np.array(teeth), np.array(rest)


STRIDES = (0.24, 0.12, 0.06, 0.03)  # m, by which axles are moved, coarse to fine
BOGIE = 3.6  # m: axles of one bogie are also moved against each other
WORTH = 1e-4  # least gain of the explained share by a move
STARTS = np.arange(-2, 3) * STEP  # m by which the whole row may be shifted


def reshaped(profiles: Profiles, vehicles, places, start: float, reach: float = 0.6):
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
        Of the first axle, behind the beginning of the audible part. [m]
    reach : float
        Largest move of an axle. [m]
    """
    kinds = [(v.name, i) for v in vehicles for i in range(len(v.axles))]
    names = list(dict.fromkeys(kinds))
    which = np.array([names.index(kind) for kind in kinds])
    change = np.zeros(len(names))
    best = first = _share(profiles, places, start)
    for stride in STRIDES:
        for _ in range(4):
            before = best
            for move in _moves(vehicles, names):
                for signed in (stride, -stride):
                    trial = np.clip(change + signed * move, -reach, reach)
                    share = _share(profiles, places + trial[which], start)
                    if share > best + WORTH:
                        best, change = share, trial
                        break
            if best - before < 4 * WORTH:
                break
    return places + change[which], first, best


def _moves(vehicles, names):
    """Moves of each axle of a vehicle type: alone, against its neighbour in a bogie, and bogies against each other."""
    index, moves = {name: k for k, name in enumerate(names)}, list(np.eye(len(names)))
    for v in {v.name: v for v in vehicles}.values():
        own = np.array([index[v.name, i] for i in range(len(v.axles))])
        wide = np.zeros(len(names))
        for i, gap in enumerate(np.diff(v.axles)):
            if gap < BOGIE:
                stretch = np.zeros(len(names))
                stretch[own[i : i + 2]] = -0.5, 0.5
                moves.append(stretch)
                wide += stretch
        apart = np.zeros(len(names))
        apart[own] = np.where(np.asarray(v.axles) < 0.5 * v.length, -0.5, 0.5)
        moves += [wide, apart]
    return moves


def _share(profiles, places, start):
    """Share of the power that a comb at ``positions`` explains, at the best of a few starts near ``start``."""
    first = places[0]
    if not np.all(np.diff(places) > 0.5):
        return -np.inf
    comb = Comb.of(places - first)
    lags = np.arange(TAPS) - TAPS // 2
    teeth = np.flatnonzero(comb.teeth)
    total = np.zeros(STARTS.size)
    for values in profiles.values[:, 0]:
        padded = np.pad(values, (TAPS, TAPS + comb.teeth.size))
        for k, shift in enumerate(STARTS):
            # whole steps: the tooth takes up the remainder
            at = round((start + first + shift + LEAD) / STEP) + TAPS
            found = comb.teeth[teeth] @ padded[at + teeth[:, None] + lags]
            total[k] += found @ comb.inverse @ found
    return float(total.max() / profiles.power[0])
