"""One blow of the hammer with its quality."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnout.records.rejection import Rejection


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
