"""Texts in the encodings of older programs, and invalid steps of a time axis."""

import h5py
import nptdms
import numpy as np
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

CHANNELS = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
RATE = 20000.0
SAMPLES = np.random.default_rng(1).normal(size=(400, 2)).round(6)


def lvm(path, encoding="utf-8", step="5.0E-5", unit="m/s²", x_columns="No"):
    def row(name, *cells):
        return "\t".join((name, *cells)) + "\t\n"

    head = row("LabVIEW Measurement") + row("Separator", "Tab") + row("Decimal_Separator", ".")
    head += row("X_Columns", x_columns) + row("***End_of_Header***") + "\n"
    head += row("Channels", "2") + row("Samples", "400", "400") + row("Y_Unit_Label", "N", unit)
    head += row("X0", "0.0", "0.0") + row("Delta_X", step, step) + row("***End_of_Header***")
    head += row("X_Value", "force", "rail", "Comment")
    times = [f"{i / RATE:.6f}" if x_columns == "One" else "" for i in range(len(SAMPLES))]
    rows = "".join(f"{t}\t{f:.6f}\t{a:.6f}\n" for t, (f, a) in zip(times, SAMPLES))
    path.write_bytes((head + rows).encode(encoding))


def uff(path, step="  5.00000E-05"):
    lines = []
    for name, unit, samples in (("force", "N", SAMPLES[:, 0]), ("rail", "m/s^2", SAMPLES[:, 1])):
        lines += [f"{'    -1':80}", f"{'    58':80}", name, "NONE", "13-May-26 10:00:00", "NONE", "NONE"]
        lines += [f"{1:5d}{0:10d}{0:5d}{0:10d} {name:>10}{1:10d}{3:4d} {'NONE':>10}{0:10d}{0:4d}"]
        lines += [f"{4:10d}{len(samples):10d}{1:10d}{0.0:13.5E}{step:>13}{0.0:13.5E}"]
        lines += [
            f"{17:10d}{0:5d}{0:5d}{0:5d} {'Time':>20} {'s':>20}",
            f"{1:10d}{0:5d}{0:5d}{0:5d} {name:>20} {unit:>20}",
        ]
        lines += [f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':>20} {'NONE':>20}"] * 2
        lines += ["".join(f"{x:20.12E}" for x in samples[i : i + 4]) for i in range(0, len(samples), 4)]
        lines += [f"{'    -1':80}"]
    path.write_text("\n".join(lines) + "\n")


def tdms(path, step=1 / RATE, **properties):
    with nptdms.TdmsWriter(str(path)) as writer:
        units = {"force": "N", "rail": "m/s^2"}
        channels = [
            nptdms.ChannelObject("hit", name, samples, {"wf_increment": step, "unit_string": unit})
            for (name, unit), samples in zip(units.items(), SAMPLES.T)
        ]
        writer.write_segment([nptdms.GroupObject("hit", properties), *channels])


def outcome(tmp_path, name):
    """Samples in SI units, or the error."""
    result = read(name, tmp_path, RawDescription(CHANNELS, rate=RATE))
    return result.errors[0] if result.errors else np.stack([result.recordings[0].signal(c.name) for c in CHANNELS], 1)


def test_an_lvm_file_with_a_time_column_per_channel_has_a_header_cell_per_channel(tmp_path):
    """LabVIEW leaves an empty cell between those of the channels, as each channel has two columns."""
    lines = ["LabVIEW Measurement", "Separator\tTab", "Decimal_Separator\t.", "X_Columns\tMulti"]
    lines += ["***End_of_Header***", ""]
    lines += ["Channels\t2", "Samples\t400\t\t400", "Y_Unit_Label\tkN\t\tg", "X0\t0.0\t\t0.0", "Delta_X\t5E-5\t\t5E-5"]
    lines += ["***End_of_Header***", "X_Value\tforce\tX_Value\trail\tComment"]
    lines += [f"{i / RATE:.6f}\t{f:.6f}\t{i / RATE:.6f}\t{a:.6f}" for i, (f, a) in enumerate(SAMPLES)]
    (tmp_path / "a.lvm").write_text("\n".join(lines) + "\n")
    np.testing.assert_allclose(outcome(tmp_path, "a.lvm"), SAMPLES * [1000.0, 9.80665])


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "latin-1"])
def test_the_unit_of_an_lvm_file_is_read_in_the_encoding_of_the_program(encoding, tmp_path):
    lvm(tmp_path / "a.lvm", encoding)
    np.testing.assert_allclose(outcome(tmp_path, "a.lvm"), SAMPLES)


