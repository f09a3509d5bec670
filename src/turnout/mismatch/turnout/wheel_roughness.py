"""Roughness and profile of single wheels as error modes of a passage, which are integrated out.

Every wheel has its own waves round its tread, at an unknown angle, so that no other passage predicts them. The radius
is known to a few per cent only: within the range of the sensors the waves are those of any rough surface. Their effect
depends on the mass of the wheels. Where a fit finds another mass than the file, the modes are computed again.

At a nose, blade or joint each wheel takes its own path, whereas the file has one for all. Its profile, new or hollow
worn, decides where it leaves the wing rail and how deep it falls (Palsson and Nielsen 2012, Vehicle System Dynamics
50). The shape in the file is only approximate.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh
from scipy.linalg.lapack import spstrf

from turnout.mismatch.engine.candidate_search import masked_candidates
from turnout.mismatch.turnout.rail_roughness import amplitude_sd
from turnout.mismatch.turnout.surface_priors import WHEELS
from turnout.mismatch.turnout.wave_response import WaveTransfer
from turnout.mismatch.turnout.wheel_flights import flight_modes
from turnout.mismatch.turnout.wheel_tops import top_modes
from turnout.simulate.blade import is_on_blade

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.mismatch.turnout.passage_observation import AlignedPassage
    from turnout.mismatch.turnout.prediction import Predictor
    from turnout.mismatch.turnout.predictions import Values
    from turnout.mismatch.turnout.rail_roughness import Waves
    from turnout.simulate.wheel_path import PathPart


def profile_modes(predictor: Predictor, values: Values, aligned: AlignedPassage, transfer: WaveTransfer) -> np.ndarray:
    """Signals of one standard deviation of each wheel's path over each component.

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

    Returns
    -------
    (n_sensor * n_time, n_mode) array of float
        [m/s²]
    """
    surfaces = predictor.surface.surfaces(aligned.passage.route, values)
    if transfer.load_transfer is not None:
        tops = [(component, is_on_blade(surface)) for surface in surfaces for component in _components(surface)]
        return top_modes(predictor, values, aligned, transfer, tops)
    grid = transfer.fine_grid
    paths = [
        path for surface in surfaces for component in _components(surface) for path in _deviations(component, grid)
    ]
    if not paths:
        return np.zeros((len(aligned.sensors) * aligned.time.size, 0))
    deviations = np.array(paths)
    linear = transfer.tops_response(deviations, deviations, transfer.wheels())
    simulated = flight_modes(predictor, values, aligned, (grid, deviations), linear)
    return np.concatenate(list(linear if simulated is None else simulated), axis=1)


def _components(surface: Sequence[PathPart]) -> list[PathPart]:
    """Components of a surface except waves and errors of a top, which are the same for all wheels."""
    return [c for c in surface if not (hasattr(c, "wavelength") or hasattr(c, "is_shape_error"))]


def _deviations(component: PathPart, grid: np.ndarray) -> list[np.ndarray]:
    """Standard deviations of a surface component at ``grid`` (n,) [m]: deeper, further, longer, sharper.

    A height step between its ends is the same for all wheels.
    """
    ends = getattr(component, "places", grid)[0], getattr(component, "places", grid)[-1]
    inside = (grid >= ends[0]) & (grid <= ends[1])
    dip = np.where(inside, component(grid, 0) - np.interp(grid, ends, component(np.array(ends), 0)), 0.0)
    deepest = np.max(np.abs(dip))
    if deepest < WHEELS.min_depth:
        return []
    slope = np.gradient(dip, grid)
    from_middle = np.clip(grid - grid[np.argmax(np.abs(dip))], -WHEELS.max_nose_length, WHEELS.max_nose_length)
    share = np.abs(dip) / deepest
    sharper = np.sign(dip) * deepest * (share**0.75 - share)
    return [
        WHEELS.depth_sd * dip,
        WHEELS.position_sd * slope,
        WHEELS.length_sd * from_middle * slope,
        WHEELS.sharpness_sd * sharper,
    ]


def wheel_modes(predictor: Predictor, values: Values, aligned: AlignedPassage, sigma: np.ndarray) -> np.ndarray:
    """Signals of one standard deviation of the roughness and profile of all wheels.

    ``sigma`` (n,) is the error of the observation. In single precision: a long train over many sensors has a thousand
    modes of ten thousand samples each.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    aligned : AlignedPassage
        The passage.
    sigma : (n_sensor * n_time,) array of float
        Error of the observation. [m/s²]

    Returns
    -------
    (n_sensor * n_time, n_mode) array of float
        In single precision. [m/s²]
    """
    waves, scale = predictor.waves, sigma[:, None].astype(np.float32)
    radii, transfer = (
        aligned.passage.vehicle.wheel_values("radius"),
        WaveTransfer(predictor, values, aligned, beyond=WHEELS.roughness_margin),
    )
    treads = {radius: _wave_sds(waves, radius) for radius in radii}
    blocks = [profile_modes(predictor, values, aligned, transfer).astype(np.float32) / scale]
    rail_sds: tuple[Any, ...] = (0.0, waves.sd[::2], waves.sd[::2])
    for envelope, rail in zip(_envelopes(waves, transfer.node), rail_sds):
        plus, minus = (x.astype(np.complex64) for x in transfer.spectra(waves.lengths, envelope))
        for w, radius in enumerate(radii):
            sd = np.repeat(np.hypot(treads[radius], rail), 2).astype(np.float32)
            columns = transfer.signals_from((plus, minus), transfer.wheel(w).astype(np.complex64)) * sd / scale
            power = np.einsum("ij,ij->j", columns, columns)
            blocks.append(columns[:, power > WHEELS.faint_share * WHEELS.min_mode_variance])
    scaled = np.concatenate(blocks, axis=1)
    return scale * (scaled @ principal_directions(scaled.T @ scaled, WHEELS.min_mode_variance))


def principal_directions(gram: np.ndarray, least: float) -> np.ndarray:
    """Eigenvectors of a Gram matrix with an eigenvalue above ``least``, in single precision.

    Two thirds of a thousand waves are combinations of the others. So the matrix is factorised with pivoting (Higham
    1990, Analysis of the Cholesky decomposition) until what is left of no diagonal element matters. The eigenvectors
    follow from the smaller Gram matrix of the factor, in a quarter of the time.

    Parameters
    ----------
    gram : (n, n) array of float
        Symmetric, without negative eigenvalues.
    least : float
        Above 0.

    Returns
    -------
    (n, n_kept) array of float
        In single precision, orthonormal to its rounding.
    """
    gram = np.asfortranarray(gram, dtype=np.float32)
    lower, order, rank, _ = spstrf(gram, lower=1, tol=WHEELS.factor_tolerance * least)
    factor = np.empty((len(gram), rank), dtype=np.float32)
    factor[order - 1] = np.tril(lower[:, :rank])
    power, vectors = eigh(factor.T @ factor, driver="evd", overwrite_a=True)  # scipy's: half the time of numpy's
    is_kept = power > least
    return factor @ (vectors[:, is_kept] / np.sqrt(power[is_kept]))


def _wave_sds(waves: Waves, radius: float) -> np.ndarray:
    """(n_length,) standard deviation of the waves of a wheel [m]."""
    sd, circumference = amplitude_sd(waves.lengths, waves.length, WHEELS.level), 2.0 * np.pi * radius
    # out of round: the variance of an harmonic is spread over the waves up to half an order beside it
    is_out_of_round = np.clip(np.round(circumference / waves.lengths), 1, 99) <= 3
    sd[is_out_of_round] = np.maximum(
        sd[is_out_of_round], WHEELS.out_of_round_sd * np.sqrt(circumference / waves.length)
    )
    return sd


def _envelopes(waves: Waves, node: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Envelopes (n_node,) of the region with free rail waves, of that before and of that behind it.

    In the latter two the roughness of the rail is an error of each wheel as well.
    """
    inside = (node >= waves.start - 0.3) & (node <= waves.end + 0.3)
    outside, ahead = 1.0 - waves.fade(node), node < 0.5 * (waves.start + waves.end)
    return inside.astype(float), outside * ahead, outside * ~ahead


def log_mass_ratios(case: TrackCase, fit: Fit) -> dict[str, float]:
    """Logarithm of each train's unsprung mass in ``fit`` over that of the file, dict train -> float.

    Where it is a nuisance, the value is that without its narrow prior in the base model.

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        A fit of the case.

    Returns
    -------
    dict
        Train -> logarithm of the ratio.
    """
    masked = {c.site.masking_parameter: start for _, c, start, _ in masked_candidates(case, fit)}
    log_ratios = {}
    for aligned in case.aligned_passages.values():
        conditions = aligned.conditions
        file = vehicle = aligned.passage.vehicle
        for term in case.all_terms(fit):
            vehicle = term.under_conditions(conditions).vehicle(vehicle)
        wheel, train = file.wheels[0], conditions["train"]
        name = f"wheels_{train}"
        nuisance_value = float(np.log(masked[name][0])) if name in masked else fit.values[name]
        log_ratios[train] = nuisance_value + float(np.log(vehicle.bodies[wheel].mass / file.bodies[wheel].mass))
    return log_ratios
