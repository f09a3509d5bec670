r"""Find corrugation shorter than the simulated waves: a line at one wavelength in the sound level of all trains.

The band in which passages are fitted ends at the shortest free wave of the rail; most corrugation is shorter. Above
that band the signal is roughness with a level that is smooth in the wavelength. With P the mean power of a sensor in
bins of :math:`\lambda = v/f` and B the median of the bins around it,

.. math:: z = \overline{\ln (P / B)}

scatters with the roughness under that sensor, which is the same in all passages, and is large where the rail has waves
of that length. A wave of a wheel shows in its train alone. A hum or a resonance has one frequency: its wavelength
differs between slow and fast passages.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from turnout import physics
from turnout.mismatch.turnout.candidates.catalogue import candidate_of
from turnout.mismatch.turnout.defect_priors import CORRUGATION
from turnout.mismatch.turnout.matrix_cache import matrices_of
from turnout.mismatch.turnout.priors import PASSAGE, SIMULATION
from turnout.mismatch.turnout.track_parameters import track_with
from turnout.mismatch.turnout.track_under_wheels import rail_receptances
from turnout.mismatch.turnout.wave_response import wheel_and_contact_receptance
from turnout.physics.hypothesis import Hypothesis
from turnout.physics.rail_corrugation import MIN_AMPLITUDE

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.mismatch.turnout.passage_observation import AlignedPassage

AMPLITUDES = np.geomspace(*CORRUGATION.amplitudes)  # m, tested


@dataclass(frozen=True)
class BandPower:
    """Power of one passage in bins of the wavelength.

    ``power`` and its ``background`` (n_recorded, n_bin) are means of the squared spectrum. ``recorded`` (n_sensor,)
    marks the sensors with a signal.
    """

    name: str
    train: str
    speed: float
    power: np.ndarray
    background: np.ndarray
    recorded: np.ndarray

    @property
    def excess(self) -> np.ndarray:
        """(n_recorded, n_bin) logarithm of the power over its background."""
        return np.log(self.power / self.background)


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
    shortest = max(
        [
            CORRUGATION.min_wavelength,
            *(m.speed / (CORRUGATION.max_frequency_share * m.passage.recording.rate) for m in passages),
        ]
    )
    longest = PASSAGE.shortest_wave * np.exp(
        CORRUGATION.bin_width * (CORRUGATION.background_reach + 1)
    )  # the first bins are background alone
    return longest * np.exp(-np.arange(0.0, np.log(longest / shortest), CORRUGATION.bin_width))


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
    alive = np.any(samples != samples[:, :1], axis=1)
    power = power[alive]
    total = np.column_stack([power[:, a : max(b, a + 1)].mean(axis=1) for a, b in edges])
    level = np.log(total)
    near = np.abs(np.subtract.outer(np.arange(wavelengths.size), np.arange(wavelengths.size)))
    near = (near >= CORRUGATION.background_gap) & (near <= CORRUGATION.background_reach)
    usual = np.exp(np.column_stack([np.median(level[:, row], axis=1) for row in near]))
    return BandPower(aligned.name, aligned.passage.train, aligned.speed, total, usual, alive)


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
    return [*by_train, [p for p in passages if p.speed < middle], [p for p in passages if p.speed >= middle]]


def corrugation_evidence(passages: Sequence[BandPower], n_sensors: float) -> np.ndarray:
    """Evidence for a line that all trains show at all speeds, over roughness alone.

    Parameters
    ----------
    passages : sequence of BandPower
        Power of the passages.
    n_sensors : float
        Number of sensors on different rail.

    Returns
    -------
    (n_bin,) array of float
        [nats]
    """
    z = np.min([np.mean([p.excess.mean(axis=0) for p in group], axis=0) for group in passage_groups(passages)], axis=0)
    z, spread = np.maximum(z, 0.0), CORRUGATION.sensor_sd**2 / n_sensors
    wide = spread + CORRUGATION.corrugation_sd**2
    return 0.5 * np.log(spread / wide) + 0.5 * z**2 * (1.0 / spread - 1.0 / wide)


def short_corrugation_candidates(case: TrackCase, fit: Fit) -> tuple[Candidate, ...]:
    """The likeliest short corrugation as a candidate, () where intact rail is likelier or the data cannot tell.

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        A fit of the case.

    Returns
    -------
    tuple of Candidate
        One or none.
    """
    passages = sorted((m for m in case.fitted_passages() if m.passage.train), key=lambda m: m.speed)
    if any(c.family == physics.RailCorrugation.name for c in fit.candidates) or not _can_distinguish(passages):
        return ()
    wavelengths = bin_wavelengths(passages)
    if wavelengths.size <= 2 * CORRUGATION.background_reach:
        return ()
    band_powers = [band_power(case, m, wavelengths) for m in passages]
    if not all(len(p.power) for p in band_powers):
        return ()
    nats = corrugation_evidence(band_powers, _n_independent_sensors(case))
    nats[_is_in_file(case, wavelengths)] = -np.inf
    k = int(np.argmax(nats))
    if wavelengths[k] >= PASSAGE.shortest_wave or nats[k] < np.log(nats.size) or not _is_repeatable(band_powers, k):
        return ()
    return (_candidate(case, fit, wavelengths, k, float(nats[k]), band_powers),)


def _can_distinguish(passages: Sequence[AlignedPassage]) -> bool:
    """Whether trains and speeds differ enough to distinguish the rail from wheels and from frequencies."""
    speeds = [m.speed for m in passages]
    return len({m.passage.train for m in passages}) >= CORRUGATION.min_trains and max(
        speeds
    ) > CORRUGATION.min_speed_ratio * min(speeds)


def _n_independent_sensors(case: TrackCase) -> float:
    """Effective number of sensors on different rail."""
    positions = sorted(s.place for s in case.campaign.sensors)
    return 1.0 + float(np.sum(np.minimum(np.diff(positions) / CORRUGATION.independent_distance, 1.0)))


def _is_in_file(case: TrackCase, wavelengths: np.ndarray) -> np.ndarray:
    """(n_bin,) whether the track's file has corrugation of about that length."""
    components = [
        p
        for m in case.aligned_passages.values()
        for s in case.predictor.zone.turnout.surfaces(m.passage.route)
        for p in s
    ]
    lengths = np.array([p.wavelength for p in components if hasattr(p, "wavelength")])
    return np.any(
        np.abs(np.log(wavelengths[:, None] / lengths)) < (CORRUGATION.line_bins + 0.5) * CORRUGATION.bin_width, axis=1
    )


