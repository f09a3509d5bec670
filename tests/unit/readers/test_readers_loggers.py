"""Recordings of loggers and analysers: stated scales and structures are applied or reported.

The programs in ``shared/inputs/recordings`` write the files. Their impacts are known exactly.
"""

import os
import runpy
import struct
import subprocess
import sys
from datetime import datetime

import h5py
import nptdms
import numpy as np
import pytest
import soundfile

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0


@pytest.fixture(scope="session")
def made(shared_recordings, tmp_path_factory):
    """Function: name of an input -> folder with its files."""
    folders = {}

    def make(name):
        if name not in folders:
            folders[name] = tmp_path_factory.mktemp(name)
            environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
            command = [sys.executable, str(shared_recordings / name / "make.py")]
            subprocess.run(command, cwd=folders[name], env=environment, check=True, capture_output=True)
        return folders[name]

    return make


@pytest.fixture(scope="session")
def impacts(shared_recordings):
    """Force and acceleration of ten records, (10, 2, 3000), as the programs write them."""
    return np.array(runpy.run_path(str(shared_recordings / "gen.py"))["hits"]())


@pytest.fixture(scope="session")
def stream(shared_recordings):
    """Six impacts in one record, (2, 60000)."""
    hits = runpy.run_path(str(shared_recordings / "gen.py"))["hits"]
    return np.concatenate(hits(n=10000, n_hit=6, pre=2000), axis=1)


def layout(unit_of_force=None, unit_of_rail=None, rate=RATE, force="force", rail="rail", **fields):
    channels = (
        RawChannel("force", force, "force", unit=unit_of_force),
        RawChannel("rail", rail, "acceleration", unit=unit_of_rail),
    )
    return RawDescription(channels, rate=rate, **fields)


def errors_of(path, description):
    try:
        return [str(error) for error in read(path.name, path.parent, description).errors]
    except ReadError as error:
        return [str(error)]


def samples_of(path, description):
    result = read(path.name, path.parent, description)
    assert not result.errors, result.errors
    return np.array([recording.samples for recording in result.recordings])


def test_the_linear_scale_of_a_tdms_file_is_applied(made, impacts):
    samples = samples_of(made("01_tdms_scale_kind") / "linear.tdms", layout())
    np.testing.assert_allclose(samples[:, 0], impacts[:, 0], atol=0.126)  # half a step of 0.25 N
    np.testing.assert_allclose(samples[:, 1], impacts[:, 1], atol=0.0021)


@pytest.mark.parametrize(
    ("name", "kind"),
    [("piecewise", "PiecewisePolynomial"), ("maplin", "MapRanges"), ("piecewise_force_only", "PiecewisePolynomial")],
)
def test_a_scale_that_cannot_be_applied_is_rejected(made, name, kind):
    path = made("01_tdms_scale_kind") / f"{name}.tdms"
    errors = errors_of(path, layout())
    assert len(errors) == 10
    assert (
        f"record 1 of 10, channel 'force': the file states the scale '{kind}', which npTDMS cannot apply" in errors[0]
    )
    assert "unit: 'N!'" in errors[0]


def test_a_unit_that_overrides_the_file_determines_its_scale(made, impacts):
    path = made("01_tdms_scale_kind") / "piecewise_force_only.tdms"
    samples = samples_of(path, layout("0.4 N!"))
    np.testing.assert_allclose(samples[:, 0], impacts[:, 0], atol=0.21)


@pytest.mark.parametrize("name", ["cf.nc", "cf_force.h5"])
def test_packed_numbers_of_netcdf_are_unpacked(made, impacts, name):
    samples = samples_of(made("05_hdf5_scale_factor") / name, layout())
    np.testing.assert_allclose(samples[:, 0], impacts[:, 0], atol=0.21)
    np.testing.assert_allclose(samples[:, 1], impacts[:, 1], atol=1 / 32 + 1e-3)


def test_fill_values_of_netcdf_are_missing_samples(made):
    path = made("05_hdf5_scale_factor") / "cf_fill.h5"
    result = read(path.name, path.parent, layout())
    assert [r.record for r in result.recordings] == [0, 1, 2, *range(4, 10)]
    (error,) = result.errors
    assert error.reason == "not_finite"
    assert "record 4 of 10, channel 'force': 4 of 3000 samples are missing or not finite, the first is sample 1500" in (
        str(error)
    )


