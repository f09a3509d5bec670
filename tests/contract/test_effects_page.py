"""docs/effects.md agrees with the effects that a diagnosis tests."""

from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.physics import TERMS
from turnout.stages.effects_page import page


def test_the_page_is_up_to_date_with_the_catalogue(repository):
    written = (repository / "docs" / "effects.md").read_text(encoding="utf-8")
    assert written == page(), "run: python -m turnout.stages.effects_page docs"


def test_all_candidate_effects_of_a_case_are_marked_as_tested():
    """The table marks all candidate effects of a case, and those that only a residual suggests."""
    families = {c.family for c in TrackCase(measured_campaign(small_plan((15.0,)), (), 3)).candidates}
    assert families <= {t.name for t in TERMS if t.asked} and len(families) > 15
