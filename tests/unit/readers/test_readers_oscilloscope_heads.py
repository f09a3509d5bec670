"""Heads of oscilloscopes and loggers: values below names, several numbers in one line, and divisions of a screen."""

import numpy as np
import pytest
from test_readers_notations_of_starts import WRITERS

from turnout.readers import names_and_units, read
from turnout.records import RawChannel, RawDescription

TRUE, OTHER = 25600.0, 20000.0
NOISE = np.random.default_rng(0).normal(size=(2, 128)).round(4)
VALUES_BELOW_NAMES = {
    "empty cells": ("X,CH1,CH2,Start,Increment,", "Sequence,VOLT,VOLT,-7.5e-03,3.906250e-05", "{i},{a},{b},,"),
    "names as wide as the rows": ("X,CH1,CH2,Start,Increment", "Sequence,Volt,Volt,0,3.90625E-05", "{i},{a},{b},,"),
    "no cells": ("X,CH1,CH2,Start,Increment", "Sequence,V,V,0,3.90625e-05", "{i},{a},{b}"),
    "a cell between": ("X,CH1,CH2,,Sample rate", "s,V,V,,25600", "{t:.8f},{a},{b},,"),
    "one value": ("CH1,CH2,dt", "V,V,3.90625E-05", "{a},{b},"),
    "one value without cells": ("CH1,CH2,tInc", "V,V,3.90625E-05", "{a},{b}"),
    "units in brackets": ("CH1,CH2,Rate", "(V),(V),25600", "{a},{b},"),
}
VOLTS = (
    RawChannel("force", "CH1", "force", unit="V", sensitivity=1.0, sensitivity_unit="V/N"),
    RawChannel("rail", "CH2", "acceleration", unit="V", sensitivity=1.0, sensitivity_unit="V/(m/s²)"),
    RawChannel("x", "X", "ignored"),
)
IN_SI = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²"))


def scope_file(tmp_path, kind, separator):
    first, second, row = VALUES_BELOW_NAMES[kind]
    rows = [row.format(i=i, t=i / TRUE, a=a, b=b) for i, (a, b) in enumerate(NOISE.T)]
    text = "\n".join([first, second, *rows, ""])
    text = text if separator == "," else text.replace(",", separator).replace(".", ",")
    (tmp_path / "a.csv").write_text(text)
    return lambda rate: read("a.csv", tmp_path, RawDescription(VOLTS, rate=rate))


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("kind", VALUES_BELOW_NAMES)
def test_a_step_or_rate_below_its_name_is_compared_with_the_layout(kind, separator, tmp_path):
    result = scope_file(tmp_path, kind, separator)(TRUE)
    np.testing.assert_allclose([r.samples for r in result.recordings], [NOISE], atol=1e-9)
    (error,) = scope_file(tmp_path, kind, separator)(OTHER).errors
    assert error.reason == "wrong_rate"


def head_file(tmp_path, line):
    rows = "".join(f"{a};{b}\n" for a, b in NOISE.T)
    (tmp_path / "a.csv").write_text(f"{line}\nforce;rail\n{rows}")
    return read("a.csv", tmp_path, RawDescription(IN_SI, rate=OTHER))


@pytest.mark.parametrize(
    "line",
    [
        *["Block Length/Delta;64 / 39.0625E-6", "Block length / delta: 64/3.90625e-05 s", "Channels/Rate: 2/25600 Hz"],
        *[
            "Rate/Resolution;25600/24",
            "Fs & samples: 25600 & 128",
            "Gain/Offset;0.5/0",
            "Rate|Resolution: 25600 Hz|24 bit",
        ],
    ],
)
def test_each_of_several_numbers_in_a_line_is_compared(line, tmp_path):
    (error,) = head_file(tmp_path, line).errors
    assert error.reason in ("wrong_rate", "rate_ambiguous", "scale_unknown")
    assert not head_file(tmp_path, line).recordings


