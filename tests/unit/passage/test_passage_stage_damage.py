"""Offsets, coarse converters and incomplete records: a passage loses its damaged parts and nothing else."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest
from benchmarks.passage_truth import PATTERNS, impact_train, paper_model

from turnout.config import load_configuration, with_raw
from turnout.errors import PartlyComputed
from turnout.passage.segmentation import cut_passages
from turnout.readers.writing import write
from turnout.records import Channel
from turnout.stages.passage import PassageContext, SectionModel, passage_unit
from turnout.workflow.guard import compute_guarded
from turnout.workflow.scan import scan

PLACES = {"OT": -12.0, "SP": 3.6, "CLP": 13.8, "A7": 24.6, "A8": 26.4, "A9": 28.2, "ASM": 36.0, "ASD": 36.0}
LOCATIONS = dict(zip(PLACES, ("OT", "SP", "CLP", "CP A7", "CP A8", "CP A9", "AS main", "AS diverging")))
STARTED = datetime(2024, 5, 13, 10)


@pytest.fixture(autouse=True)
def in_repository(repository, monkeypatch):
    monkeypatch.chdir(repository)


def on_main(snr_db=40.0):
    """Responses of the paper's models to an IC3 on the main track; sensors of the diverging track record nothing."""
    rng = np.random.default_rng(1)
    recording, _ = impact_train(rng, LOCATIONS.values(), list(PLACES.values()), speed=44.4, snr_db=snr_db)
    samples = recording.samples.copy()
    for i, name in enumerate(PLACES):
        if name in ("A9", "ASD"):
            samples[i] = 0.003 * rng.standard_normal(samples.shape[1])
    channels = tuple(Channel(name, "acceleration", x) for name, x in PLACES.items())
    return replace(recording, samples=samples, channels=channels, started_at=STARTED)


def with_model(rows):
    """Rows of passage_fits at sections that have a model."""
    return [fit for fit in rows["passage_fits"] if fit["model_id"] != "none"]


def rows_of(raw, *recordings, sections=("A7", "SP")):
    """Rows of a file with these records, fitted with the models of two sections."""
    folder = raw / "tommerup_s1" / "passages"
    folder.mkdir(parents=True, exist_ok=True)
    write(list(recordings), folder / "20240513T100000Z.h5", "hdf5")
    turnout = with_raw(load_configuration("config").turnout("tommerup_s1"), raw)
    models = {
        name: (SectionModel(f"model-{name}", datetime(2024, 1, 1), paper_model(LOCATIONS[name])),) for name in sections
    }
    return passage_unit(scan(turnout, raw).units[0], turnout, raw, PassageContext(models, PATTERNS))


def assert_same_rows(found, expected, but=()):
    """Rows agree: numbers to 1e-6, the rest exactly."""
    assert len(found) == len(expected)
    for one, other in zip(found, expected):
        assert set(one) == set(other)
        for name in set(one) - {"passage_id", "recording_id", *but}:
            value = other[name]
            close = isinstance(value, (float, np.ndarray))
            assert one[name] == (pytest.approx(value, rel=1e-6, abs=1e-9) if close else value), name


@pytest.mark.parametrize(("late", "used"), [(timedelta(hours=-14), True), (timedelta(days=-365), False)])
def test_a_file_whose_time_contradicts_its_name_is_rejected(late, used, tmp_path):
    """Local time in the name is no contradiction; a year is."""
    rows = rows_of(tmp_path, replace(on_main(), started_at=STARTED + late))
    assert [p["passed_at_utc"] - STARTED - late < timedelta(minutes=1) for p in rows["passages"]] == [True] * used
    assert [q["reason_code"] for q in rows["quarantine"]] == ["wrong_time"] * (not used)
    if not used:
        assert rows["quarantine"][0]["found"].startswith("says it was recorded on 2023-05-14 10:00, and is filed under")


@pytest.mark.parametrize("channels", [["A7"], list(PLACES)])
def test_a_zero_offset_does_not_change_the_rows(channels, tmp_path):
    """9.81 m/s² is what a sensor that also measures the standing weight leaves on a channel."""
    sound = on_main()
    offset = np.array([9.81 if name in channels else 0.0 for name in PLACES])[:, None]
    expected = rows_of(tmp_path / "sound", sound)
    found = rows_of(tmp_path / "offset", replace(sound, samples=sound.samples + offset))
    assert [p["status"] for p in expected["passages"]] == ["accepted"]
    assert {f["status"] for f in with_model(expected)} == {"accepted"}
    for table in ("passages", "passage_fits"):
        assert_same_rows(found[table], expected[table])
    assert found["quarantine"] == []


