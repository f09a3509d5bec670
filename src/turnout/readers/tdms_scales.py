"""Scales of TDMS channels that npTDMS does not apply."""

import re
from collections.abc import Mapping
from typing import Any

import nptdms
import numpy as np

from turnout.readers.stated_scales import scale_text, without_drawings

# Kinds of scale that npTDMS applies; of any other it only warns, and returns the raw numbers.
KNOWN_SCALES = frozenset("Polynomial Linear RTD Strain Table Thermistor Thermocouple Add Subtract AdvancedAPI".split())
UNCHANGED = "AdvancedAPI"
SCALE_TYPE = re.compile(r"NI_Scale\[(\d+)\]_Scale_Type")
APPLIED_PREFIXES = ("wf_", "NI_")  # properties of the time axis and of the scales that npTDMS applies


def stated_scale(channel: nptdms.TdmsChannel, *outer: Mapping[str, Any]) -> str:
    """What the properties of a channel, its group and the file state of a scale that npTDMS does not apply.

    Of "AdvancedAPI" npTDMS returns the numbers as they are: they are physical, unless they are whole.

    Parameters
    ----------
    channel : nptdms.TdmsChannel
        The channel.
    outer : mapping of str to any
        Properties of its group, then those of the file.

    Returns
    -------
    str
        The statement, for a message; "" without one.
    """
    levels = (channel.properties, *outer)
    for properties in levels:
        kinds = {int(m[1]): str(v) for k, v in properties.items() if (m := SCALE_TYPE.fullmatch(k))}
        count = properties.get("NI_Number_Of_Scales", len(kinds))
        if not str(count).isdigit() or not kinds or properties.get("NI_Scaling_Status") == "scaled":
            continue
        if (last := max(kinds)) >= int(count) and "NI_Number_Of_Scales" in properties:
            return f"the file states the scale {kinds[last]!r} and a number of scales of {count}: it is not applied"
        unknown = sorted(set(kinds.values()) - KNOWN_SCALES)
        if _is_whole(channel) and set(kinds.values()) == {UNCHANGED}:
            unknown = [UNCHANGED]
        if unknown:
            return f"the file states the scale {', '.join(map(repr, unknown))}, which npTDMS cannot apply"
        break
    shown = [without_drawings(level) for level in levels[:0:-1]] + [levels[0]]
    merged = {k: v for level in shown for k, v in level.items() if not k.startswith(APPLIED_PREFIXES)}
    return scale_text(merged)


def _is_whole(channel: nptdms.TdmsChannel) -> bool:
    """Whether the numbers of a channel are whole before they are scaled."""
    stored = getattr(channel.data_type, "nptype", None)
    return stored is not None and np.dtype(stored).kind in "iu"
