"""Where a diagnosis has not been proven on concealed data, its answer says so."""

import pytest

from turnout.stages.mismatch_rows import UNPROVEN_SWITCH, as_unproven


@pytest.mark.parametrize(("grade", "expected"), [("A", "B"), ("B", "B"), (None, None)])
def test_a_name_at_an_unproven_panel_is_at_most_of_grade_b(grade, expected):
    row = {"verdict": "named", "grade": grade, "sentence": "A hanging sleeper at 4.8 m."}
    changed = as_unproven(row, UNPROVEN_SWITCH)
    assert changed == {**row, "grade": expected, "sentence": f"A hanging sleeper at 4.8 m. {UNPROVEN_SWITCH}"}
