"""Lines of a head with a cell for each channel: units above the names or behind a label, scales between commas."""

import numpy as np
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
N = 300
FORCE, RAIL = np.random.default_rng(1).normal(size=(2, N)).round(4)
IN_FILE_UNITS = (RawChannel("force", "Force", "force"), RawChannel("rail", "Rail", "acceleration"))
IN_VOLTS = (
    RawChannel("force", "Force", "force", "V", 1.0, "V/N"),
    RawChannel("rail", "Rail", "acceleration", "V", 1.0, "V/(m/s²)"),
)


def read_table(tmp_path, head, separator, begin="{t:.5f};", channels=IN_FILE_UNITS):
    rows = "".join(f"{begin.format(t=k / RATE)}{f};{r}\n" for k, (f, r) in enumerate(zip(FORCE, RAIL)))
    (tmp_path / "a.csv").write_text((head + rows).replace(";", separator), "utf-8")
    return read("a.csv", tmp_path, RawDescription(channels, rate=RATE))


@pytest.mark.parametrize("separator", [";", ",", "\t"])
@pytest.mark.parametrize(
    ("head", "begin"),
    [
        ("s;kN;g\nTime;Force;Rail\n", "{t:.5f};"),
        ("Test 1;Track 3;West\n[s];[kN];[g]\nTime;Force;Rail\n", "{t:.5f};"),
        ("kN;g\nForce;Rail\n", ""),
        ("Unit;kN;g\nName;Force;Rail\n", ";"),
        ("Unit;s;kN;g\nName;Time;Force;Rail\n", ";{t:.5f};"),
        ("Name;Force;Rail\nUnit;kN;g\nSensor;hammer;accelerometer\n", ";"),
        ("Einheit;kN;g\nDatum;13.05.2026;13.05.2026\nKanal;Force;Rail\n", ";"),
        ("Name;Force;Rail\nUnit;kN;g\nTime;Force;Rail\n", "{t:.5f};"),
        ("Name:;Force;Rail\nUnit:;kN;g\n", ""),
        ("Name;Force;Rail\nUnit;kN;g\ndx;5E-5;5E-5\n", ""),
        ("s;kN;g\nTime;CH1;CH2\nTime;Force;Rail\n", "{t:.5f};"),
        ("Name;Force;Rail\nUnit;kN;g\nMaximum;n/a;n/a\n", ";"),
        ("s;kN;g\nTime;Force;Rail\ns;kN;g\n", "{t:.5f};"),
        ("s;kN;g\nTime;CH1;CH2\nTime;Force;Rail\ns;kN;g\n", "{t:.5f};"),
    ],
)
def test_units_above_the_names_or_behind_a_label_are_those_of_the_columns(head, begin, separator, tmp_path):
    result = read_table(tmp_path, head, separator, begin)
    np.testing.assert_allclose(result.recordings[0].samples, [1000.0 * FORCE, 9.80665 * RAIL], rtol=1e-9)
    assert not result.errors


@pytest.mark.parametrize("separator", [";", ",", "\t"])
@pytest.mark.parametrize(
    ("head", "begin", "reason"),
    [
        ("s;kN;g\nTime [s];Force [N];Rail [m/s²]\n", "{t:.5f};", "scale_unknown"),
        ("Name;Force;Rail\nUnit;kN;g\nDelay [ms];0;1.5\nTime;Force;Rail\n", "{t:.5f};", "clock_drift"),
        ("Name;Force;Rail\nUnit;kN;g\ndx;5E-5;1E-4\n", "", "wrong_rate"),
    ],
)
def test_lines_that_contradict_each_other_are_an_error(head, begin, reason, separator, tmp_path):
    result = read_table(tmp_path, head, separator, begin)
    assert not result.recordings and result.errors[0].reason == reason


@pytest.mark.parametrize("separator", [";", ",", "\t"])
@pytest.mark.parametrize("line", ["Probe Attenuation;{};{}", "Gain;{};{}", "Gain;;{};{}"])
@pytest.mark.parametrize(
    ("values", "is_neutral"), [(("1", "1"), True), (("1X", "1X"), True), (("10", "1"), False), (("1", "10X"), False)]
)
def test_a_comma_between_the_scales_of_two_channels_is_no_decimal_mark(line, values, is_neutral, separator, tmp_path):
    head = f"{line.format(*values)}\nTime;Force;Rail\n"
    result = read_table(tmp_path, head, separator, channels=IN_VOLTS)
    assert len(result.recordings) == is_neutral
    assert {error.reason for error in result.errors} == (set() if is_neutral else {"scale_unknown"})


@pytest.mark.parametrize(
    "head",
    [
        "s;N;m/s²\nTime;Force;Rail\ns;kN;g\n", "Time;Force;Rail\ns;V;V\ns;kN;g\n",
        "ms;kN;g\nTime;Force;Rail\ns;kN;g\n", "Time [s];Force [N];Rail [m/s²]\ns;kN;g\n",
    ],
)  # fmt: skip
def test_two_lines_of_units_that_differ_are_an_error(head, tmp_path):
    with pytest.raises(ReadError) as caught:
        result = read_table(tmp_path, head, ";")
        raise result.errors[0]
    assert caught.value.reason in ("unit_unknown", "scale_unknown")


@pytest.mark.parametrize("ranges", ["10 V;5 V", "5000 N;100 m/s²", "0.1 N;.01 m/s²", "-5 V;-5 V"])
@pytest.mark.parametrize("head", ["{}\nForce;Rail\nkN;g\n", "Force;Rail\nkN;g\n{}\n"])
def test_numbers_with_units_are_ranges_and_no_second_line_of_units(head, ranges, tmp_path):
    result = read_table(tmp_path, head.format(ranges), ";", "")
    assert len(result.recordings) == 1 and [error.reason for error in result.errors] in ([], ["entry_unknown"])
    np.testing.assert_allclose(result.recordings[0].samples, [1e3 * FORCE, 9.80665 * RAIL])
