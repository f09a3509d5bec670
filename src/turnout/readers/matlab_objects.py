"""Objects of MATLAB classes in a file: datetime, table, string and others, whose content no library reads.

MATLAB stores only a reference where such a variable belongs, and the content in a subsystem of the file that is not
documented. The reference is an array of numbers, which must never be taken for a start time or for samples.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import h5py
import numpy as np
from scipy.io.matlab import MatlabOpaque

from turnout.counts import first_texts
from turnout.readers.array_metadata import Alphabetical
from turnout.readers.entries import UnreadObject
from turnout.readers.metadata_names import (
    CHANNEL_NAMES,
    RECORD_COUNT_NAMES,
    SAMPLE_COUNT_NAMES,
    TIME_NAMES,
    UNIT_NAMES,
)
from turnout.readers.rate_vocabulary import is_rate_name
from turnout.readers.sample_variables import holds_samples, plain_name
from turnout.readers.scale_vocabulary import is_scale_name
from turnout.readers.source import Source

REFERENCE = 0xDD000000  # first of the numbers by which MATLAB refers to an object
MIN_REFERENCE_SIZE = 6  # numbers: the mark, the dimensions, the object and its class
OBJECT_DECODING = 3  # value of the attribute of such a reference in version 7.3
SUBSYSTEM = "#subsystem#"  # group that holds the content of the objects in version 7.3
NEEDED_NAMES = {*TIME_NAMES, *CHANNEL_NAMES, *UNIT_NAMES, *RECORD_COUNT_NAMES, *SAMPLE_COUNT_NAMES}
MAX_LISTED = 6  # objects that a message names

# MATLAB class -> statement that turns the object x into something that other programs read.
STATEMENTS = {
    "datetime": "x = char(x, 'yyyy-MM-dd HH:mm:ss.SSS')",
    "duration": "x = seconds(x)",
    "string": "x = cellstr(x)",
    "categorical": "x = cellstr(x)",
    "table": "x = table2struct(x, 'ToScalar', true)",
    "timetable": "x = table2struct(timetable2table(x), 'ToScalar', true); x.Time = seconds(x.Time - x.Time(1))",
    "timeseries": "x = struct('time', x.Time, 'data', x.Data)",
}
OTHER_STATEMENT = "x = struct(x)"


def matlab_object(class_name: str) -> UnreadObject:
    """The mark that stands for an object of a MATLAB class.

    Parameters
    ----------
    class_name : str
        Name of the class, "" if the file does not state it beside the object.

    Returns
    -------
    UnreadObject
        Its kind and the way to store its content so that it can be read.

    Examples
    --------
    >>> print(matlab_object("duration"))
    object of the MATLAB class duration
    >>> matlab_object("duration").remedy("t")
    'Turn it into plain numbers or text in MATLAB before saving, t = seconds(t)'
    """
    kind = f"object of the MATLAB class {class_name}" if class_name else "MATLAB object"
    statement = STATEMENTS.get(class_name, OTHER_STATEMENT)
    return UnreadObject(kind, f"Turn it into plain numbers or text in MATLAB before saving, {statement}")


def with_marked_objects(value: Any) -> Any:
    """A value of a version 5 file as scipy returns it, with a mark for each object; arrays are changed in place.

    Parameters
    ----------
    value : any
        A variable, or a dictionary of variables.

    Returns
    -------
    any
        The same value if it holds no object.
    """
    if isinstance(value, dict):
        return {name: with_marked_objects(v) for name, v in value.items()}
    if isinstance(value, MatlabOpaque):
        names: tuple[str, ...] = value.dtype.names or ()
        class_name = value.ravel()[0][names[-2]] if value.size and len(names) > 2 else ""
        return matlab_object(class_name.decode("utf-8", "replace") if isinstance(class_name, bytes) else class_name)
    if isinstance(value, np.ndarray) and value.dtype.names:
        for name in value.dtype.names:
            with_marked_objects(value[name])
    elif isinstance(value, np.ndarray) and value.dtype.kind == "O":
        for index in np.ndindex(value.shape):
            value[index] = with_marked_objects(value[index])
    return value


def class_names(file: h5py.File) -> dict[str, str]:
    """Classes of the objects in a version 7.3 file, by their paths; those in cells are not found.

    Parameters
    ----------
    file : h5py.File
        The open file.

    Returns
    -------
    dict of str to str
        Path -> name of the class.
    """
    classes: dict[str, str] = {}

    def note(path: str, member: h5py.Dataset | h5py.Group) -> None:
        if path.startswith("#") or member.attrs.get("MATLAB_object_decode", 0) != OBJECT_DECODING:
            return
        name = member.attrs.get("MATLAB_class", b"")
        classes[path] = name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)

    file.visititems(note)
    return classes


def with_marked_references(value: Any, classes: Mapping[str, str], path: str = "") -> Any:
    """A value of a version 7.3 file as pymatreader returns it, with a mark for each object.

    Parameters
    ----------
    value : any
        A variable, or a dictionary of variables.
    classes : mapping of str to str
        As ``class_names`` returns them.
    path : str
        Path of the value in the file.

    Returns
    -------
    any
        A value of the same structure.
    """
    if path in classes:
        return matlab_object(classes[path])
    if isinstance(value, dict):
        inner = {name: f"{path}/{name}" if path else name for name in sorted(value)}  # pymatreader's order is random
        return {name: with_marked_references(value[name], classes, inner[name]) for name in inner}
    if isinstance(value, list):
        return [with_marked_references(v, classes, path) for v in value]
    return matlab_object("") if _is_reference(value) else value


def _is_reference(value: Any) -> bool:
    """Whether an array is the reference to an object."""
    is_array = isinstance(value, np.ndarray) and value.dtype == np.uint32 and value.size >= MIN_REFERENCE_SIZE
    return is_array and int(value.flat[0]) == REFERENCE


def check_objects(variables: Mapping[str, Any], source: Source) -> dict[str, Any]:
    """The variables, with an error in place of each object whose content is needed to read the samples.

    Parameters
    ----------
    variables : mapping of str to any
        Name -> value, with marks for objects.
    source : Source
        The MATLAB file.

    Returns
    -------
    dict of str to any
        Name -> value. Objects of other names stay, to be reported as entries.

    Raises
    ------
    ReadError
        If the file holds objects and no samples beside them.
    """
    objects = dict(_objects(variables))
    if not objects or holds_samples(variables):
        return _with_errors(variables, "", source)
    listed = first_texts([f"{name!r} ({value})" for name, value in objects.items()], MAX_LISTED)
    name, value = next(iter(objects.items()))
    content = "only MATLAB can read what it holds" if value.is_matlab else "none of its variables is a full array"
    problem = f"{content}: {listed}"
    raise source.error(f"variable {name!r}", problem, value.remedy(name.replace("/", ".")), reason="unreadable")


def _objects(variables: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, UnreadObject]]:
    """(path, mark) of all objects in nested variables."""
    for name, value in variables.items():
        inner = f"{path}/{name}" if path else str(name)
        if isinstance(value, UnreadObject):
            yield inner, value
        elif isinstance(value, Mapping):
            yield from _objects(value, inner)
        elif isinstance(value, (list, np.ndarray)) and getattr(value, "dtype", np.dtype("O")).kind == "O":
            yield from _objects({f"{name}{{{i + 1}}}": v for i, v in enumerate(np.ravel(value))}, path)


def _with_errors(variables: Mapping[str, Any], path: str, source: Source) -> dict[str, Any]:
    """The variables of one group and of those in it, with errors for the objects that are needed."""
    checked = {}
    for name, value in variables.items():
        inner = f"{path}/{name}" if path else str(name)
        if isinstance(value, Mapping):
            checked_group = _with_errors(value, inner, source)
            value = Alphabetical(checked_group) if isinstance(value, Alphabetical) else checked_group
        elif (unread := next((mark for _, mark in _objects({name: value})), None)) and _is_needed(str(name)):
            remedy = unread.remedy(inner.replace("/", "."))
            reader = "only MATLAB can read" if unread.is_matlab else "is not read"
            value = source.error(f"variable {inner!r}", f"it is {unread.with_article}, which {reader}", remedy)
        checked[name] = value
    return checked


def _is_needed(name: str) -> bool:
    """Whether a variable of this name decides how the samples are read."""
    return plain_name(name) in NEEDED_NAMES or is_rate_name(name) or is_scale_name(name)
