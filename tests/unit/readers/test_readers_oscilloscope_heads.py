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
