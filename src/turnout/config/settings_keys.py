"""Keys of config/config.yaml, read from the settings dataclasses, and the dataclasses filled from it."""

from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Union, get_args, get_origin, get_type_hints

from turnout.config.keys import Group, Key
from turnout.config.settings import parts

KIND_OF = {int: "integer", float: "number", str: "text", bool: "flag"}


@cache
def settings_keys() -> dict[str, Group]:
    """One group of keys per part of the program."""
    return {name: Group(keys_of(cls), _first_line(cls)) for name, cls in parts().items()}


def keys_of(cls: type) -> dict[str, Key | Group]:
    """Key of every field of a settings dataclass, nested ones as groups.

    >>> from turnout.config.settings.fleet import FleetSettings
    >>> keys_of(FleetSettings)["checkpoint_time"].unit
    's'
    """
    hints = get_type_hints(cls)
    return {f.name: _key(cls, f, hints[f.name]) for f in fields(cls)}


def filled(cls: type, values: dict):
    """Instance of ``cls`` with ``values`` in place of its defaults."""
    given = {}
    for field in fields(cls):
        if field.name in values:
            value, default = values[field.name], default_of(field)
            if is_dataclass(default):
                value = filled(type(default), value)
            elif isinstance(default, float) and isinstance(value, int):
                value = float(value)
            given[field.name] = value
    return cls(**given)


def default_of(field):
    """Default of a dataclass field."""
    return field.default_factory() if field.default is MISSING else field.default


def _key(cls, field, hint) -> Key | Group:
    default, said = default_of(field), field.metadata
    if is_dataclass(default):
        return Group(keys_of(type(default)), _first_line(type(default)))
    nullable = get_origin(hint) in (Union, UnionType) and type(None) in get_args(hint)
    if nullable:
        hint = next(a for a in get_args(hint) if a is not type(None))
    many = get_origin(hint) is tuple or hint is tuple
    if many:
        hint = get_args(hint)[0] if get_args(hint) else type(default[0])
    if hint not in KIND_OF:
        raise TypeError(f"{cls.__name__}.{field.name}: a setting is int, float, str, bool or a tuple, not {hint}")
    return Key(
        KIND_OF[hint],
        said.get("why", ""),
        unit=said.get("unit", ""),
        minimum=said.get("minimum"),
        maximum=said.get("maximum"),
        choices=tuple(said.get("choices") or ()),
        many=many,
        nullable=nullable,
        default=default,
    )


def _first_line(cls: type) -> str:
    return (cls.__doc__ or cls.__name__).strip().splitlines()[0]
