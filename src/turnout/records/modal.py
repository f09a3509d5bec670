"""Results of a hammer test: the impacts, the averaged receptance of a section, its modes and its state-space model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from turnout.records.unit import Rejection

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure


def value_with_error(value: float, error: float | None) -> str:
    """A value with its error, both to the last digit that the error leaves significant.

    Parameters
    ----------
    value : float
        The value. [any unit]
    error : float or None
        Its error; None for the value alone. [same unit]

    Returns
    -------
    str
        Without unit.

    Examples
    --------
    >>> value_with_error(154.63, 0.83), value_with_error(611.4, 2.3), value_with_error(99.6, 0.12)
    ('154.6 ± 0.8', '611 ± 2', '99.60 ± 0.12')
    >>> value_with_error(154.63, None)
    '154.6'
    """
    if error is None or not 0.0 < error < math.inf:
        return f"{value:.4g}"
    exponent = math.floor(math.log10(error))
    n_digit = max(0, -exponent + (error < 2.0 * 10.0**exponent))
    return f"{value:.{n_digit}f} ± {error:.{n_digit}f}"


@dataclass(frozen=True)
class Mode:
    """One resonance: ``frequency`` [Hz] undamped, ``damping`` ratio, with standard errors and interval.

    ``*_se`` is the standard error of the campaign value. It adds two parts in squares: ``*_repeatability`` from the
    spread of its ``n`` impacts, and ``*_systematic`` from what the modes leave of all impacts alike, and from the
    choice among explanations. ``*_sd`` is the spread between impacts after subtraction of the estimation error of each
    impact. ``*_low`` and ``*_high`` are the two-sided 95 % interval, for damping within 0 and 1. ``*_crb`` is the
    Cramér-Rao bound of the same decays, as a standard error.
    ``band`` is "ballast", "railpad" or "other". ``energy`` is the mode's share of the energy of the decay.
    """

    band: str
    frequency: float
    damping: float
    frequency_se: float | None = None
    damping_se: float | None = None
    frequency_sd: float | None = None
    damping_sd: float | None = None
    frequency_low: float | None = None
    frequency_high: float | None = None
    damping_low: float | None = None
    damping_high: float | None = None
    frequency_crb: float | None = None
    damping_crb: float | None = None
    energy: float | None = None
    n: int = 0
    frequency_repeatability: float | None = None
    damping_repeatability: float | None = None
    frequency_systematic: float | None = None
    damping_systematic: float | None = None

    @property
    def frequency_text(self) -> str:
        """Frequency with half its 95 % interval, such as "154.6 ± 0.8 Hz"."""
        return f"{value_with_error(self.frequency, _half(self.frequency_low, self.frequency_high))} Hz"

    @property
    def damping_text(self) -> str:
        """Damping ratio in percent with half its 95 % interval, such as "5.2 ± 0.3 %"."""
        half = _half(self.damping_low, self.damping_high)
        return f"{value_with_error(100.0 * self.damping, None if half is None else 100.0 * half)} %"

    def __repr__(self) -> str:
        return f"Mode({self.band}, {self.frequency_text}, damping {self.damping_text}, n = {self.n})"


def _half(low: float | None, high: float | None) -> float | None:
    """Half the width of an interval, None without one."""
    return None if low is None or high is None else 0.5 * (high - low)


@dataclass(frozen=True)
class FittedReceptance:
    r"""Receptance of the modes of a section, as fitted to the measured one.

    .. math:: H(p) = \frac{1}{p^2}\left[\sum_m \frac12\left(\frac{R_m}{p - s_m} + \frac{\bar R_m}{p - \bar s_m}\right)
              + d_0 + d_1 p^2\right], \quad p = i 2\pi f + a

    ``pole`` [1/s] and ``residue`` [m/s² per N s] are (n_mode,) complex: first those of the model's modes, in their
    order, then those of further modes in the fit. ``direct`` holds d0 [m/s²/N] and d1 [m/N]: the acceleration follows
    the force at once, which no free decay shows. ``residue_se`` holds the standard errors of the residues, of the real
    part in its real and of the imaginary part in its imaginary part. ``decay`` [1/s] is that of the exponential window
    of the measurement.
    """

    pole: np.ndarray
    residue: np.ndarray
    direct: tuple[float, float]
    residue_se: np.ndarray
    decay: float = 0.0

    def at(self, frequency: np.ndarray) -> np.ndarray:
        """Receptance at given frequencies.

        Parameters
        ----------
        frequency : (n,) array of float
            Above 0. [Hz]

        Returns
        -------
        (n,) array of complex
            Displacement per force. [m/N]

        Examples
        --------
        A free mass of 4 kg has a direct term only:

        >>> mass = FittedReceptance(np.empty(0), np.empty(0), (0.25, 0.0), np.empty(0))
        >>> print((mass.at(np.array([1.0 / (2.0 * np.pi)])) * 4.0).round(9))
        [-1.+0.j]
        """
        p = 2j * np.pi * np.asarray(frequency, dtype=float)[:, None] + self.decay
        terms = 0.5 * (self.residue / (p - self.pole) + self.residue.conj() / (p - self.pole.conj()))
        return terms.sum(axis=1) / p[:, 0] ** 2 + self.direct[0] / p[:, 0] ** 2 + self.direct[1]


@dataclass(frozen=True)
class ModalModel:
    """State-space model of one section: x[k+1] = A x[k], y[k] = c x[k], x[0] = b for a unit impact.

    ``a`` is (order, order), ``b`` and ``c`` are (order,), ``rate`` is in Hz. ``status`` is "accepted", "rejected" with
    ``rejections``, or "second_order_only": the gate passed only the ballast mode, as at the paper's section A8.
    ``per_impact`` holds the estimates of each impact: impact, band, frequency, damping, frequency_se, damping_se.
    ``stabilisation`` holds those of each model order: order, frequency, damping, status. ``rejected_modes`` lists the
    rejected candidates with the reason. ``receptance`` is the measured one where the caller keeps it, for ``plot``.

    ``a``, ``b`` and ``c`` describe the free decay after an impact. They do not hold the part of the acceleration that
    follows the force at once, nor modes without a name, so they alone do not give the receptance: that is
    ``fitted_receptance``, where a receptance was measured.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    rate: float
    modes: tuple[Mode, ...]
    method: str = "joint"
    status: str = "accepted"
    rejections: tuple[Rejection, ...] = ()
    per_impact: tuple[Mapping, ...] = ()
    stabilisation: tuple[Mapping, ...] = ()
    rejected_modes: tuple[Mapping, ...] = ()
    fit: float | None = None
    diagnostics: Mapping = field(default_factory=dict)
    receptance: Receptance | None = None
    fitted_receptance: FittedReceptance | None = None

    def __repr__(self) -> str:
        modes = [f"{mode.band} {mode.frequency_text}" for mode in self.modes]
        n = [f"n = {max(mode.n for mode in self.modes)}"] if modes else []
        reasons = [r.detail or r.reason for r in self.rejections]
        words = "; ".join(text for text in (", ".join([*modes, *n]), *reasons) if text)
        return f"ModalModel({self.method}, {self.status}: {words or 'no mode'})"

    def plot(self, figure: Figure | SubFigure | None = None) -> np.ndarray:
        """Draw the modes with their errors, below the measured and the fitted receptance if the model holds them.

        Parameters
        ----------
        figure : matplotlib.figure.Figure or SubFigure, optional
            Where to draw; a new figure by default.

        Returns
        -------
        (n_axes,) array of matplotlib.axes.Axes
            Receptance [m/N] over frequency [Hz], if it is known, then for each mode its damping ratio [%] over its
            frequency [Hz]: the estimate of each impact with its standard error, the mean with its 95 % interval.
        """
        from turnout.plots import plot_model

        return plot_model(self, figure)

    @property
    def order(self) -> int:
        """Number of states."""
        return self.a.shape[0]

    def mode(self, band: str) -> Mode | None:
        """The mode of ``band``, or None.

        Parameters
        ----------
        band : str
            "ballast", "railpad" or "other".

        Returns
        -------
        Mode or None
            The first mode of that band.
        """
        return next((m for m in self.modes if m.band == band), None)


