"""Effects of a track's file on a part of that track."""

import pytest

from turnout.config.document import Place
from turnout.config.parameters import Number, ParameterSet
from turnout.errors import ConfigError, SimulationError
from turnout.simulate import uniform_track
from turnout.simulate.turnout_track import stretch_of_track
from turnout.stages.accepted_effects import AcceptedEffect, accepted_of

TRACK = uniform_track(60.0)
LIFTS = AcceptedEffect("lifting_sleepers", {"first": 12.0, "last": 55.8}, {"share": (1.0, None)})


@pytest.mark.parametrize(("place", "half"), [(30.0, 30.0), (30.0, 12.0), (10.0, 6.0), (58.0, 5.0), (12.0, 0.7)])
def test_of_a_range_what_lies_on_the_stretch_is_simulated(place, half):
    """The supports from 12.0 to 55.8 m that a stretch has, told by their places: they are those of the whole track."""
    stretch = stretch_of_track(TRACK, place, half)
    term = LIFTS.term(stretch)
    expected = [x for x in TRACK.support.round(6) if 12.0 <= x <= 55.8 and abs(x - place) <= half]
    assert list(stretch.support[term.first : term.last + 1].round(6)) == expected


@pytest.mark.parametrize(("place", "half"), [(5.0, 6.0), (59.0, 2.5)])
def test_a_range_that_lies_elsewhere_is_left_out(place, half):
    assert LIFTS.term(stretch_of_track(TRACK, place, half)) is None


def test_one_sleeper_beyond_the_end_is_left_out():
    gap = AcceptedEffect("hanging_sleeper", {"sleeper": 30.0}, {"gap": (3e-4, None)})
    assert gap.term(TRACK).sleeper == 50 and gap.term(stretch_of_track(TRACK, 10.0, 12.0)) is None


@pytest.mark.parametrize(
    ("first", "error", "said"),
    [
        (Number(12.0, "kg", "x"), ConfigError, r"terms\[0\]\.first: the unit 'kg' is not one of 'm'"),
        ("toe", ConfigError, r"terms\[0\]\.first: 'toe' has no unit and source"),
        (56.4, SimulationError, "lifting_sleepers from 56.4 m back to 55.8 m"),
    ],
)
def test_a_place_that_is_none_is_refused(first, error, said):
    share = Number(1.0, "-", "x")
    entry = {"term": "lifting_sleepers", "first": first, "last": 55.8, "share": share}
    with pytest.raises(error, match=said):
        accepted_of([ParameterSet(Place("t.yaml", entry="terms[0]"), entry)])
