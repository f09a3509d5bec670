"""Candidates of corrugation shorter than the simulated waves: found by its level, sized by the track's receptance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from turnout import physics
from turnout.mismatch.engine.ambiguity import Ambiguity
from turnout.mismatch.turnout.candidates.catalogue import candidate_of, recorded_quantities
from turnout.mismatch.turnout.candidates.corrugation_levels import (
    BandPower,
    band_power,
    bin_wavelengths,
    corrugation_evidence,
    is_repeatable,
    n_widths,
    sensor_stretches,
    stretch_evidence,
)
from turnout.mismatch.turnout.candidates.corrugation_phase import wave_in_band
from turnout.mismatch.turnout.defect_priors import CORRUGATION
from turnout.mismatch.turnout.matrix_cache import matrices_of
from turnout.mismatch.turnout.priors import PASSAGE, SIMULATION
from turnout.mismatch.turnout.track_parameters import track_with
from turnout.mismatch.turnout.track_under_wheels import rail_receptances
from turnout.mismatch.turnout.wave_response import wheel_and_contact_receptance
from turnout.physics.hypothesis import Hypothesis
from turnout.physics.rail_corrugation import MIN_AMPLITUDE, fade_envelope

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.candidates.rail_defects import RailScan
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.mismatch.turnout.passage_observation import AlignedPassage
    from turnout.physics.requirement import Requirement

AMPLITUDES = np.geomspace(*CORRUGATION.amplitudes)  # m, tested
# Other explanations of a line, by the quantity in which the passages do not differ.
EXPLANATIONS = {"train": "waves of the wheels of this train", "speed": "a vibration of this frequency"}


def short_corrugation_candidates(case: TrackCase, fit: Fit, scan: RailScan | None = None) -> tuple[Candidate, ...]:
    """The likeliest short corrugation as a candidate, () where intact rail is likelier or the data cannot tell.

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        A fit of the case.
    scan : RailScan or None
        Scores of shapes of the running surface, which give the phase; None: any phase.

    Returns
    -------
    tuple of Candidate
        One or none.
    """
    if any(c.family == physics.RailCorrugation.name for c in fit.candidates) or _unmet_requirements(case):
        return ()
    line = _common_line(case)
    if line is None:
        return ()
    wavelengths, length, k, nats, band_powers, _ = line
    return (_candidate(case, fit, scan, wavelengths, length, k, nats, band_powers),)


# Wavelengths of the bins [m], that of the line [m], its bin, evidence [nats], the passages, and the stretch [m].
Line: TypeAlias = tuple[np.ndarray, float, int, float, list[BandPower], tuple[float, float]]


def _common_line(case: TrackCase) -> Line | None:
    """The likeliest line that all fitted passages have at one wavelength; None where intact rail is likelier."""
    passages = sorted((m for m in case.fitted_passages() if m.passage.train), key=lambda m: m.speed)
    if len(passages) < 2:
        return None
    wavelengths = bin_wavelengths(passages)
    if wavelengths.size <= 2 * CORRUGATION.background_reach * CORRUGATION.overlap:
        return None
    band_powers = [band_power(case, m, wavelengths) for m in passages]
    if not all(len(p.power) for p in band_powers):
        return None
    positions = [s.place for s in case.campaign.sensors]
    nats = corrugation_evidence(band_powers, positions)
    nats[_is_in_file(case, wavelengths)] = -np.inf
    k = int(np.argmax(nats))
    if nats[k] < np.log(n_widths(wavelengths)):
        return None
    stretch = sensor_stretches(positions)[int(np.argmax(stretch_evidence(band_powers, positions)[:, k]))]
    length = line_wavelength(wavelengths, k, band_powers, stretch)
    if length >= PASSAGE.shortest_wave or not is_repeatable(band_powers, k, stretch):
        return None
    return wavelengths, length, k, float(nats[k]), band_powers, stretch


def _unmet_requirements(case: TrackCase) -> list[Requirement]:
    """What the passages lack to distinguish the rail from wheels and from frequencies."""
    recorded = recorded_quantities(case.data)
    return [r for r in physics.RailCorrugation.requirements if not r.is_met(recorded)]


def ambiguous_line(case: TrackCase) -> Ambiguity | None:
    """A line of all passages where these cannot distinguish the rail from wheels or from frequencies.

    Its evidence is that of corrugation in ``short_corrugation_candidates``.

    Parameters
    ----------
    case : TrackCase
        The case.

    Returns
    -------
    Ambiguity or None
        None where they can, or where intact rail is likelier.
    """
    unmet = [r for r in _unmet_requirements(case) if r.part]
    line = _common_line(case) if unmet else None
    if line is None:
        return None
    wavelengths, length, k, nats, band_powers, stretch = line
    decibels = 10.0 / np.log(10.0) * float(np.nanmean([p.level_in(stretch)[k] for p in band_powers]))
    frequencies = [p.speed / length for p in band_powers]
    low, high = (round(f) for f in (min(frequencies), max(frequencies)))
    at = f"{low} Hz" if high - low <= CORRUGATION.bin_width * low else f"{low} to {high} Hz, with the speed,"
    others = [EXPLANATIONS[r.quantity] for r in unmet if r.quantity in EXPLANATIONS]
    words = (
        f"the level at {at} is {decibels:.0f} dB above that around it. It may be corrugation of {length:.3f} m"
        f" or {' or '.join(others)}, since {' and '.join(r.lack for r in unmet)}"
    )
    measurement = " and ".join(r.measurement for r in unmet)
    evidence = nats - float(np.log(n_widths(wavelengths)))
    return Ambiguity(evidence, words, measurement, "wavelength", f"{length:.3f} m", *stretch)


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


def line_wavelength(
    wavelengths: np.ndarray, k: int, band_powers: Sequence[BandPower], stretch: tuple[float, float]
) -> float:
    """Centre of a line, weighted with its power over the background.

    Parameters
    ----------
    wavelengths : (n_bin,) array of float
        Centres of the bins. [m]
    k : int
        Bin of the line.
    band_powers : sequence of BandPower
        Power of the passages.
    stretch : (float, float)
        Positions of the first and the last sensor that count. [m]

    Returns
    -------
    float
        [m]
    """
    line = _line_bins(k)
    weight = np.maximum(np.nanmean([np.exp(p.level_in(stretch)[line]) - 1.0 for p in band_powers], axis=0), 0.0)
    return float(np.exp(weight @ np.log(wavelengths[line]) / weight.sum()))


def _candidate(
    case: TrackCase,
    fit: Fit,
    scan: RailScan | None,
    wavelengths: np.ndarray,
    length: float,
    k: int,
    nats: float,
    band_powers: Sequence[BandPower],
) -> Candidate:
    middle, reach, amplitude, error = _fit_stretch(case, fit, length, _line_bins(k), band_powers)
    a, b = middle - reach, middle + reach
    priors = {"sine": (amplitude, error), "wavelength": (length, 0.5 * CORRUGATION.bin_width * length)}
    parameters = tuple(replace(p, prior=priors[p.name]) for p in physics.RailCorrugation.parameters if p.name in priors)
    where = {"wavelength": round(length, 3), "place": round(float(middle), 2)}
    hypothesis = Hypothesis(
        starts=((amplitude, length),),
        fixed={"start": a, "end": b, "fade": reach},
        where=where,
        n_scanned=n_widths(wavelengths[wavelengths < PASSAGE.shortest_wave]),
        parameters=parameters,
        smallest_reportable=MIN_AMPLITUDE,
        promise=nats - float(np.log(n_widths(wavelengths))),
        external_evidence=nats,
    )
    if scan is not None:
        hypothesis = _in_phase(hypothesis, scan, (a, b), priors)
    return candidate_of(physics.RailCorrugation, hypothesis)


def _in_phase(
    hypothesis: Hypothesis, scan: RailScan, stretch: tuple[float, float], priors: Mapping[str, tuple[float, float]]
) -> Hypothesis:
    """The hypothesis with the phase that the free waves show; the search for it has its penalty."""
    wave = wave_in_band(scan, stretch, priors["wavelength"], priors["sine"])
    assert hypothesis.promise is not None
    errors = {"wavelength": wave.wavelength_error / wave.wavelength}
    parameters = tuple(
        replace(p, model_error_share=errors.get(p.name, p.model_error_share)) for p in hypothesis.parameters or ()
    )
    return replace(
        hypothesis,
        parameters=parameters,
        starts=((wave.amplitude, wave.wavelength),),
        fixed={**hypothesis.fixed, "start": wave.start},
        n_scanned=hypothesis.n_scanned * float(np.exp(wave.penalty)),
        promise=hypothesis.promise + wave.gain,
        start_nuisances=wave.nuisances,
    )


def _line_bins(k: int) -> slice:
    """Bins side by side over which a line spreads: a stretch of 3 m is some 10 % wide at 0.3 m."""
    step, reach = CORRUGATION.overlap, CORRUGATION.overlap * CORRUGATION.line_bins
    return slice(max(k - reach, k % step), k + reach + 1, step)


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
    share = np.array([fade_envelope(node, m - r, m + r, r) ** 2 for m, r in shapes])
    energy = (
        0.5 * len(aligned.passage.vehicle.wheels) / aligned.speed * np.trapezoid(share[:, None] * gain, node, axis=2)
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
    h, under_wheel = rail_receptances(matrices, frequency, near, [s.probe(track).place for s in aligned.sensors])
    mean_receptance = under_wheel @ _averages(matrices.node[near])  # a wheel rings on for a few bays
    force = 1.0 / np.abs(wheel_and_contact_receptance(aligned.passage.vehicle, frequency)[:, None] + mean_receptance)[0]
    return matrices.node[near], ((2.0 * np.pi * frequency) ** 2 * force * np.abs(h[0])) ** 2


def _averages(node: np.ndarray) -> np.ndarray:
    """(n, n) matrix that averages values at nodes over ``SIMULATION.averaging_length`` about each."""
    about = np.abs(node[:, None] - node) < 0.5 * SIMULATION.averaging_length
    return about / about.sum(axis=0)
