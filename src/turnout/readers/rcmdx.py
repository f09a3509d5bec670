"""Reader of RCM-DX, the rail condition monitoring data exchange format (HDF5 below a root RCMDX), versions 1 and 2.

Each data source that samples in time is a record; those that sample by distance or on events are left out. Data sources
are recognised by their time stamps and channels at any level, because releases moved them in the tree. Time stamps are
nanoseconds since 1970 UTC, one per sample, and must agree with ``CommonTriggerFrequency``.

Layout: OpenRail Association, RCM-DX Specification 2.0.2 (document 1.04 of 23.11.2023) and the drafts before it. Groups
and attributes that a later release adds are ignored.
"""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import h5py
import numpy as np

from turnout.errors import ReadError
from turnout.readers.array_metadata import Metadata, single_value
from turnout.readers.declared_sizes import check_hdf5, open_hdf5
from turnout.readers.entries import entries_of, rate_entry
from turnout.readers.lazy import is_large, lazy_array
from turnout.readers.source import CONDITIONS, COPY_AGAIN, MIN_SAMPLES, RawFile, RawRecord, Source
from turnout.readers.stated_scales import scale_text, without_drawings

FREQUENCY_ATTRIBUTES = ("CommonTriggerFrequency", "CommonTriggerFreq", "CommonTriggerFrequence", "TriggerValue")
METADATA_ATTRIBUTES = {*CONDITIONS, "RecordCount"}
# Attributes that the specification defines and that say nothing about rate, scale and conditions; not read, for speed.
FURTHER_ATTRIBUTES = {
    b"Element", b"ID", b"ChannelBasis", b"CommonTriggerDistance", b"MeasurementType", b"MoveDirAutoInvert", b"Neighbor",
    b"PositionOffset",
}  # fmt: skip


def read_raw(source: Source) -> RawFile:
    """Records of an RCM-DX file, in the order of its sessions.

    Parameters
    ----------
    source : Source
        The RCM-DX file.

    Returns
    -------
    RawFile
        One record per data source that samples in time.

    Raises
    ------
    ReadError
        If the file cannot be opened, or has no group RCMDX.
    """
    with source.parsed_by("HDF5"), open_hdf5(source) as file:
        check_hdf5(file, source)
        if "RCMDX" not in file:
            raise source.error("the root", "there is no group RCMDX", "Set the format in the layout to hdf5")
        data_sources: list[DataSource] = []
        _data_sources(file["RCMDX"], "/RCMDX", {}, data_sources)
        records = []
        for data_source in data_sources:
            try:
                with source.parsed_by("HDF5", f"data source {data_source.path!r}"):
                    record: RawRecord | ReadError | None = _record(data_source, source)
            except ReadError as error:
                record = error
            if record is not None:
                records.append((data_source.path, record))
    records.sort(key=lambda entry: entry[0])  # sessions are named by their date
    notes = _notes(data_sources[0].attributes) if data_sources else {}
    return RawFile(tuple(record for _, record in records), Metadata(notes, source).count(("recordcount",)))


EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True)
class DataSource:
    """A group with time stamps and channels; ``attributes`` are its own and those of the groups above, by path."""

    group: h5py.Group
    path: str
    attributes: dict[str, dict[str, Any]]
    channels: dict[str, tuple[h5py.Group, h5py.Dataset]]


def _data_sources(
    group: h5py.Group, path: str, above: dict[str, dict[str, Any]], data_sources: list[DataSource]
) -> None:
    """Append every group that holds time stamps and channels, with the attributes of its parent groups."""
    attributes = {path: _attributes_of(group), **above}
    members = dict(group.items())
    if isinstance(members.get("timestamp"), h5py.Dataset):
        channels = {name: (m, d) for name, m in members.items() if (d := _data_of(m)) is not None}
        if channels:
            data_sources.append(DataSource(group, path, attributes, channels))
            return
    for name, member in members.items():
        if isinstance(member, h5py.Group):
            _data_sources(member, f"{path}/{name}", attributes, data_sources)


