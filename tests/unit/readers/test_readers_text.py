"""Numbers as programs print them: decimal commas, rounded steps, units of time, superfluous separators."""

import re
from dataclasses import replace
from datetime import datetime, timedelta

import nptdms
import numpy as np
import pytest

from turnout.errors import ReadError
from turnout.readers import FORMATS, read, read_unconverted
from turnout.records import RawChannel, RawDescription

RATES = (44100, 65536, 48000, 30000, 16384, 12000, 51200, 20000)
X = np.random.default_rng(0).normal(size=(50, 2))
NAMED = RawDescription(
    (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "acc", "acceleration", unit="m/s²"))
)


def with_comma(value):
    return f"{value:.4f}".replace(".", ",")


def checked_recording(root, name, text, description=NAMED, rate=20000.0):
    """The only recording of a text file, after a check of its numbers and rate."""
    (root / name).write_text(text, encoding="utf-8")
    result = read(name, root, description)
    assert result.errors == ()
    (recording,) = result.recordings
    np.testing.assert_allclose(recording.samples, X.T.round(4), atol=1e-12)
    assert recording.rate == rate
    return recording


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("end", ["", ";"])
def test_a_decimal_comma_is_not_read_as_a_separator(separator, end, tmp_path):
    """Every line has more decimal commas than separators."""
    end = separator if end else ""
    rows = "".join(f"{with_comma(a)}{separator}{with_comma(b)}{end}\n" for a, b in X)
    head = f"# rate: 20000,0\nforce{separator}acc{end}\n"
    checked_recording(tmp_path, "a.csv", head + rows)
    checked_recording(tmp_path, "a.csv", head + rows, replace(NAMED, rate=20000.0))


def test_a_decimal_comma_after_many_zeros_is_identified(tmp_path):
    silence = "0;0\n" * 2000
    rows = "".join(f"{with_comma(a)};{with_comma(b)}\n" for a, b in X)
    (tmp_path / "a.csv").write_text("rate: 20000\nforce;acc\n" + silence + rows)
    (recording,) = read("a.csv", tmp_path, NAMED).recordings
    np.testing.assert_allclose(recording.samples[:, 2000:], X.T.round(4), atol=1e-12)


@pytest.mark.parametrize(
    "head",
    ["rate: 12.8 kHz", "fs: 12,8 kHz", "rate: 12800 Hz", "dt: 78.125 µs", "rate; 12800", "Sampling rate [kHz];12,8"],
)
def test_a_rate_is_read_with_its_unit(head, tmp_path):
    checked_recording(
        tmp_path, "a.csv", f"{head}\nforce;acc\n" + "".join(f"{a:.4f};{b:.4f}\n" for a, b in X), rate=12800.0
    )


@pytest.mark.parametrize(
    "head",
    ["rail_temperature: -2.5", "# rail_temperature: -2.5 °C", "rail_temperature [°C];-2,5", "Rail temperature;-2,5"],
)
def test_the_rail_temperature_in_a_header_is_a_condition_of_the_recording(head, tmp_path):
    recording = checked_recording(tmp_path, "a.csv", f"rate: 12800\n{head}\nforce;acc\n{ROWS}", rate=12800.0)
    assert recording.conditions["rail_temperature"] == -2.5


def test_a_column_with_the_name_of_a_temperature_is_read_as_a_channel(tmp_path):
    (tmp_path / "a.csv").write_text(f"rate: 12800\nrail_temperature;acc\n{ROWS}")
    warm = RawDescription((RawChannel("force", "rail_temperature", "force", unit="N"), NAMED.channels[1]))
    (recording,) = read("a.csv", tmp_path, warm).recordings
    assert "rail_temperature" not in recording.conditions and recording.samples.shape == X.T.shape


WORDS = ("Abtastrate", "Abtastfrequenz", "Fréquence d'échantillonnage", "Frecuencia de muestreo",
         "Frequenza di campionamento", "Samplingsfrekvens", "# Taux d’échantillonnage")  # fmt: skip
ROWS = "".join(f"{a:.4f};{b:.4f}\n" for a, b in X)


@pytest.mark.parametrize("word", WORDS)
def test_a_rate_in_another_language_is_read_and_compared_with_the_layout(word, tmp_path):
    text = f"{word}: 10000 Hz\nforce;acc\n{ROWS}"
    checked_recording(tmp_path, "a.csv", text, rate=10000.0)
    (error,) = read("a.csv", tmp_path, replace(NAMED, rate=20000.0)).errors
    assert error.reason == "wrong_rate" and "10000 Hz instead of 20000 Hz" in error.problem


STARTS = {
    "Startzeit: 13.05.2024 08:30:12,250": "08:30:12.250000",
    "Startzeit;13.05.2024;08:30:12,250": "08:30:12.250000",
    "Startdatum;13.05.2024\nStartzeit;08:30:12,25": "08:30:12.250000",
    "Startzeit;08:30:12.25;\nStartdatum;2024-05-13;": "08:30:12.250000",
    "# Messbeginn = 13.5.2024 8:30": "08:30:00",
    "Début de mesure: 13.05.2024 08:30:12": "08:30:12",
    "Starttijd: 2024-05-13 08:30:12": "08:30:12",
    "Začátek měření;13.05.2024 08:30:12": "08:30:12",
    "Starttidspunkt;13.05.2024 08:30:12": "08:30:12",
    "started_at: 13.05.2024 08:30:12": "08:30:12",
}


@pytest.mark.parametrize("head", STARTS)
def test_the_start_in_the_header_is_read_in_several_languages_and_date_formats(head, tmp_path):
    recording = checked_recording(tmp_path, "a.csv", f"rate: 20000\n{head}\nforce;acc\n{ROWS}")
    assert recording.started_at.isoformat() == f"2024-05-13T{STARTS[head]}"


