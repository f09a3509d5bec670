"""Text files whose head comes again below the rows, and what people write below the last row."""

import tracemalloc
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.timing import is_coarse
from turnout.records import RawChannel, RawDescription

RATE, N = 20000.0, 200
LAYOUT = RawDescription(
    (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration")), rate=RATE
)  # fmt: skip
NAMES = "t [s];force [N];rail [m/s2]"


def signals(k):
    """Force and response of record ``k``, (2, N): noise, which never repeats, and an impact."""
    noise = np.random.default_rng(k).normal(size=(2, N)).round(4)
    noise[0, 50:60] += 1000.0
    return noise


def rows_of(k, first=0.0):
    return [f"{first + i / RATE:.5f};{f:.4f};{a:.4f}" for i, (f, a) in enumerate(signals(k).T)]


def read_lines(lines, folder, description=LAYOUT):
    (folder / "a.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read("a.csv", folder, description)


def assert_error(words, *arguments):
    result = read_lines(*arguments)
    assert not result.recordings
    assert words in str(result.errors[0])


@pytest.mark.parametrize(
    "above",
    [[], [""], ["Test {}"], ["# Impact {}"], ["Test;{}", "Operator: Meier", ""], ["Max;;1003;3", "", "Test {}"]],
)
def test_a_head_that_comes_again_begins_another_record(above, tmp_path):
    lines = ["fs: 20000"]
    for k in range(3):
        lines += [line.format(k + 1) for line in above] + [NAMES, *rows_of(k)]
    result = read_lines(lines, tmp_path)
    assert not result.errors
    assert len(result.recordings) == 3
    for k, recording in enumerate(result.recordings):
        np.testing.assert_allclose(recording.read(0, N), signals(k), atol=1e-9)


def test_each_head_states_the_start_of_its_record_and_the_first_lines_are_about_the_file(tmp_path):
    lines = ["rail_temperature: 12.5"]
    for k in range(3):
        lines += [f"Start time: 2026-05-13 08:3{k}:00", "force [N];rail [m/s2]"]
        lines += [row.partition(";")[2] for row in rows_of(k)]
    result = read_lines(lines, tmp_path)
    first = datetime(2026, 5, 13, 8, 30)
    assert [r.started_at for r in result.recordings] == [first + timedelta(minutes=k) for k in range(3)]
    assert [r.conditions["rail_temperature"] for r in result.recordings] == [12.5] * 3


@pytest.mark.parametrize(
    "own", [["Test {}"], ["", "# Test {}"], ["Impact {}", "Start: 2026-05-13 08:3{}:00"], ["a", "b", "c"]]
)
def test_the_lines_of_the_file_count_for_each_table_however_many_lines_a_table_has(own, tmp_path):
    """Formerly, as many lines of the first head were its own as stand above the second table."""
    lines = ["rail_temperature: 12.5"]
    for k in range(3):
        lines += [line.format(k) for line in own if k or own != ["a", "b", "c"]] + [NAMES, *rows_of(k)]
    result = read_lines(lines, tmp_path)
    assert [r.conditions.get("rail_temperature") for r in result.recordings] == [12.5] * 3


def test_a_number_in_the_first_lines_is_no_statistic_of_a_table_above(tmp_path):
    """Formerly, it was reported of the second record alone."""
    result = read_lines(["Maximum: 10", NAMES, *rows_of(0), NAMES, *rows_of(1)], tmp_path)
    assert ["record 1 of 2: 'Maximum: 10' in line 1" in str(error) for error in result.errors] == [True]


def test_a_time_that_goes_on_below_a_repeated_head_is_one_record(tmp_path):
    lines = [NAMES, *rows_of(0), NAMES, *rows_of(1, first=N / RATE)]
    with pytest.raises(ReadError, match=r"table 2 of 2: .* the time goes on: it is one record. Delete the lines"):
        read_lines(lines, tmp_path)


@pytest.mark.parametrize("resolution", [1e-3, 1e-4])
@pytest.mark.parametrize("first", [N - 1, N, N + 1])
def test_a_coarse_clock_that_goes_on_below_a_repeated_head_is_one_record(resolution, first, tmp_path):
    """The last time comes again, or the next one is 20 steps later."""

    def rows(k, first):
        times = np.floor((first + np.arange(N)) / RATE / resolution + 1e-6) * resolution
        return [f"{t:.4f};{f:.4f};{a:.4f}" for t, (f, a) in zip(times, signals(k).T)]

    with pytest.raises(ReadError, match="the time goes on: it is one record"):
        read_lines([NAMES, *rows(0, 0), NAMES, *rows(1, first)], tmp_path)
    assert len(read_lines([NAMES, *rows(0, 0), NAMES, *rows(1, 0)], tmp_path).recordings) == 2


def test_without_time_and_starts_nothing_says_whether_another_record_begins(tmp_path):
    rows = [[row.partition(";")[2] for row in rows_of(k)] for k in range(2)]
    lines = ["force [N];rail [m/s2]", *rows[0], "force [N];rail [m/s2]", *rows[1]]
    with pytest.raises(ReadError, match=r"nothing says whether another record begins.*column 'record'"):
        read_lines(lines, tmp_path)


def test_a_damaged_table_costs_its_record_and_its_line_keeps_its_number(tmp_path):
    tables = [[NAMES, *rows_of(k)] for k in range(3)]
    tables[1][10] = "0.00045;abc;1.0"
    result = read_lines([line for table in tables for line in table], tmp_path)
    assert len(result.recordings) == 2
    (error,) = result.errors
    assert str(error).startswith(f"a.csv, line {N + 1 + 11}, column 'force': 'abc' is no number")


@pytest.mark.parametrize(
    "tail", [";;\n;;", "# 200 samples\n# end", "// 2026-05-13 end", '"";"";""', "% 3 rows left out"]
)
def test_empty_rows_and_comments_below_the_rows_are_left_out(tail, tmp_path):
    result = read_lines([NAMES, *rows_of(0), tail], tmp_path)
    assert not result.errors
    np.testing.assert_allclose(result.recordings[0].read(0, N), signals(0), atol=1e-9)


@pytest.mark.parametrize("row", ["# 0.01;1.5;2.5", ";;2.5", "0.01;;"])
def test_a_row_with_a_number_below_the_rows_is_not_left_out(row, tmp_path):
    try:
        result = read_lines([NAMES, *rows_of(0), row], tmp_path)
    except ReadError:
        return
    assert result.errors


@pytest.mark.parametrize(
    "line",
    ["Abtastfrequenz 25,6 kHz", "Sampling rate, kHz: 25.6", "Частота дискретизации, кГц: 25,6", "Rate, Hz;25600"],
)
def test_a_comma_in_a_line_of_the_head_separates_no_decimals_and_no_unit(line, tmp_path):
    """Formerly, "25,6 kHz" was a name that ends in 25 and a rate of 6 kHz."""
    rows = [row.partition(";")[2] for row in rows_of(0)]
    right, wrong = (RawDescription(LAYOUT.channels, rate=rate) for rate in (25600.0, 6000.0))
    result = read_lines([line, "force [N];rail [m/s2]", *rows], tmp_path, right)
    assert not result.errors
    assert_error("sampled at 25600 Hz instead of 6000 Hz", [line, "force [N];rail [m/s2]", *rows], tmp_path, wrong)


@pytest.mark.parametrize("line", ["Rate1,20000", "Sampling rate CH12,20000", "fs_1,20000"])
def test_a_digit_at_the_end_of_a_name_is_no_number_before_a_comma(line, tmp_path):
    """Formerly, "Rate1,20000" was a rate of 1.2 kHz."""
    rows = [row.partition(";")[2] for row in rows_of(0)]
    assert not read_lines([line, "force [N];rail [m/s2]", *rows], tmp_path).errors


@pytest.mark.parametrize(
    ("names", "encoding"),
    [
        (("Siła", "Szyna"), "cp1250"),
        (("Сила", "Рельс"), "cp1251"),
        (("力", "加速度"), "gbk"),
        (("Δύναμη", "Τροχιά"), "cp1253"),
    ],
)
def test_the_layout_names_channels_in_the_8_bit_encoding_of_the_logger(names, encoding, tmp_path):
    text = "\n".join([f"t [s];{names[0]} [N];{names[1]} [m/s2]", *rows_of(0)]) + "\n"
    (tmp_path / "a.csv").write_bytes(text.encode(encoding))
    channels = (RawChannel("force", names[0], "force"), RawChannel("rail", names[1], "acceleration"))
    result = read("a.csv", tmp_path, RawDescription(channels, rate=RATE))
    assert not result.errors
    np.testing.assert_allclose(result.recordings[0].read(0, N), signals(0), atol=1e-9)


def test_russian_units_behind_names(tmp_path):
    kilonewtons = [f"{i / RATE:.5f};{f / 1000:.7f};{a:.4f}" for i, (f, a) in enumerate(signals(0).T)]
    channels = (RawChannel("force", "Сила", "force"), RawChannel("rail", "Рельс", "acceleration"))
    lines = ["t, с;Сила, кН;Рельс, м/с²", *kilonewtons]
    result = read_lines(lines, tmp_path, RawDescription(channels, rate=RATE))
    assert not result.errors
    np.testing.assert_allclose(result.recordings[0].read(0, N), signals(0), atol=1e-3)


def coarse(resolution, n=2000):
    return np.floor(np.arange(n) / RATE / resolution + 1e-6) * resolution


@pytest.mark.parametrize("resolution", [1e-3, 1e-2, 0.0156, 8e-5])
def test_samples_may_share_the_times_of_a_coarse_clock(resolution, tmp_path):
    noise = np.random.default_rng(0).normal(size=(2, 2000)).round(4)
    lines = [NAMES] + [f"{t:.6f};{f:.4f};{a:.4f}" for t, f, a in zip(coarse(resolution), *noise)]
    result = read_lines(lines, tmp_path)
    assert not result.errors
    assert result.recordings[0].rate == RATE
    assert_error("instead of 51200 Hz", lines, tmp_path, RawDescription(LAYOUT.channels, rate=51200.0))


@pytest.mark.parametrize("fault", ["gap", "repeated", "stopped"])
def test_faults_of_a_coarse_clock_and_of_a_fine_one_are_errors(fault, tmp_path):
    times = coarse(1e-3)
    if fault == "gap":
        times[1000:] += 0.01
    else:
        times = np.arange(2000) / RATE
        times[1000 : 1001 if fault == "repeated" else 1100] = times[999]
    noise = np.random.default_rng(0).normal(size=(2, 2000)).round(4)
    assert_error("stands still", [NAMES] + [f"{t:.6f};{f:.4f};{a:.4f}" for t, f, a in zip(times, *noise)], tmp_path)


def test_the_times_of_a_long_record_are_not_copied_to_see_that_its_clock_is_fine():
    times = np.arange(2_000_000) / RATE
    tracemalloc.start()
    assert not is_coarse(times)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 0.5 * times.nbytes


def test_a_time_that_begins_again_is_said_to_be_another_record(tmp_path):
    assert_error(
        f"its time begins again after {N} samples: another record follows", [NAMES, *rows_of(0), *rows_of(1)], tmp_path
    )


@pytest.mark.parametrize(("stated", "n_read"), [(3 * N, 3), (N, 3), (4 * N, 0)])
def test_a_number_of_samples_in_the_first_lines_may_count_those_of_all_tables(stated, n_read, tmp_path):
    lines = [f"Number of samples;{stated}"]
    for k in range(3):
        lines += [f"Test {k + 1}", NAMES, *rows_of(k)]
    result = read_lines(lines, tmp_path)
    assert (len(result.recordings), len(result.errors)) == (n_read, 3 - n_read)


@pytest.mark.parametrize(
    "head",
    [
        ["#t;force;rail", "#s;N;m/s2"],
        ["# t;force;rail", "# [s];[N];[m/s2]"],
        ["Time;force;rail", ";PCB 086;PCB 352", "[s];[N];[m/s2]"],
        ["Channel;force;rail", "t [s];CH1 [N];CH2 [m/s2]"],
        ["Kanal;force;rail", "Sensor;S1;S2", "t;CH1;CH2", "s;N;m/s2"],
    ],
)
def test_the_layout_names_a_channel_by_any_line_of_words_above_the_rows(head, tmp_path):
    result = read_lines([*head, *rows_of(0)], tmp_path)
    assert not result.errors
    np.testing.assert_allclose(result.recordings[0].read(0, N), signals(0), atol=1e-9)


def test_units_in_a_line_behind_a_mark_of_a_comment_are_those_of_the_file(tmp_path):
    """Formerly, the units were the names."""
    channels = tuple(RawChannel(c.name, c.source, c.quantity, unit="N") for c in LAYOUT.channels[:1])
    layout = RawDescription((*channels, LAYOUT.channels[1]), rate=RATE)
    assert_error("the file says 'kN', the layout 'N'", ["#t;force;rail", "#s;kN;m/s2", *rows_of(0)], tmp_path, layout)


def test_a_word_in_two_lines_is_the_name_in_the_line_of_names(tmp_path):
    result = read_lines(["Was;rail;force", NAMES, *rows_of(0)], tmp_path)
    np.testing.assert_allclose(result.recordings[0].read(0, N), signals(0), atol=1e-9)


def test_a_direction_is_that_of_the_channel_with_this_name_and_not_with_this_further_name(tmp_path):
    """The layout inverts the channel of which the file says so."""
    layout = (RawChannel("a", "a", "acceleration", sign=-1), RawChannel("b", "b", "acceleration"))
    lines = ["Direction of a: -z", "Was;b;a", "t [s];a [m/s2];b [m/s2]", *rows_of(0)]
    assert not read_lines(lines, tmp_path, RawDescription(layout, rate=RATE)).errors
    other_layout = (replace(layout[0], sign=1), layout[1])
    assert read_lines(lines, tmp_path, RawDescription(other_layout, rate=RATE)).errors


def test_the_unit_of_a_rate_may_be_in_the_next_cell(tmp_path):
    rows = [row.partition(";")[2] for row in rows_of(0)]
    lines = ["fs: 20;kHz", "force [N];rail [m/s2]", *rows]
    assert not read_lines(lines, tmp_path).errors
    assert_error("instead of 25600 Hz", lines, tmp_path, RawDescription(LAYOUT.channels, rate=25600.0))


def test_a_column_of_time_without_numbers_is_no_time(tmp_path):
    result = read_lines(["fs: 20000", NAMES, *(";" + row.partition(";")[2] for row in rows_of(0))], tmp_path)
    assert not result.errors
    np.testing.assert_allclose(result.recordings[0].read(0, N), signals(0), atol=1e-9)


def test_times_for_each_column_directly_above_the_rows_are_a_start_and_no_names(tmp_path):
    head = ["Trace;force;rail", "Unit;N;m/s2", "Date;13.05.2026;13.05.2026", "Time;08:30:12.5;08:30:12.5"]
    layout = tuple(RawChannel(c.name, c.source, c.quantity, unit=u) for c, u in zip(LAYOUT.channels, ("N", "m/s²")))
    rows = [";" + row.partition(";")[2] for row in rows_of(0)]
    result = read_lines([*head, *rows], tmp_path, RawDescription(layout, rate=RATE))
    (recording,) = result.recordings
    assert recording.started_at == datetime(2026, 5, 13, 8, 30, 12, 500000)
    np.testing.assert_allclose(recording.read(0, N), signals(0), atol=1e-9)


def test_the_error_of_a_name_in_a_head_of_sections_states_where_it_is(tmp_path):
    head = ["[Channel1]", "Name=force", "Unit=N", "[Channel2]", "Name=rail", "Unit=m/s2", "[Data]"]
    rows = [row.partition(";")[2] for row in rows_of(0)]
    words = "'force' is the value of 'Name' in line 2. Name the channel by its number in the layout, from 0"
    assert_error(words, [*head, *rows], tmp_path)


def test_tables_of_a_file_that_is_read_in_blocks(tmp_path):
    lines = [line for k in range(3) for line in (NAMES, *rows_of(k))]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    result = read("a.csv", tmp_path, LAYOUT, max_duration=1e-3, max_whole_file_size=0)
    recordings = [*result.recordings, *result.long_recordings]
    assert len(recordings) == 3
    np.testing.assert_allclose(recordings[2].read(0, N), signals(2), atol=1e-9)
