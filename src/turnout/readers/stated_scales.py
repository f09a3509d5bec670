"""Scales that a file states beside its numbers: they are applied where a standard defines them, else rejected by name.

A gain or an offset may already be in the numbers or not. Where nothing defines which, the numbers are used only if the
unit in the layout ends with "!".
"""

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from turnout.constants import STANDARD_GRAVITY
from turnout.readers.statements import Entry
from turnout.units import to_si

# Words for a factor and an offset of the ordinate: lower case, without accents and separators.
FACTOR_WORDS = frozenset(
    (
        "scale scaling scalefactor scalingfactor factor calibrationfactor calfactor conversionfactor multiplier gain "
        "slope ymult ygain yscale ordinatescale skalierung skalierungsfaktor faktor kalibrierfaktor verstarkung "
        "facteur facteurdechelle echelle pente skala skalafaktor forstaerkning forstarkning factordeescala escala "
        "ganancia pendiente fattore fattorediscala scala guadagno pendenza"
    ).split()
)
OFFSET_WORDS = frozenset(
    "offset addoffset yoffset intercept yintercept nullpunkt nullpunktverschiebung decalage forskydning "
    "desplazamiento scostamento ordenada".split()
)
SCALE_WORDS = FACTOR_WORDS | OFFSET_WORDS


@lru_cache(maxsize=4096)
def plain_word(name: str) -> str:
    """A name in lower case without accents, separators and a unit in brackets.

    Parameters
    ----------
    name : str
        Name of an attribute, a property or a head line.

    Returns
    -------
    str
        Only its letters and digits.

    Examples
    --------
    >>> plain_word("Scale_Factor [N/V]"), plain_word("Verstärkung")
    ('scalefactor', 'verstarkung')
    """
    letters = unicodedata.normalize("NFKD", re.sub(r"[\[(].*?[\])]", "", name).lower())
    return re.sub(r"[^a-z0-9]", "", letters.replace("æ", "ae").replace("ø", "o"))


