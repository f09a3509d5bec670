"""A start of a clock that was never set, such as 1904-01-01, counts only where the file states no other."""

import h5py
import numpy as np
import pytest
import scipy.io
from nptdms import ChannelObject, RootObject, TdmsWriter

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

CHANNELS = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))
DESCRIPTION = RawDescription(CHANNELS, rate=5000.0)
SAMPLES = np.random.default_rng(1).normal(size=(2, 400)).round(4)
EPOCHS = ["1601-01-01T00:00:00", "1904-01-01T00:00:00", "1970-01-01T00:12:34", "1980-01-06T00:00:00"]
START = "2026-05-13T08:30:00"


def start_and_problems(name, tmp_path):
    result = read(name, tmp_path, DESCRIPTION)
    return str(result.recordings[0].started_at), [error.problem for error in result.errors]


def write_csv(tmp_path, *lines):
    rows = "".join(f"{f};{r}\n" for f, r in SAMPLES.T)
    (tmp_path / "a.csv").write_text("\n".join((*lines, "force;rail", rows)))
    return "a.csv"


def write_tdms(tmp_path, epoch, properties):
    with TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        waveform = {"wf_increment": 2e-4, "wf_start_time": np.datetime64(epoch)}
        channels = [ChannelObject("g", name, x, waveform) for name, x in zip(("force", "rail"), SAMPLES)]
        writer.write_segment([RootObject(properties), *channels])
    return "a.tdms"


def write_mat(tmp_path, epoch):
    content = {"force": SAMPLES[0], "rail": SAMPLES[1], "fs": 5000.0, "start_time": epoch, "date_time": START}
    scipy.io.savemat(tmp_path / "a.mat", content)
    return "a.mat"


def write_hdf5(tmp_path, epoch):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["force"], file["rail"] = SAMPLES
        file.attrs.update(fs=5000.0, start_time=epoch, recorded_at=START)
    return "a.h5"


def write_lvm(tmp_path, epoch):
    day, clock = epoch.replace("-", "/").split("T")
    rows = "".join(f"\t{f}\t{r}\n" for f, r in SAMPLES.T)
    end = "***End_of_Header***\t\n"
    text = (
        f"LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tNo\nDate\t2026/05/13\nTime\t08:30:00\n{end}\n"
        f"Channels\t2\t\nSamples\t400\t400\nDate\t{day}\t{day}\nTime\t{clock}\t{clock}\nX0\t0\t0\n"
        f"Delta_X\t0.0002\t0.0002\n{end}X_Value\tforce\trail\tComment\n{rows}"
    )
    (tmp_path / "a.lvm").write_text(text)
    return "a.lvm"


@pytest.mark.parametrize("epoch", EPOCHS)
def test_another_start_counts_more_than_that_of_an_unset_clock(epoch, tmp_path):
    names = [
        write_csv(tmp_path, f"Start: {epoch}", f"Recorded on: {START}"),
        write_tdms(tmp_path, epoch, {"DateTime": np.datetime64(START)}),
        write_mat(tmp_path, epoch),
        write_hdf5(tmp_path, epoch),
        write_lvm(tmp_path, epoch),
    ]
    found = {name: start_and_problems(name, tmp_path) for name in names}
    assert found == dict.fromkeys(names, ("2026-05-13 08:30:00", []))


@pytest.mark.parametrize("head", [f"Start: {START}", "Start: 1904-01-01T00:00:00"])
def test_a_time_column_and_a_head_of_which_one_was_never_set_state_one_start(head, tmp_path):
    day = "1970-01-01 00:00" if START in head else "2026-05-13 08:30"
    rows = "".join(f"{day}:{k / 5000:08.5f};{f};{r}\n" for k, (f, r) in enumerate(SAMPLES.T))
    (tmp_path / "a.csv").write_text(f"{head}\nTimestamp;force;rail\n{rows}")
    assert start_and_problems("a.csv", tmp_path) == ("2026-05-13 08:30:00", [])


@pytest.mark.parametrize("epoch", EPOCHS)
def test_an_unset_clock_alone_is_reported(epoch, tmp_path):
    for name in (write_csv(tmp_path, f"Start: {epoch}"), write_tdms(tmp_path, epoch, {})):
        start, problems = start_and_problems(name, tmp_path)
        assert start == "None" and len(problems) == 1 and "the logger's clock was not set" in problems[0]
