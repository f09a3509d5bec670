"""Fit modes to frequency responses in a narrow band by least squares, with the residues eliminated."""

from dataclasses import dataclass

import numpy as np

from turnout.modal.poles import continuous_pole

MAX_ITERATIONS = 25  # of a fit
POLYNOMIAL_TERMS = 3  # coefficients of the polynomial in frequency that stands for modes outside the band
MAX_DAMPING = 0.95  # damping ratio at which a step of the fit ends: at 1 there is no oscillation
MIN_SINGLE_CONTRAST = 30.0  # dB over the residual from which on one mode is enough for a peak


@dataclass(frozen=True)
class FrfFit:
    """Fit of a band: ``theta`` (n_mode, 2) ln f [Hz] and zeta; ``information`` (n_frf, p, p), ``score`` (n_frf, p).

    ``residue`` (n_mode, n_frf) and ``residual`` (n_frf, n_line) are complex. ``noise`` (n_frf,) is the standard
    deviation of each response per real part; ``information`` and ``score`` are relative to it.
    """

    theta: np.ndarray
    information: np.ndarray
    score: np.ndarray
    residue: np.ndarray
    residual: np.ndarray
    noise: np.ndarray

    @property
    def error(self) -> np.ndarray:
        """(n_mode, 2) standard errors of ln f and zeta from the residual."""
        covariance = np.linalg.pinv(self.information.sum(axis=0), hermitian=True)
        return np.sqrt(np.maximum(np.diag(covariance), 1e-300)).reshape(-1, 2)

    @property
    def contrast(self) -> np.ndarray:
        """(n_mode,) height of each resonance over the residual. [dB]"""
        decay_rate = 2.0 * np.pi * np.exp(self.theta[:, 0]) * np.abs(self.theta[:, 1])
        height = np.sqrt(np.mean(np.abs(self.residue) ** 2, axis=1)) / np.maximum(decay_rate, 1e-300)
        residual_level = np.sqrt(np.mean(np.abs(self.residual) ** 2))
        return 20.0 * np.log10(np.maximum(height, 1e-300) / max(residual_level, 1e-300))

    @property
    def cost(self) -> float:
        """Sum of squared residuals over the variance of the noise, which the fit minimises. [-]"""
        return float(np.sum(np.abs(self.residual) ** 2 / self.noise[:, None] ** 2))


def linearise_frf(theta: np.ndarray, frequency: np.ndarray, frf: np.ndarray, noise: np.ndarray) -> FrfFit:
    r"""Local model :math:`\sum_m R_m / (i\omega - s_m) + p_0 + p_1 \omega + p_2 \omega^2` around given modes.

    The polynomial stands for all modes outside the band and for the conjugate poles.

    Parameters
    ----------
    theta : (n_mode, 2) array of float
        Ln f [Hz] and zeta of each mode.
    frequency : (n_line,) array of float
        Lines of the band. [Hz]
    frf : (n_frf, n_line) array of complex
        Responses in the band.
    noise : (n_frf,) array of float
        Standard deviation of each response per real part, in its unit.

    Returns
    -------
    FrfFit
        Residues and residuals of these modes, with information and score.
    """
    n_mode = len(theta)
    omega = 2.0 * np.pi * frequency
    s = continuous_pole(np.exp(theta[:, 0]), theta[:, 1])
    middle, width = omega.mean(), np.ptp(omega) / 2.0
    pole_part = 1.0 / (1j * omega[:, None] - s)
    scale = np.abs(s.real)
    basis = np.hstack([pole_part * scale, ((omega[:, None] - middle) / width) ** np.arange(POLYNOMIAL_TERMS)])
    q, r = np.linalg.qr(basis)
    projection = q.conj().T @ frf.T
    coefficient = np.linalg.solve(r, projection)
    residual = frf.T - q @ projection
    damped = np.sqrt(1.0 - theta[:, 1] ** 2)
    magnitude = 2.0 * np.pi * np.exp(theta[:, 0])
    slope = np.stack([s, magnitude * (-1.0 - 1j * theta[:, 1] / damped)], axis=1)
    columns = (pole_part**2 * scale)[:, :, None] * slope
    columns = columns.reshape(len(omega), 2 * n_mode)
    columns = columns - q @ (q.conj().T @ columns)
    jacobian = columns[:, :, None] * np.repeat(coefficient[:n_mode], 2, axis=0)
    weight = noise**-2.0
    information = np.einsum("kpi,kqi,i->ipq", jacobian.conj(), jacobian, weight).real
    score = np.einsum("kpi,ki,i->ip", jacobian.conj(), residual, weight).real
    return FrfFit(theta, information, score, coefficient[:n_mode] * scale[:, None], residual.T, noise)


