"""Rows and cells without numbers in text files: separators alone, blanks, zero bytes, and heads with quoted cells."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
N = 60
GENERATOR = np.random.default_rng(11)
FIRST, SECOND = (GENERATOR.normal(size=(N, 2)).round(4) for _ in range(2))
CHANNELS = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²"))
LAYOUT = RawDescription(CHANNELS, rate=RATE)
IN_MEMORY, IN_FILE = {}, {"max_duration": 1e-3, "max_whole_file_size": 0}
BLANK_ROWS = {"empty": "", "separators": ";", "spaced": " ; ", "quoted": '"";""', "spaces": "   "}


def rows_of(samples, start=""):
    return [f"{start}{a:.4f};{b:.4f}" for a, b in samples]


def result_of(folder, lines, description=LAYOUT, **options):
    description = replace(description, kind="passage" if options else "hammer")
    (folder / "a.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read("a.csv", folder, description, **options)


def samples_of(result):
    return [recording.samples.T for recording in result.recordings]


@pytest.mark.parametrize("blank", BLANK_ROWS)
def test_a_row_without_numbers_among_the_samples_is_an_error_with_its_line(blank, tmp_path):
    rows = rows_of(FIRST)
    lines = ["force;rail", *rows[:20], BLANK_ROWS[blank], *rows[20:]]
    with pytest.raises(ReadError, match=r"a\.csv, line 22: an? .* stands before its last 40 rows"):
        result_of(tmp_path, lines)


@pytest.mark.parametrize("start", ["2026-05-13 10:00:00.{:06d};", "13.05.2026;10:00:00.{:06d};"])
def test_a_row_of_separators_among_times_of_day_is_an_error_with_its_line(start, tmp_path):
    rows = [start.format(50 * k) + row for k, row in enumerate(rows_of(FIRST))]
    names = "Timestamp;" if start.count(";") == 1 else "Date;Time;"
    lines = [f"{names}force;rail", *rows[:20], ";" * rows[0].count(";"), *rows[20:]]
    with pytest.raises(ReadError, match="line 22: a row without numbers stands before its last 40 rows"):
        result_of(tmp_path, lines)


# A long text with blanks between its separators is not read from the file.
IN_BOTH_WAYS = [(blank, IN_MEMORY) for blank in BLANK_ROWS]
IN_BOTH_WAYS += [(blank, IN_FILE) for blank in BLANK_ROWS if blank not in ("spaced", "spaces")]


@pytest.mark.parametrize(("blank", "options"), IN_BOTH_WAYS)
def test_rows_without_numbers_below_the_samples_or_behind_each_are_left_out(blank, options, tmp_path):
    rows, empty = rows_of(FIRST), BLANK_ROWS[blank]
    spaced = [line for row in rows for line in (row, empty)]
    for lines in ([*rows, empty, empty], [*rows, empty, "End of file"], spaced, [*spaced, "End"]):
        result = result_of(tmp_path, ["force;rail", *lines], **options)
        assert result.errors == ()
        recordings = (*result.recordings, *result.long_recordings)
        samples = [r.samples if hasattr(r, "samples") else r.read(0, r.n_sample) for r in recordings]
        np.testing.assert_allclose(samples, [FIRST.T], atol=1e-12)


@pytest.mark.parametrize("blank", ["", ";;", " ; ; "])
def test_a_row_without_numbers_between_records_separates_them_and_within_one_costs_it(blank, tmp_path):
    first, second = rows_of(FIRST, "1;"), rows_of(SECOND, "2;")
    head = "record;force;rail"
    result = result_of(tmp_path, [head, *first, blank, *second])
    assert result.errors == ()
    np.testing.assert_allclose(samples_of(result), [FIRST, SECOND], atol=1e-12)
    result = result_of(tmp_path, [head, *first, *second[:9], blank, *second[9:]])
    np.testing.assert_allclose(samples_of(result), [FIRST], atol=1e-12)
    assert [error.reason for error in result.errors] == ["not_finite"]
    assert "record 2 of 2" in result.errors[0].where


def test_rows_of_nan_among_the_samples_are_missing_samples(tmp_path):
    rows = [row for pair in zip(rows_of(FIRST), ["NaN;NaN"] * N) for row in pair]
    result = result_of(tmp_path, ["force;rail", *rows])
    assert not result.recordings and result.errors[0].reason == "not_finite"


@pytest.mark.parametrize("where", ["below the names", "below the samples"])
@pytest.mark.parametrize("options", [IN_MEMORY, IN_FILE], ids=["in memory", "in the file"])
def test_rows_of_least_and_largest_numbers_are_no_samples(where, options, tmp_path):
    summary = rows_of([FIRST.min(axis=0), FIRST.max(axis=0)])
    rows = rows_of(FIRST)
    lines = [*summary, *rows] if where == "below the names" else [*rows, *summary]
    line = 3 if where == "below the names" else N + 2
    with pytest.raises(ReadError, match=rf"line {line}: .* rows hold the least and the largest number"):
        result_of(tmp_path, ["force;rail", *lines], **options)
    assert result_of(tmp_path, ["force;rail", *rows], **options).errors == ()


def test_a_decay_that_begins_with_its_extremes_is_no_summary(tmp_path):
    decay = np.exp(-0.1 * np.arange(N)) * np.cos(2.5 * np.arange(N))
    result = result_of(tmp_path, ["force;rail", *rows_of(np.column_stack([decay, 2.0 * decay]))])
    assert result.errors == () and len(result.recordings) == 1


@pytest.mark.parametrize("separator", [";", "\t", "|", ","])
def test_separators_and_line_breaks_between_quotation_marks_are_part_of_a_name(separator, tmp_path):
    name = f"force{separator} hammer"
    rows = [f"{a:.4f}{separator}{b:.4f}" for a, b in FIRST]
    channels = (RawChannel("force", name, "force"), RawChannel("rail", "rail left", "acceleration"))
    lines = [f'"{name} [N]"{separator}"rail\nleft\n[m/s²]"', *rows]
    result = result_of(tmp_path, lines, RawDescription(channels, rate=RATE))
    assert result.errors == ()
    np.testing.assert_allclose(samples_of(result), [FIRST], atol=1e-12)
    with pytest.raises(ReadError, match="line 10, column 'rail left"):  # the lines of the file are counted
        result_of(tmp_path, [*lines[:7], f"1.5{separator}x", *lines[7:]], RawDescription(channels, rate=RATE))


@pytest.mark.parametrize("mark", ['5" disc', '12"', "'"])
def test_a_single_quotation_mark_quotes_nothing(mark, tmp_path):
    lines = [f"Remark;{mark};7", "force;rail", *rows_of(FIRST)]
    np.testing.assert_allclose(samples_of(result_of(tmp_path, lines)), [FIRST], atol=1e-12)


def test_a_quotation_mark_behind_a_name_quotes_nothing(tmp_path):
    """Two of them, for inches: the names are those of a line with one such mark or none."""
    channels = tuple(replace(c, source=name) for c, name in zip(CHANNELS, ("disc 12", "rail 5")))
    for names in ('disc 12";rail 5"', 'disc 12";rail 5', '"disc 12";"rail 5"'):
        result = result_of(tmp_path, [names, *rows_of(FIRST)], RawDescription(channels, rate=RATE))
        assert result.errors == ()
        np.testing.assert_allclose(samples_of(result), [FIRST], atol=1e-12)


def test_zero_bytes_are_reported_as_not_written(tmp_path):
    text = ("\n".join(["force;rail", *rows_of(FIRST)]) + "\n").encode()
    (tmp_path / "a.csv").write_bytes(text + b"\0" * 5000)
    result = read("a.csv", tmp_path, LAYOUT)
    np.testing.assert_allclose(samples_of(result), [FIRST], atol=1e-12)
    (error,) = result.errors
    assert (error.reason, error.where) == ("truncated", f"line {N + 2}") and "all bytes are 0x00" in error.problem
    for hole in (b"\0" * 512 + text[300:], b"\0" * 20 + text[320:]):
        (tmp_path / "a.csv").write_bytes(text[:300] + hole)
        with pytest.raises(ReadError, match=r"a\.csv, line \d+.*: zero bytes, to which nothing was written"):
            read("a.csv", tmp_path, LAYOUT)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-32"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", ["", "\x1a"])
def test_zero_bytes_are_reported_once_with_their_line_in_any_encoding(encoding, line_end, mark, tmp_path):
    text = line_end.join(["force;rail", *rows_of(FIRST)]) + line_end + mark
    (tmp_path / "a.csv").write_bytes(text.encode(encoding) + b"\0" * 400)
    result = read("a.csv", tmp_path, LAYOUT)
    np.testing.assert_allclose(samples_of(result), [FIRST], atol=1e-12)
    assert [(error.reason, error.where) for error in result.errors] == [("truncated", f"line {N + 2}")]
    assert "all bytes are 0x00" in result.errors[0].problem


def test_a_text_of_blanks_is_not_reported_as_appended_to_itself(tmp_path):
    (tmp_path / "a.csv").write_bytes(b" \r\n" * 400)
    with pytest.raises(ReadError) as caught:
        read("a.csv", tmp_path, LAYOUT)
    assert caught.value.reason == "empty"


@pytest.mark.parametrize("n_row", [20, N])
def test_a_last_record_that_ends_early_without_a_line_break_is_reported(n_row, tmp_path):
    lines = ["record;force;rail", *rows_of(FIRST, "1;"), *rows_of(SECOND, "2;")[:n_row]]
    for end, is_reported in (("", n_row < N), ("\n", False)):
        (tmp_path / "a.csv").write_text("\n".join(lines) + end)
        result = read("a.csv", tmp_path, LAYOUT)
        assert [len(samples) for samples in samples_of(result)] == [N, n_row]
        assert [error.where for error in result.errors] == ["record 2 of 2"] * is_reported


@pytest.mark.parametrize("unit", ["second", "Seconds", "sekunder", "secondes", "milliseconds", "µsec"])
@pytest.mark.parametrize("true_rate", [RATE, 25600.0])
def test_a_column_in_a_word_for_a_unit_of_time_is_the_time(unit, true_rate, tmp_path):
    scale = {"m": 1e3, "µ": 1e6}.get(unit[0], 1.0)
    rows = [f"{scale * k / true_rate:.9g};{row}" for k, row in enumerate(rows_of(FIRST))]
    lines = ["x-axis;force;rail", f"{unit};N;m/s²", *rows]
    result = result_of(tmp_path, lines)
    assert [error.reason for error in result.errors] == ["wrong_rate"] * (true_rate != RATE)
    assert len(result.recordings) == (true_rate == RATE)


@pytest.mark.parametrize("true_rate", [RATE, 25600.0])
def test_a_name_in_the_line_of_units_stands_for_an_empty_one_above_it(true_rate, tmp_path):
    rows = [f"{k / true_rate:.9g};{row}" for k, row in enumerate(rows_of(FIRST))]
    result = result_of(tmp_path, [";force;rail", "Time (s);N;m/s²", *rows])
    assert [error.reason for error in result.errors] == ["wrong_rate"] * (true_rate != RATE)
    assert len(result.recordings) == (true_rate == RATE)


@pytest.mark.parametrize("separators", ["\t,", ",;", " \t"])
def test_names_between_other_separators_than_the_numbers_are_read(separators, tmp_path):
    above, below = separators
    rows = [f"{a:.4f}{below}{b:.4f}" for a, b in FIRST]
    result = result_of(tmp_path, [f"force [N]{above}rail [m/s²]", *rows])
    np.testing.assert_allclose(samples_of(result), [FIRST], atol=1e-12)


@pytest.mark.parametrize("title", ["Hammer test [N]", "Kraftmessung Gleis [N]"])
def test_a_title_with_a_unit_is_no_line_of_names(title, tmp_path):
    channels = tuple(replace(channel, source=i) for i, channel in enumerate(CHANNELS))
    result = result_of(tmp_path, [title, *rows_of(FIRST)], RawDescription(channels, rate=RATE))
    assert result.errors == ()
    np.testing.assert_allclose(samples_of(result), [FIRST], atol=1e-12)


def test_a_name_in_a_line_of_another_width_is_quoted_with_its_line(tmp_path):
    with pytest.raises(ReadError, match="'force' stands in line 1"):
        result = result_of(tmp_path, ["force;rail", *[f"{row};1.5" for row in rows_of(FIRST)]])
        raise result.errors[0]


@pytest.mark.parametrize("first", [0, 1])
def test_a_count_of_the_samples_needs_no_name_in_a_long_text(first, tmp_path):
    rows = [f"{k + first};{row}" for k, row in enumerate(rows_of(FIRST))]
    for lines, is_read in ((rows, True), ([*rows[:30], *rows[31:]], False)):
        result = result_of(tmp_path, ["Sample;force;rail", *lines], **IN_FILE)
        assert len(result.long_recordings) == is_read and bool(result.errors) != is_read


@pytest.mark.parametrize("blank", ["", " ", "\t\t", ";"])
@pytest.mark.parametrize("n_above", [1, 2, 4])
def test_a_blank_line_among_the_first_rows_between_blanks_does_not_hide_those_above_it(blank, n_above, tmp_path):
    rows = [row.replace(";", "   ") for row in rows_of(FIRST)]
    with pytest.raises(ReadError, match=rf"line {n_above + 2}: .* stands before its last {N - n_above} rows"):
        result_of(tmp_path, ["force rail", *rows[:n_above], blank, *rows[n_above:]])


@pytest.mark.parametrize("true_rate", [RATE, 25600.0])
def test_a_label_of_the_line_of_names_is_not_the_name_of_the_time(true_rate, tmp_path):
    rows = [f"{1e3 * k / true_rate:.9g};{row}" for k, row in enumerate(rows_of(FIRST))]
    result = result_of(tmp_path, ["Channel;force;rail", "t [ms];N;m/s²", *rows])
    assert [error.reason for error in result.errors] == ["wrong_rate"] * (true_rate != RATE)
    assert len(result.recordings) == (true_rate == RATE)
