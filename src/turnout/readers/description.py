"""The stage that all formats share: raw records and what the layout promises -> recordings in SI units."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np

from turnout.errors import ReadError
from turnout.readers.channels import mappings
from turnout.readers.clock import check_time, settled_rate
from turnout.readers.long_record import Soundness, Stretches, fault
from turnout.readers.raw import COPY_AGAIN
from turnout.readers.started import check_order, starts_of
from turnout.records import LongRecording, RawDescription, Recording

TOO_SHORT = 2  # samples; one sample has neither rate nor spread


def describe(raw, description: RawDescription, source, longest=None):
    """(recordings, errors) of a raw file; a damaged record costs that record only.

    In a passage, a channel that is dead or not finite costs that channel only: the recording goes without it and
    the error says so. A hammer test needs all its channels. A record of more than ``longest`` seconds becomes a
    ``LongRecording`` where the source lets samples stay in the file.
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
    """What the layout, or the file itself, promises about the number of records, and does not keep."""
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
    """The remedy where a file holds less than the layout's ``key`` promises: either may be wrong."""
    return f"{COPY_AGAIN}; if it is whole, correct '{key}: {promised}' in the layout (null: any number)"


def _recording(record, k, n_record, description, source, longest):
    """(recording, errors of its lost channels) of raw record ``k``; ReadError where it cannot be used."""
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
    """(samples that are not finite, the first of them, first value, whether all are equal) of a channel (n,)."""
    with np.errstate(over="ignore", invalid="ignore"):
        suspect = not np.isfinite(row.sum())
    n_bad, first_bad = 0, -1
    if suspect and not (finite := np.isfinite(row)).all():
        n_bad, first_bad = int(np.count_nonzero(~finite)), int(np.argmin(finite))
    return n_bad, first_bad, row[0], bool(row[0] == row[-1] and row.min() == row.max())
