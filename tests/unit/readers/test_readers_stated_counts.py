"""Number of samples in the metadata of any format, names of the rate in further languages, incomplete scales."""

import json
from dataclasses import replace

import h5py
import nptdms
import numpy as np
import pytest
import scipy.io
import soundfile

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.rate_statements import statements_of_value
from turnout.readers.rate_vocabulary import CERTAIN, name_meaning
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
CHANNELS = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))
SAMPLES = np.random.default_rng(1).normal(size=(400, 2)).round(6)


def as_npz(path, **entries):
    np.savez(path, force=SAMPLES[:, 0], rail=SAMPLES[:, 1], **entries)


def as_mat(path, **entries):
    scipy.io.savemat(path, {"force": SAMPLES[:, 0], "rail": SAMPLES[:, 1], **entries})


def as_hdf5(path, **entries):
    with h5py.File(path, "w") as file:
        file["force"], file["rail"] = SAMPLES.T
        file.attrs.update(entries)


def as_tdms(path, **entries):
    with nptdms.TdmsWriter(str(path)) as writer:
        properties = {"wf_increment": 1 / RATE}
        channels = [nptdms.ChannelObject("hit", n, x, properties) for n, x in zip(("force", "rail"), SAMPLES.T)]
        writer.write_segment([nptdms.RootObject(entries), *channels])


def as_wav(path, **entries):
    with soundfile.SoundFile(str(path), "w", int(RATE), 2, "DOUBLE") as file:
        file.comment = json.dumps({"channels": ["force", "rail"], **entries})
        file.write(SAMPLES)


FORMATS = {"npz": as_npz, "mat": as_mat, "h5": as_hdf5, "tdms": as_tdms, "wav": as_wav}


def result_of(tmp_path, name):
    return read(name, tmp_path, RawDescription(CHANNELS, rate=RATE))


@pytest.mark.parametrize("name", ["n_samples", "Number of samples", "Samples", "Anzahl Messwerte"])
@pytest.mark.parametrize("extension", FORMATS)
def test_a_file_with_fewer_samples_than_it_states_is_reported_as_truncated(extension, name, tmp_path):
    entry = name.replace(" ", "_") if extension in ("npz", "mat") else name
    FORMATS[extension](tmp_path / f"a.{extension}", **{entry: 500})
    (error,) = result_of(tmp_path, f"a.{extension}").errors
    assert error.reason == "truncated" and "the file ends after 400 of the 500 samples that" in str(error)


@pytest.mark.parametrize(
    ("entries", "is_whole"),
    [({"Record Length": 500}, False), ({"Record Length": 500, "Number of samples": 450}, False),
     ({"Record Length": 500, "Number of samples": 400}, True), ({"Samples": 400, "Number of points": 4000}, True)],
)  # fmt: skip
@pytest.mark.parametrize("extension", ["h5", "tdms", "wav"])
def test_the_length_of_a_memory_beside_that_of_the_saved_part_is_no_loss(extension, entries, is_whole, tmp_path):
    FORMATS[extension](tmp_path / f"a.{extension}", **entries)
    result = result_of(tmp_path, f"a.{extension}")
    assert len(result.recordings) == is_whole
    if not is_whole:
        assert result.errors[0].reason == "truncated" and "write 'checked_entries: " in str(result.errors[0])
        checked = RawDescription(CHANNELS, rate=RATE, checked_entries=tuple(entries))
        assert len(read(f"a.{extension}", tmp_path, checked).recordings) == 1


@pytest.mark.parametrize("count", [400, 399, 0])
@pytest.mark.parametrize("extension", FORMATS)
def test_a_file_with_as_many_samples_as_it_states_is_read(extension, count, tmp_path):
    FORMATS[extension](tmp_path / f"a.{extension}", n_samples=count)
    assert len(result_of(tmp_path, f"a.{extension}").recordings) == 1


@pytest.mark.parametrize("stated, n_recording", [(1200, 3), (400, 3), (1201, 0)])
def test_the_number_may_count_the_samples_of_all_records(stated, n_recording, tmp_path):
    records = {f"record_{k:03d}": SAMPLES.T + k for k in range(3)}
    np.savez(tmp_path / "a.npz", **records, channels=np.array(["force", "rail"]), number_of_samples=stated)
    assert len(result_of(tmp_path, "a.npz").recordings) == n_recording


