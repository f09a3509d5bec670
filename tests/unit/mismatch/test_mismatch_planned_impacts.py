"""A planned hammer test has impacts, which supports that press and pull differently need."""

import numpy as np
import pytest

from turnout.mismatch.engine.distinguishability import distinguishability
from turnout.mismatch.turnout.planned_case import PLANNED_CONTACT, PLANNED_PEAK, PlannedCase, small_plan

EFFECTS = ("loose_fastening", "local_pad")


@pytest.fixture(scope="module")
def case():
    return PlannedCase(small_plan((15.0,), (28.0,), (24.0,)), families=EFFECTS)


def test_a_planned_impact_has_the_impulse_of_a_half_sine(case):
    impact = next(iter(case.data.frf_pairs.values())).typical_impact
    assert impact.force[0] == impact.force[-1] == 0.0 and impact.force.max() <= PLANNED_PEAK
    expected = 2.0 / np.pi * PLANNED_PEAK * PLANNED_CONTACT
    assert np.trapezoid(impact.force, dx=1.0 / impact.rate) == pytest.approx(expected, rel=0.01)
    assert impact.impulse == pytest.approx(expected) and impact.accepted


def test_loose_fastenings_are_distinguished_from_a_soft_pad_in_a_plan_with_impacts(case):
    matrix = distinguishability(case)
    assert set(matrix.names) == set(EFFECTS)
    assert np.all(np.isfinite(matrix.loss)) and np.all(matrix.detectability > 0.0)
