"""Seeded mutations of raw files of every format, and a comparison of what is read from them with the intact file.

A mutation changes, removes, inserts or moves some bytes of a file. Headers are mutated more often than samples: the
first and the last kilobytes get most of the mutations. What is read from the mutated file is compared with what was
written. A difference that no error reports is silent. It counts only outside the damaged bytes: no reader can know that
another digit stood in a number, unless a checksum protects it.
"""

import contextlib
import logging
import signal
import struct
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from turnout.errors import TurnoutError
from turnout.readers import read
from turnout.readers.writing import WRITERS, write
from turnout.records import Channel, RawChannel, RawDescription, ReadResult, Recording

FORMATS = tuple(WRITERS)
RATE = 51200.0
N_RECORD, N_SAMPLE = 4, 64
HEADER_SIZE = 3000  # bytes at both ends of a file that count as its header
HEADER_SHARE = 0.75  # of all mutations
MAX_CPU_TIME = 10.0  # s for one file: more is a hang
CHANNELS = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
OUTCOMES = ("same", "reported", "damaged samples", "damaged value", "metadata", "samples", "crash", "hang")


@dataclass(frozen=True)
class Mutation:
    """A mutated file: its bytes, the kind of the mutation, and the damaged bytes [start, stop) of the intact file."""

    data: bytes
    kind: str
    start: int
    stop: int


@dataclass(frozen=True)
class Case:
    """What was read from one mutated file: an entry of ``OUTCOMES``, with the difference in words."""

    format: str
    seed: int
    kind: str
    outcome: str
    note: str = ""


def intact_recordings(format: str) -> list[Recording]:
    """Records of two channels with start times and conditions.

    Parameters
    ----------
    format : str
        A WAV file holds one record, any other four.

    Returns
    -------
    list of Recording
        In SI units.
    """
    rng = np.random.default_rng(7)
    channels = (Channel("force", "force"), Channel("rail", "acceleration"))
    return [
        Recording(
            rng.normal(size=(2, N_SAMPLE)) * [[2000.0], [30.0]],
            RATE,
            channels,
            started_at=datetime(2024, 5, 13, 10, 3 * k + 1, 17, 250_000),
            conditions={"rail_temperature": 12.5, "train_type": "IC4"},
        )
        for k in range(1 if format == "wav" else N_RECORD)
    ]


def mutated(data: bytes, rng: np.random.Generator) -> Mutation:
    """A file with one mutation.

    Parameters
    ----------
    data : bytes
        The intact file.
    rng : numpy.random.Generator
        Chooses kind and position.

    Returns
    -------
    Mutation
        Its bytes differ from ``data``.
    """
    while True:
        mutation = _mutated(data, rng)
        if mutation.data != data:
            return mutation


def _mutated(data: bytes, rng: np.random.Generator) -> Mutation:
    size = len(data)
    start = int(rng.integers(size))
    if rng.random() < HEADER_SHARE:
        start = int(rng.integers(min(HEADER_SIZE, size)))
        start = size - 1 - start if rng.random() < 0.2 else start
    kind = KINDS[int(rng.integers(len(KINDS)))]
    length = int(rng.integers(1, 17))
    stop = min(start + length, size)
    run = data[start:stop]
    match kind:
        case "bit":
            stop = start + 1
            new = bytes([data[start] ^ (1 << int(rng.integers(8)))])
        case "byte":
            stop = start + 1
            new = bytes([int(rng.integers(256))])
        case "printable":
            stop = start + 1
            new = bytes([int(rng.integers(32, 127))])
        case "zeros":
            new = bytes(len(run))
        case "random":
            new = rng.bytes(len(run))
        case "removed":
            new = b""
        case "inserted":
            stop, new = start, rng.bytes(length)
        case "twice":
            new = run + run
        case "truncated":
            stop, new = size, b""
        case _:  # a line or a run of bytes changes place with the next
            middle = stop
            stop = min(stop + len(run), size)
            new = data[middle:stop] + run
    return Mutation(data[:start] + new + data[stop:], kind, start, max(stop, start + 1))


KINDS = ("bit", "byte", "printable", "zeros", "random", "removed", "inserted", "twice", "truncated", "exchanged")


def cases(n_file: int, first_seed: int = 0, formats: tuple[str, ...] = FORMATS) -> Iterator[Case]:
    """Read ``n_file`` mutated files, in turn of each format.

    Parameters
    ----------
    n_file : int
        Number of files.
    first_seed : int
        Each file has a seed of its own, counted from here.
    formats : tuple of str
        Keys of ``WRITERS``.

    Yields
    ------
    Case
        What was read.
    """
    logging.getLogger("turnout.readers").setLevel(logging.CRITICAL)
    with tempfile.TemporaryDirectory() as folder:
        intact = {}
        for format in formats:
            path = write(intact_recordings(format), Path(folder) / f"intact.{format}", format)
            layout = RawDescription(CHANNELS, format=format)
            intact[format] = path.read_bytes(), read(path.name, folder, layout)
        for k in range(n_file):
            seed = first_seed + k
            format = formats[seed % len(formats)]
            yield _case(format, seed, *intact[format], folder)


