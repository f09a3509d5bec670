"""The number of samples that a file states beside them, in any format: with fewer the file was cut off."""

import re
from typing import Any

from turnout.readers.metadata_names import SAMPLE_COUNT_NAMES
from turnout.readers.rate_units import words_of
from turnout.readers.source import RawRecord

COUNT_NAMES = frozenset(("n_samples", *SAMPLE_COUNT_NAMES))


def missing_samples(record: RawRecord, n_sample: int) -> str:
    """What the metadata of a record promise beyond the samples of the file.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    n_sample : int
        Samples of all records of the file: a stated number may count them together.

    Returns
    -------
    str
        The problem, for a message; "" if the file has no fewer samples than it states.
    """
    for entry in record.entries:
        if "_".join(words_of(entry.name)) in COUNT_NAMES and (promised := _whole_number(entry.value)) > n_sample:
            return f"the file ends after {n_sample} of the {promised} samples that {entry.place} states"
    return ""


def _whole_number(value: Any) -> int:
    """A single whole number, also as a text; 0 for another value."""
    match = re.fullmatch(r"\s*(\d{1,15})(?:\.0*)?\s*", str(value))
    return int(match[1]) if match else 0