def _attributes_of(member: Any) -> dict[str, Any]:
    """Attributes of a group or dataset that may matter."""
    names: list[bytes] = []
    h5py.h5a.iterate(member.id, lambda name, *_: names.append(name))  # returns None, so that it goes on
    wanted = [name.decode("utf-8", "surrogateescape") for name in names if name not in FURTHER_ATTRIBUTES]
    return {name: member.attrs[name] for name in wanted}


def _data_of(member: Any) -> h5py.Dataset | None:
    """The samples of a channel; None if the member is no channel."""
    data = member.get("data") if isinstance(member, h5py.Group) else None
    return data if isinstance(data, h5py.Dataset) else None


def _notes(attributes: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Conditions and the number of records among the attributes; those of the innermost group count."""
    return {k: v for of in reversed(attributes.values()) for k, v in of.items() if k in METADATA_ATTRIBUTES}


def _text(value: Any) -> str:
    return (value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)).strip()


def _record(data_source: DataSource, source: Source) -> RawRecord | None:
    """The record of one data source; None if it is not sampled in time."""
    group, path, channels = data_source.group, data_source.path, data_source.channels
    settings = {name: _attributes_of(channel) for name, (channel, _) in channels.items()}
    of_data = {name: _attributes_of(data) for name, (_, data) in channels.items()}
    modes = {_text(attributes.get("TriggerMode", "TIME")).upper() for attributes in settings.values()}
    if modes != {"TIME"}:
        return None
    where = f"data source {path!r}"
    stamps = group["timestamp"][()].astype("int64")  # unsigned from 2.0.0 on: differences would wrap around
    data = [dataset for _, dataset in channels.values()]
    samples: list[Any] = [lazy_array(d) if source.lazy and is_large(d) else d[()] for d in data]
    for name, x in zip(channels, samples):
        if len(x) != len(stamps):
            problem = f"{len(x)} samples and {len(stamps)} time stamps"
            raise source.error(f"{where}, channel {name!r}", problem, COPY_AGAIN, reason="truncated")
    if len(stamps) < MIN_SAMPLES:
        raise source.error(where, f"it has {len(stamps)} samples", COPY_AGAIN, reason="empty")
    rates = [
        rate_entry(f"{key} of {name!r}", attributes[key])
        for name, attributes in settings.items()
        for key in FREQUENCY_ATTRIBUTES
        if key in attributes and float(attributes[key]) != 0.0
    ]
    places = {
        **data_source.attributes,
        **{f"{path}/{name}": attributes for name, attributes in settings.items()},
        **{f"{path}/{name}/data": attributes for name, attributes in of_data.items()},
    }
    above = {k: v for attributes in reversed(data_source.attributes.values()) for k, v in attributes.items()}
    scales = [scale_text({**without_drawings(above), **settings[name], **of_data[name]}) for name in channels]
    notes = _notes(data_source.attributes)
    time = (stamps - stamps[0]) * 1e-9
    names = tuple(name.rpartition(".")[2] for name in channels)
    names = names if len(set(names)) == len(names) else tuple(channels)
    return RawRecord(
        names=names,
        samples=samples,
        entries=(*rates, *entries_of(_plain_attributes(places), "")),
        units=tuple(_text(attributes.get("Unit", "")) for attributes in of_data.values()),
        started_at=EPOCH + timedelta(microseconds=int(stamps[0]) // 1000),
        conditions={name: single_value(_plain(notes[name]), 0, 1) for name in CONDITIONS if name in notes},
        time=time,
        is_time_in_seconds=True,
        aliases=tuple((name,) for name in channels),
        undecided={i: text for i, text in enumerate(scales) if text},
    )


def _plain_attributes(places: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Attributes by path, without those that the format defines and without arrays."""
    defined = {*FREQUENCY_ATTRIBUTES, "TriggerMode"}
    return {
        path: {k: _plain(v) for k, v in attributes.items() if k not in defined and not isinstance(v, np.ndarray)}
        for path, attributes in places.items()
    }


def _plain(value: Any) -> Any:
    is_number = isinstance(value, np.generic) and not isinstance(value, np.bytes_)
    return value.item() if is_number else value if isinstance(value, np.ndarray) else _text(value)
