"""A stage: what is computed of each unit, by which code, with what from other stages."""

import os
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

from turnout.config import Configuration
from turnout.fleet.plan import Planned
from turnout.records import Unit

Token = str | Callable[[Unit], str]


@dataclass(frozen=True)
class Stage:
    """What a stage computes: units of ``kind`` by ``compute(unit, turnout, raw_root, algo=...)``.

    ``algo`` is the version of its code, part of every key. ``context(turnout_id, settings)``, where given, returns
    (token, value): the token, or what it says of a unit where it is a function, enters the key; the value is passed on
    as ``context=``. ``settings`` are those of the turnout, by part. ``gather(plan, configuration)``,
    where given, makes units of the stage's own from a plan file, else they are the plan's. All three may be named,
    "package.module:function", and are then imported when there is something to compute.
    """

    kind: str
    compute: Callable | str
    algo: str
    context: Callable[[str, Mapping], tuple[Token, object]] | str | None = None
    gather: Callable[[Path, Configuration], Iterable[Planned]] | str | None = None


def named(function: Callable | str) -> Callable:
    """The function that "package.module:name" names; a module of one's own lies in the folder of the run."""
    if callable(function):
        return function
    module, _, name = function.partition(":")
    if module.partition(".")[0] != "turnout" and os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    return getattr(import_module(module), name)


def with_token(planned: Planned, token: Token) -> Planned:
    """The unit as planned, its note with what the stage's context says of it."""
    return replace(planned, note=planned.note + (token if isinstance(token, str) else token(planned.unit)))
