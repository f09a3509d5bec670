"""Entries of the metadata that damage may have taken away: a start time or a condition that only some records lack.

A bit that changes in a name such as "rail_temperature" removes the condition without a trace. Two rules find it: an
entry that most records of a file have and some lack, and a name that nearly equals a known one.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from turnout.errors import ReadError
from turnout.readers.condition_units import condition_of_entry, is_impossible, unread_conditions
from turnout.readers.metadata_names import CONDITION_QUANTITIES, START_NAMES, TEMPERATURES
from turnout.readers.rate_statements import PLACEHOLDERS
from turnout.readers.source import CONDITIONS, COPY_AGAIN, RawRecord, Source

MIN_NAME_SIZE = 5  # characters: shorter names resemble many
START = "start time"
UNIT_REMEDY = "Write it as '12.5 °C', or as a number in °C"
SPEED_REMEDY = "Write it as '120 km/h', or as a number in m/s"
OTHER_NAME_REMEDY = (
    "Let the logger call it '{}'; if it means something else, name it in the layout, 'checked_entries: {}'"
)
REMEDY = "Copy the file again; if it is whole, correct the entry in the logger's settings"


def lost_entry_errors(records: Sequence[RawRecord | ReadError], source: Source) -> Iterator[ReadError]:
    """Errors about start times and conditions that are lost; the records stay usable.

    Parameters
    ----------
    records : sequence of RawRecord or ReadError
        Records of the file.
    source : Source
        The raw file.

    Yields
    ------
    ReadError
        One per entry, with the reason ``start_unknown`` or ``condition_lost``.
    """
    read = [(k, record, _names(record)) for k, record in enumerate(records) if isinstance(record, RawRecord)]
    if not read:
        return
    impossible: dict[str, int] = {}  # first record with one
    arrays: dict[str, int] = {}  # first record with one
    for k, record, _ in read:
        for name, value in record.conditions.items():
            if is_impossible(name, value) and impossible.setdefault(name, k) == k:
                problem = f"its {name} is {value:g}, which no {'train has' if name == 'speed' else 'rail or air has'}"
                yield _error(f"record {k + 1}", name, f"{problem}: it may be a code for a missing number", source)
            if not is_single(value) and arrays.setdefault(name, k) == k:
                problem = f"its {name} is {len(value)} different values, and not one for each record"
                yield _error(f"record {k + 1}", name, problem, source)
    unread: dict[str, tuple[int, str]] = {}
    for k, record, _ in read:
        for name, text in unread_conditions(record.conditions, record.entries).items():
            unread.setdefault(name, (k, text))
    for name, (k, text) in unread.items():
        problem = f"its {name} is {text[:40]!r}, no number in a known unit"
        yield _error(f"record {k + 1}", name, problem, source, UNIT_REMEDY if name in TEMPERATURES else SPEED_REMEDY)
    everywhere = set.intersection(*(names for _, _, names in read))
    reported = set()
    for name in sorted(set.union(*(names for _, _, names in read)) - everywhere):
        lacking = [k for k, _, names in read if name not in names]
        if 2 * len(lacking) < len(read):
            reported.add(name)
            numbers = ", ".join(str(k + 1) for k in lacking[:5])
            yield _error(f"record {numbers}", name, f"it lacks the {name} that the other records have", source)
    _, first, names = read[0]
    for entry in {entry.name: entry for entry in first.entries}.values():
        condition = similar_name(entry.name)
        other_words = "" if condition else condition_of_entry(entry)
        condition = condition or other_words
        if condition and condition not in names and condition not in reported:
            reported.add(condition)
            likeness = "may mean" if other_words else "is nearly the name of"
            problem = f"{entry.name[:60]!r} in {entry.place[:80]} {likeness} the {condition}, which is missing"
            remedy = OTHER_NAME_REMEDY.format(condition, entry.name[:60]) if other_words else REMEDY
            yield _error("the file", condition, problem, source, remedy)


def is_single(value: Any) -> bool:
    """Whether a condition is a number or a text, and no array or list.

    Parameters
    ----------
    value : any
        Value of a condition.

    Returns
    -------
    bool
    """
    return not isinstance(value, (list, tuple, np.ndarray))


def usable_conditions(conditions: Mapping[str, Any]) -> dict[str, Any]:
    """The conditions of a record without those that are reported and not used.

    Parameters
    ----------
    conditions : mapping of str to any
        Conditions of a record.

    Returns
    -------
    dict of str to any
        Without lists, without values that no rail, air or train has, and without "n/a" in place of a number.
    """
    return {
        name: value
        for name, value in conditions.items()
        if is_single(value) and not is_impossible(name, value) and not _is_no_number(name, value)
    }


def _is_no_number(name: str, value: Any) -> bool:
    """Whether a text stands for a condition with a quantity that was not measured."""
    return name in CONDITION_QUANTITIES and isinstance(value, str) and value.strip().casefold() in PLACEHOLDERS


CONTROL_CHARACTER = re.compile(rb"[\x00-\x08\x0e-\x19\x1b-\x1f]")


def control_character_errors(head: bytes, source: Source) -> tuple[ReadError, ...]:
    """Remark on the head of a text file that holds bytes which are no text: entries may be lost.

    Parameters
    ----------
    head : bytes
        Bytes above the samples.
    source : Source
        The raw file.

    Returns
    -------
    tuple of ReadError
        At most one, with the reason ``condition_lost``.
    """
    if (match := CONTROL_CHARACTER.search(head)) is None:
        return ()
    problem = f"byte {match[0][0]:#04x} in its head is no text: entries of the head may be lost"
    return (source.error(f"byte {match.start()}", problem, COPY_AGAIN, reason="condition_lost"),)


def _names(record: RawRecord) -> set[str]:
    """The entries that a record has."""
    has_start = record.started_at is not None or bool(record.unread_start)
    return {*record.conditions, *([START] if has_start else [])}


def _error(where: str, name: str, problem: str, source: Source, remedy: str = REMEDY) -> ReadError:
    return source.error(where, problem, remedy, reason="start_unknown" if name == START else "condition_lost")


@lru_cache(maxsize=4096)
def similar_name(name: str) -> str:
    """The condition, or "start time", whose name nearly equals another name.

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    str
        "" if it resembles none, or is one.

    Examples
    --------
    >>> similar_name("rail_temqerature"), similar_name("started_ad"), similar_name("rail_temperature")
    ('rail_temperature', 'start time', '')
    """
    plain = name.strip().lower()
    if (
        re.sub(r"[ -]", "_", plain) in KNOWN
        or plain in OTHER_LANGUAGES
        or len(plain) < MIN_NAME_SIZE
        or len(plain) > MAX_NAME_SIZE
    ):
        return ""
    return next((KNOWN[known_name] for known_name in KNOWN if _is_damaged(plain, known_name)), "")


def _is_damaged(name: str, known_name: str) -> bool:
    """Whether a name is a known one with one character changed, missing or added, or two neighbours swapped.

    A changed word of one character ("sensor_a", "sensor_b") and a further letter or digit at the end of a word (as in
    a plural) make another name, not a damaged one.
    """
    start = next((i for i, (a, b) in enumerate(zip(name, known_name)) if a != b), min(len(name), len(known_name)))
    a, b = name[start:], known_name[start:]
    if len(a) == len(b) + 1:  # added
        return a[1:] == b and not (a[0].isalnum() and a[1:2] in ("", *WORD_ENDS))
    if len(a) + 1 == len(b):
        return a == b[1:]
    if len(a) != len(b):
        return False
    is_swap = a[:2] == b[1::-1] and len(b) > 1 and a[2:] == b[2:]
    is_word = (start == 0 or known_name[start - 1] in WORD_ENDS) and b[1:2] in ("", *WORD_ENDS)
    is_one_bit = (ord(a[0]) ^ ord(b[0])).bit_count() == 1 if a and b else True
    return is_swap or (a[1:] == b[1:] and not is_word and (is_one_bit or len(known_name) > MAX_SHORT))


OTHER_LANGUAGES = frozenset(("operatør", "operator", "operatör", "operador", "operatore", "opérator", "operateur"))
MAX_SHORT = 6  # characters: of names as short as "track" only one changed bit counts
WORD_ENDS = ("_", " ", "-", ".")


KNOWN = {name: name for name in CONDITIONS} | {name: START for name in START_NAMES}
MAX_NAME_SIZE = 2 * max(map(len, KNOWN))  # characters
