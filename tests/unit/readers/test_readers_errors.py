"""Every error message states the file, the place in it, the problem and the remedy."""

import os
from dataclasses import replace

import h5py
import numpy as np
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.writing import write
from turnout.records import RawChannel

COPY = "Copy the file again from the logger."


def rejection(path, root, description):
    with pytest.raises(ReadError) as caught:
        read(path, root, description)
    return caught.value


def only_error(path, root, description, sound):
    """The single error of a file with ``sound`` intact records."""
    result = read(path, root, description)
    assert len(result.recordings) == sound
    (error,) = result.errors
    return error


def archive(folder, **variables):
    np.savez(folder / "a.npz", **variables)
    return "a.npz"


def saw(n=100):
    return np.arange(n) % 7 - 3.0


def test_a_path_outside_the_root_is_rejected(tmp_path, in_si, hammer_test):
    write(hammer_test, tmp_path / "secret.npz", "npz")
    root = tmp_path / "raw"
    root.mkdir()
    os.symlink(tmp_path / "secret.npz", root / "link.npz")
    os.symlink(tmp_path, root / "folder")
    for path in ("../secret.npz", "link.npz", "folder/secret.npz", str(tmp_path / "secret.npz")):
        error = rejection(path, root, in_si)
        assert error.reason == "outside_root"
        remedy = "Put the file under the raw root or correct the turnout's pattern."
        assert str(error) == f"{path}, the path: it leads outside the raw root. {remedy}"


def test_a_link_within_the_root_and_a_linked_root_are_accepted(tmp_path, in_si, hammer_test):
    (tmp_path / "raw").mkdir()
    write(hammer_test, tmp_path / "raw" / "a.npz", "npz")
    os.symlink(tmp_path / "raw" / "a.npz", tmp_path / "raw" / "b.npz")
    os.symlink(tmp_path / "raw", tmp_path / "store")
    assert len(read("b.npz", tmp_path / "store", in_si).recordings) == 4
    assert read(tmp_path / "raw" / "a.npz", tmp_path / "raw", in_si).recordings[0].source == "a.npz"


def test_a_circular_link_is_rejected(tmp_path, in_si):
    os.symlink(tmp_path / "b", tmp_path / "a")
    os.symlink(tmp_path / "a", tmp_path / "b")
    assert rejection("a", tmp_path, in_si).reason in ("outside_root", "unreadable")


def test_a_missing_file_is_an_error(tmp_path, in_si):
    error = rejection("A7_1.uff", tmp_path, in_si)
    assert error.reason == "vanished"
    found = "there is no such file. Correct the path, or wait until the disk that holds the file is mounted again."
    assert str(error) == f"A7_1.uff, the path: {found}"


def test_a_folder_in_place_of_a_file_is_an_error(tmp_path, in_si):
    (tmp_path / "A7_1.uff").mkdir()
    error = rejection("A7_1.uff", tmp_path, in_si)
    assert error.reason == "no_file"
    assert "it is a folder" in str(error)


def test_an_empty_file_is_an_error(tmp_path, in_si):
    (tmp_path / "A7_1.uff").write_bytes(b"")
    error = rejection("A7_1.uff", tmp_path, in_si)
    assert error.reason == "empty"
    assert str(error) == f"A7_1.uff, byte 0: the file has no bytes. {COPY}"


def test_an_unknown_format_is_an_error(tmp_path, in_si):
    (tmp_path / "a.xyz").write_bytes(b"hello world")
    error = rejection("a.xyz", tmp_path, in_si)
    assert "neither its first bytes (b'hello wo') nor its extension '.xyz' belong to a known format" in str(error)
    assert "Export the recording in one of the formats uff58, " in str(error)
    error = rejection("a.xyz", tmp_path, replace(in_si, format="xls"))
    assert "the layout: the format 'xls' is not known. Use one of uff58, " in str(error)


