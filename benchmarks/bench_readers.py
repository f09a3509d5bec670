"""CPU time of ``read`` over that of the bare library call on the same file, MB/s, and vendors' files.

The file has 10 records, 2 channels, 1 s at 51,200 Hz in double precision: 16.4 MB of samples. Text formats get a
tenth of it. ``read`` also hashes the file, converts units, and checks every sample and every count.
Small records are 30 of 4,096 samples; their bars are the ratios before statements of rates and scales were checked.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import h5py
import lvm_read
import nptdms
import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pymatreader
import pyuff
import soundfile

from benchmarks.bar import Bar, stopwatch
from turnout.errors import REMARK_REASONS
from turnout.readers import read
from turnout.readers.writing import write
from turnout.records import Channel, RawChannel, RawDescription, Recording

RATE = 51200.0
TEXT_FORMATS = ("uff58", "csv", "lvm")
LIMITED_FORMATS = ("uff58b", "hdf5", "tdms")  # a pipeline within 5 times the bare reading needs a fast reader
REPEATS = 5


def _recordings(n_record, n_sample):
    rng = np.random.default_rng(1)
    channels = (Channel("force", "force"), Channel("rail", "acceleration"))
    return [Recording(rng.normal(size=(2, n_sample)) * [[2e3], [30.0]], RATE, channels) for _ in range(n_record)]


def _description():
    rail = RawChannel("rail", "a1", "acceleration", unit="V", sensitivity=35.3, sensitivity_unit="mV/g")
    force = RawChannel("force", "h", "force", unit="V", sensitivity=0.23, sensitivity_unit="mV/N", sign=-1)
    return RawDescription((force, rail), rate=RATE)


def _npz(path):
    with np.load(path) as archive:
        return [archive[name] for name in archive.files]


def _hdf5(path):
    with h5py.File(path) as file:
        return [channel[()] for record in file.values() for channel in record.values()]


def _rcmdx(path):
    samples = []
    with h5py.File(path) as file:
        file.visititems(lambda _, item: samples.append(item[()]) if isinstance(item, h5py.Dataset) else None)
    return samples


def _tdms(path):
    tdms = nptdms.TdmsFile.read(path)
    return [channel[:] for group in tdms.groups() for channel in group.channels()]


BARE_READERS = {
    "uff58": lambda path: pyuff.UFF(str(path)).read_sets(),
    "uff58b": lambda path: pyuff.UFF(str(path)).read_sets(),
    "tdms": _tdms,
    "hdf5": _hdf5,
    "rcmdx": _rcmdx,
    "mat": pymatreader.read_mat,
    "mat73": pymatreader.read_mat,
    "wav": lambda path: soundfile.read(path),
    "csv": lambda path: pyarrow.csv.read_csv(path, pyarrow.csv.ReadOptions(use_threads=False, skip_rows=4)).to_pandas(),
    "lvm": lambda path: lvm_read.read(path, read_from_pickle=False, dump_file=False),
    "npz": _npz,
    "parquet": lambda path: pyarrow.parquet.read_table(path, use_threads=False),
}


def _fastest(call, *arguments):
    """CPU seconds of the fastest of some rounds of calls, after one call to warm up."""
    with stopwatch() as watch:
        call(*arguments)
    calls = max(1, int(0.1 / max(watch.cpu, 1e-3)))
    times = []
    for _ in range(REPEATS):
        with stopwatch() as watch:
            for _ in range(calls):
                call(*arguments)
        times.append(watch.cpu / calls)
    return min(times)


# CPU time of read over that of the library, 30 records of 4,096 samples, before rates, scales and claims were checked.
SMALL_BEFORE = {
    "uff58": 0.56, "uff58b": 0.46, "tdms": 2.74, "hdf5": 2.58, "rcmdx": 2.37, "mat": 1.84, "mat73": 1.35, "wav": 8.83,
    "csv": 1.53, "lvm": 0.17, "npz": 2.17, "parquet": 2.72,
}  # fmt: skip
N_SMALL, SMALL_SIZE = 30, 4096


def small_records():
    """Small records, of which the checks are the larger part; the limit is the ratio before them."""
    description = _description()
    with tempfile.TemporaryDirectory() as folder:
        for format, bare in BARE_READERS.items():
            n_record, n_sample = (1, N_SMALL * SMALL_SIZE) if format == "wav" else (N_SMALL, SMALL_SIZE)
            path = write(_recordings(n_record, n_sample), Path(folder) / f"a.{format}", format, description)
            ours = _fastest(read, path.name, folder, replace(description, format=format))
            floor = _fastest(bare, path)
            note = f"{1e3 * ours:.1f} ms"
            name = f"read small records over bare library, {format}"
            yield Bar(name, ours / floor, SMALL_BEFORE[format], "times", n=f"n={REPEATS}", note=note)
            path.unlink()


def bars():
    """Speed per format, of long and of small records, then the vendors' files."""
    yield from small_records()
    description = _description()
    with tempfile.TemporaryDirectory() as folder:
        for format, bare in BARE_READERS.items():
            n_record = 1 if format == "wav" else 10
            n_sample = int((0.1 if format in TEXT_FORMATS else 10 / n_record) * RATE)
            path = write(_recordings(n_record, n_sample), Path(folder) / f"a.{format}", format, description)
            full_description = replace(description, format=format, n_records=n_record, n_samples=n_sample)
            result = read(path.name, folder, full_description)
            assert all(e.reason in REMARK_REASONS for e in result.errors), result.errors  # RCM-DX has to state a start
            assert len(result.recordings) == n_record
            ours, floor = _fastest(read, path.name, folder, full_description), _fastest(bare, path)
            megabytes = path.stat().st_size / 1e6
            note = f"{megabytes / ours:.0f} MB/s; library {megabytes / floor:.0f} MB/s"
            limit = 5.0 if format in LIMITED_FORMATS else None
            yield Bar(f"read over bare library, {format}", ours / floor, limit, "times", n=f"n={REPEATS}", note=note)
            path.unlink()
    yield from _vendors()


def _vendors():
    """Every data set of the problem files of pyuff, compared with what pyuff reads."""
    from turnout.readers.uff_datasets import read_datasets

    folder = Path(__file__).resolve().parents[2] / "shared" / "data" / "uff58_reader_samples"
    files = sorted(folder.glob("*.uff"))
    if not files:
        yield Bar("vendor files of UFF 58 and 58b that read", 0, None, "files", note="not on this machine")
        return
    equal = 0
    for path in files:
        theirs = pyuff.UFF(str(path)).read_sets()
        theirs = theirs if isinstance(theirs, list) else [theirs]
        ours = read_datasets(path.read_bytes())
        pairs = [(a.data, b["data"]) for a, b in zip(ours, theirs, strict=True) if b["type"] == 58]
        equal += all(np.array_equal(a, b) for a, b in pairs)
    yield Bar("vendor files of UFF 58 and 58b that read", equal, len(files), "files", ">=", n=f"n={len(files)}")
