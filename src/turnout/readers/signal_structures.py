"""Structures of a signal that keep its axes apart: ``x_values.increment`` beside ``y_values.values``.

Simcenter Testlab exports every signal to MATLAB in this form: ``x_values`` holds ``start_value``, ``increment`` and
``number_of_values``, ``y_values`` the vector or matrix ``values``, each with its unit in ``quantity.label``.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from turnout.readers.array_metadata import Alphabetical
from turnout.readers.metadata_names import TIME_NAMES
from turnout.readers.rate_units import rate_unit
from turnout.readers.sample_variables import Attributes, matrices, vectors
from turnout.readers.source import COPY_AGAIN, Source
from turnout.readers.unit_names import is_unit_name

X_AXIS = re.compile(r"x_?(?:values?|axis)|abscissa", re.IGNORECASE)
Y_AXIS = re.compile(r"y_?(?:values?|axis)|ordinate", re.IGNORECASE)
STEP, START, COUNT = "increment", "start_value", "number_of_values"
MAX_LAG = 0.5  # steps between the first samples of signals that were sampled together


def with_signal_structures(variables: Mapping[str, Any], source: Source) -> Mapping[str, Any]:
    """The variables, with a group of samples, unit and step for each structure with an x and a y axis.

    Parameters
    ----------
    variables : mapping of str to any
        Name -> value, groups included.
    source : Source
        The raw file.

    Returns
    -------
    mapping of str to any
        The same object if there is no such structure.

    Raises
    ------
    ReadError
        If an axis is not that of a time, has not the stated number of values, or signals begin apart.
    """
    flat = {name: _flat_signal(name, v, source) for name, v in variables.items() if isinstance(v, Mapping)}
    if all(variables[name] is value for name, value in flat.items()):
        return variables
    _check_starts({name: variables[name] for name, v in flat.items() if v is not variables[name]}, source)
    merged = {**variables, **flat}
    return Alphabetical(merged) if isinstance(variables, Alphabetical) else merged


def _axes(group: Mapping[str, Any]) -> tuple[Mapping[str, Any], Mapping[str, Any], str] | None:
    """The x axis, the y axis and the name of its samples; None for another group."""
    of_x, of_y = (
        [v for name, v in group.items() if isinstance(v, Mapping) and pattern.fullmatch(name)]
        for pattern in (X_AXIS, Y_AXIS)
    )
    if len(of_x) != 1 or len(of_y) != 1:
        return None
    names = [name for name in (*vectors(of_y[0]), *matrices(of_y[0])) if name.lower() not in TIME_NAMES]
    is_axis = STEP in of_x[0] or any(vectors(of_x[0]))
    return (of_x[0], of_y[0], names[0]) if len(names) == 1 and is_axis else None


def _flat_signal(name: str, group: Mapping[str, Any], source: Source) -> Mapping[str, Any]:
    """A structure of a signal as a group of variables; another group with its inner ones treated alike."""
    if isinstance(group, Attributes):
        return group
    axes = _axes(group)
    if axes is None:
        return with_signal_structures(group, source)
    x, y, of_samples = axes
    where = f"signal {name!r}"
    samples = y[of_samples]
    label = _unit(x)
    unit = rate_unit(label) if isinstance(label, str) and label else rate_unit("s")
    if unit is None or not unit.is_step:
        remedy = "Export the time signals of force and acceleration"
        raise source.error(where, f"its x axis is in {label!r}, so it is no time signal", remedy)
    promised = _number(x.get(COUNT))
    if promised is not None and promised != max(samples.shape):
        problem = f"it has {max(samples.shape)} values where {COUNT} says {promised:g}"
        raise source.error(where, problem, COPY_AGAIN, reason="truncated")
    flat: dict[str, Any] = {"values": samples, **dict(_names_and_units(group, y, samples))}
    if STEP in x:
        flat["x_increment"] = _number(x[STEP])
        if flat["x_increment"] is not None:
            flat["x_increment"] *= float(unit.scale)
    else:
        flat["time"] = next(iter(vectors(x).values())) * float(unit.scale)
    others = {n: v for n, v in group.items() if v is not x and v is not y}
    of_y = {n: v for n, v in y.items() if n != of_samples}
    return {**flat, **_transformation(y), **others, "y_axis": of_y}


def _transformation(y: Mapping[str, Any]) -> dict[str, Any]:
    """The factor and offset of the unit, of which nothing says whether the samples contain them."""
    quantity = y.get("quantity")
    stated = quantity.get("unit_transformation") if isinstance(quantity, Mapping) else None
    return {n: v for n, v in stated.items() if n in ("factor", "offset")} if isinstance(stated, Mapping) else {}


def _names_and_units(
    group: Mapping[str, Any], y: Mapping[str, Any], samples: Any
) -> Iterator[tuple[str, str | list[str]]]:
    """The unit of the samples, and the names of the columns of a matrix."""
    unit = _unit(y)
    if unit:
        yield ("unit" if isinstance(unit, str) else "units"), unit
    record = group.get("function_record")
    names = record.get("name") if isinstance(record, Mapping) else None
    if isinstance(names, list | np.ndarray) and len(names) in samples.shape and samples.ndim > 1:
        yield "channels", [str(name) for name in names]


def _unit(axis: Mapping[str, Any]) -> Any:
    """The unit of an axis: the label of its quantity, or an entry of a unit; "" without one."""
    quantity = axis.get("quantity")
    label = quantity.get("label") if isinstance(quantity, Mapping) else None
    stated = next((v for name, v in axis.items() if is_unit_name(name)), "")
    return label if label is not None and len(label) else stated


def _number(value: Any) -> float | None:
    """A single number; None for another value."""
    array = np.asarray(value)
    return float(array.ravel()[0]) if array.size == 1 and array.dtype.kind in "fiu" else None


def _check_starts(signals: Mapping[str, Mapping[str, Any]], source: Source) -> None:
    """ReadError if signals beside each other begin apart by more than ``MAX_LAG`` of a step."""
    starts: dict[str, tuple[float, float]] = {}
    for name, group in signals.items():
        axes = _axes(group)
        if axes and STEP in axes[0] and START in axes[0]:
            starts[name] = (_number(axes[0][START]) or 0.0, _number(axes[0][STEP]) or 0.0)
    first = next(iter(starts), "")
    for name, (start, step) in starts.items():
        if abs(start - starts[first][0]) > MAX_LAG * abs(step):
            problem = f"it begins at {start:g} and {first!r} at {starts[first][0]:g}: they were not sampled together"
            remedy = "Export the signals of one impact over the same range of time"
            raise source.error(f"signal {name!r}", problem, remedy, reason="clock_drift")