def test_a_file_of_another_format_than_configured_is_an_error(tmp_path, in_si, hammer_test):
    write(hammer_test, tmp_path / "a.npz", "npz")
    for format in ("uff58", "tdms", "hdf5", "mat", "rcmdx", "wav", "lvm", "parquet"):
        assert rejection("a.npz", tmp_path, replace(in_si, format=format)).reason in ("unreadable", "truncated"), format


def test_the_error_of_a_missing_channel_lists_the_existing_channels(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, force=saw(), rial=saw(), units=["N", "m/s²"])
    error = only_error(name, tmp_path, in_si, 0)
    assert error.reason == "channel_missing"
    found = "there is no channel 'rail'; there are 'force', 'rial'"
    assert (
        str(error)
        == f"a.npz, record 1 of 1: {found}. Did you mean 'rial'? Correct 'source' of this channel in the layout."
    )


def test_a_channel_that_the_layout_uses_is_not_suggested_for_a_missing_one(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, force=saw(), acc_2=saw(), units=["N", "m/s²"])
    channels = (
        RawChannel("force", "force", "force"),
        RawChannel("acc_1", "acc_1", "acceleration"),
        RawChannel("acc_2", "acc_2", "acceleration"),
    )
    error = only_error(name, tmp_path, replace(in_si, channels=channels), 0)
    assert "no channel 'acc_1'; there are 'force', 'acc_2'" in str(error) and "Did you mean" not in str(error)


def test_the_number_of_a_missing_channel_is_an_error(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, force=saw(), units=["N"])
    channels = (RawChannel("force", 0, "force"), RawChannel("rail", 1, "acceleration"))
    error = only_error(name, tmp_path, replace(in_si, channels=channels), 0)
    assert error.reason == "channel_missing"
    found = "the file has 1 ('force'; times and numbers of records are no channels), counted from 0"
    assert f"record 1 of 1: there is no channel 1; {found}. Correct 'source' of" in str(error)


def test_the_layout_must_list_every_channel_even_if_it_is_ignored(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, force=saw(), rail=saw(), web=saw(), units=["N", "m/s²", "V"])
    error = only_error(name, tmp_path, in_si, 0)
    assert error.reason == "channel_unknown"
    remedy = "Add it to the layout, with 'quantity: ignored' if it is not wanted."
    assert str(error) == f"a.npz, record 1 of 1: the file has channel 'web', which the layout does not name. {remedy}"
    known = (*in_si.channels, RawChannel("web", "web", "ignored"))
    (recording,) = read(name, tmp_path, replace(in_si, channels=known)).recordings
    assert [c.name for c in recording.channels] == ["force", "rail"]


def test_an_ignored_channel_may_be_missing(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, force=saw(), rail=saw(), units=["N", "m/s²"])
    known = (*in_si.channels, RawChannel("web", "web", "ignored"))
    (recording,) = read(name, tmp_path, replace(in_si, channels=known)).recordings
    assert [c.name for c in recording.channels] == ["force", "rail"]


def test_a_channel_that_is_listed_twice_is_an_error(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, force=saw(), units=["N"])
    channels = (RawChannel("force", "force", "force"), RawChannel("again", 0, "force"))
    error = only_error(name, tmp_path, replace(in_si, channels=channels), 0)
    assert "the layout names the channel 'force' twice. Name each once." in str(error)


def test_a_unit_that_cannot_be_converted_is_an_error(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, force=saw(), rail=saw(), units=["V", "m/s²"])
    error = only_error(name, tmp_path, in_si, 0)
    assert error.reason == "unit_unknown"
    assert str(error) == (
        "a.npz, record 1 of 1, channel 'force': 'V' is no unit of force and no sensitivity is given. "
        "Correct 'unit' or 'sensitivity' of this channel in the layout."
    )


@pytest.mark.parametrize("rate", [51199.0, 25600.0, 102400.0])
def test_a_rate_that_differs_from_the_layout_is_an_error(rate, tmp_path, in_si):
    name = archive(tmp_path, fs=rate, force=saw(), rail=saw(), units=["N", "m/s²"])
    error = only_error(name, tmp_path, in_si, 0)
    assert error.reason == "wrong_rate"
    remedy = "Correct the rate in the layout, or find out why the logger was set differently."
    found = f"sampled at {rate:g} Hz instead of 51200 Hz, by 'fs: {rate}' ({rate:g} Hz) in fs"
    assert str(error) == f"a.npz, record 1 of 1: {found}. {remedy}"


