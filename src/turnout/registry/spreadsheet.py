"""Text for CSV files that people open in a spreadsheet: no letter is garbled, and nothing is taken for a formula."""

from __future__ import annotations

from typing import TypeVar

T = TypeVar("T")
MARK = "\ufeff"  # at the begin of a file: without this byte order mark a spreadsheet may not read it as UTF-8
QUOTE = "'"  # before a text: a spreadsheet shows the text as it is
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r", "\n")


def without_formula(value: T) -> T | str:
    """``value``, with an apostrophe before a text that a spreadsheet would compute.

    Parameters
    ----------
    value : any
        Value of a cell.

    Returns
    -------
    any
        The same value if it is a number or a harmless text.

    Examples
    --------
    >>> without_formula('=HYPERLINK("http://x")'), without_formula(-3.5), without_formula("A7")
    ('\\'=HYPERLINK("http://x")', -3.5, 'A7')

    References
    ----------
    OWASP, "CSV Injection".
    """
    if isinstance(value, str) and value.startswith(FORMULA_STARTS):
        return f"{QUOTE}{value}"
    return value
