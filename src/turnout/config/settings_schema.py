"""Keys of the settings, read from their dataclasses, and the ranges that two of them form."""

from collections.abc import Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from types import UnionType
from typing import TYPE_CHECKING, Any, TypeVar, Union, get_args, get_origin, get_type_hints

from turnout.config.document import Branch
from turnout.config.schema import Group, Key
from turnout.config.settings import parts
from turnout.errors import ConfigError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")
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
        pattern=metadata.get("pattern", ""),
        many=many,
        nullable=nullable,
        default=default,
    )


def _first_line(cls: type) -> str:
    return (cls.__doc__ or cls.__name__).strip().splitlines()[0]


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
