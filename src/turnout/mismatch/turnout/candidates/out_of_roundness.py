r"""Find polygonal wheels in the residual of passages: which wheel of which train, order and amplitude.

Waves longer than 0.3 m are found in the band of the fit, shorter ones by ``short_polygons``. The wave of a wheel is a
line at v/λ in every passage of its train, at an unknown angle. C are its two whitened signals, a quarter wave apart.
Their amplitudes have the standard deviation a, the same in all passages. Each passage gives, with the angle integrated
out,

.. math:: \ln \Lambda = \tfrac12 s^T (M + a^{-2})^{-1} s - \tfrac12 \ln |1 + a^2 M|, \quad s = C^T r, \; M = C^T C

M is that of the first wheel: it is the same for all wheels of a train.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from turnout import physics
from turnout.mismatch.turnout.candidates.catalogue import candidate_of, rival_axles
from turnout.mismatch.turnout.defect_priors import POLYGONS
from turnout.mismatch.turnout.surface_priors import ROUGHNESS
from turnout.mismatch.turnout.wave_response import WaveTransfer
from turnout.physics.hypothesis import Hypothesis
from turnout.physics.out_of_round import MIN_AMPLITUDE

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.turnout.case import TrackCase

# (nats, train, wheel, wavelength [m], [(recording, cosine, sine)])
WheelEvidence: TypeAlias = tuple[float, str, int, float, list[tuple[str, float, float]]]
WAVELENGTHS = np.geomspace(ROUGHNESS.shortest_wave, POLYGONS.longest_wave, POLYGONS.n_wavelengths)  # m
FINE_FACTORS = np.linspace(*POLYGONS.fine_factors)  # of the wavelength, for its refinement
AMPLITUDES = np.geomspace(*POLYGONS.amplitudes)  # m, prior sd of cosine and sine


def polygon_candidates(case: TrackCase, fit: Fit) -> tuple[Candidate, ...]:
    """The likeliest polygonal wheel as a candidate, () where a round one is likelier.

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
    wheel_fits = [s for train in case.trains for s in wheel_evidence(case, fit, train)]
    if not wheel_fits:
        return ()
    nats, train, wheel, wavelength, _ = max(wheel_fits, key=lambda f: f[0])
    if nats <= 0.0:
        return ()
    refined = wheel_evidence(case, fit, train, wavelength * FINE_FACTORS)
    _, _, _, wavelength, amplitudes = next(f for f in refined if f[2] == wheel)
    rivals = rival_axles({w: g for g, of_train, w, *_ in wheel_fits if of_train == train}, wheel)
    return (_candidate(case, train, wheel, wavelength, amplitudes, nats, len(wheel_fits), rivals),)


def wheel_evidence(
    case: TrackCase, fit: Fit, train: str, wavelengths: np.ndarray = WAVELENGTHS
) -> Iterator[WheelEvidence]:
    """Evidence of a polygonal wheel, for each wheel of a train.

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        A fit of the case.
    train : str
        Type or number of the train.
    wavelengths : (n,) array of float
        Trial wavelengths. [m]

    Yields
    ------
    tuple
        (nats, train, wheel, wavelength [m], [(recording, cosine, sine)]) of each wheel, 0 first.
    """
    members = [(o, w) for o, w in zip(case.observations, fit.white) if o.name in case.aligned_passages]
    members = [(o, w) for o, w in members if case.aligned_passages[o.name].conditions["train"] == train]
    if not members:
        return
    n_wheel = len(case.aligned_passages[members[0][0].name].passage.vehicle.wheels)
    statistics = [_slopes(case, fit, o, white, n_wheel, wavelengths) for o, white in members]
    for wheel in range(n_wheel):
        evidence = (_passage_evidence(slope[wheel], size) for slope, size in statistics)
        nats = sum(evidence, np.zeros((AMPLITUDES.size, wavelengths.size)))
        a, k = np.unravel_index(int(np.argmax(nats)), nats.shape)
        prior = np.eye(2) / AMPLITUDES[a] ** 2
        amplitudes = [np.linalg.solve(size[k] + prior, slope[wheel][k]) for slope, size in statistics]
        total_nats = float(_log_mean(nats))
        yield total_nats, train, wheel, float(wavelengths[k]), [(o.name, *b) for (o, _), b in zip(members, amplitudes)]


