"""A casting may differ from the file piece by piece: the pieces, and their effect on the rail."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.mismatch.turnout.planned_case import small_plan
from turnout.mismatch.turnout.rail_parameters import CASTING_SDS, RAIL_SDS, rail_sds, with_rail
from turnout.mismatch.turnout.track_parameters import track_nuisances
from turnout.mismatch.turnout.zone import casting_elements, zone_of
from turnout.simulate.frequency_response import receptance
from turnout.simulate.matrices import assemble
from turnout.simulate.track import RailStretch

PLAN = small_plan((15.0,), hammer_positions=(24.0,))
TRACK = PLAN.turnout.track
HEAVY = replace(TRACK.rail, bending_stiffness=1.7 * TRACK.rail.bending_stiffness, mass=2.2 * TRACK.rail.mass)
NOSE, FAR = RailStretch(23.0, 26.4, HEAVY), RailStretch(2.0, 4.0, HEAVY)


@pytest.fixture(scope="module")
def zone():
    """A crossing between the sensors of the main track, which the diverging one does not have, and one far away."""
    cast = TRACK.with_(stretches=(FAR, NOSE))
    turnout = replace(PLAN.turnout, track=cast, tracks={"main": cast, "diverging": TRACK.with_(stretches=(FAR,))})
    return zone_of(turnout, [21.0, 27.3])


def test_pieces_cover_the_casting_and_half_a_bay_beyond_its_ends(zone):
    pieces = [c.piece for c in zone.castings]
    assert [p.start for p in pieces] == pytest.approx(
        [22.7, 23.0, 23.3, *(23.3 + 2.8 / 3 * np.arange(1, 3)), 26.1, 26.4]
    )
    assert [p.end for p in pieces] == pytest.approx([*(p.start for p in pieces[1:]), 26.7])
    assert [c.inner for c in zone.castings] == [False, False, True, True, True, False, False]
    assert [p.rail.mass / TRACK.rail.mass for p in pieces] == pytest.approx([1.0, *[2.2] * 5, 1.0])


def test_each_piece_has_its_own_bending_stiffness_and_mass_and_ends_are_less_certain(zone):
    spreads, known = rail_sds(zone), {n.name: n.sd for n in track_nuisances(zone, ())}
    assert list(spreads)[:2] == [name for name, _ in RAIL_SDS] and len(spreads) == 2 + 2 * 7
    assert {name: known[name] for name in spreads} == spreads
    assert spreads["cast_mass_0"] == dict((n, e) for n, _, e in CASTING_SDS)["cast_mass"] > spreads["cast_mass_3"]


def test_the_meaning_of_a_piece_states_its_position(zone):
    meanings = {n.name: n.meaning for n in track_nuisances(zone, ())}
    assert meanings["cast_mass_0"] == "ln mass of the rail from 22.7 to 23.0 m"
    assert meanings["cast_bending_3"] == "ln bending stiffness of the rail from 24.2 to 25.2 m"
    assert meanings["rail_shear"] == "ln shear stiffness of the rail"


def test_a_piece_changes_its_own_rail_and_no_other(zone):
    """The fourth piece has 1.5 times the mass and 1.2 times the stiffness, all rails 1.1 times the stiffness.
    Compared there, beside it, on the other route, and far away, where only the common factor acts."""
    values = dict.fromkeys(rail_sds(zone), 0.0)
    values |= {"cast_mass_3": np.log(1.5), "cast_bending_3": np.log(1.2), "rail_bending": np.log(1.1)}
    changed = with_rail(zone, values).turnout
    there, beside = (changed.track.rail_at(x) for x in (24.7, 24.0))
    assert there.mass == pytest.approx(1.5 * HEAVY.mass) and beside.mass == HEAVY.mass
    assert there.bending_stiffness == pytest.approx(1.1 * 1.2 * HEAVY.bending_stiffness)
    assert beside.bending_stiffness == pytest.approx(1.1 * HEAVY.bending_stiffness)
    for x, rail in ((24.7, TRACK.rail), (3.0, HEAVY)):
        other = changed.tracks["diverging"].rail_at(x)
        assert (other.mass, other.bending_stiffness) == pytest.approx((rail.mass, 1.1 * rail.bending_stiffness))


@pytest.mark.parametrize(
    "ends",
    [[(24.0, 24.15)], [(22.0, 24.1), (24.3, 26.0)], [(22.0, 26.0), (23.5, 24.5)], [(22.0, 24.5), (24.0, 26.0)],
     [(22.0, 24.0), (24.0, 25.0)], [(24.0, 24.6)], [(18.0, 30.0)]],
)  # fmt: skip
def test_without_any_change_the_track_is_that_of_the_file(ends):
    """Element by element: joints of one element, stretches that nearly meet, lie in one another, overlap, abut."""
    rails = [replace(HEAVY, mass=HEAVY.mass * (1.0 + 0.1 * k)) for k in range(len(ends))]
    track = TRACK.with_(stretches=tuple(RailStretch(a, b, r) for (a, b), r in zip(ends, rails)))
    zone = zone_of(replace(PLAN.turnout, track=track, tracks={"main": track}), [21.0, 27.3])
    same = with_rail(zone, dict.fromkeys(rail_sds(zone), 0.0)).turnout.track
    x = np.arange(20.0, 29.0, 0.025) + 0.0125
    assert zone.castings and [same.rail_at(v) for v in x] == [track.rail_at(v) for v in x]
    node = np.arange(16.0, 32.0, 0.15)
    covered = np.zeros(node.size - 1)
    for element, share in casting_elements(zone, node):
        covered[element] += share
    assert covered.max() < 1.0 + 1e-9
    assert covered @ np.diff(node) == pytest.approx(sum(c.piece.end - c.piece.start for c in zone.castings))


def test_castings_are_those_of_the_track_on_which_impacts_are_modelled():
    cast = TRACK.with_(stretches=(NOSE,))
    turnout = replace(PLAN.turnout, track=TRACK, tracks={"diverging": TRACK, "main": cast})
    assert zone_of(turnout, [21.0, 27.3]).castings
    assert not zone_of(replace(turnout, track=cast, tracks={"diverging": cast, "main": TRACK}), [21.0, 27.3]).castings


def test_both_ends_of_a_casting_that_leaves_the_measured_range_have_values_of_their_own():
    """It ends 5 m behind the last sensor. Another one begins 7 m before the first."""
    long, away = RailStretch(25.0, 32.3, HEAVY), RailStretch(5.0, 14.0, HEAVY)
    cast = TRACK.with_(stretches=(away, long))
    pieces = zone_of(replace(PLAN.turnout, track=cast, tracks={"main": cast}), [21.0, 27.3]).castings
    assert [(c.piece.start, c.piece.end, c.inner) for c in pieces][-2:] == [
        pytest.approx((32.0, 32.3, False)), pytest.approx((32.3, 32.6, False)),
    ]  # fmt: skip
    assert {c.stretch for c in pieces} == {long} and pieces[0].piece.start == pytest.approx(24.7)


def test_the_end_of_a_casting_almost_five_metres_away_matters_more_than_the_farthest_pad_with_a_value_of_its_own():
    """A section that grows over 0.6 m reflects less than a step. A pad 1.8 m away is 15 % stiffer."""
    frequency = np.arange(300.0, 800.0, 10.0)
    beams = [
        replace(TRACK.rail, bending_stiffness=(1.0 + 0.7 * share) * TRACK.rail.bending_stiffness,
                mass=(1.0 + 1.2 * share) * TRACK.rail.mass)
        for share in np.arange(0.95, 0.0, -0.1)
    ]  # fmt: skip
    ramp = tuple(RailStretch(32.0 + 0.06 * k, 32.06 + 0.06 * k, beam) for k, beam in enumerate(beams))
    step = TRACK.with_(stretches=(RailStretch(25.0, 32.3, HEAVY),))
    grown = TRACK.with_(stretches=(RailStretch(25.0, 32.0, HEAVY), *ramp))
    pads = np.where(np.abs(TRACK.support - 29.4) < 1e-6, 1.15, 1.0) * TRACK.pad_stiffness

    def change(one, other):
        h = [receptance(assemble(track), frequency, 27.6, 27.3) for track in (one, other)]
        return np.sqrt(np.mean(np.abs(h[1] / h[0] - 1.0) ** 2))

    assert np.count_nonzero(pads != TRACK.pad_stiffness) == 1
    assert change(step, grown) > change(TRACK, TRACK.with_(pad_stiffness=pads))


def test_plain_track_has_no_castings():
    plain = zone_of(PLAN.turnout, [21.0, 27.3])
    assert plain.castings == () and rail_sds(plain) == dict(RAIL_SDS)
