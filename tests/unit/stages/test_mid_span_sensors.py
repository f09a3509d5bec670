"""An accelerometer at mid-span without a position is half a bay of its own track behind the sleeper."""

import numpy as np
import pytest
import small_turnout as small

from turnout.config import load_configuration, with_raw
from turnout.simulate import simulate_hammer, uniform_track
from turnout.simulate.track import Track
from turnout.simulate.turnout_track import half_bay
from turnout.stages import calibrate as calibrate_stage
from turnout.stages.mismatch_inputs import gather_inputs
from turnout.stages.simulate import write_hammer
from turnout.stages.track_files import track_of
from turnout.workflow.scan import scan

SPACINGS = (0.6, 0.75, 0.9)  # m; section A at 18 m is on a sleeper of all three tracks
CHANNEL = "    mid: {source: rail, quantity: acceleration, unit: m/s², mounting: rail head mid-span}\n"


@pytest.fixture(params=SPACINGS, ids=lambda spacing: f"{spacing} m")
def spacing(request, tmp_path, repository, monkeypatch):
    """The small turnout on such a track, with an accelerometer at mid-span and a hammer test at section A."""
    config = small.write_configuration(tmp_path, repository)
    track, layout = config / "tracks/small.yaml", config / "layouts/small.yaml"
    track.write_text(track.read_text().replace("spacing: {value: 0.6", f"spacing: {{value: {request.param}"))
    rail = next(line for line in small.LAYOUT.splitlines(keepends=True) if line.startswith("    rail: "))
    layout.write_text(small.LAYOUT.replace(rail, CHANNEL).replace("response: rail", "response: mid"))
    small.write_hammer_tests(tmp_path, labels=("A",))
    monkeypatch.chdir(tmp_path)
    return request.param


def turnout_here():
    return with_raw(load_configuration("config").turnout("t1"), "raw")


def test_a_simulated_test_has_its_second_accelerometer_in_the_middle_of_the_bay(spacing):
    (recording,) = simulate_hammer(uniform_track(36.0, spacing), 18.0, n_impacts=1, rate=5e3, duration=0.06)
    assert recording.channels[2].position == pytest.approx(18.0 + 0.5 * spacing, abs=1e-9)


def test_a_simulation_for_a_turnout_has_its_channel_in_the_middle_of_the_bay(spacing, monkeypatch):
    sensors = []

    def simulated(track, section, hammer, sensors_of_test, *others, **options):
        sensors.extend(sensors_of_test)
        raise InterruptedError

    monkeypatch.setattr("turnout.stages.simulate.simulate_hammer", simulated)
    request = {"section": "A", "track": None, "turnout": "t1", "config": "config", "raw": "raw", "tests": 1}
    request |= {"impacts": 1, "seed": 0, "out": None, "format": None, "at": "2024-05-13T09:00:00", "truth": None}
    with pytest.raises(InterruptedError):
        next(write_hammer(request))
    assert [s.place for s in sensors] == pytest.approx([18.0 + 0.5 * spacing], abs=1e-9)


def test_a_calibration_assumes_the_channel_in_the_middle_of_the_bay(spacing, monkeypatch):
    measured = []
    monkeypatch.setattr(calibrate_stage, "calibrate", lambda track, section, data: measured.extend(data))
    calibrate_stage.calibrate_to_files("config/tracks/small.yaml", "A", ["raw/t1/hammer/2026-07-25/A_1.h5"], "t1")
    assert [d.measured for d in measured] == pytest.approx([18.0 + 0.5 * spacing], abs=1e-9)


def test_a_diagnosis_assumes_the_channel_in_the_middle_of_the_bay(spacing):
    turnout = turnout_here()
    units = [u for u in scan(turnout, "raw").units if u.kind == "hammer"]
    (test,) = gather_inputs(units, turnout, "raw", track_of(turnout)[0], {}).tests
    channel = test.recordings[0].channels[test.recordings[0].index("mid")]
    assert channel.position == pytest.approx(18.0 + 0.5 * spacing, abs=1e-9)


def test_half_a_bay_is_that_behind_the_nearest_support():
    support = np.cumsum([0.0, 0.5, 0.6, 0.7, 0.8])
    track = Track(uniform_track(6.0).rail, support, 3e8, 3e4, 150.0, 9e7, 8e4)
    assert [half_bay(track, x) for x in (0.0, 0.2, 0.5, 1.2, 2.6)] == [0.25, 0.25, 0.3, 0.35, 0.4]


def test_positions_of_tests_on_usual_tracks_are_those_of_before():
    """0.3 m to the last bit: simulated tests and stored calibrations stay as they are."""
    assert 24.6 + half_bay(uniform_track(102.0, start=-45.0), 24.6) == 24.6 + 0.3
