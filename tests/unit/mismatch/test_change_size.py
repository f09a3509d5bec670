"""Standard deviation of the size of a change: error of the data, share of the size, and stiff springs that hide."""

import numpy as np
import pytest

from turnout.mismatch.calibrated.answers_against_file import file_answer
from turnout.mismatch.calibrated.answers_of_change import change_candidates
from turnout.mismatch.calibrated.belief import StateParameter
from turnout.mismatch.calibrated.change import ChangeEffect
from turnout.mismatch.calibrated.change_size import error_of_stiff_spring, with_model_error
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.information import GroupInformation, VisitInformation

PAD = StateParameter("pad@1.20", 0.0, 0.1, 0.0, "pad", 2, 1.2)
DAMPER = StateParameter("pad_damper@1.20", 0.0, 0.15, 0.0, "pad_damper", 2, 1.2)
GAIN = StateParameter("gain_A1", 0.0, 0.02, 0.0, "gain", None, 1.0)
BY_NAME = {p.name: p for p in (PAD, DAMPER, GAIN)}
STIFFER = ChangeEffect("pad@1.20", {"pad@1.20": 1.0, "pad_damper@1.20": 0.5}, 0.5)
PAD_ERROR = dict(CALIBRATION.model_errors)["pad"]


def test_the_error_of_a_stiff_pad_is_a_constant_share_of_the_compliance_before():
    """A compliance of exp(-x) with the error e (1 - exp(-x)): to first order that of x is e (exp(x) - 1)."""
    for x in (0.3, 1.4, 2.5):
        compliance = np.exp(-x)
        step = 1e-6 * PAD_ERROR * (1.0 - compliance)
        slope = (np.log(compliance + step) - np.log(compliance)) / 1e-6
        assert error_of_stiff_spring(STIFFER, x, BY_NAME) == pytest.approx(slope, rel=1e-4)


def test_a_softer_pad_and_a_gain_have_no_such_error():
    assert error_of_stiff_spring(STIFFER, -1.8, BY_NAME) == 0.0
    assert error_of_stiff_spring(ChangeEffect("gain_A1", {"gain_A1": 1.0}, 0.1), 0.3, BY_NAME) == 0.0


def test_three_independent_errors_of_a_size():
    """A pad with twelve times its stiffness: its error is mostly that of a compliance that has almost vanished."""
    x = np.log(12.0)
    size, sd = with_model_error(STIFFER, (x, 0.1), BY_NAME)
    assert size == x and sd**2 == pytest.approx(0.1**2 + (0.1 * x) ** 2 + (PAD_ERROR * 11.0) ** 2)


def test_a_difference_from_the_file_has_this_error_too():
    visits = [
        VisitInformation(f"v{k}", 0.5 * k, (GroupInformation("A", 1, (PAD.name,), np.array([[1e4]]), np.array([2e4])),))
        for k in range(3)
    ]
    answer = file_answer([PAD], visits, [], "v2", change_candidates([PAD]), 12.0, 6.0)
    assert "local_pad" in answer.names and answer.size == pytest.approx(2.0, abs=0.1)
    assert answer.sd >= PAD_ERROR * np.expm1(answer.size) > 3.0 * 1e-2
