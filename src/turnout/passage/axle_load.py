"""Estimate axle loads from the quasi-static deflection of the rail, calibrated on trains of known weight."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import scipy

from turnout.passage.axles import GRID_STEP, along_train

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from turnout.config.settings.passage import PassageSettings
    from turnout.passage.result import Passage
    from turnout.records import Recording

TIME_STEP = 0.001  # s, bins of the slow acceleration
SPEED_EXPONENT, SPEED_EXPONENT_SD = 2.0, 0.3  # of an amplitude: acceleration is v² w''; and its prior deviation
# Relative error of the load of a train of a type that is not in the calibration: on a nearly smooth rail IC3 came out
# 2 % too heavy and intercity trains 3 % too light (21 simulated trains).
OTHER_TYPE_ERROR = 0.03
MAX_AMPLITUDE_ERROR = 0.3  # relative standard error of an amplitude; above it the logarithm has no normal error
WAVENUMBER_BAND = (0.12, 0.9)  # cycles per metre: below is drift, above is vibration


@dataclass(frozen=True)
class LoadCalibration:
    r"""Amplitude per load of one channel: :math:`\ln(A / P) = \ln k + \gamma \ln(v / v_0)`.

    ``log_gain`` and ``exponent`` (near 2: acceleration is v² w'') have the ``covariance`` (2, 2). ``scatter`` is the
    relative scatter of one train about it, ``n`` the number of trains. ``speed`` is v_0 [m/s]; ``slowest`` and
    ``fastest`` limit the speeds [m/s]. ``shared`` is the correlation of its errors with those of the other channels,
    1 where it is not measured. ``types`` are the types of its trains, None where they are not known.
    """

    log_gain: float
    exponent: float
    covariance: np.ndarray
    scatter: float
    n: int
    speed: float
    slowest: float
    fastest: float
    shared: float = 1.0
    types: tuple[str, ...] | None = None


@dataclass(frozen=True)
class LoadFinding:
    """Mean axle load with standard error [t], and ``per_axle`` (n_axle,) [t], which is less accurate.

    1.96 standard errors on either side are a 95 % interval: those from few trains or axles are enlarged for it.
    """

    mean: float
    se: float
    per_axle: np.ndarray


def quasi_static(samples: np.ndarray, rate: float, passage: Passage, position: float) -> np.ndarray:
    r"""(n_axle,) amplitude of each axle in the slow acceleration at one sensor, positive for a load. [m/s²]

    Least squares of :math:`\sum_j A_j (v_j/v_0)^2 \kappa(s - d_j)`, κ the curvature of a rail on an elastic foundation
    with wavenumber 1.1 per metre. Data and κ are both limited to ``WAVENUMBER_BAND`` along the train. v_j is the speed
    of axle j at the sensor; v_0 is the speed of the motion, which is that of the calibration.

    Parameters
    ----------
    samples : (n_sample,) array of float
        Acceleration of one sensor. [m/s²]
    rate : float
        Sampling rate. [Hz]
    passage : Passage
        Motion and axle offsets of the train.
    position : float
        Position of the sensor. [m]

    Returns
    -------
    (n_axle,) array of float
        Amplitude of each axle. [m/s²]
    """
    per_bin = max(round(TIME_STEP * rate), 1)
    n = len(samples) // per_bin
    slow = np.asarray(samples[: n * per_bin], float).reshape(n, per_bin).mean(axis=1)
    start, stop = passage.offsets[0] - 12.0, passage.offsets[-1] + 12.0
    motion = passage.train_motion
    row = along_train((slow - np.median(slow))[None], per_bin / rate, [position], motion, start, stop)[0]
    sections = scipy.signal.butter(3, WAVENUMBER_BAND, btype="bandpass", fs=1.0 / GRID_STEP, output="sos")
    grid = np.arange(len(row)) * GRID_STEP + start
    kx = 1.1 * np.abs(grid[:, None] - passage.offsets)
    columns = np.exp(-kx) * (np.cos(kx) - np.sin(kx))
    columns *= (motion.speed_at(motion.passing(passage.offsets, position)) / motion.speed) ** 2
    columns = scipy.signal.sosfiltfilt(sections, columns, axis=0)
    return np.linalg.lstsq(columns, scipy.signal.sosfiltfilt(sections, row), rcond=None)[0]


def train_amplitude(per_axle: np.ndarray) -> tuple[float, float]:
    """Mean of ``quasi_static`` (n_axle,) and its standard error, both signed like a load; inf from a single axle.

    A slow train causes less than the noise, by v² w''. Its axles then differ by more than loads do; the error shows it.

    Parameters
    ----------
    per_axle : (n_axle,) array of float
        Amplitude of each axle. [m/s²]

    Returns
    -------
    mean, se : float
        Mean amplitude and its standard error. [m/s²]

    Examples
    --------
    Half the difference is the standard error of the mean of two.

    >>> mean, se = train_amplitude([1.0, 4.0])
    >>> print(f"{mean:.2f} ± {se:.2f}")
    2.50 ± 1.50
    >>> train_amplitude([2.0])
    (2.0, inf)
    """
    per_axle = np.asarray(per_axle, dtype=float)
    if per_axle.size < 2:
        return float(per_axle.mean()), float("inf")
    return float(per_axle.mean()), float(per_axle.std(ddof=1) / np.sqrt(per_axle.size))


def with_speed_error(mean: float, se: float, speed: float, speed_se: float) -> tuple[float, float]:
    """``train_amplitude`` with the error that the train's speed adds: a load follows from amplitude over speed squared.

    Parameters
    ----------
    mean, se : float
        Mean amplitude and its standard error. [m/s²]
    speed, speed_se : float
        Speed of the train and its standard error. [m/s]

    Returns
    -------
    mean, se : float
        Mean amplitude and its standard error. [m/s²]

    Examples
    --------
    >>> mean, se = with_speed_error(2.0, 0.03, 20.0, 0.2)
    >>> print(f"{mean:.2f} ± {se:.2f}")
    2.00 ± 0.05
    """
    return mean, float(np.hypot(se, SPEED_EXPONENT * speed_se / speed * mean))


def calibrate(
    amplitudes: ArrayLike, loads: ArrayLike, speeds: ArrayLike, min_trains: int = 5, errors: ArrayLike | None = None
) -> LoadCalibration | None:
    """Calibration of one channel from trains of known mean axle load; None from fewer than ``min_trains``.

    Parameters
    ----------
    amplitudes : (n_train,) array of float
        Mean amplitude of each train at the channel, sign of the sensor included. [m/s²]
    loads : (n_train,) array of float
        Mean axle load of each train. [t]
    speeds : (n_train,) array of float
        Speed of each train. [m/s]
    min_trains : int
        Least number of usable trains; at least 3 are needed.
    errors : (n_train,) array of float or None
        Standard errors of the amplitudes; trains above ``MAX_AMPLITUDE_ERROR`` do not count. [m/s²]

    Returns
    -------
    LoadCalibration or None
        None from fewer trains.
    """
    amplitude, load, speed = (np.asarray(x, dtype=float) for x in (amplitudes, loads, speeds))
    amplitude = np.abs(amplitude)
    error = np.zeros(amplitude.shape) if errors is None else np.asarray(errors, dtype=float)
    is_usable = (amplitude > 0) & (load > 0) & (error <= MAX_AMPLITUDE_ERROR * amplitude)
    if is_usable.sum() < max(min_trains, 3):
        return None
    reference = float(np.exp(np.mean(np.log(speed[is_usable]))))
    relative = np.log(speed[is_usable] / reference)
    target = np.log(amplitude[is_usable] / load[is_usable])
    # acceleration goes with v²; trains of one speed cannot show anything else
    prior = np.array([[0.0, 0.0], [0.0, SPEED_EXPONENT_SD**-2]])
    scatter, own_variance = 0.05, (error[is_usable] / amplitude[is_usable]) ** 2
    design = np.column_stack([np.ones(is_usable.sum()), relative])
    for _ in range(10):
        weight = 1.0 / (scatter**2 + own_variance)
        normal = (design * weight[:, None]).T @ design + prior
        solution = np.linalg.solve(normal, design.T @ (weight * target) + prior @ [0.0, SPEED_EXPONENT])
        residual = target - design @ solution
        # variance beyond the trains' own errors, weighted as the fit is
        excess = (
            np.sum(weight * (residual**2 * is_usable.sum() / max(is_usable.sum() - 2, 1) - own_variance)) / weight.sum()
        )
        scatter = float(np.sqrt(max(excess, 1e-6)))
    low, high = speed[is_usable].min(), speed[is_usable].max()
    covariance = np.linalg.inv(normal)
    return LoadCalibration(
        float(solution[0]),
        float(solution[1]),
        covariance,
        scatter,
        int(is_usable.sum()),
        reference,
        float(low),
        float(high),
    )


def with_error_correlation(
    calibrations: Mapping[str, LoadCalibration], trains: Sequence[Mapping]
) -> dict[str, LoadCalibration]:
    """The ``calibrations`` by channel, with the correlation of the trains' residuals in any two channels.

    A wrong speed, frozen ballast and the train's own roughness are the same in all sensors: more sensors do not help.
    ``trains`` are dicts with "load" [t], "speed" [m/s] and "amplitudes", channel -> (mean, standard error) [m/s²].

    Parameters
    ----------
    calibrations : mapping
        Channel -> LoadCalibration.
    trains : sequence of mappings
        Trains of the calibration, as described above.

    Returns
    -------
    dict
        Channel -> LoadCalibration with ``shared``, the correlation between channels [-].
    """
    residuals = {
        name: [_standardised_residual(calibration, train, name) for train in trains]
        for name, calibration in calibrations.items()
    }
    covariance_sum, power_sum = 0.0, 0.0
    for first, second in combinations(residuals.values(), 2):
        a, b = np.array([pair for pair in zip(first, second) if None not in pair], dtype=float).reshape(-1, 2).T
        covariance_sum += float(a @ b)
        power_sum += float(np.sqrt((a @ a) * (b @ b)))
    shared = min(max(covariance_sum / power_sum, 0.0), 1.0) if power_sum > 0.0 else 1.0
    return {name: replace(calibration, shared=shared) for name, calibration in calibrations.items()}


def _standardised_residual(calibration: LoadCalibration, train: Mapping, name: str) -> float | None:
    """Residual of one train in one channel, in standard deviations; None where the train did not count."""
    mean, error = np.abs(train["amplitudes"].get(name, (0.0, 0.0)))
    if mean == 0.0 or train["load"] <= 0.0 or error > MAX_AMPLITUDE_ERROR * mean:
        return None
    expected = calibration.log_gain + calibration.exponent * np.log(train["speed"] / calibration.speed)
    return float((np.log(mean / train["load"]) - expected) / np.hypot(calibration.scatter, error / mean))


def axle_load(
    recording: Recording, passage: Passage, calibrations: Mapping[str, LoadCalibration], settings: PassageSettings
) -> LoadFinding | None:
    """Mean axle load from all calibrated channels; None ("unavailable") where its error would exceed the setting.

    A calibration is used between 0.8 times its slowest and 1.25 times its fastest train. The error of the train's speed
    is the same at all channels. So is ``OTHER_TYPE_ERROR``, of a train of another type than those of the calibration.

    Parameters
    ----------
    recording : Recording
        Recording of the passage.
    passage : Passage
        The train that was found.
    calibrations : mapping
        Channel -> LoadCalibration.
    settings : PassageSettings
        Settings of the passage analysis.

    Returns
    -------
    LoadFinding or None
        Mean axle load with its standard error, and the load of each axle. [t]
    """
    logs, errors, shapes, shared, by_type = [], [], [], 1.0, 0.0
    train_type = None if passage.type is None else passage.type.type
    positions = {c.name: c.position for c in recording.channels}
    for name in passage.at_sensor:
        calibration, position = calibrations.get(name), positions[name]
        speed = passage.train_motion.speed
        if (
            calibration is None
            or position is None
            or not 0.8 * calibration.slowest <= speed <= 1.25 * calibration.fastest
        ):
            continue
        amplitudes = quasi_static(recording.signal(name), recording.rate, passage, position)
        mean, error = np.abs(train_amplitude(amplitudes))
        if mean == 0 or error > MAX_AMPLITUDE_ERROR * mean:
            continue
        regressors = np.array([1.0, np.log(speed / calibration.speed)])
        logs.append(np.log(mean) - regressors @ [calibration.log_gain, calibration.exponent])
        by_trains = float(regressors @ calibration.covariance @ regressors + calibration.scatter**2)
        errors.append(_student_error(by_trains, calibration.n - 2, float(error / mean) ** 2, amplitudes.size - 1))
        shapes.append(amplitudes / np.mean(amplitudes))
        shared = calibration.shared
        if calibration.types is not None and train_type not in calibration.types:
            by_type = OTHER_TYPE_ERROR
    if not logs:
        return None
    weight = np.array(errors) ** -2
    log_mean = float(np.sum(weight * logs) / weight.sum())
    contributions = weight * np.array(errors) / weight.sum()
    variance = shared * contributions.sum() ** 2 + (1.0 - shared) * np.sum(contributions**2)
    # of the mean, from the differences of the sensors: one sensor whose gain has changed moves the mean as much
    between = np.sum(weight * (np.array(logs) - log_mean) ** 2) / (weight.sum() * max(len(logs) - 1, 1))
    by_speed = 0.0 if passage.speed is None else SPEED_EXPONENT * passage.speed.se / passage.speed.speed
    relative = float(np.sqrt(max(variance, between) + by_speed**2 + by_type**2))
    if relative > settings.load_relative_error_maximum:
        return None
    mean = float(np.exp(log_mean))
    return LoadFinding(mean, relative * mean, mean * np.mean(shapes, axis=0))


def _student_error(by_trains: float, n_train: int, by_axles: float, n_axle: int) -> float:
    """Standard error for a 95 % interval, from two variances with their degrees of freedom (Welch, Satterthwaite).

    Five trains determine their scatter to a third only: where it is small by chance, the interval would be too short.
    """
    variance = by_trains + by_axles
    freedom = variance**2 / (by_trains**2 / n_train + by_axles**2 / n_axle)
    return float(np.sqrt(variance) * scipy.stats.t.ppf(0.975, freedom) / scipy.stats.norm.ppf(0.975))
