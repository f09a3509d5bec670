"""Entries of the metadata of a file: name, value and place, also of nested mappings and of free texts."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from turnout.errors import ReadError
from turnout.readers.precision import NUMBER
from turnout.readers.rate_units import rate_unit
from turnout.readers.scale_vocabulary import is_of_drawing, scale_meaning, value_of_word
from turnout.readers.texts import decode_text

MAX_ENTRIES = 64  # numbers of a list: longer ones are samples
MAX_TEXT = 4000  # characters of a text that are searched


@dataclass(frozen=True)
class Entry:
    """An entry of the metadata: ``value`` (text, number, list, mapping) under ``name``; ``place`` is where it is.

    ``is_defined`` is True if the format defines it: then it is about the samples as they are in the file. ``is_piece``
    is True for a part of a free text that is an entry as well.
    """

    place: str
    name: str
    value: Any
    is_defined: bool = False
    is_piece: bool = False


@dataclass(frozen=True)
class UnreadObject:
    """Stands for a value whose content cannot be read: what ``kind`` of object it is, and the ``advice`` to store it.

    The letter x in the advice stands for the name of the variable. ``is_matlab`` marks an object of MATLAB alone.
    """

    kind: str
    advice: str
    is_matlab: bool = True

    def __str__(self) -> str:
        return self.kind

    @property
    def with_article(self) -> str:
        """Its kind behind an article."""
        return f"{'an' if self.kind[:1] in 'aeio' else 'a'} {self.kind}"

    def remedy(self, name: str) -> str:
        """What to do, for a message.

        Parameters
        ----------
        name : str
            Name of the variable.

        Returns
        -------
        str
            The advice with this name.
        """
        return re.sub(r"\bx\b", lambda _: name, self.advice)


FREE_TEXT = "text"  # name of an entry that holds a whole text, beside the entries of its pieces


def rate_entry(place: str, rate: Any) -> Entry:
    """Entry of a rate [Hz] that the format itself defines.

    Parameters
    ----------
    place : str
        Where the format states it.
    rate : any
        Number, or text as it is printed. [Hz]

    Returns
    -------
    Entry
        Under a name that is understood.
    """
    return Entry(place, "sampling rate [Hz]", rate, is_defined=True)


def step_entry(place: str, step: Any, unit: str = "s") -> Entry:
    """Entry of a time step that the format itself defines.

    Parameters
    ----------
    place : str
        Where the format states it.
    step : any
        Number, or text as it is printed.
    unit : str
        A unit of time; any other text counts as seconds.

    Returns
    -------
    Entry
        Under a name that is understood.
    """
    known = rate_unit(unit)
    return Entry(place, f"sampling interval [{unit if known and known.is_step else 's'}]", step, is_defined=True)


def entries_of(variables: Mapping[Any, Any], place: str) -> Iterator[Entry]:
    """Entries of nested metadata: mappings, lists of them, and texts that hold JSON.

    Parameters
    ----------
    variables : mapping
        Name -> value.
    place : str
        Where it is in the file, for messages, "" for the file itself.

    Yields
    ------
    Entry
        Every text, number and short list of numbers.
    """
    for name, value in variables.items():
        name = str(name)
        path = f"{place}/{name}" if place else name
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value[()]
        if isinstance(value, (str, bytes)):
            text = decode_text(value) if isinstance(value, bytes) else value
            value = decoded_json(text)
        if isinstance(value, Mapping):
            yield from entries_of(value, path)
        elif isinstance(value, (list, tuple)) and any(isinstance(v, Mapping) for v in value):
            for i, v in enumerate(value):
                if isinstance(v, Mapping):
                    yield from entries_of(v, f"{path}[{i}]")
        elif pairs := paired_statements(name, value):
            yield from (Entry(path, *pair) for pair in pairs)
        elif value is not None and not isinstance(value, ReadError) and getattr(value, "size", 1) <= MAX_ENTRIES:
            yield Entry(path, name, value)


PAIR_MARK = re.compile(r"\s*[/|&]\s*")
BEGINS_WITH_NUMBER = re.compile(r"[+-]?[.,]?\d")


def paired_statements(name: str, value: Any) -> tuple[tuple[str, str], ...]:
    """Names and values of an entry that states several numbers, "Block length/delta: 64 / 5E-05".

    Parameters
    ----------
    name : str
        Name of the entry.
    value : any
        Its value.

    Returns
    -------
    tuple of (str, str)
        Empty without as many numbers as names; a unit such as "mV/g" is none of two names.

    Examples
    --------
    >>> paired_statements("Rate/Resolution", "25600 Hz / 24 bit"), paired_statements("Panel/Track", "CP/2")
    ((('Rate', '25600 Hz'), ('Resolution', '24 bit')), ())
    """
    if not isinstance(value, str) or len(value) > MAX_PAIRED or not PAIR_MARK.search(name):
        return ()
    names, values = PAIR_MARK.split(name.strip()), PAIR_MARK.split(value.strip())
    are_words = all(re.search(r"[^\W\d_]{2}", word) for word in names) and not is_of_drawing(name)
    if len(names) != len(values) or not are_words or not all(map(BEGINS_WITH_NUMBER.match, values)):
        return ()
    return tuple(zip(names, values))


MAX_PAIRED = 80  # characters of such a value


def decoded_json(text: str) -> Any:
    """What a text holds as JSON.

    Parameters
    ----------
    text : str
        Value of an entry, or a comment.

    Returns
    -------
    any
        A mapping or a list, else the same text.
    """
    if not text.lstrip().startswith(("{", "[")):
        return text
    try:
        return json.loads(text)
    except ValueError:
        return text


# Not that of a time of day, which has seconds or follows a date: "start 10:20:30", but "gain 2:50" and "fs 1:51200".
COLON = r"(?:(?<![ \t]\d)(?<![ \t]\d\d):|(?<!\d[ \tT]\d)(?<!\d[ \tT]\d\d):(?!\d\d:\d\d)|:(?!\d\d(?![\d.,])))"
# "name: value" with a word, numbers without unit, or a ratio as its value.
NAMED_PIECE = re.compile(
    r"(?:[^\d:=]*:)?\s*([^\W\d][^:=]{1,40}?)\s*(?:" + COLON + r"|=)\s*"
    r"([+-]?[.,]?\d[^:=]{0,30}?|[^\W\d]{1,20}\.?|[-+]|[x×]\s?\d+|\d+\s?:\s?\d+)\s*"
)

# Several of them in one piece: "t0=0 dt=0.0001 s n=3000". A word behind a number is its unit if no mark follows it.
PAIR = r"([^\W\d][^:=]{0,40}?)\s*[:=]\s*([+-]?[.,]?\d[^\s:=]*+(?:\s+[^\W\d][^\s:=]*+(?!\s*[:=]))?)"
PAIRS = re.compile(rf"(?>{PAIR}\s*){{2,}}")  # without steps back into a pair, of which a long text has too many

RATIO_PIECE = re.compile(  # "scale 1:500 map"
    r"(?:([^\d:=]*):)?([^\d:=]*[^\W\d])[\s:=]+(1\s?[:/]\s?\d+[^\d:=]{0,30})"
)
MAX_RATIO_PIECE = 100  # characters: a longer piece is a description


def entries_of_text(text: str, place: str) -> Iterator[Entry]:
    """Entries of a free text such as a comment: its pieces with a number, "sampled at 25.6 kHz; tip: steel".

    Parameters
    ----------
    text : str
        One or several lines.
    place : str
        Where it is, for messages.

    Yields
    ------
    Entry
        Words before (else after) the number as the name; the number with its unit as the value.

    Examples
    --------
    >>> [(e.name, e.value) for e in entries_of_text("hammer 3; sampled at 25.6 kHz, tip=steel", "comment")]
    [('hammer', '3'), ('sampled at', '25.6 kHz')]
    >>> [(e.name, e.value) for e in entries_of_text("t0=0 dt=0.1 ms n: 3000", "comment")]
    [('t0', '0'), ('dt', '0.1 ms'), ('n', '3000')]
    """
    for piece in map(str.strip, re.split(r"[;\n\r|]|,\s", text[:MAX_TEXT])):
        if PAIRS.fullmatch(piece):
            yield from (Entry(place, name, value, is_piece=True) for name, value in re.findall(PAIR, piece))
            continue
        ratio = RATIO_PIECE.fullmatch(piece) if len(piece) <= MAX_RATIO_PIECE else None
        if ratio and scale_meaning(ratio[2]):
            subject = f"{ratio[1]} " if is_of_drawing(ratio[1] or "") else ""
            yield Entry(place, subject + ratio[2].strip(), ratio[3].strip(), is_piece=True)
            continue
        named = NAMED_PIECE.fullmatch(piece)
        if named and (re.search(r"\d", named[2]) or value_of_word(scale_meaning(named[1]), named[2]) is not None):
            yield Entry(place, named[1].strip(), named[2].strip(), is_piece=True)
            continue
        match = re.fullmatch(rf"\s*([^\d]*?)[\s:=,@~≈#]*({NUMBER.pattern})\s*([^\d]*?)[\s.]*", piece)
        if not match or not (match[1] or match[3]):
            continue
        words = match[3].split()
        n_unit = next((n for n in (3, 2, 1) if rate_unit(" ".join(words[:n])) and len(words) >= n), 1)
        name = match[1].strip() or " ".join(words[n_unit:]) or "number"
        yield Entry(place, name, f"{match[2]} {' '.join(words[:n_unit])}".strip(), is_piece=True)