@pytest.mark.parametrize("stated", [51200.0, None])
def test_a_rate_that_contradicts_the_time_column_is_an_error(stated, tmp_path, in_si):
    """The clock gives half of the stated rate: every frequency would be doubled."""
    name = archive(tmp_path, fs=51200.0, time=np.arange(100) / 25600.0, force=saw(), rail=saw(), units=["N", "m/s²"])
    error = only_error(name, tmp_path, replace(in_si, rate=stated), 0)
    assert error.reason == "wrong_rate"
    clock = "'25600 samples per unit of time' (25600 Hz) in its time column"
    found = f"two rates: 'fs: 51200.0' (51200 Hz) in fs, and {clock}"
    remedy = "Find out which of them is right and export the record again with that one alone"
    assert str(error) == f"a.npz, record 1 of 1: {found}. {remedy}."


def test_a_frequency_of_rcm_dx_that_contradicts_its_time_stamps_is_an_error_of_the_record(tmp_path, in_si, hammer_test):
    path = write(hammer_test[:2], tmp_path / "a.rcmdx", "rcmdx")

    def change(name, item):
        if item.attrs.get("CommonTriggerFrequency"):
            item.attrs["CommonTriggerFrequency"] = np.float32(25600.0)

    with h5py.File(path, "r+") as file:
        file.visititems(change)
    result = read(path.name, tmp_path, in_si)
    assert {e.reason for e in result.errors} == {"wrong_rate"} and len(result.errors) == 2
    assert "(25600 Hz) in CommonTriggerFrequency" in result.errors[0].problem
    assert "(51200 Hz) in its time column" in result.errors[0].problem


@pytest.mark.parametrize("per_second", [1.0, 1e3, 1e6])
def test_a_time_column_without_a_unit_may_agree_with_the_rate_in_s_ms_or_us(per_second, tmp_path, in_si):
    """Printed with four digits, the last of which is up to a tenth of a step, it agrees within its digits."""
    time = np.array([float(f"{k * per_second / 51200.0:.4g}") for k in range(100)])
    name = archive(tmp_path, fs=51200.0, time=time, force=saw(), rail=saw(), units=["N", "m/s²"])
    assert read(name, tmp_path, in_si).recordings[0].rate == 51200.0


@pytest.mark.parametrize("rate", [0.0, -51200.0, np.nan, np.inf])
def test_a_rate_that_is_not_positive_and_finite_is_an_error(rate, tmp_path, in_si):
    name = archive(tmp_path, fs=rate, force=saw(), rail=saw(), units=["N", "m/s²"])
    assert only_error(name, tmp_path, in_si, 0).reason == "wrong_rate"


def test_a_missing_rate_is_an_error(tmp_path, in_si):
    name = archive(tmp_path, force=saw(), rail=saw(), units=["N", "m/s²"])
    error = only_error(name, tmp_path, replace(in_si, rate=None), 0)
    assert error.reason == "wrong_rate"
    assert "neither the file nor the layout says the sampling rate. Give the rate in the layout" in str(error)
    assert read(name, tmp_path, in_si).recordings[0].rate == 51200.0


def test_fewer_records_than_the_layout_states_are_an_error(tmp_path, in_si, hammer_test):
    path = write(hammer_test[:3], tmp_path / "a.npz", "npz")
    error = only_error(path.name, tmp_path, replace(in_si, n_records=10), 3)
    assert error.reason == "truncated"
    remedy = f"{COPY[:-1]}; if it is whole, correct 'records: 10' in the layout (null: any number)"
    assert str(error) == f"a.npz, record 4 of 10: it holds 3 of the 10 records that the layout states. {remedy}."


