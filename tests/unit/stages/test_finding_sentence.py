"""Sentences and positions of a diagnosis, with what else is possible."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout import physics
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.localization import Location
from turnout.mismatch.engine.verdict import Verdict
from turnout.stages.finding_row import location_fields, sentence

FLAT = physics.WheelFlat(1, 0.04, train="railcar")


@pytest.mark.parametrize(
    ("rivals", "end"), [((), "(length 40 mm, 95 % interval 24 to 56 mm)."), ((1, 3), ". Or wheel 1 or 3 has it.")]
)
def test_the_answer_states_every_wheel_that_may_have_the_flat(rivals, end):
    """0.040 ± 1.96 * 0.008 m."""
    candidate = Candidate.of(FLAT.name, FLAT.parameters, dict, (), {"train": "railcar", "axle": 2}, rival_axles=rivals)
    fit = SimpleNamespace(
        terms=(FLAT,),
        candidates=(candidate,),
        psi=np.array([0.04]),
        psi_se=np.array([0.008]),
        part=lambda c: slice(0, 1),
    )
    verdict = Verdict("named", (FLAT.name,), "A")
    text = sentence(SimpleNamespace(verdict=verdict, verdicts=(verdict,), fit=fit))
    assert text.startswith("The simulation lacks an effect: wheel 2 of railcar has a flat of 0.040 m") and end in text
    assert text.endswith(end)


@pytest.mark.parametrize(("low", "high", "half_interval"), [(4.2, 4.2, 0.6), (3.6, 4.2, 0.6), (3.0, 5.4, 1.2)])
def test_the_position_of_an_unknown_cause_is_known_to_one_bay_to_either_side_at_best(low, high, half_interval):
    """An interval of 95 % reaches two standard errors to either side; a bay has 0.6 m."""
    fields = location_fields(Location("place", 4.2, 50.0, 0.5 * (low + high), low, high))
    assert 2.0 * fields["place_se"] == pytest.approx(half_interval)