@pytest.mark.parametrize("line", ["Channels/Rate: 2/20000", "Rate/Resolution;20000 Hz / 24 bit", "Gain/Offset;1/0",
                                  "Panel/Track;CP/2", "Temp/Humidity: 12 / 80", "Map/Scale: 1/500"])  # fmt: skip
def test_several_numbers_that_contradict_nothing_are_accepted(line, tmp_path):
    result = head_file(tmp_path, line)
    assert (len(result.recordings), result.errors) == (1, ())


@pytest.mark.parametrize("write", WRITERS[2:])
def test_several_numbers_in_one_entry_of_any_format_are_compared(write, tmp_path):
    write(tmp_path / "a", "Block Length/Delta", "64 / 39.0625E-6")
    (path,) = tmp_path.iterdir()
    result = read(path.name, tmp_path, RawDescription(IN_SI, rate=OTHER))
    assert result.errors


@pytest.mark.parametrize(
    "line",
    [
        *["Time/div;1 ms", "Time per division: 1 ms", "Timebase: 1 ms/div", "Time scale;5 ms/div", "TIME/DIV,500us"],
        *["Points/div;25.6", "Horizontal scale: 100 us/div", "s/div;0.001"],
    ],
)
def test_a_division_of_a_screen_is_about_no_sample(line, tmp_path):
    result = head_file(tmp_path, line)
    assert (len(result.recordings), result.errors) == (1, ())


@pytest.mark.parametrize("line", ["Timebase: 39.0625 us/pt", "Time/div 1 ms, Fs: 25600", "Time/point: 39.0625 us"])
def test_a_time_of_a_sample_beside_a_division_is_compared(line, tmp_path):
    assert not head_file(tmp_path, line).recordings


@pytest.mark.parametrize("kind", VALUES_BELOW_NAMES)
def test_the_names_are_those_above_the_values(kind, tmp_path):
    scope_file(tmp_path, kind, ",")
    names = [name for name, _ in names_and_units("a.csv", tmp_path)]
    assert names in (["CH1", "CH2"], ["X", "CH1", "CH2"])  # a time in seconds is no channel


def scope_text(tmp_path, head, values=NOISE, row="{a},{b}", rate=TRUE, channels=None):
    rows = [row.format(i=i, t=i / TRUE, a=a, b=b) for i, (a, b) in enumerate(values.T)]
    (tmp_path / "a.csv").write_text("\n".join([*head, *rows, ""]))
    return read("a.csv", tmp_path, RawDescription(channels or VOLTS, rate=rate))


SCREEN = ("Vertical Scale,CH1:0.5,CH2:0.5", "Vertical Offset,CH1:0.00000,CH2:0.00000", "Horizontal Scale,0.001")
MODEL = ("Model Number,SDS2354X Plus", "Serial Number,SDS2PEDC6R0001", "Software Version,1.3.9R12")
LABELLED = ("Record Length,Analog:{n}", "Sample Interval,Analog:{step}", "Vertical Units,CH1:V,CH2:V", *SCREEN, *MODEL)
PLAIN = ("Record Length,{n}", "Sample Interval,{step}", "Vertical Units,V,V", "Vertical Scale,0.5,0.5",
         "Horizontal Scale,0.001", *MODEL)  # fmt: skip


@pytest.mark.parametrize("lines", [LABELLED, PLAIN])
@pytest.mark.parametrize(("n", "step", "reason"), [(128, 3.90625e-05, ""), (128, 5e-5, "wrong_rate"),
                                                   (280, 3.90625e-05, "truncated")])  # fmt: skip
def test_values_with_labels_and_divisions_of_a_screen(lines, n, step, reason, tmp_path):
    head = [line.format(n=n, step=f"{step:.8g}") for line in (*lines, "X,CH1,CH2", "s,V,V")]
    result = scope_text(tmp_path, head, row="{t:.8f},{a},{b}")
    assert [error.reason for error in result.errors] == ([reason] if reason else [])
    if not reason:
        np.testing.assert_allclose([r.samples for r in result.recordings], [NOISE])


