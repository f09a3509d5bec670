"""The page about the Silverbox says what its run says, and ends with a reason where there is no recording."""

import pytest
from examples import silverbox
from examples.recorded import DOCS, folder_of


@pytest.mark.slow
def test_the_page_follows_from_the_recording(shared_data):
    found = silverbox.analyse(shared_data / "nonlinear_silverbox")
    text = silverbox.page(found)
    assert "**named: cubic spring**" in text and "**unknown**" in text
    kept = (DOCS / "silverbox.md").read_text(encoding="utf-8")
    assert text.splitlines()[0] == kept.splitlines()[0]
    case, told = found["without prior knowledge"]
    (multisine, _), (arrow, _) = silverbox.held_out(case, told.fit)
    assert multisine >= 98.0 and arrow >= 96.0
    other, removed = found["law removed"]
    assert silverbox.missing_force(other, removed.base).best_covariate == "displacement"


def test_without_a_recording_it_says_so(tmp_path):
    with pytest.raises(SystemExit, match=r"skipped: .* does not exist"):
        folder_of("nonlinear_silverbox", [str(tmp_path / "nowhere")])
