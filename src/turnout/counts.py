"""Counts in texts: a number with its noun, and the first texts of a long list with the number of others."""

from __future__ import annotations

from collections.abc import Sequence


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


def first_texts(texts: Sequence[str], most: int, separator: str = ", ", others: str = "more") -> str:
    """The first texts of a list, and how many others there are.

    Parameters
    ----------
    texts : sequence of str
        Texts of the list.
    most : int
        Number of texts that are named.
    separator : str
        Between two of them.
    others : str
        What the others are called.

    Returns
    -------
    str
        For example "a, b and 3 more".

    Examples
    --------
    >>> first_texts(["A7", "A8", "A9"], 2), first_texts(["A7", "A8"], 2)
    ('A7, A8 and 1 more', 'A7, A8')
    """
    n_others = len(texts) - most
    return separator.join(texts[:most]) + (f" and {n_others} {others}" if n_others > 0 else "")
