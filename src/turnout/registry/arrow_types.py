"""Arrow types of the columns of the registry.

They are apart from the columns themselves, because ``pyarrow`` takes 65 MB and readers of the registry need none of it.
"""

from __future__ import annotations

from functools import cache

import pyarrow as pa

from turnout.registry.schema import Column, tables

ARROW_TYPES = {
    "varchar": pa.string(),
    "double": pa.float64(),
    "float": pa.float32(),
    "integer": pa.int32(),
    "bigint": pa.int64(),
    "boolean": pa.bool_(),
    "timestamp": pa.timestamp("us"),
}


def arrow_type(column: Column) -> pa.DataType:
    """Arrow type of a column.

    Parameters
    ----------
    column : Column
        Column of a table.

    Returns
    -------
    DataType
        The type; of a list, with that of its elements.

    Examples
    --------
    >>> from turnout.registry.schema import column
    >>> arrow_type(column("modes", "damping_ratio"))
    DataType(double)
    """
    element_type = ARROW_TYPES[column.type.removesuffix("[]")]
    return pa.list_(element_type) if column.is_list else element_type


@cache
def arrow_schema(table: str) -> pa.Schema:
    """Arrow types of the table, with unit and meaning as field metadata.

    Parameters
    ----------
    table : str
        Name of the table.

    Returns
    -------
    Schema
        The schema.
    """
    return pa.schema(
        [pa.field(c.name, arrow_type(c), metadata={"unit": c.unit, "meaning": c.meaning}) for c in tables()[table]]
    )
