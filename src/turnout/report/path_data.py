"""Path data of curves in SVG: the visible points of a curve, in hundredths of a pixel."""

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
    if 4 * (1 + np.count_nonzero(step)) >= len(px) or np.any(step < 0):
        return px, py
    starts = np.append(0, np.flatnonzero(step) + 1)
    ends = np.append(starts[1:], len(px)) - 1
    order = np.lexsort((py, column))
    indices = np.unique(np.concatenate([starts, ends, order[starts], order[ends]]))
    return px[indices], py[indices]


HUNDREDTHS = 100  # per pixel
MIN_TOGETHER = 50  # points from which it is faster to write all numbers of a path together than one by one
MAX_STEP = 1000  # px, steps written together are below it
# Text of a step: separator or sign, whole part without a leading zero, decimals without zeros at their end.
STEP = np.dtype([("sign", "S1"), ("whole", "S3"), ("decimals", "S3")])
SIGNS = np.array([b" ", b"-"], dtype="S1")
DECIMAL_TEXTS = [f".{k:02d}".rstrip("0") if k else "" for k in range(HUNDREDTHS)]
WHOLE = np.array([str(k) if k else "" for k in range(MAX_STEP)], dtype="S3")
DECIMALS = np.array(DECIMAL_TEXTS, dtype="S3")


def format_pixels(hundredths: int) -> str:
    """Shortest text of a number of hundredths of a pixel.

    Parameters
    ----------
    hundredths : int
        The number.

    Returns
    -------
    str
        In pixels.

    Examples
    --------
    >>> [format_pixels(k) for k in (6200, -450, 7, 0)]
    ['62', '-4.5', '.07', '0']
    """
    whole, rest = divmod(abs(hundredths), HUNDREDTHS)
    text = (str(whole) if whole else "") + DECIMAL_TEXTS[rest]
    return ("-" if hundredths < 0 else "") + (text or "0")


def path_points(px: np.ndarray, py: np.ndarray) -> str:
    """Path data of points: the first one, and the steps from each to the next.

    Points are rounded to hundredths of a pixel before steps are taken, so no error accumulates.

    Parameters
    ----------
    px, py : (n,) array of float
        Pixels, finite.

    Returns
    -------
    str
        Without the first letter M.

    Examples
    --------
    >>> path_points(np.array([1.0, 2.5, 2.0]), np.array([3.0, 3.125, 3.0]))
    '1 3l1.5 .12-.5-.12'
    """
    hundredths = np.rint(HUNDREDTHS * np.column_stack([px, py])).astype(np.int64)
    first = " ".join(map(format_pixels, hundredths[0].tolist()))
    if len(px) == 1:
        return first
    steps = np.diff(hundredths, axis=0).ravel()
    together = len(px) >= MIN_TOGETHER and int(np.abs(steps).max()) < HUNDREDTHS * MAX_STEP
    text = _format_together(steps) if together else _format_singly(steps)
    return first + "l" + text.removeprefix(" ")


def _format_singly(steps: np.ndarray) -> str:
    return "".join(text if text[0] == "-" else " " + text for text in map(format_pixels, steps.tolist()))


def _format_together(steps: np.ndarray) -> str:
    """Texts of steps below ``MAX_STEP``, from tables of their parts."""
    size = np.abs(steps)
    texts = np.empty(len(steps), STEP)
    texts["sign"] = SIGNS[(steps < 0).astype(np.int8)]
    texts["whole"], texts["decimals"] = WHOLE[size // HUNDREDTHS], DECIMALS[size % HUNDREDTHS]
    texts["whole"][size == 0] = b"0"
    return texts.tobytes().translate(None, b"\0").decode("ascii")


def path_bars(px: np.ndarray, py: np.ndarray, end: np.ndarray) -> str:
    """Path data of vertical bars.

    Parameters
    ----------
    px, py : (n,) array of float
        Starts of the bars, in pixels.
    end : (n,) array of float
        Vertical pixels of their ends.

    Returns
    -------
    str
        One move and one vertical line for each.

    Examples
    --------
    >>> path_bars(np.array([73.325]), np.array([201.0]), np.array([51.0]))
    'M73.32 201V51'
    """
    numbers = np.rint(HUNDREDTHS * np.column_stack([px, py, end])).astype(np.int64).tolist()
    return "".join("M{} {}V{}".format(*map(format_pixels, bar)) for bar in numbers)
