"""Which variables of a file hold samples, and which are metadata."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from turnout.errors import ReadError
from turnout.readers.entries import MAX_ENTRIES
from turnout.readers.lazy import ARRAYS
from turnout.readers.metadata_names import (
    CHANNEL_NAMES,
    RECORD_COUNT_NAMES,
    START_NAMES,
    TIME_NAMES,
    UNIT_NAMES,
)
from turnout.readers.rate_vocabulary import is_rate_name
from turnout.readers.source import CONDITIONS


def plain_name(name: str) -> str:
    """A name in lower case, except for "T": it is a temperature or any other quantity, and "t" is the time.

    Parameters
    ----------
    name : str
        Name of a variable.

    Returns
    -------
    str
    """
    return name if name == "T" else name.lower()


def underscored_name(name: str) -> str:
    """A name with "_" for blanks and hyphens, as ``metadata_names`` lists names.

    Parameters
    ----------
    name : str
        Name of a variable.

    Returns
    -------
    str

    Examples
    --------
    >>> underscored_name("start time"), underscored_name("start-time")
    ('start_time', 'start_time')
    """
    return re.sub(r"[ -]+", "_", name.strip())


class Attributes(dict):
    """Attributes of the variable ``owner``: metadata, never a group of samples.

    Parameters
    ----------
    owner : str
        Name of the variable.
    values : mapping of str to any
        Name -> value.
    """

    def __init__(self, owner: str, values: Mapping[str, Any]):
        super().__init__(values)
        self.owner = owner


def is_slow(value: Any, name: str, samples: set[str]) -> bool:
    """Whether a variable is an array beside the samples, for example one that is sampled at a lower rate.

    Parameters
    ----------
    value : any
        Value of the variable.
    name : str
        Its name.
    samples : set of str
        Names of the variables of the group that hold samples.

    Returns
    -------
    bool
    """
    return isinstance(value, ARRAYS) and value.size > 1 and name not in samples and name.lower() not in TIME_NAMES


def size_of_longest(value: Mapping) -> int:
    """Size of the largest array in a group or one of its groups.

    Parameters
    ----------
    value : mapping
        Variables of a group.

    Returns
    -------
    int
        Number of elements; 0 without an array.
    """
    sizes = (
        size_of_longest(v) if isinstance(v, Mapping) else v.size if isinstance(v, ARRAYS) else 0 for v in value.values()
    )
    return max(sizes, default=0)


def holds_samples(value: Mapping) -> bool:
    """Whether a group or one of its groups holds samples, or a variable that cannot be read.

    Parameters
    ----------
    value : mapping
        Variables of a group.

    Returns
    -------
    bool
        False for a group of short entries.
    """
    if isinstance(value, Attributes):
        return False
    return bool(vectors(value) or matrices(value)) or any(
        isinstance(v, ReadError) or (isinstance(v, Mapping) and holds_samples(v)) for v in value.values()
    )


def matrices(variables: Mapping[str, Any]) -> dict[str, Any]:
    """Arrays that can be samples in two or three dimensions.

    Parameters
    ----------
    variables : mapping of str to any
        Name -> value of any type.

    Returns
    -------
    dict of str to any
        Those that are numeric arrays with at least two numbers along one axis.
    """
    arrays = {name: v for name, v in variables.items() if isinstance(v, ARRAYS) and v.dtype.kind in "fiu"}
    return {name: v for name, v in arrays.items() if v.ndim in (2, 3) and min(v.shape) >= 1 and max(v.shape) > 1}


def is_flag_series(array: Any) -> bool:
    """Whether an array holds true and false, as the mask of invalid samples does; all equal it says nothing.

    Parameters
    ----------
    array : (...) array or LazyColumn
        Numbers of any type.

    Returns
    -------
    bool
        False for any other type.
    """
    return bool(array.dtype.kind == "b" and np.any(array[:]) and not np.all(array[:]))


# Names of vectors that are metadata, not samples.
RESERVED_NAMES = frozenset((*TIME_NAMES, *CHANNEL_NAMES, *UNIT_NAMES, *START_NAMES, *RECORD_COUNT_NAMES, *CONDITIONS))


def vectors(variables: Mapping[str, Any]) -> dict[str, Any]:
    """Vectors that can be channels; those much shorter than the longest are metadata, not samples.

    Parameters
    ----------
    variables : mapping of str to any
        Name -> value of any type.

    Returns
    -------
    dict of str to any
        Vectors of numbers or flags that are longer than half of the longest and have no name of metadata.
    """
    candidates = {
        name: v
        for name, v in variables.items()
        if isinstance(v, ARRAYS) and v.ndim == 1 and v.size > 1 and (v.dtype.kind in "fiu" or is_flag_series(v))
        if underscored_name(plain_name(name)) not in RESERVED_NAMES
        and not (is_rate_name(name) and v.size <= MAX_ENTRIES)
    }
    longest = max((v.size for v in candidates.values()), default=0)
    return {name: v for name, v in candidates.items() if 2 * v.size > longest}
