"""Scales that a file states beside its numbers: they are applied where a standard defines them, else rejected by name.

A gain or an offset may already be in the numbers or not. Where nothing defines which, the numbers are used only if the
unit in the layout ends with "!".
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from turnout.readers.entries import Entry, entries_of_text
from turnout.readers.entry_owners import container_of, owners_of
from turnout.readers.rate_statements import PLACEHOLDERS
from turnout.readers.scale_vocabulary import (
    FACTOR,
    INVERSIONS,
    NEUTRAL,
    OFFSET,
    POLYNOMIAL,
    POSSIBLY_FACTOR,
    POSSIBLY_OFFSET,
    is_of_drawing,
    is_ratio_of_drawing,
    is_scale_name,
    plain_word,
    says_no_scale,
    scale_meaning,
    value_of_word,
)
from turnout.readers.source import MEANINGLESS_UNITS, RawRecord
from turnout.readers.stated_numbers import MAX_CHANNELS, finite_numbers, number_and_unit
from turnout.unit_spellings import SUPERSCRIPTS
from turnout.units import conversion

LEVEL_IN_NAME = re.compile(r"(?:[\[(]\s*|[\s_])db(?:\s*[\])])?$", re.IGNORECASE)  # "Gain (dB)", "gain_db"
ROUND_YEARS = (2000.0, 2048.0, 2050.0)  # which are factors as well
YEARS = (1990.0, 2060.0)  # a whole number between them behind a word of calibration is a year


def without_drawings(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Metadata that stand at no channel, without the scale of a drawing.

    Parameters
    ----------
    facts : mapping of str to any
        Names and values.

    Returns
    -------
    dict of str to any
        The others.
    """
    return {name: value for name, value in facts.items() if not is_ratio_of_drawing(str(name), value)}


def scale_statements(facts: Mapping[str, Any], n_channel: int = 1) -> tuple[str, ...]:
    """What the metadata state about the scale of each channel, where it is not neutral.

    Parameters
    ----------
    facts : mapping of str to any
        Names and values of the metadata.
    n_channel : int
        Number of channels. A list with one value per channel applies to each, any other value to all.

    Returns
    -------
    tuple of str
        Text for each channel, as in "gain = 0.4"; "" where nothing or a neutral scale is stated. A factor or an
        offset that is not understood is not neutral; a polarity is reversed only by a word or a number of an inversion.

    Examples
    --------
    >>> scale_statements({"gain": [0.4, 1.0], "Offset": 0.0, "speed": 30.0}, 2)
    ('gain = 0.4', '')
    >>> scale_statements({"gain": "0dB", "Slope": "1:10"})
    ("Slope = '1:10'",)
    """
    texts: list[list[str]] = [[] for _ in range(n_channel)]
    names = {str(name).casefold() for name in facts}
    for name, value in facts.items():
        meaning = _meaning_among(str(name), names)
        if not meaning and isinstance(value, str):
            if is_of_drawing(str(name)):
                continue
            for inner, number in scales_in_text(value):
                for text, stated in zip(texts, _stated_by_channel(inner, scale_meaning(inner), number, n_channel)):
                    text.extend(stated)
            continue
        for text, stated in zip(texts, _stated_by_channel(str(name), meaning, value, n_channel)):
            text.extend(stated)
    return tuple(", ".join(text) for text in texts)


@lru_cache(maxsize=4096)
def scales_in_text(text: str) -> tuple[tuple[str, str], ...]:
    """Names and values of the scales in a free text, as in "gain 10, tip: steel".

    Parameters
    ----------
    text : str
        Free text of an entry; longer than ``MAX_SCALE_TEXT`` it states none.

    Returns
    -------
    tuple of (str, str)
        Name and value of each scale, in the order of the text.
    """
    if len(text) > MAX_SCALE_TEXT or not re.search(r"[^\W\d]{3}.*\d", text):
        return ()
    entries = [e for e in entries_of_text(text, "") if scale_meaning(e.name)]
    return tuple((e.name, e.value) for e in entries if not is_ratio_of_drawing(e.name, e.value))


