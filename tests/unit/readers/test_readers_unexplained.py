"""Entries that no other rule can interpret are reported if they could change samples or rate.

The layout states 25.6 kHz, newtons and m/s²; the file has no statement in known words.
"""

import h5py
import numpy as np
import pytest
from tests.unit.readers.test_readers_metadata_subjects import can_hold, outcome
from tests.unit.readers.test_readers_rate_matrix import FORMATS, SENSORS, TRUE, described, write_csv

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.entries import Entry
from turnout.readers.unexplained_entries import RecordFacts, unexplained_entries
from turnout.records import RawDescription

# Name, value: a rate of 20 kHz, a scale, or another unit, with names that are in no list.
CONTRADICTIONS = [
    ("Mode", "20 kS/s @ 24 bit"), ("Profile", "mono/20kHz/16bit"), ("Setup", "2 ch x 20000 Hz, 24 bit"), ("Acq", "20k"),
    ("Qtz", 5e-05), ("Punktabstand", 5e-05), ("Hub", "20000"), ("Nyquist", "10 kHz"), ("Uhr", "1/20000 s"),
    ("Sweep", "3.2 ms"), ("Amplifier", "x100"), ("Reading", "raw*0.01"), ("Conversion", "1 count = 0.3 mV"),
    ("Q-format", "Q1.15"), ("Inverted", "true"), ("Scaled", "no"), ("Hub", 2.5), ("Range factor", 0.5),
    ("Values in", "kN"), ("Comment", "acceleration in g"), ("Data", "rail [g]"), ("System", "US customary"),
    ("Aufschlag", 1.25), ("Rapport", 2.5), ("Empfindlichkeitskorrektur", 1.08), ("Note", "accel_g"),
    ("Note", "channel 2 in: g"), ("Channel 2 in", "g"), ("Zuschlag", "x1.1"), ("Conversion", 0.5),
    ("Dataconversion", "a=2.5 b=0.1"), ("Signalkonversion", "x2.5"), ("Schienenaufschlag", "x1.1"),
    ("speed", "20 kS/s"), ("Hub", 3), ("Messgang", 117), ("Full scale", 10.0),
    ("Time scale", 2.5), ("direction", "20 kS/s"), ("Serial number", "sampled at 20 kHz"), ("Battery", 12800),
    ("Delay", "78.125 us"),
]  # fmt: skip
# The same statements in agreement with the record, and values about something else.
HARMLESS = [
    ("Mode", "25.6 kS/s @ 24 bit"), ("Acq", "25.6k"), ("Qtz", 3.90625e-05), ("Nyquist", "12.8 kHz"),
    ("Sweep", "2.5 ms"), ("Hub", 2), ("Hub", 1.0), ("Values in", "N"), ("Amplifier", "x1"), ("Scaled", "yes"),
    ("Filter", "BE 5000 Hz"), ("Note", "accel_b"), ("Note", "channel 2 in: N"), ("Schienentemperatur", 12.5),
    ("Hammerschlag", 12.5), ("Serialport", 2.5), ("Standardversion", 2.5),
    ("Trigger level", "50 N"), ("Rail temperature", 12.5), ("Kilometer", "41,235"), ("Serial", 20000), ("Lot", 41233),
    ("Pre-trigger", "10 ms"), ("Recorded", "13.05.2024"), ("Bits per sample", 24), ("Wheel load", "80 kN"),
    ("speed", 37.871), ("Speed", "160.0"), ("train_id", 20000),
]  # fmt: skip


@pytest.mark.parametrize("format", FORMATS)
def test_a_value_that_contradicts_the_record_is_reported_under_any_name(format, tmp_path):
    for name, value in CONTRADICTIONS:
        if can_hold(format, name, str(value)):
            _, errors = outcome(format, tmp_path, (name, value))
            assert errors, (name, value)
            assert str(value)[:6] in errors[0].problem.replace("T", "t"), (name, value)


@pytest.mark.parametrize("format", FORMATS)
def test_a_value_that_agrees_or_is_about_something_else_is_not_reported(format, tmp_path):
    for name, value in HARMLESS:
        if can_hold(format, name, str(value)):
            recording, errors = outcome(format, tmp_path, (name, value))
            assert recording is not None and errors == (), (name, value)


def test_only_checked_entries_are_accepted(tmp_path):
    write_csv(tmp_path / "a.csv", [("Profile", "20 kS/s"), ("Hub", "2.5")])
    for checked, n_record, reasons in (
        ((), 0, ["wrong_rate"]), (("profile",), 1, ["entry_unknown"]), (("Profile", "Hub"), 1, []),
    ):  # fmt: skip
        description = RawDescription(SENSORS, rate=TRUE, checked_entries=checked)
        try:
            result = read("a.csv", tmp_path, description)
        except ReadError as error:
            assert n_record == 0 and [error.reason] == reasons
            continue
        assert len(result.recordings) == n_record and [e.reason for e in result.errors] == reasons
        assert all("checked_entries: Hub" in str(e) for e in result.errors if e.reason == "entry_unknown")


def test_units_that_override_the_file_explain_scales_but_no_rates(tmp_path):
    sensors = tuple(RawDescription(SENSORS).channels)
    overridden = tuple(type(s)(s.name, s.source, s.quantity, unit=f"{s.unit}!") for s in sensors)
    write_csv(tmp_path / "a.csv", [("Reading", "raw*0.01"), ("Values in", "kN")])
    assert read("a.csv", tmp_path, RawDescription(overridden, rate=TRUE)).errors == ()
    write_csv(tmp_path / "a.csv", [("Profile", "20 kS/s")])
    (error,) = read("a.csv", tmp_path, RawDescription(overridden, rate=TRUE)).errors
    assert error.reason == "wrong_rate"
    assert read("a.csv", tmp_path, described(20000.0)).errors == ()


def test_samples_of_another_record_are_not_read_as_statements():
    """The matrix of a second record is not reported; a short list of the same numbers is reported."""
    facts = RecordFacts(5000.0, 32, 2, 2, ("N", "m/s²"))
    matrix = np.random.default_rng(3).normal(size=(2, 32)) * 0.01
    assert not list(unexplained_entries([Entry("record_001", "record_001", matrix)], facts))
    assert list(unexplained_entries([Entry("head", "list", matrix[:1, :5])], facts))


def test_a_condition_of_one_record_or_of_each_record_is_not_reported(tmp_path):
    """A speed [m/s] is stored with the samples of one record as a number or as an array of one value."""
    force, rail = np.random.default_rng(5).normal(size=(2, 64))
    for speed in (37.871, np.array([37.871])):
        np.savez(tmp_path / "a.npz", rate=TRUE, force=force, rail=rail, speed=speed)
        result = read("a.npz", tmp_path, RawDescription(SENSORS, rate=TRUE))
        assert result.recordings[0].conditions["speed"] == pytest.approx(37.871)
        assert "entry_unknown" not in [e.reason for e in result.errors]


@pytest.mark.parametrize(("name", "value"), [("Profile", "20 kS/s"), ("Values in", "kN"), ("Reading", "raw*0.01")])
def test_a_clear_contradiction_rejects_every_record_that_it_concerns(name, value, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs[name] = value
        for k in range(3):
            for sensor in SENSORS:
                samples = np.random.default_rng(k).normal(size=64)
                file.create_dataset(f"record_{k:03d}/{sensor.source}", data=samples)
    result = read("a.h5", tmp_path, described(TRUE))
    assert result.recordings == () and len(result.errors) == 3
    assert all(value in error.problem for error in result.errors)
