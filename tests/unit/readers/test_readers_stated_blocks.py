"""Numbers of blocks and samples of a block in the head of a file, beside the samples that the file has."""

import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
CHANNELS = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
SAMPLES = np.random.default_rng(3).normal(size=(400, 2)).round(4)


def errors_of(tmp_path, lines, checked=()):
    rows = [f"{a:.4f},{b:.4f}" for a, b in SAMPLES]
    (tmp_path / "a.csv").write_text("\n".join([*lines, "force [N],rail [m/s²]", *rows, ""]), "utf-8")
    result = read("a.csv", tmp_path, RawDescription(CHANNELS, rate=RATE, checked_entries=checked))
    np.testing.assert_allclose([r.samples for r in result.recordings], [SAMPLES.T])
    return result.errors


MISSING = [
    ("Blocks,4", "Block size,200"), ("Number of segments,3", "Segment length,400"), ("SegmentSize,401",),
    ("Anzahl Blöcke,2", "Blockgröße,300"), ("nSweeps,2", "Samples per sweep,400"), ("Frame count,5", "FrameSize,100"),
]  # fmt: skip


@pytest.mark.parametrize("lines", MISSING)
def test_blocks_of_more_samples_than_the_file_has_are_a_remark(lines, tmp_path):
    (error,) = errors_of(tmp_path, lines)
    assert error.reason == "entry_unknown" and "the file has 400 samples" in str(error)
    assert not errors_of(tmp_path, lines, checked=(lines[-1].partition(",")[0],))


@pytest.mark.parametrize(
    "lines",
    [
        ("Blocks,2", "Block size,200"), ("SegmentSize,400",), ("Segments,1", "SegmentSize,400"), ("Block size,256",),
        ("Blocks,4",), ("Block size,4096", "Number of samples,400"), ("Block size,64 kB",),
        ("Frames,400", "Frame size,8"),  # bytes of a sample of all channels
    ],
)  # fmt: skip
def test_blocks_that_the_samples_fill_are_no_remark(lines, tmp_path):
    assert not errors_of(tmp_path, lines)


def test_blocks_are_those_of_all_records_together(tmp_path):
    head = "Blocks,2\nBlock size,400\nrecord,force [N],rail [m/s²]\n"
    rows = [f"{1 if k < 400 else 2},{a:.4f},{b:.4f}" for k, (a, b) in enumerate([*SAMPLES, *SAMPLES[::-1]])]
    (tmp_path / "a.csv").write_text(head + "\n".join(rows) + "\n", "utf-8")
    result = read("a.csv", tmp_path, RawDescription(CHANNELS, rate=RATE))
    assert (len(result.recordings), result.errors) == (2, ())
