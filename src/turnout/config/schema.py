"""Schema of the configuration files: names, types, units and limits of all keys, and the check of a file against it.

The keys of config/config.yaml come from the settings dataclasses. The keys of layouts and overrides are listed here.
Ranges of settings are checked as well: the low end must be below the high end, and adjacent bands must not overlap.
"""

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from difflib import get_close_matches
from functools import cache
from types import UnionType
from typing import TYPE_CHECKING, Any, TypeVar, Union, get_args, get_origin, get_type_hints

from turnout.config.document import Branch, Leaf
from turnout.config.settings import parts
from turnout.errors import ConfigError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

ID = r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}"
LABEL = r"[A-Za-z][A-Za-z0-9-]*"
NAME = r"[A-Za-z][A-Za-z0-9_-]*"
PATTERN_TEXTS = {
    ID: "1 to 64 letters, digits, _ and -, the first a letter or digit",
    LABEL: "letters, digits and -, the first a letter",
    NAME: "letters, digits, _ and -, the first a letter",
}
NO_TURNOUT = "There are no turnouts yet: add one with 'turnout add ID LAYOUT'"
VALUE_TYPES = {
    "text": (str,),
    "number": (int, float),
    "integer": (int,),
    "flag": (bool,),
    "name_or_index": (str, int),
}
TYPE_TEXTS = {"text": "text", "number": "a number", "integer": "a whole number", "flag": "true or false"}


@dataclass(frozen=True)
class Key:
    """One value: its ``value_type`` (``many``: a list of these), unit, limits and meaning."""

    value_type: str
    meaning: str
    unit: str = ""
    required: bool = False
    minimum: float | None = None
    maximum: float | None = None
    above: float | None = None
    choices: tuple = ()
    pattern: str = ""
    many: bool = False
    nullable: bool = False
    default: Any = None  # of any of the types in TYPE_NAMES, or a tuple of them


@dataclass(frozen=True)
class NamedEntries:
    """A mapping with free names that match ``pattern`` and with values that all follow ``spec``."""

    spec: dict
    pattern: str
    meaning: str
    required: bool = False


@dataclass(frozen=True)
class Group:
    """A mapping with fixed names; in a ``fragment`` no name is required."""

    spec: dict
    meaning: str
    required: bool = False
    fragment: bool = False


@dataclass(frozen=True)
class FleetWideKey:
    """A name that is allowed only in ``file``, because it holds for the whole fleet."""

    file: str
    required: bool = False


Rule = Key | NamedEntries | Group | FleetWideKey
T = TypeVar("T", bound="DataclassInstance")


def suggestion(name: str, allowed: Iterable[Any], none: str = "There is none to choose from") -> str:
    """Remedy for an unknown name.

    Parameters
    ----------
    name : str
        The name as it was written.
    allowed : iterable of any
        The names that may be written.
    none : str
        Remedy if nothing is allowed.

    Returns
    -------
    str
        The most similar name if there is one, and the allowed names.

    Examples
    --------
    >>> suggestion("posiiton", ["position", "panel"])
    "Did you mean 'position'? Allowed: panel, position"
    """
    allowed = sorted(map(str, allowed))
    if not allowed:
        return none
    close = get_close_matches(name, allowed, n=1, cutoff=0.6)
    listed = ", ".join(allowed) if len(allowed) <= 24 else f"{len(allowed)} names, as in docs/settings.md"
    return (f"Did you mean {close[0]!r}? " if close else "") + f"Allowed: {listed}"


def value_problem(key: Key, value: Any) -> tuple[str, str] | None:
    """Compare a value with its key.

    Parameters
    ----------
    key : Key
        Type, limits and choices.
    value : any
        The value as it was written; a list as a tuple.

    Returns
    -------
    tuple of (str, str) or None
        Problem and remedy; None if the value fits.

    Examples
    --------
    >>> value_problem(Key("number", "rate", unit="Hz", above=0), -1)
    ('-1', 'Write a number above 0 Hz')
    """
    if value is None and key.nullable:
        return None
    if key.many:
        if not isinstance(value, tuple):
            return repr(value), "Write a list, [a, b]"
        single = Key(**{**key.__dict__, "many": False})
        return next((p for v in value if (p := value_problem(single, v))), None)
    if not isinstance(value, VALUE_TYPES[key.value_type]) or (isinstance(value, bool) and key.value_type != "flag"):
        return repr(value), f"Write {_expected_text(key)}"
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value), f"Write {_expected_text(key)}"
    if key.choices and value not in key.choices:
        return repr(value), suggestion(str(value), key.choices)
    if key.pattern and isinstance(value, str) and not re.fullmatch(key.pattern, value):
        return repr(value), f"Write {_expected_text(key)}"
    if not isinstance(value, (int, float)):
        return None
    low = key.minimum is not None and value < key.minimum
    if low or (key.maximum is not None and value > key.maximum) or (key.above is not None and value <= key.above):
        return repr(value), f"Write {_expected_text(key)}"
    return None


