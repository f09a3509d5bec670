"""First on the path of every process of a golden run: fingerprints and the clock of ``turnout`` are constant.

The compilation of kernels uses the real fingerprint, which names the folder of machine code and never a result.
"""

import datetime
import os
import sys
from importlib.machinery import SourceFileLoader
from types import FunctionType

REAL, NOW = datetime.datetime, datetime.datetime(2026, 8, 1, 6, 0)
CODE = "00c0de00c0de00c0"


class _LikeReal(type):
    def __instancecheck__(cls, thing):
        return isinstance(thing, REAL)

    def __subclasscheck__(cls, other):
        return issubclass(other, REAL)


class Pinned(REAL, metaclass=_LikeReal):
    """The class ``datetime`` with a constant clock; its objects are real datetimes."""

    def __new__(cls, *args, **named):
        return REAL(*args, **named)

    @classmethod
    def now(cls, tz=None):
        return NOW if tz is None else NOW.replace(tzinfo=datetime.UTC).astimezone(tz)


def _pinned(real):
    def fingerprint(*modules):
        return real(*modules) if "njit" in sys._getframe(1).f_globals else CODE

    return fingerprint


def _patch(module):
    known = vars(module)
    if known.get("datetime") is REAL:
        module.datetime = Pinned
    own = known.get("fingerprint")
    if isinstance(own, FunctionType) and own.__module__ == module.__name__:
        module.fingerprint = _pinned(own)


_exec_module = SourceFileLoader.exec_module


def exec_module(self, module):
    _exec_module(self, module)
    if module.__name__.partition(".")[0] == "turnout":
        _patch(module)


if "TURNOUT_GOLDEN" in os.environ:
    SourceFileLoader.exec_module = exec_module
