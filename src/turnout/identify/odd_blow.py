"""Blows that the modes of all others do not describe."""

import numpy as np

from turnout.records import Rejection

TIMES_MEDIAN = 9.0
LARGEST_SHARE = 1.0 / 3.0


def odd_blows(residual_power) -> list[tuple[int, Rejection]]:
    """Blows whose residual is three times (in power nine) that of the median blow: (row, Rejection) each.

    ``residual_power`` is (n_blow,). The power of white noise over some hundred samples is known to ten per cent,
    so this is no matter of chance. None where more than a third would go: then it is the model that fails.

    >>> [row for row, _ in odd_blows(np.array([1.0, 1.1, 20.0, 0.9]))]
    [2]
    """
    median = float(np.median(residual_power))
    odd = np.flatnonzero(residual_power > TIMES_MEDIAN * median)
    if not 0 < len(odd) <= LARGEST_SHARE * len(residual_power):
        return []
    words = "power of what the modes of the test leave of this impact, over the median of all"
    return [(int(i), Rejection("odd_one_out", float(residual_power[i] / median), TIMES_MEDIAN, words)) for i in odd]