def fit_frf(theta: np.ndarray, frequency: np.ndarray, frf: np.ndarray) -> FrfFit:
    """Gauss-Newton from ``theta`` with halved steps, each response weighted by its own residual.

    Parameters
    ----------
    theta : (n_mode, 2) array of float
        Ln f [Hz] and zeta at the start.
    frequency : (n_line,) array of float
        Lines of the band. [Hz]
    frf : (n_frf, n_line) array of complex
        Responses in the band.

    Returns
    -------
    FrfFit
        The last fit, also if the iteration has not converged.
    """
    noise = np.full(len(frf), np.sqrt(np.mean(np.abs(frf) ** 2)))
    fit = linearise_frf(np.asarray(theta, float), frequency, frf, noise)
    for _ in range(MAX_ITERATIONS):
        freedom = max(1, 2 * len(frequency) - 2 * (len(fit.theta) + POLYNOMIAL_TERMS))
        noise = np.sqrt(np.sum(np.abs(fit.residual) ** 2, axis=1) / freedom)
        fit = linearise_frf(fit.theta, frequency, frf, np.maximum(noise, 1e-12 * np.abs(frf).max()))
        information = fit.information.sum(axis=0)
        step = np.linalg.lstsq(information, fit.score.sum(axis=0), rcond=1e-14)[0].reshape(-1, 2)
        limit = np.stack([fit.theta[:, 1], 0.5 * fit.theta[:, 1]], axis=1)
        step = np.clip(step, -limit, limit)
        better = None
        for _ in range(6):
            trial = linearise_frf(_below_critical(fit.theta + step), frequency, frf, fit.noise)
            if trial.cost <= fit.cost:
                better = trial
                break
            step = 0.5 * step
        if better is None:
            return fit
        converged = step.ravel() @ information @ step.ravel() < 1e-6
        fit = better
        if converged:
            return fit
    return fit


def _below_critical(theta: np.ndarray) -> np.ndarray:
    """``theta`` with the damping ratios inside the range of oscillating modes."""
    return np.stack([theta[:, 0], np.clip(theta[:, 1], -MAX_DAMPING, MAX_DAMPING)], axis=1)


def fit_each(
    start: np.ndarray, frequency: np.ndarray, frf: np.ndarray, peak_and_width: tuple[float, float]
) -> list[FrfFit]:
    """Fit each response alone, from the modes of the common fit and with as few modes as possible.

    Poles that differ between responses look like close poles to a common fit. So the mode nearest to the peak is tried
    alone first. It stays the only one if it stands ``MIN_SINGLE_CONTRAST`` over the residual.

    Parameters
    ----------
    start : (n_mode, 2) array of float
        Ln f [Hz] and zeta at the start.
    frequency : (n_line,) array of float
        Lines of the band. [Hz]
    frf : (n_frf, n_line) array of complex
        Responses in the band.
    peak_and_width : (float, float)
        Frequency of the peak and its half-power width. [Hz]

    Returns
    -------
    list of FrfFit
        One fit for each response.
    """
    nearest = int(np.argmin(np.abs(np.exp(start[:, 0]) - peak_and_width[0])))
    single_fits = [_fit_single(start[[nearest]], frequency, response) for response in frf]
    if len(start) == 1 or np.median([fit.contrast[0] for fit in single_fits]) >= MIN_SINGLE_CONTRAST:
        return single_fits
    common = fit_frf(start, frequency, frf)
    return [_fit_single(common.theta, frequency, response) for response in frf]


def _fit_single(theta: np.ndarray, frequency: np.ndarray, response: np.ndarray) -> FrfFit:
    return fit_frf(theta, frequency, response[None])