@dataclass(frozen=True)
class Receptance:
    r"""Averaged receptance of one section with its coherence.

    All arrays are (n_frequency,); ``frequency`` [Hz] is above 0. ``h1``, ``h2``, ``hv`` complex [m/N];
    ``coherence`` has the two-sided 95 % limits ``coherence_low`` and ``coherence_high``. The gate compares its
    one-sided lower limit ``gate_level``; ``passed`` is the result. ``n`` is the number of averaged impacts.
    ``valid_to`` [Hz] is the hammer's band edge. With an exponential window of ``decay`` [1/s] the responses are those
    at :math:`i\omega + a`: the window adds this decay rate to every mode.
    """

    frequency: np.ndarray
    h1: np.ndarray
    h2: np.ndarray
    hv: np.ndarray
    coherence: np.ndarray
    coherence_low: np.ndarray
    coherence_high: np.ndarray
    gate_level: np.ndarray
    passed: np.ndarray
    n: int
    valid_to: float
    gate: str = "limit"
    decay: float = 0.0

    def __repr__(self) -> str:
        if not len(self.frequency):
            return f"Receptance(no impact, n = {self.n})"
        band = f"{self.frequency[0]:.3g} to {self.frequency[-1]:.4g} Hz, {len(self.frequency)} lines"
        return f"Receptance({band}, {np.mean(self.passed):.0%} pass the gate, n = {self.n})"

    def plot(self, figure: Figure | SubFigure | None = None) -> np.ndarray:
        """Draw magnitude and coherence over frequency; lines that fail the gate are shaded.

        Parameters
        ----------
        figure : matplotlib.figure.Figure or SubFigure, optional
            Where to draw; a new figure by default.

        Returns
        -------
        (2,) array of matplotlib.axes.Axes
            Magnitude of the receptance [m/N] and coherence [-] over frequency [Hz].
        """
        from turnout.plots import plot_receptance

        return plot_receptance(self, figure)


