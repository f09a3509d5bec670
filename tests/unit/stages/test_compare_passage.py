"""A recorded passage beside its simulation: the same train agrees, and a scaled recording differs by its factor."""

import csv
import json
import shutil
from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from turnout.cli.main import main
from turnout.errors import ConfigError
from turnout.passage.kinematics import Motion
from turnout.passage.result import Passage, PassageSensor, SpeedFinding
from turnout.readers.writing import write
from turnout.simulate import Sensor, load_track, load_vehicle, simulate_passage
from turnout.stages.compare import (
    MAX_DELAY,
    N_SHIFTS,
    _fit_by_chance,
    _shifts_by_chance,
    _vehicle,
    compare_passage,
)
from turnout.stages.simulated_speed import recorded_times, speed_at_sensors

SENSORS = {"OT": -12.0, "A7": 24.6, "ASM": 36.0}
OTHERS = {"SP": 3.6, "CLP": 13.8, "A8": 26.4, "A9": 28.2, "ASD": 36.0}
FACTOR = {"OT": 1.0, "A7": 1.0, "ASM": 2.0}


@pytest.fixture(scope="module")
def passage(tmp_path_factory):
    """Recording of a locomotive at 5 kHz, with twice the level at ASM; A9 and ASD are on the other track."""
    folder = tmp_path_factory.mktemp("raw")
    places = {**SENSORS, **OTHERS}
    sensors = [Sensor(name, x, "rail web", gain=0.02 if name in ("A9", "ASD") else 1.0) for name, x in places.items()]
    sensors = [replace(s, gain=s.gain * FACTOR.get(s.name, 1.0), noise=0.05) for s in sensors]
    recording = simulate_passage(
        load_track("tommerup"),
        load_vehicle("locomotive"),
        120.0 / 3.6,
        sensors,
        rate=5e3,
        substeps=2,
        lead=0.8,
        tail=0.8,
        started_at=datetime(2026, 7, 24, 9),
    )
    path = folder / "20260724T090000Z.h5"
    write([replace(recording, conditions={"rail_temperature": 15.0})], path, "hdf5", single=True)
    return path


@pytest.fixture(scope="module")
def comparison(passage, repository):
    return compare_passage(
        passage, "tommerup_s2", repository / "config", passage.parent, sensors=("A7", "ASM"), calibrate=False
    )


def test_both_bands_are_complete(comparison):
    assert comparison.train.startswith("locomotive, 4 axles, 120.") or comparison.train.startswith(
        "locomotive, 4 axles, 119."
    )
    assert [(b.sensor, b.low, b.high) for b in comparison.bands] == [
        (s, *band) for s in ("A7", "ASM") for band in ((0.0, 40.0), (40.0, 1000.0))
    ]
    for b in comparison.bands:
        step = b.frequency[1] - b.frequency[0]
        assert b.frequency[0] == pytest.approx(b.low, abs=step) and b.frequency[-1] == pytest.approx(b.high, abs=step)
        assert step <= 1.5  # Hz


def test_the_same_train_agrees_and_a_factor_of_two_is_six_decibels(comparison):
    """20 lg 2 = 6.02 dB. The estimated speed is 0.4 % off, so the time series of the high band are out of phase."""
    level = {(b.sensor, b.low): b.level_difference for b in comparison.bands}
    assert level["A7", 0.0] == pytest.approx(0.0, abs=0.3) and level["A7", 40.0] == pytest.approx(0.0, abs=1.5)
    assert level["ASM", 0.0] == pytest.approx(-6.02, abs=0.3) and level["ASM", 40.0] == pytest.approx(-6.02, abs=1.5)
    low = next(b for b in comparison.bands if (b.sensor, b.low) == ("A7", 0.0))
    assert low.fit > 80.0
    power = np.sum(low.recorded_density) * (low.frequency[1] - low.frequency[0])
    assert power == pytest.approx(
        np.mean(low.recorded**2), rel=0.25
    )  # Parseval's theorem, without the power that the filter passes above 40 Hz


def test_the_fit_by_chance_separates_the_right_time_series_from_equal_levels(comparison):
    """In 0-40 Hz the same train fits far better than the same simulation at other times."""
    low, high = comparison.bands[:2]
    assert low.fit > 80.0 and low.fit_by_chance < 20.0
    shifted = _shifts_by_chance(low.recorded, low.recorded, 5e3)
    assert len(shifted) == N_SHIFTS and abs(shifted).min() >= MAX_DELAY * 5e3
    assert _fit_by_chance(low.recorded, low.recorded, np.array([0])) == pytest.approx(100.0)
    assert _fit_by_chance(low.recorded, low.recorded, shifted) < 30.0
    assert high.row["fit_by_chance_pct"] == high.fit_by_chance > -100.0


def test_a_recording_too_short_for_shifts_has_no_fit_by_chance():
    x = np.sin(np.arange(500.0))
    assert _fit_by_chance(x, x, _shifts_by_chance(x, x, 5e3)) is None


@pytest.mark.parametrize("runs_reversed", [False, True])
def test_the_vehicle_is_simulated_in_the_order_of_the_recorded_axles(runs_reversed):
    """A locomotive at the end is simulated there; formerly at the front, 9.5 m off."""
    at = load_vehicle("intercity").wheel_positions
    recorded = at[-1] - at[::-1] if runs_reversed else at
    vehicle, is_reversed, _ = _vehicle("intercity", 0.5, passage_with(recorded), ["A7"], 0.05, "a.h5")
    assert is_reversed == runs_reversed and vehicle.wheel_positions == pytest.approx(recorded)