def test_fewer_records_than_the_file_states_are_an_error(tmp_path, in_si, hammer_test):
    path = write(hammer_test[:3], tmp_path / "a.csv", "csv")
    path.write_text("# n_records: 5\n" + "\n".join(x for x in path.read_text().split("\n") if "n_records" not in x))
    error = only_error(path.name, tmp_path, in_si, 3)
    assert error.reason == "truncated"
    assert str(error) == f"a.csv, record 4 of 5: it holds 3 of the 5 records that its own header states. {COPY}"


def test_more_records_than_the_layout_states_are_an_error(tmp_path, in_si, hammer_test):
    path = write(hammer_test, tmp_path / "a.npz", "npz")
    error = only_error(path.name, tmp_path, replace(in_si, n_records=3), 4)
    assert error.reason == "wrong_length"
    assert "a.npz, record 4: it holds 4 records, 1 more than the layout states. Correct records in" in str(error)


def test_fewer_samples_than_the_layout_states_are_an_error_of_the_record(tmp_path, in_si, hammer_test):
    hammer_test[1] = replace(hammer_test[1], samples=hammer_test[1].samples[:, :200])
    path = write(hammer_test, tmp_path / "a.npz", "npz")
    error = only_error(path.name, tmp_path, replace(in_si, n_samples=301), 3)
    assert error.reason == "truncated"
    found = "ends after 200 of the 301 samples that the layout states"
    remedy = f"{COPY[:-1]}; if it is whole, correct 'samples: 301' in the layout (null: any number)"
    assert str(error) == f"a.npz, record 2 of 4: {found}. {remedy}."
    kept = read(path.name, tmp_path, replace(in_si, n_samples=301)).recordings
    assert [r.record for r in kept] == [0, 2, 3]


def test_more_samples_than_the_layout_states_are_an_error(tmp_path, in_si, hammer_test):
    path = write(hammer_test[:1], tmp_path / "a.npz", "npz")
    error = only_error(path.name, tmp_path, replace(in_si, n_samples=300), 0)
    assert error.reason == "wrong_length"
    assert "record 1 of 1: it has 301 samples instead of 300. Correct samples in the layout" in str(error)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_sample_that_is_not_finite_is_an_error_of_the_record(value, tmp_path, in_si, hammer_test):
    samples = hammer_test[2].samples.copy()
    samples[1, 17] = samples[1, 200] = value
    hammer_test[2] = replace(hammer_test[2], samples=samples)
    path = write(hammer_test, tmp_path / "a.npz", "npz")
    error = only_error(path.name, tmp_path, in_si, 3)
    assert error.reason == "not_finite"
    found = "2 of 301 samples are missing or not finite, the first is sample 17"
    remedy = "Export the record again from the logger; if it is so there too, check the channel's cable and range"
    assert str(error) == f"a.npz, record 3 of 4, channel 'rail': {found}. {remedy}."


def test_large_samples_below_the_marks_of_missing_samples_are_accepted(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, force=saw() * 3e29, rail=saw(), units=["N", "m/s²"])
    assert read(name, tmp_path, in_si).errors == ()


def test_a_dead_channel_is_an_error_of_a_hammer_record(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, force=saw(), rail=np.full(100, 0.25), units=["N", "m/s²"])
    error = only_error(name, tmp_path, in_si, 0)
    assert error.reason == "dead_channel"
    found = "all 100 samples are 0.25: the channel is dead"
    remedy = "Check the sensor, its cable and 'source' of this channel in the layout."
    assert str(error) == f"a.npz, record 1 of 1, channel 'rail': {found}. {remedy}"


@pytest.mark.parametrize(
    ("dead", "kept"), [("sleeper", ["force", "rail"]), ("rail", ["force", "sleeper"]), ("force", None)]
)
def test_a_dead_response_of_several_is_the_only_channel_that_is_left_out(tmp_path, in_si, dead, kept):
    described = replace(in_si, channels=(*in_si.channels, RawChannel("sleeper", "sleeper", "acceleration")))
    samples = {"force": saw(), "rail": 2.0 * saw(), "sleeper": 3.0 * saw()} | {dead: np.zeros(100)}
    name = archive(tmp_path, fs=51200.0, **samples, units=["N", "m/s²", "m/s²"])
    if kept is None:
        assert only_error(name, tmp_path, described, 0).reason == "dead_channel"
        return
    result = read(name, tmp_path, described)
    assert [c.name for c in result.recordings[0].channels] == kept
    np.testing.assert_allclose(result.recordings[0].samples[0], saw())
    (error,) = result.errors
    assert error.reason == "dead_channel" and repr(dead) in error.where


