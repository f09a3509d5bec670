"""A hammer test near an end of the simulated track is computed with a warning, and one far from it without."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.cli.main import main
from turnout.simulate.frequency_response import receptance
from turnout.simulate.hammer import MIN_END_DISTANCE, end_warning
from turnout.simulate.matrices import assemble
from turnout.simulate.track import uniform_track

TRACKS = {
    "usual": {},
    "soft": {"pad_stiffness": 80e6, "ballast_stiffness": 20e6},
    "stiff": {"pad_stiffness": 600e6, "ballast_stiffness": 120e6},
}


@pytest.mark.parametrize("end_length", [0.0, 4.0, 9.0])
@pytest.mark.parametrize("name", TRACKS)
def test_without_a_warning_the_end_changes_the_receptance_by_at_most_two_per_cent(name, end_length):
    frequency = np.concatenate([np.arange(20.0, 300.0, 20.0), np.arange(300.0, 800.0, 50.0)])
    track = replace(uniform_track(72.0, **TRACKS[name]), end_length=end_length, end_damping=400.0)
    matrices, middle = assemble(track), float(track.support[60])
    far = np.abs(receptance(matrices, frequency, middle, middle))
    errors = {}
    for n in (1, 2, 3, 5, 8, 10, 15, 20):
        position = float(track.support[n])
        near = np.abs(receptance(matrices, frequency, position, position))
        errors[position] = (np.max(np.abs(near / far - 1.0)), end_warning(track, position))
    assert max(error for error, warning in errors.values() if warning is None) < 0.021
    assert all(warning for position, (_, warning) in errors.items() if position < 3.0)
    assert max(error for error, _ in errors.values()) > 0.1


def test_both_ends_and_a_short_simulated_stretch_are_stated():
    track = uniform_track(60.0)
    assert end_warning(track, 30.0) is None
    assert "2.4 m from the end of the simulated track at 0 m" in end_warning(track, 2.4)
    assert "track file that goes on for 6 m behind them" in end_warning(track, 58.0)
    assert "simulate.hammer_half_length" in end_warning(track, 30.0, half_length=MIN_END_DISTANCE - 1.0)


def test_the_command_states_the_position_and_the_distance(tmp_path, capsys):
    options = ["--impacts", "1", "--format", "npz", "--out", str(tmp_path / "end.npz")]
    assert main(["simulate", "hammer", "--track", "tommerup", "--section=-43", *options]) == 0
    assert "the impacts at -43 m are 2 m from the end of the simulated track at -45 m" in capsys.readouterr().err
