"""The sampling rate of a record by its file alone, with the places that state it."""

from __future__ import annotations

from dataclasses import dataclass

from turnout.errors import ReadError
from turnout.readers.rate_agreement import resolve
from turnout.readers.rate_statements import statements_of
from turnout.readers.rate_vocabulary import CERTAIN
from turnout.readers.source import RawRecord, Source
from turnout.readers.time_axes import all_statements


@dataclass(frozen=True)
class StatedRate:
    """``value`` [Hz], None where the file does not tell it, the ``statements`` about it, and the problem with them."""

    value: float | None = None
    statements: tuple[str, ...] = ()
    problem: str = ""


NO_RATE = StatedRate()


def stated_rate(record: RawRecord, k: int, n: int, source: Source) -> StatedRate:
    """Rate of a record and every statement about it.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    k : int
        Number of the record, from 0.
    n : int
        Number of records of the file.
    source : Source
        The raw file.

    Returns
    -------
    StatedRate
        Without a value where nothing states the rate, or statements contradict each other.
    """
    where = f"record {k + 1} of {n}"
    try:
        statements = all_statements(record, k, n, set(), where, source)
    except ReadError as error:
        texts = tuple(map(str, statements_of(record.entries, k, n)))
        return StatedRate(None, texts, f"{error.problem}. {error.remedy}.")
    texts = tuple(map(str, statements))
    try:
        value = resolve(statements, None, where, source) if any(s.certainty == CERTAIN for s in statements) else None
    except ReadError as error:
        return StatedRate(None, texts, f"{error.problem}. {error.remedy}.")
    return StatedRate(value, texts)
