"""Free decays of a test brought to one length."""

import numpy as np

from turnout.records import Rejection


def common_length(decays, rate: float, settings) -> tuple[np.ndarray, np.ndarray, list[tuple[int, Rejection]]]:
    """Decays that are long enough, cut to one length, with the ones that are not.

    Parameters
    ----------
    decays : sequence of (n,) arrays
    rate : float
        [Hz]
    settings : IdentifySettings
        ``duration`` is the length aimed at, ``shortest_decay`` the least.

    Returns
    -------
    kept : (n_kept, n) array of float
    index : (n_kept,) array of int
        Position of each among ``decays``.
    dropped : list of (index, Rejection)
    """
    aim, least = round(settings.duration * rate), round(settings.shortest_decay * rate)
    kept, dropped = [], []
    for i, decay in enumerate(decays):
        decay = np.asarray(decay, dtype=float)
        if decay.ndim != 1:
            raise ValueError(f"decay {i} has shape {decay.shape}, need (n,)")
        if len(decay) < least:
            dropped.append((i, Rejection("late", len(decay) / rate, settings.shortest_decay, "decay too short [s]")))
        elif not np.all(np.isfinite(decay[:aim])):
            bad = int(np.argmin(np.isfinite(decay)))
            dropped.append((i, Rejection("not_finite", bad, None, "first sample of the decay that is not finite")))
        elif np.ptp(decay[:aim]) == 0.0:
            dropped.append((i, Rejection("dead_channel", 0.0, 0.0, "the decay is constant")))
        else:
            kept.append((i, decay))
    if not kept:
        return np.empty((0, 0)), np.empty(0, dtype=int), dropped
    n = min(aim, *(len(d) for _, d in kept))
    return np.array([d[:n] for _, d in kept]), np.array([i for i, _ in kept]), dropped
