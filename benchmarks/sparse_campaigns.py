"""Detect changes from a few campaigns of several sections with many quantities.

A control chart needs a year of campaigns. With only a few, all sections and quantities are evaluated together. Every
section has one level per quantity and at most one step between two campaigns. All sections share one temperature slope
per quantity.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp, stdtr

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True)
class Block:
    """Quantities measured at the same temperatures: ``values`` (n_quantity, n_section, n_campaign) are logarithms.

    ``temperature`` is (n_section, n_campaign) [°C]. No value may be missing.
    """

    values: np.ndarray
    temperature: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """(n_section, n_campaign)."""
        return self.temperature.shape


@dataclass(frozen=True)
class SplitVerdict:
    """Change of one section: ``split`` is its first campaign after the step in the likeliest model, None for no step.

    ``probability`` is that of no change and of each split; ``p_value`` is that of any change, by permutation. Use a
    split together with these two.
    """

    split: int | None
    probability: np.ndarray
    p_value: float


def design(splits: Sequence[int], temperature: np.ndarray, common: str = "temperature") -> np.ndarray:
    """Design matrix: a level per section, a step per section that has a split, and the terms common to all sections.

    Parameters
    ----------
    splits : sequence of int
        One per section: 0 for no step, else the campaign from which on the level differs.
    temperature : (n_section, n_campaign) array of float
        Temperatures. [°C]
    common : str
        "temperature", a slope; "campaign", a shift of every campaign but the first; "" for nothing.

    Returns
    -------
    (n_section * n_campaign, n_column) array of float

    Examples
    --------
    >>> design([0, 1], np.zeros((2, 2)), common="")
    array([[1., 0., 0.],
           [1., 0., 0.],
           [0., 1., 0.],
           [0., 1., 1.]])
    """
    n_section, n_campaign = temperature.shape
    section = np.repeat(np.arange(n_section), n_campaign)
    campaign = np.tile(np.arange(n_campaign), n_section)
    columns = [section == s for s in range(n_section)]
    columns += [(section == s) & (campaign >= k) for s, k in enumerate(splits) if k]
    if common == "temperature":
        columns.append(temperature.ravel() - temperature.mean())
    elif common == "campaign":
        columns += [campaign == c for c in range(1, n_campaign)]
    return np.column_stack(columns).astype(float)


def _projector(matrix: np.ndarray) -> np.ndarray:
    """Projector on the residual space, I - H, of a regression, from an orthonormal basis of its columns."""
    basis = np.linalg.svd(matrix, full_matrices=False)
    columns = basis.U[:, basis.S > 1e-10 * basis.S[0]]
    return np.eye(len(matrix)) - columns @ columns.T


def deviance(blocks: Sequence[Block], splits: Sequence[int], common: str = "temperature") -> float:
    r"""Minus twice the logarithm of the marginal likelihood of all quantities together, up to a constant.

    .. math:: \ln B = \tfrac12 (n - p) \ln(1 + g) - \tfrac12 n \ln(1 + g (1 - R^2))

    for each quantity and each choice of the sections whose step it shows. n is the number of its cells less one level
    per section, p the number of further columns, R² the share that they explain, g = n (unit information). A change
    need not show in every quantity: all choices have equal weight. 2 ln(number of splits) is added for every section
    that changes, for it might have changed at any of them.

    Parameters
    ----------
    blocks : sequence of Block
        Quantities by their temperatures, with the same sections and campaigns.
    splits : sequence of int
        First campaign after the step of each section, 0 for none.
    common : str
        Terms common to all sections, see ``design``.

    Returns
    -------
    float
        Deviance; only differences have a meaning.

    References
    ----------
    Liang et al., Mixtures of g priors, J. American Statistical Association 103, 2008, eq. 6.
    """
    n_section, n_campaign = blocks[0].shape
    changed = [s for s, k in enumerate(splits) if k]
    total = 2.0 * len(changed) * np.log(n_campaign - 1.0)
    for block in blocks:
        cells = block.values.reshape(len(block.values), -1)
        log_factors = []
        for is_shown in product((False, True), repeat=len(changed)):
            splits_shown = [k if s in changed and is_shown[changed.index(s)] else 0 for s, k in enumerate(splits)]
            log_factors.append(_log_factor(cells, design(splits_shown, block.temperature, common), n_section))
        total -= 2.0 * float(np.sum(logsumexp(log_factors, axis=0) - len(changed) * np.log(2.0)))
    return total


def _log_factor(cells: np.ndarray, matrix: np.ndarray, n_section: int) -> np.ndarray:
    """Logarithm of the Bayes factor of a design against levels alone, one per quantity."""
    n, p = cells.shape[1] - n_section, np.linalg.matrix_rank(matrix) - n_section
    rss = np.sum((cells @ _projector(matrix)) ** 2, axis=1)
    base = np.sum((cells @ _projector(matrix[:, :n_section])) ** 2, axis=1)
    return 0.5 * (n - p) * np.log1p(n) - 0.5 * n * np.log1p(n * rss / base)


def find_splits(blocks: Sequence[Block]) -> tuple[int, ...]:
    """Splits of all sections with the smallest deviance, by coordinate descent over the sections.

    It starts from no change and from each change common to all: one section at a time would not find a change that
    most sections share.

    Parameters
    ----------
    blocks : sequence of Block
        Quantities by their temperatures, with the same sections and campaigns.

    Returns
    -------
    tuple of int
        First campaign after the step of each section, 0 for none.
    """
    n_section, n_campaign = blocks[0].shape
    best_splits, lowest = (0,) * n_section, np.inf
    for start in range(n_campaign):
        splits, score = [start] * n_section, deviance(blocks, [start] * n_section)
        is_improved = True
        while is_improved:
            is_improved = False
            for s in range(n_section):
                for k in range(n_campaign):
                    trial = [*splits[:s], k, *splits[s + 1 :]]
                    if k != splits[s] and (trial_score := deviance(blocks, trial)) < score - 1e-9:
                        splits, score, is_improved = trial, trial_score, True
        if score < lowest:
            best_splits, lowest = tuple(splits), score
    return best_splits


def independent_quantities(blocks: Sequence[Block], splits: Sequence[int]) -> float:
    r"""Effective number of independent quantities, :math:`(\sum \lambda)^2 / \sum \lambda^2` of their correlation.

    Errors of neighbouring frequency bands are correlated; to count each band fully would overstate the evidence.

    Parameters
    ----------
    blocks : sequence of Block
        Quantities by their temperatures, with the same sections and campaigns.
    splits : sequence of int
        First campaign after the step of each section, 0 for none.

    Returns
    -------
    float
        Number, between 1 and that of all quantities.
    """
    residuals = []
    for block in blocks:
        cells = block.values.reshape(len(block.values), -1)
        residuals.append(cells @ _projector(design(splits, block.temperature)))
    residual = np.vstack(residuals)
    residual = residual / np.sqrt(np.sum(residual**2, axis=1, keepdims=True))
    correlation = residual @ residual.T
    return float(np.trace(correlation) ** 2 / np.sum(correlation**2))


def verdicts(blocks: Sequence[Block], n_permutation: int = 2000, seed: int = 0) -> list[SplitVerdict]:
    """For every section: when it changed, with what probability, and the p value of a change.

    The probability follows from the deviances of the section's splits, with the other sections at their best splits and
    each block scaled to its number of independent quantities. The p value is that of Freedman and Lane (J. Business
    Econ. Stat. 1, 1983): residuals of the model without the section's step are permuted among cells, all quantities of
    a cell together, and the largest gain over all splits is compared.

    Parameters
    ----------
    blocks : sequence of Block
        Quantities by their temperatures, with the same sections and campaigns.
    n_permutation : int
        Number of permutations for the p value.
    seed : int
        Seed of the permutations.

    Returns
    -------
    list of SplitVerdict
        One for each section.
    """
    best_splits = find_splits(blocks)
    shares = [independent_quantities([b], best_splits) / len(b.values) for b in blocks]
    n_section, n_campaign = blocks[0].shape
    rng = np.random.default_rng(seed)
    results = []
    for s in range(n_section):
        options = [(*best_splits[:s], k, *best_splits[s + 1 :]) for k in range(n_campaign)]
        score = np.array([sum(w * deviance([b], o) for w, b in zip(shares, blocks)) for o in options])
        weight = np.exp(-0.5 * (score - score.min()))
        p_value = _permutation_p_value(blocks, options, n_permutation, rng)
        results.append(SplitVerdict(best_splits[s] or None, weight / weight.sum(), p_value))
    return results


def _permutation_p_value(
    blocks: Sequence[Block], options: Sequence[Sequence[int]], n_permutation: int, rng: np.random.Generator
) -> float:
    prepared = []
    for block in blocks:
        cells = block.values.reshape(len(block.values), -1)
        null_projector = _projector(design(options[0], block.temperature))
        projectors = [_projector(design(o, block.temperature)) for o in options[1:]]
        prepared.append((cells @ null_projector, cells - cells @ null_projector, null_projector, projectors))

    def gain(order: np.ndarray) -> float:
        gains = np.zeros(len(options) - 1)
        for residual, fitted, null_projector, projectors in prepared:
            cells = fitted + residual[:, order]
            base = np.log(np.sum((cells @ null_projector) ** 2, axis=1))
            gains += [np.sum(base - np.log(np.sum((cells @ projector) ** 2, axis=1))) for projector in projectors]
        return gains.max()

    n_cell = blocks[0].temperature.size
    observed_gain = gain(np.arange(n_cell))
    larger = sum(gain(rng.permutation(n_cell)) >= observed_gain - 1e-12 for _ in range(n_permutation))
    return (1 + larger) / (1 + n_permutation)


def steps(block: Block, splits: Sequence[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Step of every changed section in every quantity, with standard error and p value, and the temperature slopes.

    Parameters
    ----------
    block : Block
        Quantities at the same temperatures.
    splits : sequence of int
        First campaign after the step of each section, 0 for none.

    Returns
    -------
    step, error, p_value : (n_quantity, n_section) arrays of float
        Logarithm of the factor; nan for a section without a step.
    slope, slope_error : (n_quantity,) arrays of float
        [1/°C]
    """
    cells = block.values.reshape(len(block.values), -1)
    matrix = design(splits, block.temperature)
    inverse = np.linalg.pinv(matrix.T @ matrix)
    coefficient = cells @ matrix @ inverse
    freedom = len(matrix) - np.linalg.matrix_rank(matrix)
    scale = np.sum((cells - coefficient @ matrix.T) ** 2, axis=1) / freedom
    error = np.sqrt(scale[:, None] * np.diag(inverse)[None])
    n_section = block.shape[0]
    table = np.full((3, len(cells), n_section), np.nan)
    for column, s in enumerate([s for s, k in enumerate(splits) if k], start=n_section):
        table[0, :, s], table[1, :, s] = coefficient[:, column], error[:, column]
    with np.errstate(invalid="ignore"):
        table[2] = 2.0 * stdtr(freedom, -np.abs(table[0] / table[1]))
    return table[0], table[1], table[2], coefficient[:, -1], error[:, -1]