def test_a_vehicle_with_other_axle_distances_is_an_error_also_with_the_same_number():
    """Two locomotives have eight axles, as an IC3. Formerly they were simulated in its place."""
    recorded = load_vehicle("ic3").wheel_positions
    with pytest.raises(ConfigError, match=r"axles lie \d\.\d+ m rms off those of locomotive\.yaml.*--vehicle"):
        _vehicle("locomotive", 0.5, passage_with(recorded), ["A7"], 0.05, "a.h5")
    assert len(_vehicle("ic3", 0.5, passage_with(recorded), ["A7"], 0.05, "a.h5")[0].wheels) == 8


def passage_with(offsets, speed=None, motion=None):
    offsets, motion = np.asarray(offsets), motion or Motion(30.0)
    return Passage("accepted", (), motion, speed, offsets, at_sensor={"A7": motion.passing(offsets, 24.6)})


@pytest.mark.parametrize(
    ("source", "share", "se", "is_from_axles"),
    [
        ("sensors", 0.8, 0.25, True),
        ("bogie", 0.94, 0.16, True),
        ("both", 1.0, 1e-4, False),
        ("axle spacing", 0.99, 1e-4, True),
    ],
)
def test_the_more_exact_speed_is_simulated(source, share, se, is_from_axles):
    """The recorded axles lie at ``share`` of the true distances, as a speed with this error places them.

    Formerly a train of unknown type was simulated at its recorded speed, up to a quarter off.
    """
    found = SpeedFinding(30.0 * share, 30.0 * se, 0.0, 0.1, source)
    recorded = load_vehicle("ic3").wheel_positions * share
    _, _, speed = _vehicle("ic3", 0.5, passage_with(recorded, found, Motion(30.0 * share)), ["A7"], 0.05, "a.h5")
    assert speed.is_from_axles == is_from_axles
    assert speed.speed == pytest.approx(30.0, rel=1e-3)
    assert ("from the axle distances" in speed.note) == is_from_axles
    assert f"{108.0 * share:.1f}" in speed.note


def test_the_speed_of_a_train_that_brakes_is_that_at_the_sensors():
    """Braking by 0.5 m/s² from 20 m/s over 53 m and 25 m: in the middle of its time at A7 v² = 20² - 2 * 0.5 * 51."""
    positions = load_vehicle("ic3").wheel_positions
    passage = passage_with(positions, motion=Motion(20.0, acceleration=-0.5))
    assert speed_at_sensors(passage, ["A7"]) == pytest.approx(np.sqrt(400.0 - 51.0), rel=2e-3)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("share", [1.0, 0.8])
def test_a_train_that_brakes_is_compared_where_it_was(direction, share):
    """Every simulated axle is at the time of the recorded one, though only the latter train brakes.

    Formerly the series were shifted alone: at 20 m/s and -0.5 m/s² the last axle of an IC3 was 0.2 s early.
    """
    positions = load_vehicle("ic3").wheel_positions
    passage = passage_with(positions * share, motion=Motion(20.0, 1.0, -0.5, direction))
    recorded = speed_at_sensors(passage, ["A7"])
    simulated_axles = 0.9 + positions / (recorded / share)
    at = recorded_times(simulated_axles, simulated_axles, passage, PassageSensor("A7", "A7", 24.6), recorded)
    assert at == pytest.approx(passage.at_sensor["A7"], abs=1e-6)


def test_the_comparison_states_the_simulated_speed(comparison):
    assert sum(note.startswith("speed 1") and "km/h (95 %) from the" in note for note in comparison.notes) == 1


def test_the_command_states_an_improbable_value_of_the_track_file(passage, repository, tmp_path, capsys):
    shutil.copytree(repository / "config", tmp_path / "config")
    track = tmp_path / "config/tracks/tommerup.yaml"
    track.write_text(track.read_text().replace("{value: 466.3, unit: MN/m", "{value: 466300, unit: MN/m", 1))
    command = ["compare", str(passage), "--turnout", "tommerup_s2", "--configuration", str(tmp_path / "config")]
    assert main([*command, "--raw", str(passage.parent), "--sensors", "ASM", "--no-calibration"]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert "improbable: " in line and "sections[0].pad_stiffness: 4.663e+11 N/m is outside" in line


def test_the_command_prints_a_row_per_band_and_writes_page_and_spectra(passage, repository, tmp_path, capsys):
    page, spectra = tmp_path / "c.html", tmp_path / "c.csv"
    arguments = ["compare", str(passage), "--turnout", "tommerup_s2", "--configuration", str(repository / "config")]
    arguments += ["--raw", str(passage.parent), "--sensors", "A7", "--figure", str(page), "--csv", str(spectra)]
    assert main(arguments) == 0
    text = capsys.readouterr().out
    assert "A7: no hammer test before the passage" in text and text.count("\nA7 ") == 2
    assert page.read_text(encoding="utf-8").count("<svg") >= 4
    rows = list(csv.DictReader(spectra.open()))
    assert {r["band_high_hz"] for r in rows} == {"40", "1000"} and float(rows[5]["recorded_psd"]) > 0.0
    assert main([*arguments, "--json"]) == 0
    first, second = json.loads(capsys.readouterr().out)["result"]
    assert (first["sensor"], first["band_high_hz"], second["band_low_hz"]) == ("A7", 40.0, 40.0)
    assert first["fit_pct"] > first["fit_by_chance_pct"] and f"{first['fit_pct']:.1f} / " in text
    assert main([*arguments[:6], "--raw", str(passage.parent), "--sensors", "A9"]) == 2
    assert "A9: did not record the train" in capsys.readouterr().err
    assert main([*arguments[:6], "--raw", str(passage.parent), "--sensors", "A17"]) == 2
    assert "no sensor 'A17'. The turnout has OT, SP, CLP, A7, A8, A9, ASM, ASD." in capsys.readouterr().err