def _slopes(
    case: TrackCase, fit: Fit, o: Observation, white: np.ndarray, n_wheel: int, wavelengths: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n_wheel, n_wavelength, 2) slopes and (n_wavelength, 2, 2) sizes of one passage."""
    aligned = case.aligned_passages[o.name]
    transfer = WaveTransfer(case.predictor, fit.values, aligned, case.all_terms(fit))
    spectra = transfer.spectra(wavelengths, np.ones(transfer.node.size))
    weight = o.effective / fit.scale[o.data_type]
    rewhitened = o.whiten(np.asarray(white) * o.sigma) / o.sigma  # the whitening is symmetric: columns need not pass it
    delays = [transfer.wheel(w) for w in range(n_wheel)]
    slopes = weight * _products(transfer, rewhitened, spectra, delays).reshape(n_wheel, -1, 2)
    whitened = o.whiten(transfer.signals_from(spectra, delays[0])).reshape(o.data.size, -1, 2)
    return slopes, weight * np.einsum("nki,nkj->kij", whitened, whitened)


def _products(
    transfer: WaveTransfer, residual: np.ndarray, spectra: tuple[np.ndarray, np.ndarray], delays: Sequence[np.ndarray]
) -> np.ndarray:
    """(n_delay, 2 n_wave) ``transfer.signals_from(spectra, delay).T @ residual`` of each delay.

    One transform of the residual (n_sensor * n_time,) instead of one for each column.
    """
    rows = residual.reshape(len(transfer.aligned.sensors), -1)
    seen = np.fft.rfft(rows, transfer.size)[:, transfer.inside].T.conj() * transfer.clock * (2.0 / transfer.size)
    return (np.array(delays) @ np.einsum("fsk,fs->fk", transfer.cosines_and_sines(spectra), seen)).real


def _passage_evidence(slope: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(n_amplitude, n_wavelength) nats of one passage."""
    nats = []
    for a in AMPLITUDES:
        inside = size + np.eye(2) / a**2
        along = np.einsum("ki,ki->k", slope, np.linalg.solve(inside, slope[..., None])[..., 0])
        nats.append(0.5 * along - 0.5 * np.linalg.slogdet(a**2 * inside)[1])
    return np.array(nats)


def _log_mean(nats: np.ndarray) -> float:
    top = nats.max()
    return top + np.log(np.mean(np.exp(nats - top)))


def _candidate(
    case: TrackCase,
    train: str,
    wheel: int,
    wavelength: float,
    amplitudes: Sequence[tuple[str, float, float]],
    nats: float,
    scanned: float,
    rivals: tuple[int, ...],
) -> Candidate:
    passage = next(case.aligned_passages[name].passage for name, *_ in amplitudes)
    order = max(1, round(2.0 * np.pi * passage.vehicle.wheel_values("radius")[wheel] / wavelength))
    radius = order * wavelength / (2.0 * np.pi)
    middle = np.mean([s.place for s in case.campaign.sensors])  # a wave a little longer then fits there at least
    rolled = [(name, np.arctan2(s, c) * radius / order) for name, c, s in amplitudes]
    phases = tuple((name, float(x + wavelength * np.round((middle - x) / wavelength))) for name, x in rolled)
    amplitude = float(np.clip(np.median([np.hypot(c, s) for _, c, s in amplitudes]), 0.0, 9e-4))

    hypothesis = Hypothesis(
        starts=((amplitude, 0.0, 0.0),),
        fixed={"wheel": wheel, "order": order, "radius": radius, "train": train, "phases": phases},
        where={"train": train, "axle": wheel + 1},
        n_scanned=scanned * POLYGONS.angles_per_passage ** len(phases),
        smallest_reportable=MIN_AMPLITUDE,
        promise=float(nats - np.log(scanned)),
        rival_axles=rivals,
    )
    return candidate_of(physics.OutOfRound, hypothesis)
