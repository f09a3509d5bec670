"""Median of the other sections of a turnout, campaign by campaign."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator


def blocks(group: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the chart numbers of all groups of equal size, one array for each size.

    Equal sizes are stacked so that numpy computes many turnouts at once.

    Parameters
    ----------
    group : (n_chart,) array of int
        Number of the group of each chart, sorted.

    Yields
    ------
    (n_group, size) array of int
        Charts of the groups of one size.
    """
    start = np.flatnonzero(np.diff(group, prepend=-1))
    size = np.diff(np.append(start, len(group)))
    for n in np.unique(size):
        yield start[size == n][:, None] + np.arange(n)


def median_of_siblings(values: np.ndarray, mask: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Median over the siblings of each chart, that is the other charts of its group, and their number.

    Parameters
    ----------
    values : (n_chart, n_campaign) array of float
        Values; those outside the mask may be nan.
    mask : (n_chart, n_campaign) array of bool
        Values that may serve as sibling of others.
    group : (n_chart,) array of int
        Sorted number of the group.

    Returns
    -------
    median : (n_chart, n_campaign) array of float
        nan without a sibling.
    n_siblings : (n_chart, n_campaign) array of int

    Examples
    --------
    >>> median_of_siblings(np.array([[1.0], [2.0], [4.0], [9.0]]), np.ones((4, 1), bool), np.zeros(4, int))[0].ravel()
    array([4., 4., 2., 2.])
    """
    median = np.full(values.shape, np.nan)
    n_siblings = np.zeros(values.shape, dtype=np.int16)
    for block in blocks(group):
        if block.shape[1] == 1:
            continue
        inside = mask[block]
        ordered = np.where(inside, values[block], np.inf)
        order = np.argsort(ordered, axis=1, kind="stable")
        ordered = np.take_along_axis(ordered, order, axis=1)
        rank = np.empty_like(order)
        np.put_along_axis(rank, order, np.arange(block.shape[1])[None, :, None], axis=1)
        n_block = inside.sum(axis=1, keepdims=True) - inside
        lower, upper = (n_block - 1) // 2, n_block // 2
        own_rank = np.where(inside, rank, block.shape[1])
        low = np.take_along_axis(ordered, np.clip(lower + (lower >= own_rank), 0, block.shape[1] - 1), axis=1)
        high = np.take_along_axis(ordered, np.clip(upper + (upper >= own_rank), 0, block.shape[1] - 1), axis=1)
        with np.errstate(invalid="ignore"):
            median[block] = np.where(n_block > 0, 0.5 * (low + high), np.nan)
        n_siblings[block] = n_block
    return median, n_siblings


def median_of_group(values: np.ndarray, mask: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Median of each group, and the number of charts it is computed from.

    Parameters
    ----------
    values : (n_chart, n_campaign) array of float
        Values; those outside the mask may be nan.
    mask : (n_chart, n_campaign) array of bool
        Values that count.
    group : (n_chart,) array of int
        Number of the group of each chart, sorted.

    Returns
    -------
    two (n_group, n_campaign) arrays
        Median, nan without a chart, and number of charts.
    """
    n_group = int(group[-1]) + 1 if len(group) else 0
    median = np.full((n_group, values.shape[1]), np.nan)
    count = np.zeros((n_group, values.shape[1]), dtype=np.int16)
    for block in blocks(group):
        inside = mask[block]
        ordered = np.sort(np.where(inside, values[block], np.inf), axis=1)
        n = inside.sum(axis=1, keepdims=True)
        low = np.take_along_axis(ordered, np.maximum((n - 1) // 2, 0), axis=1)
        high = np.take_along_axis(ordered, np.minimum(n // 2, block.shape[1] - 1), axis=1)
        with np.errstate(invalid="ignore"):
            middle = np.where(n > 0, 0.5 * (low + high), np.nan)
        median[group[block[:, 0]]], count[group[block[:, 0]]] = middle[:, 0], n[:, 0]
    return median, count
