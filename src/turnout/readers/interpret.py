"""Conversion of raw records to recordings in SI units, for all formats.

It assigns the channels of a file to those of the layout, converts units and checks what the layout states.
"""

from dataclasses import dataclass, replace
from difflib import get_close_matches
from types import MappingProxyType

import numpy as np

from turnout.errors import ReadError
from turnout.readers.lazy import Soundness, Stretches, fault
from turnout.readers.source import COPY_AGAIN
from turnout.readers.timing import check_order, check_time, settled_rate, starts_of
from turnout.records import Channel, LongRecording, RawChannel, RawDescription, Recording
from turnout.units import IGNORED, conversion, to_si

# Labels that loggers write for a unit that was not configured; in lower case.
MEANINGLESS = ("", "-", "eu", "none", "n/a", "a.u.", "arb", "?", "unknown", "undefined", "unitless")


@dataclass(frozen=True)
class Mapping:
    """Row ``index`` of the file becomes ``channel``: SI = ``scale`` * number + ``offset``, sign included."""

    index: int
    channel: Channel
    scale: float
    offset: float


def mappings(record, channels, where, source):
    """One ChannelMapping per channel that is read, in the layout's order; ReadError if file and layout disagree.

    ``RawChannel.limit`` and ``resolution`` are in SI already. Channels with the quantity "ignored" are not read and
    may be absent.
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
    """Row of the channel that the layout calls ``wanted``: a number, a name, or an alias of the format."""
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
    """Unit of the raw numbers. File and layout must agree if both state one; "V!" in a layout overrules the file.

    If the file states counts, the layout gives the value of one count: a voltage, or a unit with a factor. The layout
    overrules meaningless labels. ValueError for any other unknown unit.

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
    """Whether a label is no unit: a placeholder, or a number that some loggers write there."""
    return unit.casefold() in MEANINGLESS or unit.replace(".", "", 1).isdigit()


def _both_say(said, layout_unit):
    return f"the file says {said}, the layout {layout_unit!r} ({layout_unit + '!'!r} would overrule the file)"


TOO_SHORT = 2  # fewest samples of a record: one sample has neither rate nor spread


def describe(raw, description: RawDescription, source, longest=None):
    """(recordings, errors) of a raw file. A damaged record does not affect the other records.

    In a passage a dead or non-finite channel is left out of the recording and adds an error. A hammer test needs all
    its channels. A record of more than ``max_duration`` seconds becomes a ``LongRecording`` if the source is lazy.
    """
    if not raw.records and not raw.expected:
        raise source.error("the file", "it holds no record", COPY_AGAIN, reason="empty")
    recordings, errors = [], []
    stamps = [(k, record.started_at) for k, record in enumerate(raw.records) if not isinstance(record, ReadError)]
    starts = starts_of(stamps, description.time_zone)
    backwards = check_order(starts, source)
    for k, record in enumerate(raw.records):
        try:
            if isinstance(record, ReadError):
                raise record
            if k in backwards:
                raise backwards[k]
            limit = longest if source.stay and description.kind == "passage" else None
            recording, lost = _recording(record, k, len(raw.records), description, source, limit)
            recordings.append(replace(recording, started_at=dict(starts)[k]))
            errors.extend(lost)
        except ReadError as error:
            errors.append(error)
    errors.extend(_count_errors(raw, description, source))
    return tuple(recordings), tuple(errors)


def _count_errors(raw, description, source):
    """Errors where the number of records differs from that stated by the layout or by the file itself."""
    there = len(raw.records)
    of_layout = _or_layout("records", description.n_records)
    promises = (("the layout", description.n_records, of_layout), ("its own header", raw.expected, COPY_AGAIN))
    for who, promised, remedy in promises:
        if promised is not None and there < promised:
            found = f"it holds {there} of the {promised} records that {who} promises"
            yield source.error(f"record {there + 1} of {promised}", found, remedy, reason="truncated")
            return
    if description.n_records is not None and there > description.n_records:
        found = f"it holds {there} records, {there - description.n_records} more than the layout promises"
        remedy = "Correct records in the layout, or find out whether two tests share one file"
        yield source.error(f"record {description.n_records + 1}", found, remedy, reason="wrong_length")


def _or_layout(key, promised):
    """Remedy if a file holds less than the layout's ``key`` states: either may be wrong."""
    return f"{COPY_AGAIN}; if it is whole, correct '{key}: {promised}' in the layout (null: any number)"


def _recording(record, k, n_record, description, source, longest):
    """(recording, errors of channels left out) of raw record ``k``; ReadError if the record cannot be used."""
    where = f"record {k + 1} of {n_record}"
    n_sample = _sample_count(record, where, description.n_samples, source)
    if record.time is not None:
        check_time(record.time, where, source)
    rate = settled_rate(record, description.rate, where, source)
    mapped = mappings(record, description.channels, where, source)
    if not mapped:
        raise source.error(where, "the layout wants none of its channels", "Name channels in the layout")
    stretches = Stretches(record, mapped, where, source, source.state())
    stays = longest is not None and n_sample / rate > longest
    samples = np.empty((0, 0)) if stays else stretches(0, n_sample)
    judged = Soundness.over(stretches, n_sample).by_channel() if stays else [_judged(row) for row in samples]
    faults = {i: e for i, j in enumerate(judged) if (e := fault(n_sample, j, mapped[i].channel, where, source))}
    if faults and (description.kind != "passage" or len(faults) == len(mapped)):
        raise next(iter(faults.values()))
    kept = [i for i in range(len(mapped)) if i not in faults]
    known = {
        "rate": rate,
        "channels": tuple(mapped[i].channel for i in kept),
        "kind": description.kind,
        "source": source.name,
        "record": k,
        "conditions": MappingProxyType(dict(record.conditions)),
    }
    lost = list(faults.values())
    if stays:
        return LongRecording(stretches.of(kept), n_sample, **known), lost
    return Recording(samples=samples if not faults else samples[kept], **known), lost


def _sample_count(record, where, promised, source):
    lengths = {name: len(x) for name, x in zip(record.names, record.samples)}
    shortest = min(lengths.values(), default=0)
    longest = max(lengths.values(), default=0)
    if shortest != longest:
        short = next(name for name, n in lengths.items() if n == shortest)
        found = f"channel {short!r} ends after {shortest} samples, others after {longest}"
        raise source.error(where, found, COPY_AGAIN, reason="truncated")
    if promised is not None and shortest < promised:
        found = f"ends after {shortest} of the {promised} samples that the layout promises"
        raise source.error(where, found, _or_layout("samples", promised), reason="truncated")
    if promised is not None and shortest > promised:
        found = f"it has {shortest} samples instead of {promised}"
        remedy = "Correct samples in the layout, or find out why the logger was set differently"
        raise source.error(where, found, remedy, reason="wrong_length")
    if shortest < TOO_SHORT:
        raise source.error(
            where, f"it has {shortest} samples", COPY_AGAIN, reason="empty" if not shortest else "truncated"
        )
    return shortest


def _judged(row):
    """(number of non-finite samples, index of the first, first value, whether all are equal) of a channel (n,)."""
    with np.errstate(over="ignore", invalid="ignore"):
        suspect = not np.isfinite(row.sum())
    n_bad, first_bad = 0, -1
    if suspect and not (finite := np.isfinite(row)).all():
        n_bad, first_bad = int(np.count_nonzero(~finite)), int(np.argmin(finite))
    return n_bad, first_bad, row[0], bool(row[0] == row[-1] and row.min() == row.max())
