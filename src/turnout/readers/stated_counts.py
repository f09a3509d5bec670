"""The number of samples that a file states beside them, in any format: with fewer the file was cut off.

A number of valid samples that is less than theirs is that of a buffer that was not filled.
"""

import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

from turnout.errors import ReadError
from turnout.readers.entries import Entry
from turnout.readers.metadata_names import SAMPLE_COUNT_NAMES
from turnout.readers.rate_units import words_of
from turnout.readers.source import RawRecord, Source

# Words of names such as "valid_samples", "n_samples_used", "valid count", "last valid index".
VALID_WORDS = frozenset("valid used actual written filled captured gultig gultige gultiger".split())
SAMPLE_WORDS = frozenset("sample samples points values rows werte messwerte".split())
COUNT_WORDS = frozenset("n nr no nb num number count counts length index anzahl".split())
OTHER_WORDS = frozenset("of in the last total".split())
FIRST_FREE = (frozenset(("write", "index")), frozenset(("write", "pointer")), frozenset(("nvalid",)))
COUNT_NAMES = frozenset(("n_samples", *SAMPLE_COUNT_NAMES))
# Names of the samples of a block, and of the number of blocks: "SegmentSize", "Samples per block"; "Blocks".
BLOCK = r"(?:blocks?|blocke|segmente?s?|sweeps?|frames?)"
SIZE_OF_BLOCK = re.compile(
    rf"{BLOCK}(?:size|length|grosse|lange|samples|points)|(?:n|numberof|noof)?(?:samples|points|werte)(?:per|pro|je){BLOCK}"
)
NUMBER_OF_BLOCKS = re.compile(
    r"(?:n|no|nr|num|number|anzahl)?(?:of|der)?(?:blocks|blocke|segments|segmente|sweeps|frames)|(?:block|segment|sweep|frame)count"
)
PROMISING_NAMES = COUNT_NAMES | {"record_length"}  # a small whole number may be seconds


def missing_samples(record: RawRecord, n_sample: int) -> tuple[str, str]:
    """What the metadata of a record promise beyond the samples of the file.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    n_sample : int
        Samples of all records of the file: a stated number may count them together.

    Returns
    -------
    tuple of (str, str)
        The problem, for a message, and the name of the entry; "" if the file has no fewer samples than it states, and
        where another number is that of its samples: oscilloscopes state the length of their memory beside that of the
        part which they save.
    """
    named = [(e, _whole_number(e.value)) for e in record.entries if "_".join(words_of(e.name)) in PROMISING_NAMES]
    larger = [(entry, number) for entry, number in named if number > n_sample]
    if not larger or any(number == n_sample for _, number in named):
        return "", ""
    entry, promised = larger[0]
    return f"the file ends after {n_sample} of the {promised} samples that {entry.place} states", entry.name


def stated_counts(record: RawRecord) -> frozenset[int]:
    """Numbers of samples that the metadata of a record state.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.

    Returns
    -------
    frozenset of int
        Without those that the format itself defines.
    """
    return frozenset(number for _, number in _counts(record))


def surplus_samples(record: RawRecord, n_sample: int, n_record: int = 1) -> tuple[str, str]:
    """A stated number of samples that is less than those of the record: they may be of two recordings, or of a buffer.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    n_sample : int
        Samples of the shortest record of the file.
    n_record : int
        Records of the file.

    Returns
    -------
    tuple of (str, str)
        The problem, for a message, and the name of the entry; "" if a number is that of the samples, the last index,
        the channels or the records.
    """
    counts = tuple(_counts(record))
    explained = {n_sample, n_sample - 1, n_sample * n_record, n_record, len(record.names)}
    for entry, number in counts:
        if 0 < number < n_sample and not explained & {n for _, n in counts}:
            place = f"{entry.name!r} in {entry.place}" if entry.place else repr(entry.name)
            return f"{place} is {number}, and there are {n_sample} samples", entry.name
    return "", ""


def count_remarks(
    record: RawRecord, lengths: Sequence[int], n_record: int, where: str, source: Source
) -> Iterator[ReadError]:
    """Remarks on numbers of samples that the metadata state and the file does not have.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    lengths : sequence of int
        Samples of each record of the file that was read.
    n_record : int
        Records of the file.
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Yields
    ------
    ReadError
        With the reason ``entry_unknown``: on fewer samples than there are, and on blocks of more samples.
    """
    problem, name = surplus_samples(record, min(lengths, default=0), n_record)
    remedy = "Find out what the others are"
    if not problem and len(lengths) == n_record:
        problem, name = missing_blocks(record, sum(lengths))
        remedy = "Compare with the logger's own program whether samples are missing"
    if problem:
        remedy = f"{remedy}; if it counts something else, write 'checked_entries: {name}' into the layout"
        yield source.error(where, problem, remedy, reason="entry_unknown")


