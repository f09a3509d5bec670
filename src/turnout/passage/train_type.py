"""Identify the train type by its axle pattern: posterior probability over templates and "unknown"."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from turnout.constants import KMH
from turnout.passage.axle_patterns import Vehicle, offsets
from turnout.passage.vehicle_sequence import closest_row

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from turnout.config.settings.passage import PassageSettings
    from turnout.passage.axle_patterns import Pattern

UNKNOWN = "unknown"
# m, axle spacings of a train without template: inside bogies 1.8 to 3.2 m, between them up to 22 m.
BOGIE_WHEELBASE, BOGIE_WHEELBASE_SD, MIN_LONG_SPACING, MAX_SPACING = 2.4, 0.4, 3.4, 22.0


@dataclass(frozen=True)
class TypeFinding:
    """``type`` is a name or "unknown", ``probability`` its posterior; ``probabilities`` those of every candidate.

    ``vehicles`` and ``offsets`` (n_axle,) [m] belong to the best template, also where it was not accepted. Then
    ``residual`` [m], the rms deviation of the axle spacings, is the reason. ``speed`` [m/s] at the first axle,
    ``speed_se``, ``acceleration`` [m/s²] and ``acceleration_se`` follow from the template's distances. ``middle_speed``
    and ``middle_speed_se`` are for the middle between the first and the last axle, where an uncertain acceleration
    matters least, at the time ``middle_time`` [s].
    """

    type: str
    probability: float
    probabilities: dict[str, float]
    vehicles: tuple[Vehicle, ...] = ()
    offsets: np.ndarray | None = None
    residual: float | None = None
    speed: float | None = None
    speed_se: float | None = None
    acceleration: float | None = None
    acceleration_se: float | None = None
    middle_speed: float | None = None
    middle_speed_se: float | None = None
    middle_time: float | None = None

    @property
    def middle_motion(self) -> tuple[float, float, float, float, float]:
        """Speed and its standard error, acceleration and its standard error, and time of the speed: of the middle.

        nan where they are not known.
        """
        values = self.middle_speed, self.middle_speed_se, self.acceleration, self.acceleration_se, self.middle_time
        speed, speed_se, acceleration, acceleration_se, time = (float("nan") if v is None else v for v in values)
        return speed, speed_se, acceleration, acceleration_se, time


@dataclass(frozen=True)
class _Candidate:
    type: str
    evidence: float
    p_value: float
    vehicles: tuple
    offsets: np.ndarray
    residual: float
    motion: tuple


def axle_times_to_motion(
    times: np.ndarray, positions: np.ndarray, sigma: float, limit: float
) -> tuple[np.ndarray, np.ndarray]:
    r"""Speed and acceleration at the first axle from times and known distances, with their covariance.

    .. math:: d = u_0 + v t + \tfrac12 a t^2

    Most trains pass a turnout at a steady speed: the acceleration is 0 ± 0.02 m/s² with prior probability 0.8, else
    0 ± ``limit`` / 4. Both fits are weighted by their evidence; the covariance includes the difference between them.
    ``sigma`` [m] is the error of one axle's position. Returns ((v, a), covariance (2, 2)).

    Parameters
    ----------
    times : (n_axle,) array of float
        Times of the axles at one position. [s]
    positions : (n_axle,) array of float
        d, distances behind the first axle. [m]
    sigma : float
        Standard deviation of one axle's position. [m]
    limit : float
        Four standard deviations of the wide prior of the acceleration. [m/s²]

    Returns
    -------
    motion : (2,) array of float
        Speed [m/s] and acceleration [m/s²].
    covariance : (2, 2) array of float
        Covariance of both.
    """
    t = np.asarray(times, dtype=float) - times[0]
    design = np.column_stack([np.ones_like(t), t, 0.5 * t**2]) / sigma
    target = np.asarray(positions, dtype=float) / sigma
    fits = []
    for share, width in ((0.8, 0.02), (0.2, limit / 4)):
        normal = design.T @ design + np.diag([0.0, 0.0, width**-2])
        covariance = np.linalg.pinv(normal)
        solution = covariance @ design.T @ target
        misfit = np.sum((target - design @ solution) ** 2) + (solution[2] / width) ** 2
        log = np.log(share / width) - 0.5 * misfit - 0.5 * np.linalg.slogdet(normal)[1]
        fits.append((log, solution[1:], covariance[1:, 1:]))
    weight = np.exp(np.array([f[0] for f in fits]) - max(f[0] for f in fits))
    weight /= weight.sum()
    mean = sum(w * f[1] for w, f in zip(weight, fits))
    total_covariance = sum(w * (f[2] + np.outer(f[1] - mean, f[1] - mean)) for w, f in zip(weight, fits))
    return mean, total_covariance


def find_type(
    times: np.ndarray,
    patterns: Sequence[Pattern],
    settings: PassageSettings,
    speed: float | None = None,
    speed_se: float | None = None,
    position_se: float = 0.03,
) -> TypeFinding:
    """Template that the axle ``times`` (n_axle,) [s] fit, at any speed, or at ``speed`` ± ``speed_se`` [m/s].

    ``position_se`` [m] is the error of one axle's position along the rail. A type is named if its posterior probability
    reaches ``settings.type_probability`` and its deviations pass a chi-squared test at 0.001; else "unknown".

    Parameters
    ----------
    times : (n_axle,) array of float
        Times of the axles at one position. [s]
    patterns : sequence of Pattern
        Axle patterns of known trains.
    settings : PassageSettings
        Tolerance of the templates, probabilities, limits of speed and acceleration.
    speed : float, optional
        Speed at the first axle, if it is known. [m/s]
    speed_se : float, optional
        Its standard error. [m/s]
    position_se : float
        Standard error of one axle's position. [m]

    Returns
    -------
    TypeFinding
        "unknown" for fewer than three axles.
    """
    times = np.asarray(times, dtype=float)
    if len(times) < 3:
        return TypeFinding(UNKNOWN, 1.0, {UNKNOWN: 1.0})
    sigma = float(np.sqrt(2 * position_se**2 + settings.type_tolerance**2))
    candidates: dict[str, _Candidate] = {}
    for pattern in patterns:
        candidate = _fit_pattern(times, pattern, settings, speed, speed_se, sigma)
        if candidate and candidate.evidence > getattr(candidates.get(candidate.type), "evidence", -np.inf):
            candidates[candidate.type] = candidate
    return _decide_type(times, candidates, len({p.type for p in patterns}), settings, speed, sigma)


def _decide_type(
    times: np.ndarray,
    candidates: dict[str, _Candidate],
    n_type: int,
    settings: PassageSettings,
    speed: float | None,
    sigma: float,
) -> TypeFinding:
    log_posterior = {
        name: c.evidence + np.log((1 - settings.unknown_prior) / max(n_type, 1)) for name, c in candidates.items()
    }
    likeliest = max(candidates.values(), key=lambda c: c.evidence, default=None)
    v = speed or (likeliest.motion[0][0] if likeliest else BOGIE_WHEELBASE / np.min(np.diff(times)))
    log_posterior[UNKNOWN] = np.log(settings.unknown_prior) + unknown_evidence(v * np.diff(times))
    top = max(log_posterior.values())
    weight = {name: float(np.exp(value - top)) for name, value in log_posterior.items()}
    total = sum(weight.values())
    posterior = {name: w / total for name, w in sorted(weight.items())}
    if likeliest is None:
        return TypeFinding(UNKNOWN, posterior[UNKNOWN], posterior)
    (v, a), covariance = likeliest.motion
    half_duration = 0.5 * float(times[-1] - times[0])
    to_middle = np.array([1.0, half_duration])
    accepted = posterior[likeliest.type] >= settings.type_probability and likeliest.p_value >= 1e-3
    return TypeFinding(
        likeliest.type if accepted else UNKNOWN,
        posterior[likeliest.type] if accepted else max(posterior[UNKNOWN], 1.0 - posterior[likeliest.type]),
        posterior,
        likeliest.vehicles,
        likeliest.offsets,
        likeliest.residual,
        float(v),
        float(np.sqrt(covariance[0, 0])),
        float(a),
        float(np.sqrt(covariance[1, 1])),
        float(v + a * half_duration),
        float(np.sqrt(to_middle @ covariance @ to_middle)),
        float(times[0]) + half_duration,
    )


def unknown_evidence(spacing: np.ndarray) -> float:
    """Log density of axle spacings [m] of a train that has no template.

    Short spacings (in a bogie) and long ones form a Markov chain: a short one is nearly always followed by a long one.
    This distinguishes bogies from axles where the speed is not known.

    Parameters
    ----------
    spacing : (n_axle - 1,) array of float
        Distances between neighbouring axles. [m]

    Returns
    -------
    float
        Log density. [nat]
    """
    short = np.asarray(spacing) < MIN_LONG_SPACING
    density = np.where(
        short,
        0.95 * scipy.stats.norm.pdf(spacing, BOGIE_WHEELBASE, BOGIE_WHEELBASE_SD) + 0.01,
        1 / (MAX_SPACING - MIN_LONG_SPACING),
    )
    density = np.where(np.asarray(spacing) > 1.5 * MAX_SPACING, 1e-4, density)
    transitions = np.where(short[:-1], np.where(short[1:], 0.05, 0.95), np.where(short[1:], 0.85, 0.15))
    # three short ones in a row are four axles at bogie distance, which no vehicle has
    runs = np.sum(short[:-2] & short[1:-1] & short[2:])
    first = np.log(0.9 if short[0] else 0.1) + runs * np.log(0.01)
    return float(np.sum(np.log(density)) + np.sum(np.log(transitions)) + first)


def _fit_pattern(
    times: np.ndarray,
    pattern: Pattern,
    settings: PassageSettings,
    speed: float | None,
    speed_se: float | None,
    sigma: float,
) -> _Candidate | None:
    """Best row of one pattern: a coarse search over speed and acceleration, then a fine one."""
    low, high = pattern.axle_counts()
    if not low <= len(times) <= high:
        return None
    elapsed = times - times[0]
    row = pattern.fixed_row()
    if speed is not None and not _is_plausible(times, pattern, row, settings, speed, speed_se or 0.0):
        return None
    if row is None:
        starts = _start_values(times, pattern, settings, speed, speed_se)
        rows = [closest_row(np.diff(v * elapsed + 0.5 * a * elapsed**2), pattern, 5.0 * sigma) for v, a in starts]
        row = min((r for r in rows if r), key=lambda r: r[0], default=None)
        for _ in range(3):
            if row is None:
                break
            (v, a), _ = axle_times_to_motion(times, offsets(row[1]), sigma, settings.acceleration_limit)
            refined = closest_row(np.diff(v * elapsed + 0.5 * a * elapsed**2), pattern, 2.0 * sigma)
            if refined is None or refined[1] == row[1]:
                break
            row = refined
    return _candidate(times, pattern.type, row, settings, speed, speed_se, sigma) if row else None


def _is_plausible(
    times: np.ndarray,
    pattern: Pattern,
    row: tuple[float, tuple[Vehicle, ...], float] | None,
    settings: PassageSettings,
    speed: float,
    speed_se: float,
) -> bool:
    """Whether the known speed allows the pattern, by a short test.

    It compares the length of a fixed row, or the first wheelbase of a free one.
    """
    duration = times[-1] - times[0]
    slack = 4 * speed_se * duration + 0.5 * settings.acceleration_limit * duration**2 + 1.0
    if row is not None:
        return abs(offsets(row[1])[-1] - speed * duration) < slack
    wheelbases = {v.axles[1] - v.axles[0] for g in pattern.groups for v in g.vehicles if len(v.axles) > 1}
    gap = times[1] - times[0]
    return any(abs(speed * gap - wheelbase) < 4 * speed_se * gap + 0.1 * wheelbase + 0.2 for wheelbase in wheelbases)


def _candidate(
    times: np.ndarray,
    type_: str,
    row: tuple[float, tuple[Vehicle, ...], float],
    settings: PassageSettings,
    speed: float | None,
    speed_se: float | None,
    sigma: float,
) -> _Candidate | None:
    """Motion, residual and evidence of one row of vehicles."""
    _, vehicles, choices = row
    positions = offsets(vehicles)
    motion, covariance, residual = _row_motion(times, positions, settings, sigma)
    v, a = motion
    if not settings.speed_minimum / KMH <= v <= settings.speed_maximum / KMH or abs(a) > settings.acceleration_limit:
        return None
    chi_squared, freedom = float(np.sum((residual / sigma) ** 2)), _freedom(residual)
    if speed is not None and speed_se:
        chi_squared += float((v - speed) ** 2 / (speed_se**2 + covariance[0, 0]))
        freedom += 1
    evidence = -0.5 * chi_squared - len(residual) * np.log(sigma * np.sqrt(2 * np.pi)) - choices
    p_value = float(scipy.stats.chi2.sf(chi_squared, freedom))
    return _Candidate(type_, evidence, p_value, vehicles, positions, _rms(residual), (motion, covariance))


def _row_motion(
    times: np.ndarray, positions: np.ndarray, settings: PassageSettings, sigma: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Motion of a row of axles, its covariance, and the residuals (n_axle - 1,) of the axle spacings [m].

    A second fit has the error that the residuals of the first show. It is not a factor on the covariance: the prior of
    the acceleration is as wide as before.
    """
    position_error, limit = sigma / np.sqrt(2), settings.acceleration_limit
    motion, _ = axle_times_to_motion(times, positions, position_error, limit)
    elapsed = times - times[0]
    fitted_positions = motion[0] * elapsed + 0.5 * motion[1] * elapsed**2
    residual = np.diff(fitted_positions) - np.diff(positions)
    # the error of an axle follows the observed scatter, as far as a few axles determine it
    ratio = (_rms(residual) / sigma) ** 2 * len(times) / _freedom(residual)
    # errors of neighbours are correlated, most in a heavy vehicle: fewer of them are independent
    factor = min(1.0, max(ratio, 0.1)) * _variance_inflation(fitted_positions - positions)
    return *axle_times_to_motion(times, positions, position_error * np.sqrt(factor), limit), residual


