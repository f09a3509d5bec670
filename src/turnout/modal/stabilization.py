"""Compute the poles of a test over model orders and start samples, and find those that recur.

A second list of candidates comes from the order whose maximum likelihood fit to the mean decay is the likeliest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.modal.era import subspaces
from turnout.modal.least_squares import linearise
from turnout.modal.mixed_effects import fit_common
from turnout.modal.mode_candidates import Candidate
from turnout.modal.mode_tests import mode_chi_squared
from turnout.modal.poles import continuous_pole, modal_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.identify import IdentifySettings

MAX_POLE_RADIUS = 1.002  # factor per sample by which an oscillation may grow: a hum may seem to grow this much


@dataclass(frozen=True)
class Stabilisation:
    """One row per pole: (n_pole,) ``start`` [samples], ``order``, ``frequency`` [Hz], ``damping`` and two indicators.

    ``energy`` is the share of the mode in the energy of all decays from the start sample on. ``emac`` is its extended
    modal amplitude coherence, 0 to 1: how well the mode after one decay time agrees with its pole.
    """

    start: np.ndarray
    order: np.ndarray
    frequency: np.ndarray
    damping: np.ndarray
    energy: np.ndarray
    emac: np.ndarray
    n_cell: int


def stabilisation(
    decays: np.ndarray, rate: float, rows: int, order_maximum: int, starts: Sequence[int] = (0,)
) -> Stabilisation:
    """Oscillating poles of all decays together, for every even order up to ``order_maximum`` and every start.

    All orders come from one decomposition for each start; see :func:`turnout.modal.era.subspaces`.

    Parameters
    ----------
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    rate : float
        [Hz]
    rows, order_maximum : int
    starts : sequence of int
        Numbers of leading samples that are skipped.

    Returns
    -------
    Stabilisation
        One row per pole.
    """
    total = float(np.sum(decays**2))
    columns = []
    for start, space in zip(starts, subspaces(decays, rows, order_maximum, starts), strict=True):
        state = space.u.T @ decays[:, start + space.index].T
        for order in range(2, order_maximum + 1, 2):
            z, v = np.linalg.eig(space.state_matrix(order))
            amplitude = 2.0 * (space.u[0, :order] @ v)[:, None] * np.linalg.solve(v, state[:order])
            oscillating = (z.imag > 1e-9) & (np.abs(z) < MAX_POLE_RADIUS)
            energy = _energy(amplitude[oscillating], z[oscillating], decays.shape[1] - start) / total
            frequency, damping = modal_parameters(z[oscillating], rate)
            emac = amplitude_coherence(space.u[:, :order] @ v[:, oscillating], z[oscillating], space.index)
            cell = (np.full(len(energy), start), np.full(len(energy), order))
            columns.append((*cell, frequency, damping, energy, emac))
    cells = len(starts) * (order_maximum // 2)
    starts_of, orders_of, frequency, damping, energy, emac = (np.concatenate(c) for c in zip(*columns, strict=True))
    return Stabilisation(starts_of, orders_of, frequency, damping, energy, emac, cells)


def amplitude_coherence(shape: np.ndarray, z: np.ndarray, index: np.ndarray) -> np.ndarray:
    r"""Extended modal amplitude coherence of each mode after one decay time, 0 to 1.

    .. math:: \mathrm{EMAC} = \min(|r|, |r|^{-1}) \, \max\left(0, 1 - \frac{|\arg r|}{\pi/4}\right), \quad
              r = \frac{\phi_k}{\phi_0 z^k}

    Parameters
    ----------
    shape : (n_row, n_mode) array of complex
        Observability of each mode along the rows of the Hankel matrix.
    z : (n_mode,) array of complex
        Poles of the sampled system.
    index : (n_row,) array of int
        Samples at which the rows begin.

    Returns
    -------
    (n_mode,) array of float
        Coherence of each mode.

    References
    ----------
    Pappa, Elliott and Schenk 1993, Consistent-mode indicator for the eigensystem realization algorithm.

    Examples
    --------
    A mode that turns 0.1 rad too far in one decay time (of ten samples) loses 0.1 / (pi / 4).

    >>> z = np.array([np.exp(-0.1 + 0.5j)])
    >>> shape = (z * np.exp(0.01j)) ** np.arange(30)[:, None]
    >>> print(f"{amplitude_coherence(shape, z, np.arange(30))[0]:.3f}")
    0.873
    """
    decay = np.maximum(-np.log(np.abs(z)), 1e-9)
    row = np.minimum(np.searchsorted(index, 1.0 / decay), len(index) - 1)
    mode = np.arange(len(z))
    ratio = shape[row, mode] / (shape[0, mode] * z ** index[row])
    size = np.abs(ratio)
    turned = np.clip(1.0 - np.abs(np.angle(ratio)) / (np.pi / 4.0), 0.0, None)
    return np.minimum(size, 1.0 / np.maximum(size, 1e-300)) * turned


def _energy(amplitude: np.ndarray, z: np.ndarray, n: int) -> np.ndarray:
    """Energy of each pole over ``n`` samples, all decays together."""
    square = np.minimum(np.abs(z) ** 2, 1.0 - 1e-12)
    return (np.abs(amplitude) ** 2).sum(axis=1) * (1.0 - square**n) / (2.0 * (1.0 - square))


def candidates(table: Stabilisation, tolerance: float, damping_maximum: float) -> list[Candidate]:
    """Groups of poles that recur over orders and starts, most energetic first.

    Two poles are one mode if they are closer than ``tolerance`` times their magnitude. ``presence`` is the share of the
    pairs of order and start that have the pole, from the lowest order on at which the group occurs.

    Parameters
    ----------
    table : Stabilisation
        Poles over orders and starts.
    tolerance : float
        Distance of two poles relative to their magnitude, below which they are one mode.
    damping_maximum : float
        Damping ratio from which a pole is ignored.

    Returns
    -------
    list of Candidate
        Groups, also those that occur only once.
    """
    plausible = (table.damping > 0.0) & (table.damping < damping_maximum)
    pole = np.full(len(table.frequency), np.nan, dtype=complex)
    pole[plausible] = continuous_pole(table.frequency[plausible], table.damping[plausible])
    ungrouped = plausible.copy()
    highest, lowest = (table.order.max(), table.order.min()) if len(table.order) else (0, 0)
    n_start = len(np.unique(table.start))
    groups = []
    while ungrouped.any():
        members = _largest_group(pole, ungrouped, tolerance, table)
        ungrouped &= ~members
        orders = table.order[members]
        possible = n_start * ((highest - max(orders.min(), lowest)) // 2 + 1)
        n_cell = len(np.unique(table.start[members] * 1000 + orders))
        presence = n_cell / max(possible, n_start * 3)
        groups.append(
            Candidate(
                float(np.median(table.frequency[members])),
                float(np.median(table.damping[members])),
                float(np.median(table.energy[members])),
                float(np.median(table.emac[members])),
                float(min(1.0, presence)),
                members,
            )
        )
    return sorted(groups, key=lambda c: -c.energy)


def _largest_group(pole: np.ndarray, ungrouped: np.ndarray, tolerance: float, table: Stabilisation) -> np.ndarray:
    """Ungrouped poles near the one with the most neighbours; in a tie that of the most energetic."""
    index = np.flatnonzero(ungrouped)
    distance = np.abs(pole[index, None] - pole[None, index])
    near = distance < tolerance * np.minimum(np.abs(pole[index, None]), np.abs(pole[None, index]))
    count = near.sum(axis=1)
    largest = np.lexsort((-table.energy[index], -count))[0]
    mask = np.zeros(len(pole), dtype=bool)
    mask[index[near[largest]]] = True
    return mask


MIN_ORDER = 8  # lowest model order whose poles are fitted
DAMPING_RANGE = (2e-3, 0.9)  # damping ratios of usable poles


def likely_poles(
    table: Stabilisation,
    decays: np.ndarray,
    rate: float,
    columns: np.ndarray,
    settings: IdentifySettings,
    max_lists: int = 1,
) -> list[list[Candidate]]:
    """Up to ``max_lists`` lists of candidates: each has the poles of one order.

    These poles need not recur. The leading right singular vector of the decays is their weighted mean: as long as one
    decay, with the noise of one and the signal of all. It is fitted by maximum likelihood from the poles of each order.
    Modes are removed, the weakest first, as long as the criterion falls.

    Parameters
    ----------
    table : Stabilisation
        Poles over orders and starts.
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    rate : float
        [Hz]
    columns : (n_column, n) array of float
        Columns of the background.
    settings : IdentifySettings
        Settings of the identification.
    max_lists : int
        Largest number of lists.

    Returns
    -------
    list of lists of Candidate
        The likeliest list first.
    """
    _, size, shape = np.linalg.svd(decays, full_matrices=False)
    shared = size[:1, None] * shape[:1]
    usable = (table.start == 0) & (table.damping > DAMPING_RANGE[0]) & (table.damping < DAMPING_RANGE[1])
    usable &= (table.frequency > 0.5 / settings.duration) & (table.frequency < 0.45 * rate)
    fits = []
    for order in np.unique(table.order[table.order >= MIN_ORDER]):
        selected = usable & (table.order == order)
        start = np.stack([np.log(table.frequency[selected]), table.damping[selected]], axis=1)
        fits.append(_prune_poles(start, shared, rate, columns))
    fits.sort(key=lambda item: item[0])
    # orders with the same optimum agree to more digits than two different optima
    lists = {round(value, 2): poles for value, poles in fits if len(poles)}
    return [
        _as_candidates(poles, shared, rate, columns, len(table.order)) for poles in list(lists.values())[:max_lists]
    ]


def _as_candidates(
    poles: np.ndarray, shared: np.ndarray, rate: float, columns: np.ndarray, n_pole: int
) -> list[Candidate]:
    linearisation = linearise(poles[None], shared, rate, columns)
    share = np.abs(linearisation.amplitude[0]) ** 2 / (poles[:, 1] * np.exp(poles[:, 0]))
    return [
        Candidate(float(np.exp(f)), float(damping), float(e), float("nan"), 1.0, np.zeros(n_pole, dtype=bool))
        for (f, damping), e in zip(poles, share / share.sum(), strict=True)
    ]


def _prune_poles(theta: np.ndarray, shared: np.ndarray, rate: float, columns: np.ndarray) -> tuple[float, np.ndarray]:
    """(criterion, modes) at which removing the least significant mode no longer reduces the criterion."""
    n = shared.size
    lowest_criterion, poles = np.inf, theta[:0]
    while len(theta):
        theta, _ = fit_common(theta, shared, rate, columns)
        linearisation = linearise(theta[None], shared, rate, columns)
        rss = float(linearisation.rss.sum())
        criterion = n * np.log(rss / n) + 4 * len(theta) * np.log(n)
        if criterion > lowest_criterion:
            break
        lowest_criterion, poles = criterion, theta
        weakest = int(np.argmin(mode_chi_squared(linearisation, rss / n)[0]))
        theta = np.delete(theta, weakest, axis=0)
    return lowest_criterion, poles
