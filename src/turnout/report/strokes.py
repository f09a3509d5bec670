"""Which points of a long curve a drawing needs: what the eye cannot part is not written out."""

import numpy as np


def runs(good):
    """Slices of the unbroken stretches of True.

    >>> runs(np.array([True, True, False, True]))
    [slice(0, 2, None), slice(3, 4, None)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], np.atleast_1d(good), [False]]).astype(np.int8)))
    return [slice(first, last) for first, last in zip(edges[::2].tolist(), edges[1::2].tolist())]


def drawn(px, py):
    """The points that draw the same curve: in every pixel's width the first, the last, the lowest and the highest.

    Parameters
    ----------
    px, py : (n,) array of float
        Pixels, finite, from left to right; a curve that turns back is drawn whole.

    Returns
    -------
    pair of (m,) array of float
        m <= n, in the order given: at most four points for each pixel of width.

    Examples
    --------
    Two hundred points of a comb within two pixels; six draw it, first and last of a pixel being its extremes:

    >>> px, py = drawn(np.linspace(0.0, 1.99, 200), np.arange(200) % 2.0)
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
    kept = np.unique(np.concatenate([starts, ends, order[starts], order[ends]]))
    return px[kept], py[kept]