def _is_repeatable(band_powers: Sequence[BandPower], k: int) -> bool:
    """Whether the line repeats: passages in order of speed are split into two halves.

    Either half must show at least half the level of the other.
    """
    levels = [np.mean([p.excess[:, k].mean() for p in half]) for half in (band_powers[::2], band_powers[1::2])]
    return min(levels) > 0.5 * max(levels)


def _candidate(
    case: TrackCase, fit: Fit, wavelengths: np.ndarray, k: int, nats: float, band_powers: Sequence[BandPower]
) -> Candidate:
    line = _line_bins(k)
    excess = np.mean([(p.power[:, line] / p.background[:, line]).mean(axis=0) - 1.0 for p in band_powers], axis=0)
    weight = np.maximum(excess, 0.0)
    length = float(np.exp(weight @ np.log(wavelengths[line]) / weight.sum()))
    middle, reach, amplitude, error = _fit_stretch(case, fit, length, line, band_powers)
    a, b = middle - reach, middle + reach
    priors = {"sine": (amplitude, error), "wavelength": (length, 0.5 * CORRUGATION.bin_width * length)}
    parameters = tuple(replace(p, prior=priors[p.name]) for p in physics.RailCorrugation.parameters if p.name in priors)
    where = {"wavelength": round(length, 3), "place": round(float(middle), 2)}
    hypothesis = Hypothesis(
        starts=((amplitude, length),),
        fixed={"start": a, "end": b},
        where=where,
        n_scanned=int(np.count_nonzero(wavelengths < PASSAGE.shortest_wave)),
        parameters=parameters,
        smallest_reportable=MIN_AMPLITUDE,
        promise=nats - float(np.log(wavelengths.size)),
        external_evidence=nats,
    )
    return candidate_of(physics.RailCorrugation, hypothesis)