def check(spec: dict, tree: Branch, whole: bool = True) -> Iterator[ConfigError]:
    """Compare a tree with its schema.

    Parameters
    ----------
    spec : dict
        Name -> Key, Group, NamedEntries or FleetWideKey.
    tree : Branch
        Tree of a file, or of merged files.
    whole : bool
        Whether required names must be there.

    Yields
    ------
    ConfigError
        Every error, at the name or value to correct.
    """
    misspelt = set()
    for name, value in tree.items():
        rule = spec.get(name)
        if rule is None:
            misspelt.update(get_close_matches(name, spec, n=1))
            allowed = [allowed_name for allowed_name, rule in spec.items() if not isinstance(rule, FleetWideKey)]
            yield tree.key_places[name].error(f"unknown key {name!r}", suggestion(name, allowed))
        elif isinstance(rule, FleetWideKey):
            message = f"{name!r} holds for the whole fleet and would be ignored here"
            yield tree.key_places[name].error(message, f"It belongs into {rule.file}: move it there")
        elif isinstance(rule, Key):
            if isinstance(value, Branch):
                yield value.place.error(f"names under {name!r}", f"Write {_expected_text(rule)}")
            elif problem := value_problem(rule, value.value):
                yield value.place.error(f"{name} is {problem[0]}", problem[1])
        elif isinstance(value, Leaf):
            if value.value is not None or whole:
                yield value.place.error(f"{name} is {value.value!r}", "Write 'name: value' lines below it")
        elif isinstance(rule, Group):
            yield from check(rule.spec, value, whole and not rule.fragment)
        else:
            yield from _check_each(rule, name, value, whole)
    if whole:
        for name, rule in spec.items():
            if rule.required and name not in tree and name not in misspelt:
                yield tree.place.error(f"{name!r} is missing", f"Add '{name}:', {rule.meaning}")


def _check_each(rule: NamedEntries, name: str, tree: Branch, whole: bool) -> Iterator[ConfigError]:
    for label, value in tree.items():
        if not re.fullmatch(rule.pattern, label):
            remedy = f"Write a name of {PATTERN_TEXTS[rule.pattern]}"
            yield tree.key_places[label].error(f"{label!r} under {name!r}", remedy)
        elif isinstance(value, Leaf):
            yield value.place.error(f"{label} is {value.value!r}", "Write 'name: value' lines below it")
        else:
            yield from check(rule.spec, value, whole)
    if whole and not tree:
        yield tree.place.error(f"{name!r} is empty", f"Add at least one, {rule.meaning}")


def _expected_text(key: Key) -> str:
    if key.choices:
        return "one of " + ", ".join(map(str, key.choices))
    if key.pattern:
        return PATTERN_TEXTS[key.pattern]
    text = TYPE_TEXTS.get(key.value_type, "a name, or a number counted from 0")
    unit = f" {key.unit}" if key.unit not in ("", None, "-", "1") else ""
    if key.above is not None:
        text += f" above {key.above:g}{unit}"
    elif key.minimum is not None and key.maximum is not None:
        text += f" from {key.minimum:g} to {key.maximum:g}{unit}"
    elif key.minimum is not None:
        text += f" of at least {key.minimum:g}{unit}"
    elif key.maximum is not None:
        text += f" of at most {key.maximum:g}{unit}"
    elif unit:
        text += f" in{unit}"
    return text


TYPE_NAMES = {int: "integer", float: "number", str: "text", bool: "flag"}


@cache
def settings_keys() -> dict[str, Group]:
    """One group of keys per section of the settings."""
    return {name: Group(keys_of(cls), _first_line(cls)) for name, cls in parts().items()}


def keys_of(cls: type) -> dict[str, Key | Group]:
    """Key of every field of a settings dataclass; nested dataclasses become groups.

    Parameters
    ----------
    cls : type
        Settings dataclass.

    Returns
    -------
    dict of str to Key or Group
        Field -> Key, or Group for a nested dataclass.

    Examples
    --------
    >>> from turnout.config.settings.fleet import FleetSettings
    >>> keys_of(FleetSettings)["checkpoint_time"].unit
    's'
    """
    hints = get_type_hints(cls)
    return {f.name: _key(cls, f, hints[f.name]) for f in fields(cls)}


