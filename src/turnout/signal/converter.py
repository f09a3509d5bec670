"""What the converter of a channel leaves in its samples."""

from __future__ import annotations

import numpy as np


def converter_step(samples: np.ndarray) -> float:
    """Smallest change from one sample to the next: a converter's step, or nearly 0; 0 where nothing changes.

    Parameters
    ----------
    samples : (n_sample,) array of float
        Acceleration. [m/s²]

    Returns
    -------
    float
        [m/s²]
    """
    change = np.abs(np.diff(samples))
    return float(np.min(change, where=change > 0, initial=np.inf)) if change.any() else 0.0
