"""Resonances and the state-space model they stand in.

Averaged frequency response of a section.

One blow of the hammer with its quality.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from turnout.records.unit import Rejection


@dataclass(frozen=True)
class Mode:
    """One resonance: ``frequency`` [Hz] undamped, ``damping`` ratio, with standard errors and interval.

    ``*_se`` is the standard error of the campaign value from the spread of its ``n`` impacts, ``*_sd`` the
    between-impact spread that is left after the estimation error of each impact is taken off, ``*_low`` and
    ``*_high`` the two-sided 95 % t interval, ``*_crb`` the Cramér-Rao bound of the same decays (standard error).
    ``band`` is "ballast", "railpad" or "other". ``energy`` is its share of the decay's energy.
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


@dataclass(frozen=True)
class ModalModel:
    """State-space model of one section: x[k+1] = A x[k], y[k] = c x[k], x[0] = b for a unit impact.

    ``a`` (order, order), ``b`` and ``c`` (order,), ``rate`` [Hz]. ``status`` is "accepted",
    "second_order_only" (the gate left only the ballast mode, as at the paper's A8) or "rejected" with
    ``rejections``. ``per_impact`` holds the estimates behind the summary: a structured table with fields
    impact, band, frequency, damping, frequency_se, damping_se. ``stabilisation`` the same for orders: order,
    frequency, damping, status. ``rejected_modes`` says which candidate was dropped and why.
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

    @property
    def order(self) -> int:
        """Number of states."""
        return self.a.shape[0]

    def mode(self, band: str) -> Mode | None:
        """The mode of ``band``, or None."""
        return next((m for m in self.modes if m.band == band), None)


@dataclass(frozen=True)
class Receptance:
    r"""Averaged frequency response of one section, with what can be trusted of it.

    All arrays are (n_frequency,); ``frequency`` [Hz] is above 0. ``h1``, ``h2``, ``hv`` complex [m/N];
    ``coherence`` with its two-sided 95 % limits ``coherence_low``, ``coherence_high`` and the one-sided lower
    limit ``gate_level`` that the gate compares; ``passed`` bool; ``n`` number of averaged impacts;
    ``valid_to`` [Hz] is the hammer's band edge. Behind an exponential window of ``decay`` [1/s] the responses are those
    at :math:`i\omega + a`: every resonance looks damped by so much more.
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


@dataclass(frozen=True)
class Impact:
    """One blow of the hammer, cut out of a recording, with its quality.

    ``force`` [N] and ``acceleration`` [m/s²] are (n_sample,) from ``onset`` - pre-trigger on; the indices
    ``onset``, ``contact_end`` and ``decay_start`` count from the first of these samples. ``peak`` [N],
    ``contact`` [s], ``impulse`` [N s], ``noise_force`` [N] and ``noise_acceleration`` [m/s²] (pre-trigger rms),
    ``band_edge`` [Hz] where the force spectrum has fallen by 20 dB. ``rejections`` is empty for an accepted
    impact; ``notes`` are findings that do not reject (a double hit whose decay starts after the last contact).
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

    @property
    def accepted(self) -> bool:
        """Nothing speaks against the blow."""
        return not self.rejections

    @property
    def decay(self) -> np.ndarray:
        """(n,) acceleration from the start of the free decay on. [m/s²]"""
        return self.acceleration[self.decay_start :]
