"""Offsets, coarse converters and remains of records: a passage costs what is damaged in it and nothing else."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest
from benchmarks.passage_truth import PATTERNS, paper_model, struck_train

from turnout.chains.passage import PassageContext, SectionModel, passage_unit
from turnout.config import load_configuration, with_raw
from turnout.fleet.scan import scan
from turnout.passage.continuous import cut_passages
from turnout.readers.writing import write
from turnout.records import Channel

PLACES = {"OT": -12.0, "SP": 3.6, "CLP": 13.8, "A7": 24.6, "A8": 26.4, "A9": 28.2, "ASM": 36.0, "ASD": 36.0}
LOCATIONS = dict(zip(PLACES, ("OT", "SP", "CLP", "CP A7", "CP A8", "CP A9", "AS main", "AS diverging")))
STARTED = datetime(2024, 5, 13, 10)


@pytest.fixture(autouse=True)
def in_repository(repository, monkeypatch):
    monkeypatch.chdir(repository)


def on_main(snr_db=40.0):
    """An IC3 on the main track as the paper's models answer; the diverging sensors hear nothing."""
    rng = np.random.default_rng(1)
    recording, _ = struck_train(rng, LOCATIONS.values(), list(PLACES.values()), speed=44.4, snr_db=snr_db)
    samples = recording.samples.copy()
    for i, name in enumerate(PLACES):
        if name in ("A9", "ASD"):
            samples[i] = 0.003 * rng.standard_normal(samples.shape[1])
    channels = tuple(Channel(name, "acceleration", x) for name, x in PLACES.items())
    return replace(recording, samples=samples, channels=channels, started_at=STARTED)


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


def same(found, expected, but=()):
    """Rows agree: numbers to 1e-6, the rest exactly."""
    assert len(found) == len(expected)
    for one, other in zip(found, expected):
        assert set(one) == set(other)
        for name in set(one) - {"passage_id", "recording_id", *but}:
            value = other[name]
            close = isinstance(value, (float, np.ndarray))
            assert one[name] == (pytest.approx(value, rel=1e-6, abs=1e-9) if close else value), name


@pytest.mark.parametrize("channels", [["A7"], list(PLACES)])
def test_a_zero_offset_changes_nothing(channels, tmp_path):
    """9.81 m/s² is what a sensor that also measures the standing weight leaves on a channel."""
    sound = on_main()
    offset = np.array([9.81 if name in channels else 0.0 for name in PLACES])[:, None]
    expected = rows_of(tmp_path / "sound", sound)
    found = rows_of(tmp_path / "offset", replace(sound, samples=sound.samples + offset))
    assert [p["status"] for p in expected["passages"]] == ["accepted"]
    assert {f["status"] for f in expected["passage_fits"]} == {"accepted"}
    for table in ("passages", "passage_fits"):
        same(found[table], expected[table])
    assert found["quarantine"] == []


def test_a_zero_offset_at_the_start_of_a_continuous_record_is_no_passage(settings):
    quiet = 0.02 * np.random.default_rng(3).standard_normal((3, 400_000))
    assert list(cut_passages([quiet + 9.81], 20000.0, settings)) == []