@pytest.mark.parametrize("kind", ["hammer", "passage"])
def test_an_error_states_its_record_and_one_of_the_file_none(kind, tmp_path, in_si):
    """Record 2 has a dead channel; a fourth record that the layout states is missing in the file as a whole."""
    samples = np.random.default_rng(1).normal(size=(3, 2, 100))
    samples[1, 1] = 0.0
    name = archive(tmp_path, fs=51200.0, data=samples, channels=["force", "rail"], units=["N", "m/s²"])
    errors = read(name, tmp_path, replace(in_si, kind=kind, n_records=4)).errors
    of_times = [("wrong_time", k) for k in range(3)] if kind == "passage" else []  # nothing states when they began
    assert [(e.reason, e.record) for e in errors] == [("dead_channel", 1), *of_times, ("truncated", None)]


def test_a_dead_required_channel_is_an_error_of_the_record(tmp_path, in_si):
    """A section without its response has no modes, whatever else was recorded."""
    channels = (*in_si.channels, RawChannel("sleeper", "sleeper", "acceleration"))
    described = replace(in_si, channels=channels, required=("force", "rail"))
    name = archive(
        tmp_path, fs=51200.0, force=saw(), rail=np.zeros(100), sleeper=np.zeros(100), units=["N"] + ["m/s²"] * 2
    )
    error = only_error(name, tmp_path, described, 0)
    assert error.reason == "dead_channel" and "'rail'" in error.where


def test_a_dead_channel_of_a_passage_is_the_only_channel_that_is_left_out(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, force=saw(), rail=np.zeros(100), units=["N", "m/s²"])
    result = read(name, tmp_path, replace(in_si, kind="passage"))
    assert [c.name for c in result.recordings[0].channels] == ["force"]
    np.testing.assert_array_equal(result.recordings[0].samples[0], saw())
    assert [e.reason for e in result.errors] == ["dead_channel"]


def test_a_constant_temperature_is_not_reported_as_a_dead_channel(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, force=saw(), pt100=np.full(100, 285.65), units=["N", "K"])
    channels = (in_si.channels[0], RawChannel("rail_temperature", "pt100", "temperature"))
    (recording,) = read(name, tmp_path, replace(in_si, channels=channels)).recordings
    np.testing.assert_allclose(recording.signal("rail_temperature"), 12.5, rtol=1e-12)


def test_the_sign_applies_to_offset_and_scale(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, t1=np.full(100, 300.0), units=["K"])
    channels = (RawChannel("t", "t1", "temperature", sign=-1),)
    (recording,) = read(name, tmp_path, replace(in_si, channels=channels)).recordings
    np.testing.assert_allclose(recording.samples[0], -26.85, rtol=1e-12)


def test_a_channel_gets_limit_and_resolution_of_the_layout(tmp_path, in_volts):
    name = archive(tmp_path, fs=51200.0, a1=saw(), h=saw())
    channels = tuple(replace(c, limit=500.0, resolution=0.5, position=1.5, serial="7") for c in in_volts.channels)
    (recording,) = read(name, tmp_path, replace(in_volts, channels=channels, n_records=1, n_samples=100)).recordings
    rail = recording.channels[0]
    assert (rail.limit, rail.resolution, rail.position, rail.serial) == (500.0, 0.5, 1.5, "7")


def test_a_clock_that_runs_backwards_within_a_record_is_an_error(tmp_path, in_si):
    time = np.arange(100) / 51200.0
    time[60:] -= 0.001
    name = archive(tmp_path, time=time, force=saw(), rail=saw(), units=["N", "m/s²"])
    error = only_error(name, tmp_path, in_si, 0)
    assert error.reason == "clock_backwards"
    found = "the clock runs backwards or stands still: sample 59 at 0.00115234375 s, the next at 0.000171875 s"
    assert str(error) == f"a.npz, record 1 of 1: {found}. Check the logger's clock and export the record again."