MAX_SCALE_TEXT = 400  # characters: a longer text is no note about an amplifier


def _meaning_among(name: str, names: Set[str]) -> str:
    """Kind of scale of a name beside others in lower case: "a0" beside "a1" are the coefficients of a polynomial."""
    if meaning := scale_meaning(name):
        return meaning
    plain = name.strip().casefold()
    if not POLYNOMIAL.fullmatch(plain) or not {f"{plain[0]}0", f"{plain[0]}1"} <= names:
        return ""
    return POSSIBLY_FACTOR if plain[1] == "1" else POSSIBLY_OFFSET


def _stated_by_channel(label: str, meaning: str, value: Any, n_channel: int) -> list[list[str]]:
    """Texts of the scales that one entry states for each channel, without neutral ones."""
    if not meaning:
        return [[] for _ in range(n_channel)]
    neutral = NEUTRAL[meaning]
    if (words := _words(value, meaning, label)) is not None:
        stated = [f"{label} = {_value_text(v)}" if number != neutral else "" for v, number in words]
    else:
        values = _scale_values(value)
        if LEVEL_IN_NAME.search(label) and "db" not in str(value).casefold():  # the unit is in the name alone
            values = [10 ** (x / 20) if isinstance(x, float) else x for x in values]
        if meaning not in (FACTOR, OFFSET):
            values = [x if isinstance(x, float) and not _is_year(x) else _ratio(x, neutral) for x in values]
        stated = [_scale_text(label, x, neutral) for x in values]
    if len(stated) == n_channel:
        return [[text] if text else [] for text in stated]
    return [list(filter(None, dict.fromkeys(stated))) for _ in range(n_channel)]


def _words(value: Any, meaning: str, name: str) -> list[tuple[Any, float]] | None:
    """(value, factor) of each value under a name of an inversion, a prefix or an exponent; else None."""
    values = value.ravel().tolist() if isinstance(value, np.ndarray) else value
    values = values if isinstance(values, (list, tuple)) else [values]
    values = [v for v in values[:MAX_CHANNELS] if isinstance(v, (str, bytes, int, float, np.number, np.bool_))]
    pairs = [(v, value_of_word(meaning, v, name)) for v in values]
    return [(v, number) for v, number in pairs if number is not None] if pairs and pairs[0][1] is not None else None


def _value_text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else repr(str(value)[:40])


def _is_year(number: float) -> bool:
    return number.is_integer() and YEARS[0] < number < YEARS[1] and number not in ROUND_YEARS


def _ratio(value: float | str, neutral: float) -> float:
    """The number of a text such as "x10", "1:10" and "10 mV/pC"; ``neutral`` for any other text."""
    match = re.fullmatch(
        r"(?:[x×]|1 ?[:/] ?)?(\d+(?:[.,]\d+)?)(?: ?[:/] ?1| ?[^\s\d/]{1,5}/[^\s\d]{1,8})?",
        str(value).strip().casefold(),
    )
    return float(match[1].replace(",", ".")) if match and isinstance(value, str) else neutral


def _scale_text(label: str, value: float | str, neutral: float) -> str:
    """Text of one scale, as in "gain = 0.4"; "" for a neutral one."""
    if isinstance(value, str):
        return f"{label} = {value[:40]!r}"
    return "" if value == neutral or math.isnan(value) else f"{label} = {value:g}"


def _scale_values(value: Any) -> list[float | str]:
    """Numbers of a stated scale; a text that is not understood stays a text. Empty for an array of samples."""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, (bool, np.bool_)):
        return ["true"] if value else []
    if isinstance(value, str):
        return _scales_of_text(value)
    numbers = finite_numbers(value)
    if numbers is not None:
        return [float(x) for x in numbers]
    if isinstance(value, np.ndarray):
        value = value.ravel().tolist() if value.dtype.kind in "SUOf" else []
    if isinstance(value, (list, tuple)) and len(value) <= MAX_CHANNELS:
        return [cells[0] if len(cells) == 1 else str(x) for x in value if (cells := _scale_values(x) or [math.nan])]
    return [str(value)] if isinstance(value, (float, np.floating)) and not np.isnan(value) else []


