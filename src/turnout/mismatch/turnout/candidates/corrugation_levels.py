r"""Levels of corrugation shorter than the simulated waves: a line at one wavelength in the sound level of all trains.

The band in which passages are fitted ends at the shortest free wave of the rail; most corrugation is shorter. Above
that band the signal is roughness with a level that is smooth in the wavelength. With P the mean power of a sensor in
bins of :math:`\lambda = v/f` and B the median of the bins around it,

.. math:: z = \overline{\ln (P / B)}

scatters with the roughness under that sensor, which is the same in all passages, and is large where the rail has waves
of that length. A wave of a wheel shows in its train alone. A hum or a resonance has one frequency: its wavelength
differs between slow and fast passages. Corrugation may end between two sensors: the evidence is the mean over all
stretches of neighbouring sensors. Bins overlap by half: a line between two of them would be half in each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from turnout.mismatch.turnout.defect_priors import CORRUGATION
from turnout.mismatch.turnout.priors import PASSAGE, SIMULATION

if TYPE_CHECKING:
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.mismatch.turnout.passage_observation import AlignedPassage


@dataclass(frozen=True)
class BandPower:
    """Power of one passage in bins of the wavelength.

    ``power`` and its ``background`` (n_recorded, n_bin) are means of the squared spectrum. ``recorded`` (n_sensor,)
    marks the sensors with a signal, ``positions`` (n_recorded,) are theirs [m].
    """

    name: str
    train: str
    speed: float
    power: np.ndarray
    background: np.ndarray
    recorded: np.ndarray
    positions: np.ndarray

    @property
    def excess(self) -> np.ndarray:
        """(n_recorded, n_bin) logarithm of the power over its background."""
        return np.log(self.power / self.background)

    def level_in(self, stretch: tuple[float, float]) -> np.ndarray:
        """Mean excess of the sensors in a stretch of rail.

        Parameters
        ----------
        stretch : (float, float)
            Positions of its first and its last sensor. [m]

        Returns
        -------
        (n_bin,) array of float
            nan if none of them has a signal.
        """
        inside = (self.positions >= stretch[0]) & (self.positions <= stretch[1])
        return self.excess[inside].mean(axis=0) if inside.any() else np.full(self.power.shape[1], np.nan)


def bin_wavelengths(passages: Sequence[AlignedPassage]) -> np.ndarray:
    """Wavelengths that every passage covers, longest first [m].

    Parameters
    ----------
    passages : sequence of AlignedPassage
        The passages.

    Returns
    -------
    (n,) array of float
        [m]
    """
    shortest = shortest_covered(passages, CORRUGATION.min_wavelength)
    longest = PASSAGE.shortest_wave * np.exp(
        CORRUGATION.bin_width * (CORRUGATION.background_reach + 1)
    )  # the first bins are background alone
    return longest * np.exp(-np.arange(0.0, np.log(longest / shortest), CORRUGATION.bin_width / CORRUGATION.overlap))


def shortest_covered(passages: Sequence[AlignedPassage], least: float) -> float:
    """Shortest wavelength that every passage covers within the band of its recording, or ``least`` if that is longer.

    Parameters
    ----------
    passages : sequence of AlignedPassage
        The passages.
    least : float
        [m]

    Returns
    -------
    float
        [m]
    """
    rates = ((m.speed, m.passage.recording.rate) for m in passages)
    return max([least, *(speed / (CORRUGATION.max_frequency_share * rate) for speed, rate in rates)])


def n_widths(wavelengths: np.ndarray) -> float:
    """Number of lines that can be distinguished: bins side by side. Overlapping bins show one line twice.

    Parameters
    ----------
    wavelengths : (n_bin,) array of float
        Centres of the bins. [m]

    Returns
    -------
    float
    """
    return max(1.0, wavelengths.size / CORRUGATION.overlap)


def band_power(case: TrackCase, aligned: AlignedPassage, wavelengths: np.ndarray) -> BandPower:
    """``BandPower`` of a passage.

    Parameters
    ----------
    case : TrackCase
        The case.
    aligned : AlignedPassage
        The passage.
    wavelengths : (n_bin,) array of float
        Centres of the bins. [m]

    Returns
    -------
    BandPower
    """
    recording = aligned.passage.recording
    rows = [recording.index(s.name) for s in aligned.sensors]
    first, last = (round(t * recording.rate) for t in (aligned.time[0], aligned.time[-1]))
    samples = recording.samples[rows][:, max(first, 0) : last]
    edge = 2.0 * SIMULATION.edge_time * recording.rate / samples.shape[1]
    n = 1 << int(np.ceil(np.log2(4 * samples.shape[1])))  # finer lines than bins
    power = np.abs(np.fft.rfft(samples * scipy.signal.windows.tukey(samples.shape[1], min(edge, 1.0)), n)) ** 2
    frequency = np.arange(power.shape[1]) * recording.rate / n
    edges = np.searchsorted(
        frequency,
        aligned.speed / wavelengths[:, None] * np.exp([-0.5 * CORRUGATION.bin_width, 0.5 * CORRUGATION.bin_width]),
    )
    has_signal = np.any(samples != samples[:, :1], axis=1)
    power = power[has_signal]
    total = np.column_stack([power[:, a : max(b, a + 1)].mean(axis=1) for a, b in edges])
    level = np.log(total)
    number = np.arange(wavelengths.size) / CORRUGATION.overlap  # in widths of a bin
    distance = np.abs(np.subtract.outer(number, number))
    near = (distance >= CORRUGATION.background_gap) & (distance <= CORRUGATION.background_reach)
    usual = np.exp(np.column_stack([np.median(level[:, row], axis=1) for row in near]))
    positions = np.array([s.place for s in aligned.sensors])[has_signal]
    return BandPower(aligned.name, aligned.passage.train, aligned.speed, total, usual, has_signal, positions)


def passage_groups(passages: Sequence[BandPower]) -> list[list[BandPower]]:
    """Passages of each train, the slower and the faster ones: corrugation must show in all groups.

    Parameters
    ----------
    passages : sequence of BandPower
        Power of the passages.

    Returns
    -------
    list of list of BandPower
    """
    trains = sorted({p.train for p in passages})
    middle = np.sqrt(min(p.speed for p in passages) * max(p.speed for p in passages))
    by_train = [[p for p in passages if p.train == t] for t in trains]
    by_speed = [p for p in passages if p.speed < middle], [p for p in passages if p.speed >= middle]
    return [group for group in (*by_train, *by_speed) if group]


def sensor_stretches(positions: Sequence[float]) -> list[tuple[float, float]]:
    """All stretches of neighbouring sensors, of one sensor or more.

    Parameters
    ----------
    positions : sequence of float
        Of the sensors. [m]

    Returns
    -------
    list of (float, float)
        Positions of the first and the last sensor of each. [m]

    Examples
    --------
    >>> sensor_stretches([3.0, 1.0])
    [(1.0, 1.0), (1.0, 3.0), (3.0, 3.0)]
    """
    ordered = sorted({float(x) for x in positions})
    return [(a, b) for k, a in enumerate(ordered) for b in ordered[k:]]


def stretch_evidence(passages: Sequence[BandPower], positions: Sequence[float]) -> np.ndarray:
    """Evidence for a line that all trains show at all speeds in a stretch, over roughness alone.

    Parameters
    ----------
    passages : sequence of BandPower
        Power of the passages.
    positions : sequence of float
        Of the sensors. [m]

    Returns
    -------
    (n_stretch, n_bin) array of float
        Of each of the ``sensor_stretches``. [nats]
    """
    nats = []
    for stretch in sensor_stretches(positions):
        n_sensors = _n_independent_sensors([x for x in positions if stretch[0] <= x <= stretch[1]])
        levels = [_group_level(group, stretch) for group in passage_groups(passages)]
        z, spread = np.maximum(np.min(levels, axis=0), 0.0), CORRUGATION.sensor_sd**2 / n_sensors
        wide = spread + CORRUGATION.corrugation_sd**2
        nats.append(0.5 * np.log(spread / wide) + 0.5 * z**2 * (1.0 / spread - 1.0 / wide))
    return np.array(nats)


def _group_level(group: Sequence[BandPower], stretch: tuple[float, float]) -> np.ndarray:
    """(n_bin,) mean level of a group of passages in a stretch, 0 where none has a signal."""
    levels = np.array([p.level_in(stretch) for p in group])
    levels = levels[np.isfinite(levels).all(axis=1)]
    return levels.mean(axis=0) if len(levels) else np.zeros(group[0].power.shape[1])


def corrugation_evidence(passages: Sequence[BandPower], positions: Sequence[float]) -> np.ndarray:
    """Evidence for corrugation of unknown extent: every stretch of neighbouring sensors is equally probable.

    Parameters
    ----------
    passages : sequence of BandPower
        Power of the passages.
    positions : sequence of float
        Of the sensors. [m]

    Returns
    -------
    (n_bin,) array of float
        [nats]
    """
    nats = stretch_evidence(passages, positions)
    return np.asarray(scipy.special.logsumexp(nats, axis=0) - np.log(len(nats)))


def _n_independent_sensors(positions: Sequence[float]) -> float:
    """Effective number of sensors on different rail."""
    return 1.0 + float(np.sum(np.minimum(np.diff(sorted(positions)) / CORRUGATION.independent_distance, 1.0)))


def is_repeatable(band_powers: Sequence[BandPower], k: int, stretch: tuple[float, float]) -> bool:
    """Whether the line repeats in a stretch: passages in order of speed are split into two halves.

    Either half must show at least half the level of the other.

    Parameters
    ----------
    band_powers : sequence of BandPower
        Power of the passages, in order of speed.
    k : int
        Bin.
    stretch : (float, float)
        Positions of its first and its last sensor. [m]

    Returns
    -------
    bool
    """
    levels = [_group_level(half, stretch)[k] for half in (band_powers[::2], band_powers[1::2])]
    return is_alike(levels)


def is_alike(levels: Sequence[float]) -> bool:
    """Whether either half of the passages shows at least half the level of the other.

    Parameters
    ----------
    levels : sequence of float
        One of each half.

    Returns
    -------
    bool
    """
    return bool(min(levels) > 0.5 * max(levels))
