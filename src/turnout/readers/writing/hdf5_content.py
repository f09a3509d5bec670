"""HDF5 that is built in memory: on a full disk the library would end the process without a message."""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import h5py


@contextmanager
def hdf5_content(path: Path, **options: Any) -> Iterator[h5py.File]:
    """Context of an HDF5 file, which is written to ``path`` when the context ends.

    Parameters
    ----------
    path : Path
        File to write.
    **options : any
        Options of ``h5py.File``.

    Yields
    ------
    h5py.File
        The file in memory.

    Raises
    ------
    OSError
        If the disk fails or is full.
    """
    content = BytesIO()
    with h5py.File(content, "w", **options) as file:
        yield file
    path.write_bytes(content.getbuffer())
