"""Abscissa of a waveform in a TDMS file: the quantity and the unit of its step and of its offset."""

from collections.abc import Mapping, Sequence
from typing import Any

import nptdms

from turnout.readers.array_metadata import Metadata
from turnout.readers.rate_agreement import ABSCISSA_REMEDY
from turnout.readers.rate_units import rate_unit, words_of
from turnout.readers.rate_vocabulary import FREQUENCY
from turnout.readers.source import MEANINGLESS_UNITS, Source
from turnout.readers.time_axes import is_unit_of_no_time
from turnout.readers.time_texts import parse_time
from turnout.readers.timing import check_simultaneous, start_offsets

UNIT_NAME, AXIS_NAME = "wf_xunit_string", "wf_xname"


def unit_of_abscissa(properties: Mapping[str, Any]) -> str:
    """Unit of the step of a waveform.

    Parameters
    ----------
    properties : mapping of str to any
        Properties of its channel.

    Returns
    -------
    str
        As it is written; "" if it is not stated, or by a placeholder: then it is s.
    """
    unit = str(properties.get(UNIT_NAME, "")).strip()
    return "" if unit.casefold() in MEANINGLESS_UNITS else unit


def seconds_of_abscissa(properties: Mapping[str, Any]) -> float:
    """Seconds of one unit of the abscissa of a waveform.

    Parameters
    ----------
    properties : mapping of str to any
        Properties of its channel.

    Returns
    -------
    float
        1 for a unit that is not stated, and for one of which ``abscissa_problem`` speaks. [s]

    Examples
    --------
    >>> seconds_of_abscissa({"wf_xunit_string": "ms"}), seconds_of_abscissa({})
    (0.001, 1.0)
    """
    unit = rate_unit(unit_of_abscissa(properties))
    return float(unit.scale) if unit is not None and unit.is_step else 1.0


def abscissa_problem(properties: Mapping[str, Any]) -> str:
    """Why the samples of a waveform are none of a time.

    Parameters
    ----------
    properties : mapping of str to any
        Properties of its channel.

    Returns
    -------
    str
        "" for a time in a known unit, whatever the axis is called, and where nothing speaks of another quantity.

    Examples
    --------
    >>> abscissa_problem({"wf_increment": 10.0, "wf_xunit_string": "Hz"})
    "it is measured over an axis in 'Hz', and not over the time"
    >>> abscissa_problem({"wf_increment": 0.001, "wf_xname": "Time", "wf_xunit_string": "s"})
    ''
    """
    if not properties.get("wf_increment"):
        return ""
    unit, name = unit_of_abscissa(properties), str(properties.get(AXIS_NAME, ""))
    if is_unit_of_no_time(unit):
        return f"it is measured over an axis in {unit!r}, and not over the time"
    if rate_unit(unit) is not None:
        return ""
    if any(FREQUENCY.match(word) for word in words_of(name)):
        return f"it is measured over {name!r}, and not over the time"
    return ""


def unknown_unit(properties: Mapping[str, Any]) -> str:
    """Unit of the step of a waveform if it is not known: "Time", "relative" or "HH:MM:SS" stand for s.

    Parameters
    ----------
    properties : mapping of str to any
        Properties of its channel.

    Returns
    -------
    str
        "" for a known unit, and without a step or a unit.

    Examples
    --------
    >>> unknown_unit({"wf_increment": 0.001, "wf_xunit_string": "Zeit"}), unknown_unit({"wf_increment": 0.001})
    ('Zeit', '')
    """
    unit = unit_of_abscissa(properties) if properties.get("wf_increment") else ""
    return unit if unit and rate_unit(unit) is None and not is_unit_of_no_time(unit) else ""


def check_steps(channels: Sequence[nptdms.TdmsChannel], where: str, source: Source) -> dict[str, str]:
    """Check that channels are sampled over the time, at one rate and from one moment on.

    A channel begins at its time stamp plus ``wf_start_offset``. Channels without a step count if none has one.

    Parameters
    ----------
    channels : sequence of nptdms.TdmsChannel
        Channels of one record.
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Returns
    -------
    dict of str to str
        Channels whose abscissa is none of time, name -> why: an error if the layout uses them.

    Raises
    ------
    ReadError
        If no abscissa is one of time, or if steps or starts of the others differ.
    """
    channels = [c for c in channels if "wf_increment" in c.properties] or channels
    problems = {c.name: problem for c in channels if (problem := abscissa_problem(c.properties))}
    if len(problems) == len(channels):
        for name, problem in problems.items():
            raise source.error(f"{where}, channel {name!r}", problem, ABSCISSA_REMEDY, "wrong_rate")
    channels = [c for c in channels if c.name not in problems]
    facts = [Metadata(c.properties, source) for c in channels]
    scales = [seconds_of_abscissa(c.properties) for c in channels]
    steps = [(f.number(("wf_increment",)) or 0.0) * scale for f, scale in zip(facts, scales)]
    stamps = start_offsets([parse_time(f.record_value(("wf_start_time",), 0, 1)) for f in facts])
    offsets = [(f.number(("wf_start_offset",)) or 0.0) * scale for f, scale in zip(facts, scales)]
    starts = [stamp + offset for stamp, offset in zip(stamps, offsets)]
    check_simultaneous([c.name for c in channels], steps, starts, where, source)
    return problems
