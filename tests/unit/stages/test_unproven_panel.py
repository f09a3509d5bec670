"""An answer states if the diagnosis has not been proven on concealed data at its position."""

import pytest

from turnout.mismatch.turnout.unproven_panels import UNPROVEN_SWITCH, as_unproven, reservation
from turnout.simulate import uniform_track
from turnout.simulate.blade import Blade
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.stages import distinguish


@pytest.mark.parametrize(("grade", "expected"), [("A", "B"), ("B", "B"), (None, None)])
def test_a_name_at_an_unproven_panel_has_at_most_grade_b(grade, expected):
    row = {"verdict": "named", "grade": grade, "sentence": "A hanging sleeper at 4.8 m."}
    changed = as_unproven(row, UNPROVEN_SWITCH)
    assert changed == {**row, "grade": expected, "sentence": f"A hanging sleeper at 4.8 m. {UNPROVEN_SWITCH}"}


def test_a_change_on_a_track_with_a_switch_blade_is_unproven():
    """The blade may be on any route; a track without a blade has no reservation."""
    plain = uniform_track(30.0)
    switch = plain.with_(blade=Blade(3.0, 9.0, 12.0, plain.rail, 3e8, 3e4))
    assert reservation(TurnoutTrack(plain)) == ""
    assert UNPROVEN_SWITCH in reservation(TurnoutTrack(switch))
    assert UNPROVEN_SWITCH in reservation(TurnoutTrack(plain, tracks={"diverging": switch}))


def test_the_plan_of_a_campaign_at_a_switch_has_the_reservation(monkeypatch):
    """The effects that a plan can distinguish are computed only with the model."""
    plain = uniform_track(30.0)
    switch = plain.with_(blade=Blade(3.0, 9.0, 12.0, plain.rail, 3e8, 3e4))
    for track, expected in ((plain, False), (switch, True)):
        monkeypatch.setattr(distinguish, "load_track", lambda *_, track=track, **__: TurnoutTrack(track))
        _, advice = distinguish.planned_matrix("t", [6.0], [6.0], [15.0], [], [], ["local_ballast", "local_pad"])
        assert (UNPROVEN_SWITCH in advice) is expected
