"""Writers of raw files in every format that ``turnout.readers`` reads, for tests, demonstrations and exchange.

The files are like those of a logger: a ``RawDescription`` gives the units, sensitivities and signs of the numbers, so
that ``read(write(x)) == x``.
"""

from collections.abc import Sequence
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any

from turnout.files import whole_file
from turnout.readers.writing.encode import raw_records
from turnout.records import RawDescription, Recording

WRITERS = {
    "uff58": ("uff", {"binary": False}),
    "uff58b": ("uff", {"binary": True}),
    "tdms": ("tdms", {}),
    "hdf5": ("hdf5", {}),
    "rcmdx": ("rcmdx", {}),
    "mat": ("mat", {}),
    "mat73": ("mat73", {}),
    "wav": ("wav", {}),
    "csv": ("csv", {}),
    "lvm": ("lvm", {}),
    "npz": ("npz", {}),
    "parquet": ("parquet", {}),
}


def write(
    recordings: Sequence[Recording],
    path: PathLike | str,
    format: str,
    description: RawDescription | None = None,
    *,
    single: bool = False,
    **options: Any,
) -> Path:
    """Write recordings (one per record, with the same channels) to ``path`` and return it.

    Parameters
    ----------
    recordings : sequence of Recording
        In SI. A WAV file holds only one.
    path : path-like
        Overwritten if it exists; its folder is created.
    format : str
        A key of ``WRITERS``.
    description : RawDescription or None
        Units, sensitivities, signs and names of the file; None: SI, names of the channels, times in UTC.
    single : bool
        Store the numbers in 4 bytes instead of 8.
    **options
        Options of the writer: ``decimal_comma`` (csv), ``subtype`` and ``full_scale`` (wav), ``station`` (rcmdx).

    Raises
    ------
    ValueError
        For an unknown format, no recordings, or recordings that one file cannot hold.
    OSError
        If the disk fails or is full. No part of the file is left then.
    """
    if format not in WRITERS:
        raise ValueError(f"no writer for the format {format!r}; there are {', '.join(WRITERS)}")
    module, fixed = WRITERS[format]
    records = raw_records(recordings, description, "float32" if single else "float64")
    with whole_file(path) as unfinished:
        import_module(f"turnout.readers.writing.{module}").write_raw(records, unfinished, **fixed, **options)
    return Path(path)
