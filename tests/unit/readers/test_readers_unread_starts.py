"""Starts and time zones in words that are not known: the start is read or reported, never lost without a word."""

from datetime import datetime

import numpy as np
import pytest

from turnout.readers import read
from turnout.readers.stated_zones import zone_of
from turnout.readers.time_texts import parse_uff_time
from turnout.records import RawChannel, RawDescription

START = datetime(2024, 5, 13, 14, 5, 30)  # in summer


def outcome(tmp_path, head, time_zone="UTC", checked=()):
    """(start in UTC, errors)."""
    rows = "".join(f"{f:.4f};{r:.4f}\n" for f, r in np.random.default_rng(5).normal(size=(200, 2)))
    (tmp_path / "a.csv").write_text(f"{head}\nforce;rail\n{rows}", encoding="utf-8")
    channels = RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²")
    description = RawDescription(channels, rate=20000.0, time_zone=time_zone, checked_entries=checked)
    result = read("a.csv", tmp_path, description)
    return result.recordings[0].started_at, result.errors


@pytest.mark.parametrize(
    "head",
    [
        *[
            "Data: 13.05.2024\nGodzina: 14:05:30",
            "Datum: 13.05.2024\nUhrzeit: 14.05.30",
            "Datum: 13. 5. 2024\nČas: 14:05:30",
        ],
        *[
            "Date: 13/05/2024\nHeure: 14h05m30s",
            "Dato: 13-05-2024\nKlokkeslæt: 14.05.30",
            "Data: 13/05/2024\nOra: 14:05:30",
        ],
        *["Pomiar: 2024-05-13 14:05:30", "Záznam: 13.05.2024 14:05:30"],
    ],
)
def test_day_and_time_of_day_in_other_languages_are_joined(head, tmp_path):
    assert outcome(tmp_path, head) == (START, ())


@pytest.mark.parametrize(
    "head",
    [
        *[
            "13.05.2024 14:05:30",
            "2024-05-13T14:05:30.000Z",
            "Start: 13. května 2024 14:05:30",
            "Mérés: 2024.05.13. 14:05:30",
        ],
        *[
            "Ölçüm: 13.05.2024 14:05",
            "Mittaus alkoi 13.5.2024 14:05:30",
            "Päivä: 2024-05-13\nSaa: 14:05:30",
            "Sitzung 20240513_140530",
        ],
    ],
)
def test_a_date_with_a_time_of_day_that_is_not_understood_is_quoted(head, tmp_path):
    start, (error,) = outcome(tmp_path, head)
    assert start is None and error.reason == "start_unknown" and head.split(": ")[-1].split()[0] in error.problem
    assert "start_time" in error.remedy


def test_an_entry_that_the_layout_declares_checked_is_no_start(tmp_path):
    assert outcome(tmp_path, "Ölçüm: 13.05.2024 14:05", checked=("Ölçüm",)) == (None, ())


@pytest.mark.parametrize(
    "head",
    [
        *["Calibrated: 2023-01-01 00:00:00", "Exportiert am 01.06.2024 08:00:00", "Vytištěno: 01.06.2024 08:00:00"],
        *[
            "Uloženo: 01.06.2024 08:00:00",
            "Udskrevet: 01.06.2024 08:00",
            "Ende: 2024-05-13 14:05:35",
            "Koniec: 2024-05-13 14:05:35",
        ],
        *["Firmware 2.1.3 of 2019", "Position: 12.05.20", "Next service: 2025-01-01 00:00:00"],
    ],
)
def test_the_time_of_another_event_is_not_reported(head, tmp_path):
    assert outcome(tmp_path, head) == (None, ())


OTHER_EVENTS = [
    *["Generated", "Output by DIAdem", "Written", "Report", "Processed", "Filtered", "Sent", "Received", "Downloaded"],
    *[
        "Transferred",
        "Approved",
        "Reviewed",
        "Verified",
        "Inspected",
        "Geprüft",
        "Geändert",
        "Bearbeitet",
        "Ausgegeben",
    ],
    *["Stand", "Eksporteret", "Ændret", "Oprettet", "Hentet", "Vérifié", "Built", "Baujahr", "Weld", "Rail laid"],
    *["Commissioned", "Delivered", "Zero", "Tare", "Nullabgleich", "Boot", "Power on", "Possession", "Sperrpause"],
    *["Shift", "License", "Copyright", "Battery", "TEDS cal"],
]


@pytest.mark.parametrize("name", OTHER_EVENTS)
@pytest.mark.parametrize("mark", [": ", " "])
def test_a_dated_event_that_is_no_start_is_not_reported(name, mark, tmp_path):
    """Formerly, each of these was quoted as a start that cannot be read."""
    assert outcome(tmp_path, f"{name}{mark}13.05.2024 14:05:30") == (None, ())


@pytest.mark.parametrize(
    "head",
    [
        *["Part: 12-05-20\nMast: 12:30", "Drawing: 12.05.2020\nShift: 06:00", "Inventory: 2019-05-12\nContact: 08:00"],
        *["Lot: 2024-05-12\nMast: 12:30", "Datum: 12.05.20\nMast: 12:30"],
    ],
)
def test_two_entries_are_a_start_only_if_they_are_called_date_and_time(head, tmp_path):
    assert outcome(tmp_path, head)[0] is None and "Mast" not in str(outcome(tmp_path, head)[1])