NO_SCALE = PLACEHOLDERS | {"unity", "linear", "off", "1:1", "1/1"}


# "x1", "1 (auto)", "0 dB, fixed"
FACTOR_OF_ONE = re.compile(
    r"(?:[x×]\s?1|1(?:[.,]0+)?\s?[x×])(?:\s?[,(\[][^\d]*)?|(?:1(?:[.,]0+)?|0(?:[.,]0+)?\s?dB)\s?[,(\[][^\d]*",
    re.IGNORECASE,
)


def _scales_of_text(text: str) -> list[float | str]:
    """Scales of a text: one number with its unit, or a list of these; pieces that are not understood stay texts."""
    pieces = text.strip().strip(";").split(";")
    if len(pieces) == 1 and (numbers := finite_numbers(text)) is not None and not re.search(r"[^\d\s.,;eE+-]", text):
        return [float(x) for x in numbers]
    return [_scale_of_piece(piece.strip()) for piece in pieces if len(pieces) > 1 or piece.strip()]


def _scale_of_piece(text: str) -> float | str:
    """The number of a scale; the text itself if it is not understood, nan if it says that there is none."""
    if text.casefold() in NO_SCALE or says_no_scale(text) or FACTOR_OF_ONE.fullmatch(text):
        return math.nan
    parts = number_and_unit(text)
    if parts is None:
        return text
    number, unit = parts
    if unit.casefold() == "db":
        return 10 ** (number / 20)
    if unit.casefold() in ("x", "\u00d7", *MEANINGLESS_UNITS) or (not number and re.match(r"[^\W\d]|[%°(\[]", unit)):
        return number
    try:
        factors = [conversion(part.strip(" ()")).scale for part in unit.strip("[]").split("/", 1)]
    except ValueError:
        try:
            factors = [conversion(unit).scale]
        except ValueError:
            return text
    return number * factors[0] / (factors[1] if len(factors) > 1 else factors[0])


def entry_statements(entries: Iterable[Entry], names: Sequence[str]) -> dict[int, str]:
    """Problems of a message about the scales that entries of the metadata state, nested ones too.

    Each entry is judged by itself. An entry concerns the channel that its place or an entry beside it names, else all;
    it overrules one of the same name in a group above only for a channel that it names.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata that concern the channels.
    names : sequence of str
        Names of the channels.

    Returns
    -------
    dict of int to str
        Index of the channel -> problem; without channels of which nothing or a neutral scale is stated.
    """
    entries = list(entries)
    texts_beside = [
        Entry(entry.place, name, value)
        for entry in entries
        if isinstance(entry.value, str) and not is_scale_name(entry.name) and not is_of_drawing(entry.name)
        for name, value in scales_in_text(entry.value)
    ]
    entries = [*entries, *texts_beside]
    scales = [(entry, _scale_name(entry, names)) for entry in entries]
    scales = [(entry, name) for entry, name in scales if name]
    if not scales:
        return {}
    plain_names = {name.strip().casefold() for _, name in scales}
    texts: list[list[str]] = [[] for _ in names]
    named = [(entry, name, container_of(entry), owners_of(entry, entries, names)) for entry, name in scales]
    named = [n for n in named if n[3] or not is_ratio_of_drawing(n[1], n[0].value)]
    for entry, name, container, owners in named:
        label = entry.name if entry.name == name else f"{name} of {entry.name}"
        meaning = _meaning_among(name, plain_names)
        stated = _stated_by_channel(label, meaning, entry.value, 1 if owners else len(names))
        for i, text in enumerate(texts):
            if owners and i not in owners:
                continue
            is_overruled = any(
                i in inner and plain_word(inner_name) == plain_word(name) and _is_inside(inner_container, container)
                for _, inner_name, inner_container, inner in named
            )
            if not is_overruled:
                text.extend(stated[0 if owners else i])
    return {i: scale_problem(", ".join(dict.fromkeys(text))) for i, text in enumerate(texts) if text}


