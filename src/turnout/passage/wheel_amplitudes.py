r"""Compare rows of axles whose wheels are not all as loud: each axle of the comb has an amplitude of its own.

.. math:: y_i(s) = \sum_j a_j k_i(s - d_j) + e, \qquad a_j \sim N(1, \sigma_a^2)

A comb of equal teeth decides between rows of vehicles by the loud and the quiet wheels, as much as by where they are.
Here the amplitudes are integrated out, so that a row is likelier only where its wheels are at better positions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.passage.axle_patterns import offsets as offsets_of
from turnout.passage.comb import (
    COMB_STEP,
    CORRELATION_LENGTH,
    LEAD_LENGTH,
    N_TAPS,
    Comb,
    evidence,
    explained_share,
    profiles_at,
    teeth_of,
)
from turnout.passage.comb_search import FittedRow, choices_of, refine_motion

if TYPE_CHECKING:
    from collections.abc import Iterator

    from turnout.passage.axle_patterns import Vehicle
    from turnout.passage.comb import Profiles
    from turnout.passage.sensor_envelopes import SensorEnvelopes

AMPLITUDE_SD = 0.3  # relative standard deviation of the amplitudes of the wheels of a train
N_PASSES = 2  # of the tooth and the amplitudes in turn
N_REFINED = 3  # rows with an exchanged vehicle whose motion is refined
SPEED_REACH = 0.006  # relative change of the speed by an exchanged vehicle
START_SHIFTS = (-COMB_STEP, 0.0, COMB_STEP)  # m by which a row may be shifted
N_VARIANCE_PASSES = 3  # of the amplitudes and the variance of the residual in turn


@dataclass(frozen=True)
class AmplitudeFit:
    """``amplitudes`` (n_axle,) of the wheels over the tooth [-], ``evidence`` [nat] of the axles against no train.

    ``further`` (n,) is the amplitude [-] that one more wheel would have at each of the ``positions`` (n,) [m] behind
    the first axle.
    """

    amplitudes: np.ndarray
    evidence: float
    positions: np.ndarray
    further: np.ndarray

    def extremes(self, offsets: np.ndarray, spacing: float) -> tuple[float, float]:
        """(weakest wheel, strongest further wheel) over the median wheel; both are near 1 where a wheel is.

        Parameters
        ----------
        offsets : (n_axle,) array of float
            Metres behind the first axle.
        spacing : float
            Least distance of a further wheel from every other one. [m]

        Returns
        -------
        weakest, further : float
            Amplitudes. [-]
        """
        typical = max(float(np.median(self.amplitudes)), 1e-6)
        is_apart = np.abs(np.subtract.outer(self.positions, offsets)).min(axis=1) >= spacing
        return float(self.amplitudes.min()) / typical, float(self.further[is_apart].max(initial=0.0)) / typical


def fit_amplitudes(profiles: Profiles, offsets: np.ndarray, start: float) -> AmplitudeFit:
    r"""Amplitudes of the wheels of a row, and its evidence with the amplitudes integrated out.

    With the tooth's own correlation R and its correlation b with the record, the posterior mean is
    :math:`a = (N + \lambda)^{-1} (b + \lambda)`, :math:`N_{jl} = R(d_j - d_l)`. The log evidence is that of the comb
    with the penalised residual, less :math:`\tfrac12 \ln\det(N/\lambda + 1)`.

    Parameters
    ----------
    profiles : Profiles
        Of one motion.
    offsets : (n_axle,) array of float
        Metres behind the first axle; the first is 0.
    start : float
        First axle behind the beginning of the audible part. [m]

    Returns
    -------
    AmplitudeFit
        The sensors record the same wheels, so that they count as one observation.
    """
    values = profiles.values[:, 0]
    positions = np.arange(values.shape[1]) * COMB_STEP - LEAD_LENGTH - start
    n_point = values.size
    n_per_observation = CORRELATION_LENGTH / COMB_STEP * len(values)
    n_observation = max(float(profiles.length[0]) / CORRELATION_LENGTH, 2.0)
    lags = np.arange(N_TAPS) * COMB_STEP
    amplitudes = np.ones(offsets.size)
    for _ in range(N_PASSES):
        teeth, _ = teeth_of(profiles, Comb.of(offsets, amplitudes), start)
        overlap = np.sum([np.correlate(k, k, "full")[N_TAPS - 1 :] for k in teeth], axis=0)
        matched = np.sum([np.correlate(y, k, "same") for y, k in zip(values, teeth)], axis=0)
        at_axles = np.interp(offsets, positions, matched)
        normal = np.interp(np.abs(np.subtract.outer(offsets, offsets)), lags, overlap, right=0.0)
        residual = _residual_power(profiles, normal, at_axles, amplitudes)
        for _ in range(N_VARIANCE_PASSES):
            weight = n_per_observation * residual / n_point / AMPLITUDE_SD**2
            inverse = np.linalg.inv(normal + weight * np.eye(offsets.size))
            amplitudes = inverse @ (at_axles + weight)
            residual = _residual_power(profiles, normal, at_axles, amplitudes)
    penalised = residual + weight * np.sum((amplitudes - 1.0) ** 2)
    evidence = -0.5 * n_observation * np.log(penalised / profiles.power[0]) - 0.5 * N_TAPS * np.log(n_observation)
    evidence -= 0.5 * float(np.linalg.slogdet(normal / weight + np.eye(offsets.size))[1])
    near = np.interp(np.abs(np.subtract.outer(positions, offsets)), lags, overlap, right=0.0)
    free = overlap[0] - np.sum(near @ inverse * near, axis=1)  # what the amplitudes of the other wheels cannot take up
    further = (matched - near @ amplitudes) / np.maximum(free, 1e-3 * overlap[0])
    return AmplitudeFit(amplitudes, float(evidence), positions, further)


def _residual_power(profiles: Profiles, normal: np.ndarray, at_axles: np.ndarray, amplitudes: np.ndarray) -> float:
    """Sum of the squares of the record without the wheels of these amplitudes."""
    power = float(profiles.power[0])
    explained = 2.0 * float(amplitudes @ at_axles) - float(amplitudes @ normal @ amplitudes)
    return max(power - explained, 1e-6 * power)


def settle_count(envelopes: SensorEnvelopes, fitted: FittedRow) -> tuple[FittedRow, AmplitudeFit, float]:
    """The row with single vehicles exchanged until no other number of axles is likelier.

    Two wagons of one length may have two axles or four. A comb of equal teeth does not tell them apart where wheels
    differ in loudness.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    fitted : FittedRow
        A row of vehicles with its motion.

    Returns
    -------
    row : FittedRow
        ``fitted`` itself where nothing is likelier.
    fit : AmplitudeFit
        Its wheels.
    lead : float
        Log evidence over the likeliest row with one vehicle exchanged and another number of axles; infinite where the
        pattern has none, 0 where the count is not that of ``fitted``: equal and free amplitudes disagree. [nat]
    """
    fit, n_given = _fit_row(envelopes, fitted), fitted.comb.offsets.size
    for _ in range(len(fitted.vehicles)):
        rivals = _rivals(envelopes, fitted)
        if not rivals:
            return fitted, fit, np.inf
        rival, rival_fit = max(((r, _fit_row(envelopes, r)) for r in rivals), key=lambda pair: _log_posterior(*pair))
        lead = _log_posterior(fitted, fit) - _log_posterior(rival, rival_fit)
        if lead >= 0.0:
            break
        fitted, fit = rival, rival_fit
    return fitted, fit, abs(lead) if fitted.comb.offsets.size == n_given else 0.0


def _log_posterior(row: FittedRow, fit: AmplitudeFit) -> float:
    return fit.evidence - choices_of(row.pattern, row.vehicles)


def _fit_row(envelopes: SensorEnvelopes, row: FittedRow) -> AmplitudeFit:
    """The likeliest fit at a few starts: positions on a grid are off by up to half of its step."""
    profiles = profiles_at(envelopes, [row.motion])
    fits = [fit_amplitudes(profiles, row.comb.offsets, row.start + shift) for shift in START_SHIFTS]
    return max(fits, key=lambda f: f.evidence)


def _rivals(envelopes: SensorEnvelopes, fitted: FittedRow) -> list[FittedRow]:
    """The likeliest rows with one vehicle exchanged and another number of axles, each at its own motion."""
    profiles, candidates = profiles_at(envelopes, [fitted.motion]), []
    for vehicles in _exchange_vehicles(fitted):
        comb = Comb.of(offsets_of(vehicles))
        share, starts = explained_share(profiles, comb, np.arange(1))
        k = int(np.argmax(share[0]))
        log_evidence = evidence(share[0, k], profiles.length[0], len(envelopes.positions))
        log_evidence -= choices_of(fitted.pattern, vehicles)
        row = replace(
            fitted,
            vehicles=vehicles,
            comb=comb,
            start=float(starts[k]),
            share=float(share[0, k]),
            evidence=float(log_evidence),
        )
        candidates.append((_log_posterior(row, fit_amplitudes(profiles, comb.offsets, row.start)), row))
    likeliest = sorted(candidates, key=lambda c: -c[0])[:N_REFINED]
    return [refine_motion(envelopes, row, SPEED_REACH) for _, row in likeliest]


def _exchange_vehicles(fitted: FittedRow) -> Iterator[tuple[Vehicle, ...]]:
    """Rows with one vehicle exchanged for another of its group with another number of axles, each once."""
    rows = {}
    for i, vehicle in enumerate(fitted.vehicles):
        for group in fitted.pattern.groups:
            for substitute in group.vehicles if vehicle in group.vehicles else ():
                if len(substitute.axles) != len(vehicle.axles):
                    row = (*fitted.vehicles[:i], substitute, *fitted.vehicles[i + 1 :])
                    rows[tuple((v.length, v.axles) for v in row)] = row
    yield from rows.values()
