"""Whole numbers on the command line that count something."""

import argparse


def at_least_one(text: str) -> int:
    """The number of ``text``, 1 or more; argparse.ArgumentTypeError otherwise.

    >>> at_least_one("4")
    4
    """
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of 1 or more")
    return number