def _line_bins(k: int) -> slice:
    """Bins over which a line spreads: a stretch of 3 m is some 10 % wide at 0.3 m."""
    return slice(max(k - CORRUGATION.line_bins, 0), k + CORRUGATION.line_bins + 1)


def _fit_stretch(
    case: TrackCase, fit: Fit, length: float, line: slice, band_powers: Sequence[BandPower]
) -> tuple[float, float, float, float]:
    """(middle, half the stretch, amplitude, its standard error) [m] of waves of this length.

    These explain the power of each sensor in each passage best.
    """
    positions = [s.place for s in case.campaign.sensors]
    middles = np.arange(min(positions), max(positions) + 0.1, 0.5)
    shapes = [(m, r) for m in middles for r in CORRUGATION.half_lengths]
    misfit = np.zeros((len(shapes), AMPLITUDES.size))
    for p in band_powers:
        unit = _unit_energy(case, fit, case.aligned_passages[p.name], length, shapes)  # (n_shape, n_sensor)
        expected = AMPLITUDES[:, None, None] ** 2 * unit[:, p.recorded] + p.background[:, line].sum(axis=1)
        misfit += np.sum((np.log(p.power[:, line].sum(axis=1)) - np.log(expected)) ** 2, axis=2).T
    n = sum(len(p.power) for p in band_powers)
    best_shape, size = np.unravel_index(int(np.argmin(misfit)), misfit.shape)
    spread = misfit[best_shape, size] / n
    posterior = np.exp(-0.5 * (misfit - misfit[best_shape, size]) / max(spread, CORRUGATION.sensor_sd**2))
    posterior = posterior.sum(axis=0) / posterior.sum()
    mean = float(posterior @ np.log(AMPLITUDES))
    error = float(np.sqrt(posterior @ (np.log(AMPLITUDES) - mean) ** 2 + CORRUGATION.response_error**2))
    return *shapes[best_shape], float(np.exp(mean)), error * float(np.exp(mean))


def _unit_energy(
    case: TrackCase, fit: Fit, aligned: AlignedPassage, length: float, shapes: Sequence[tuple[float, float]]
) -> np.ndarray:
    r"""(n_shape, n_sensor) power, as in ``BandPower``, of waves one metre high.

    The force of the wheel at v/λ is carried to the sensor from the position of the wheel:

    .. math:: \int y^2 dt = \tfrac12 \sum_w |F|^2 \int |G(x)|^2 e(x)^2 \, dx / v, \quad
              F = 1 / (A_{wheel} + A_{contact} + A_{rail})
    """
    node, gain = response_energy(case, fit, aligned, length)
    inside = np.array([np.abs(node - m) <= r for m, r in shapes])
    energy = (
        0.5 * len(aligned.passage.vehicle.wheels) / aligned.speed * np.trapezoid(inside[:, None] * gain, node, axis=2)
    )
    return (
        energy * aligned.passage.recording.rate**2 / (2.0 * CORRUGATION.bin_width * aligned.speed / length)
    )  # Parseval, half at f < 0


def response_energy(case: TrackCase, fit: Fit, aligned: AlignedPassage, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Squared acceleration of each sensor for one wheel that rolls over a wave one metre high.

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        A fit of the case.
    aligned : AlignedPassage
        The passage.
    length : float
        Wavelength. [m]

    Returns
    -------
    node : (n,) array of float
        Positions of the wheel. [m]
    energy : (n_sensor, n) array of float
        [1/s⁴]
    """
    track = track_with(case.predictor.track(aligned.passage.route), case.predictor.zone, fit.values)
    matrices, frequency = matrices_of(track), np.array([aligned.speed / length])
    near = np.flatnonzero((matrices.node >= case.predictor.waves.start) & (matrices.node <= case.predictor.waves.end))[
        :: CORRUGATION.node_stride
    ]
    h, mean_receptance = rail_receptances(matrices, frequency, near, [s.probe(track).place for s in aligned.sensors])
    force = 1.0 / np.abs(wheel_and_contact_receptance(aligned.passage.vehicle, frequency)[:, None] + mean_receptance)[0]
    return matrices.node[near], ((2.0 * np.pi * frequency) ** 2 * force * np.abs(h[0])) ** 2
