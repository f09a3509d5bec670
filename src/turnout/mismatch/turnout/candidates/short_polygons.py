r"""Find polygonal wheels with waves shorter than 0.3 m in the sound level of passages.

While a wheel is within 1.2 m of a sensor, it dominates the signal. With P the power at that time in bins of
:math:`\lambda = v/f` and B that of the bins around it,

.. math:: z = \ln (P / B) - \mathrm{median}_{wheels} \ln (P / B)

is near 0 for a round wheel: hum, resonances and corrugation are common to all wheels of a passage and cancel. The
evidence compares the mean of z over sensors and passages for a polygonal wheel with that for a round one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout import physics
from turnout.mismatch.turnout.candidates.catalogue import candidate_of, rival_axles
from turnout.mismatch.turnout.candidates.corrugation_levels import is_alike, shortest_covered
from turnout.mismatch.turnout.candidates.short_corrugation import response_energy
from turnout.mismatch.turnout.defect_priors import CORRUGATION, SHORT_POLYGONS
from turnout.mismatch.turnout.priors import PASSAGE
from turnout.physics.hypothesis import Hypothesis
from turnout.physics.out_of_round import MIN_AMPLITUDE

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.mismatch.turnout.passage_observation import AlignedPassage


@dataclass(frozen=True)
class WheelSpectra:
    """Spectra of one passage while each wheel passes each sensor.

    ``level`` (n_sensor, n_wheel, n_bin) is the logarithm of the power, nan where it was not recorded; ``width``
    (n_bin,) lines per bin, ``size`` of the transform, ``window`` (n,) of the samples.
    """

    aligned: AlignedPassage
    level: np.ndarray
    width: np.ndarray
    size: int
    window: np.ndarray


def short_polygon_candidates(case: TrackCase, fit: Fit) -> tuple[Candidate, ...]:
    """The likeliest wheel with short waves as a candidate, () where all may be round.

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
    passages = sorted(case.fitted_passages(), key=lambda m: m.speed)
    if not passages:
        return ()
    lengths = bin_wavelengths(passages)
    bins = np.flatnonzero(
        (lengths < PASSAGE.shortest_wave) & (lengths > lengths.min(initial=np.inf) * np.exp(SHORT_POLYGONS.far_offset))
    )
    if not bins.size:
        return ()
    wheel_fits, n = [], 0
    for train in case.trains:
        spectra = [wheel_spectra(m, lengths) for m in passages if m.conditions["train"] == train]
        if spectra and spectra[0].level.shape[1] >= SHORT_POLYGONS.min_wheels:
            z, n_slots = wheel_excess(spectra, bins, lengths)
            n += z.shape[0]
            w, k = np.unravel_index(int(np.argmax(z)), z.shape)
            if n_slots and is_alike(
                [wheel_excess(half, bins, lengths)[0][w, k] for half in (spectra[::2], spectra[1::2]) if half]
            ):
                evidence = {wheel: polygon_evidence(level, n_slots) for wheel, level in enumerate(z[:, k])}
                wheel_fits.append((evidence, train, int(w), int(bins[k]), spectra))
    if not wheel_fits:
        return ()
    evidence, train, wheel, chosen_bin, spectra = max(wheel_fits, key=lambda f: f[0][f[2]])
    scanned = n * max(1.0, float(np.ptp(np.log(lengths[bins]))) / SHORT_POLYGONS.resolution)
    if evidence[wheel] < np.log(scanned):
        return ()
    return (_short_candidate(case, fit, train, wheel, lengths, chosen_bin, evidence, scanned, spectra),)


def bin_wavelengths(passages: Sequence[AlignedPassage]) -> np.ndarray:
    """Centres of the bins, longest first; those at both ends serve as background. [m]

    Parameters
    ----------
    passages : sequence of AlignedPassage
        The passages.

    Returns
    -------
    (n,) array of float
        [m]
    """
    shortest = shortest_covered(passages, CORRUGATION.min_wavelength * np.exp(-SHORT_POLYGONS.far_offset))
    longest = PASSAGE.shortest_wave * np.exp(SHORT_POLYGONS.far_offset)
    return longest * np.exp(-np.arange(0.0, np.log(longest / shortest), SHORT_POLYGONS.bin_width))