def _case(format: str, seed: int, data: bytes, expected: ReadResult, folder: str) -> Case:
    rng = np.random.default_rng(seed)
    mutation = mutated(data, rng)
    layout = RawDescription(CHANNELS, format=format)
    if rng.random() < 0.5:
        layout = replace(layout, rate=RATE, n_records=len(expected.recordings), n_samples=N_SAMPLE)
    path = Path(folder) / f"mutated.{format}"
    path.write_bytes(mutation.data)
    try:
        with _time_limit(MAX_CPU_TIME):
            result = read(path.name, folder, layout)
    except TurnoutError:
        return Case(format, seed, mutation.kind, "reported")
    except _Hang:
        return Case(format, seed, mutation.kind, "hang")
    except Exception as error:
        return Case(format, seed, mutation.kind, "crash", f"{type(error).__name__}: {error}")
    return Case(format, seed, mutation.kind, *_difference(result, expected, mutation, data))


class _Hang(BaseException):
    pass


@contextlib.contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    """Context that raises ``_Hang`` after some seconds of CPU time."""

    def stop(*_: object) -> None:
        raise _Hang

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def _difference(result: ReadResult, expected: ReadResult, mutation: Mutation, data: bytes) -> tuple[str, str]:
    """(outcome, note) of a file that was read: the worst difference from the intact file."""
    if result.errors:
        return "reported", ""
    if len(result.recordings) != len(expected.recordings):
        return "samples", f"{len(result.recordings)} records"
    found = {"same": ""}
    for k, (a, b) in enumerate(zip(result.recordings, expected.recordings)):
        if a.samples.shape != b.samples.shape or a.channels != b.channels:
            return "samples", f"record {k + 1}: shape {a.samples.shape} or channels differ"
        n_other = int(np.count_nonzero(a.samples != b.samples))
        if n_other > 2 + (mutation.stop - mutation.start) // 2:
            return "samples", f"record {k + 1}: {n_other} samples differ"
        if n_other:
            found["damaged samples"] = f"record {k + 1}: {n_other} samples"
        for name, new, old in _metadata(a, b):
            if not np.array_equal(np.asarray(new, dtype=object), np.asarray(old, dtype=object)):
                is_inside = _is_damaged(old, new, mutation, data)
                found["damaged value" if is_inside else "metadata"] = f"record {k + 1}: {name} {new!r}, was {old!r}"
    outcome = max(found, key=OUTCOMES.index)
    return outcome, found[outcome]


def _metadata(a: Recording, b: Recording) -> Iterator[tuple[str, object, object]]:
    yield "rate", a.rate, b.rate
    yield "start", a.started_at, b.started_at
    for name in sorted({*a.conditions, *b.conditions}):
        yield name, a.conditions.get(name), b.conditions.get(name)


def _is_damaged(old: object, new: object, mutation: Mutation, data: bytes) -> bool:
    """Whether the mutation is in bytes that encode the value itself, and another value of its kind was read."""
    if old is None or new is None:
        return False
    if isinstance(old, str) and isinstance(new, str) and old in new:
        return True  # blanks behind the text are its field, too
    for code in _encodings(old):
        position = data.find(code)
        while position >= 0:
            if position - 1 <= mutation.start < position + len(code) or position < mutation.stop <= position + len(
                code
            ):
                return True
            position = data.find(code, position + 1)
    return False


def _encodings(value: object) -> Iterator[bytes]:
    """Bytes that stand for a value in any of the formats."""
    if isinstance(value, str):
        yield from (value.encode(), value.encode("utf-16-le"))
    elif isinstance(value, float):
        for number in (value, 1 / value):
            yield from (struct.pack(code, number) for code in ("<d", ">d", "<f", ">f"))
            yield from (repr(number).encode(), f"{number:g}".encode(), f"{number:.5e}".upper().encode())
        yield struct.pack("<i", round(value))
    elif isinstance(value, datetime):
        seconds = (value - datetime(1904, 1, 1)) // timedelta(seconds=1)
        nanoseconds = (value - datetime(1970, 1, 1)) // timedelta(microseconds=1) * 1000
        yield from (struct.pack("<Q", seconds), struct.pack("<Q", nanoseconds))
        yield struct.pack("<Q", round(value.microsecond * 1e-6 * 2**64))
        yield struct.pack("<d", (value - datetime(1970, 1, 1)).total_seconds())
        for text in (f"{value:%Y-%m-%dT%H:%M:%S.%f}", f"{value:%d-%b-%y %H:%M:%S.%f}", f"{value:%Y/%m/%d}"):
            yield text.encode()
            yield text.upper().encode()
        yield f"{value:%H:%M:%S.%f}".encode()


def counts(found: list[Case]) -> dict[str, Counter]:
    """Number of files per outcome, of each format and of all.

    Parameters
    ----------
    found : list of Case
        Cases.

    Returns
    -------
    dict of str to Counter
        Format, or "all" -> outcome -> number of files.
    """
    table: dict[str, Counter] = {"all": Counter()}
    for case in found:
        table["all"][case.outcome] += 1
        table.setdefault(case.format, Counter())[case.outcome] += 1
    return table
