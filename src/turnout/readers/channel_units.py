"""Unit and scale of a channel: what file and layout state of them, compared, and the conversion to SI."""

import re

import numpy as np

from turnout.errors import ReadError
from turnout.readers.inversions import INVERSION
from turnout.readers.lazy import Column
from turnout.readers.rate_units import words_of
from turnout.readers.sensitivity_comparison import sensitivity_problem
from turnout.readers.sensitivity_scales import is_scale_of_sensor
from turnout.readers.source import BLOCK_SIZE, RawRecord, Source
from turnout.readers.stated_quantities import contradicting_quantity
from turnout.readers.stated_units import contradicting_unit, is_meaningless
from turnout.records import RawChannel
from turnout.units import Conversion, conversion, is_of_a_stretch, to_si

FULL_SCALE_UNIT = re.compile(r"\s*[+-]?[\d.]")  # a unit with a number, as in "10 V"
FIND_OUT = "Find out which is right; then set it in the layout"
CORRECT_SOURCE = "Correct 'source' of this channel in the layout"


def checked_conversion(record: RawRecord, index: int, raw: RawChannel, place: str, source: Source) -> Conversion:
    """Conversion of the numbers of a channel to SI, once nothing in the file contradicts it.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    index : int
        Number of the row, from 0.
    raw : RawChannel
        The channel in the layout. A unit that ends with "!" overrules what the file states.
    place : str
        Record and channel, for the message.
    source : Source
        The raw file.

    Returns
    -------
    Conversion
        Scale and offset to SI, without the sign of the channel.

    Raises
    ------
    ReadError
        If the unit or the scale is not known, or if the file contradicts the layout.
    """
    file_unit = record.units[index]
    try:
        conversion_to_si = to_si(raw.quantity, resolve_unit(file_unit, raw.unit), raw.sensitivity, raw.sensitivity_unit)
    except ValueError as error:
        remedy = "Correct 'unit' or 'sensitivity' of this channel in the layout"
        if not file_unit.isascii() and "is not known" in str(error):
            remedy = f"{remedy}; if its letters are wrong, save the file as UTF-8 with a text editor"
        raise source.error(place, str(error), remedy, reason="unit_unknown") from error
    if (scale_error := undecided_error(record, index, place, source)) and not raw.overrules_file:
        is_in_volts = conversion(resolve_unit(file_unit, raw.unit)).dimension == "voltage"
        if not (is_in_volts and is_scale_of_sensor(record, index, raw)):
            raise scale_error
    if not raw.overrules_file:
        _check_stated_units(record, index, raw, place, source)
    if raw.sensitivity is not None and not raw.overrules_file:
        stated = record.entries, raw.sensitivity, raw.sensitivity_unit, raw.quantity, record.names, index
        if problem := sensitivity_problem(*stated):
            remedy = f"Correct the layout; if it is right, set 'unit: {raw.unit or file_unit}!' for this channel"
            raise source.error(place, problem, remedy, reason="scale_unknown")
    if record.audio and not raw.overrules_file:
        _check_full_scale(record, index, raw.unit or "", place, source)
    return conversion_to_si


def undecided_error(record: RawRecord, index: int, place: str, source: Source) -> ReadError | None:
    """The error of a channel of which the file itself leaves the scale open, unless the layout decides.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    index : int
        Number of the row, from 0.
    place : str
        Record and channel, for the message.
    source : Source
        The raw file.

    Returns
    -------
    ReadError or None
        About a scale that may be applied already, or about two units that contradict each other.
    """
    if statement := record.undecided.get(index):
        remedy = _scale_remedy(record.units[index])
        if any(map(INVERSION.fullmatch, words_of(statement))):
            remedy = f"{remedy}; if the entry means something else, name it there, 'checked_entries'"
        return source.error(place, statement, remedy, reason="scale_unknown")
    if statement := record.unit_conflicts.get(index):
        return source.error(place, statement, FIND_OUT, reason="scale_unknown")
    return None


def _scale_remedy(unit: str) -> str:
    """What to do about a scale of which nothing says whether it was applied, in a file that states ``unit``."""
    label = unit.strip() or "N"
    return (
        f"Find out in the logger's manual whether its numbers already contain it; if they do, set unit: '{label}!' for "
        f"this channel in the layout, else the value of one step, such as unit: '0.4 {label}!'"
    )