@dataclass(frozen=True)
class Impact:
    """One hammer impact, cut out of a recording, with its quality.

    ``force`` [N] and ``acceleration`` [m/s²] are (n_sample,) from ``onset`` - pre-trigger on; the indices
    ``onset``, ``contact_end`` and ``decay_start`` count from the first of these samples. ``peak`` [N],
    ``contact`` [s], ``impulse`` [N s], ``noise_force`` [N] and ``noise_acceleration`` [m/s²] (pre-trigger rms),
    ``band_edge`` [Hz] where the force spectrum has fallen by 20 dB. ``rejections`` is empty for an accepted
    impact; ``notes`` are findings that do not reject it (a double impact whose decay starts after the last contact).
    """

    force: np.ndarray
    acceleration: np.ndarray
    rate: float
    onset: int
    contact_end: int
    decay_start: int
    peak: float
    contact: float
    impulse: float
    noise_force: float
    noise_acceleration: float
    band_edge: float
    source: str = ""
    record: int = 0
    rejections: tuple[Rejection, ...] = ()
    notes: tuple[Rejection, ...] = ()

    def __repr__(self) -> str:
        source = f"{self.source}, record {self.record + 1}" if self.source else f"record {self.record + 1}"
        if self.rejections:
            return f"Impact({source}, rejected: {', '.join(r.reason for r in self.rejections)})"
        return f"Impact({source}, accepted: {self.peak:.0f} N in {1e3 * self.contact:.2g} ms)"

    @property
    def accepted(self) -> bool:
        """Whether the impact has no rejection."""
        return not self.rejections

    @property
    def decay(self) -> np.ndarray:
        """(n,) acceleration from the start of the free decay on. [m/s²]"""
        return self.acceleration[self.decay_start :]
