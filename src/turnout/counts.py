"""Counts in texts: a number with its noun."""

from __future__ import annotations


def count_of(n: int, noun: str) -> str:
    """A number with its noun, in the plural where it is not one.

    Parameters
    ----------
    n : int
        Number.
    noun : str
        Noun whose plural ends in "s".

    Returns
    -------
    str
        For example "1 turnout" or "2 turnouts".

    Examples
    --------
    >>> count_of(1, "turnout"), count_of(0, "turnout")
    ('1 turnout', '0 turnouts')
    """
    return f"{n} {noun}{'s' * (n != 1)}"
