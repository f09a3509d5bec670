"""docs/effects.md tells what a diagnosis asks for."""

from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.physics import TERMS
from turnout.stages.effects_page import page


def test_the_page_is_the_one_that_the_catalogue_gives(repository):
    written = (repository / "docs" / "effects.md").read_text(encoding="utf-8")
    assert written == page(), "run: python -m turnout.stages.effects_page docs"


def test_what_the_page_calls_never_asked_is_in_no_library():
    """All that a case of passages and impacts asks at once is in the table; what only a residual suggests is so too."""
    asked = {c.family for c in TrackCase(measured_campaign(small_plan((15.0,)), (), 3)).candidates}
    assert asked <= {t.name for t in TERMS if t.asked} and len(asked) > 15
