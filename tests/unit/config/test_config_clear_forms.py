"""Forms of flags, labels, times and tables that have one meaning are read, and unclear ones are errors."""

import unicodedata

import pytest
from tests.unit.config.test_config_written_forms import EVENTS, LAYOUT, project

from turnout.config import load_configuration
from turnout.config.campaign_notes import read_campaigns, read_trains
from turnout.config.events import COLUMNS, parse_utc, time_problem
from turnout.config.table_edits import added_row
from turnout.errors import ConfigErrors
from turnout.passage.timetable import listed_trains

FLAG = "settings:\n  mismatch: {unproven_names: %s}\n"


@pytest.mark.parametrize("words, is_set", [("yes Yes ja JA TRUE 'true' on oui 1 y", True),
                                           ("no No nein NEIN FALSE 'false' off non 0 n", False)])  # fmt: skip
def test_words_for_yes_and_no_are_flags(tmp_path, words, is_set):
    for word in words.split():
        found = load_configuration(project(tmp_path, LAYOUT + FLAG % word))
        assert found.turnout("t1").settings["mismatch"].unproven_names is is_set, word


@pytest.mark.parametrize("word", ["maybe", "2", "-1", "1.0", "''", "nope", "[true]"])
def test_another_word_is_no_flag(tmp_path, word):
    with pytest.raises(ConfigErrors, match=r"line 13, column 30: unproven_names is .*Write true or false"):
        load_configuration(project(tmp_path, LAYOUT + FLAG % word))


@pytest.mark.parametrize("label", ["A_7", "Süd", "Herzstück_1", "7A", "12", "Växel-3", "Стрелка", "Ε1"])
def test_a_section_has_the_name_that_people_use(tmp_path, label):
    events = EVENTS.replace("A7", unicodedata.normalize("NFD", label))
    layout = LAYOUT.replace("A7", unicodedata.normalize("NFD", label))
    for text in (layout, LAYOUT.replace("A7", label)):
        found = load_configuration(project(tmp_path, text, events=events))
        assert [s.label for s in found.turnout("t1").sections] == [label]
        assert [e.section for e in found.events] == [label]


@pytest.mark.parametrize("label", ["A 7", "A/7", "A.7", "-7", "A+7", "_7", "A7²"])
def test_a_label_with_another_character_is_an_error(tmp_path, label):
    with pytest.raises(ConfigErrors, match=r"line 2, column 3.*Write a name of letters, digits, _ and -"):
        load_configuration(project(tmp_path, LAYOUT.replace("A7", label)))


TIMES = ["T10:30Z", "T10:30z", "t10:30z", " 10:30 UTC", " 10:30 utc", "T10:30UTC", " 10:30 GMT", " 10:30 +00:00",
         "T10:30+0000", " 10:30:00 Z"]  # fmt: skip


@pytest.mark.parametrize("time", TIMES)
def test_a_time_may_end_with_any_mark_of_utc(time, tmp_path):
    assert time_problem("2026-04-02" + time) is None
    assert parse_utc("2026-04-02" + time).isoformat() == "2026-04-02T10:30:00"
    (tmp_path / "trains.csv").write_text(f"passed_at_utc,speed_kmh\n2026-04-02{time},120\n")
    rows, errors = read_trains(tmp_path / "trains.csv", "trains.csv")
    (train,), faults = listed_trains(rows)
    assert (train.passed_at.isoformat(), errors, faults) == ("2026-04-02T10:30:00", [], ())


@pytest.mark.parametrize("time", ["T10:30 CET", " 10:30 +02:00", "T10:30+02:00 UTC", " 10:30 UTC+2", "T10:30 local"])
def test_a_time_of_another_zone_is_an_error(time):
    assert time_problem("2026-04-02" + time)


FORMS = {
    "sep=,": EVENTS,
    "sep=;": EVENTS.replace(",", ";"),
    "SEP=;": EVENTS.replace(",", ";"),
    '"sep=;"': EVENTS.replace(",", ";"),
    "\ufeffsep=;": EVENTS.replace(",", ";"),
    "sep=\t": EVENTS.replace(",", "\t"),
}


@pytest.mark.parametrize("first", FORMS)
def test_the_first_line_of_a_csv_may_name_its_separator(tmp_path, first):
    expected = load_configuration(project(tmp_path / "a")).events
    path = project(tmp_path / "b", events=f"{first}\n{FORMS[first]}") / "events.csv"
    assert load_configuration(path.parent).events == expected and len(expected) == 1
    with added_row(path, {"turnout": "t2", "date": "2025-03-02", "kind": "tamping"}, COLUMNS):
        pass
    assert [e.turnout for e in load_configuration(path.parent).events] == ["t1", "t2"]


def test_another_separator_than_the_first_line_names_is_an_error(tmp_path):
    with pytest.raises(ConfigErrors, match=r"line 2, column 1: commas between the columns.*remove the line 'sep='"):
        load_configuration(project(tmp_path, events=f"sep=;\n{EVENTS}"))
    with pytest.raises(ConfigErrors, match="line 2, column 1: semicolons between the columns"):
        load_configuration(project(tmp_path, events=EVENTS.replace(",", ";").replace("turnout", "sep=,\nturnout", 1)))


def test_a_comma_that_separates_no_cells_is_a_decimal_mark(tmp_path):
    text = "campaign;started_at_utc;rail_temperature_c\n2026-04-02;2026-04-02T10:00;{}\n"
    for sep, cell, expected in (("sep=;\n", "12,5", 12.5), ("sep=;\n", "-3", -3.0), ("sep=;\n", "12.5", 12.5)):
        (tmp_path / "campaigns.csv").write_text(sep + text.format(cell))
        campaigns, errors = read_campaigns(tmp_path / "campaigns.csv", "campaigns.csv")
        assert (campaigns["2026-04-02"].rail_temperature, errors) == (expected, [])
    (tmp_path / "campaigns.csv").write_text("sep=;\n" + text.format("1,234"))  # a thousand, or 1.2 °C
    campaigns, (error,) = read_campaigns(tmp_path / "campaigns.csv", "campaigns.csv")
    assert campaigns[
        "2026-04-02"
    ].rail_temperature is None and "line 3, column 29: rail_temperature_c is '1,234'" in str(error)