def test_a_record_that_starts_before_the_previous_one_is_an_error(tmp_path, in_si, hammer_test):
    hammer_test[2] = replace(hammer_test[2], started_at=hammer_test[0].started_at.replace(year=2023))
    path = write(hammer_test, tmp_path / "a.npz", "npz")
    error = only_error(path.name, tmp_path, in_si, 3)
    assert error.reason == "clock_backwards"
    began = "it began at 2023-05-13 10:00:01.250000, before the record in front of it (2024-05-13 10:01:01.250000)"
    assert str(error) == f"a.npz, record 3: {began}. Check the logger's clock and the time zone in the layout."


@pytest.mark.parametrize(("odd", "neighbour"), [(0, 1), (1, 2)])
def test_a_future_start_is_an_error_of_its_record_and_not_of_the_next_ones(
    odd, neighbour, tmp_path, in_si, hammer_test
):
    ahead = [
        replace(r, started_at=r.started_at.replace(year=2099)) if k == odd else r for k, r in enumerate(hammer_test)
    ]
    path = write(ahead, tmp_path / "a.npz", "npz")
    error = only_error(path.name, tmp_path, in_si, 3)
    assert error.reason == "clock_backwards"
    began = (
        f"it began at 2099-05-13 10:0{odd}:01.250000, after a record behind it (2024-05-13 10:0{neighbour}:01.250000)"
    )
    assert str(error) == f"a.npz, record {odd + 1}: {began}. Check the logger's clock and the time zone in the layout."


@pytest.mark.parametrize(
    ("minutes", "rejected"),
    [
        ((0, 3, 2, 5), [2]),  # it is unknown which of two is wrong: the first is kept
        ((9, 1), [1]),
        ((5, 6, 7, 0, 1, 2), [3, 4, 5]),
        ((8, 0, 1, 9, 2, 3), [0, 3]),
        ((4, 4, 4, 0, 4), [3]),  # equal stamps are in order
    ],
)
def test_the_largest_set_of_records_in_order_of_time_is_kept(minutes, rejected, tmp_path, in_si, hammer_test):
    start = hammer_test[0].started_at
    records = [replace(hammer_test[k % 4], started_at=start.replace(minute=m)) for k, m in enumerate(minutes)]
    path = write(records, tmp_path / "a.npz", "npz")
    result = read(path.name, tmp_path, in_si)
    assert [int(e.where.split()[-1]) - 1 for e in result.errors] == rejected
    assert {e.reason for e in result.errors} == {"clock_backwards"}


def test_a_jump_of_the_time_is_reported_as_missing_samples(tmp_path, in_si):
    time = np.delete(np.arange(110), slice(40, 50)) / 51200.0
    name = archive(tmp_path, time=time, force=saw(), rail=saw(), units=["N", "m/s²"])
    error = only_error(name, tmp_path, in_si, 0)
    assert error.reason == "truncated"
    assert "time jumps from 0.00076171875 s to 0.0009765625 s at 51200 Hz: samples are missing" in str(error)


UNEVEN = {
    "a tenth of it at another rate": np.where(np.arange(299) < 270, 1 / 51200, 1 / 64000),
    "a rate that rises from 43 to 59 kHz": 1 / np.linspace(43e3, 59e3, 299),
    "steps that differ by up to 38 %": np.random.default_rng(4).uniform(0.62, 1.38, 299) / 51200,
}


@pytest.mark.parametrize("kind", UNEVEN)
def test_an_uneven_time_is_an_error_although_its_mean_rate_agrees(kind, tmp_path, in_si):
    """No sample is missing, as no step is half a step off; the mean rate is within 2 % of the stated one."""
    time = np.concatenate([[0.0], np.cumsum(UNEVEN[kind])])
    name = archive(tmp_path, time=time, force=saw(300), rail=saw(300), units=["N", "m/s²"])
    error = only_error(name, tmp_path, in_si, 0)
    assert error.reason == "wrong_rate"
    assert "its time column is not even: sample " in error.problem and " steps from where " in error.problem
    assert error.remedy == "Check the logger's clock, or export the record at an even rate"


