"""A name whose shape stays unresolved and that foretells recordings never used worse is no name."""

import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.diagnose import Verification
from turnout.mismatch.together import unconfirmed
from turnout.mismatch.verdict import Verdict

POSTERIOR = {"pad_preload": 0.8, "none": 0.15, "unknown": 0.05}


@pytest.mark.parametrize(
    ("after", "error", "fell"),
    [(26.0, 0.9, True), (26.0, 1.7, False), (28.0, 0.1, False), (26.0, None, False)],
)
def test_a_fall_is_one_beyond_its_standard_error(after, error, fell):
    assert Verification(1, 27.6, after, error=error).fell is fell


def test_a_model_that_foretells_nothing_is_left_to_the_rules_before():
    """Without a prediction there is no error either: such a name was refused when it was judged."""
    assert not Verification(1, 27.6).fell


def test_a_name_of_grade_b_becomes_unknown_with_the_probability_of_that():
    settings = MismatchSettings()
    found = unconfirmed(Verdict("named", ("pad_preload",), "B", 0.97, dict(POSTERIOR)), settings)
    assert (found.answer, found.names, found.grade) == ("unknown", (), "")
    assert "pad_preload" in found.reason and "worse" in found.reason
    assert sum(found.posterior.values()) == pytest.approx(1.0)
    assert found.posterior["unknown"] == pytest.approx(found.probability) and found.probability < 0.7


@pytest.mark.parametrize("verdict", [Verdict("named", ("dip",), "A", 0.97), Verdict("none"), Verdict("a_or_b")])
def test_other_answers_stay(verdict):
    assert unconfirmed(verdict, MismatchSettings()) is verdict
