"""Notations of numbers in text that mean one thing: a typographic minus, the D of Fortran, a blank that is kept."""

import re

KEPT_BLANK = "\u00a0".encode()
MINUS_SIGNS = ("\u2212".encode(), "\u2013".encode())  # minus, and the dash that word processors write for it
BLANKS_AROUND_CELLS = re.compile(rb"(?:(?<=[;,\t|\n])|\A)(?:\xc2\xa0)+|(?:\xc2\xa0)+(?=[;,\t|\r\n]|\Z)")
MINUS = re.compile(rb"(?:(?<=[;,\t| \"\n])|\A)(?:\xe2\x88\x92|\xe2\x80\x93)(?=[\d.,])")
EXPONENT = re.compile(rb"(?<=[\d.])[dD](?=[+-]\d{2,3}[\";,\t| \r\n])")


def has_other_notation(data: bytes) -> bool:
    """Whether bytes of a text may hold a number in another notation.

    Parameters
    ----------
    data : bytes
        Text in UTF-8.

    Returns
    -------
    bool
        False if ``with_plain_numbers`` would change nothing.
    """
    return KEPT_BLANK in data or any(sign in data for sign in MINUS_SIGNS) or bool(EXPONENT.search(data))


def with_plain_numbers(data: bytes) -> bytes:
    """A text with "-" and "E" in its numbers, and without kept blanks around its cells.

    A kept blank within a number stays: it is a mark for thousands.

    Parameters
    ----------
    data : bytes
        Text in UTF-8.

    Returns
    -------
    bytes
        As many lines.

    Examples
    --------
    >>> with_plain_numbers("\u00a0-1,5;\u22122,5;1.5D-02;1\u00a0234\\n".encode()).decode()
    '-1,5;-2,5;1.5E-02;1\\xa0234\\n'
    """
    if KEPT_BLANK in data:
        data = BLANKS_AROUND_CELLS.sub(b"", data)
    if any(sign in data for sign in MINUS_SIGNS):
        data = MINUS.sub(b"-", data)
    return EXPONENT.sub(b"E", data) if EXPONENT.search(data, 0, MAX_SEARCHED) else data


MAX_SEARCHED = 2**16  # bytes: a program that writes D as the mark of the exponent writes it everywhere
