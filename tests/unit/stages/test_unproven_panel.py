"""Where a diagnosis has not been proven on concealed data, its answer says so."""

import pytest

from turnout.simulate import uniform_track
from turnout.simulate.blade import Blade
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.stages.change_diagnosis import reservation
from turnout.stages.mismatch_rows import UNPROVEN_SWITCH, as_unproven


@pytest.mark.parametrize(("grade", "expected"), [("A", "B"), ("B", "B"), (None, None)])
def test_a_name_at_an_unproven_panel_is_at_most_of_grade_b(grade, expected):
    row = {"verdict": "named", "grade": grade, "sentence": "A hanging sleeper at 4.8 m."}
    changed = as_unproven(row, UNPROVEN_SWITCH)
    assert changed == {**row, "grade": expected, "sentence": f"A hanging sleeper at 4.8 m. {UNPROVEN_SWITCH}"}


def test_a_change_on_a_track_with_a_blade_is_unproven_too():
    """The blade may be that of any route; a track without one has no reservation."""
    plain = uniform_track(30.0)
    switch = plain.with_(blade=Blade(3.0, 9.0, 12.0, plain.rail, 3e8, 3e4))
    assert reservation(TurnoutTrack(plain)) == ""
    assert UNPROVEN_SWITCH in reservation(TurnoutTrack(switch))
    assert UNPROVEN_SWITCH in reservation(TurnoutTrack(plain, tracks={"diverging": switch}))
