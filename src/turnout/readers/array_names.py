"""Names of records and channels among named variables, their order, and units that belong to them."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from turnout.readers.array_metadata import Metadata, list_of_texts
from turnout.readers.metadata_names import (
    CHANNEL_NAMES,
)
from turnout.readers.record_numbers import with_missing
from turnout.readers.source import Source

RECORD_NAME = re.compile(r"^(?:record|rec|segment|impact|hit)[_ ]?(\d+)$", re.IGNORECASE)


def numbered_names(names: Iterable[str]) -> list[tuple[int, str]]:
    """Names of records, "record", "impact" ... with a number.

    Parameters
    ----------
    names : iterable of str
        Names of variables or groups.

    Returns
    -------
    list of tuple of (int, str)
        (number, name) of those that name a record, in the given order.

    Examples
    --------
    >>> numbered_names(["rate", "hit_02", "Record 10"])
    [(2, 'hit_02'), (10, 'Record 10')]
    """
    return [(int(m[1]), name) for name in names if (m := RECORD_NAME.match(name))]


def records_in_order(
    numbered: Iterable[tuple[int, str]], variables: Mapping[str, Any], source: Source
) -> Iterator[Any]:
    """Values of the records in the order of their numbers, None for a missing number.

    Parameters
    ----------
    numbered : iterable of tuple of (int, str)
        (number, name) of each record.
    variables : mapping of str to any
        Name -> value, the other variables included.
    source : Source
        The raw file.

    Yields
    ------
    any
        The value of each record in turn, None for a missing number.

    Raises
    ------
    ReadError
        If two names have the same number.
    """
    names: dict[int, list[str]] = {}
    for number, name in sorted(numbered):
        names.setdefault(number, []).append(name)
    for i, number in enumerate(with_missing(names)):
        candidates = names.get(number, [])
        if len(candidates) > 1:
            problem = f"{' and '.join(map(repr, candidates))} are both number {number}"
            yield source.error(f"record {i + 1}", problem, "Number the records each by a number of its own")
        else:
            yield variables[candidates[0]] if candidates else None


def natural_sort_key(name: str) -> list[int | str]:
    """Key that sorts "record_2" before "record_10".

    Parameters
    ----------
    name : str
        Name with numbers in it.

    Returns
    -------
    list of int or str
        Its texts and numbers in turn.
    """
    return [int(piece) if piece.isdigit() else piece for piece in re.split(r"(\d+)", name)]


def match_units(names: Sequence[str], units: list[str], labels: Sequence[str], ordered: bool) -> list[str] | None:
    """Unit of each of ``names``: by the ``labels`` that belong to the units, else by order.

    Parameters
    ----------
    names : sequence of str
        Names of the channels.
    units : list of str
        Units that the file lists.
    labels : sequence of str
        Names that the file lists for these units; case does not matter.
    ordered : bool
        Whether the order of ``names`` is that of the file.

    Returns
    -------
    list of str or None
        One unit per name, "" if unknown; None if the units differ and nothing assigns them.

    Examples
    --------
    >>> match_units(["rail", "sleeper"], ["g", "m/s²"], ["Sleeper", "rail"], ordered=False)
    ['m/s²', 'g']
    >>> match_units(["rail", "sleeper"], ["g", "m/s²"], [], ordered=True)
    ['g', 'm/s²']
    >>> match_units(["rail", "sleeper"], ["g", "m/s²"], [], ordered=False)
    """
    plain_names, labels = [name.casefold() for name in names], [label.casefold() for label in labels]
    if len(labels) == len(set(labels)) == len(units) and set(plain_names) <= set(labels):
        return [units[labels.index(name)] for name in plain_names]
    if len(units) == 1:
        return units * len(names)
    if len(units) != len(names):
        return [""] * len(names)
    return units if ordered or len(set(units)) == 1 else None


def channel_names(facts: Metadata) -> list[str]:
    """Names of the channels in the metadata; a number there counts the channels, as in "Channels: 2".

    Parameters
    ----------
    facts : Metadata
        Metadata of the record.

    Returns
    -------
    list of str
        Empty without names.

    Raises
    ------
    ReadError
        If the variable is damaged.
    """
    value = facts.get(CHANNEL_NAMES)
    value = value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value
    is_number = isinstance(value, (int, float, np.number))
    is_count = is_number or (isinstance(value, str) and value.strip().isdecimal() and int(value) > 1)
    return [] if is_count else split_texts(list_of_texts(value))


def split_texts(texts: list[str]) -> list[str]:
    """The texts of a list that a program wrote as one text, as in "force, rail".

    Parameters
    ----------
    texts : list of str
        Texts of an entry.

    Returns
    -------
    list of str
        The parts of a single text between its commas, semicolons, bars or tabs; several texts as they are.

    Examples
    --------
    >>> split_texts(["force, rail"]), split_texts(["force", "rail, left"])
    (['force', 'rail'], ['force', 'rail, left'])
    """
    return [text.strip() for text in re.split(r"[,;|\t]", texts[0])] if len(texts) == 1 else texts
