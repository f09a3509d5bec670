"""Input and output of the readers: the ``Source`` of a raw file, and its records as they are in the file."""

from __future__ import annotations

import gzip
import hashlib
import math
import mmap
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from turnout.content import sha256_of
from turnout.errors import ReadError, TurnoutError, installation_error, is_infrastructure, reason_of_access
from turnout.files import sparse_size, special_kind
from turnout.records import EMPTY_MAPPING

if TYPE_CHECKING:
    from turnout.readers.entries import Entry, UnreadObject
    from turnout.readers.lazy import LazyColumn

GZIP_HEAD = b"\x1f\x8b"  # first bytes of a gzipped file
COPY_AGAIN = "Copy the file again from the logger"
SYSTEM_ERROR = re.compile(r"errno = (\d{1,9})\b")
BLOCK_SIZE = 2**18  # samples of each channel that are read or checked at a time: long records need little memory
MIN_SAMPLES = 2  # fewest samples of a record: one sample has neither rate nor spread
MAX_COMPRESSION_RATIO = 1032  # largest ratio of unpacked to packed bytes: the bound of deflate
# Labels that loggers write for a unit that was not configured; in lower case.
MEANINGLESS_UNITS = ("", "-", "eu", "none", "n/a", "a.u.", "arb", "?", "unknown", "undefined", "unitless")
# Metadata that any format may store with the samples; they become Recording.conditions.
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

# What the simulator states beside them in the files that it writes. It says nothing about the samples.
SIMULATED_CONDITIONS = ("axle_loads", "load_share", "n_units")


def number_or_text(text: str) -> float | str:
    """A condition as a float if it is a number, else as text.

    Parameters
    ----------
    text : str
        Value as it is written in the file.

    Returns
    -------
    float or str
        The number, or the same text.

    Examples
    --------
    >>> number_or_text("12.5"), number_or_text("main")
    (12.5, 'main')
    """
    try:
        return float(text)
    except ValueError:
        return text


