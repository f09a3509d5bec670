"""Poles of the realisation whose maximum likelihood fit to what all decays share is likeliest for its size."""

import numpy as np

from turnout.identify.linearise import linearise
from turnout.identify.mixed import fit_common
from turnout.identify.significance import mode_chi_squared
from turnout.identify.stabilise import Candidate, Stabilisation

LOWEST_ORDER = 8
DAMPING = (2e-3, 0.9)


def likely_poles(table: Stabilisation, decays, rate: float, columns, settings, most=1) -> list[list[Candidate]]:
    """Lists of candidates that need not reappear: poles of one order together, the likeliest first, ``most`` lists.

    The leading right singular vector of the decays is their weighted mean: as long as one decay, with the noise
    of one, and the signal of all. From the poles of each order it is fitted by maximum likelihood, and modes are
    dropped, the weakest first, as long as the criterion falls.

    Parameters
    ----------
    table : Stabilisation
    decays : (n_decay, n) array of float
    rate : float
        [Hz]
    columns : (n_column, n) array of float
        Background.
    settings : IdentifySettings
    """
    _, size, shape = np.linalg.svd(decays, full_matrices=False)
    shared = size[:1, None] * shape[:1]
    usable = (table.start == 0) & (table.damping > DAMPING[0]) & (table.damping < DAMPING[1])
    usable &= (table.frequency > 0.5 / settings.duration) & (table.frequency < 0.45 * rate)
    found = []
    for order in np.unique(table.order[table.order >= LOWEST_ORDER]):
        here = usable & (table.order == order)
        start = np.stack([np.log(table.frequency[here]), table.damping[here]], axis=1)
        found.append(_thinned(start, shared, rate, columns))
    found.sort(key=lambda item: item[0])
    # two orders that end in the same optimum agree to more digits than two optima ever do
    lists = {round(value, 2): poles for value, poles in found if len(poles)}
    return [_as_candidates(poles, shared, rate, columns, len(table.order)) for poles in list(lists.values())[:most]]


def _as_candidates(poles, shared, rate, columns, n_pole):
    at = linearise(poles[None], shared, rate, columns)
    share = np.abs(at.amplitude[0]) ** 2 / (poles[:, 1] * np.exp(poles[:, 0]))
    return [
        Candidate(float(np.exp(f)), float(damping), float(e), float("nan"), 1.0, np.zeros(n_pole, dtype=bool))
        for (f, damping), e in zip(poles, share / share.sum(), strict=True)
    ]


def _thinned(theta, shared, rate, columns):
    """(criterion, modes) where dropping the least significant mode no longer helps."""
    n = shared.size
    best, poles = np.inf, theta[:0]
    while len(theta):
        theta, _ = fit_common(theta, shared, rate, columns)
        at = linearise(theta[None], shared, rate, columns)
        rss = float(at.rss.sum())
        value = n * np.log(rss / n) + 4 * len(theta) * np.log(n)
        if value > best:
            break
        best, poles = value, theta
        weakest = int(np.argmin(mode_chi_squared(at, rss / n)[0]))
        theta = np.delete(theta, weakest, axis=0)
    return best, poles
