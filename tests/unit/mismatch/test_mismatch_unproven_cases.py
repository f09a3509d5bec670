"""If a kind of diagnosis is not proven, its names are withheld unless the settings request them."""

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.diagnose import diagnose
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.physics.term import Parameter

RESERVATION = "Diagnoses of such lines are not proven."
SIZE = (Parameter("size", "-", 0.0, (0.0, 9.0), "of the parabola", "made up 2026"),)


class Bent(Case):
    """Readings of a line with a parabola of size ``bend``, which the library has as its only effect."""

    control_level = {"reading": 1.5}  # 120 independent readings: by chance above 1.4 in one of 1,000

    def __init__(self, bend, reservation=""):
        self.x, rng = np.arange(1.0, 41.0) / 10.0, np.random.default_rng(3)
        self.observations = tuple(
            Observation(
                f"o{k}", f"c{k}", 2.0 * self.x + bend * self.x**2 + 0.1 * rng.normal(size=40), 0.1, 1.0, "reading"
            )
            for k in range(3)
        )
        self.nuisances, self.reservation = (Nuisance("slope", "-", 2.0, 1.0),), reservation
        self.candidates = (Candidate.of("bend", SIZE, lambda psi: psi["size"], ((1.0,),)),)

    def predict(self, values, terms, observations):
        return [values["slope"] * self.x + sum(terms) * self.x**2 for _ in observations]


@pytest.mark.parametrize(
    ("reservation", "is_requested", "answer"),
    [("", False, "named"), (RESERVATION, False, "unknown"), (RESERVATION, True, "named")],
)
def test_a_name_is_withheld_if_the_diagnosis_is_not_proven(reservation, is_requested, answer):
    found = diagnose(Bent(1.0, reservation), MismatchSettings(unproven_names=is_requested))
    assert found.verdict.answer == answer
    assert found.names == (("bend",) if answer == "named" else ())
    if answer == "unknown":
        assert found.verdict.reason == f"bend would explain it. {RESERVATION}"
        assert found.verdict.grade == "" and found.fit is found.base
        assert "panel_not_proven" in found.verdict.trail


def test_the_answer_none_is_not_withheld():
    assert diagnose(Bent(0.0, RESERVATION)).verdict.answer == "none"