def wheel_spectra(aligned: AlignedPassage, lengths: np.ndarray) -> WheelSpectra:
    """``WheelSpectra`` of a passage.

    Parameters
    ----------
    aligned : AlignedPassage
        The passage.
    lengths : (n_bin,) array of float
        Centres of the bins. [m]

    Returns
    -------
    WheelSpectra
    """
    recording, speed = aligned.passage.recording, aligned.speed
    n = round(2.0 * SHORT_POLYGONS.wheel_reach / speed * recording.rate)
    window, size = np.hanning(n), 1 << int(np.ceil(np.log2(8 * n)))
    frequency = np.arange(size // 2 + 1) * recording.rate / size
    edges = np.searchsorted(
        frequency, speed / lengths[:, None] * np.exp([-0.5 * SHORT_POLYGONS.bin_width, 0.5 * SHORT_POLYGONS.bin_width])
    )
    edges[:, 1] = np.maximum(edges[:, 1], edges[:, 0] + 1)
    sign = 1.0 if aligned.passage.direction == "facing" else -1.0
    first = sign * min(sign * s.place for s in aligned.sensors)
    behind = aligned.passage.vehicle.wheel_positions
    level = np.full((len(aligned.sensors), behind.size, lengths.size), np.nan)
    for row, sensor in zip(level, aligned.sensors):
        samples = recording.samples[recording.index(sensor.name)]
        for spectrum, delay_distance in zip(row, behind):
            k = (
                round((aligned.reference + (sign * (sensor.place - first) + delay_distance) / speed) * recording.rate)
                - n // 2
            )
            segment = samples[max(k, 0) : k + n]
            if segment.size == n and np.ptp(segment) > 0.0:
                power = np.abs(np.fft.rfft((segment - segment.mean()) * window, size)) ** 2
                spectrum[:] = [np.log(power[a:b].mean()) for a, b in edges]
    return WheelSpectra(aligned, level, np.diff(edges, axis=1)[:, 0], size, window)


def _background(level: np.ndarray, k: int, lengths: np.ndarray) -> np.ndarray:
    """(n_sensor, n_wheel) background level of bin k from the bins around it, mean of both sides."""
    away = np.log(lengths[k] / lengths)
    sides = [
        (away > SHORT_POLYGONS.near_offset) & (away < SHORT_POLYGONS.far_offset),
        (-away > SHORT_POLYGONS.near_offset) & (-away < SHORT_POLYGONS.far_offset),
    ]
    return np.mean([np.median(level[..., side], axis=-1) for side in sides], axis=0)


def wheel_excess(
    spectra: Sequence[WheelSpectra], bins: Sequence[int] | np.ndarray, lengths: np.ndarray
) -> tuple[np.ndarray, int]:
    """Mean level of each wheel over its background, less that of the other wheels.

    Parameters
    ----------
    spectra : sequence of WheelSpectra
        Of the passages of a train.
    bins : (n_tried,) array of int
        Bins that are tested.
    lengths : (n_bin,) array of float
        Centres of the bins. [m]

    Returns
    -------
    z : (n_wheel, n_tried) array of float
        Mean over sensors and passages.
    n_slots : int
        Number of spectra per wheel.
    """
    excess = [np.stack([s.level[..., k] - _background(s.level, k, lengths) for k in bins], axis=-1) for s in spectra]
    centred = [a - np.nanmedian(a, axis=1, keepdims=True) for a in excess if not np.isnan(a).all()]
    z = np.concatenate([*centred, np.full((0, *excess[0].shape[1:]), np.nan)])
    if not z.size:
        return np.full(excess[0].shape[1:], -np.inf), 0
    return np.nan_to_num(np.nanmean(z, axis=0), nan=-np.inf), z.shape[0]


def polygon_evidence(z: float, n_slots: int) -> float:
    """Nats for a polygonal wheel over a round one, from its mean z over so many spectra.

    Parameters
    ----------
    z : float
        Mean level of the wheel.
    n_slots : int
        Number of spectra.

    Returns
    -------
    float
        [nats]
    """
    spread = SHORT_POLYGONS.wheel_sd**2 + SHORT_POLYGONS.sensor_sd**2 / n_slots
    wide = spread + SHORT_POLYGONS.polygon_sd**2
    z = max(float(z), 0.0)
    return 0.5 * np.log(spread / wide) + 0.5 * z**2 * (1.0 / spread - 1.0 / wide)


def _short_candidate(
    case: TrackCase,
    fit: Fit,
    train: str,
    wheel: int,
    lengths: np.ndarray,
    k: int,
    evidence: Mapping[int, float],
    scanned: float,
    spectra: Sequence[WheelSpectra],
) -> Candidate:
    radius = spectra[0].aligned.passage.vehicle.wheel_values("radius")[wheel]
    order = round(2.0 * np.pi * radius / lengths[k])
    sizes = np.concatenate([_amplitudes(case, fit, s, wheel, lengths, k) for s in spectra])
    amplitude = float(np.clip(np.median(sizes), 1e-6, 9e-4))
    error = amplitude * float(np.hypot(CORRUGATION.response_error, np.std(np.log(sizes)) / np.sqrt(sizes.size)))
    parameters = tuple(
        replace(p, prior=(amplitude, error)) for p in physics.OutOfRound.parameters if p.name == "cosine"
    )  # fmt: skip
    hypothesis = Hypothesis(
        starts=((amplitude,),),
        fixed={"wheel": wheel, "order": order, "radius": radius, "train": train},
        where={"train": train, "axle": wheel + 1},
        n_scanned=scanned,
        parameters=parameters,
        smallest_reportable=MIN_AMPLITUDE,
        promise=float(evidence[wheel] - np.log(scanned)),
        external_evidence=float(evidence[wheel]),
        rival_axles=rival_axles(evidence, wheel),
    )
    return candidate_of(physics.OutOfRound, hypothesis)


def _amplitudes(
    case: TrackCase, fit: Fit, spectra: WheelSpectra, wheel: int, lengths: np.ndarray, k: int
) -> np.ndarray:
    r"""(n,) amplitude of the wheel's wave [m] from each sensor, by its energy over the background:

    .. math:: \sum_f |Y|^2 = \tfrac{N}{2} f_s \int y^2 h^2 dt, \quad
              \int y^2 h^2 dt = \tfrac12 a^2 |F|^2 \omega^4 \int |G(x)|^2 h(x)^2 dx / v
    """
    aligned, near = spectra.aligned, np.flatnonzero(np.abs(np.log(lengths / lengths[k])) < SHORT_POLYGONS.near_offset)
    excess = np.exp(spectra.level[:, wheel, near]) - np.exp(_background(spectra.level, k, lengths)[:, wheel, None])
    energy = 2.0 * np.sum(excess * spectra.width[near], axis=1) / (spectra.size * aligned.passage.recording.rate)
    node, gain = response_energy(case, fit, aligned, lengths[k])
    distance = np.array([s.place for s in aligned.sensors])[:, None] - node
    window = np.where(
        np.abs(distance) < SHORT_POLYGONS.wheel_reach,
        np.cos(0.5 * np.pi * distance / SHORT_POLYGONS.wheel_reach) ** 2,
        0.0,
    )
    unit_energy = 0.5 / aligned.speed * np.trapezoid(gain * window**2, node, axis=1)
    is_valid = np.isfinite(energy) & (energy > 0.0)
    return np.sqrt(energy[is_valid] / unit_energy[is_valid]) if is_valid.any() else np.array([1e-6])
