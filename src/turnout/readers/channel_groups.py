"""Groups that hold one channel each, as structures of MATLAB and groups of HDF5 do: ``force.data``, ``force.unit``."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from turnout.errors import ReadError
from turnout.readers.array_metadata import Alphabetical
from turnout.readers.metadata_names import ATTRIBUTES_MARK, TIME_NAMES
from turnout.readers.sample_variables import Attributes, holds_samples, matrices, vectors
from turnout.readers.scale_vocabulary import is_scale_name
from turnout.readers.stated_scales import scale_text
from turnout.readers.unit_names import is_unit_name

STATED_SCALES = "(scales)"  # pairs (channel, statement about its scale) that a reader adds to the variables
# Names that say nothing about what a vector is, so that its channel is named by the group.
SAMPLE_NAMES = frozenset("data value values sample samples signal raw y ydata y_data amplitude".split())


def with_channel_groups(variables: Mapping[str, Any]) -> Mapping[str, Any]:
    """The variables, with a channel and its attributes for each group that holds one vector of samples.

    Two or more such groups are the channels of one record if all vectors have a name that says nothing, as "data", and
    their time vectors are equal. The channel has the name that its group states, else that of the group. A vector and a
    structure beside it, as "Channel_1_Data" and "Channel_1_Header", are such a group, too.

    Parameters
    ----------
    variables : mapping of str to any
        Name -> value, groups included.

    Returns
    -------
    mapping of str to any
        The same object if its groups are no channels.

    Raises
    ------
    ReadError
        If what a group states about its channel cannot be read.
    """
    variables = _with_headers(variables)
    groups = {name: v for name, v in variables.items() if isinstance(v, Mapping) and holds_samples(v)}
    vector_names = {name: _vector_name(group) for name, group in groups.items()}
    if len(groups) < 2 or not all(vector_names.values()) or vectors(variables) or matrices(variables):
        return variables
    times = [v for group in groups.values() for n, v in group.items() if n.lower() in TIME_NAMES]
    if len(times) not in (0, len(groups)) or not all(np.array_equal(t, times[0]) for t in times[1:]):
        return variables
    if damaged := [v for group in groups.values() for v in group.values() if isinstance(v, ReadError)]:
        raise damaged[0]
    titles = [_title(group) for group in groups.values()]
    names = titles if all(titles) and len(set(titles)) == len(titles) else list(groups)
    channels: dict[str, Any] = {name: value for name, value in variables.items() if name not in groups}
    channels |= {"time": times[0]} if times else {}
    scales = []
    for name, (group_name, group) in zip(names, groups.items()):
        channels[name] = _flat(group[vector_names[group_name]])
        facts = {n: v for n, v in group.items() if n != vector_names[group_name] and n.lower() not in TIME_NAMES}
        channels[f"{name}{ATTRIBUTES_MARK}"] = Attributes(name, facts)
        if text := scale_text({n: v for n, v in facts.items() if is_scale_name(n)}):
            scales.append((name, text))
    units = {name: _unit(group) for name, group in zip(names, groups.values())}
    channels |= {"units": units} if any(units.values()) else {}
    channels |= {STATED_SCALES: tuple(scales)} if scales else {}
    return Alphabetical(channels) if isinstance(variables, Alphabetical) else channels


# Ends of the names of a channel's structure and of its vector, as in "Channel_1_Header" beside "Channel_1_Data".
HEADER_ENDS = re.compile(r"_?(?:header|info|attributes|meta|properties)$")
VECTOR_ENDS = re.compile(r"_?(?:data|values?|samples|signal)$")


def _with_headers(variables: Mapping[str, Any]) -> Mapping[str, Any]:
    """The variables, with a group for each vector that has a structure of the same name with another end.

    The same object if a vector has none, or if no structure states the name or the unit of its vector.
    """
    headers = {
        stem: name
        for name, v in variables.items()
        if isinstance(v, Mapping)
        and not holds_samples(v)
        and (stem := HEADER_ENDS.sub("", name.lower())) != name.lower()
    }
    owners = {name: headers.get(VECTOR_ENDS.sub("", name.lower()), "") for name in vectors(variables)}
    if not headers or len(owners) < 2 or not all(owners.values()):
        return variables
    if not any(_title(variables[header]) or _unit(variables[header]) for header in owners.values()):
        return variables
    merged = {
        name: {**variables[owners[name]], "data": v} if name in owners else v
        for name, v in variables.items()
        if name not in owners.values()
    }
    return Alphabetical(merged) if isinstance(variables, Alphabetical) else merged


TITLES = ("name", "channel_name", "channelname", "signal_name", "signalname", "label")


def _vector_name(group: Mapping[str, Any]) -> str:
    """Name of the only vector of samples in a group, "" if it holds others or the name says what it is."""
    arrays = {n: v for n, v in (vectors(group) | matrices(group)).items() if n.lower() not in TIME_NAMES}
    inner = any(isinstance(v, Mapping) and holds_samples(v) for v in group.values())
    if len(arrays) != 1 or inner:
        return ""
    (name, array), *_ = arrays.items()
    is_vector = array.ndim == 1 or (array.ndim == 2 and min(array.shape) == 1)
    return name if is_vector and name.lower() in SAMPLE_NAMES else ""


def _flat(array: Any) -> Any:
    """A vector; that of a column or row."""
    return array if array.ndim == 1 else next(iter(array if array.shape[0] == 1 else array.T))


def _title(group: Mapping[str, Any]) -> str:
    """The name that a group states for its channel, "" without one."""
    titles = (v for n, v in group.items() if n.lower() in TITLES and isinstance(v, str))
    return next(titles, "").strip()


def _unit(group: Mapping[str, Any]) -> str:
    """The unit that a group states for its channel, "" without one."""
    units = (v for n, v in group.items() if is_unit_name(n) and isinstance(v, str))
    return next(units, "").strip()
