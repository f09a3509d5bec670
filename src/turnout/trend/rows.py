"""Frames of the trend as Arrow tables of the registry: NULL for what cannot be said, rounded to resolution."""

import numpy as np
import pyarrow as pa

from turnout.registry.columns import arrow_schema, tables


def arrow_rows(table, frame, rounded=True, single=False) -> pa.Table:
    """``frame`` with the columns and types of ``table``; NaN, infinity and NaT become NULL.

    A column that the frame lacks is NULL. ``rounded`` False keeps full precision, for tests of the views; ``single``
    halves what numbers with a stated resolution take in memory, 7 digits being more than they have.
    """
    schema, columns = arrow_schema(table), tables()[table]
    arrays = [_array(frame, c, field.type, rounded, single) for c, field in zip(columns, schema)]
    return pa.table(arrays, names=[c.name for c in columns])


def _array(frame, column, kind, rounded, single):
    if column.name not in frame:
        return pa.nulls(len(frame), kind)
    values = frame[column.name]
    if pa.types.is_floating(kind) or pa.types.is_integer(kind):
        numbers = values.to_numpy(dtype=float, na_value=np.nan) if values.dtype.kind not in "iub" else values.to_numpy()
        if rounded and column.decimals is not None:
            numbers = np.round(numbers, column.decimals) + 0.0
        if single and column.decimals is not None:
            numbers, kind = numbers.astype(np.float32), pa.float32()
        if numbers.dtype.kind == "f":
            return pa.array(numbers, mask=~np.isfinite(numbers)).cast(kind)
        return pa.array(numbers).cast(kind)
    if str(values.dtype) == "category":
        return pa.DictionaryArray.from_arrays(
            pa.array(values.cat.codes.to_numpy(), mask=values.cat.codes.to_numpy() < 0), values.cat.categories.tolist()
        )
    return pa.array(values, type=kind, from_pandas=True)
