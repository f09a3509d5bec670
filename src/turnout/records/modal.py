"""Resonances and the state-space model they stand in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from turnout.records.rejection import Rejection


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
