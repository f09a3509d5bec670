"""The command export: what a spreadsheet takes for a formula is text, and other tools get it as it is."""

import csv

import duckdb
import pytest

from turnout.cli.main import main
from turnout.registry.spreadsheet import FORMULA_STARTS, without_formula

TEXTS = [*(f"{start}1+1" for start in FORMULA_STARTS), "tamping", "", None, "x=1", "'quoted'"]


@pytest.fixture
def export(tmp_path, monkeypatch):
    """Function that exports a table of texts and numbers in a format, and returns the file."""

    def registry(folder):
        connection = duckdb.connect()
        connection.execute('create table notes ("the ""note""" varchar, change_pct double, at_utc timestamp)')
        rows = [[text, -1.5, "2026-04-02 14:30:00"] for text in TEXTS]
        connection.executemany("insert into notes values (?, ?, ?)", rows)
        connection.execute("create view numbers as select change_pct from notes")
        return connection

    monkeypatch.setattr("turnout.registry.database.open_registry", registry)

    def run(name, form):
        assert main(["export", str(tmp_path), "--format", form, "--only", name]) == 0
        return tmp_path / f"{name}.{form}"

    return run


def test_in_csv_no_text_is_a_formula_and_numbers_and_times_are_as_they_are(export):
    with export("notes", "csv").open(newline="", encoding="utf-8") as stream:
        header, *rows = csv.reader(stream)
    assert header == ['the "note"', "change_pct", "at_utc"]
    assert [row[0] for row in rows] == [without_formula(text) or "" for text in TEXTS]
    assert {tuple(row[1:]) for row in rows} == {("-1.5", "2026-04-02 14:30:00")}
    assert export("numbers", "csv").read_text(encoding="utf-8-sig").split() == ["change_pct", *["-1.5"] * len(TEXTS)]


def test_in_parquet_texts_are_as_they_are(export):
    rows = duckdb.sql(f"from '{export('notes', 'parquet')}'").fetchall()
    assert [row[0] for row in rows] == TEXTS