@pytest.mark.parametrize("stamp", ["04/05/2024 08:30", "31.02.2024 08:30", "13.05.2024", "08:30:12"])
def test_an_ambiguous_or_incomplete_start_is_not_used_and_is_reported(stamp, tmp_path):
    """04/05 may be 4 May or 5 April; a date without time, or a time without date, is incomplete."""
    (tmp_path / "a.csv").write_text(f"rate: 20000\nStartzeit;{stamp}\nforce;acc\n{ROWS}")
    result = read("a.csv", tmp_path, NAMED)
    assert result.recordings[0].started_at is None
    (error,) = result.errors
    fault = "has no time of day" if stamp == "13.05.2024" else "cannot be read"
    assert error.reason == "start_unknown" and error.problem == f"the start time {stamp!r} {fault}"


@pytest.mark.parametrize("head", ["Startzeit;{} 10:00:00\nforce;acc\n", "force;acc;Uhr\n"])
@pytest.mark.parametrize("date", ["05/13/2024", "04/05/2024", "4-5-2024", "13.05.24", "13/05/24"])
def test_the_remedy_for_an_ambiguous_date_is_another_order(date, head, tmp_path):
    """Formerly, the message named the clock of the logger. A date with only one possible order is read."""
    rows = ROWS if "{}" in head else ROWS.replace("\n", f";{date} 10:00:00\n")
    (tmp_path / "a.csv").write_text(f"rate: 20000\n{head.format(date)}{rows}")
    result = read("a.csv", tmp_path, NAMED)
    if date == "05/13/2024":
        assert result.recordings[0].started_at.isoformat() == "2024-05-13T10:00:00"
        return
    (error,) = result.errors
    assert error.reason == "start_unknown" and "YYYY-MM-DD" in error.remedy and "clock" not in error.remedy


@pytest.mark.parametrize("stamp", ["31.02.2024 10:00", "2024-13-05 10:00:00"])
def test_the_remedy_for_a_date_that_does_not_exist_concerns_the_clock(stamp, tmp_path):
    (tmp_path / "a.csv").write_text(f"rate: 20000\nstart: {stamp}\nforce;acc\n{ROWS}")
    (error,) = read("a.csv", tmp_path, NAMED).errors
    assert error.reason == "start_unknown" and "clock" in error.remedy


COUNTS = ("Anzahl Messwerte", "# Anzahl Werte", "Number of samples", "Nombre d'échantillons", "Aantal samples",
          "Počet vzorků", "Antal målepunkter")  # fmt: skip


@pytest.mark.parametrize("word", COUNTS)
def test_a_table_with_fewer_samples_than_its_header_states_is_reported_as_truncated(word, tmp_path):
    text = f"rate: 20000\n{word};{{}}\nforce;acc\n{ROWS}"
    for accepted in ("50", "50 Werte", "49", "0"):
        checked_recording(tmp_path, "a.csv", text.format(accepted))
    for stated, number in (("60", 60), ("1.200", 1200), ("60 000", 60000)):
        (tmp_path / "a.csv").write_text(text.format(stated))
        (error,) = read("a.csv", tmp_path, NAMED).errors
        assert error.reason == "truncated"
        assert error.problem == f"has 50 of the {number} samples that its header states"


def test_a_record_longer_than_its_header_states_is_not_reported_as_truncated(tmp_path):
    (tmp_path / "a.csv").write_text(f"rate: 20000\nn_samples: 4\nforce;acc\n{ROWS}")
    (error,) = read("a.csv", tmp_path, NAMED).errors
    assert error.reason == "wrong_length" and error.problem == "has 50 samples, and its header states 4"


def test_the_error_of_decimal_commas_between_commas_states_the_cause(tmp_path):
    rows = "".join(f"{a:.4f},{b:.4f}\n" for a, b in X)
    (tmp_path / "a.csv").write_text("rate: 20000\nforce,acc\n1,1\n" + rows.replace(".", ","))
    with pytest.raises(ReadError, match="4 cells instead of 2") as caught:
        read("a.csv", tmp_path, NAMED)
    assert "where the decimal mark is a comma, export with semicolons or tabs between columns" in str(caught.value)


def test_the_error_of_decimal_commas_in_all_numbers_between_commas_states_the_cause(tmp_path):
    rows = "".join(f"{k / 20000:.5f},{a:.4f},{b:.4f}\n".replace(".", ",") for k, (a, b) in enumerate(X))
    (tmp_path / "a.csv").write_text("time [s],force [N],acc [m/s²]\n" + rows, encoding="utf-8")
    with pytest.raises(
        ReadError, match="line 2: the rows have 6 cells and 3 names stand above them: commas are"
    ) as caught:
        read("a.csv", tmp_path, NAMED)
    assert "semicolons or tabs" in caught.value.remedy


def test_a_count_of_all_rows_is_not_compared_with_the_single_records(tmp_path):
    rows = "".join(f"{1 + k // 20};{a:.4f};{b:.4f}\n" for k, (a, b) in enumerate(X))
    (tmp_path / "a.csv").write_text(f"rate: 20000\nAnzahl Messwerte: 50\nrecord;force;acc\n{rows}")
    result = read("a.csv", tmp_path, NAMED)
    assert result.errors == () and [r.n_sample for r in result.recordings] == [20, 20, 10]


def test_a_column_with_the_name_of_a_count_is_read_as_a_channel(tmp_path):
    (tmp_path / "a.csv").write_text(f"rate: 12800\nMesswerte;acc\n{ROWS}")
    called = RawDescription((RawChannel("force", "Messwerte", "force", unit="N"), NAMED.channels[1]))
    assert read("a.csv", tmp_path, called).recordings[0].samples.shape == X.T.shape


