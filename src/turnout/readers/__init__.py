"""Readers of raw files: ``read`` converts a file of any supported format to recordings in SI units."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from os import PathLike

from turnout.errors import ReadError, TurnoutError, installation_error
from turnout.readers.foreign_formats import reject_foreign_format
from turnout.readers.formats import FORMATS, Format, detect_format
from turnout.readers.interpret import convert_records
from turnout.readers.source import COPY_AGAIN, RawFile, RawRecord, Source, load
from turnout.records import LongRecording, RawDescription, ReadResult, Recording

__all__ = ["FORMATS", "names_and_units", "read", "read_unconverted"]

LOG = logging.getLogger("turnout.readers")

MAX_WHOLE_FILE_SIZE = 32 * 2**20  # bytes: a file up to this size is read into memory as a whole, whatever its duration


def read(
    path: PathLike | str,
    root: PathLike | str,
    description: RawDescription,
    max_duration: float | None = None,
    max_whole_file_size: int = MAX_WHOLE_FILE_SIZE,
) -> ReadResult:
    """Recordings of one raw file, in SI units, with the order and signs of channels that the configuration states.

    Parameters
    ----------
    path : path-like
        Relative to ``root``, or absolute inside it.
    root : path-like
        The raw root. No file outside it is opened, not even through a symbolic link.
    description : RawDescription
        Format (or "auto"), channels with units and sensitivities, rate, counts, time zone.
    max_duration : float or None
        Longer records of a large file stay in the file and become a ``LongRecording``; None: all are read. [s]
    max_whole_file_size : int
        A file up to this size is read into memory as a whole. [bytes]

    Returns
    -------
    ReadResult
        Intact records, one ReadError for each damaged one, sha256 of the file's bytes. A long record has been read
        once, to check its channels.

    Raises
    ------
    ReadError
        If the file as a whole cannot be used. The message names file, place, problem and remedy.
    InstallationError
        If a package that reads the format is missing or broken.

    Examples
    --------
    A hammer of 0.23 mV/N that read 1 V saw 4347.8 N.

    >>> import tempfile, numpy as np
    >>> from turnout.records import RawChannel
    >>> hammer = RawChannel("force", "ch0", "force", unit="V", sensitivity=0.23, sensitivity_unit="mV/N")
    >>> with tempfile.TemporaryDirectory() as root:
    ...     np.savez(root + "/A7_1.npz", ch0=np.array([0.0, 1.0, 0.0]), fs=51200.0)
    ...     result = read("A7_1.npz", root, RawDescription(channels=(hammer,), rate=51200.0))
    >>> result.recordings[0].signal("force").round(1)
    array([   0. , 4347.8,    0. ])
    """
    source = load(path, root)
    source = replace(source, lazy=max_duration is not None and source.size > max_whole_file_size)
    before = source.state()
    _reject_one_byte(source)
    _reject_repeated_bytes(source)
    with _as_read_error(source):
        with _collected_warnings(source) as remarks:
            raw = _format_of(source, description).read_raw(source)
        raw = replace(raw, remarks=(*raw.remarks, *remarks))
        digest = source.sha256()
        recordings, errors = convert_records(raw, description, source, max_duration)
    if source.state() != before:
        raise source.error("the file", "it changed while it was read", "Start again when its copying has ended")
    long_recordings = tuple(r for r in recordings if isinstance(r, LongRecording))
    recordings_in_memory = tuple(r for r in recordings if isinstance(r, Recording))
    return ReadResult(recordings=recordings_in_memory, errors=errors, sha256=digest, long_recordings=long_recordings)


def read_unconverted(
    path: PathLike | str, root: PathLike | str, format: str = "auto", is_lazy: bool = False
) -> tuple[Source, str, RawFile]:
    """The records of a raw file as they are in it, without any layout.

    Parameters
    ----------
    path, root : path-like
        As for ``read``.
    format : str
        A key of ``FORMATS``, or "auto".
    is_lazy : bool
        Leave long columns in the file, where the format allows it, until they are sliced.

    Returns
    -------
    tuple of (Source, str, RawFile)
        The file, the key of its format in ``FORMATS``, and its records.

    Raises
    ------
    ReadError
        If the file as a whole cannot be read.
    """
    source = replace(load(path, root), lazy=is_lazy)
    _reject_one_byte(source)
    with _as_read_error(source):
        file_format = _format_of(source, RawDescription((), format=format))
        with _collected_warnings(source) as remarks:
            raw = file_format.read_raw(source)
    raw = replace(raw, remarks=(*raw.remarks, *remarks))
    return source, next(name for name, entry in FORMATS.items() if entry is file_format), raw


def names_and_units(path: PathLike | str, root: PathLike | str, format: str = "auto") -> tuple[tuple[str, str], ...]:
    """Name and unit of every channel of a raw file, as the file states them in its first intact record.

    Parameters
    ----------
    path, root : path-like
        As for ``read``.
    format : str
        A key of ``FORMATS``, or "auto".

    Returns
    -------
    tuple of (str, str)
        The unit is "" where the file states none.

    Raises
    ------
    ReadError
        If the file cannot be read, or holds no intact record.
    """
    source, _, raw = read_unconverted(path, root, format)
    records = raw.records
    for record in records:
        if isinstance(record, RawRecord):
            return tuple(zip(record.names, record.units))
    damaged = [record for record in records if isinstance(record, ReadError)]
    raise damaged[0] if damaged else source.error("the file", "it holds no record", COPY_AGAIN, reason="empty")


@contextmanager
def _as_read_error(source: Source) -> Iterator[None]:
    """Turn any unexpected exception of a reader into a ReadError of this file; ``-v`` shows its traceback.

    A fault of the machine or of the installation says nothing about the file: it is raised, the latter as an
    InstallationError.
    """
    try:
        yield
    except TurnoutError:
        raise
    except Exception as error:
        if fault := installation_error(error):
            raise fault from error
        if isinstance(error, MemoryError | OSError):
            raise
        if isinstance(error.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        LOG.info("%s: not foreseen by the reader", source.name, exc_info=True)
        problem = f"it cannot be read ({type(error).__name__}: {' '.join(str(error).split())[:200]})"
        raise source.error("the file", problem) from error


def _reject_one_byte(source: Source) -> None:
    """ReadError if all bytes of the file are the same, as zeros where a file was created and nothing was written."""
    value = source.head[:1]
    if source.head != value * len(source.head):
        return
    data = source.memory_map if source.lazy else source.data
    if all(data[k : k + 2**20] == value * len(data[k : k + 2**20]) for k in range(0, len(data), 2**20)):
        problem = f"all of its {source.size} bytes are 0x{value[0]:02X}: nothing was written to it"
        raise source.error("byte 0", problem, COPY_AGAIN, reason="empty")


MAX_REPEATS = 4  # copies of a file in itself that are looked for


def _reject_repeated_bytes(source: Source) -> None:
    """ReadError if the file is a smaller one two to four times in a row: it was appended to itself."""
    if not source.head.strip():
        return
    for n in range(2, MAX_REPEATS + 1):
        part = source.size // n
        if part * n != source.size or part < MIN_REPEATED_SIZE or not _is_beginning(source, part):
            continue
        data = source.memory_map if source.lazy else source.data
        first = data[:part]
        if all(data[k * part : (k + 1) * part] == first for k in range(1, n)):
            problem = f"its first {part} bytes are in it {n} times: it was appended to itself"
            remedy = f"{COPY_AGAIN}; one copy holds all recordings"
            raise source.error(f"byte {part}", problem, remedy, reason="duplicate")


def _is_beginning(source: Source, part: int) -> bool:
    """Whether the bytes from ``part`` on equal the first bytes of the file."""
    n = min(part, len(source.head))
    if part + 16 <= len(source.head) and source.head[part : part + 16] != source.head[:16]:
        return False
    with source.path.open("rb", buffering=0) as file:
        file.seek(part)
        return file.read(n) == source.head[:n]


MIN_REPEATED_SIZE = 64  # bytes: shorter repetitions are no files


# Warnings about the code that calls a library, not about the file.
CODE_WARNINGS = (DeprecationWarning, PendingDeprecationWarning, FutureWarning, ImportWarning, ResourceWarning)
LOGGING_LIBRARIES = ("nptdms", "h5py", "pymatreader")
# Beginnings of warnings about what the readers check and report themselves.
CHECKED_WARNINGS = ("Unsupported scale type", "Last segment")
MAX_WARNINGS = 3  # different warnings about one file that are passed on


class _WarningCollector(logging.Handler):
    """Keeps the texts of the warnings that a library writes to its log."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the text of one entry of the log.

        Parameters
        ----------
        record : logging.LogRecord
            The entry.
        """
        self.texts.append(record.getMessage())


@contextmanager
def _collected_warnings(source: Source) -> Iterator[list[ReadError]]:
    """Context in which the warnings of the libraries become remarks about the file; they are complete at its end."""
    remarks: list[ReadError] = []
    collector = _WarningCollector()
    logs = [logging.getLogger(name) for name in LOGGING_LIBRARIES]
    for log in logs:
        log.addHandler(collector)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield remarks
    finally:
        for log in logs:
            log.removeHandler(collector)
    texts = collector.texts + [str(w.message) for w in caught if not issubclass(w.category, CODE_WARNINGS)]
    remedy = "Compare the recording with what the logger's own program shows"
    texts = [" ".join(text.split())[:200] for text in texts if not text.startswith(CHECKED_WARNINGS)]
    for text in list(dict.fromkeys(texts))[:MAX_WARNINGS]:
        problem = f"the library that reads it warns: {text}"
        remarks.append(source.error("the file", problem, remedy, reason="library_warning"))


def _format_of(source: Source, description: RawDescription) -> Format:
    reject_foreign_format(source)
    if description.format == "auto":
        return detect_format(source)
    if description.format not in FORMATS:
        names = ", ".join(FORMATS)
        raise source.error("the layout", f"the format {description.format!r} is not known", f"Use one of {names}")
    return FORMATS[description.format]
