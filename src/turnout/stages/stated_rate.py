"""The sampling rate of a record by its file alone, with the places that state it."""

from __future__ import annotations

from dataclasses import dataclass

from turnout.errors import ReadError
from turnout.readers.source import RawRecord, Source
from turnout.readers.timing import check_time, rate_of_time, resolve_rate


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
    statements = []
    if record.rate is not None:
        statements.append(f"{record.rate:.9g} Hz (head or attributes of the file)")
    if record.time is not None and len(record.time) > 2:
        statements.append(f"{rate_of_time(record.time)[0]:.9g} samples per second (time column)")
    statements += [f"{line[:60]!r} (head, perhaps)" for line, _ in record.unclear]
    try:
        if record.time is not None:
            check_time(record.time, where, source)
        is_stated = record.rate is not None or record.time is not None
        value = resolve_rate(record, None, where, source) if is_stated else None
    except ReadError as error:
        return StatedRate(None, tuple(statements), f"{error.problem}. {error.remedy}.")
    return StatedRate(value, tuple(statements))
