"""Columns that the layout does not use and that are one of its channels in other units, as raw codes beside volts."""

from collections.abc import Sequence

import numpy as np

from turnout.errors import ReadError
from turnout.readers.channel_maps import ChannelMapping
from turnout.readers.scaled_copies import N_COMPARED, scaled_copies
from turnout.readers.source import RawRecord, Source
from turnout.readers.stated_units import known_unit
from turnout.records import RawChannel
from turnout.units import to_si

MAX_DIFFERENCE = 0.005  # relative, of two scales that agree: a copy of whole numbers is rounded
# Relative, of two calibrations of one sensor: nominal sensitivities of hammers hold within 15 %. Another unit, a gain
# or a shifted point makes more.
MAX_CALIBRATION_DIFFERENCE = 0.15
REMEDY = (
    "Find out which is right; then correct 'unit' or 'sensitivity' of this channel, name the other one as 'source', "
    "or set the unit with '!'"
)


def unused_copy_errors(
    record: RawRecord, mappings: Sequence[ChannelMapping], channels: Sequence[RawChannel], where: str, source: Source
) -> dict[int, ReadError]:
    """Errors and remarks by index of the channels of which the file has other values in another column.

    Both columns are one signal, at two places of its measuring chain: counts and volts, or volts and N. The unit of the
    unused one, with the sensitivity of the layout, gives other values in SI than the channel has. A difference as
    between two calibrations of a sensor is a remark: logger and layout have it from two certificates. The scale of
    codes has no such error.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    mappings : sequence of ChannelMapping
        Channels in use.
    channels : sequence of RawChannel
        Channels of the layout.
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Returns
    -------
    dict of int to ReadError
        Empty where the values agree, or nothing states the unit of the unused column.
    """
    used = {m.index for m in mappings}
    unused = [i for i, unit in enumerate(record.units) if i not in used and known_unit(unit)]
    unused = [i for i in unused if record.samples[i].dtype.kind in "fiu"]
    of_layout = {channel.name: channel for channel in channels}
    errors: dict[int, ReadError] = {}
    if not unused:
        return errors
    heads = [np.asarray(record.samples[i][:N_COMPARED]) for i in (*(m.index for m in mappings), *unused)]
    for first, second, factor in scaled_copies(heads):
        if first >= len(mappings) or second < len(mappings):
            continue
        mapping, column = mappings[first], unused[second - len(mappings)]
        channel, unit = of_layout[mapping.channel.name], record.units[column]
        in_use = known_unit(record.units[mapping.index]) or known_unit((channel.unit or "").rstrip("!"))
        if in_use is None or in_use.dimension == getattr(known_unit(unit), "dimension", ""):
            continue
        try:
            scale = to_si(channel.quantity, unit, channel.sensitivity, channel.sensitivity_unit).scale
        except ValueError:
            continue
        ratio = abs(mapping.scale / (factor * scale))
        if not channel.overrules_file and abs(ratio - 1.0) > MAX_DIFFERENCE:
            name = record.names[column] or str(column)
            problem = f"it is {ratio:.4g} times what the same signal in channel {name!r} with the unit {unit!r} gives"
            is_over_sensor = channel.quantity in (in_use.dimension, getattr(known_unit(unit), "dimension", ""))
            is_calibration = is_over_sensor and abs(ratio - 1.0) <= MAX_CALIBRATION_DIFFERENCE
            reason = "entry_unknown" if is_calibration else "scale_unknown"
            errors[first] = source.error(f"{where}, channel {channel.name!r}", problem, REMEDY, reason=reason)
    return errors
