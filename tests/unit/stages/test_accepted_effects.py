"""Effects of a track file on a part of that track."""

import pytest

from turnout.config.document import Place
from turnout.config.parameters import Number, ParameterSet
from turnout.errors import ConfigError, SimulationError
from turnout.simulate import uniform_track
from turnout.simulate.turnout_track import TurnoutTrack, stretch_of_track
from turnout.stages.accepted_effects import AcceptedEffect, accepted_of, effects_of, terms_on

TRACK = uniform_track(60.0)
LIFTING_SLEEPERS = AcceptedEffect("lifting_sleepers", {"first": 12.0, "last": 55.8}, {"share": (1.0, None)})


@pytest.mark.parametrize(("place", "half"), [(30.0, 30.0), (30.0, 12.0), (10.0, 6.0), (58.0, 5.0), (12.0, 0.7)])
def test_the_part_of_a_range_that_is_on_the_stretch_is_simulated(place, half):
    """The supports of the stretch between 12.0 and 55.8 m, by position, are those of the whole track."""
    stretch = stretch_of_track(TRACK, place, half)
    term = LIFTING_SLEEPERS.term(stretch)
    expected = [x for x in TRACK.support.round(6) if 12.0 <= x <= 55.8 and abs(x - place) <= half]
    assert list(stretch.support[term.first : term.last + 1].round(6)) == expected


@pytest.mark.parametrize(("place", "half"), [(5.0, 6.0), (59.0, 2.5)])
def test_a_range_outside_the_stretch_is_left_out(place, half):
    assert LIFTING_SLEEPERS.term(stretch_of_track(TRACK, place, half)) is None


def test_a_sleeper_outside_the_stretch_is_left_out():
    gap = AcceptedEffect("hanging_sleeper", {"sleeper": 30.0}, {"gap": (3e-4, None)})
    assert gap.term(TRACK).sleeper == 50 and gap.term(stretch_of_track(TRACK, 10.0, 12.0)) is None


@pytest.mark.parametrize(
    ("first", "error", "message"),
    [
        (Number(12.0, "kg", "x"), ConfigError, r"terms\[0\]\.first: the unit 'kg' is not one of 'm'"),
        ("toe", ConfigError, r"terms\[0\]\.first: 'toe' has no unit and source"),
        (56.4, SimulationError, "lifting_sleepers from 56.4 m back to 55.8 m"),
    ],
)
def test_an_invalid_position_is_rejected(first, error, message):
    share = Number(1.0, "-", "x")
    entry = {"term": "lifting_sleepers", "first": first, "last": 55.8, "share": share}
    with pytest.raises(error, match=message):
        accepted_of([ParameterSet(Place("t.yaml", entry="terms[0]"), entry)])


def entry_of(**fields):
    return ParameterSet(Place("t.yaml", entry="terms[0]"), fields)


@pytest.mark.parametrize(
    ("fields", "is_on"),
    [
        ({"term": "local_pad", "sleeper": 30.0, "factor": Number(0.5, "-", "x")}, True),
        ({"term": "local_pad", "sleeper": 900.0, "factor": Number(0.5, "-", "x")}, False),
        ({"term": "local_pad", "sleeper": -3.0, "factor": Number(0.5, "-", "x")}, False),
        ({"term": "local_pad", "sleeper": 30.0, "factor": Number(0.5, "-", "x"), "route": "diverging"}, False),
        ({"term": "lifting_sleepers", "first": 50.0, "last": 70.0, "share": Number(0.5, "-", "x")}, True),
        ({"term": "lifting_sleepers", "first": 61.0, "last": 70.0, "share": Number(0.5, "-", "x")}, False),
        ({"term": "rail_shear", "flexibility": Number(0.5, "-", "x")}, True),
    ],
)
def test_an_effect_on_no_route_of_the_whole_track_is_an_error(fields, is_on):
    turnout = TurnoutTrack(TRACK, terms=(entry_of(**fields),))
    if is_on:
        assert len(effects_of(turnout)) == len(terms_on(turnout, TRACK)) == 1
        return
    for call in (effects_of, lambda t: terms_on(t, TRACK)):
        with pytest.raises(SimulationError, match=r"t\.yaml, terms\[0\]: .* is on no route of the track.* Correct its"):
            call(turnout)
