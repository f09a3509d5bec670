"""What a reader of one format hands over: the numbers as they stand in the file, nothing converted.

From a path to a file that lies inside the raw root and can be opened.
"""

import hashlib
import math
import mmap
import os
import re
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from pathlib import Path

import numpy as np

from turnout.content import sha256_of
from turnout.errors import ReadError, TurnoutError, of_the_machine
from turnout.records import NOTHING

COPY_AGAIN = "Copy the file again from the logger"
SYSTEM_ERROR = re.compile(r"errno = (\d{1,9})\b")
MOST = 1032  # bytes that one of a file can become: deflate's bound
# What may stand beside the samples in any format, and reaches Recording.conditions.
CONDITIONS = (
    "rail_temperature",
    "air_temperature",
    "train_type",
    "train_id",
    "speed",
    "track",
    "direction",
    "hammer_id",
    "tip",
    "operator",
)


def number_or_text(text: str) -> float | str:
    """A condition as a float where it is one, else as it stands.

    >>> number_or_text("12.5"), number_or_text("main")
    (12.5, 'main')
    """
    try:
        return float(text)
    except ValueError:
        return text


@dataclass(frozen=True)
class Source:
    """One file: where it lies, the name that messages use, its size and first bytes. ``data`` is read when asked for.

    Formats whose library reads from the path leave ``data`` alone: a large block of fresh memory costs as much as the
    reading. Where samples may ``stay`` in the file, a reader whose format allows it hands over ``Column``s in place of
    arrays, and goes by ``mapped``.
    """

    path: Path
    name: str
    size: int
    head: bytes
    stay: bool = False

    @cached_property
    def data(self) -> bytes:
        """All bytes of the file."""
        return self.path.read_bytes()

    @cached_property
    def mapped(self) -> mmap.mmap:
        """The bytes of the file, none of them in memory before it is looked at."""
        with self.path.open("rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)

    def state(self) -> tuple[int, int] | None:
        """Size and time of change; None where the file is gone."""
        try:
            status = self.path.stat()
        except OSError:
            return None
        return status.st_size, status.st_mtime_ns

    def sha256(self) -> str:
        """Of the file's bytes, in hexadecimal."""
        if "data" in self.__dict__:
            return hashlib.sha256(self.data).hexdigest()
        return sha256_of(self.path)

    def error(self, where, found, remedy=COPY_AGAIN, reason="unreadable") -> ReadError:
        """The ReadError of this file at ``where``."""
        return ReadError(self.name, where, found, remedy, reason=reason)

    @contextmanager
    def parsed_by(self, library, where="the file", reason="unreadable"):
        """Turn whatever ``library`` raises on damaged bytes into a ReadError; for the library's call alone.

        A fault of the machine is no damage, and goes on as it is.
        """
        try:
            yield
        except TurnoutError:
            raise
        except Exception as error:
            said = " ".join(str(error).split())[:200] or type(error).__name__
            fault = None if _asks_for_more_than(MOST * self.size, error) else _fault_of_the_machine(error)
            if fault is error:
                raise
            if fault:
                raise fault from error
            raise self.error(where, f"{library} cannot read it ({said})", reason=reason) from error


def _fault_of_the_machine(error):
    """``error`` where the machine is at fault, an OSError where HDF5 says so in the text of another; else None."""
    if of_the_machine(error):
        return error
    told = SYSTEM_ERROR.search(str(error))
    fault = OSError(int(told[1]), str(error)) if told else None
    return fault if fault and of_the_machine(fault) else None


def _asks_for_more_than(n_byte, error):
    """Whether numpy had no memory for an array of more bytes: that is the length which damaged bytes make up."""
    shape, dtype = getattr(error, "shape", None), getattr(error, "dtype", None)
    return shape is not None and dtype is not None and math.prod(shape) * dtype.itemsize > n_byte


@dataclass(frozen=True)
class RawRecord:
    """One stretch of simultaneous samples, as it stands in the file.

    ``samples`` holds one (n_sample,) array or ``Column`` per name, in ``units`` ("" where the file does not say).
    ``rate`` [Hz] is None where the file does not say; ``rate_tolerance`` is the relative precision with which
    its format can state it. ``started_at`` is aware where the format says the zone, naive where it does not.
    ``time`` [s] is the file's own time column, ``aliases`` are further names by which a channel may be asked for,
    ``unclear`` are lines that name a frequency [Hz] in words that nobody understood.
    """

    names: tuple[str, ...]
    samples: Sequence
    rate: float | None = None
    units: tuple[str, ...] = ()
    rate_tolerance: float = 1e-9
    started_at: datetime | None = None
    conditions: Mapping = field(default_factory=lambda: NOTHING)
    time: np.ndarray | None = None
    aliases: tuple[tuple[str, ...], ...] = ()
    unclear: tuple[tuple[str, float], ...] = ()

    def __post_init__(self):
        object.__setattr__(self, "units", tuple(self.units) or ("",) * len(self.names))
        if not len(self.names) == len(self.samples) == len(self.units):
            raise ValueError(f"{len(self.names)} names, {len(self.samples)} channels, {len(self.units)} units")


@dataclass(frozen=True)
class RawFile:
    """All records of a file in their order, a damaged one as its ReadError.

    ``expected`` is how many the file itself promises, None where it does not say.
    """

    records: tuple[RawRecord | ReadError, ...]
    expected: int | None = None


HEAD = 4096  # bytes, enough for every signature


def load(path, root) -> Source:
    """The file at ``path`` (relative to ``root``, or absolute inside it); ReadError says why not.

    A symbolic link counts by what it points to: one that leads out of the raw root is refused.
    """
    root = Path(root)
    inside = "Put the file under the raw root or correct the turnout's pattern"
    try:
        base = root.resolve()
        resolved = (base / Path(path)).resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise ReadError(path, "the path", f"it cannot be followed ({error})", inside, reason="outside_root") from error
    name = _name(path, root, base)
    if not resolved.is_relative_to(base):
        raise ReadError(name, "the path", "it leads outside the raw root", inside, reason="outside_root")
    try:
        with resolved.open("rb") as file:
            head, size = file.read(HEAD), os.fstat(file.fileno()).st_size
    except (FileNotFoundError, NotADirectoryError) as error:
        again = "Correct the path; if it was there before, start again when it is back, or plan anew without it"
        raise ReadError(name, "the path", "there is no such file", again, reason="vanished") from error
    except OSError as error:
        if of_the_machine(error) and not isinstance(error, PermissionError):
            raise
        found = f"the file cannot be opened ({error.strerror})"
        raise ReadError(name, "the path", found, "Correct its permissions or copy it again") from error
    if not size:
        raise ReadError(name, "byte 0", "the file has no bytes", "Copy the file again from the logger", reason="empty")
    return Source(resolved, name, size, head)


def _name(path, root, base):
    """The path relative to the raw root where it has one, with forward slashes."""
    path = Path(path)
    for start in (root, base):
        if path.is_absolute() and path.is_relative_to(start):
            return path.relative_to(start).as_posix()
    return path.as_posix()
