"""Combine decays of similar poles: the search for modes then costs a fraction, with nearly all of the information."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.modal.mixed_effects import MIN_DAMPING

if TYPE_CHECKING:
    from collections.abc import Callable

    from turnout.modal.mixed_effects import MixedFit

MIN_DECAYS = 12  # fewer are not combined: no fit would take half the time
MIN_GROUPS = 6  # groups from which the spread between impacts can be judged
# Energy, in variances of the noise, that the scatter of the poles within a group may add to its combined decay.
# A criterion of the choice changes by it, and no choice depends on two (``SEARCH_RSS_STEP`` is 1).
MAX_SMEAR = 1.0


def group_similar(fit: MixedFit) -> np.ndarray:
    r"""Number of the group of each decay; the poles within a group scatter too little to matter.

    The mean of waves whose parameter :math:`\theta_j` scatters with variance v differs from one wave by
    :math:`\tfrac{v}{2}\,\partial^2 y/\partial\theta_j^2`. For ln f of a wave that decays within the record

    .. math:: \left\|\frac{\partial^2 y}{\partial\theta^2}\right\|^2
              = \frac{3}{\zeta^2} \left\|\frac{\partial y}{\partial\theta}\right\|^2,

    and the same for zeta. Groups are halved at the median of the parameter with the largest such energy, the group with
    the largest one first, until it is below ``MAX_SMEAR``.

    Parameters
    ----------
    fit : MixedFit
        Fit of the decays.

    Returns
    -------
    (n_decay,) array of int
        Groups from 0; each decay in its own where too few decays would be combined.
    """
    n_decay = len(fit.theta)
    alone = np.arange(n_decay)
    if n_decay < MIN_DECAYS:
        return alone
    theta = fit.theta.reshape(n_decay, -1)
    damping = np.repeat(np.maximum(fit.mean[:, 1], MIN_DAMPING), 2)
    curvature = 3.0 / damping**2 * np.einsum("ijj->ij", fit.linearisation.information) / fit.sigma2

    def smear(members: np.ndarray) -> np.ndarray:
        return 0.25 * theta[members].var(axis=0) ** 2 * curvature[members].sum(axis=0)

    groups = _halve(alone, theta, smear)
    if 2 * len(groups) > n_decay:
        return alone
    label = np.empty(n_decay, dtype=int)
    for number, members in enumerate(groups):
        label[members] = number
    return label


def _halve(members: np.ndarray, theta: np.ndarray, smear: Callable[[np.ndarray], np.ndarray]) -> list[np.ndarray]:
    """Groups with a smear below its limit, at least ``MIN_GROUPS``."""
    groups, energies = [members], [smear(members)]
    while True:
        largest = np.array([energy.max() for energy in energies])
        if len(groups) >= MIN_GROUPS and largest.max() <= MAX_SMEAR:
            return groups
        sizes = np.array([len(g) for g in groups])
        # A group of one has no smear. While there are too few groups the one of most decays is halved.
        worst = int(np.argmax(largest if largest.max() > MAX_SMEAR else sizes))
        ordered = groups[worst][np.argsort(theta[groups[worst], np.argmax(energies[worst])], kind="stable")]
        parts = np.array_split(ordered, 2)
        groups[worst : worst + 1] = parts
        energies[worst : worst + 1] = [smear(part) for part in parts]


def combine(decays: np.ndarray, group: np.ndarray) -> np.ndarray:
    """The principal decay of each group: of all combinations with weights of norm 1 that of the largest energy.

    It contains the poles of the group, and noise of the variance of a single decay.

    Parameters
    ----------
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    group : (n_decay,) array of int
        Group of each decay, from 0.

    Returns
    -------
    (n_group, n) array of float
        One decay per group. [m/s²]

    Examples
    --------
    >>> combine(np.array([[3.0, 0.0], [4.0, 0.0], [0.0, -2.0]]), np.array([0, 0, 1]))
    array([[ 5.,  0.],
           [ 0., -2.]])
    """
    combined = np.empty((group.max() + 1, decays.shape[1]))
    for number in range(len(combined)):
        members = decays[group == number]
        weight = np.linalg.eigh(members @ members.T)[1][:, -1]
        combined[number] = np.copysign(1.0, weight.sum()) * weight @ members
    return combined
