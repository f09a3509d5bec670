"""Raw files of ten kinds -> ``Recording`` in SI units, or a reason why not."""

import logging
from contextlib import contextmanager
from dataclasses import replace

from turnout.errors import TurnoutError
from turnout.readers.formats import FORMATS, detect, refuse_spreadsheet
from turnout.readers.interpret import describe
from turnout.readers.source import load
from turnout.records import LongRecording, RawDescription, ReadResult, Recording

__all__ = ["FORMATS", "read"]

LOG = logging.getLogger("turnout.readers")

HELD = 32 * 2**20  # bytes: a file up to this size is read whole, whatever its length in time


def read(path, root, description: RawDescription, longest: float | None = None, held: int = HELD) -> ReadResult:
    """Recordings of one raw file, in SI units, in the order and with the signs that the configuration promises.

    Parameters
    ----------
    path : path-like
        Relative to ``root``, or absolute inside it.
    root : path-like
        The raw root: nothing outside it is opened, symbolic links included.
    description : RawDescription
        Format (or "auto"), channel map with units and sensitivities, rate, counts, time zone.
    longest : float or None
        Records of more seconds than this stay in a file of more than ``held`` bytes and come as ``LongRecording``;
        None: every record is read.
    held : int

    Returns
    -------
    ReadResult
        Sound records, one ReadError for each damaged one, sha256 of the file's bytes. A long record has been read
        through once, to know which of its channels are sound.

    Raises
    ------
    ReadError
        Where the file as a whole cannot be used: says file, place, what stands there, what to do.

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
    source = replace(source, stay=longest is not None and source.size > held)
    before = source.state()
    with _named(source):
        raw = _format(source, description).read_raw(source)
        digest = source.sha256()
        recordings, errors = describe(raw, description, source, longest)
    if source.state() != before:
        raise source.error("the file", "it changed while it was read", "Start again when its copying has ended")
    held_back = tuple(r for r in recordings if isinstance(r, LongRecording))
    whole = tuple(r for r in recordings if isinstance(r, Recording))
    return ReadResult(recordings=whole, errors=errors, sha256=digest, long=held_back)


@contextmanager
def _named(source):
    """Whatever a reader did not foresee costs this file alone, and names it; the traceback is in the log."""
    try:
        yield
    except (TurnoutError, MemoryError, OSError):
        raise
    except Exception as error:
        LOG.exception("%s: not foreseen by the reader", source.name)
        found = f"it cannot be read ({type(error).__name__}: {' '.join(str(error).split())[:200]})"
        raise source.error("the file", found) from error


def _format(source, description):
    refuse_spreadsheet(source)
    if description.format == "auto":
        return detect(source)
    if description.format not in FORMATS:
        known = ", ".join(FORMATS)
        raise source.error("the layout", f"the format {description.format!r} is not known", f"Use one of {known}")
    return FORMATS[description.format]
