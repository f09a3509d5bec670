"""A file that states more than it can contain, or stores samples elsewhere, is rejected before memory is allocated."""

import io
import json
import os
import struct
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from false_sizes import ACCEPTED, ENDINGS, N_SAMPLE, lengths

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

CHANNELS = tuple(RawChannel(name, name, "acceleration", unit="g") for name in ("a", "b"))
DESCRIPTION = RawDescription(channels=CHANNELS, rate=1000.0)
HUGE = 2**28  # values: 2 GiB of doubles
END = "***End_of_Header***\n"
LVM = f"LabVIEW Measurement\nSeparator\tTab\n{END}\nChannels\t{10**9}\nSamples\t1\n{END}X_Value\ta\n0\t1\n"


def npy_header(path):
    """A header of 2 GiB in a member of a few bytes."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": "<f8", "fortran_order": False, "shape": (HUGE,)})
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", buffer.getvalue())


def npz_zeros(path):
    np.savez_compressed(path.open("wb"), a=np.zeros(2**25), b=np.zeros(2**10))


def npz_directory(path):
    """The directory of the archive states 4 GB."""
    np.savez(path.open("wb"), a=np.zeros(10), b=np.zeros(10))
    content = bytearray(path.read_bytes())
    at = content.find(b"PK\x01\x02")
    content[at + 24 : at + 28] = struct.pack("<I", 2**32 - 2)
    path.write_bytes(content)


def hdf5_unwritten(path):
    with h5py.File(path, "w") as file:
        file.create_dataset("a", (HUGE,), "f8", chunks=(2**20,))
        file["b"] = np.zeros(4)


def hdf5_zeros(path):
    with h5py.File(path, "w") as file:
        for name in ("a", "b"):
            file.create_dataset(name, data=np.zeros(2**24), compression="gzip", chunks=(2**20,))


def mat_zeros(path):
    element = struct.pack("<II", 14, 2**31 - 1) + bytes(64)
    packed = zlib.compress(element)
    path.write_bytes(
        b"MATLAB 5.0".ljust(124) + struct.pack("<H", 0x0100) + b"IM" + struct.pack("<II", 15, len(packed)) + packed
    )


def parquet_repeated(path):
    """Repeated values need no space."""
    column = pa.array(np.zeros(2**24))
    pq.write_table(pa.table({"a": column, "b": column}), path, use_dictionary=True, compression="zstd")


def parquet_columns(path):
    pq.write_table(pa.table({f"c{k}": pa.array([0.0]) for k in range(5000)}), path)


def flac_header(path):
    fields = (1000 << 44) | (7 << 41) | (15 << 36) | (2**36 - 1)
    block = struct.pack(">HH6x", 4096, 4096) + fields.to_bytes(8, "big") + bytes(16)
    path.write_bytes(b"fLaC" + bytes([0x80, 0, 0, 34]) + block)


def lvm_channels(path):
    path.write_text(LVM)


def csv_transposed(path):
    """One row per channel."""
    path.write_text("\n".join(",".join([f"{k}.5"] * 20_000) for k in range(2)) + "\n")


BOMBS = {
    "npz": (npy_header, npz_zeros, npz_directory), "h5": (hdf5_unwritten, hdf5_zeros), "mat": (mat_zeros,),
    "parquet": (parquet_repeated, parquet_columns), "flac": (flac_header,), "lvm": (lvm_channels,),
    "csv": (csv_transposed,),
}  # fmt: skip
CASES = [(suffix, bomb) for suffix, bombs in BOMBS.items() for bomb in bombs]


@pytest.mark.parametrize(("suffix", "bomb"), CASES, ids=[bomb.__name__ for _, bomb in CASES])
def test_a_stated_size_beyond_that_of_the_file_is_rejected(tmp_path, suffix, bomb):
    path = tmp_path / f"A7_1.{suffix}"
    bomb(path)
    with pytest.raises(ReadError, match="A7_1") as caught:
        read(path.name, tmp_path, DESCRIPTION)
    assert caught.value.reason in ("claims_too_much", "unreadable")


def test_no_stated_size_causes_an_allocation_of_memory(tmp_path):
    """All files in one process whose address space is limited to 0.7 GB above that of the program."""
    for suffix, bomb in CASES:
        bomb(tmp_path / f"{bomb.__name__}.{suffix}")
    code = (
        "import resource, sys, re; from pathlib import Path\n"
        "import h5py, pyarrow.parquet, pyarrow.csv, soundfile, scipy.io, pymatreader\n"
        "from turnout.errors import ReadError; from turnout.readers import read\n"
        "from turnout.records import RawDescription\n"
        "size = int(re.search(r'VmSize:\\s*(\\d+)', Path('/proc/self/status').read_text())[1]) * 1024\n"
        "resource.setrlimit(resource.RLIMIT_AS, (size + 700 * 2**20,) * 2)\n"
        "for path in sorted(Path(sys.argv[1]).iterdir()):\n"
        "    try: read(path.name, path.parent, RawDescription(channels=(), rate=1000.0))\n"
        "    except ReadError: continue\n"
        "    raise SystemExit(f'{path} was read')\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]


LIMITED = """
import json, logging, re, resource, sys
from pathlib import Path
import h5py, nptdms, pyarrow.csv, pyarrow.parquet, pymatreader, scipy.io, soundfile
from false_sizes import ENDINGS, outcomes
logging.disable(logging.CRITICAL)
size = int(re.search(r"VmSize:\\s*(\\d+)", Path("/proc/self/status").read_text())[1]) * 1024
resource.setrlimit(resource.RLIMIT_AS, (size + 700 * 2**20,) * 2)
print(json.dumps({format: outcomes(Path(sys.argv[1]), format) for format in ENDINGS}))
"""


@pytest.mark.parametrize("format", ENDINGS)
def test_the_intact_file_of_each_format_is_read(format, tmp_path):
    assert lengths(tmp_path, format) == [[N_SAMPLE], [N_SAMPLE]]


def test_a_false_size_in_a_file_of_any_format_needs_no_memory_and_gives_no_longer_record(tmp_path):
    """Each number that states a size is replaced by each of six false sizes from 2**27 to 2**62."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *filter(None, sys.path)])}
    command = [sys.executable, "-c", LIMITED, str(tmp_path)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    found = json.loads(done.stdout)
    assert sorted(found) == sorted(ENDINGS)
    assert {format: n for format, cases in found.items() if (n := len(cases)) < 8} == {}
    wrong = {(f, place): o for f, cases in found.items() for place, o in cases.items() if o not in ACCEPTED}
    assert wrong == {}


def outside(tmp_path):
    """A file outside the raw root with samples, and the raw root."""
    (tmp_path / "raw").mkdir()
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["a"] = np.arange(1000.0)
    np.arange(1000.0).tofile(tmp_path / "other.bin")
    return tmp_path / "raw" / "A7_1.h5"


def link(file, folder):
    file["a"] = h5py.ExternalLink(str(folder / "other.h5"), "/a")


def group_link(file, folder):
    file["records"] = h5py.ExternalLink("../other.h5", "/")


def storage(file, folder):
    file.create_dataset("a", (1000,), "f8", external=[(str(folder / "other.bin"), 0, h5py.h5f.UNLIMITED)])


def virtual(file, folder):
    layout = h5py.VirtualLayout((1000,), "f8")
    layout[:] = h5py.VirtualSource(str(folder / "other.h5"), "a", (1000,))
    file.create_virtual_dataset("a", layout)


@pytest.mark.parametrize("place", [link, group_link, storage, virtual], ids=lambda f: f.__name__)
@pytest.mark.parametrize("suffix", ["h5", "rcmdx", "mat"])
def test_an_hdf5_file_with_samples_in_another_file_is_rejected_without_opening_the_other(tmp_path, place, suffix):
    path = outside(tmp_path).with_suffix(f".{suffix}")
    with h5py.File(path, "w", userblock_size=512 if suffix == "mat" else 0) as file:
        place(file, tmp_path)
        file["b"] = np.arange(1000.0)
    if suffix == "mat":
        with path.open("r+b") as stream:
            stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    with pytest.raises(ReadError, match=r"in the file|link to the file") as caught:
        read(path.name, path.parent, DESCRIPTION)
    assert caught.value.reason == "outside_root"


def test_a_virtual_dataset_of_the_same_file_is_read(tmp_path):
    path = tmp_path / "A7_1.h5"
    with h5py.File(path, "w") as file:
        file["a"] = np.sin(np.arange(1000.0))
        layout = h5py.VirtualLayout((1000,), "f8")
        layout[:] = h5py.VirtualSource(".", "a", (1000,))
        file.create_virtual_dataset("b", layout)
    (recording,) = read(path.name, tmp_path, DESCRIPTION).recordings
    assert recording.n_sample == 1000


@pytest.mark.parametrize("n_sample", [1000, 2**20])
def test_a_highly_compressed_record_is_read(tmp_path, n_sample):
    """A quiet sensor: 8 MiB of small whole numbers, compressed a hundredfold."""
    rows = np.round(np.sin(np.arange(n_sample) / 5000.0) * 3)
    np.savez_compressed(tmp_path / "A7_1.npz", a=rows, b=rows[::-1])
    (recording,) = read("A7_1.npz", tmp_path, DESCRIPTION).recordings
    assert recording.n_sample == n_sample