@pytest.mark.parametrize(("off", "sound"), [(5e-5, True), (-5e-5, True), (3e-4, False)])
def test_a_clock_error_of_parts_in_a_million_is_accepted(off, sound, tmp_path, in_si):
    """Quartz clocks are accurate to about 50 ppm; 300 ppm means another rate."""
    time = np.arange(4000) * (1.0 + off) / in_si.rate
    result = read(archive(tmp_path, time=time, force=saw(4000), rail=saw(4000), units=["N", "m/s²"]), tmp_path, in_si)
    if sound:
        assert result.recordings[0].rate == in_si.rate
    else:
        assert result.errors[0].reason == "wrong_rate"


@pytest.mark.parametrize("n", [300, 2**18 + 2, 2**19])
def test_a_time_with_few_digits_or_with_thermal_drift_is_accepted_as_even(n, tmp_path, in_si):
    """A last digit of 0.4 steps, rounded down; a crystal that changes by 2e-5: 2.6 steps within 2**19 samples."""
    k = np.arange(n)
    time = (k + 2e-5 * (k**2 / n - k)) / 51200.0
    digit = 0.4 / 51200.0
    for printed in (time, np.floor(time / digit) * digit):
        name = archive(tmp_path, time=printed, force=saw(n), rail=saw(n), units=["N", "m/s²"])
        assert read(name, tmp_path, in_si).errors == ()


def test_channels_of_different_length_are_an_error(tmp_path, in_si):
    name = archive(tmp_path, fs=51200.0, force=saw(100), rail=saw(80), units=["N", "m/s²"])
    error = only_error(name, tmp_path, in_si, 0)
    assert error.reason == "truncated"
    assert f"record 1 of 1: channel 'rail' ends after 80 samples, others after 100. {COPY}" in str(error)


def test_a_missing_number_between_records_is_an_error(tmp_path, in_si):
    both = np.vstack([saw(), saw()[::-1]])
    name = archive(tmp_path, fs=51200.0, record_001=both, record_003=both, channels=["force", "rail"], units=["N", "g"])
    error = only_error(name, tmp_path, in_si, 2)
    assert error.reason == "truncated"
    assert f"a.npz, record 2: this record is missing between its neighbours. {COPY}" in str(error)


@pytest.mark.parametrize("numbers", [("20240513101500", "20240513140000"), ("7", "99999999999999999999", "2000")])
def test_numbers_of_records_from_a_clock_or_a_counter_need_not_be_consecutive(numbers, tmp_path, in_si):
    records = {f"rec_{n}": np.vstack([saw() + k, saw()[::-1]]) for k, n in enumerate(numbers)}
    name = archive(tmp_path, fs=51200.0, channels=["force", "rail"], units=["N", "g"], **records)
    result = read(name, tmp_path, in_si)
    assert result.errors == ()
    in_order = sorted(range(len(numbers)), key=lambda k: int(numbers[k]))
    assert [r.samples[0, 0] for r in result.recordings] == [-3.0 + k for k in in_order]


def test_two_records_with_one_number_are_an_error_of_that_record(tmp_path, in_si):
    records = {name: np.vstack([saw() + k, saw()[::-1]]) for k, name in enumerate(("hit_1", "impact_1", "hit_2"))}
    name = archive(tmp_path, fs=51200.0, channels=["force", "rail"], units=["N", "g"], **records)
    error = only_error(name, tmp_path, in_si, 1)
    found = "'hit_1' and 'impact_1' are both number 1"
    assert str(error) == f"a.npz, record 1: {found}. Number the records each by a number of its own."
    (recording,) = read(name, tmp_path, in_si).recordings
    assert (recording.record, recording.samples[0, 0]) == (1, -1.0)