def is_scale_name(name: str) -> bool:
    """Whether a name speaks of a factor or an offset of the ordinate.

    Parameters
    ----------
    name : str
        Name of an attribute, a property or a head line.

    Returns
    -------
    bool
        True for "gain", "Scale factor", "Skalierung" and the like.
    """
    return plain_word(name) in SCALE_WORDS


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
        Text for each channel, as in "gain = 0.4"; "" where nothing or a neutral scale is stated.

    Examples
    --------
    >>> scale_statements({"gain": [0.4, 1.0], "Offset": 0.0, "speed": 30.0}, 2)
    ('gain = 0.4', '')
    """
    texts: list[list[str]] = [[] for _ in range(n_channel)]
    for name, value in facts.items():
        word = plain_word(str(name))
        if word not in SCALE_WORDS or (numbers := _numbers(value)) is None:
            continue
        neutral = 1.0 if word in FACTOR_WORDS else 0.0
        values = numbers if numbers.size == n_channel else np.resize(numbers, n_channel)
        for text, number in zip(texts, values):
            if number != neutral:
                text.append(f"{name} = {number:g}")
    return tuple(", ".join(text) for text in texts)


def entry_statements(entries: Iterable[Entry], n_channel: int = 1) -> dict[int, str]:
    """Problems of a message about the scales that entries of the metadata state, nested ones too.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata that concern all of the channels.
    n_channel : int
        Number of channels, as in ``scale_statements``.

    Returns
    -------
    dict of int to str
        Index of the channel -> problem; without channels of which nothing or a neutral scale is stated.
    """
    facts = {entry.name: entry.value for entry in entries if is_scale_name(entry.name)}
    texts = scale_statements(facts, n_channel) if facts else ()
    return {i: scale_problem(text) for i, text in enumerate(texts) if text}


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


def _numbers(value: Any) -> np.ndarray | None:
    """The finite numbers of a value, (n,); None if it holds none or is an array of samples."""
    if isinstance(value, str):
        cells = re.split(r"[;\s]+", value.strip())
        listed = len(cells) == 1 and (value.count(",") > 1 or "." in value)  # else a comma is the decimal mark
        value = cells[0].split(",") if listed else [cell.replace(",", ".") for cell in cells]
        if len(value) > 1 and not re.match(r"[+-]?\.?\d", value[1]):  # a number with its unit
            number = _numbers(value[0])
            is_level = number is not None and value[1].casefold() == "db"
            return 10 ** (number / 20) if is_level and number is not None else number
    if not isinstance(value, (int, float, list, tuple, np.ndarray, np.generic)) or isinstance(value, bool):
        return None
    try:
        numbers = np.ravel(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        return None
    return numbers if 0 < numbers.size <= MAX_CHANNELS and np.isfinite(numbers).all() else None


MAX_CHANNELS = 64  # a longer array is no list of scales but one of samples


FILL_WORDS = frozenset(
    "fillvalue missingvalue missing nodata nodatavalue invalidvalue novalue nanvalue fehlwert ersatzwert "
    "valeurmanquante manglendevaerdi valoremancante valorfaltante".split()
)
SENSITIVITY = re.compile(r"sensitiv|empfindlich|sensibi|folsom|gevoelig")
MAX_SENSITIVITY_DEVIATION = 0.1  # relative: a certificate and a logger's nominal sensitivity differ by less
# Ratios of units of one sensitivity: prefixes, and g against m/s².
UNIT_RATIOS = tuple(10.0**p * g for p in (-6, -3, 0, 3, 6) for g in (1.0, STANDARD_GRAVITY, 1.0 / STANDARD_GRAVITY))


def fill_values(entries: Iterable[Entry]) -> tuple[float, ...]:
    """Numbers that stand for a missing sample, as the metadata state.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata of a record.

    Returns
    -------
    tuple of float
        Values of the entries that are named like a fill value.

    Examples
    --------
    >>> fill_values([Entry("head", "_FillValue", -999), Entry("head", "gain", 2.0)])
    (-999.0,)
    """
    lists = (_numbers(entry.value) for entry in entries if plain_word(entry.name) in FILL_WORDS)
    return tuple(float(x) for numbers in lists if numbers is not None for x in numbers)


def sensitivity_problem(entries: Iterable[Entry], sensitivity: float, unit: str) -> str:
    """The problem of a message if the metadata state sensitivities and none is that of the layout.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata of a record.
    sensitivity : float
        Sensitivity of the channel in the layout.
    unit : str
        Its unit.

    Returns
    -------
    str
        "" if the file states none, or one that agrees within a tenth in any unit of the same kind.

    Examples
    --------
    >>> stated = [Entry("head", "Sensitivity", "10.2 mV/(m/s²)")]
    >>> sensitivity_problem(stated, 100.0, "mV/g"), bool(sensitivity_problem(stated, 35.3, "mV/g"))
    ('', True)
    """
    stated = [entry for entry in entries if SENSITIVITY.search(plain_word(entry.name))]
    numbers = [(entry, float(x)) for entry in stated if (n := _numbers(entry.value)) is not None for x in n if x != 0.0]
    if not numbers or any(_is_same_sensitivity(entry, x, sensitivity, unit) for entry, x in numbers):
        return ""
    listed = "; ".join(f"{entry.name}: {entry.value}" for entry in stated[:3])
    return f"the file states {listed[:100]!r}, and the layout's sensitivity of {sensitivity:g} {unit} is none of these"


def _is_same_sensitivity(entry: Entry, stated: float, sensitivity: float, unit: str) -> bool:
    """Whether a number is the sensitivity of the layout, in its own unit or, without one, in any of the kind."""
    in_name = re.search(r"[\[(](.+)[\])]\s*$", entry.name)
    behind = re.sub(r"^[\s\d.,eE+-]*", "", str(entry.value)) if isinstance(entry.value, str) else ""
    own_unit = behind.strip() or (in_name[1] if in_name else "")
    for quantity in ("force", "acceleration", "velocity", "displacement", "strain") if own_unit else ():
        try:
            ratio = to_si(quantity, "V", abs(stated), own_unit).scale / to_si(quantity, "V", sensitivity, unit).scale
        except ValueError:
            continue
        return abs(ratio - 1.0) <= MAX_SENSITIVITY_DEVIATION
    ratios = (abs(stated) / sensitivity, 1.0 / (abs(stated) * sensitivity))
    return any(abs(r / unit_ratio - 1.0) <= MAX_SENSITIVITY_DEVIATION for r in ratios for unit_ratio in UNIT_RATIOS)


def remedy(unit: str) -> str:
    """What to do about a scale of which nothing says whether it was applied.

    Parameters
    ----------
    unit : str
        Unit that the file states, "" without one.

    Returns
    -------
    str
        The advice, without its full stop.
    """
    label = unit.strip() or "N"
    return (
        f"Find out in the logger's manual whether its numbers already contain it; if they do, set unit: '{label}!' for "
        f"this channel in the layout, else the value of one step, such as unit: '0.4 {label}!'"
    )


def apply_packing(numbers: Sequence | np.ndarray, factor: float, offset: float, fills: Sequence[float]) -> np.ndarray:
    r"""Unpack numbers by the climate and forecast (CF) conventions of netCDF, section 8.1.

    .. math:: x = s p + o, \qquad x = \mathrm{nan} \quad \mathrm{where}\ p\ \mathrm{is\ a\ fill\ value}

    Parameters
    ----------
    numbers : (n,) array
        Packed numbers p.
    factor, offset : float
        ``scale_factor`` s and ``add_offset`` o. [unit of the file]
    fills : sequence of float
        Values that stand for a missing sample.

    Returns
    -------
    (n,) array of float
        x. [unit of the file]

    Examples
    --------
    >>> apply_packing(np.array([10, -99], dtype="int16"), 0.5, 1.0, [-99])
    array([ 6., nan])
    """
    packed = np.asarray(numbers)
    unpacked = packed * float(factor) + float(offset)
    for fill in fills:
        unpacked[packed == fill] = np.nan
    return unpacked
