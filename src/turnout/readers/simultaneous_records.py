"""Records of a file that are parts of one recording, as where one group holds the left and another the right rail."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from turnout.errors import ReadError
from turnout.readers.repeated_blocks import is_noisy
from turnout.readers.source import Source
from turnout.records import LongRecording, Recording

MAX_OVERLAP = 0.5  # of the shorter record: a trigger may begin within the recording before it
N_COMPARED = 16  # first samples, by which channels with the same samples are found
ONE_RECORD_REMEDY = (
    "If they were recorded at once, export all channels as one record, each by its own name, or one record to a file"
)


def simultaneous_errors(recordings: Sequence[Recording | LongRecording], source: Source) -> dict[int, ReadError]:
    """Errors of records that cannot follow each other.

    Two records with the same noise in one channel, and other samples in another, were recorded at once. A record that
    repeats another counts once; the hammer test itself finds its impact. Records of trains follow each other by their
    starts.

    Parameters
    ----------
    recordings : sequence of Recording or LongRecording
        The recordings of a file in their order.
    source : Source
        The raw file.

    Returns
    -------
    dict of int to ReadError
        Number of the record, from 0 -> its error.
    """
    errors: dict[int, ReadError] = {}
    in_memory = {r.record: r for r in recordings if isinstance(r, Recording)}
    for first, second, row, is_whole in shared_channels([(k, list(r.samples)) for k, r in in_memory.items()]):
        if not (is_whole and in_memory[first].kind == "hammer"):
            name = in_memory[first].channels[row].name
            add_shared(errors, (first, second), "" if is_whole else name, source)
    for earlier, later in pairwise(recordings):
        if problem := _overlap(earlier, later):
            numbers = earlier.record, later.record
            for record, partner in (numbers, numbers[::-1]):
                errors.setdefault(record, _error(record, partner, problem, "wrong_time", source))
    return errors


def shared_channels(records: Sequence[tuple[int, Sequence[np.ndarray]]]) -> Iterator[tuple[int, int, int, bool]]:
    """Pairs of records with the same noise in one channel.

    Parameters
    ----------
    records : sequence of tuple of (int, sequence of (n_sample,) array)
        Number and channels of each record.

    Yields
    ------
    tuple of (int, int, int, bool)
        The two records, the channel, and whether all of their channels are the same.
    """
    earlier: dict[tuple[int, bytes], tuple[int, Sequence[np.ndarray]]] = {}
    for k, channels in records:
        for row, samples in enumerate(channels):
            first, former = earlier.setdefault((row, samples[:N_COMPARED].tobytes()), (k, channels))
            if first != k and np.array_equal(samples, former[row]) and is_noisy(samples[None]):
                is_whole = len(channels) == len(former) and all(map(np.array_equal, channels, former))
                yield first, k, row, is_whole
                break


def add_shared(errors: dict[int, ReadError], records: tuple[int, int], name: str, source: Source) -> None:
    """Add the errors of two records with the same noise in one channel, unless a record has one already.

    Parameters
    ----------
    errors : dict of int to ReadError
        Number of the record -> its error.
    records : tuple of (int, int)
        Numbers of the two records, from 0.
    name : str
        The channel; "" if all channels are the same: then only the second record has an error.
    source : Source
        The raw file.
    """
    if not name:
        errors.setdefault(records[1], _error(*records[::-1], "its samples are those of {other}", "duplicate", source))
        return
    problem = f"its channel {name!r} has the same samples as in {{other}}: neither follows the other"
    for record, partner in (records, records[::-1]):
        errors.setdefault(record, _error(record, partner, problem, "duplicate", source))


def _error(record: int, partner: int, problem: str, reason: str, source: Source) -> ReadError:
    text = problem.format(other=f"record {partner + 1}")
    return source.error(f"record {record + 1}", text, ONE_RECORD_REMEDY, reason)


def _overlap(first: Recording | LongRecording, second: Recording | LongRecording) -> str:
    """Why two consecutive records of trains may be of one time, for a message; "" if their starts tell them apart."""
    if first.kind != "passage":
        return ""
    if first.started_at is None or second.started_at is None:
        return "" if first.started_at or second.started_at else "neither it nor {other} states when it began"
    lengths = [r.n_sample / r.rate for r in (first, second)]
    overlap = lengths[0] - (second.started_at - first.started_at).total_seconds()
    return (
        "it was recorded at the same time as {other}, by their starts" if overlap > MAX_OVERLAP * min(lengths) else ""
    )