def test_packed_numbers_of_long_records_are_unpacked_block_by_block(tmp_path):
    packed = np.arange(300_000, dtype="int32") * 7 % 1000
    with h5py.File(tmp_path / "long.h5", "w") as file:
        file.attrs["rate"] = RATE
        for name in ("force", "rail"):
            dataset = file.create_dataset(name, data=packed)
            dataset.attrs.update({"scale_factor": 0.5, "add_offset": -3.0, "units": "N" if name == "force" else "m/s2"})
    description = layout(kind="passage")
    (recording,) = read("long.h5", tmp_path, description, 1.0, max_whole_file_size=0).long_recordings
    np.testing.assert_array_equal(recording.read(500, 700)[1], 0.5 * packed[500:700] - 3.0)


def test_a_gain_that_may_already_be_applied_is_rejected(made):
    errors = errors_of(made("05_hdf5_scale_factor") / "gain_offset.h5", layout())
    assert "channel 'force': the file states gain = 0.4, and nothing says whether its numbers already" in errors[0]


def test_a_gain_is_rejected_in_every_format_that_can_state_one(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq
    import scipy.io

    t = np.arange(400) / RATE
    force, rail = np.sin(900 * t + 0.1), np.cos(700 * t + 0.1)
    columns = {"force": force, "rail": rail}
    scipy.io.savemat(tmp_path / "a.mat", columns | {"fs": RATE, "gain": 0.4, "units": ["N", "m/s2"]})
    np.savez(tmp_path / "a.npz", **columns, fs=RATE, scale=[0.4, 1.0], units=["N", "m/s2"])
    text = "Verstärkung;0,4;1\nforce [N];rail [m/s²]\n" + "".join(f"{f};{a}\n" for f, a in zip(force, rail))
    (tmp_path / "a.csv").write_text(text.replace(".", ","), encoding="utf-8")
    fields = [
        pa.field(n, pa.float64(), metadata={"unit": u} | ({"Gain": "0.4"} if n == "force" else {}))
        for n, u in (("force", "N"), ("rail", "m/s2"))
    ]
    pq.write_table(pa.table(list(columns.values()), schema=pa.schema(fields)), tmp_path / "a.parquet")
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        facts = {"wf_increment": 1 / RATE, "unit_string": "N", "Scale factor": 0.4}
        other = facts | {"unit_string": "m/s2", "Scale factor": 1.0}
        channels = nptdms.ChannelObject("r", "force", force, facts), nptdms.ChannelObject("r", "rail", rail, other)
        file.write_segment(channels)
    for name in ("a.mat", "a.npz", "a.csv", "a.parquet", "a.tdms"):
        (error,) = errors_of(tmp_path / name, layout())
        assert "channel 'force': the file states" in error and " = 0.4, and nothing says" in error, error
        decided = RawChannel("rail", "rail", "acceleration", unit="m/s²!")
        description = RawDescription((RawChannel("force", "force", "force", unit="0.4 N!"), decided), rate=RATE)
        np.testing.assert_allclose(samples_of(tmp_path / name, description)[0, 0], 0.4 * force, atol=1e-9)


@pytest.mark.parametrize("facts", [{"gain": 1.0, "offset": 0.0}, {"time_offset": 3.0}, {"sensitivity": 10.0}, {}])
def test_a_neutral_scale_and_other_entries_are_accepted(tmp_path, facts):
    np.savez(tmp_path / "a.npz", force=np.arange(9.0), rail=np.arange(9.0), fs=RATE, units=["N", "m/s2"], **facts)
    assert samples_of(tmp_path / "a.npz", layout()).shape == (1, 2, 9)


def test_the_warning_of_a_library_is_reported(tmp_path):
    path = tmp_path / "version.tdms"
    with nptdms.TdmsWriter(path) as file:
        facts = {"wf_increment": 1 / RATE}
        file.write_segment(
            [nptdms.ChannelObject("r", n, np.arange(9.0), facts | {"unit_string": u}) for n, u in
             (("force", "N"), ("rail", "m/s2"))]
        )  # fmt: skip
    data = bytearray(path.read_bytes())
    data[8:12] = (4999).to_bytes(4, "little")
    path.write_bytes(data)
    result = read(path.name, tmp_path, layout())
    assert len(result.recordings) == 1
    (warning,) = result.errors
    assert warning.reason == "library_warning" and "Unrecognised version number: 4999" in str(warning)


def test_numbers_above_full_scale_are_rejected_as_fractions_of_it(made, stream):
    folder = made("10_wav_float")
    channels = (
        RawChannel("force", 0, "force", unit="10 V", sensitivity=1.0, sensitivity_unit="mV/N"),
        RawChannel("rail", 1, "acceleration", unit="10 V", sensitivity=10.0, sensitivity_unit="mV/(m/s²)"),
    )
    description = RawDescription(channels, rate=RATE)
    for name in ("float_volts.wav", "double_volts.wav"):
        (error,) = errors_of(folder / name, description)
        assert "channel 'force': its numbers reach 4.946, so they are no fractions of the full scale '10 V'" in error
    step = 10.0 / 2**15
    pcm = samples_of(folder / "pcm16.wav", description)[0]
    np.testing.assert_allclose(pcm[0], stream[0], atol=step / 1e-3)
    np.testing.assert_allclose(pcm[1], stream[1], atol=step / 10e-3)
    in_volts = RawDescription(tuple(RawChannel(c.name, c.source, c.quantity, "V", c.sensitivity, c.sensitivity_unit)
                                    for c in channels), rate=RATE)  # fmt: skip
    np.testing.assert_allclose(samples_of(folder / "float_volts.wav", in_volts)[0], stream, rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("name", ["two_groups.tdms", "two_groups_info.tdms"])
def test_the_groups_of_one_record_are_joined(made, stream, name):
    np.testing.assert_array_equal(samples_of(made("13_tdms_groups_per_task") / name, layout()), stream[None])


def test_groups_with_different_starts_are_not_joined(tmp_path):
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        for group, name, start in (("Hammer", "force", 0), ("Accel", "rail", 1)):
            facts = {"wf_increment": 1 / RATE, "wf_start_time": np.datetime64(f"2026-05-13T08:00:0{start}")}
            file.write_segment([nptdms.ChannelObject(group, name, np.arange(9.0), facts)])
    (error,) = errors_of(tmp_path / "a.tdms", layout("N", "m/s²"))
    assert "its channels lie in groups with different names ('Accel': rail; 'Hammer': force)" in error
    assert "9 samples of 5e-05 s from 2026-05-13T08:00:01" in error and "Copy" not in error


def test_a_big_endian_tdms_file_is_complete(made, impacts):
    np.testing.assert_array_equal(samples_of(made("28_tdms_big_endian") / "big_endian.tdms", layout()), impacts)


def test_lvm_with_one_x_column_per_channel_is_read(made, impacts):
    np.testing.assert_allclose(samples_of(made("03_lvm_multi") / "multi.lvm", layout()), impacts, atol=5.1e-7)


@pytest.mark.parametrize("name", ["one_header.lvm", "one_header_x.lvm"])
def test_lvm_with_one_header_for_ten_impacts_is_read(made, impacts, name):
    np.testing.assert_allclose(samples_of(made("04_lvm_one_header") / name, layout()), impacts, atol=5.1e-7)


def test_lvm_with_one_header_and_continued_time_is_one_record(made, impacts, tmp_path):
    text = (made("04_lvm_one_header") / "one_header_x.lvm").read_text()
    head, _, body = text.partition("Comment\n")
    rows = [row.partition("\t")[2] for row in body.splitlines()]
    path = tmp_path / "continued.lvm"
    path.write_text(f"{head}Comment\n" + "".join(f"{i / RATE:.6f}\t{row}\n" for i, row in enumerate(rows)))
    np.testing.assert_allclose(samples_of(path, layout()), [np.hstack(impacts)], atol=5.1e-7)
    path.write_text("\n".join(text.splitlines()[:-7]) + "\n")
    (error,) = errors_of(path, layout())
    assert "29993 rows follow its header of 3000 samples: no whole number of writes" in error


def test_the_error_of_lvm_without_a_header_states_its_cause(made):
    (error,) = errors_of(made("04_lvm_one_header") / "no_header.lvm", layout())
    assert "LabVIEW wrote it with the setting 'Segment headers: no headers'" in error and "Copy" not in error


@pytest.mark.parametrize("name", ["thousands_tab.txt", "thousands_dot.txt", "thousands_only_rail.txt"])
def test_separators_of_thousands_are_an_error(made, name):
    (error,) = errors_of(made("15_csv_cells") / name, layout())
    assert "has a mark for thousands" in error and ("column 'rail'" if "only" in name else "column 'force'") in error


def test_decimals_are_not_read_as_separators_of_thousands(tmp_path):
    """Temperatures in steps of a half, and numbers with three decimals, some of which are whole."""
    rows = [f"{20 + i % 2 / 2:g};{1 + (i % 7) * 0.125:g}\n" for i in range(200)]
    (tmp_path / "a.csv").write_text("force [N];rail [m/s²]\n" + "".join(rows))
    assert samples_of(tmp_path / "a.csv", layout())[0, :, 1].tolist() == [20.5, 1.125]


@pytest.mark.parametrize("name", ["footer.csv", "quoted.csv", "quoted_comma.csv", "sep_line.csv"])
def test_text_of_spreadsheets_and_loggers_is_read(made, stream, name):
    np.testing.assert_allclose(samples_of(made("15_csv_cells") / name, layout())[0], stream, atol=5.1e-5)


def test_the_sign_of_infinity_is_an_error(made):
    (error,) = errors_of(made("15_csv_cells") / "infinity.csv", layout())
    assert "column 'force': '∞' is no number" in error


def test_text_without_its_last_line_break_is_read(tmp_path):
    rows = "".join(f"{i * 1.0:.3f},{i * 0.5:.3f}\n" for i in range(40))
    path = tmp_path / "a.csv"
    path.write_text("force [N],rail [m/s²]\n" + rows[:-1])
    assert samples_of(path, layout()).shape == (1, 2, 40)
    path.write_text("force [N],rail [m/s²]\n" + rows[:-2])
    result = read(path.name, tmp_path, layout())
    assert result.recordings[0].samples.shape == (2, 39)
    (error,) = result.errors
    assert error.reason == "truncated" and "line 41: the last line has no line break" in str(error)


def test_the_error_of_a_universal_file_without_time_responses_states_its_content(shared_data):
    folder = shared_data / "uff58_reader_samples"
    found = []
    for path in sorted(folder.rglob("*.uff")):
        found += [e for e in errors_of(path, layout("N", "m/s²", rate=None)) if "no time response" in e]
    assert found and all("it holds" in e and "Copy" not in e for e in found), found
    assert any("x frequency response" in e and "turnout.modes_of_frf" in e for e in found)


@pytest.mark.parametrize("copies", [2, 3])
def test_a_file_appended_to_itself_is_an_error(tmp_path, copies):
    rows = "".join(f"{i}.25,{i}.5\n" for i in range(40))
    path = tmp_path / "a.csv"
    path.write_text(("force [N],rail [m/s²]\n" + rows) * copies)
    (error,) = errors_of(path, layout())
    assert f"are in it {copies} times: it was appended to itself" in error
    path.write_text("force [N],rail [m/s²]\n" + rows * copies)  # a periodic signal is no such file
    assert samples_of(path, layout()).shape[2] == 40 * copies


@pytest.mark.parametrize("name", ["a.csv", "a.wav", "a.mat", "a.h5"])
@pytest.mark.parametrize("value", [b"\0", b"\xff", b" "])
@pytest.mark.parametrize("size", [1, 4096, 2**21 + 1])
def test_a_file_with_only_one_repeated_byte_is_reported_as_empty(tmp_path, name, value, size):
    (tmp_path / name).write_bytes(value * size)
    (error,) = errors_of(tmp_path / name, layout())
    assert f"all of its {size} bytes are 0x{value[0]:02X}: nothing was written to it" in error


def test_a_file_with_one_other_byte_is_not_reported_as_empty(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b" " * 2**21 + b"x")
    (error,) = errors_of(path, layout())
    assert "nothing was written" not in error


def test_bytes_inserted_into_audio_are_found(tmp_path):
    path = tmp_path / "a.wav"
    soundfile.write(path, np.random.default_rng(1).uniform(-1, 1, (500, 2)), 20000, "PCM_16")
    data = path.read_bytes()
    at = data.find(b"data") + 108
    description = layout("10 N", "10 m/s²", force=0, rail=1)
    for inserted in (b"\0", b"abc", bytes(8), bytes(40)):
        path.write_bytes(data[:at] + inserted + data[at:])
        (error,) = errors_of(path, description)
        assert "inserted" in error or "ends after" in error
    path.write_bytes(data + data)
    assert "appended" in errors_of(path, description)[0]
    path.write_bytes(data + b"LIST" + (4).to_bytes(4, "little") + b"INFO")  # a chunk that an editor appended
    assert samples_of(path, description).shape == (1, 2, 500)


def as_whole_wav(path, numbers, n_byte, n_valid=None):
    """Write whole numbers of n_byte bytes each; n_valid is the stated number of valid bits."""
    n = numbers.shape[1]
    fmt = struct.pack("<HHIIHH", 1 if n_valid is None else 0xFFFE, n, 25600, 25600 * n * n_byte, n * n_byte, 8 * n_byte)
    if n_valid is not None:
        fmt += struct.pack("<HHIH", 22, n_valid, 0, 1) + bytes.fromhex("000000001000800000aa00389b71")
    data = b"".join(int(k).to_bytes(n_byte, "little", signed=True) for k in numbers.ravel())
    body = b"WAVEfmt " + struct.pack("<I", len(fmt)) + fmt + b"data" + struct.pack("<I", len(data)) + data
    path.write_bytes(b"RIFF" + struct.pack("<I", len(body)) + body)


@pytest.mark.parametrize(("n_byte", "n_valid"), [(4, 24), (4, 20), (3, 20), (2, 12)])
@pytest.mark.parametrize("is_lazy", [False, True])
def test_valid_bits_can_be_the_high_or_the_low_bits(n_byte, n_valid, is_lazy, tmp_path):
    fractions = np.random.default_rng(8).uniform(-0.9, 0.9, size=(300, 2))
    numbers = np.round(fractions * 2 ** (n_valid - 1)).astype(int)
    channels = (RawChannel("force", 0, "force", unit="22000 N"), RawChannel("rail", 1, "acceleration", unit="1 m/s²"))
    split = {"max_duration": 3600.0, "max_whole_file_size": 0} if is_lazy else {}
    for shift in (0, 8 * n_byte - n_valid):
        as_whole_wav(tmp_path / "a.wav", numbers << shift, n_byte, n_valid)
        result = read("a.wav", tmp_path, RawDescription(channels), **split)
        assert not result.errors
        np.testing.assert_allclose(result.recordings[0].samples[1], fractions[:, 1], atol=2.0**-n_valid)
        np.testing.assert_allclose(result.recordings[0].samples[0], 22000 * fractions[:, 0], atol=22000 * 2.0**-n_valid)


def test_codes_of_a_converter_in_32_bits_are_reported(tmp_path):
    numbers = np.random.default_rng(8).integers(-(2**22), 2**22, size=(300, 2))
    channels = (RawChannel("force", 0, "force", unit="1 N"), RawChannel("rail", 1, "acceleration", unit="1 m/s²"))
    as_whole_wav(tmp_path / "a.wav", numbers, 4)
    result = read("a.wav", tmp_path, RawDescription(channels))
    assert [error.reason for error in result.errors] == ["entry_unknown"] and len(result.recordings) == 1
    assert "by 256" in result.errors[0].remedy
    for other in (numbers << 8, numbers << 7):  # 24 bits in the high ones; more than 24 bits
        as_whole_wav(tmp_path / "a.wav", other, 4)
        assert not read("a.wav", tmp_path, RawDescription(channels)).errors


def wav_with(tmp_path, tag, content):
    """Two channels at 25600 Hz, with a further chunk before the samples."""
    samples = np.random.default_rng(3).normal(size=(2, 200)) * [[0.5], [0.1]]
    soundfile.write(tmp_path / "a.wav", samples.T, 25600, "DOUBLE")
    data = (tmp_path / "a.wav").read_bytes()
    content += b"\0" * (len(content) % 2)
    at = data.index(b"data")
    chunk = tag + struct.pack("<I", len(content)) + content
    size = struct.pack("<I", len(data) + len(chunk) - 8)
    (tmp_path / "a.wav").write_bytes(data[:4] + size + data[8:at] + chunk + data[at:])
    channels = (RawChannel("force", 0, "force", unit="N"), RawChannel("rail", 1, "acceleration", unit="m/s²"))
    return RawDescription(channels)


def broadcast(rate, date=b"2024-05-13", clock=b"10:02:03"):
    head = b"hammer test".ljust(320, b"\0") + date + clock
    return head.ljust(602, b"\0") + f"A=PCM,F={rate},W=24,M=stereo\r\n".encode()


@pytest.mark.parametrize(
    ("tag", "content"),
    [
        (b"bext", broadcast),
        (b"iXML", lambda rate: f"<BWFXML><SPEED><FILE_SAMPLE_RATE>{rate}</FILE_SAMPLE_RATE></SPEED></BWFXML>".encode()),
    ],
)
def test_the_rate_in_chunks_of_field_recorders_is_compared(tag, content, tmp_path):
    layout = wav_with(tmp_path, tag, content(25600))
    result = read("a.wav", tmp_path, layout)
    assert not result.errors and result.recordings[0].rate == 25600.0
    if tag == b"bext":
        assert result.recordings[0].started_at == datetime(2024, 5, 13, 10, 2, 3)
    layout = wav_with(tmp_path, tag, content(48000))
    (error,) = read("a.wav", tmp_path, layout).errors
    assert error.reason == "wrong_rate" and "25600" in str(error) and "48000" in str(error)


def test_an_impossible_start_date_in_a_chunk_is_reported(tmp_path):
    layout = wav_with(tmp_path, b"bext", broadcast(25600, date=b"2024-02-30"))
    (error,) = read("a.wav", tmp_path, layout).errors
    assert error.reason == "start_unknown" and "2024-02-30" in str(error)


@pytest.mark.parametrize("rate", [None, 20000.0, 25600.0])
def test_the_error_of_two_sampling_rates_states_both_and_a_remedy(made, rate):
    channels = (
        RawChannel("force", "force", "force", unit="N"),
        RawChannel("rail", "rail", "acceleration", unit="m/s²"),
    )
    (error,) = read("two_times.csv", made("15_csv_cells"), RawDescription(channels, rate=rate)).errors
    assert error.reason == "wrong_rate" and "20000 Hz" in str(error) and "25600.0004 Hz" in str(error)
    assert "export all at one rate, or each rate to its own file" in str(error)


def write_tasks(path, numbers_of_tasks, seconds=None):
    """One group per task and impact; each group contains the number of its impact."""
    with nptdms.TdmsWriter(path) as file:
        for (task, name), numbers in zip((("Hammer", "force"), ("Accel", "rail")), numbers_of_tasks):
            for number in numbers:
                facts = {"wf_increment": 1 / RATE, "wf_start_offset": 0.0}
                if seconds:
                    facts["wf_start_time"] = np.datetime64("2026-05-13T08:00:00") + seconds[number]
                samples = number + np.random.default_rng(number).normal(size=50) / 100.0
                file.write_segment([nptdms.ChannelObject(f"Mod1 {task} {number}", name, samples, facts)])


def test_the_groups_of_two_tasks_are_joined_by_their_numbers_or_starts(tmp_path):
    """The force of one impact with the acceleration of the next would look intact."""
    write_tasks(tmp_path / "a.tdms", ((9, 10, 11), (9, 10, 11)))
    samples = samples_of(tmp_path / "a.tdms", layout("N", "m/s²"))
    np.testing.assert_allclose(samples.mean(axis=2), [[9, 9], [10, 10], [11, 11]], atol=0.01)
    write_tasks(tmp_path / "a.tdms", ((9, 10), (10, 11)))
    (error,) = errors_of(tmp_path / "a.tdms", layout("N", "m/s²"))
    assert "their numbers differ ('Mod1 Accel 10' and 'Mod1 Hammer 9')" in error
    seconds = {number: np.timedelta64(10 * (number % 3), "s") for number in (9, 10, 12, 13)}
    write_tasks(tmp_path / "a.tdms", ((9, 10), (12, 13)), seconds)
    assert len(samples_of(tmp_path / "a.tdms", layout("N", "m/s²"))) == 2


def test_a_group_of_equal_length_without_a_time_axis_is_an_error(tmp_path):
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        facts = {"wf_increment": 1 / RATE}
        file.write_segment([nptdms.ChannelObject("Hammer", "force", np.arange(9.0), facts)])
        file.write_segment([nptdms.ChannelObject("Accel", "rail", np.arange(9.0))])
    (error,) = errors_of(tmp_path / "a.tdms", layout("N", "m/s²"))
    assert "'Accel': 9 samples of 0 s from no time" in error


def test_a_scale_beyond_the_stated_number_of_scales_is_an_error(tmp_path):
    """npTDMS applies as many scales as the file states, and none if the number is 0."""
    facts = {"wf_increment": 1 / RATE, "NI_Number_Of_Scales": 0, "NI_Scale[0]_Scale_Type": "Linear"}
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        channels = [nptdms.ChannelObject("g", name, np.arange(50.0) ** 2 % 7, facts) for name in ("force", "rail")]
        file.write_segment(channels)
    (error,) = errors_of(tmp_path / "a.tdms", layout("N", "m/s²"))
    assert "states the scale 'Linear' and a number of scales of 0: it is not applied" in error


@pytest.mark.parametrize("columns", ["No", "One"])
def test_the_unit_of_the_x_axis_of_lvm_is_used_and_another_quantity_is_an_error(made, impacts, tmp_path, columns):
    name = "one_header.lvm" if columns == "No" else "one_header_x.lvm"
    text = (made("04_lvm_one_header") / name).read_text()
    head, _, body = text.partition("X_Value\t")
    in_ms = head.replace("Delta_X\t5.000000E-05", "X_Unit_Label\tms\tms\t\nDelta_X\t5.000000E-02").replace(
        "5.000000E-05", "5.000000E-02"
    )
    rows = body.splitlines()
    if columns == "One":
        rows[1:] = [f"{float(t) * 1e3:.6f}\t{row}" for t, _, row in (row.partition("\t") for row in rows[1:])]
    (tmp_path / "a.lvm").write_text(f"{in_ms}X_Value\t" + "\n".join(rows) + "\n")
    for rate in (RATE, None):
        np.testing.assert_allclose(samples_of(tmp_path / "a.lvm", layout(rate=rate)), impacts, atol=5.1e-7)
    for old, new, words in (
        (
            "X_Dimension\tTime\tTime",
            "X_Dimension\tFrequency\tFrequency",
            "its X axis is Frequency in 'ms', and not the time",
        ),
        ("\tms\tms", "\tHz\tHz", "its X axis is Time in 'Hz', and not the time"),
    ):
        (tmp_path / "a.lvm").write_text(f"{in_ms.replace(old, new)}X_Value\t" + "\n".join(rows) + "\n")
        (error,) = errors_of(tmp_path / "a.lvm", layout())
        assert words in error


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, ""),
        ({"unit_string": "kN"}, "its property 'unit_string' changes from 'N' to 'kN' after 80 samples"),
        ({"wf_increment": 1e-4}, "its property 'wf_increment' changes from 5e-05 to 0.0001 after 80 samples"),
        ({"NI_Scale[0]_Linear_Slope": 2.0}, "'NI_Scale[0]_Linear_Slope' changes from 1.0 to 2.0"),
        ({"wf_start_time": np.datetime64("2026-05-13T08:00:10")}, "a write began 10 s after the first one"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("is_in_file", [False, True])
def test_a_channel_of_several_writes_starts_at_the_first_and_must_not_change_its_properties(
    tmp_path, changed, words, is_in_file
):
    """npTDMS returns the last value of a property, also for the samples before it."""
    scale = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear", "NI_Scale[0]_Linear_Slope": 1.0}
    scale |= {"NI_Scale[0]_Linear_Y_Intercept": 0.0, "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF}
    samples = np.random.default_rng(2).normal(size=(2, 120))
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        for k in range(3):
            start = np.datetime64("2026-05-13T08:00:00") + np.timedelta64(2000 * k, "us")
            facts = {"wf_increment": 1 / RATE, "wf_samples": 40, "wf_start_time": start, **scale}
            rows = samples[:, 40 * k : 40 * k + 40]
            force = facts | {"unit_string": "N"} | (changed if k == 2 else {})
            rail = facts | {"unit_string": "m/s²"}
            file.write_segment(
                [nptdms.ChannelObject("g", "force", rows[0], force), nptdms.ChannelObject("g", "rail", rows[1], rail)]
            )
    size = {"max_duration": 1e-3, "max_whole_file_size": 0} if is_in_file else {}
    result = read("a.tdms", tmp_path, layout(kind="passage"), **size)
    records = [*result.recordings, *result.long_recordings]
    if words:
        assert not records and words in str(result.errors[0])
    else:
        assert [r.started_at for r in records] == [datetime(2026, 5, 13, 8)] and records[0].n_sample == 120
