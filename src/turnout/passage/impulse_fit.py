"""Fit the impacts of all wheels of a passage at one sensor by joint least squares.

A whitening filter for a sensor's noise is estimated here too, so that sums of squares can be tested.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from turnout.passage.wheel_basis import WheelBasis


@dataclass(frozen=True)
class WheelFit:
    """Amplitudes of every wheel, all wheels estimated together.

    ``times`` (n_wheel,) impact times in samples, ``amplitudes`` (n_wheel, n_number): one amplitude along b, or
    the free jump's column weights. ``covariance`` (n_wheel n_number, same) without the noise variance,
    ``prediction`` (n_sample,) the model's response to all wheels.
    """

    times: np.ndarray
    amplitudes: np.ndarray
    covariance: np.ndarray
    prediction: np.ndarray

    def standard_errors(self, noise: float) -> np.ndarray:
        """(n_wheel, n_number) standard errors of ``amplitudes`` under white noise of this standard deviation.

        Parameters
        ----------
        noise : float
            Standard deviation of the noise. [unit of the data]

        Returns
        -------
        (n_wheel, n_number) array of float
            In the unit of ``amplitudes``.
        """
        return noise * np.sqrt(np.diag(self.covariance)).reshape(self.amplitudes.shape)


def onsets(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First sample at or after each impact, and the fraction of a sample by which the impact precedes it.

    Parameters
    ----------
    times : (n_wheel,) array of float
        Times of the impacts. [samples]

    Returns
    -------
    first : (n_wheel,) array of int
        First sample at or after each impact.
    phi : (n_wheel,) array of float
        Fraction of a sample between impact and ``first``, from 0 to 1. [samples]
    """
    times = np.asarray(times, dtype=float)
    first = np.ceil(times - 1e-12).astype(int)
    return first, np.maximum(first - times, 0.0)


def joint_fit(data: np.ndarray, times: np.ndarray, basis: WheelBasis, free: bool = False) -> WheelFit:
    r"""Least squares over all wheels, including their overlaps.

    .. math:: \min \| y - \sum_j g_j\, h(k - t_j) \|^2, \qquad h = F * c A^k b

    with F the filter of the data, or the free jump w_j in place of g_j b (``free``). The normal equations are banded:
    wheels further from each other than the response do not interact.

    Parameters
    ----------
    data : (n_sample,) array of float
        Acceleration behind the filter of ``basis``. [m/s²]
    times : (n_wheel,) array of float
        Impact times, increasing. [samples]
    basis : WheelBasis
        Responses; a wheel whose response runs past the end is fitted on the available samples.
    free : bool
        Estimate the free jump (as many numbers as the model has states) instead of one amplitude along b.

    Returns
    -------
    WheelFit

    Raises
    ------
    ValueError
        A wheel lies outside the data.

    References
    ----------
    Barkhordari et al., eq. 17 (initial state), here corrected to one joint problem for all wheels.

    Examples
    --------
    Two overlapping decays of a pole 0.5, 3 and 5 high:

    >>> from turnout.passage.wheel_basis import wheel_basis
    >>> from turnout.records import ModalModel
    >>> model = ModalModel(np.array([[0.5]]), np.ones(1), np.ones(1), 1.0, ())
    >>> basis = wheel_basis(model, None, 1.0, longest=99.0)
    >>> y = np.zeros(40)
    >>> y[3:] += 3 * 0.5 ** np.arange(37)
    >>> y[5:] += 5 * 0.5 ** np.arange(35)
    >>> joint_fit(y, [3, 5], basis).amplitudes.ravel().round(3).tolist()
    [3.0, 5.0]
    """
    data = np.asarray(data, dtype=float)
    first, phi = onsets(times)
    weights = _weights(basis, phi, free)
    right_side, blocks, n_overlap = _normal_equations(data, first, weights, basis)
    numbers, covariance = _solve_banded(blocks, right_side, n_overlap)
    amplitudes = numbers.reshape(len(first), -1)
    prediction = predict(len(data), first, np.einsum("jp,jpq->jq", amplitudes, weights), basis)
    return WheelFit(np.asarray(times, float), amplitudes, covariance, prediction)


def predict(n: int, first: np.ndarray, weights: np.ndarray, basis: WheelBasis) -> np.ndarray:
    """(n,) sum over the wheels of their weighted columns from ``first`` on; ``weights`` (n_wheel, n_column).

    Parameters
    ----------
    n : int
        Samples of the prediction.
    first : (n_wheel,) array of int
        First sample of each response.
    weights : (n_wheel, n_column) array of float
        Weights of the columns of ``basis``.
    basis : WheelBasis
        Responses of the model.

    Returns
    -------
    (n,) array of float
        Sum of the responses. [m/s²]
    """
    prediction = np.zeros(n)
    for start, weight in zip(first, weights):
        length = min(basis.n_sample, n - start)
        if length > 0 and start >= 0:
            prediction[start : start + length] += weight @ basis.columns[:, :length]
    return prediction


