"""Raw files of ten kinds -> ``Recording`` in SI units, or a reason why not."""

from turnout.readers.description import describe
from turnout.readers.formats import FORMATS, detect
from turnout.readers.places import load
from turnout.records import RawDescription, ReadResult

__all__ = ["FORMATS", "read"]


def read(path, root, description: RawDescription) -> ReadResult:
    """Recordings of one raw file, in SI units, in the order and with the signs that the configuration promises.

    Parameters
    ----------
    path : path-like
        Relative to ``root``, or absolute inside it.
    root : path-like
        The raw root: nothing outside it is opened, symbolic links included.
    description : RawDescription
        Format (or "auto"), channel map with units and sensitivities, rate, counts, time zone.

    Returns
    -------
    ReadResult
        Sound records, one ReadError for each damaged one, sha256 of the file's bytes.

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
    before = _state(source)
    raw = _format(source, description).read_raw(source)
    digest = source.sha256()
    if _state(source) != before:
        raise source.error("the file", "it changed while it was read", "Start again when its copying has ended")
    recordings, errors = describe(raw, description, source)
    return ReadResult(recordings=recordings, errors=errors, sha256=digest)


def _state(source):
    """Size and time of change; None where the file is gone."""
    try:
        status = source.path.stat()
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns


def _format(source, description):
    if description.format == "auto":
        return detect(source)
    if description.format not in FORMATS:
        known = ", ".join(FORMATS)
        raise source.error("the layout", f"the format {description.format!r} is not known", f"Use one of {known}")
    return FORMATS[description.format]