@dataclass(frozen=True)
class Source:
    """One raw file: path, name in messages, size and first bytes. ``data`` is read on first access.

    Readers whose library opens the path do not use ``data``: allocating a large block costs as much as reading it.
    With ``lazy``, readers whose format allows it return ``LazyColumn`` in place of arrays and use ``memory_map``.
    """

    path: Path
    name: str
    size: int
    head: bytes
    lazy: bool = False

    @cached_property
    def data(self) -> bytes:
        """All bytes of the file."""
        return self.path.read_bytes()

    def unpacked_data(self) -> bytes:
        """All bytes of the file; of a gzipped one those that it contains.

        Returns
        -------
        bytes

        Raises
        ------
        ReadError
            If a gzipped file is damaged.
        """
        if not self.data.startswith(GZIP_HEAD):
            return self.data
        with self.parsed_by("gzip"):
            return gzip.decompress(self.data)

    @cached_property
    def memory_map(self) -> mmap.mmap:
        """The bytes of the file, mapped into memory and loaded on access."""
        with self.path.open("rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)

    def state(self) -> tuple[int, int] | None:
        """Size and modification time; None if the file is gone."""
        try:
            status = self.path.stat()
        except OSError:
            return None
        return status.st_size, status.st_mtime_ns

    def sha256(self) -> str:
        """sha256 of the file's bytes, in hexadecimal."""
        if "data" in self.__dict__:
            return hashlib.sha256(self.data).hexdigest()
        return sha256_of(self.path)

    def error(self, where: str, problem: str, remedy: str = COPY_AGAIN, reason: str = "unreadable") -> ReadError:
        """The ReadError of this file at ``where``.

        Parameters
        ----------
        where : str
            Position in the file: record, channel, byte or line.
        problem : str
            What is wrong there.
        remedy : str
            What to do, a sentence without its full stop.
        reason : str
            A key of ``turnout.reasons.REASONS``.

        Returns
        -------
        ReadError
            The error; it is returned, not raised.
        """
        return ReadError(self.name, where, problem, remedy, reason=reason)

    @contextmanager
    def parsed_by(self, library: str, where: str = "the file", reason: str = "unreadable") -> Iterator[None]:
        """Context of a call of ``library``: any exception it raises on damaged bytes becomes a ReadError.

        A fault of the machine is no damage and is raised unchanged; one of the installation as InstallationError.

        Parameters
        ----------
        library : str
            Name of the library, for the message.
        where : str
            Position in the file that the call reads.
        reason : str
            A key of ``turnout.reasons.REASONS`` for damaged bytes.

        Raises
        ------
        ReadError
            If the call raises an exception that is no fault of the machine.
        InstallationError
            If a package is missing or broken.
        KeyboardInterrupt
            If the library turned one into an exception of its own.
        """
        try:
            yield
        except TurnoutError:
            raise
        except Exception as error:
            if absent := installation_error(error):
                raise absent from error
            if isinstance(error.__context__, KeyboardInterrupt):  # the library made an exception of its own of it
                raise KeyboardInterrupt from error
            message = " ".join(str(error).split())[:200]
            if not re.search(r"[^\W\d]", message):  # a number alone, the key of a KeyError
                message = f"{type(error).__name__} {message}".strip()
            fault = (
                None
                if _requests_more_memory_than(MAX_COMPRESSION_RATIO * self.size, error)
                else _infrastructure_error(error)
            )
            if fault is error:
                raise
            if fault:
                raise fault from error
            raise self.error(where, f"{library} cannot read it ({message})", reason=reason) from error


def _infrastructure_error(error: Exception) -> Exception | None:
    """``error`` if it is a fault of the machine, an OSError if the text of an HDF5 error states one, else None."""
    if is_infrastructure(error):
        return error
    match = SYSTEM_ERROR.search(str(error))
    fault = OSError(int(match[1]), str(error)) if match else None
    return fault if fault and is_infrastructure(fault) else None


def _requests_more_memory_than(n_byte: float, error: Exception) -> bool:
    """Whether numpy failed to allocate an array of more bytes: such a length comes from damaged bytes."""
    shape, dtype = getattr(error, "shape", None), getattr(error, "dtype", None)
    return shape is not None and dtype is not None and math.prod(shape) * dtype.itemsize > n_byte


@dataclass(frozen=True)
class RawRecord:
    """One record of simultaneous samples, as it is in the file.

    ``samples`` holds one (n_sample,) array or ``LazyColumn`` per name, in ``units`` ("" if not stated).
    ``entries`` are all metadata of the record with their places: ``turnout.readers.rate_statements`` finds the sampling
    rate in them. ``started_at`` has a time zone only if the format states one; ``unread_start`` is a start time that
    cannot be read, as it is written, ``unread_zone`` a time zone of it. ``time`` is the time column of the file, in
    seconds unless ``is_time_in_seconds`` is False: then its unit is not stated; ``time_label`` is its name, with the
    unit as it is written. ``clocks`` are further time axes (place, seconds). ``axis_starts`` are the times at which
    axes of time stamps begin, or the text of one that cannot be read. ``aliases`` are further names of the channels.
    ``counters`` are whole numbers that are no channels, one for each sample, by name: equal texts have equal numbers.
    ``states`` are the different words of each column of words of a text file, by name, the rarest first.
    ``marked_numbers`` are cells with a mark that may be one for thousands, by the index of the channel.
    ``undecided`` are statements about the scale of channels, by index, of which nothing says whether it is applied;
    ``unit_conflicts`` are statements about units of channels that contradict each other, by index. ``not_numbers`` are
    variables that are no channels, name -> what they hold, for messages about missing channels. ``audio`` is "whole"
    for an audio file of whole numbers, which are fractions of full scale, "floating" for one of floating-point numbers,
    which may be none, and "" for any other file. ``other_axes`` are channels that are not sampled over the time, by
    name, and why. ``unknown_step`` is a unit that is not known, of a step that the entries state in s.
    ``undecided_axes`` are arrays of three dimensions of which nothing states the order of the axes, by name, and how
    they are read.
    """

    names: tuple[str, ...]
    samples: Sequence[np.ndarray | LazyColumn]
    units: tuple[str, ...] = ()
    entries: tuple[Entry, ...] = ()
    started_at: datetime | None = None
    unread_start: str = ""
    unread_zone: str = ""
    conditions: Mapping = field(default_factory=lambda: EMPTY_MAPPING)
    time: np.ndarray | None = None
    time_label: str = ""
    is_time_in_seconds: bool = False
    axis_starts: tuple[tuple[datetime | None, str], ...] = ()
    clocks: tuple[tuple[str, np.ndarray], ...] = ()
    aliases: tuple[tuple[str, ...], ...] = ()
    marked_numbers: Mapping[int, str] = field(default_factory=lambda: EMPTY_MAPPING)
    counters: Mapping[str, np.ndarray] = field(default_factory=lambda: EMPTY_MAPPING)
    states: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: EMPTY_MAPPING)
    undecided: Mapping[int, str] = field(default_factory=lambda: EMPTY_MAPPING)
    unit_conflicts: Mapping[int, str] = field(default_factory=lambda: EMPTY_MAPPING)
    audio: str = ""
    not_numbers: Mapping[str, str | UnreadObject] = field(default_factory=lambda: EMPTY_MAPPING)
    other_axes: Mapping[str, str] = field(default_factory=lambda: EMPTY_MAPPING)
    unknown_step: str = ""
    undecided_axes: Mapping[str, str] = field(default_factory=lambda: EMPTY_MAPPING)

    def __post_init__(self) -> None:
        object.__setattr__(self, "units", tuple(self.units) or ("",) * len(self.names))
        if not len(self.names) == len(self.samples) == len(self.units):
            raise ValueError(f"{len(self.names)} names, {len(self.samples)} channels, {len(self.units)} units")

    def row_of(self, channel: str | int) -> int | None:
        """Row of the channel with a name, a further name or a number of the layout.

        Parameters
        ----------
        channel : str or int
            Source of a channel of the layout.

        Returns
        -------
        int or None
            The first such row, by a further name only where no channel has it as its name; None if the record does not
            have the channel.
        """
        rows = [i for i, name in enumerate(self.names) if channel in (i, name)]
        rows += [i for i, aliases in enumerate(self.aliases) if channel in aliases]
        return rows[0] if rows else None