def test_an_lvm_file_in_utf16_is_an_error_that_states_its_encoding(tmp_path):
    lvm(tmp_path / "a.lvm", "utf-16")
    with pytest.raises(ReadError, match=r"its text is in UTF-16\. Save it as UTF-8"):
        outcome(tmp_path, "a.lvm")


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
@pytest.mark.parametrize("is_fixed", [True, False])
def test_the_unit_of_an_hdf5_file_is_read_in_the_encoding_of_the_program(encoding, is_fixed, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, unit, samples in (("force", "N", SAMPLES[:, 0]), ("rail", "m/s²", SAMPLES[:, 1])):
            file[name] = samples
            text = unit.encode(encoding)
            kind = None if is_fixed else h5py.string_dtype()
            file[name].attrs.create("units", np.bytes_(text) if is_fixed else text, dtype=kind)
    np.testing.assert_allclose(outcome(tmp_path, "a.h5"), SAMPLES)


def test_names_in_a_dataset_of_texts_are_read_in_the_encoding_of_the_program(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["data"] = SAMPLES
        file["channels"] = np.array([b"force", b"rail"], dtype=h5py.string_dtype())
        file["units"] = np.array([b"N", "m/s²".encode("cp1252")], dtype=h5py.string_dtype())
    np.testing.assert_allclose(outcome(tmp_path, "a.h5"), SAMPLES)


@pytest.mark.parametrize("step", ["0.0", "0", "-5.00000E-05", "NaN", ""])
def test_an_invalid_step_of_a_universal_file_is_an_error(step, tmp_path):
    uff(tmp_path / "a.uff")
    np.testing.assert_allclose(outcome(tmp_path, "a.uff"), SAMPLES)
    uff(tmp_path / "b.uff", step)
    error = outcome(tmp_path, "b.uff")
    assert error.reason == "wrong_rate" and "in abscissa spacing (record 7) states no rate" in str(error)


@pytest.mark.parametrize("step", ["0.0", "-5.0E-5", "NaN", ""])
def test_an_invalid_step_of_an_lvm_file_without_a_time_column_is_an_error(step, tmp_path):
    lvm(tmp_path / "a.lvm", step=step)
    error = outcome(tmp_path, "a.lvm")
    assert error.reason == "wrong_rate" and "in header of the segment: Delta_X states no rate" in str(error)
    lvm(tmp_path / "b.lvm", step=step, x_columns="One")
    np.testing.assert_allclose(outcome(tmp_path, "b.lvm"), SAMPLES)


@pytest.mark.parametrize("step", [0.0, -5e-5])
def test_an_invalid_step_of_a_tdms_file_is_an_error_unless_another_entry_states_the_rate(step, tmp_path):
    tdms(tmp_path / "a.tdms", step)
    error = outcome(tmp_path, "a.tdms")
    assert error.reason == "wrong_rate" and "wf_increment states no rate, and nothing else does" in str(error)
    tdms(tmp_path / "b.tdms", step, **{"Sample Rate": RATE})
    np.testing.assert_allclose(outcome(tmp_path, "b.tdms"), SAMPLES)
    tdms(tmp_path / "c.tdms", step, **{"Sample Rate": 25600.0})
    assert "sampled at 25600 Hz instead of 20000 Hz" in str(outcome(tmp_path, "c.tdms"))


def test_the_layout_can_declare_an_invalid_step_as_checked(tmp_path):
    tdms(tmp_path / "a.tdms", 0.0)
    description = RawDescription(CHANNELS, rate=RATE, checked_entries=("wf_increment",))
    assert len(read("a.tdms", tmp_path, description).recordings) == 1


@pytest.mark.parametrize(
    "text",
    [
        "13 mai 2026 10:00:00",
        "13. Mai 2026 10:00",
        "13 May 2026 10:00:00",
        "13. maj 2026 kl. 10:00",
        "13 de mayo de 2026 10:00",
    ],
)
@pytest.mark.parametrize("name", ["Start time", "Startzeit", "Messbeginn"])
def test_a_start_that_begins_with_the_day_is_not_read_as_a_number(name, text, tmp_path):
    rows = "".join(f"{f:.6f};{a:.6f}\n" for f, a in SAMPLES)
    (tmp_path / "a.csv").write_text(
        f"{name};{text}\nSample rate;20000\nforce [N];rail [m/s²]\n{rows}", encoding="utf-8"
    )
    result = read("a.csv", tmp_path, RawDescription(CHANNELS, rate=RATE))
    assert not result.errors and f"{result.recordings[0].started_at:%Y-%m-%d %H:%M}" == "2026-05-13 10:00"