def _check_full_scale(record: RawRecord, index: int, unit: str, place: str, source: Source) -> None:
    """ReadError if the numbers of an audio file are fractions of a full scale that nothing states, or are none."""
    is_stated = bool(FULL_SCALE_UNIT.match(unit))
    if record.audio == "whole" and not is_stated and is_meaningless(record.units[index]):
        problem = f"its whole numbers are fractions of full scale, and nothing says what full scale is in {unit!r}"
        remedy = f"Set it in the layout, such as 'unit: 10 {unit}'; 'unit: 1 {unit}' if full scale is one"
        raise source.error(place, problem, remedy, reason="scale_unknown")
    if record.audio == "floating" and is_stated and (largest := _largest(record.samples[index])) > 1.0:
        problem = f"its numbers reach {largest:.4g}, so they are no fractions of the full scale {unit!r}"
        remedy = "The logger wrote physical numbers: set the unit in the layout without a number, such as 'unit: V'"
        raise source.error(place, problem, remedy, reason="out_of_scale")


def _check_stated_units(record: RawRecord, index: int, raw: RawChannel, place: str, source: Source) -> None:
    """ReadError if the metadata or the name of a channel state another unit or quantity than the one in use."""
    unit_in_use = record.units[index] if not is_meaningless(record.units[index]) else raw.unit or ""
    if quantity := contradicting_quantity(record, index, raw.quantity, unit_in_use):
        problem = f"the file says that its quantity is {quantity}, the layout {raw.quantity} in {unit_in_use!r}"
        remedy = f"{CORRECT_SOURCE}; if the layout is right, set 'unit: {unit_in_use}!' for this channel"
        raise source.error(place, problem, remedy, reason="unit_unknown")
    rival = contradicting_unit(record, index, raw.unit, raw.quantity, lambda unit: _is_usable(unit, raw))
    if not rival:
        return
    holder = "the layout" if is_meaningless(record.units[index]) else "its unit"
    problem = f"its metadata or its name {record.names[index]!r} say {rival!r}, {holder} {unit_in_use!r}"
    choices = " or ".join(f"'unit: {unit}!'" for unit in (rival, unit_in_use) if _is_usable(unit, raw))
    remedy = f"{FIND_OUT} as {choices or 'a unit with !'}"
    raise source.error(place, problem, remedy, reason="unit_unknown")


def _is_usable(unit: str, raw: RawChannel) -> bool:
    """Whether numbers in a unit can become the quantity of the channel, by its sensitivity if it has one."""
    try:
        to_si(raw.quantity, unit, raw.sensitivity, raw.sensitivity_unit)
    except ValueError:
        return False
    return True


def _largest(column: Column) -> float:
    """Largest absolute number of a column that is finite."""
    blocks = (column[start : start + BLOCK_SIZE] for start in range(0, len(column), BLOCK_SIZE))
    return max((float(np.fmax(np.nanmax(block), -np.nanmin(block))) for block in blocks), default=0.0)


def resolve_unit(file_unit: str, layout_unit: str | None) -> str:
    """Unit of the raw numbers, from the file and the layout.

    Both must agree if both state one; "V!" in a layout overrules the file. If the file states counts, the layout gives
    the value of one count: a voltage, or a unit with a factor. The layout overrules meaningless labels.

    Parameters
    ----------
    file_unit : str
        Unit that the file states, "" without one.
    layout_unit : str or None
        Unit that the layout states, or None.

    Returns
    -------
    str
        The unit that holds, which may have a factor.

    Raises
    ------
    ValueError
        If no unit is stated, the units differ, or the file's unit is not known.

    Examples
    --------
    >>> resolve_unit("Newtons", None), resolve_unit("EU", "mV"), resolve_unit("g", "V!"), resolve_unit("count", "0.5 N")
    ('Newtons', 'mV', 'V', '0.5 N')
    """
    if layout_unit is None:
        if not file_unit:
            raise ValueError("neither the file nor the layout says the unit")
        return file_unit
    if layout_unit.endswith("!"):
        return layout_unit[:-1]
    stated = conversion(layout_unit)
    if is_meaningless(file_unit):
        return layout_unit
    try:
        written = conversion(file_unit)
    except ValueError:
        meaning = "the unit of values over a stretch of time" if is_of_a_stretch(file_unit) else "which is not known"
        raise ValueError(
            f"the file says {file_unit!r}, {meaning}, the layout {layout_unit!r} "
            f"('unit: {layout_unit}!' if the layout is right)"
        ) from None
    of_a_count = stated.dimension == "voltage" or layout_unit.lstrip(" [+-.")[:1].isdigit()
    same = stated.dimension == written.dimension and abs(stated.scale - written.scale) <= 1e-9 * abs(stated.scale)
    if not same and not (written.dimension == "count" and of_a_count):
        raise ValueError(
            f"the file says {file_unit!r}, the layout {layout_unit!r} "
            f"('unit: {file_unit}' if the file is right, 'unit: {layout_unit}!' if the layout is)"
        )
    return layout_unit
