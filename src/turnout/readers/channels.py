"""Which channel of a file is which of the layout, and what turns its numbers into SI."""

from dataclasses import dataclass
from difflib import get_close_matches

from turnout.errors import ReadError
from turnout.records import Channel, RawChannel
from turnout.units import IGNORED, conversion, to_si

# What loggers write for a unit where nobody told them one; without case.
MEANINGLESS = ("", "-", "eu", "none", "n/a", "a.u.", "arb", "?", "unknown", "undefined", "unitless")


@dataclass(frozen=True)
class Mapping:
    """Row ``index`` of the file becomes ``channel`` by SI = ``scale`` * number + ``offset``, sign included."""

    index: int
    channel: Channel
    scale: float
    offset: float


def mappings(record, channels, where, source):
    """One Mapping per wanted channel, in the layout's order; ReadError where file and layout disagree.

    ``RawChannel.limit`` and ``resolution`` are in SI already. Channels with the quantity "ignored" are in the file
    but not wanted; nobody misses one that is not there.
    """
    channels = [c for c in channels if c.quantity != IGNORED or _is_there(record, c.source, where, source)]
    indices = [index_of(record, channel.source, where, source) for channel in channels]
    if len(set(indices)) < len(indices):
        twice = next(i for i in indices if indices.count(i) > 1)
        raise source.error(where, f"the layout names the channel {record.names[twice]!r} twice", "Name each once")
    if unknown := sorted(set(range(len(record.names))) - set(indices)):
        names = ", ".join(repr(record.names[i]) for i in unknown)
        raise source.error(
            where,
            f"the file has {'channel' if len(unknown) == 1 else 'channels'} {names}, which the layout does not name",
            f"Add it to the layout, with 'quantity: {IGNORED}' if it is not wanted",
            reason="channel_unknown",
        )
    return tuple(
        _mapping(i, record.units[i], channel, where, source)
        for i, channel in zip(indices, channels)
        if channel.quantity != IGNORED
    )


def index_of(record, wanted, where, source):
    """Row of the channel that a layout calls ``wanted``: a number, a name, or another name the format gives it."""
    if isinstance(wanted, int):
        if 0 <= wanted < len(record.names):
            return wanted
        found = f"there is no channel {wanted}; the file has {len(record.names)}, counted from 0"
        raise source.error(where, found, "Correct the channel map or copy the file again", reason="channel_missing")
    for names in (record.names, [n.strip().casefold() for n in record.names]):
        key = wanted if names is record.names else wanted.strip().casefold()
        if names.count(key) == 1:
            return names.index(key)
    hits = [i for i, others in enumerate(record.aliases) if wanted in others]
    if len(hits) == 1:
        return hits[0]
    there = ", ".join(repr(name) for name in record.names)
    near = get_close_matches(wanted, record.names, n=1)
    hint = f"Did you mean {near[0]!r}? Correct the channel map" if near else "Correct the channel map or the wiring"
    count = record.names.count(wanted) + len(hits)
    found = (
        f"{count} channels are called {wanted!r}" if count > 1 else f"there is no channel {wanted!r}; there are {there}"
    )
    raise source.error(where, found, hint, reason="channel_missing")


def _is_there(record, wanted, where, source):
    try:
        index_of(record, wanted, where, source)
    except ReadError:
        return False
    return True


def _mapping(index, file_unit, raw: RawChannel, where, source):
    try:
        convert = to_si(raw.quantity, settled_unit(file_unit, raw.unit), raw.sensitivity, raw.sensitivity_unit)
    except ValueError as error:
        remedy = "Correct unit and sensitivity of this channel in the layout"
        place = f"{where}, channel {raw.name!r}"
        raise source.error(place, str(error), remedy, reason="unit_unknown") from error
    sign = -1 if raw.sign < 0 else 1
    channel = Channel(
        name=raw.name,
        quantity=raw.quantity,
        position=raw.position,
        mounting=raw.mounting,
        serial=raw.serial,
        limit=raw.limit,
        resolution=raw.resolution,
    )
    return Mapping(index, channel, sign * convert.scale, sign * convert.offset)


def settled_unit(file_unit, layout_unit):
    """The unit of the raw numbers: both must agree where both speak; "V!" in a layout overrules the file.

    Counts of a file become what the layout says that a count is worth: a voltage, or a unit with its factor. Labels
    that say nothing are overruled by the layout; ValueError for another unit that is not known.

    Examples
    --------
    >>> settled_unit("Newtons", None), settled_unit("EU", "mV"), settled_unit("g", "V!"), settled_unit("count", "0.5 N")
    ('Newtons', 'mV', 'V', '0.5 N')
    """
    if layout_unit is None:
        if not file_unit:
            raise ValueError("neither the file nor the layout says the unit")
        return file_unit
    if layout_unit.endswith("!"):
        return layout_unit[:-1]
    stated = conversion(layout_unit)
    if _says_nothing(file_unit.strip().strip("[]").strip()):
        return layout_unit
    try:
        written = conversion(file_unit)
    except ValueError:
        raise ValueError(_both_say(f"{file_unit!r}, which is not known", layout_unit)) from None
    of_a_count = stated.dimension == "voltage" or layout_unit.lstrip(" [+-.")[:1].isdigit()
    same = stated.dimension == written.dimension and abs(stated.scale - written.scale) <= 1e-9 * abs(stated.scale)
    if not same and not (written.dimension == "count" and of_a_count):
        raise ValueError(_both_say(repr(file_unit), layout_unit))
    return layout_unit


def _says_nothing(unit):
    """Whether a label is none, or a number: a count of something else that stands beside the samples."""
    return unit.casefold() in MEANINGLESS or unit.replace(".", "", 1).isdigit()


def _both_say(said, layout_unit):
    return f"the file says {said}, the layout {layout_unit!r} ({layout_unit + '!'!r} would overrule the file)"
