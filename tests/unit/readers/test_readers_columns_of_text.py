"""Columns of text files: a value above each of them, marks in all of their numbers, blanks and tabs between them."""

import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE, N = 25600.0, 400
FORCE, RAIL = np.random.default_rng(15).normal(size=(2, N)) * [[900.0], [30.0]]


def outcome(folder, text, units=("N", "m/s²"), sensitivities=(None, None), ignored=(), rate=RATE):
    """Recordings, and the reason of each error."""
    (folder / "a.txt").write_text(text, encoding="utf-8")
    sensors = [
        RawChannel(name, name, quantity, unit=unit, sensitivity=s, sensitivity_unit=f"count/{si}" if s else "")
        for name, quantity, unit, s, si in zip(
            ("force", "rail"), ("force", "acceleration"), units, sensitivities, ("N", "(m/s²)")
        )
    ]
    sensors += [RawChannel(name, name, "ignored") for name in ignored]
    result = read("a.txt", folder, RawDescription(tuple(sensors), rate=rate))
    return result.recordings, [e.reason for e in result.errors]


def table(head, columns=(FORCE, RAIL), names="force;rail"):
    rows = "".join(f"{';'.join(f'{x:.5f}' for x in row)}\n" for row in zip(*columns))
    return f"{head}\n{names}\n{rows}"


@pytest.mark.parametrize("name", ["Sample rate [Hz]", "Abtastrate", "Abtastrate:", "fs", "Scan rate (Hz)"])
@pytest.mark.parametrize(("values", "n_record"), [("25600;25600", 1), ("25600;12800", 0), ("25600,0;12800,0", 0)])
def test_a_rate_for_each_column_has_to_be_one(name, values, n_record, tmp_path):
    recordings, reasons = outcome(tmp_path, table(f"{name};{values}"))
    assert len(recordings) == n_record and reasons == ["wrong_rate"] * (n_record == 0)
    timed = table(f"{name};;{values}", (np.arange(N) / RATE, FORCE, RAIL), "Time;force;rail")
    assert len(outcome(tmp_path, timed)[0]) == n_record


@pytest.mark.parametrize("line", ["dt;3.90625e-05;7.8125e-05", "Abtastintervall [µs];39,0625;78,125"])
def test_a_step_for_each_column_has_to_be_one(line, tmp_path):
    assert outcome(tmp_path, table(line))[1] == ["wrong_rate"]


@pytest.mark.parametrize("line", ["Duration [s];0.015625;0.0078125", "Messdauer;0,015625 s;0,03125 s"])
def test_a_duration_for_each_column_has_to_fit_the_rows(line, tmp_path):
    assert outcome(tmp_path, table(line))[1]


@pytest.mark.parametrize("line", ["Abtastrate;25,6;kHz", "Abtastrate;kHz;25,6", "Sample rate;25600;N", "Delay;0;0"])
def test_a_single_value_with_its_unit_is_none_for_each_column(line, tmp_path):
    recordings, reasons = outcome(tmp_path, table(line))
    assert [r.rate for r in recordings] == [RATE] and "wrong_rate" not in reasons


def grouped(values, mark=","):
    return [f"{int(x):,}".replace(",", mark) for x in values]


COUNTS = np.rint(32768 + FORCE), np.rint(32768 + RAIL)


@pytest.mark.parametrize(("mark", "separator"), [(",", "\t"), (",", ";"), (".", ";"), (".", "\t")])
def test_counts_with_a_mark_in_every_number_are_rejected(mark, separator, tmp_path):
    """Formerly, all numbers were read as a thousandth of what they are."""
    rows = "".join(f"{a}{separator}{b}\n" for a, b in zip(*(grouped(x, mark) for x in COUNTS)))
    text = f"force{separator}rail\n{rows}"
    recordings, reasons = outcome(tmp_path, text, ("count", "count"), (1.0, 1.0))
    assert not recordings and reasons == ["scale_unknown"]
    recordings, reasons = outcome(tmp_path, text)
    assert len(recordings) == 1 and reasons == ["entry_unknown"] * 2
    assert outcome(tmp_path, text, ("kN", "g"))[1] == []


@pytest.mark.parametrize("third", ["0.5", "0.125", "1234.125", "12.5", "1e3"])
def test_a_number_of_another_form_shows_that_the_mark_is_a_decimal_mark(third, tmp_path):
    rows = [f"{a};{b};1.500\n" for a, b in zip(*(grouped(x, ".") for x in COUNTS))]
    rows[7] = rows[7].replace("1.500", third)
    text = "force;rail;third\n" + "".join(rows)
    assert outcome(tmp_path, text, ignored=("third",))[1] == []


def test_numbers_with_three_decimals_around_zero_are_no_thousands(tmp_path):
    rows = "".join(f"{a:.3f};{b:.3f}\n" for a, b in zip(FORCE / 10, RAIL))
    assert outcome(tmp_path, f"force;rail\n{rows}")[1] == []


LINES = [f"{f:.4f} {a:.5f}" for f, a in zip(FORCE, RAIL)]
MIXTURES = {
    "tab before a row": [*LINES[:2], "\t" + LINES[2], *LINES[3:]],
    "tab before the first row": ["\t" + LINES[0], *LINES[1:]],
    "tab in one row": [*LINES[:200], LINES[200].replace(" ", "\t"), *LINES[201:]],
    "tab behind a row": [*LINES[:5], LINES[5] + "\t", *LINES[6:]],
    "tabs and blanks": [line.replace(" ", "\t  ") for line in LINES],
    "rows in turn": [line.replace(" ", "\t") if k % 2 else line for k, line in enumerate(LINES)],
}  # fmt: skip


@pytest.mark.parametrize("name", MIXTURES)
def test_blanks_and_tabs_both_separate(name, tmp_path):
    recordings, reasons = outcome(tmp_path, "force\trail\n" + "\n".join(MIXTURES[name]) + "\n")
    assert reasons == [] and np.abs(recordings[0].samples - [FORCE, RAIL]).max() < 1e-4
