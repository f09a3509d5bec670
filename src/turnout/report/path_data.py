"""Path data of curves in SVG: the visible points of a curve, with two decimals."""

from __future__ import annotations

import numpy as np


def runs(good: np.ndarray | bool) -> list[slice]:
    """Slices of the contiguous runs of True.

    Parameters
    ----------
    good : (n,) array of bool
        Values.

    Returns
    -------
    list of slice
        One for each run.

    Examples
    --------
    >>> runs(np.array([True, True, False, True]))
    [slice(0, 2, None), slice(3, 4, None)]
    """
    good = np.atleast_1d(good)
    if good.all():  # the usual case
        return [slice(0, len(good))] if len(good) else []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(np.int8)))
    return [slice(first, last) for first, last in zip(edges[::2].tolist(), edges[1::2].tolist())]


def reduce_points(px: np.ndarray, py: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fewer points that draw the same curve: the first, last, lowest and highest of every pixel column.

    Parameters
    ----------
    px, py : (n,) array of float
        Pixels, finite, from left to right; a curve that turns back is not reduced.

    Returns
    -------
    pair of (m,) array of float
        m <= n, in the order given: at most four points for each pixel of width.

    Examples
    --------
    Two hundred points of a comb within two pixels; four draw it, as first and last of a pixel are its extremes:

    >>> px, py = reduce_points(np.linspace(0.0, 1.99, 200), np.arange(200) % 2.0)
    >>> len(px), sorted(set(py.tolist()))
    (4, [0.0, 1.0])
    """
    column = np.floor(px).astype(int)
    step = np.diff(column)
    starts = np.flatnonzero(np.concatenate([[True], step != 0]))
    if 4 * len(starts) >= len(px) or np.any(step < 0):
        return px, py
    ends = np.append(starts[1:], len(px)) - 1
    order = np.lexsort((py, column))
    indices = np.unique(np.concatenate([starts, ends, order[starts], order[ends]]))
    return px[indices], py[indices]


MIN_TOGETHER = 50  # points from which it is faster to write all numbers of a path together than one by one
MAX_PIXEL = 1000  # px, numbers written together are below it
TIE = 1e-6  # distance from the middle of two hundredths, within which the error of a product could turn the rounding
# Text of a number with two decimals: whole part and point, filled with null bytes in front; decimals; what follows.
NUMBER = np.dtype([("whole", "S4"), ("decimals", "S2"), ("end", "S1")])
WHOLE = np.array([f"{k}.".rjust(4, "\0") for k in range(MAX_PIXEL)], dtype="S4")
DECIMALS = np.array([f"{k:02d}" for k in range(100)], dtype="S2")
ENDS = np.array([b" ", b"L"], dtype="S1")


def path_points(px: np.ndarray, py: np.ndarray) -> str:
    """Path data of points: ``x y`` of each, with the letter L of a straight line between them.

    Parameters
    ----------
    px, py : (n,) array of float
        Pixels, finite.

    Returns
    -------
    str
        Two decimals each, without the first letter M.

    Examples
    --------
    >>> path_points(np.array([1.0, 2.5]), np.array([3.0, 4.125]))
    '1.00 3.00L2.50 4.12'
    """
    numbers = np.empty((len(px), 2))
    numbers[:, 0], numbers[:, 1] = px, py
    text = _format_together(numbers) if len(px) >= MIN_TOGETHER else None
    return (text or "%.2f %.2fL" * len(px) % tuple(numbers.ravel().tolist()))[:-1]


def _format_together(numbers: np.ndarray) -> str | None:
    """``x yL`` of each row with two decimals; None where a number is no pixel, or so near to a tie that it may differ
    from the correctly rounded one."""
    hundredths = 100.0 * numbers
    nearest = np.rint(hundredths)
    inside = numbers.min() > 0.0 and nearest.max() < 100 * MAX_PIXEL
    if not (inside and np.abs(hundredths - nearest).max() < 0.5 - TIE):
        return None
    whole, decimals = np.divmod(nearest.astype(np.int32), 100)
    texts = np.empty(numbers.shape, NUMBER)
    texts["whole"], texts["decimals"], texts["end"] = WHOLE[whole], DECIMALS[decimals], ENDS
    return texts.tobytes().translate(None, b"\0").decode("ascii")