@dataclass(frozen=True)
class RawFile:
    """All records of a file in their order; a damaged record is its ReadError.

    ``expected`` is the number of records that the file itself states, or None. ``remarks`` are reported although the
    records are used.
    """

    records: tuple[RawRecord | ReadError, ...]
    expected: int | None = None
    remarks: tuple[ReadError, ...] = ()


HEAD_SIZE = 4096  # bytes, enough for every signature


def load(path: PathLike | str, root: PathLike | str) -> Source:
    """The raw file at ``path``, of which only the first bytes are read.

    Parameters
    ----------
    path : path-like
        Relative to ``root``, or absolute inside it.
    root : path-like
        The raw root. A symbolic link that leads out of it is an error.

    Returns
    -------
    Source
        Path, name, size and first bytes of the file.

    Raises
    ------
    ReadError
        If the file is outside the raw root, absent, empty or cannot be opened.
    OSError
        For a fault of the machine.
    """
    root = Path(root)
    remedy = "Put the file under the raw root or correct the turnout's pattern"
    try:
        base = root.resolve()
        resolved = (base / Path(path)).resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise ReadError(path, "the path", f"it cannot be followed ({error})", remedy, reason="outside_root") from error
    name = _name(path, root, base)
    if not resolved.is_relative_to(base):
        raise ReadError(name, "the path", "it leads outside the raw root", remedy, reason="outside_root")
    try:
        status = resolved.stat()
        if kind := special_kind(status.st_mode):
            raise ReadError(name, "the path", f"it is a {kind}", "Put a file there, or remove it", reason="no_file")
        if (on_disk := sparse_size(resolved, status)) >= 0:
            problem = f"it has a size of {status.st_size} bytes, of which {on_disk} are on the disk"
            raise ReadError(name, "the file", problem, COPY_AGAIN, reason="claims_too_much")
        with resolved.open("rb") as file:
            head, size = file.read(HEAD_SIZE), os.fstat(file.fileno()).st_size
    except (FileNotFoundError, NotADirectoryError) as error:
        vanished_remedy = "Correct the path, or wait until the disk that holds the file is mounted again"
        raise ReadError(name, "the path", "there is no such file", vanished_remedy, reason="vanished") from error
    except OSError as error:
        if is_infrastructure(error) and not isinstance(error, PermissionError):
            raise
        problem = f"the file cannot be opened ({error.strerror})"
        remedy = "Correct its permissions or copy it again"
        raise ReadError(name, "the path", problem, remedy, reason_of_access(error)) from error
    if not size:
        raise ReadError(name, "byte 0", "the file has no bytes", COPY_AGAIN, reason="empty")
    return Source(resolved, name, size, head)


def _name(path: PathLike | str, root: Path, base: Path) -> str:
    """The path relative to the raw root if it lies inside, with forward slashes."""
    path = Path(path)
    for start in (root, base):
        if path.is_absolute() and path.is_relative_to(start):
            return path.relative_to(start).as_posix()
    return path.as_posix()