def fill_settings(cls: type[T], values: dict) -> T:
    """Instance of ``cls`` with ``values`` in place of its defaults.

    Parameters
    ----------
    cls : type
        Settings dataclass.
    values : dict
        Field -> value; a whole number is accepted where the default is a float.

    Returns
    -------
    dataclass
        The settings.
    """
    arguments = {}
    for field in fields(cls):
        if field.name in values:
            value, default = values[field.name], default_of(field)
            if is_dataclass(default):
                nested: Any = type(default)
                value = fill_settings(nested, value)
            elif isinstance(default, float) and isinstance(value, int):
                value = float(value)
            arguments[field.name] = value
    return cls(**arguments)


def default_of(field: Field) -> Any:
    """Default of a dataclass field.

    Parameters
    ----------
    field : Field
        Field of a settings dataclass.

    Returns
    -------
    any
        Its default.
    """
    return field.default if field.default_factory is MISSING else field.default_factory()


def _key(cls: type, field: Field, hint: Any) -> Key | Group:
    default, metadata = default_of(field), field.metadata
    if is_dataclass(default):
        return Group(keys_of(type(default)), _first_line(type(default)))
    nullable = get_origin(hint) in (Union, UnionType) and type(None) in get_args(hint)
    if nullable:
        hint = next(a for a in get_args(hint) if a is not type(None))
    many = get_origin(hint) is tuple or hint is tuple
    if many:
        hint = get_args(hint)[0] if get_args(hint) else type(default[0])
    if hint not in TYPE_NAMES:
        raise TypeError(f"{cls.__name__}.{field.name}: a setting is int, float, str, bool or a tuple, not {hint}")
    return Key(
        TYPE_NAMES[hint],
        metadata.get("why", ""),
        unit=metadata.get("unit", ""),
        minimum=metadata.get("minimum"),
        maximum=metadata.get("maximum"),
        choices=tuple(metadata.get("choices") or ()),
        many=many,
        nullable=nullable,
        default=default,
    )


def _first_line(cls: type) -> str:
    return (cls.__doc__ or cls.__name__).strip().splitlines()[0]


QUANTITIES = ("force", "acceleration", "velocity", "displacement", "strain", "temperature", "ignored")

CHANNEL = {
    "source": Key("name_or_index", "name of the channel in the file, or its number counted from 0", required=True),
    "quantity": Key("text", "what it measures", required=True, choices=QUANTITIES),
    "unit": Key("text", "unit of the numbers in the file; null: as the file says", nullable=True),
    "sensitivity": Key(
        "number", "sensitivity of the sensor; null where the file holds physical units", above=0, nullable=True
    ),
    "sensitivity_unit": Key("text", "its unit: mV/N, mV/g, mV/(m/s²), V/count ..."),
    "sign": Key("integer", "-1 where the sensor is mounted upside down", choices=(1, -1)),
    "offset": Key("number", "position of the sensor from the section's position", unit="m", minimum=-100, maximum=100),
    "mounting": Key("text", "where it sits: hammer, rail head at sleeper, rail head mid-span, rail web, sleeper"),
    "serial": Key("text", "serial number"),
    "limit": Key("number", "range beyond which it clips, in the SI unit of its quantity", above=0, nullable=True),
    "resolution": Key("number", "one step of the converter, in the SI unit of its quantity", above=0, nullable=True),
}
PASSAGE_CHANNEL = {
    **CHANNEL,
    "section": Key("text", "section it watches", required=True, pattern=LABEL),
}
# Minimum rates: below them a recording shows no mode of the track. They also catch a rate written in kHz.
HAMMER_RATE = Key("number", "samples per second", unit="Hz", minimum=250, nullable=True)
PASSAGE_RATE = Key("number", "samples per second", unit="Hz", minimum=100, nullable=True)
FILES = {
    "files": Key("text", "pattern of the file names below the turnout's raw folder", required=True),
    "format": Key("text", "reader, one of `turnout check --formats`; auto: by the file itself"),
    "rate": HAMMER_RATE,
    "records": Key("integer", "records in one file; null: not promised", minimum=1, nullable=True),
    "samples": Key("integer", "samples per record; null: not promised", minimum=1, nullable=True),
    "time_zone": Key("text", "time zone of the file's time stamps, an IANA name"),
    "checked_entries": Key("text", "entries of the files that state neither rate, scale nor unit; separated by ;"),
}
HAMMER = {
    **FILES,
    "force": Key("text", "channel of the hammer", required=True),
    "response": Key("text", "channel that the models are identified from", required=True),
    "validation": Key("text", "second response; identify.second_response says what for; null: none", nullable=True),
    "channels": NamedEntries(CHANNEL, NAME, "one entry per channel", required=True),
}
PASSAGES = {
    **FILES,
    "rate": PASSAGE_RATE,
    "channels": NamedEntries(PASSAGE_CHANNEL, NAME, "one entry per channel", required=True),
}
# Keys that a single section may set differently from the turnout.
SECTION_HAMMER = {name: rule for name, rule in HAMMER.items() if name != "files"}
SECTION = {
    "panel": Key("text", "open track, switch, closure, crossing panel, after the crossing", required=True,
                 choices=("OT", "SP", "CLP", "CP", "AS")),
    "track": Key("text", "track it lies in", required=True, choices=("main", "diverging", "both")),
    "position": Key("number", "position along the turnout, 0 at the switch toe, towards the crossing", unit="m",
                    required=True, minimum=-10000, maximum=10000),
    "pad": Key("text", "railpad"),
    "sleeper": Key("text", "sleeper"),
    "hammer": Group(SECTION_HAMMER, "what differs for this section", fragment=True),
}  # fmt: skip


