"""Sets of a Universal File that belong to one record: by their numbers, times or nodes, else by a regular order."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from itertools import combinations, groupby, pairwise
from typing import Any

import numpy as np

from turnout.readers.record_numbers import with_missing
from turnout.readers.source import Source
from turnout.readers.time_texts import parse_uff_time
from turnout.readers.uff_datasets import UffDataset

# ID line 1; entity, node and direction of the response; label and unit of the ordinate
ChannelKey = tuple[str, str, int, int, str, str]
DIRECTIONS = {0: "", 1: "+X", 2: "+Y", 3: "+Z", -1: "-X", -2: "-Y", -3: "-Z", 4: "+RX", 5: "+RY", 6: "+RZ"}
FORCE_TYPES = (9, 13)  # specific data types of an ordinate (record 9)
MAX_STAMP_DIFFERENCE = timedelta(seconds=1)  # between the sets of a record: ID line 3 is rounded to seconds
MAX_LISTED = 6  # channels that a message lists
PAIRING_REMEDY = (
    "Export the sets with the number of the impact in field 3 of record 6, or with its time in ID line 3, or each "
    "impact to a file"
)


@dataclass(frozen=True)
class Pairing:
    """The sets of each record by channel.

    ``problems`` are contradictions between the sets of a record, ``labels`` what its sets have in common, each by the
    number of the record.
    """

    channels: tuple[ChannelKey, ...]
    groups: list[dict[ChannelKey, UffDataset]]
    problems: dict[int, str] = field(default_factory=dict)
    labels: dict[int, str] = field(default_factory=dict)


def channel_key(dataset: UffDataset) -> ChannelKey:
    """Key of a set's channel: all its names.

    Parameters
    ----------
    dataset : UffDataset
        A set with a readable header.

    Returns
    -------
    tuple
        ID line 1; entity, node and direction of the response; label and unit of the ordinate.
    """
    return (
        dataset.ids[0] if dataset.ids[0] not in ("", "NONE") else "",
        *dataset.response,
        dataset.labels[1][1],
        dataset.labels[1][2],
    )


def channel_name(key: ChannelKey) -> str:
    """The name of a channel: ID line 1, or the first of its other names that is not empty.

    Parameters
    ----------
    key : tuple
        As ``channel_key`` returns it.

    Returns
    -------
    str
        The name.

    Examples
    --------
    >>> channel_name(("", "NONE", 12, 3, "", "m/s²"))
    '12 +Z'
    """
    return next(
        (name for name in (key[0], key[1], key[4]) if name and name != "NONE"),
        f"{key[2]} {DIRECTIONS.get(key[3], key[3])}",
    )


def pair_sets(named: Sequence[UffDataset], nameless: Sequence[UffDataset], source: Source) -> Pairing:
    """The sets of each record.

    Sequence numbers that differ count first. Without them the times in ID line 3 count if those of each channel differ,
    then the nodes of the impacts, then a regular order: channel by channel in turn, or all sets of a channel before
    those of the next. Where times, nodes or lengths contradict that order, sets are lost or moved: then only records
    that a time or a node confirms are used.

    Parameters
    ----------
    named : sequence of UffDataset
        Sets with a readable header, in the order of the file.
    nameless : sequence of UffDataset
        The other sets.
    source : Source
        The Universal File.

    Returns
    -------
    Pairing
        The records in the order of their numbers, times, or sets.

    Raises
    ------
    ReadError
        If nothing says which sets belong together.
    """
    keys = [channel_key(s) for s in named]
    channels = tuple(dict.fromkeys(keys))
    numbers = [s.sequence for s in named]
    if len(set(zip(keys, numbers))) == len(named) and len(set(numbers)) > 1:
        span = range(min(numbers), max(numbers) + 1)
        is_of_damaged_sets = len(span) <= len(set(numbers)) + len(nameless)
        by_number = _by_label(keys, numbers, named)
        return Pairing(
            channels, [by_number.get(n, {}) for n in (span if is_of_damaged_sets else with_missing(numbers))]
        )
    stamps, nodes = _joined_stamps(keys, [parse_uff_time(s.ids[2]) for s in named]), [_impact_node(s) for s in named]
    if len(channels) > 1 and _settles(keys, stamps):
        by_stamp = dict(sorted(_by_label(keys, stamps, named).items()))
        labels = {k: f"the time {stamp:%Y-%m-%d %H:%M:%S} in ID line 3" for k, stamp in enumerate(by_stamp)}
        groups = list(by_stamp.values())
    elif len(channels) > 1 and _settles(keys, nodes):
        by_node = _by_label(keys, nodes, named)
        labels = {k: f"an impact at node {node}" for k, node in enumerate(by_node)}
        groups = list(by_node.values())
    else:
        _check_order(keys, channels, named, nameless, source)
        labels, n_taken = {}, Counter[ChannelKey]()
        groups = [{} for _ in range(max(Counter(keys).values(), default=0))]
        for key, dataset in zip(keys, named):
            groups[n_taken[key]][key] = dataset
            n_taken[key] += 1
        _check_repeats(groups, channels, source)
        _check_sizes(groups, channels, source)
    stamp_of, node_of = dict(zip(map(id, named), stamps)), dict(zip(map(id, named), nodes))
    contradictions = (_contradiction(group, stamp_of, node_of, is_by_order=not labels) for group in groups)
    problems = {k: text for k, text in enumerate(contradictions) if text}
    if problems and not labels:
        first = min(problems)
        confirmed = {k for of_sets in (stamps, nodes) for k in _records_of_own_label(groups, keys, named, of_sets)}
        unsettled = f"record {first + 1} shows that sets are lost or moved, and nothing confirms those of this record"
        problems |= {k: unsettled for k in range(len(groups)) if k not in problems and k not in confirmed}
    return Pairing(channels, groups, problems, labels)


def _by_label(
    keys: Sequence[ChannelKey], labels: Sequence[Any], sets: Sequence[UffDataset]
) -> dict[Any, dict[ChannelKey, UffDataset]]:
    """Label -> sets by channel, in the order of the file."""
    groups: dict[Any, dict[ChannelKey, UffDataset]] = {}
    for key, label, dataset in zip(keys, labels, sets):
        groups.setdefault(label, {})[key] = dataset
    return groups


def _settles(keys: Sequence[ChannelKey], labels: Sequence[Any]) -> bool:
    """Whether every set has a label, and no two sets of a channel have the same."""
    return None not in labels and len(set(zip(keys, labels))) == len(labels)


def _joined_stamps(keys: Sequence[ChannelKey], stamps: Sequence[datetime | None]) -> list[datetime | None]:
    """Each time replaced by the first of those that are equal but for rounding.

    Times are rounded alike only if those of each channel are far enough apart.
    """
    per_channel = [sorted({t for k, t in zip(keys, stamps) if k == key and t}) for key in dict.fromkeys(keys)]
    intervals = [b - a for times in per_channel for a, b in pairwise(times)]
    is_far = min(intervals, default=timedelta.max) > 2 * MAX_STAMP_DIFFERENCE
    joined: dict[datetime | None, datetime | None] = {None: None}
    first: datetime | None = None
    for stamp in sorted({t for t in stamps if t}):
        if first is None or not is_far or stamp - first > MAX_STAMP_DIFFERENCE:
            first = stamp
        joined[stamp] = first
    return [joined[stamp] for stamp in stamps]


def _impact_node(dataset: UffDataset) -> int | None:
    """Node of the impact: that of the reference, or of a force; None if none is stated.

    A reference that repeats the response is none: exporters fill it so.
    """
    if dataset.reference[1] and dataset.reference[1] != dataset.response[1]:
        return dataset.reference[1]
    return dataset.response[1] or None if dataset.labels[1][0] in FORCE_TYPES else None


def _check_order(
    keys: Sequence[ChannelKey],
    channels: Sequence[ChannelKey],
    named: Sequence[UffDataset],
    nameless: Sequence[UffDataset],
    source: Source,
) -> None:
    """ReadError if a set between others has no readable header, or the channels come in no regular order."""
    if nameless and len(named) > len(channels) and nameless[0].offset < named[-1].offset:
        problem = "a set without readable header is between others, and no numbers or times say which belong together"
        raise source.error(f"byte {nameless[0].offset}", f"{nameless[0].damage}; {problem}", PAIRING_REMEDY)
    is_in_turn = all(key == channels[i % len(channels)] for i, key in enumerate(keys))
    counts = Counter(keys)
    is_channel_after_channel = len(list(groupby(keys))) == len(channels) and len(set(counts.values())) == 1
    if is_in_turn or is_channel_after_channel:
        return
    numbers = ", ".join(f"{n} of channel {channel_name(key)!r}" for key, n in list(counts.items())[:MAX_LISTED])
    problem = f"{numbers} come in no regular order, and neither numbers, times nor nodes say which belong together"
    raise source.error("the sets", problem, PAIRING_REMEDY)


MAX_SIZED_RECORDS = 100  # no test has more impacts, and the search grows with their square
MIN_MOVED_RECORDS = 3  # that a lost set moves; fewer are not distinguished from impacts that differ
MIN_SIZE_SPREAD = 0.05  # of the logarithm of energies: below it all impacts are alike, and their order shows nothing


def _check_repeats(
    groups: Sequence[dict[ChannelKey, UffDataset]], channels: Sequence[ChannelKey], source: Source
) -> None:
    """ReadError if a set repeats an earlier one of its channel and the others of its record do not.

    A whole record that repeats another is no fault of the order: its impact counts once (reason ``duplicate``).
    """
    copies = {key: _copies([group.get(key) for group in groups]) for key in channels}
    for key, of_channel in copies.items():
        for k, first in of_channel.items():
            if partner := next((c for c in groups[k] if copies[c].get(k) != first), None):
                problem = (
                    f"set {k + 1} of channel {channel_name(key)!r} repeats set {first + 1}, and set {k + 1} of channel "
                    f"{channel_name(partner)!r} does not; neither numbers, times nor nodes say which belong together"
                )
                raise source.error("the sets", problem, PAIRING_REMEDY)


MIN_DISTINCT = 8  # values of a set: one with fewer, as of a dead channel, repeats by chance


def _copies(sets: Sequence[UffDataset | None]) -> dict[int, int]:
    """Number of each set whose samples are those of an earlier one -> that of the earlier one."""
    first_of: dict[bytes, int] = {}
    copies = {}
    for k, dataset in enumerate(sets):
        if dataset is None or not np.isfinite(_log_energy(dataset)) or len(np.unique(dataset.data)) < MIN_DISTINCT:
            continue
        first = first_of.setdefault(np.asarray(dataset.data).tobytes(), k)
        if first != k:
            copies[k] = first
    return copies


# Spread of the ratios of sizes in the order of the file, in units of that with two sets lost, by the number of records;
# the last one holds for more. Of 400 intact tests one exceeds it if responses do not depend on the force at all, and
# none if they do. If the impacts differ by 20 % and their ratios by 3 %, a sixth of the losses is found with 4 records,
# two thirds with 6, nine in ten with 8. With fewer than 4, two lost sets look like impacts that differ.
MIN_SPREAD_RATIOS = {4: 15.0, 5: 9.0, 6: 5.5, 7: 4.5, 8: 4.0}


def _check_sizes(
    groups: Sequence[dict[ChannelKey, UffDataset]], channels: Sequence[ChannelKey], source: Source
) -> None:
    """ReadError if the sizes of the sets show that one of each of two channels was lost, with others between them.

    A harder impact has a larger response. If set i of one channel and set j of another are lost, the order stays
    regular, and the sets between them belong to the neighbouring impact.
    """
    records = [group for group in groups if len(group) == len(channels)]  # a last one may be incomplete
    if len(channels) < 2 or not min(MIN_SPREAD_RATIOS) <= len(records) <= MAX_SIZED_RECORDS:
        return
    min_ratio = MIN_SPREAD_RATIOS[min(len(records), max(MIN_SPREAD_RATIOS))]
    sizes = {key: np.array([_log_energy(record[key]) for record in records]) for key in channels}
    for a, b in combinations(channels, 2):
        x, y, n = sizes[a], sizes[b], len(records)
        if not np.isfinite(x).all() or not np.isfinite(y).all():
            continue
        others = np.array([np.delete(np.arange(n), k) for k in range(n)])  # (n, n - 1) without set k
        spread = np.std(y[others][None] - x[others][:, None], axis=2)  # (n, n) without set i of a and set j of b
        of_order, least = np.min(np.diag(spread)), np.min(spread)
        i, j = np.unravel_index(np.argmin(spread), spread.shape)
        is_moved = of_order > MIN_SIZE_SPREAD and least * min_ratio < of_order
        if is_moved and abs(i - j) >= MIN_MOVED_RECORDS:
            problem = (
                f"the sizes of the sets fit if set {i + 1} of channel {channel_name(a)!r} and set {j + 1} of channel "
                f"{channel_name(b)!r} have lost their partners; neither numbers, times nor nodes show the right ones"
            )
            raise source.error("the sets", problem, PAIRING_REMEDY)


def _log_energy(dataset: UffDataset) -> float:
    """Logarithm of the energy of a set; NaN for one that is damaged, empty or left in the file."""
    data = dataset.data
    if dataset.damage or not isinstance(data, np.ndarray) or not data.size or data.dtype.kind not in "fiu":
        return np.nan
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.log(np.var(data.astype(float))))


def _contradiction(
    group: dict[ChannelKey, UffDataset],
    stamp_of: dict[int, datetime | None],
    node_of: dict[int, int | None],
    is_by_order: bool,
) -> str:
    """Text on two sets of a record that differ in time, node of the impact or number of samples; "" if none do.

    Where a time or node pairs them, a set with fewer samples was cut off and is of the same impact.
    """
    names = {id(s): channel_name(key) for key, s in group.items()}
    stamped = [(names[i], stamp) for i in names if (stamp := stamp_of[i])]
    located = [(names[i], node) for i in names if (node := node_of[i])]
    lengths = [(names[id(s)], s.promised) for s in group.values() if is_by_order]
    texts: dict[str, Sequence[tuple[str, Any]]] = {
        "{:%Y-%m-%d %H:%M:%S} in ID line 3": stamped,
        "an impact at node {}": located,
        "{} samples": lengths,
    }
    for text, pairs in texts.items():
        for name, value in pairs[1:]:
            first_name, first = pairs[0]
            if value != first:
                return f"channel {first_name!r} states {text.format(first)}, channel {name!r} {text.format(value)}"
    return ""


def _records_of_own_label(
    groups: Sequence[dict[ChannelKey, UffDataset]],
    keys: Sequence[ChannelKey],
    named: Sequence[UffDataset],
    labels: Sequence[Any],
) -> Iterator[int]:
    """Numbers of the records whose sets have a label in common that no other set of their channels has."""
    counts = Counter(zip(keys, labels))
    label_of = {id(s): label for s, label in zip(named, labels)}
    for k, group in enumerate(groups):
        of_group = {label_of[id(s)] for s in group.values()}
        if len(of_group) == 1 and None not in of_group:
            (label,) = of_group
            if all(counts[key, label] == 1 for key in group):
                yield k