@pytest.mark.parametrize("line", ["# taktning [Hz];10000", "Mintavétel 10000 Hz"])
def test_a_frequency_in_unknown_words_that_differs_from_the_layout_is_reported(line, tmp_path):
    text = f"{line}\nforce;acc\n{ROWS}"
    checked_recording(tmp_path, "a.csv", text, replace(NAMED, rate=10000.0), rate=10000.0)
    (error,) = read("a.csv", tmp_path, replace(NAMED, rate=20000.0)).errors
    assert error.reason == "wrong_rate" and "10" in error.problem and "20000 Hz" in error.problem
    assert line.split()[-2].strip("#")[:8].rstrip(":") in error.problem and "in line 1" in error.problem
    (tmp_path / "b.csv").write_text(f"rate: 20000\n{text}", encoding="utf-8")
    result = read("b.csv", tmp_path, replace(NAMED, rate=20000.0))
    (error,) = result.errors
    assert result.recordings[0].rate == 20000.0 and error.reason == "entry_unknown"
    assert line.split()[-2].strip("#")[:8].rstrip(":") in error.problem and "sampling rate" in error.problem


@pytest.mark.parametrize("line", ["Tiefpass: 8000 Hz", "Filter 10 kHz", "sensor: 0.5-10000 Hz", "Bandbreite: 8 kHz"])
def test_the_frequency_of_a_filter_is_not_read_as_the_rate(line, tmp_path):
    checked_recording(tmp_path, "a.csv", f"{line}\nforce;acc\n{ROWS}", replace(NAMED, rate=20000.0))


@pytest.mark.parametrize("names", ["force;acc\n", "force;acc;\n", ""])
def test_a_separator_after_the_last_number_is_not_read_as_a_channel(names, tmp_path):
    by_index = tuple(replace(c, source=i) for i, c in enumerate(NAMED.channels))
    rows = "".join(f"{a:.4f};{b:.4f};\n" for a, b in X)
    checked_recording(
        tmp_path, "a.csv", "rate: 20000\n" + names + rows, NAMED if names else replace(NAMED, channels=by_index)
    )


def test_an_unnamed_column_with_numbers_is_a_channel_unknown_to_the_layout(tmp_path):
    rows = "".join(f"{a:.4f};{b:.4f};{7 if k == 30 else ''}\n" for k, (a, b) in enumerate(X))
    (tmp_path / "a.csv").write_text("rate: 20000\nforce;acc;\n" + rows)
    (error,) = read("a.csv", tmp_path, NAMED).errors
    assert error.reason == "channel_unknown"


HEADS = {
    "as many cells above": "Messung;Gleis 3;Weiche 12\nZeit;force;acc\n",
    "more cells above": "Ort;Bf. Nord;Gleis 3;Weiche 12\nZeit [s];force [N];acc [m/s²]\n",
    "a row of units": "Messung;Gleis 3;Weiche 12\nPrüfer;M. Jensen;\nZeit;force;acc\ns;N;m/s²\n",
    "units in brackets of their own": "Messung;Gleis 3;Weiche 12\nZeit;force;acc\n(s);[N];(m/s^2)\n",
    "a comment below the units": "Messung;Gleis 3;Weiche 12\nZeit;force;acc\ns;N;m/s²\nUhr;Hammer;Schwelle 3\n",
    "a comment below the names": "Messung;Gleis 3;Weiche 12\nZeit [s];force [N];acc [m/s²]\nUhr;Hammer;Schwelle 3\n",
    "an empty row between": "Messung;Gleis 3;Weiche 12\n;;\nZeit;force;acc\n;;\ns;N;m/s²\n",
    "empty units and a comment": "Zeit;force;acc\n;;\nUhr;Hammer;Schwelle 3\n",
    "the time of day above": "Datum;13.05.2024;\nZeit;08:30:12;\nt_rel [s];force;acc\n",
    "a unit above": "Einheit;N;m/s²\nMessung;Gleis 3;Weiche 12\nZeit;force;acc\ns;N;m/s²\n",
    "a length above": "Messung;Gleis 3;\nLage;12 m;\nZeit;force;acc\n",
    "a unit that says nothing": "Messung;Gleis 3;Weiche 12\nZeit;force;acc\ns;EU;EU\n",
}


@pytest.mark.parametrize("head", HEADS)
def test_the_names_are_read_from_the_line_above_the_numbers_and_their_units(head, tmp_path):
    """Lines further up may have as many cells as there are columns."""
    rows = "".join(f"{k / 20000:.9g};{a:.4f};{b:.4f}\n" for k, (a, b) in enumerate(X))
    checked_recording(tmp_path, "a.csv", HEADS[head] + rows)


def test_an_unknown_unit_in_a_row_of_units_is_an_error(tmp_path):
    by_index = replace(NAMED, channels=tuple(replace(c, source=i) for i, c in enumerate(NAMED.channels)))
    (tmp_path / "a.csv").write_text(f"rate: 20000\nforce;acc\nN;furlong\n{ROWS}")
    (error,) = read("a.csv", tmp_path, by_index).errors
    assert error.reason == "unit_unknown" and "furlong" in error.problem


