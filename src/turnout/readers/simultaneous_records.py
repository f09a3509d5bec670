"""Records of a file that are parts of one recording, as where one group holds the left and another the right rail."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np

from turnout.errors import ReadError
from turnout.readers.repeated_blocks import is_noisy
from turnout.readers.scaled_copies import scaled_copies
from turnout.readers.source import Source
from turnout.records import LongRecording, Recording

MAX_OVERLAP = 0.5  # of the shorter record: a trigger may begin within the recording before it
N_COMPARED = 16  # first samples, by which channels with the same samples are found
ONE_RECORD_REMEDY = (
    "If they were recorded at once, export all channels as one record, each by its own name, or one record to a file"
)
ONE_UNIT_REMEDY = "Export one of them to a file of its own: the values in physical units, without the raw ones"
MIN_RATIO = 3.0  # of two units, such as ft/s² and m/s²: that of daN and kgf is not told from strengths of impacts
MAX_OFFSET = 0.01  # between two records, in standard deviations: units of vibration have the same zero
MAX_ROUNDING = 1e-3  # relative difference of copies whose units are both right


def simultaneous_errors(recordings: Sequence[Recording | LongRecording], source: Source) -> dict[int, ReadError]:
    """Errors of records that cannot follow each other.

    Two records with the same noise in one channel, and other samples in another, were recorded at once. A record whose
    noise is another's times a factor is a copy in other units. A record that repeats another counts once; the hammer
    test itself finds its impact. Records of trains follow each other by their starts.

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
    copies = _factors_of_copies(list(in_memory.values()))
    n_channels = {k: len(r.channels) for k, r in in_memory.items()}
    whole_copies = {pair for pair, factors in copies.items() if _are_whole(factors, n_channels[pair[1]])}
    for first, second, row, is_whole in shared_channels([(k, list(r.samples)) for k, r in in_memory.items()]):
        if not (is_whole and in_memory[first].kind == "hammer") and (first, second) not in whole_copies:
            name = in_memory[first].channels[row].name
            add_shared(errors, (first, second), "" if is_whole else name, source)
    _add_copies(errors, copies, whole_copies, source)
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


def _are_whole(factors: Mapping[str, float], n_channel: int) -> bool:
    """Whether all channels of a copy are the same in SI units, but for the rounding."""
    return len(factors) == n_channel and all(abs(factor - 1.0) <= MAX_ROUNDING for factor in factors.values())


def _add_copies(
    errors: dict[int, ReadError],
    copies: Mapping[tuple[int, int], Mapping[str, float]],
    whole_copies: Collection[tuple[int, int]],
    source: Source,
) -> None:
    """Add the errors of records that are copies of another in other units.

    The later one alone has an error if both are the same in SI units, else nothing says which is right.
    """
    for (first, second), factors in copies.items():
        if (first, second) in whole_copies:
            problem = "its samples are those of {other}, written in other units or with other digits"
            errors.setdefault(second, _error(second, first, problem, "duplicate", source, ONE_UNIT_REMEDY))
            continue
        name, factor = max(factors.items(), key=lambda item: abs(item[1] - 1.0))
        for record, partner, ratio in ((first, second, 1.0 / factor), (second, first, factor)):
            problem = f"its channel {name!r} is that of {{other}} times {ratio:.4g}: one is a copy in other units"
            errors.setdefault(record, _error(record, partner, problem, "duplicate", source, ONE_UNIT_REMEDY))


def _factors_of_copies(recordings: Sequence[Recording]) -> dict[tuple[int, int], dict[str, float]]:
    """Numbers of two records -> factor of each channel of the latter that is one of the former in other units.

    Computed impacts of several strengths have one shape, and one factor for all channels. Records with different starts
    or with another zero are no copies.
    """
    factors_of_pairs: dict[tuple[int, int], dict[str, float]] = {}
    for name in sorted({channel.name for r in recordings for channel in r.channels}):
        having = [r for r in recordings if any(channel.name == name for channel in r.channels)]
        signals = [r.signal(name) for r in having]
        for i, j, factor in scaled_copies(signals):
            starts = {having[k].started_at for k in (i, j)} - {None}
            offset = abs(np.mean(signals[j]) - factor * np.mean(signals[i]))
            is_copy = len(starts) < 2 and offset <= MAX_OFFSET * np.std(signals[j])
            if is_copy and not np.array_equal(having[i].samples, having[j].samples):
                factors_of_pairs.setdefault((having[i].record, having[j].record), {})[name] = factor
    return {pair: factors for pair, factors in factors_of_pairs.items() if _are_ratios_of_units([*factors.values()])}


def _are_ratios_of_units(factors: Sequence[float]) -> bool:
    """Whether factors are those of copies in SI units, all 1, or one is so far from it as units and raw values are.

    Two channels with one factor are of an impact with another strength.
    """
    if all(abs(factor - 1.0) <= MAX_ROUNDING for factor in factors):
        return True
    is_strength = len(factors) > 1 and np.ptp(factors) <= MAX_ROUNDING * abs(factors[0])
    return not is_strength and any(not 1.0 / MIN_RATIO < abs(factor) < MIN_RATIO for factor in factors)


def _error(
    record: int, partner: int, problem: str, reason: str, source: Source, remedy: str = ONE_RECORD_REMEDY
) -> ReadError:
    text = problem.format(other=f"record {partner + 1}")
    return source.error(f"record {record + 1}", text, remedy, reason)


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