@pytest.mark.parametrize(("name", "n"), [("2024-05-14_a.csv", 0), ("2024-05-13_a.csv", 1), ("a.csv", 1)])
def test_a_date_of_another_day_than_the_file_is_not_reported(name, n, tmp_path):
    outcome(tmp_path, "Ölçüm: 13.05.2024 14:05")
    (tmp_path / "a.csv").rename(tmp_path / name)
    channels = RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²")
    assert len(read(name, tmp_path, RawDescription(channels, rate=20000.0)).errors) == n


def test_another_date_beside_a_start_is_not_reported(tmp_path):
    assert outcome(tmp_path, "Start: 2024-05-13 14:05:30\nMérés: 2024.05.13. 14:05:30") == (START, ())


@pytest.mark.parametrize("zone", ["CEST", "SELČ", "MESZ", "EEST"])
@pytest.mark.parametrize("name", ["Strefa czasowa", "Časové pásmo", "Klokke", "Saat dilimi"])
def test_a_zone_counts_whatever_its_name(name, zone, tmp_path):
    start, (error,) = outcome(tmp_path, f"Start: 2024-05-13 14:05:30\n{name}: {zone}")
    assert start == START and error.reason == "start_unknown" and zone in error.problem
    if zone != "EEST":
        assert outcome(tmp_path, f"Start: 2024-05-13 14:05:30\n{name}: {zone}", "Europe/Prague")[1] == ()


@pytest.mark.parametrize("offset", ["+02:00", "UTC+2", "UTC+02:00"])
def test_an_offset_counts_whatever_its_name(offset, tmp_path):
    assert outcome(tmp_path, f"Start: 2024-05-13 14:05:30\nSaat dilimi: {offset}") == (
        datetime(2024, 5, 13, 12, 5, 30),
        (),
    )


@pytest.mark.parametrize(
    "entry",
    [
        *["Train delay: +05:00", "Verspätung: -00:30", "Cant: +00:15", "Delay: +00:30", "Time offset: +00:02"],
        *["NTP: UTC", "Clock source: UTC", "GPS sync: UTC", "Range: -10:10", "Line: BST", "Track: CET"],
    ],
)
@pytest.mark.parametrize("zone", ["", "Time zone: UTC\n"])
def test_a_duration_and_the_name_of_a_clock_are_no_zone(zone, entry, tmp_path):
    """Formerly, a start was moved by the delay of a train."""
    head = f"Start: 2024-05-13 14:05:30\n{zone}{entry}"
    expected = START if zone else datetime(2024, 5, 13, 12, 5, 30)
    assert outcome(tmp_path, head, "Europe/Berlin") == (expected, ())


@pytest.mark.parametrize("entry", ["Uhrwerk: UTC", "Standard: GMT", "Hubi: UTC+3", "Hubi: CET"])
def test_an_abbreviation_of_a_zone_under_an_unknown_name_is_a_remark(entry, tmp_path):
    head = f"Start: 2024-05-13 14:05:30\n{entry}"
    start, (error,) = outcome(tmp_path, head, "Europe/Berlin")
    assert start == datetime(2024, 5, 13, 12, 5, 30) and error.reason == "start_unknown"
    assert outcome(tmp_path, head, "Europe/Berlin", checked=(entry.split(":")[0],))[1] == ()
    agreeing = {"CET": "Africa/Tunis"}.get(entry.split(": ")[1], "Etc/GMT-3" if "+3" in entry else "UTC")
    assert outcome(tmp_path, head, agreeing)[1] == ()


@pytest.mark.parametrize("entry", ["Time reference: UTC", "Time base: GMT", "Zeitbasis: UTC", "All times: UTC"])
def test_a_name_of_the_time_states_the_zone(entry, tmp_path):
    assert outcome(tmp_path, f"Start: 2024-05-13 14:05:30\n{entry}", "Europe/Berlin") == (START, ())


@pytest.mark.parametrize(
    ("entry", "is_summer"),
    [
        *[("DST: off", False), ("DST: 0", False), ("Clock: winter time", False), ("Zimní čas: ano", False)],
        *[("DST: on", True), ("Sommerzeit: ja", True), ("Letní čas: ano", True), ("Horloge: heure d'été", True)],
        *[("Summer time: no", False), ("Sommerzeit: nein", False)],
    ],
)
def test_summer_time_is_compared_with_the_zone_of_the_layout(entry, is_summer, tmp_path):
    for stamp, is_of_summer in (("2024-05-13 14:05:30", True), ("2024-01-13 14:05:30", False)):
        errors = outcome(tmp_path, f"Start: {stamp}\n{entry}", "Europe/Berlin")[1]
        assert [error.reason for error in errors] == ([] if is_summer == is_of_summer else ["start_unknown"])


@pytest.mark.parametrize("entry", ["Direction: WEST", "Weather: daylight", "Site: summer", "Train: EC"])
def test_what_is_no_zone_is_not_reported(entry, tmp_path):
    assert outcome(tmp_path, f"Start: 2024-05-13 14:05:30\n{entry}") == (START, ())


def test_a_month_of_another_language_in_a_universal_file_is_read():
    assert parse_uff_time("13-Mai-26 10:00:00") == datetime(2026, 5, 13, 10)
    assert parse_uff_time("13-Dez-25 10:00:00") == datetime(2025, 12, 13, 10)
    assert parse_uff_time("13-Foo-25 10:00:00") is None


@pytest.mark.parametrize("text", ["Europa/Berlin", "Europe/Atlantis", "a/b", "../etc/passwd", "Europe/"])
def test_a_zone_that_does_not_exist_is_none(text):
    assert zone_of(text) is None