@pytest.mark.parametrize(
    ("unit", "second"),
    [
        ("s", 1.0),
        ("ms", 1e3),
        ("µs", 1e6),
        ("\u03bcs", 1e6),
        ("us", 1e6),
        ("Sekunden", 1.0),
        ("msec", 1e3),
        ("min", 1 / 60),
        ("h", 1 / 3600),
        ("hours", 1 / 3600),
        ("d", 1 / 86400),
    ],
)
def test_a_time_column_in_its_unit_gives_the_rate(unit, second, tmp_path):
    rows = "".join(f"{second * k / 20000:.9g};{a:.4f};{b:.4f}\n" for k, (a, b) in enumerate(X))
    checked_recording(tmp_path, "a.csv", f"time [{unit}];force;acc\n" + rows)
    checked_recording(tmp_path, "a.csv", f"t;force;acc\n({unit});(N);(m/s²)\n" + rows, replace(NAMED, rate=20000.0))


@pytest.mark.parametrize("title", ["Zeit", "Zeit [s]", "Tid (s)", "temps", "idő [s]"])
def test_a_time_column_in_another_language_is_compared_with_the_rate_of_the_layout(title, tmp_path):
    """Without the comparison, a record of half the rate would pass with doubled frequencies."""
    rows = "".join(f"{k / 10000:.9g};{a:.4f};{b:.4f}\n" for k, (a, b) in enumerate(X))
    checked_recording(tmp_path, "a.csv", f"{title};force;acc\n" + rows, rate=10000.0)
    name = title.split(" ")[0]
    ignored = replace(NAMED, rate=20000.0, channels=(*NAMED.channels, RawChannel("time", name, "ignored")))
    for description in (ignored, replace(NAMED, rate=20000.0)):
        (error,) = read("a.csv", tmp_path, description).errors
        assert error.reason == "wrong_rate" and "10000" in error.problem


@pytest.mark.parametrize(
    ("row", "what", "remedy"),
    [
        ("08:00:00:05;1,0;2,0", "with the time of a clock", "Export the time in seconds from the start of the record"),
        (
            "1.0/2.0",
            "",
            "Export numbers as '-12.5' between semicolons, tabs, commas or blanks, the time in seconds",
        ),
    ],
)
def test_the_error_of_a_table_without_a_line_of_numbers_quotes_the_last_line(row, what, remedy, tmp_path):
    """The copy is complete, so the remedy is not another copy."""
    (tmp_path / "a.csv").write_text("force;acc\n" + f"{row}\n" * 50)
    with pytest.raises(ReadError) as caught:
        read("a.csv", tmp_path, NAMED)
    problem = f"no line of numbers; the last line reads '{row}'{what and ', '}{what}"
    assert str(caught.value) == f"a.csv, the file: {problem}. {remedy}."


COMMAS = "".join(f"{with_comma(a)};{with_comma(b)}\n" for a, b in X)


@pytest.mark.parametrize("cell", ["1.234,56", "-1 234,5", "1'234,5", "12\u00a0345,5", "1.234.567"])
@pytest.mark.parametrize("above", [COMMAS, ""])
def test_the_error_of_a_separator_of_thousands_states_line_and_column(cell, above, tmp_path):
    """Also in the first row, which is no line of names. The copy is complete."""
    (tmp_path / "a.csv").write_text(f"rate: 20000\nforce;acc\n{above}0,5;{cell}\n{COMMAS}", encoding="utf-8")
    with pytest.raises(ReadError) as caught:
        read("a.csv", tmp_path, NAMED)
    line = 3 + 50 * bool(above)
    assert str(caught.value) == (
        f"a.csv, line {line}, column 'acc': {cell!r} has marks for thousands, or another decimal mark than other "
        "numbers. Export all numbers with one decimal mark and without marks for thousands."
    )


@pytest.mark.parametrize("cell", ["#NV", "#N/A", "NaN", "#DIV/0!", ""])
@pytest.mark.parametrize("where", [0, 30])
def test_missing_values_are_reported_with_their_place_and_only_their_channel_is_lost(cell, where, tmp_path):
    rows = COMMAS.splitlines()
    rows[where] = rows[where].split(";")[0] + f";{cell}"
    (tmp_path / "a.csv").write_text("force;acc\n" + "\n".join(rows) + "\n")
    result = read("a.csv", tmp_path, replace(NAMED, kind="passage", rate=20000.0))
    (error,) = result.errors
    assert error.reason == "not_finite" and error.where == "record 1 of 1, channel 'rail'"
    assert error.problem == f"1 of 50 samples are missing or not finite, the first is sample {where}"
    assert error.remedy.startswith("Export the record again from the logger; if it is so there too, check")
    np.testing.assert_allclose(result.recordings[0].samples, X.T[:1].round(4), atol=1e-12)


def test_the_error_of_a_word_among_the_numbers_states_line_and_column(tmp_path):
    (tmp_path / "a.csv").write_text(f"rate: 20000\nforce;acc\n{COMMAS}overload;0,5\n")
    with pytest.raises(ReadError) as caught:
        read("a.csv", tmp_path, NAMED)
    assert str(caught.value) == (
        "a.csv, line 53, column 'force': 'overload' is no number. Copy the file again from the logger; if the logger's "
        "own file has it too, delete the lines that are no samples or leave that record out."
    )


SHEETS = {
    "xlsx": b"PK\x03\x04\x14\x00\x06\x00\x08\x00" + bytes(16) + b"\x13\x00\x00\x00[Content_Types].xml" + bytes(500),
    "ods": b"PK\x03\x04\x14" + bytes(21) + b"\x08\x00\x00\x00mimetypeapplication/vnd.oasis.opendocument.spreadsheet",
    "xls": b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(504) + b"\n",
}


@pytest.mark.parametrize("kind", SHEETS)
@pytest.mark.parametrize(("name", "format"), [("a.csv", "auto"), ("a.csv", "csv"), ("a.xlsx", "auto")])
def test_a_spreadsheet_file_is_identified_under_any_file_name(kind, name, format, tmp_path):
    (tmp_path / name).write_bytes(SHEETS[kind])
    with pytest.raises(ReadError) as caught:
        read(name, tmp_path, replace(NAMED, format=format))
    message = "it is a spreadsheet's own file. Save it from the spreadsheet as CSV, text with separated columns"
    assert str(caught.value) == f"{name}, byte 0: {message}." and caught.value.reason == "unreadable"


