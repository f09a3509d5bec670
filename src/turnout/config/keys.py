"""What a configuration file may say: names, kinds of value, units, limits; and the check against it."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches

from turnout.config.document import Branch, Leaf
from turnout.errors import ConfigError

NO_TURNOUT = "There are no turnouts yet: add one with 'turnout add ID LAYOUT'"
KINDS = {
    "text": (str,),
    "number": (int, float),
    "integer": (int,),
    "flag": (bool,),
    "name_or_index": (str, int),
}
SAID = {"text": "text", "number": "a number", "integer": "a whole number", "flag": "true or false"}


@dataclass(frozen=True)
class Key:
    """One value: its ``kind`` (``many``: a list of them), unit, limits, and what it means."""

    kind: str
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
    default: object = None


@dataclass(frozen=True)
class Each:
    """A mapping whose names are free (matching ``pattern``) and whose values all follow ``spec``."""

    spec: dict
    pattern: str
    meaning: str
    required: bool = False


@dataclass(frozen=True)
class Group:
    """A mapping with fixed names; in a ``fragment`` none of them is required."""

    spec: dict
    meaning: str
    required: bool = False
    fragment: bool = False


@dataclass(frozen=True)
class Elsewhere:
    """A name that is understood, but only in the ``file`` that holds for the whole fleet."""

    file: str
    required: bool = False


def suggestion(name: str, allowed, none: str = "There is none to choose from") -> str:
    """What to write instead of an unknown ``name``; ``none`` where nothing is allowed.

    >>> suggestion("posiiton", ["position", "panel"])
    "Did you mean 'position'? Allowed: panel, position"
    """
    allowed = sorted(map(str, allowed))
    if not allowed:
        return none
    close = get_close_matches(name, allowed, n=1, cutoff=0.6)
    listed = ", ".join(allowed) if len(allowed) <= 24 else f"{len(allowed)} names, as in docs/configuration.md"
    return (f"Did you mean {close[0]!r}? " if close else "") + f"Allowed: {listed}"


def problem(key: Key, value) -> tuple[str, str] | None:
    """None where ``value`` fits ``key``, else what was found and what to write instead.

    >>> problem(Key("number", "rate", unit="Hz", above=0), -1)
    ('-1', 'Write a number above 0 Hz')
    """
    if value is None and key.nullable:
        return None
    if key.many:
        if not isinstance(value, tuple):
            return repr(value), "Write a list, [a, b]"
        single = Key(**{**key.__dict__, "many": False})
        return next((p for v in value if (p := problem(single, v))), None)
    if not isinstance(value, KINDS[key.kind]) or (isinstance(value, bool) and key.kind != "flag"):
        return repr(value), f"Write {_wanted(key)}"
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value), f"Write {_wanted(key)}"
    if key.choices and value not in key.choices:
        return repr(value), suggestion(str(value), key.choices)
    if key.pattern and isinstance(value, str) and not re.fullmatch(key.pattern, value):
        return repr(value), f"Write {_wanted(key)}"
    if not isinstance(value, (int, float)):
        return None
    low = key.minimum is not None and value < key.minimum
    if low or (key.maximum is not None and value > key.maximum) or (key.above is not None and value <= key.above):
        return repr(value), f"Write {_wanted(key)}"
    return None


def check(spec: dict, tree: Branch, whole: bool = True) -> Iterator[ConfigError]:
    """Every error of ``tree`` against ``spec``; with ``whole`` false, required names may be missing."""
    misspelt = set()
    for name, value in tree.items():
        rule = spec.get(name)
        if rule is None:
            misspelt.update(get_close_matches(name, spec, n=1))
            allowed = [known for known, rule in spec.items() if not isinstance(rule, Elsewhere)]
            yield tree.key_places[name].error(f"unknown key {name!r}", suggestion(name, allowed))
        elif isinstance(rule, Elsewhere):
            whose = f"{name!r} holds for the whole fleet and would be ignored here"
            yield tree.key_places[name].error(whose, f"It belongs into {rule.file}: move it there")
        elif isinstance(rule, Key):
            if isinstance(value, Branch):
                yield value.place.error(f"names under {name!r}", f"Write {_wanted(rule)}")
            elif found := problem(rule, value.value):
                yield value.place.error(f"{name} is {found[0]}", found[1])
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


def _check_each(rule: Each, name: str, tree: Branch, whole: bool) -> Iterator[ConfigError]:
    for label, value in tree.items():
        if not re.fullmatch(rule.pattern, label):
            yield tree.key_places[label].error(f"{label!r} under {name!r}", f"Write a name like {rule.pattern}")
        elif isinstance(value, Leaf):
            yield value.place.error(f"{label} is {value.value!r}", "Write 'name: value' lines below it")
        else:
            yield from check(rule.spec, value, whole)
    if whole and not tree:
        yield tree.place.error(f"{name!r} is empty", f"Add at least one, {rule.meaning}")


def _wanted(key: Key) -> str:
    if key.choices:
        return "one of " + ", ".join(map(str, key.choices))
    said = SAID.get(key.kind, "a name, or a number counted from 0")
    unit = f" {key.unit}" if key.unit not in ("", None, "-", "1") else ""
    if key.above is not None:
        said += f" above {key.above:g}{unit}"
    elif key.minimum is not None and key.maximum is not None:
        said += f" from {key.minimum:g} to {key.maximum:g}{unit}"
    elif key.minimum is not None:
        said += f" of at least {key.minimum:g}{unit}"
    elif key.maximum is not None:
        said += f" of at most {key.maximum:g}{unit}"
    elif unit:
        said += f" in{unit}"
    return said + (f" like {key.pattern}" if key.pattern else "")
