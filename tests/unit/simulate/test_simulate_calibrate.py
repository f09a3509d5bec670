"""The stated errors of a calibration: the error of the model is one per octave, not one per line."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.simulate.calibration import PARAMETERS, MeasuredReceptance, calibrate
from turnout.simulate.frequency_response import receptance
from turnout.simulate.matrices import assemble
from turnout.simulate.track import uniform_track
from turnout.simulate.turnout_track import TurnoutTrack

PLACE = 30.0


def _track():
    track = uniform_track(60.0)
    return track.with_(section=("S",) * track.support.size)


def _asked(true, frequency, parameters):
    """Calibration of the plain track by receptances of a true one, measured at the support and in mid-span."""
    matrices, track = assemble(true), _track()
    given = [
        MeasuredReceptance(frequency, h, 1e-4 * np.abs(h), PLACE, response_position)
        for response_position in (PLACE, PLACE + 0.3)
        for h in [receptance(matrices, frequency, PLACE, response_position)]
    ]
    return calibrate(TurnoutTrack(track, {"main": ((),)}), "S", given, location=PLACE, parameters=parameters)


def test_the_same_curve_on_sixteen_times_the_lines_has_no_smaller_errors():
    """Lines within an octave share the error of the model. 20 %: the ends of the curve differ by a few lines."""
    parameters = ("pad_stiffness", "ballast_stiffness", "ballast_damping")
    few, many = (_asked(_track(), np.linspace(60.0, 800.0, n), parameters) for n in (100, 1600))
    for name in parameters:
        assert many.sd[name] == pytest.approx(few.sd[name], rel=0.2)


@pytest.mark.parametrize(
    "wrong",
    [
        {"pad_width": 0.15},
        {"rail": replace(_track().rail, bending_stiffness=0.95 * _track().rail.bending_stiffness)},
    ],
    ids=["pads of a width", "rail 5 % softer"],
)
def test_errors_by_an_incomplete_model_are_within_the_stated_errors(wrong):
    """A track that the five parameters cannot describe, 371 lines of two sensors, hardly any noise."""
    found = _asked(_track().with_(**wrong), np.arange(60.0, 801.0, 2.0), tuple(PARAMETERS))
    true = {name: getattr(_track(), name)[0] for name in PARAMETERS}
    for name, value in found.values.items():
        assert abs(np.log(value / true[name])) < 3.0 * found.sd[name], name
    assert found.sd["pad_stiffness"] < 0.05  # and the errors are not large