@pytest.mark.parametrize("text", ["force, rail", "force;rail", "force\trail", "force|rail"])
def test_names_in_one_text_are_used_for_the_columns(text, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["data"] = SAMPLES
        file["data"].attrs.update(channel_names=text, units="N, m/s²", sample_rate=RATE)
    np.testing.assert_allclose(result_of(tmp_path, "a.h5").recordings[0].signal("rail"), SAMPLES[:, 1])


@pytest.mark.parametrize(
    "name, is_step",
    [
        ("Częstotliwość próbkowania", False), ("Okres próbkowania", True), ("Näytteenottotaajuus", False),
        ("Provtagningsfrekvens", False), ("Taxa de amostragem", False), ("Período de amostragem", True),
        ("Mintavételi frekvencia", False), ("Vzorkovací frekvence", False), ("Örnekleme frekansı", False),
        ("Örnekleme aralığı", True), ("Частота дискретизации", False), ("Период дискретизации", True),
        ("Frecvență de eșantionare", False), ("采样频率", False), ("采样间隔", True), ("サンプリング周波数", False),
        ("サンプリング間隔", True), ("Συχνότητα δειγματοληψίας", False), ("Frekvencija uzorkovanja", False),
    ],
)  # fmt: skip
def test_a_rate_or_a_step_is_identified_in_further_languages(name, is_step):
    assert (meaning := name_meaning(name)).certainty == CERTAIN and meaning.is_step == is_step
    (statement,) = statements_of_value(name, 1 / 25600 if is_step else 25600.0, "float")
    assert statement.usual.rate == pytest.approx(25600.0)


@pytest.mark.parametrize(
    "name",
    ["Počet vzorků", "Liczba próbek", "Taajuus", "Częstotliwość graniczna", "Частота среза", "截止频率", "Okres"],
)
def test_another_frequency_period_or_count_is_not_read_as_the_rate(name):
    assert name_meaning(name).certainty != CERTAIN


@pytest.mark.parametrize(
    "properties, words",
    [
        ({"NI_Scale[0]_Scale_Type": "RTD"}, "its scale 'RTD' cannot be applied, npTDMS says 'NI_Scale[0]_RTD_"),
        ({"NI_Scale[0]_Scale_Type": "Linear", "NI_Scale[0]_Linear_Slope": 2.0}, "its scale 'Linear' cannot be applied"),
        ({"NI_Scale[0]_Linear_Slope": 2.0}, "its scale without a type cannot be applied"),
    ],
)
def test_a_scale_without_its_properties_is_an_error(properties, words, tmp_path):
    scale = {"NI_Number_Of_Scales": 1, "NI_Scaling_Status": "unscaled", **properties}
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        codes = (SAMPLES * 1000).astype("int16").T
        channels = [
            nptdms.ChannelObject("hit", n, x, {"wf_increment": 1 / RATE, **scale})
            for n, x in zip(("force", "rail"), codes)
        ]
        writer.write_segment(channels)
    (error,) = result_of(tmp_path, "a.tdms").errors
    assert error.reason == "scale_unknown" and words in str(error) and "channel 'force'" in str(error)


@pytest.mark.parametrize("content", [b"\xef\xbb\xbf", b"\xef\xbb\xbf  ", b" \t "])
def test_a_text_without_any_character_is_reported_as_empty(content, tmp_path):
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(ReadError, match="there is no text") as raised:
        result_of(tmp_path, "a.csv")
    assert raised.value.reason == "empty"


VALID = {
    "valid_samples": True, "ValidSamples": True, "n_valid": True, "last_valid_index": True, "samples_written": True,
    "Anzahl gültiger Werte": True, "used samples": True, "write_index": True,
    "valid": False, "valid_until": False, "n_used": False, "used sensors": False, "number of valid impacts": False,
    "actual position": False, "valid_bits": False,
}  # fmt: skip


@pytest.mark.parametrize(("format", "name"), [("hdf5", "valid_samples"), *(("npz", name) for name in VALID)])
def test_a_partly_filled_buffer_is_reported(format, name, tmp_path):
    """Formerly, the zeros after the last measured sample were read as samples."""
    samples = np.random.default_rng(3).normal(size=(2, 60))
    samples[:, 45:] = 0.0

    def problems(number, checked=()):
        if format == "hdf5":
            with h5py.File(tmp_path / "a.hdf5", "w") as file:
                file["force"], file["rail"] = samples
                file["rail"].attrs[name] = number
        else:
            np.savez(tmp_path / "a.npz", force=samples[0], rail=samples[1], **{name: number})
        sensors = (
            RawChannel("force", "force", "force", unit="N"),
            RawChannel("rail", "rail", "acceleration", unit="g"),
        )
        description = RawDescription(sensors, rate=1e3)
        result = read(f"a.{format}", tmp_path, replace(description, checked_entries=checked))
        return [str(e) for e in result.errors if e.reason == "wrong_length"]

    unfilled = problems(45)
    assert bool(unfilled) == VALID[name] and all("is 45, and there are 60 samples" in text for text in unfilled)
    assert (
        not problems(45, (name,)) and not problems(60) and bool(problems(59)) == (VALID[name] and "index" not in name)
    )


COUNTS = {"n_valid": (2, 3), "valid_count": (2, 3), "valid_samples": (None, 2)}  # accepted and rejected numbers


@pytest.mark.parametrize("name", COUNTS)
def test_a_number_of_valid_items_may_be_a_number_of_records_in_a_file_of_several_records(name, tmp_path):
    def problems(number):
        with h5py.File(tmp_path / "a.hdf5", "w") as file:
            for k in range(2):
                file[f"run{k}/force"], file[f"run{k}/rail"] = SAMPLES.T
            file.attrs[name] = number
        return [e for e in result_of(tmp_path, "a.hdf5").errors if e.reason == "wrong_length"]

    accepted, rejected = COUNTS[name]
    assert len(problems(rejected)) == 2 and (accepted is None or not problems(accepted))


ENDS = {  # name and time of the end of a record of 1 s from 10:00:00.25, and whether it is reported
    ("Stop", "10:00:01.25"): False, ("End time", "10:00:01.03"): True, ("Messende", "10:00:02.25"): True,
    ("end of recording", "10:00:01.50"): True, ("Calibration end", "10:00:02.25"): False,
    ("End of warranty", "10:00:02.25"): False, ("Stop", "14:00:00.00"): False, ("Stop", "10:00:00.27"): False,
    ("Stop", "10:00:02"): False, ("Stop", "10:00:01.5"): False, ("Stop", "10:02"): False,
}  # fmt: skip


@pytest.mark.parametrize(("name", "time"), ENDS)
def test_the_duration_between_start_and_end_is_compared_with_the_samples(name, time, tmp_path):
    """An end hours later is the end of the session. A short duration has an error of a few steps of the clock.

    An end without a fraction or without seconds was rounded."""
    n_row = 25 if time == "10:00:00.27" else 500
    rows = "".join(f"{a};{b}\n" for a, b in np.random.default_rng(1).normal(size=(n_row, 2)).round(4))
    head = f"Start: 2026-05-13 10:00:00.25\n{name}: 2026-05-13 {time}\nforce;rail\n"
    (tmp_path / "a.csv").write_text(head + rows)
    result = read("a.csv", tmp_path, RawDescription(CHANNELS, rate=500.0))
    assert len(result.recordings) == 1
    assert [f"duration until {name}" in str(e) for e in result.errors] == [True] * ENDS[name, time]


def test_ends_of_several_records_in_another_zone_or_two_ends_give_no_duration(tmp_path):
    start, end, other = "2026-05-13 10:00:00.25", "2026-05-13 10:00:02.25", "2026-05-13 10:00:02.75"

    def problems(n_record, **entries):
        with h5py.File(tmp_path / "a.hdf5", "w") as file:
            for k in range(n_record):
                file[f"run{k}/force"], file[f"run{k}/rail"] = SAMPLES.T
            file.attrs.update(start=start, **entries)
        result = read("a.hdf5", tmp_path, RawDescription(CHANNELS, rate=400.0))
        return [e for e in result.errors if "duration until" in str(e)]

    assert problems(1, stop=end) and not problems(2, stop=end)
    assert not problems(1, stop=f"{end}+02:00") and not problems(1, stop=end, end_time=other)