def _weights(basis: WheelBasis, phi: np.ndarray, free: bool) -> np.ndarray:
    """(n_wheel, n_number, n_column)."""
    if not free:
        return basis.coefficients(phi)[:, None, :]
    return np.broadcast_to(np.eye(basis.n_column), (len(phi), basis.n_column, basis.n_column))


def _normal_equations(
    data: np.ndarray, first: np.ndarray, weights: np.ndarray, basis: WheelBasis
) -> tuple[np.ndarray, dict[tuple[int, int], np.ndarray], int]:
    """Right side (n,), blocks {(i, j): (p, p)} of the normal matrix, and how many wheels overlap."""
    n_wheel, p, _ = weights.shape
    grams: dict[int, np.ndarray] = {}
    blocks: dict[tuple[int, int], np.ndarray] = {}
    right_side, n_overlap = np.zeros(n_wheel * p), 0
    for i, start in enumerate(first):
        length = min(basis.n_sample, len(data) - start)
        if length <= 0 or start < 0:
            raise ValueError(f"wheel {i} at sample {start} lies outside the {len(data)} samples")
        right_side[i * p : (i + 1) * p] = weights[i] @ (basis.columns[:, :length] @ data[start : start + length])
        for j in range(i, n_wheel):
            lag = first[j] - start
            if lag >= length:
                break
            if length < basis.n_sample:
                gram = basis.columns[:, lag:length] @ basis.columns[:, : length - lag].T
            else:
                gram = grams[lag] if lag in grams else grams.setdefault(lag, basis.lagged_gram(lag))
            blocks[i, j] = weights[i] @ gram @ weights[j].T
            n_overlap = max(n_overlap, j - i)
    return right_side, blocks, n_overlap


def _solve_banded(
    blocks: dict[tuple[int, int], np.ndarray], right_side: np.ndarray, n_overlap: int
) -> tuple[np.ndarray, np.ndarray]:
    """Solution and inverse of the banded normal matrix, with a tiny ridge for wheels that coincide."""
    p = next(iter(blocks.values())).shape[0]
    width = (n_overlap + 1) * p
    bands = np.zeros((width, right_side.size))
    for (i, j), block in blocks.items():
        for a in range(p):
            for b in range(p):
                row, column = i * p + a, j * p + b
                if column >= row:
                    bands[width - 1 - (column - row), column] = block[a, b]
    bands[-1] += 1e-12 * max(bands[-1].max(), np.finfo(float).tiny)
    factor = linalg.cholesky_banded(bands)
    inverse = linalg.cho_solve_banded((factor, False), np.eye(right_side.size))
    return linalg.cho_solve_banded((factor, False), right_side), inverse


def whitener(quiet: np.ndarray, order: int = 16) -> tuple[np.ndarray, float]:
    """Taps (order + 1,) of the prediction-error filter of ``quiet`` (n,), and the standard deviation of its residual.

    Yule-Walker on the biased autocovariance: always stable, exact for autoregressive noise as n grows. ValueError
    for fewer than ten samples per tap.

    Parameters
    ----------
    quiet : (n,) array of float
        Noise without a train. [any unit]
    order : int
        Order of the filter.

    Returns
    -------
    taps : (order + 1,) array of float
        Prediction-error filter. [-]
    noise : float
        Standard deviation of its residual. [same unit]

    Raises
    ------
    ValueError
        Fewer than ten samples per tap.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> taps, noise = whitener(3.0 * rng.standard_normal(20000), 4)
    >>> print(np.round(taps, 1) + 0.0, round(noise, 1))
    [1. 0. 0. 0. 0.] 3.0
    """
    quiet = np.asarray(quiet, dtype=float)
    quiet = quiet - quiet.mean()
    if quiet.size < 10 * (order + 1):
        raise ValueError(f"{quiet.size} quiet samples are too few for a filter of order {order}")
    n = 1 << int(np.ceil(np.log2(2 * quiet.size)))
    power = np.abs(np.fft.rfft(quiet, n)) ** 2
    covariance = np.fft.irfft(power)[: order + 1] / quiet.size
    if covariance[0] == 0.0:
        return np.eye(1, order + 1)[0], 0.0
    # 1e-6 of white noise: constant samples of a converter must not make the matrix singular
    covariance[0] *= 1.0 + 1e-6
    coefficients = linalg.solve_toeplitz(covariance[:-1], covariance[1:])
    variance = covariance[0] - coefficients @ covariance[1:]
    return np.concatenate([[1.0], -coefficients]), float(np.sqrt(max(variance, 0.0)))
