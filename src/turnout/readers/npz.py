"""Reader of NumPy archives (.npz): named arrays as in ``turnout.readers.named_arrays``, each with a CRC-32."""

import numpy as np

from turnout.errors import ReadError
from turnout.readers.declared_sizes import PYTHON_OBJECTS, read_array
from turnout.readers.entries import UnreadObject
from turnout.readers.metadata_names import CHANNEL_NAMES
from turnout.readers.named_arrays import raw_file
from turnout.readers.rate_vocabulary import is_rate_name
from turnout.readers.scale_vocabulary import is_scale_name
from turnout.readers.source import RawFile, Source
from turnout.readers.unit_names import is_unit_name


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
    variables: dict[str, np.ndarray | bytes | UnreadObject | ReadError] = {}
    with source.parsed_by("numpy"), np.load(source.path, allow_pickle=False) as archive:
        for name in archive.files:
            try:
                with source.parsed_by("numpy", f"variable {name!r}"):
                    variables[name] = read_array(archive.zip, name, source)
                if variables[name] is PYTHON_OBJECTS and _is_about_samples(name):
                    problem = "it holds objects of Python, which are not loaded"
                    raise source.error(f"variable {name!r}", problem, "Save it as numbers or as text")
            except ReadError as error:
                variables[name] = error
    return raw_file(variables, source)


def _is_about_samples(name: str) -> bool:
    """Whether a variable of this name holds names, units, a rate or a scale of the channels."""
    return name.lower() in CHANNEL_NAMES or is_unit_name(name) or is_rate_name(name) or is_scale_name(name)
