"""Numbers of the records of a file, and those that are missing between two others."""

from collections.abc import Iterable
from itertools import pairwise


def with_missing(numbers: Iterable[int]) -> list[int]:
    """All numbers from the first to the last if those between are of lost records, else the given ones.

    If the gaps outnumber the records, or all steps are alike, a clock or another counter numbered the records.

    Parameters
    ----------
    numbers : iterable of int
        Numbers of the records.

    Returns
    -------
    list of int
        In rising order, each once.

    Examples
    --------
    >>> with_missing([1, 2, 4, 5]), with_missing([10, 20, 30]), with_missing([101, 214, 388])
    ([1, 2, 3, 4, 5], [10, 20, 30], [101, 214, 388])
    """
    present = sorted(set(numbers))
    steps = [b - a for a, b in pairwise(present)]
    is_counted = len(steps) < 2 or len(set(steps)) > 1
    if not present or not is_counted or sum(steps) + 1 > 2 * len(present):
        return present
    return list(range(present[0], present[-1] + 1))