def test_a_time_column_in_another_unit_is_rejected(tmp_path):
    rows = "".join(f"{k / 72e6:.12g};{a:.4f};{b:.4f}\n" for k, (a, b) in enumerate(X))
    (tmp_path / "a.csv").write_text("time [weeks];force;acc\n" + rows)
    with pytest.raises(ReadError) as caught:
        read("a.csv", tmp_path, NAMED)
    expected = (
        "a.csv, the time column: its unit 'weeks' is not known. Export the time in s, ms, µs, ns, min, h or d, or"
    )
    assert str(caught.value) == f"{expected} as the time of day with seconds."
    assert caught.value.reason == "unit_unknown"


MONDAY_NOON = datetime(2026, 10, 26, 12)


def clock_rows(stamp, n=50, step=timedelta(microseconds=50), start=MONDAY_NOON):
    """A text of n samples with the time of day, or a date and a time of day, of each."""
    rows = "".join(f"{stamp(start + k * step, k)};{a:.4f};{b:.4f}\n" for k, (a, b) in enumerate(X[:n]))
    return "time;force;acc\n" + rows


@pytest.mark.parametrize(
    "stamp",
    [
        lambda time, k: f"{time:%H:%M:%S.%f}",
        lambda time, k: f"{time:%M:%S.%f}",
        lambda time, k: f"0 days {time:%H:%M:%S.%f}",
        lambda time, k: f"{time.isoformat(timespec='microseconds')}+02:00",
        lambda time, k: f"{time:%d/%m/%Y %I:%M:%S.%f %p}",
        # summer time ends between two samples
        lambda time, k: (
            time.isoformat(timespec="microseconds") + "+02:00"
            if k < 20
            else (time - timedelta(hours=1)).isoformat(timespec="microseconds") + "+01:00"
        ),
    ],
)
@pytest.mark.parametrize("start", [MONDAY_NOON, MONDAY_NOON - timedelta(microseconds=1500)])
def test_a_time_of_day_gives_the_rate(stamp, start, tmp_path):
    checked_recording(tmp_path, "a.csv", clock_rows(stamp, start=start))


@pytest.mark.parametrize("start", [datetime(2026, 5, 4, 23, 59, 59, 999000), datetime(2026, 5, 31, 23, 59, 59, 999000)])
@pytest.mark.parametrize("date", ["%Y-%m-%d", "%d.%m.%Y", "%m/%d/%Y", "%d/%m/%Y", "%d.%m.%y"])
@pytest.mark.parametrize("separator", [" ", ";"])
def test_midnight_is_accepted_and_a_jump_of_days_is_an_error(start, date, separator, tmp_path):
    """The date may have any order and may have a cell of its own."""
    head = "date;time" if separator == ";" else "time"
    text = clock_rows(lambda time, k: f"{time:{date}}{separator}{time:%H:%M:%S.%f}", start=start)
    (tmp_path / "a.csv").write_text(text.replace("time", head, 1))
    (recording,) = read("a.csv", tmp_path, NAMED).recordings
    assert recording.rate == 20000.0 and recording.n_sample == 50
    for days in (2, -1):
        late = timedelta(days=days)
        text = clock_rows(lambda time, k: f"{time + (k > 30) * late:{date}}{separator}{time:%H:%M:%S.%f}")  # noqa: B023
        (tmp_path / "b.csv").write_text(text.replace("time", head, 1))
        result = read("b.csv", tmp_path, NAMED)
        error = result.errors[0]
        assert not result.recordings
        assert re.search("time jumps from 0.0015 s|clock runs backwards", error.problem)


@pytest.mark.parametrize("stamp", ["10:61:00.5", "24:00:00+01:00", "13:00:00 PM", "10:00:61.5"])
def test_an_impossible_time_of_day_is_an_error(stamp, tmp_path):
    (tmp_path / "a.csv").write_text(clock_rows(lambda time, k: f"{time:%H:%M:%S.%f}" if k != 9 else stamp))
    with pytest.raises(ReadError, match=f"sample 9 is '{re.escape(stamp)}'"):
        read("a.csv", tmp_path, NAMED)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("stated", [True, False])
def test_a_step_printed_with_seven_digits_gives_the_whole_number_of_the_rate(rate, stated, tmp_path):
    """The relative error of the step is up to 5e-7: 44100 Hz is printed as 44099.9957 Hz."""
    layout = replace(NAMED, rate=float(rate)) if stated else NAMED
    rows = "".join(f"{a:.4f};{b:.4f}\n" for a, b in X)
    checked_recording(tmp_path, "a.csv", f"dt = {1 / rate:.6E}\nforce;acc\n" + rows, layout, rate)
    checked_recording(tmp_path, "a.lvm", lvm(f"{1 / rate:.6E}"), layout, rate)
    np.savez(tmp_path / "a.npz", force=X[:, 0], acc=X[:, 1], dt=np.float32(1 / rate))
    assert read("a.npz", tmp_path, layout).recordings[0].rate == rate
    np.savez(tmp_path / "b.npz", force=X[:, 0], acc=X[:, 1], fs=np.float32(rate))
    assert read("b.npz", tmp_path, layout).recordings[0].rate == rate


