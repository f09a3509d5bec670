"""Compute the filtered response of a sensor to one wheel: a model's free decay from an impact between two samples."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from scipy import fft

from turnout.records import ModalModel

# Impacts are sought at the middles of 16 equal parts of the interval between two samples.
FRACTIONS = (np.arange(16) + 0.5) / 16


@dataclass(frozen=True)
class WheelBasis:
    r"""Columns that span every response of a model to a jump of its state, after a causal filter.

    .. math:: y_k = c A^{k+\varphi} w = \sum_m 2\,\mathrm{Re}\,(cV)_m (V^{-1}w)_m \lambda_m^{\varphi}\lambda_m^k

    ``columns`` is (n_column, n_sample): real and imaginary part of the filtered powers of each pole; column
    sample 0 is the first sample at or after the impact, which lies the fraction ``phi`` of a sample before it.

    Examples
    --------
    One real pole 0.5 unfiltered, the impact a whole sample before the first: half is left.

    >>> model = ModalModel(np.array([[0.5]]), np.ones(1), np.ones(1), 1.0, ())
    >>> basis = wheel_basis(model, None, 1.0, longest=99.0)
    >>> np.round(basis.response(1.0)[:3], 6).tolist()
    [0.5, 0.25, 0.125]
    """

    poles: np.ndarray
    output: np.ndarray
    to_modes: np.ndarray
    direction: np.ndarray
    columns: np.ndarray
    rate: float

    @property
    def n_column(self) -> int:
        """Number of columns."""
        return self.columns.shape[0]

    @property
    def n_sample(self) -> int:
        """Samples of each column."""
        return self.columns.shape[1]

    def coefficients(self, phi: np.ndarray, jump: np.ndarray | None = None) -> np.ndarray:
        """(..., n_column) weights of the columns for a jump (n_state,), default b, ``phi`` samples early.

        Parameters
        ----------
        phi : float or (...) array of float
            Fraction of a sample by which the impact precedes the first sample. [samples]
        jump : (n_state,) array of float, optional
            Jump of the state; b by default.

        Returns
        -------
        (..., n_column) array of float
            Weights; leading shape of ``phi``.
        """
        jump = self.direction if jump is None else jump
        weight = self.output * (self.to_modes @ jump)
        weight = weight * self.poles ** np.asarray(phi, dtype=float)[..., None]
        return self._real(weight)

    def slopes(self, phi: np.ndarray) -> np.ndarray:
        """(..., n_column) derivative of ``coefficients`` by ``phi``. [1/sample]

        Parameters
        ----------
        phi : float or (...) array of float
            Fraction of a sample by which the impact precedes the first sample. [samples]

        Returns
        -------
        (..., n_column) array of float
            Derivative. [1/sample]
        """
        weight = self.output * (self.to_modes @ self.direction) * np.log(self.poles)
        return self._real(weight * self.poles ** np.asarray(phi, dtype=float)[..., None])

    def _real(self, weight: np.ndarray) -> np.ndarray:
        oscillates = self.poles.imag > 0
        components = [np.where(oscillates, 2.0, 1.0) * weight.real, -2.0 * weight.imag]
        stacked = np.stack(components, axis=-1).reshape(*weight.shape[:-1], -1)
        keep = np.stack([np.ones_like(oscillates), oscillates], axis=-1).ravel()
        return stacked[..., keep]

    def advance(self, weights: np.ndarray, phi: np.ndarray) -> np.ndarray:
        """(n, n_column) column weights if the impacts are ``phi`` (n,) samples earlier.

        Parameters
        ----------
        weights : (n, n_column) or (n_column,) array of float
            Column weights of each impact, or of all.
        phi : (n,) array of float
            By how much each impact is earlier. [samples]

        Returns
        -------
        (n, n_column) array of float
            The new weights.
        """
        oscillates = self.poles.imag > 0
        index = np.concatenate([[0], np.cumsum(1 + oscillates)[:-1]])
        weights = np.asarray(weights, dtype=float)
        real = weights[:, index]
        imaginary = np.where(oscillates, -weights[:, np.minimum(index + 1, weights.shape[1] - 1)], 0.0)
        scale = np.where(oscillates, 2.0, 1.0)
        return self._real((real + 1j * imaginary) / scale * self.poles ** np.asarray(phi, float)[:, None])

    def response(self, phi: np.ndarray, jump: np.ndarray | None = None) -> np.ndarray:
        """(n_sample,) filtered response to one jump.

        Parameters
        ----------
        phi : float
            Fraction of a sample by which the impact precedes the first sample. [samples]
        jump : (n_state,) array of float, optional
            Jump of the state; b by default.

        Returns
        -------
        (n_sample,) array of float
            Response. [m/s²]
        """
        return self.coefficients(phi, jump) @ self.columns

    @cached_property
    def gram(self) -> np.ndarray:
        """(n_column, n_column) inner products of the columns."""
        return self.columns @ self.columns.T

    @cached_property
    def unit_weights(self) -> np.ndarray:
        """(n_fraction, n_column) weights of a response of unit norm for impacts at ``FRACTIONS``."""
        theta = self.coefficients(FRACTIONS)
        return theta / np.sqrt(np.einsum("qp,pr,qr->q", theta, self.gram, theta))[:, None]

    def correlate(self, rows: np.ndarray, n_lag: int) -> np.ndarray:
        """(n_row, n_lag, n_column) inner products of the columns with each row (n_row, n), shifted by every lag.

        Parameters
        ----------
        rows : (n_row, n) array of float
            Data. [m/s²]
        n_lag : int
            Number of lags, from 0.

        Returns
        -------
        (n_row, n_lag, n_column) array of float
            Inner products. [(m/s²)²]
        """
        size = fft.next_fast_len(rows.shape[1], real=True)
        if size not in self._spectra:
            self._spectra[size] = fft.rfft(self.columns, size).conj()
        product = fft.irfft(fft.rfft(rows, size)[:, None, :] * self._spectra[size], size)
        return product[:, :, :n_lag].transpose(0, 2, 1)

    @cached_property
    def _spectra(self) -> dict:
        return {}

    def truncated_unit_weights(self, n_observed: np.ndarray) -> np.ndarray:
        """(n, n_fraction, n_column) ``unit_weights`` for the first ``n_observed`` (n,) samples of a response.

        Parameters
        ----------
        n_observed : (n,) array of int
            Samples of the response that are observed.

        Returns
        -------
        (n, n_fraction, n_column) array of float
            Weights.
        """
        key = tuple(int(k) for k in n_observed)
        if key not in self._truncated_weights:
            products = self.columns[:, None, :] * self.columns[None, :, :]
            grams = np.cumsum(products, axis=2)[:, :, np.clip(np.asarray(n_observed) - 1, 0, self.n_sample - 1)]
            theta = self.coefficients(FRACTIONS)
            square = np.einsum("qp,prn,qr->nq", theta, grams, theta)
            self._truncated_weights[key] = theta / np.sqrt(np.maximum(square, 1e-300))[..., None]
        return self._truncated_weights[key]

    @cached_property
    def _truncated_weights(self) -> dict:
        return {}

    @cached_property
    def ring_length(self) -> int:
        """Samples after which the columns stay below 2 % of their peak."""
        level = np.abs(self.columns).max(axis=0)
        return int(np.flatnonzero(level > 0.02 * level.max())[-1]) + 1

    @cached_property
    def whitening(self) -> np.ndarray:
        """(n_column, n_column) upper triangular; its product with column weights has the norm of the response."""
        gram = self.gram + 1e-12 * np.trace(self.gram) * np.eye(self.n_column)
        return np.linalg.cholesky(gram).T

    def lagged_gram(self, lag: int) -> np.ndarray:
        """(n_column, n_column) inner products of the columns of a wheel with those of one ``lag`` samples later.

        Parameters
        ----------
        lag : int
            Samples by which the second wheel is later.

        Returns
        -------
        (n_column, n_column) array of float
            0 where the responses do not overlap.
        """
        if lag >= self.n_sample:
            return np.zeros((self.n_column, self.n_column))
        return self.columns[:, lag:] @ self.columns[:, : self.n_sample - lag].T

    def truncate(self, n: int) -> WheelBasis:
        """The same basis with the first ``n`` samples of its columns.

        Parameters
        ----------
        n : int
            Samples that stay.

        Returns
        -------
        WheelBasis
            ``self`` where the columns are no longer than that.
        """
        if n >= self.n_sample:
            return self
        if n not in self._truncated:
            columns = self.columns[:, :n].copy()
            modes = (self.poles, self.output, self.to_modes, self.direction)
            self._truncated[n] = WheelBasis(*modes, columns, self.rate)
        return self._truncated[n]

    @cached_property
    def _truncated(self) -> dict:
        return {}


def band_pass(low: float, high: float, order: int, rate: float) -> np.ndarray:
    """(n_section, 6) second-order sections of the causal Butterworth band-pass for data and model alike.

    Parameters
    ----------
    low, high : float
        Edges; ``high`` is at most 0.45 times the rate. [Hz]
    order : int
        Order of each flank.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    (n_section, 6) array of float
        Second-order sections.

    Raises
    ------
    ValueError
        The edges are not in order, or not between 0 and 0.45 times the rate.
    """
    high = min(high, 0.45 * rate)
    if not 0 < low < high:
        raise ValueError(f"no band between {low} Hz and {high} Hz at {rate} samples per second")
    return scipy.signal.butter(order, [low, high], btype="bandpass", fs=rate, output="sos")


def apply_filter(samples: np.ndarray, filter_: np.ndarray | None) -> np.ndarray:
    """Samples (..., n) behind ``filter_``: second-order sections (n, 6), taps (n,) or None for no filter.

    Parameters
    ----------
    samples : (..., n) array of float
        Samples. [any unit]
    filter_ : (n_section, 6) or (n_tap,) array of float, or None
        The filter.

    Returns
    -------
    (..., n) array of float
        Filtered samples. [same unit]
    """
    if filter_ is None:
        return np.asarray(samples, dtype=float)
    if np.ndim(filter_) == 2:
        return scipy.signal.sosfilt(filter_, samples, axis=-1)
    return scipy.signal.lfilter(filter_, [1.0], samples, axis=-1)


def settling_length(poles: np.ndarray, filter_: np.ndarray | None, tolerance: float, longest: int) -> int:
    """Samples after which the slowest pole of model and filter has decayed to ``tolerance``.

    Parameters
    ----------
    poles : (n_pole,) array of complex
        Poles of the model in discrete time. [-]
    filter_ : (n_section, 6) or (n_tap,) array of float, or None
        The filter.
    tolerance : float
        Remaining amplitude. [-]
    longest : int
        Largest number of samples.

    Returns
    -------
    int
        Number of samples, at least 8 unless ``longest`` is less.
    """
    inner = scipy.signal.sos2zpk(filter_)[1] if filter_ is not None and np.ndim(filter_) == 2 else np.zeros(0)
    radii = np.concatenate([np.abs(poles), np.abs(inner), [0.0]])
    slowest = min(radii.max(), 1 - 1e-6)
    return int(min(longest, max(8, np.ceil(np.log(tolerance) / np.log(slowest)))))


def wheel_basis(
    model: ModalModel, filter_: np.ndarray | None, rate: float, tolerance: float = 1e-4, longest: float = 0.25
) -> WheelBasis:
    """Basis of ``model`` at the sampling ``rate`` of the passage [Hz], behind ``filter_`` (``apply_filter``).

    A model identified at another rate is converted by A^(ratio): its poles in 1/s stay the same. ``tolerance``
    is the remaining amplitude at which columns end, ``longest`` [s] their limit. ValueError for an unstable model.

    Parameters
    ----------
    model : ModalModel
        State-space model of a section.
    filter_ : (n_section, 6) or (n_tap,) array of float, or None
        Filter of the data, see ``apply_filter``.
    rate : float
        Sampling rate of the passage. [Hz]
    tolerance : float
        Remaining amplitude at which the columns end. [-]
    longest : float
        Largest length of the columns. [s]

    Returns
    -------
    WheelBasis
        Responses of the model.

    Raises
    ------
    ValueError
        The model is unstable.
    """
    poles, vectors = np.linalg.eig(np.asarray(model.a, dtype=float))
    if np.abs(poles).max() >= 1.0:
        raise ValueError(f"the model is unstable: |eigenvalue| {np.abs(poles).max():.6f}")
    order = np.lexsort((poles.real, np.abs(np.angle(poles))))
    poles, vectors = poles[order].astype(complex), vectors[:, order]
    inverse = np.linalg.inv(vectors)
    keep = poles.imag >= 0
    poles, output, inverse = poles[keep], (np.asarray(model.c) @ vectors)[keep], inverse[keep]
    poles = poles ** (model.rate / rate)
    n = settling_length(poles, filter_, tolerance, int(longest * rate))
    powers = poles[:, None] ** np.arange(n)
    components = np.stack([powers.real, powers.imag], axis=1).reshape(-1, n)
    is_used = np.stack([np.ones(len(poles), bool), poles.imag > 0], axis=-1).ravel()
    columns = apply_filter(components[is_used], filter_)
    return WheelBasis(poles, output.astype(complex), inverse, np.asarray(model.b, float), columns, rate)