def _scale_name(entry: Entry, names: Sequence[str]) -> str:
    """The name of a scale under which an entry is: its own, or that of its group if the entry is called as a channel.

    "" if it states no scale.
    """
    if is_scale_name(entry.name) or POLYNOMIAL.fullmatch(plain := entry.name.strip().casefold()):
        return entry.name
    if not any(plain == name.strip().casefold() for name in names):
        return ""
    group = container_of(entry).rpartition("/")[2]
    return group if is_scale_name(group) else ""


def _is_inside(inner: str, outer: str) -> bool:
    """Whether a place lies in a group of another place."""
    return inner != outer and inner.startswith(f"{outer}/" if outer else "")


AXIS = re.compile(r"(?<![^\W_])[xyzXYZ](?=\s?\d)")  # before the number of a sensor
# A power of ten by which the numbers of a channel may be multiplied: "force x100", "rail*10", "rail ×0.1", "10³ N".
POWER = rf"10(?:(?:\^|\*\*)[+-]?\d+|[{SUPERSCRIPTS}]+)"
FACTOR_IN_NAME = re.compile(
    rf"(?:(?:(?:^|[\s_(\[])[xX]|\s?[×*])\s?(?:10+|0[.,]0*1|{POWER})|(?:^|[\s_(\[]){POWER})(?=$|[\s_)\]])"
)


def with_named_factors(record: RawRecord) -> RawRecord:
    """The record with a statement about the scale of each channel whose name has a factor.

    A number that tells the channels of the file apart, as in "acc x10" beside "acc x11", is none. An x that is an
    axis is none either, as in "acc x10" beside "acc y10".

    Parameters
    ----------
    record : RawRecord
        The record as its reader returns it.

    Returns
    -------
    RawRecord
        The same record if no name has a factor.
    """
    stems = [re.sub(r"\d+", "0", AXIS.sub("x", name)) for name in record.names]
    matches = {i: FACTOR_IN_NAME.search(name) for i, name in enumerate(record.names) if stems.count(stems[i]) == 1}
    texts = {i: match[0].strip(" _([") for i, match in matches.items() if match}
    factors = {i: scale_problem(f"a factor in the name of the channel, {text!r}") for i, text in texts.items()}
    return replace(record, undecided={**factors, **record.undecided}) if factors else record


def scale_text(facts: Mapping[str, Any]) -> str:
    """``scale_statements`` of one channel as the problem of a message.

    Parameters
    ----------
    facts : mapping of str to any
        Names and values of the metadata of the channel.

    Returns
    -------
    str
        The problem; "" where nothing or a neutral scale is stated.
    """
    (text,) = scale_statements(facts)
    return scale_problem(text)


def scale_problem(statement: str) -> str:
    """The problem of a message about a stated scale.

    Parameters
    ----------
    statement : str
        As ``scale_statements`` returns it.

    Returns
    -------
    str
        The problem; "" for "".
    """
    return f"the file states {statement}, and nothing says whether its numbers already contain it" if statement else ""


def without_checked_signs(problem: str, checked: Set[str]) -> str:
    """A problem of ``scale_problem`` without the inversions that entries state which the layout declares checked.

    Parameters
    ----------
    problem : str
        As ``RawRecord.undecided`` has it.
    checked : set of str
        Names of the entries, in lower case.

    Returns
    -------
    str
        "" if nothing else is stated.

    Examples
    --------
    >>> without_checked_signs(scale_problem("Polarity = 'rev', Gain = 10"), {"polarity", "gain"})
    'the file states Gain = 10, and nothing says whether its numbers already contain it'
    """
    names = [name for name in checked if scale_meaning(name) == INVERSIONS]
    if not names:
        return problem
    start, end = scale_problem("|").split("|")
    label = "|".join(map(re.escape, names))
    statement = rf"(?:[^,=]+ of )?(?:{label})(?: of [^,=]+)? = (?:'[^']*'|\"[^\"]*\"|[^\s,]+)(?:, |$)"
    stated = problem.removeprefix(start).removesuffix(end)
    rest = re.sub(rf"(?:^|(?<=, )){statement}", "", stated, flags=re.IGNORECASE).removesuffix(", ")
    return problem if rest == stated else scale_problem(rest)
