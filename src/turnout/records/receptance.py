"""Averaged frequency response of a section."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
