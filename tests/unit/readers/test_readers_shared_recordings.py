"""Every recording of other authors remains readable with the same records and without a rejection.

ORIGIN.md and the headers of the files state the rates and counts. The quantities are only needed for reading.
"""

import gzip

import pytest

from turnout.readers import read
from turnout.readers.frequency_responses import find_responses
from turnout.records import RawChannel, RawDescription
from turnout.stages.file_contents import file_contents

FORCE, RAIL = ("force", "N"), ("acceleration", "m/s²")
# File -> rate [Hz] of the layout, number of records, samples per record, and (source, quantity, unit) of each channel.
RECORDINGS = {
    "hammer_pyfrf/impact2_response0.lvm": (
        51_200.0, 5, 51_200, (("Force (Trigger)", *FORCE), ("Acceleration (Trigger)", *RAIL)),
    ),
    "nonlinear_silverbox/SNLS80mV.csv": (1e7 / 2**14, 1, 131_072, (("V1", *FORCE), ("V2", *RAIL))),
    "uff58_reader_samples/Sample_UFF58_ascii.uff": (65_536.0, 1, 79_292, ((0, "pressure", None),)),
    "uff58_reader_samples/Sample_UFF58b_bin.uff": (65_536.0, 1, 79_292, ((0, "pressure", None),)),
    "uff58_reader_samples/binary8byte.uff": (100.0, 1, 250, (("sine 5 Hz", "acceleration", None),)),
    "uff58_reader_samples/time-history-not-all-columns-filled.uff": (
        20_000.0, 1, 13, (("1x", "acceleration", None),),
    ),
}  # fmt: skip
# File -> number of its frequency responses and of their lines.
RESPONSES = {"uff58_reader_samples/beam.uff.gz": (3, 64_000)}
# Files in formats of recordings that contain none: tables of results, curves of programs, only headers.
WITHOUT_RECORDINGS = {
    "uff58_reader_samples": {"TestLab 161 164 18 15 82.uff", "dataset_milestone_in_header.uff", "non_ascii_header.uff"},
}  # fmt: skip
FOLDERS = ("hammer_pyfrf", "nonlinear_silverbox", "uff58_reader_samples")
EXTENSIONS = (".uff", ".gz", ".lvm", ".csv", ".tdms", ".h5", ".mat", ".npz", ".wav", ".parquet", ".rcmdx")


def test_every_recording_of_the_folder_is_compared(shared_data):
    """Each new file must be added to a list above."""
    files = {str(p.relative_to(shared_data)) for name in FOLDERS for p in (shared_data / name).iterdir()
             if p.suffix.lower() in EXTENSIONS}  # fmt: skip
    without = {f"{folder}/{name}" for folder, names in WITHOUT_RECORDINGS.items() for name in names}
    assert files == {*RECORDINGS, *RESPONSES, *without}


@pytest.mark.parametrize("path", RECORDINGS)
@pytest.mark.parametrize("states_rate", [True, False])
def test_a_recording_of_other_authors_is_read_without_a_rejection(path, states_rate, shared_data):
    """With the rate in the layout, and without it if the file states the rate."""
    rate, n_records, n_samples, channels = RECORDINGS[path]
    if not states_rate and path.endswith(".csv"):
        pytest.skip("the file states no rate")
    sensors = tuple(RawChannel(f"c{i}", source, quantity, unit) for i, (source, quantity, unit) in enumerate(channels))
    description = RawDescription(sensors, rate=rate if states_rate else None)
    result = read(path, shared_data, description)
    records = [*result.recordings, *result.long_recordings]
    assert result.errors == ()
    assert [(r.n_sample, len(r.channels)) for r in records] == [(n_samples, len(channels))] * n_records
    assert [r.rate for r in records] == pytest.approx([rate] * n_records, rel=1e-9, abs=0.0)


@pytest.mark.parametrize("path", RECORDINGS)
def test_inspect_shows_a_recording_of_other_authors_without_a_problem(path, shared_data):
    contents = file_contents(shared_data / path)
    n_records, n_samples = RECORDINGS[path][1:3]
    assert (contents.n_records, contents.n_samples, contents.problems) == (n_records, (n_samples, n_samples), ())


@pytest.mark.parametrize("path", RESPONSES)
def test_frequency_responses_of_other_authors_are_read_without_a_problem(path, shared_data, tmp_path):
    folder = (shared_data / path).parent
    (tmp_path / "a.uff").write_bytes(gzip.decompress((shared_data / path).read_bytes()))
    for root, name in ((folder, (shared_data / path).name), (tmp_path, "a.uff")):
        responses = find_responses(name, root)
        assert responses is not None and responses.frf.shape == RESPONSES[path]
    assert file_contents(tmp_path / "a.uff").problems == ()