def _rms(residual: np.ndarray) -> float:
    return float(np.sqrt(np.mean(residual**2)))


def _freedom(residual: np.ndarray) -> int:
    """Degrees of freedom of the residuals of axle spacings after a fit of speed and acceleration."""
    return max(len(residual) - 2, 1)


def _variance_inflation(residual: np.ndarray) -> float:
    r"""Factor on a variance for residuals (n,) with autocorrelation: :math:`(1 + \rho) / (1 - \rho)`.

    >>> _variance_inflation(np.array([1.0, -1.0] * 4)), round(_variance_inflation(np.repeat([1.0, -1.0], 4)), 1)
    (1.0, 4.3)
    """
    centred = residual - residual.mean()
    power = float(np.sum(centred**2))
    rho = float(np.sum(centred[1:] * centred[:-1])) / power if power > 0 else 0.0
    rho = min(max(rho, 0.0), 0.8)
    return (1.0 + rho) / (1.0 - rho)


def _start_values(
    times: np.ndarray, pattern: Pattern, settings: PassageSettings, speed: float | None, speed_se: float | None
) -> Iterator[tuple[float, float]]:
    """Start values of speed and acceleration, fine enough for the coarse tolerance over the whole train."""
    spacing = np.diff(times)
    if speed is not None:
        n = int(np.ceil(2.0 * (speed_se or 0.0) / (0.02 * speed)))
        speeds = speed * (1 + 0.02 * np.arange(-min(n, 12), min(n, 12) + 1))
    else:
        leading = [v for g in pattern.groups for v in g.vehicles if len(v.axles) > 1]
        bases = sorted({round(float(np.diff(v.axles)[0]), 2) for v in leading})
        speeds = np.array([base / spacing[0] * f for base in bases for f in (0.985, 1.0, 1.015)])
    for v in speeds:
        step = 0.03 * v / max(times[-1] - times[0], 1e-3)
        n = int(np.floor(min(settings.acceleration_limit, 1.0) / step))
        for k in range(-min(n, 40), min(n, 40) + 1):
            # the mean speed stays v: a train that accelerates starts slower
            yield v - 0.5 * k * step * (times[-1] - times[0]), k * step
