"""Reader of NumPy archives (.npz): named arrays as in ``turnout.readers.named_arrays``, each with a CRC-32."""

import numpy as np

from turnout.errors import ReadError
from turnout.readers.declared_sizes import read_array
from turnout.readers.named_arrays import raw_file
from turnout.readers.source import RawFile, Source


def read_raw(source: Source) -> RawFile:
    """Records of an archive.

    Parameters
    ----------
    source : Source
        The NumPy archive.

    Returns
    -------
    RawFile
        Its records; a wrong checksum of a member affects only its record.

    Raises
    ------
    ReadError
        If the archive cannot be opened, or its arrays are no records.
    """
    variables: dict[str, np.ndarray | bytes | ReadError] = {}
    with source.parsed_by("numpy"), np.load(source.path, allow_pickle=False) as archive:
        for name in archive.files:
            try:
                with source.parsed_by("numpy", f"variable {name!r}"):
                    variables[name] = read_array(archive.zip, name, source)
            except ReadError as error:
                variables[name] = error
    return raw_file(variables, source)