def missing_blocks(record: RawRecord, n_sample: int) -> tuple[str, str]:
    """A stated size of a block, or number of blocks times their size, that is more than the samples of the file.

    It may be that of an analysis, so it is less certain than a number of samples.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    n_sample : int
        Samples of all records of the file.

    Returns
    -------
    tuple of (str, str)
        The problem, for a message, and the name of the entry; "" if the file has no fewer samples, or if it states
        their number under a name of samples.
    """
    size = _first_number(record, SIZE_OF_BLOCK)
    if size is None or any(number == n_sample for _, number in _counts(record)):
        return "", ""
    entry, samples = size
    blocks = _first_number(record, NUMBER_OF_BLOCKS)
    number = blocks[1] if blocks else 1
    if samples * number <= n_sample or number == n_sample:  # a frame of audio is one sample of all channels
        return "", ""
    stated = f"{blocks[0].name!r} is {blocks[1]} and " if blocks else ""
    return f"{stated}{entry.name!r} is {samples}, and the file has {n_sample} samples", entry.name


@lru_cache(maxsize=4096)
def is_block_name(name: str) -> bool:
    """Whether a name means the number of blocks of a recording, or the samples of one.

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    bool

    Examples
    --------
    >>> [is_block_name(name) for name in ("SegmentSize", "Number of blocks", "Samples per frame", "Block")]
    [True, True, True, False]
    """
    word = "".join(words_of(name))
    return bool(SIZE_OF_BLOCK.fullmatch(word) or NUMBER_OF_BLOCKS.fullmatch(word))


def _first_number(record: RawRecord, pattern: re.Pattern[str]) -> tuple[Entry, int] | None:
    """The first entry with a whole number whose name matches as a whole, and the number."""
    named = (e for e in record.entries if not e.is_defined and pattern.fullmatch("".join(words_of(e.name))))
    return next(((entry, number) for entry in named if (number := _whole_number(entry.value))), None)


def _counts(record: RawRecord) -> Iterator[tuple[Entry, int]]:
    """Entries that are called a number of samples, with the number."""
    for entry in record.entries:
        is_count = not entry.is_defined and "_".join(words_of(entry.name)) in COUNT_NAMES
        if is_count and (number := _whole_number(entry.value)):
            yield entry, number


def unfilled_buffer(record: RawRecord, n_sample: int, n_record: int = 1) -> str:
    """What the metadata of a record state about samples of a buffer that were never measured.

    A number under a name without a word for samples, as "n_valid", may count the records of a file of several.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    n_sample : int
        Samples of the record.
    n_record : int
        Records of the file.

    Returns
    -------
    str
        The problem, for a message; "" if no entry states fewer valid samples.
    """
    for entry in record.entries:
        if not _counts_valid_samples(entry.name):
            continue
        values = entry.value.ravel().tolist() if hasattr(entry.value, "ravel") else entry.value
        numbers = [_whole_number(v) for v in (values if isinstance(values, (list, tuple)) else [values])]
        words = frozenset(words_of(entry.name))
        n_free = 1 if "index" in words else 0  # an index may be that of the last sample
        n_counted = 1 if words & SAMPLE_WORDS or "index" in words else n_record
        if fewer := [number for number in numbers if n_counted < number < n_sample - n_free]:
            place = f"{entry.name!r} in {entry.place}" if entry.place else repr(entry.name)
            return f"{place} is {min(fewer)}, and there are {n_sample} samples: the others may be no measured ones"
    return ""


@lru_cache(maxsize=4096)
def _counts_valid_samples(name: str) -> bool:
    """Whether a name means a number of valid samples, and of nothing else."""
    words = frozenset(words_of(name))
    is_plain = words <= VALID_WORDS | SAMPLE_WORDS | COUNT_WORDS | OTHER_WORDS
    is_count = bool(words & VALID_WORDS and words & SAMPLE_WORDS) or ("valid" in words and bool(words & COUNT_WORDS))
    return words in FIRST_FREE or (is_plain and is_count)


def _whole_number(value: Any) -> int:
    """A single whole number, also as a text; 0 for another value."""
    match = re.fullmatch(r"\s*(\d{1,15})(?:\.0*)?\s*", str(value))
    return int(match[1]) if match else 0
