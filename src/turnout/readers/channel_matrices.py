"""Matrices that hold one channel each, with all records of it: ``force`` (record, sample) beside ``rail``."""

import re
from collections.abc import Mapping
from typing import Any

from turnout.readers.array_metadata import Alphabetical, list_of_texts
from turnout.readers.array_names import numbered_names, split_texts
from turnout.readers.channel_descriptions import quantity_of_sensor
from turnout.readers.metadata_names import CHANNEL_NAMES, UNIT_NAMES
from turnout.readers.sample_variables import matrices, underscored_name, vectors


def with_records_of_channels(variables: Mapping[str, Any]) -> Mapping[str, Any]:
    """The variables, with a group for each record in place of matrices of equal shape that hold a channel each.

    Their names or units have to say that they are channels: two impacts of two channels each have the same shapes. The
    longer axis is that of the samples.

    Parameters
    ----------
    variables : mapping of str to any
        Name -> value.

    Returns
    -------
    mapping of str to any
        The same object if there are no such matrices.
    """
    blocks = matrices(variables)
    shapes = {block.shape for block in blocks.values()}
    if len(blocks) < 2 or len(shapes) > 1:
        return variables
    shape = shapes.pop()
    if any(vector.size != min(shape) for vector in vectors(variables).values()):  # others have a number for each record
        return variables
    if len(shape) != 2 or min(shape) < 2 or shape[0] == shape[1] or not _are_channels(blocks, variables):
        return variables
    rows = {name: list(block if shape[0] < shape[1] else block.T) for name, block in blocks.items()}
    records = {f"record_{k:03d}": {name: rows[name][k] for name in blocks} for k in range(min(shape))}
    merged = {name: value for name, value in variables.items() if name not in blocks} | records
    return Alphabetical(merged) if isinstance(variables, Alphabetical) else merged


def _are_channels(blocks: Mapping[str, Any], variables: Mapping[str, Any]) -> bool:
    """Whether a list of channels names the matrices; without a list, whether their names or units differ as theirs.

    "force" and "rail" do, and N and m/s²; "hammer A7" and "hammer B3" may be two tests of all channels each.
    """
    entries = {underscored_name(name.lower()): value for name, value in variables.items()}
    lists = [entries[name] for name in CHANNEL_NAMES if name in entries]
    if lists:  # any other one names the channels of one matrix
        return any(set(split_texts(list_of_texts(names))) == set(blocks) for names in lists)
    words = {re.sub(r"\d+", "", name) for name in blocks}
    units = [value for name in UNIT_NAMES if isinstance(value := entries.get(name), Mapping)]
    are_units_different = bool(units) and len({str(units[0].get(name, "")) for name in blocks}) > 1
    are_sensors_different = len(set(map(quantity_of_sensor, blocks))) > 1
    return len(words) == len(blocks) and not numbered_names(blocks) and (are_units_different or are_sensors_different)
