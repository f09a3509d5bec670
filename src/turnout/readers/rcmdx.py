"""Reader of RCM-DX, the rail condition monitoring data exchange format (HDF5 below a root RCMDX), versions 1 and 2.

Each data source that samples in time is a record; those that sample by distance or on events are left out. Data sources
are recognised by their time stamps and channels at any level, because releases moved them in the tree. Time stamps are
nanoseconds since 1970 UTC, one per sample, and must agree with ``CommonTriggerFrequency``.

Layout: OpenRail Association, RCM-DX Specification 2.0.2 (document 1.04 of 23.11.2023) and the drafts before it. Groups
and attributes that a later release adds are ignored.
"""

from contextlib import AbstractContextManager, nullcontext
from datetime import UTC, datetime, timedelta
from typing import Any

import h5py
import numpy as np

from turnout.errors import ReadError
from turnout.readers.lazy import is_large, lazy_array
from turnout.readers.named_arrays import Metadata
from turnout.readers.source import CONDITIONS, COPY_AGAIN, MIN_SAMPLES, RawFile, RawRecord, Source
from turnout.readers.statements import entries_of, rate_entry

FREQUENCY_ATTRIBUTES = ("CommonTriggerFrequency", "CommonTriggerFreq", "CommonTriggerFrequence", "TriggerValue")
METADATA_ATTRIBUTES = {*CONDITIONS, "RecordCount"}


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
    with source.parsed_by("HDF5"), _open(source) as file:
        if "RCMDX" not in file:
            raise source.error("the root", "there is no group RCMDX", "Set the format in the layout to hdf5")
        data_sources: list[tuple[h5py.Group, dict]] = []
        _data_sources(file["RCMDX"], {}, data_sources)
        records = []
        for group, notes in data_sources:
            try:
                with source.parsed_by("HDF5", f"data source {group.name!r}"):
                    record: RawRecord | ReadError | None = _record(group, notes, source)
            except ReadError as error:
                record = error
            if record is not None:
                records.append((group.name, record))
    records.sort(key=lambda entry: entry[0])  # sessions are named by their date
    notes = data_sources[0][1] if data_sources else {}
    return RawFile(tuple(record for _, record in records), Metadata(notes, source).count(("recordcount",)))


def _open(source: Source) -> AbstractContextManager[h5py.File]:
    """The file; with a lazy source the datasets keep it open."""
    file = h5py.File(source.path, "r")
    return nullcontext(file) if source.lazy else file


EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def _data_sources(group: h5py.Group, notes: dict[str, Any], data_sources: list[tuple[h5py.Group, dict]]) -> None:
    """Append every group that holds time stamps and channels, with the metadata of its parent groups."""
    notes = {**notes, **{k: group.attrs[k] for k in METADATA_ATTRIBUTES.intersection(group.attrs)}}
    if isinstance(group.get("timestamp"), h5py.Dataset) and any(_is_channel(m) for m in group.values()):
        data_sources.append((group, notes))
        return
    for member in group.values():
        if isinstance(member, h5py.Group):
            _data_sources(member, notes, data_sources)


def _is_channel(member: Any) -> bool:
    return isinstance(member, h5py.Group) and isinstance(member.get("data"), h5py.Dataset)


def _text(value: Any) -> str:
    return (value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)).strip()


def _record(group: h5py.Group, notes: dict[str, Any], source: Source) -> RawRecord | None:
    """The record of one data source; None if it is not sampled in time."""
    channels = {name: member for name, member in group.items() if _is_channel(member)}
    modes = {_text(c.attrs.get("TriggerMode", "TIME")).upper() for c in channels.values()}
    if modes != {"TIME"}:
        return None
    where = f"data source {group.name!r}"
    stamps = group["timestamp"][()].astype("int64")  # unsigned from 2.0.0 on: differences would wrap around
    data = [c["data"] for c in channels.values()]
    samples: list[Any] = [lazy_array(d) if source.lazy and is_large(d) else d[()] for d in data]
    for name, x in zip(channels, samples):
        if len(x) != len(stamps):
            problem = f"{len(x)} samples and {len(stamps)} time stamps"
            raise source.error(f"{where}, channel {name!r}", problem, COPY_AGAIN, reason="truncated")
    if len(stamps) < MIN_SAMPLES:
        raise source.error(where, f"it has {len(stamps)} samples", COPY_AGAIN, reason="empty")
    rates = [
        rate_entry(f"{key} of {name!r}", c.attrs[key])
        for name, c in channels.items()
        for key in FREQUENCY_ATTRIBUTES
        if key in c.attrs and float(c.attrs[key]) != 0.0
    ]
    time = (stamps - stamps[0]) * 1e-9
    names = tuple(name.rpartition(".")[2] for name in channels)
    names = names if len(set(names)) == len(names) else tuple(channels)
    return RawRecord(
        names=names,
        samples=samples,
        entries=(*rates, *entries_of(_attributes(group, channels), "")),
        units=tuple(_text(d.attrs.get("Unit", "")) for d in data),
        started_at=EPOCH + timedelta(microseconds=int(stamps[0]) // 1000),
        conditions={name: _plain(notes[name]) for name in CONDITIONS if name in notes},
        time=time,
        is_time_in_seconds=True,
        aliases=tuple((name,) for name in channels),
    )


def _attributes(group: h5py.Group, channels: dict[str, h5py.Group]) -> dict[str, dict]:
    """Attributes of a data source, of the groups above it, and of its channels and their data, by path."""
    path, members = group.name, [group]
    while path := path.rpartition("/")[0]:
        members.append(group.file[path])
    members += [member for channel in channels.values() for member in (channel, channel["data"])]
    own = {*FREQUENCY_ATTRIBUTES, "TriggerMode"}
    return {
        m.name: {k: _plain(v) for k, v in m.attrs.items() if k not in own and not isinstance(v, np.ndarray)}
        for m in members
    }


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else _text(value)
