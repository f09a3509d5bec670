"""Channels to which an entry of the metadata belongs, by its place, its name or a text beside it."""

import re
from collections.abc import Sequence
from functools import lru_cache

from turnout.readers.entries import FREE_TEXT, Entry


def container_of(entry: Entry) -> str:
    """The place of an entry without its own name.

    Parameters
    ----------
    entry : Entry
        The entry.

    Returns
    -------
    str
        Its place without its name and without separators at the end.
    """
    return entry.place.removesuffix(entry.name).rstrip("/: ")


def owners_of(entry: Entry, entries: Sequence[Entry], names: Sequence[str]) -> frozenset[int]:
    """Indices of the channels that the place of an entry, its name or a text beside it name; empty without any.

    Parameters
    ----------
    entry : Entry
        The entry.
    entries : sequence of Entry
        All entries of the record.
    names : sequence of str
        Names of the channels.

    Returns
    -------
    frozenset of int
        Indices of the channels, from 0.
    """
    if owners := named_channels(f"{entry.place} {entry.name}", names):
        return owners
    container = container_of(entry)
    if not container:
        return frozenset()
    beside = {
        other.value.strip().casefold()
        for other in entries
        if isinstance(other.value, str) and container_of(other) == container
    }
    return frozenset(i for i, name in enumerate(names) if name.strip().casefold() in beside)


def named_channels(text: str, names: Sequence[str]) -> frozenset[int]:
    """Channels whose name is in a text, word by word; of "rail" and "rail 2" the longer one counts.

    Parameters
    ----------
    text : str
        Place and name of an entry.
    names : sequence of str
        Names of the channels; those of digits only are not searched.

    Returns
    -------
    frozenset of int
        Indices of the channels.

    Examples
    --------
    >>> sorted(named_channels("sensors/rail 2/gain", ["rail", "rail 2", "force"]))
    [1]
    """
    return _named_channels(text, tuple(names))


@lru_cache(maxsize=4096)
def _named_channels(text: str, names: tuple[str, ...]) -> frozenset[int]:
    words = f" {spaced_words(text)} "
    spaced = {i: name for i, name in enumerate(map(spaced_words, names)) if name and not name.isdigit()}
    found = {i: name for i, name in spaced.items() if f" {name} " in words}
    return frozenset(
        i
        for i, name in found.items()
        if not any(f" {name} " in f" {other} " and name != other for other in found.values())
    )


MAX_NAME = 40  # characters at the beginning of a text in which the number of a channel stands
CHANNEL = re.compile(r"(?<![^\W_])(?:ch(?:an(?:nel)?)?s?|kanal|canal|voie)[\s.#_-]*(\d+)", re.IGNORECASE)


def numbered_channels(text: str, entries: Sequence[Entry], n_channel: int) -> frozenset[int]:
    """Channels that a text calls by their numbers, as in "Ch2 delay", from 0 where another entry has a channel 0.

    Where several numbers and not the first one occur, a part of the logger's channels is in the file, and their order
    is not known.

    Parameters
    ----------
    text : str
        Name of an entry.
    entries : sequence of Entry
        All entries of the record.
    n_channel : int
        Number of channels; a higher number is none of them.

    Returns
    -------
    frozenset of int
        Indices of the channels, from 0.

    Examples
    --------
    >>> sorted(numbered_channels("Ch2_delay", [], 2)), sorted(numbered_channels("Channel 9", [], 2))
    ([1], [])
    >>> sorted(numbered_channels("Ch1", [Entry("line 1", "Ch0", "N")], 2))
    [1]
    >>> sorted(numbered_channels("Ch2", [Entry("line 1", "Ch2", "N"), Entry("line 2", "Ch3", "g")], 2))
    []
    """
    numbers = _channel_numbers(text)
    if not numbers:
        return frozenset()
    all_numbers = frozenset().union(*(_channel_numbers(_name_of_text(entry)[:MAX_NAME]) for entry in entries))
    first = min(1, *numbers, *all_numbers)
    if len(all_numbers) > 1 and first not in all_numbers:
        return frozenset()
    return frozenset(n - first for n in numbers if n - first < n_channel)


@lru_cache(maxsize=4096)
def _channel_numbers(text: str) -> frozenset[int]:
    return frozenset(map(int, CHANNEL.findall(text)))


def _name_of_text(entry: Entry) -> str:
    """Name of an entry, of a free text the text."""
    return str(entry.value) if entry.name == FREE_TEXT else entry.name


@lru_cache(maxsize=4096)
def spaced_words(text: str) -> str:
    """Words of a text in lower case with one blank between them.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        Letters and digits only.
    """
    return " ".join(re.split(r"[\W_]+", text.casefold())).strip()


def without_channels(name: str, channels: Sequence[str]) -> str:
    """The words of a name without those of channels, so that "force_delay" and "rail delay" are one quantity.

    Parameters
    ----------
    name : str
        Name of an entry.
    channels : sequence of str
        Names of channels.

    Returns
    -------
    str
        In lower case, with one blank between them.

    Examples
    --------
    >>> without_channels("dt_rail [ms]", ["rail"])
    'dt ms'
    """
    words = f" {spaced_words(name)} "
    for channel in channels:
        words = words.replace(f" {spaced_words(channel)} ", " ")
    return words.strip()