def lvm(step):
    columns = [("Channels", 2), ("Samples", 50, 50), ("Y_Unit_Label", "N", "m/s^2"), ("Delta_X", step, step)]
    head = "".join("\t".join(map(str, row)) + "\n" for row in columns)
    rows = "".join(f"\t{a:.4f}\t{b:.4f}\n" for a, b in X)
    first = "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\t\n\t\n"
    return f"{first}{head}***End_of_Header***\t\t\nX_Value\tforce\tacc\tComment\n{rows}"


@pytest.mark.parametrize("step", ["5E-05", "5.000000E-05", "0.00005"])
def test_a_round_step_is_not_read_as_a_rounded_step_of_another_rate(step, tmp_path):
    rows = "".join(f"{a:.4f};{b:.4f}\n" for a, b in X)
    (tmp_path / "a.csv").write_text(f"dt = {step}\nforce;acc\n" + rows)
    for rate, errors in ((20000.0, 0), (20001.0, 1), (17000.0, 1)):
        assert len(read("a.csv", tmp_path, replace(NAMED, rate=rate)).errors) == errors


def test_tdms_of_several_writes_counts_the_samples_of_the_last_one(tmp_path):
    """LabVIEW writes a waveform per loop; its properties are those of the last waveform.

    Steps of one rate may differ by rounding and may be in single precision.
    """
    steps = {"force": float(np.float32(1 / 44100)), "acc": 1 / 44100}
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        for part in np.split(X, 5):
            writer.write_segment(
                [
                    nptdms.ChannelObject("test", name, x, properties={"wf_increment": steps[name], "wf_samples": 10})
                    for name, x in zip(("force", "acc"), part.T)
                ]
            )
    result = read("a.tdms", tmp_path, replace(NAMED, rate=44100.0))
    assert result.errors == ()
    np.testing.assert_array_equal(result.recordings[0].samples, X.T)
    (error,) = read("a.tdms", tmp_path, replace(NAMED, rate=44101.0)).errors
    assert error.reason == "wrong_rate"