def left_out_error(block: Block, splits: Sequence[int], common: str = "temperature") -> np.ndarray:
    """Root mean square prediction error of each quantity, leaving out one campaign after the other.

    A section with a level that only the left-out campaign determines cannot be predicted and is not counted.

    Parameters
    ----------
    block : Block
        Quantities at the same temperatures.
    splits : sequence of int
        First campaign after the step of each section, 0 for none.
    common : str
        Terms common to all sections, see ``design``.

    Returns
    -------
    (n_quantity,) array of float
        Error of the logarithms.
    """
    matrix = design(splits, block.temperature, common)
    cells = block.values.reshape(len(block.values), -1)
    campaign = np.tile(np.arange(block.shape[1]), block.shape[0])
    squares, count = np.zeros(len(cells)), 0
    for c in range(block.shape[1]):
        training, left_out = matrix[campaign != c], matrix[campaign == c]
        coefficient = cells[:, campaign != c] @ np.linalg.pinv(training).T
        null = np.eye(matrix.shape[1]) - np.linalg.pinv(training) @ training
        is_predictable = np.linalg.norm(left_out @ null, axis=1) < 1e-8
        squares += np.sum((cells[:, campaign == c] - coefficient @ left_out.T)[:, is_predictable] ** 2, axis=1)
        count += int(is_predictable.sum())
    return np.sqrt(squares / count)