# Settings that hold for the whole fleet: a whole section (empty tuple), or some of its keys.
FLEET_WIDE: dict[str, tuple[str, ...]] = {
    "alerts": (),
    "fleet": (),
    "trend": (),
    "passage": ("cluster_maximum", "cluster_seed"),
}


def layout_keys(merged: bool = False) -> dict:
    """Keys of a layout or an override, its own settings included.

    Parameters
    ----------
    merged : bool
        With the settings that hold for the whole fleet, as after merging.

    Returns
    -------
    dict
        Name -> Key, Group or NamedEntries.
    """
    return {
        "description": Key("text", "what this layout is, for people"),
        "sections": NamedEntries(SECTION, LABEL, "one entry per monitored section", required=True),
        "hammer": Group(HAMMER, "how the hammer tests lie on the disk"),
        "passages": Group(PASSAGES, "how the recordings of train passages lie on the disk"),
        "settings": Group(
            settings_keys() if merged else _layout_settings(), "method settings of config.yaml that differ here"
        ),
    }


def _layout_settings() -> dict:
    """The keys of the settings; those that hold for the whole fleet are marked as such."""
    keys: dict = dict(settings_keys())
    for section, names in FLEET_WIDE.items():
        if names:
            spec = keys[section].spec | {name: FleetWideKey("config.yaml") for name in names}
            keys[section] = Group(spec, keys[section].meaning)
        else:
            keys[section] = FleetWideKey("config.yaml")
    return keys


RANGE_SUFFIXES = (("_low", "_high"), ("_minimum", "_maximum"))
ADJACENT_RANGES = (
    ("identify", "ballast_high", "railpad_low"),
)  # one range ends before the next begins, or where it does


def ends_of_ranges() -> Iterator[tuple[str, str, str]]:
    """(section, name of the low end, name of the high end) of every range of the settings.

    >>> ("identify", "ballast_low", "ballast_high") in list(ends_of_ranges())
    True
    """
    for section, group in settings_keys().items():
        for name in group.spec:
            for low, high in RANGE_SUFFIXES:
                if name.endswith(low) and (high_name := name.removesuffix(low) + high) in group.spec:
                    yield section, name, high_name


def check_ranges(settings: Branch) -> Iterator[ConfigError]:
    """Check that the low end of every range of the settings is below its high end. Single keys must be valid.

    Parameters
    ----------
    settings : Branch
        Tree of the settings.

    Yields
    ------
    ConfigError
        An error for each range that is not, at its first written end.
    """
    for section, low, high in (*ends_of_ranges(), *ADJACENT_RANGES):
        written = settings.get(section, {})
        leaves = [written[name] for name in (low, high) if name in written]
        values = [
            written[name].value if name in written else settings_keys()[section].spec[name].default
            for name in (low, high)
        ]
        can_meet = (section, low, high) in ADJACENT_RANGES and values[0] == values[1]
        if leaves and not (values[0] < values[1] or can_meet):
            high_place = f" in {leaves[1].place.path}, {leaves[1].place}" if len(leaves) > 1 else ""
            problem = f"{section}.{low} is {values[0]}, and {high} is {values[1]}{high_place}"
            yield leaves[0].place.error(problem, f"Write a {low} below {high}")
    bands = settings.get("identify", {}).get("extra_bands")
    if bands and not _rising_pairs(bands.value):
        yield bands.place.error(f"extra_bands is {list(bands.value)}", "Write pairs [low, high, low, high, ...]")


def _rising_pairs(edges: tuple[float, ...]) -> bool:
    return len(edges) % 2 == 0 and all(low < high for low, high in zip(edges[::2], edges[1::2]))