def test_an_unexpected_exception_of_a_reader_is_an_error_with_the_name_of_the_file(tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text("force;acc\n1.5;2.5\n")
    monkeypatch.setattr(type(FORMATS["csv"]), "read_raw", lambda *_: [][3])
    with pytest.raises(ReadError) as caught:
        read("a.csv", tmp_path, NAMED)
    assert caught.value.path == "a.csv" and "IndexError: list index out of range" in str(caught.value)
    monkeypatch.setattr(type(FORMATS["csv"]), "read_raw", lambda *_: open("/nowhere/at/all"))
    with pytest.raises(FileNotFoundError):
        read("a.csv", tmp_path, NAMED)


def test_the_order_of_the_records_determines_times_in_the_repeated_hour_in_autumn(tmp_path):
    """Summer time ends in Copenhagen on 2024-10-27 at 01:00 UTC: 02:05 after 02:55 is ten minutes later."""
    local_times = ("02:30", "02:55", "02:05", "02:20", "03:10")
    rail = RawDescription((NAMED.channels[1],), kind="passage", rate=20000.0, time_zone="Europe/Copenhagen")
    stamps = np.array([f"2024-10-27T{clock}:00" for clock in local_times])
    numbered = {f"record_{k:03d}": X[:, 1:].T for k in range(5)}
    np.savez(tmp_path / "a.npz", channels=["acc"], started_at=stamps, **numbered)
    result = read("a.npz", tmp_path, rail)
    assert result.errors == ()
    expected = ["00:30", "00:55", "01:05", "01:20", "02:10"]
    assert [f"{r.started_at:%H:%M}" for r in result.recordings] == expected
    stamps[3] = "2024-10-27T01:20:00"  # this hour came once
    np.savez(tmp_path / "b.npz", channels=["acc"], started_at=stamps, **numbered)
    (error,) = read("b.npz", tmp_path, rail).errors
    assert (error.reason, error.where) == ("clock_backwards", "record 4")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_text_in_the_encodings_of_loggers_and_spreadsheets_is_read(encoding, end, tmp_path):
    """The character ² is one byte in cp1252 and two bytes in UTF-8."""
    channels = (RawChannel("force", "force", "force"), RawChannel("rail", "acc", "acceleration"))
    rows = "".join(f"{a:.4f};{b:.4f}{end}" for a, b in X)
    text = f"rate: 20000{end}force [N];acc [m/s²]{end}" + rows
    (tmp_path / "a.csv").write_bytes(text.encode(encoding))
    result = read("a.csv", tmp_path, RawDescription(channels))
    assert result.errors == ()
    np.testing.assert_allclose(result.recordings[0].samples, X.T.round(4), atol=1e-12)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-32"])
@pytest.mark.parametrize("n_lost", [1, 2, 3, 5])
def test_a_cut_text_loses_its_last_row_in_any_encoding(encoding, n_lost, tmp_path):
    rows = "".join(f"{a:.4f},{b:.4f}\n" for a, b in X) + "0.1234,0.5678\n"
    size = {"utf-8": 1, "utf-16": 2, "utf-32": 4}[encoding]
    content = f"force,acc\n{rows}".encode(encoding)
    (tmp_path / "a.csv").write_bytes(content[: -size * 2 - n_lost])
    result = read("a.csv", tmp_path, replace(NAMED, rate=20000.0))
    np.testing.assert_allclose(result.recordings[0].samples, X.T.round(4), atol=1e-12)
    assert [error.reason for error in result.errors] == ["truncated"]
    assert result.errors[0].where == f"line {len(X) + 2}"
    (tmp_path / "b.csv").write_bytes("force,acc\n1,2\n".encode(encoding)[: -size - 1])
    with pytest.raises(ReadError, match=r"b\.csv, line 1: no line of numbers follows"):
        read("b.csv", tmp_path, replace(NAMED, rate=20000.0))


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_rows_after_an_empty_line_are_an_error(end, tmp_path):
    rows = [f"{x:.4f};{y:.4f}" for x, y in X]
    texts = {
        "summary": [*rows, "", "-9.1000;9.3000"],
        "second block": [*rows, "", *rows],
        "in the middle": [*rows[:20], "", *rows[20:]],
    }
    for label, lines in texts.items():
        (tmp_path / "a.csv").write_bytes(end.join(["rate: 20000", "force;acc", *lines, ""]).encode())
        with pytest.raises(ReadError, match="an empty line stands before its last") as caught:
            read("a.csv", tmp_path, NAMED)
        assert caught.value.reason == "wrong_length", label
    for lines in ([*rows, "", ""], ["", *rows], [line for row in rows for line in (row, "")]):
        (tmp_path / "a.csv").write_bytes(end.join(["rate: 20000", "force;acc", *lines, ""]).encode())
        assert read("a.csv", tmp_path, NAMED).recordings[0].n_sample == len(rows)


def test_the_error_of_a_footer_with_another_number_of_cells_states_its_line(tmp_path):
    (tmp_path / "a.csv").write_text(f"rate: 20000\nforce;acc\n{COMMAS}Mean\n0,5;0,4\n")
    with pytest.raises(ReadError) as caught:
        read("a.csv", tmp_path, NAMED)
    assert caught.value.where == "line 53" and "'Mean'" in caught.value.problem
    assert "delete the lines that are no samples" in caught.value.remedy


@pytest.mark.parametrize("end", ["\r", "\r\n", "\n"])
@pytest.mark.parametrize("separator", [";", "\t", ","])
def test_a_file_of_any_length_is_read_with_any_line_ends(end, separator, tmp_path):
    """The 3,000 rows have more separators than a line may have columns."""
    rows = [f"{a:.4f}{separator}{b:.4f}" for a, b in np.tile(X, (60, 1))]
    path = tmp_path / "a.csv"
    path.write_bytes(end.join(["rate: 20000", f"force{separator}acc", *rows, ""]).encode())
    result = read(path.name, tmp_path, NAMED)
    assert result.errors == ()
    (recording,) = result.recordings
    np.testing.assert_allclose(recording.samples, np.tile(X, (60, 1)).T.round(4), atol=1e-12)


def test_names_without_cells_are_an_error_except_for_a_comment(tmp_path):
    """If the counter were missing in the rows, every channel would be shifted by one."""
    numbers = np.random.default_rng(1).normal(size=(40, 3))
    rows = "".join(f"{a:.4f};{b:.4f};{c:.4f}\n" for a, b, c in numbers)
    channels = (*NAMED.channels, RawChannel("nr", "nr", "ignored"), RawChannel("air", "air", "ignored"))
    description = RawDescription(channels, rate=20000.0)
    names = [channel.source for channel in NAMED.channels]
    (tmp_path / "a.csv").write_text(f"nr;{names[0]};{names[1]};air\n{rows}")
    with pytest.raises(ReadError, match="line 2: 4 columns have a name and the rows have 3 cells"):
        read("a.csv", tmp_path, description)
    (tmp_path / "a.csv").write_text(f"nr;{names[0]};{names[1]};Comment\n{rows}")
    assert read("a.csv", tmp_path, description).recordings[0].n_sample == 40


BRACKETS_OF_NAMES = ["Y[0];Y[1]", "ai (1);ai (2)", "acc [x];acc [y]", "rail (left);rail (right)", "Y[ch0];Y[ch1]"]


@pytest.mark.parametrize("names", BRACKETS_OF_NAMES)
def test_brackets_that_distinguish_columns_are_not_read_as_units(names, tmp_path):
    """Formerly, both columns had the name Y, and a layout could select neither of them."""
    first, second = names.split(";")
    (tmp_path / "a.csv").write_text(f"rate: 20000\n{names}\n{ROWS}")
    channels = tuple(replace(c, source=n) for c, n in zip(NAMED.channels, (first, second)))
    (recording,) = read("a.csv", tmp_path, replace(NAMED, channels=channels)).recordings
    np.testing.assert_allclose(recording.samples, X.T.round(4), atol=1e-12)
    (tmp_path / "a.csv").write_text(f"rate: 20000\nforce [1];acc [1]\n{ROWS}")
    assert read("a.csv", tmp_path, NAMED).errors == ()


@pytest.mark.parametrize(
    "names", ["Y [N];Y [g]", "a [mm/s² rms];a [m/s² peak]", "a [furlong];a [furlong]", "a [furlong];a"]
)
def test_units_in_brackets_after_equal_names_are_read_as_units(names, tmp_path):
    (tmp_path / "a.csv").write_text(f"rate: 20000\n{names}\n{ROWS}")
    channels = tuple(replace(c, source=i) for i, c in enumerate(NAMED.channels))
    result = read("a.csv", tmp_path, replace(NAMED, channels=channels))
    assert [error.reason for error in result.errors] == ["unit_unknown"]


TEMPERATURES = ["T [°C]", "t (K)", "T [Nm]", "Time [kN]"]


@pytest.mark.parametrize("name", TEMPERATURES)
@pytest.mark.parametrize("time", ["t [s]", "Zeit [s]", "time", "idő [s]"])
def test_a_column_whose_unit_is_no_unit_of_time_is_not_read_as_a_time_axis(name, time, tmp_path):
    rows = "".join(f"21.5;{k / 20000:.8g};{a:.4f};{b:.4f}\n" for k, (a, b) in enumerate(X))
    (tmp_path / "a.csv").write_text(f"{name};{time};force;acc\n{rows}", encoding="utf-8")
    ignored = RawChannel("t", name.split(" ")[0], "ignored")
    description = replace(NAMED, channels=(*NAMED.channels, ignored))
    result = read("a.csv", tmp_path, description)
    assert result.errors == () and result.recordings[0].rate == 20000.0


@pytest.mark.parametrize("word", ["TRUE", "FALSE", "on", "overload"])
@pytest.mark.parametrize("separator", [";", ",", "\t"])
def test_the_error_of_a_column_of_words_states_its_name(separator, word, tmp_path):
    rows = [separator.join((f"{a:.4f}", f"{b:.4f}", word)) for a, b in X]
    lines = ["rate: 20000", separator.join(("force", "acc", "valid")), *rows]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(ReadError) as caught:
        read("a.csv", tmp_path, NAMED)
    expected = f"a.csv, line 52, column 'valid': {word!r} is no number, and no row holds only numbers, dates and times"
    assert str(caught.value).startswith(expected) and "states such as TRUE and FALSE as 1 and 0" in caught.value.remedy


SUMMARIES = {
    "a label in the first cell": "Min;{0}\nMax;{1}\nMean;0.1;0.2\n",
    "a label in a cell of its own": "Minimum;;{0}\nMaximum;;{1}\n",
    "a heading": "Statistics\nMittelwert;0.1;0.2\nStd. dev.;1.1;0.9\n",
    "quoted": '"RMS";"1.1";"0.9"\n',
    "signs": "Ø;0.1;0.2\nσ;1.1;0.9\n",
}


@pytest.mark.parametrize("summary", SUMMARIES.values(), ids=list(SUMMARIES))
@pytest.mark.parametrize("is_lazy", [False, True])
def test_statistics_below_the_samples_are_not_read_as_samples(summary, is_lazy, tmp_path):
    numbers = np.random.default_rng(4).normal(size=(60, 2)).round(6)
    rows = "".join(f"{a};{b}\n" for a, b in numbers)
    least, largest = (f"{x[0]};{x[1]}" for x in (numbers.min(axis=0), numbers.max(axis=0)))
    (tmp_path / "a.csv").write_text("force;rail\n" + rows + summary.format(least, largest), encoding="utf-8")
    _, _, raw = read_unconverted("a.csv", tmp_path, is_lazy=is_lazy)
    assert [list(column[:]) for column in raw.records[0].samples] == [list(x) for x in numbers.T]
    assert not any(entry.name.casefold() in ("min", "max") for entry in raw.records[0].entries)


@pytest.mark.parametrize("word", ["NaN", "nan", "inf", "-Infinity"])
def test_missing_samples_above_a_closing_line_are_read_as_samples(word, tmp_path):
    """They are not read as words that end the samples, such as "Information"."""
    (tmp_path / "a.csv").write_text("force;rail\n" + "1.5;2.5\n" * 60 + f"{word};{word}\nInformation\nEnd of data\n")
    _, _, raw = read_unconverted("a.csv", tmp_path)
    assert [len(column) for column in raw.records[0].samples] == [61, 61]


def test_a_damaged_row_at_the_end_is_not_read_as_a_statistic(tmp_path):
    rows = "".join(f"{a};{b}\n" for a, b in np.random.default_rng(4).normal(size=(60, 2)))
    for row in ("maxwell;0.1;0.2\n", "m;0.1\n", "0.1;max\n"):
        (tmp_path / "a.csv").write_text("force;rail\n" + rows + row)
        with pytest.raises(ReadError, match="line 62"):
            read_unconverted("a.csv", tmp_path)


def test_rows_of_a_short_table_are_not_read_as_a_summary(tmp_path):
    """A short table has too few rows to identify a summary: the flags of two contacts are samples."""
    rows = ["0;1", "1;0", "0;1", "1;0", "0;1", "1;0", "1;1", "0;0", "1;0"]
    (tmp_path / "a.csv").write_text("left;right\n" + "".join(f"{row}\n" for row in rows))
    _, _, raw = read_unconverted("a.csv", tmp_path)
    assert len(raw.records[0].samples[0]) == len(rows)


@pytest.mark.parametrize("is_lazy", [False, True])
@pytest.mark.parametrize("n", [60, 30_000])
def test_extremes_below_the_samples_without_a_label_are_an_error(tmp_path, is_lazy, n):
    """Also in a long text, which is read in blocks of 16 MB: each number has 300 further zeros."""
    numbers = np.random.default_rng(4).normal(size=(n, 2)).round(6)
    zeros = "0" * (300 if n > 60 else 0)
    rows = [*numbers, numbers.mean(axis=0), numbers.max(axis=0), numbers.min(axis=0)]
    for order, line in ((rows, n + 3), (rows[:-1], None), (rows[:n], None)):
        text = "".join(f"{a:.6f}{zeros};{b:.6f}{zeros}\n" for a, b in order)
        (tmp_path / "a.csv").write_text("force;rail\n" + text)
        if line is None:
            assert read_unconverted("a.csv", tmp_path, is_lazy=is_lazy)
            continue
        with pytest.raises(ReadError, match=f"line {line}: from here on rows hold the least and the largest"):
            read_unconverted("a.csv", tmp_path, is_lazy=is_lazy)


def test_rows_of_a_long_periodic_signal_are_not_read_as_a_summary(tmp_path):
    """The last rows contain the extremes, as earlier rows do."""
    x = np.sin(np.arange(120) * np.pi / 2).round(6) + 0.0
    (tmp_path / "a.csv").write_text("force;rail\n" + "".join(f"{a:.2f};{a:.2f}\n" for a in x))
    _, _, raw = read_unconverted("a.csv", tmp_path, is_lazy=True)
    np.testing.assert_array_equal(raw.records[0].samples[0][:], x.round(2))