@pytest.mark.parametrize("head", [["Vertical Scale,2E-4,2E-4", "CH1,CH2"], [*SCREEN, "CH1,CH2"]])
def test_samples_that_do_not_fit_on_the_screen_are_reported(head, tmp_path):
    result = scope_text(tmp_path, head, np.rint(NOISE * 5000))
    assert [error.reason for error in result.errors] == ["entry_unknown"]


@pytest.mark.parametrize("line", ["Comment;Track: 5;Panel: CP", "Position;A: 12.5 m;B: 13.0 m", "Scale;CH1:1;CH2:1"])
def test_labels_that_are_no_channels_are_names(line, tmp_path):
    result = head_file(tmp_path, line)
    assert (len(result.recordings), result.errors) == (1, ())


@pytest.mark.parametrize("line", ["Scale;CH1:0.5;CH2:1", "Gain;force:2;rail:1", "Polarity;force:normal;rail:inverted"])
def test_a_scale_behind_the_label_of_a_channel_is_compared(line, tmp_path):
    assert not head_file(tmp_path, line).recordings


@pytest.mark.parametrize("line", ["Tstart,-0.1", "Tstart;-0.1", "XStart:-1.0E-01"])
def test_the_first_time_of_the_axis_is_no_scale(line, tmp_path):
    result = head_file(tmp_path, line)
    assert (len(result.recordings), result.errors) == (1, ())


def test_the_unit_of_the_horizontal_axis_is_none_of_the_channels(tmp_path):
    head = [
        '"TraceName","CH1","CH2"',
        '"VUnit","V","V"',
        '"HResolution",3.90625E-05,3.90625E-05',
        '"HUnit","s","s"',
        "",
    ]
    result = scope_text(tmp_path, head, row=",{a},{b}")
    np.testing.assert_allclose([r.samples for r in result.recordings], [NOISE])
    assert names_and_units("a.csv", tmp_path)[-2:] == (("CH1", "V"), ("CH2", "V"))


def test_a_coupling_beside_a_range_is_no_offset(tmp_path):
    result = scope_text(tmp_path, ["CH1,hammer,DC,10V", "CH2,head,AC,5V", "CH1,CH2"])
    assert (len(result.recordings), result.errors) == (1, ())


@pytest.mark.parametrize("unit", ['"VUnit","V","V"', '"Unit","V","V"'])
def test_the_horizontal_axis_in_a_head_with_labels_and_rows_without_them(unit, tmp_path):
    step = f"{1 / TRUE:.8g}"
    head = ['"TraceName","CH1","CH2"', unit, f'"HResolution","{step}","{step}"', '"HOffset","-0.01","-0.01"',
            '"HUnit","s","s"']  # fmt: skip
    result = scope_text(tmp_path, head)
    np.testing.assert_allclose([r.samples for r in result.recordings], [NOISE])
    assert result.errors == () and names_and_units("a.csv", tmp_path)[-2:] == (("CH1", "V"), ("CH2", "V"))


@pytest.mark.parametrize("name", ["VOffset", "Offset", "Y Offset"])
def test_the_offset_of_another_axis_is_compared(name, tmp_path):
    assert not scope_text(tmp_path, [f"{name},-0.01,-0.01", "CH1,CH2"]).recordings


@pytest.mark.parametrize("lines", [["Type:,raw", "X Units:,second"], ["Type:,raw,raw"], ["Acq Mode,raw"]])
def test_a_type_of_acquisition_is_a_remark(lines, tmp_path):
    (error,) = scope_text(tmp_path, [*lines, "CH1,CH2"]).errors
    assert error.reason == "entry_unknown"
    name = lines[0].partition(",")[0].rstrip(":")
    assert str(error).endswith(f"'checked_entries: {name}'.")


@pytest.mark.parametrize("line", ["Data,raw", "Values,raw,raw"])
def test_samples_that_are_called_raw_are_an_error(line, tmp_path):
    assert not scope_text(tmp_path, [line, "CH1,CH2"]).recordings