def test_a_zero_offset_at_the_start_of_a_continuous_record_is_no_passage(settings):
    quiet = 0.02 * np.random.default_rng(3).standard_normal((3, 400_000))
    assert list(cut_passages([quiet + 9.81], 20000.0, settings)) == []


def coarse(samples, codes, noisy_end=False):
    """Samples of a converter whose range to the peak has so many codes; the last code may be the next one."""
    step = np.abs(samples).max(axis=-1, keepdims=True) / codes
    rounded = np.round(samples / step) * step
    if noisy_end:
        rounded[..., -1:] = step
    return rounded


@pytest.mark.parametrize("codes", [100, 300, 1000])
def test_a_coarse_converter_does_not_count_as_a_lost_sensor(codes, tmp_path):
    """90 dB between peak and noise: before and after the train every sample is the same code."""
    sound = on_main(snr_db=90.0)
    rows = rows_of(tmp_path, replace(sound, samples=coarse(sound.samples, codes)))
    (passage,) = rows["passages"]
    assert (passage["status"], passage["n_axles"], passage["train_type"]) == ("accepted", 8, "IC3")
    assert passage["speed_kmh"] == pytest.approx(3.6 * 44.4, rel=3e-3)
    assert [f["status"] for f in with_model(rows)] == ["accepted", "accepted"] and rows["quarantine"] == []


@pytest.mark.parametrize("noisy_end", [False, True])
def test_a_channel_without_noise_is_fitted_with_the_noise_of_its_converter(noisy_end, tmp_path):
    sound = on_main()
    samples = sound.samples.copy()
    samples[3] = coarse(on_main(90.0).samples[3], 40, noisy_end)
    rows = rows_of(tmp_path, replace(sound, samples=samples))
    assert {f["channel"]: f["status"] for f in with_model(rows)} == {"A7": "accepted", "SP": "accepted"}
    assert rows["passages"][0]["status"] == "accepted"


@pytest.mark.parametrize("n_sample", [2, 100, 400, 800, 1999])
def test_a_too_short_record_is_reported_and_does_not_affect_other_trains(n_sample, tmp_path):
    sound = on_main()
    rest = replace(sound, samples=sound.samples[:, 5:][:, :n_sample], started_at=STARTED + timedelta(seconds=60))
    rows = rows_of(tmp_path, sound, rest)
    assert [p["status"] for p in rows["passages"]] == ["accepted", "rejected"]
    (row,) = rows["quarantine"]
    assert (row["reason_code"], row["record"], row["threshold"]) == ("no_train", 1, 0.1)
    assert row["found"] == f"only {n_sample / 20000:.3f} s were recorded"


def test_a_fault_of_the_program_affects_one_record(tmp_path, monkeypatch):
    """The second of three trains causes one. Its row states the fault, the file and the record; the others stay."""
    sound = on_main()
    trains = [sound.samples * (1.0 + 1e-6 * k) for k in range(3)]  # no two trains leave the same samples
    later = [replace(sound, samples=x, started_at=STARTED + timedelta(seconds=60.0 * k)) for k, x in enumerate(trains)]
    calls = []

    def failing(recording, *_):
        calls.append(recording.record)
        if recording.record == 1:
            raise ZeroDivisionError("in the toy")

    monkeypatch.setattr("turnout.stages.passage.axle_load", failing)
    with pytest.raises(PartlyComputed) as caught:
        rows_of(tmp_path, *later)
    assert calls == [0, 1, 2]
    assert [p["status"] for p in caught.value.tables["passages"]] == ["accepted", "accepted"]
    turnout = with_raw(load_configuration("config").turnout("tommerup_s1"), tmp_path)
    unit = scan(turnout, tmp_path).units[0]
    result = compute_guarded(passage_unit, unit, turnout, tmp_path, "key", "1", False)
    assert result.status == "internal_error" and len(result.tables["passages"]) == 2
    (row,) = result.tables["quarantine"]
    assert (row["reason_code"], row["record"], row["path"]) == ("internal_error", 1, unit.files[0][0])
    assert row["found"] == "ZeroDivisionError: in the toy" and "passage.py" in row["place"]
    with pytest.raises(ZeroDivisionError):
        compute_guarded(passage_unit, unit, turnout, tmp_path, "key", "1", True)
