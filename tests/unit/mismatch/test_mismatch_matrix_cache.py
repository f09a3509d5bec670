"""Matrices from a stored skeleton equal those of a full assembly."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout import physics
from turnout.mismatch.turnout import matrix_cache
from turnout.mismatch.turnout.matrix_cache import matrices_of
from turnout.mismatch.turnout.receptance_model import ReceptanceModel
from turnout.mismatch.turnout.receptance_sensitivity import ReceptanceSensitivity
from turnout.mismatch.turnout.track_parameters import COMMON_PARAMETERS, SUPPORT_PARAMETERS
from turnout.mismatch.turnout.zone import castings_of
from turnout.simulate import uniform_track
from turnout.simulate.blade import Blade
from turnout.simulate.matrices import assemble
from turnout.simulate.track import RailStretch

TERMS = [
    (),
    (physics.ZenerPad(0.5),),
    (physics.RailShear(2.0), physics.LocalPad(20, 3.0)),
    (physics.AttachedResonator(20, 30.0, 200.0),),
    (physics.SleeperMode(0.3, 200.0), physics.PadTemperature(0.01)),
]


@pytest.mark.parametrize("terms", TERMS, ids=lambda terms: "+".join(t.name for t in terms) or "none")
def test_matrices_from_a_skeleton_equal_the_assembled_ones(terms):
    rng, track = np.random.default_rng(1), uniform_track(24.0)
    for _ in range(2):  # the second time the skeleton is stored
        n = track.support.size
        other = track.with_(
            pad_stiffness=track.pad_stiffness * np.exp(0.1 * rng.normal(size=n)),
            ballast_damping=track.ballast_damping * np.exp(0.1 * rng.normal(size=n)),
            sleeper_mass=1.1 * track.sleeper_mass,
        )
        full, filled = assemble(other, terms), matrices_of(other, terms)
        assert filled.index == full.index
        for name in ("mass", "damping", "stiffness", "hysteresis"):
            a, b = getattr(full, name), getattr(filled, name)
            assert b == pytest.approx(a, rel=1e-9, abs=1e-9 * np.abs(a).max())


def test_matrices_do_not_depend_on_the_track_that_made_the_skeleton():
    """Bit for bit, since an interrupted diagnosis needs the same tracks in another order."""
    rng, track = np.random.default_rng(4), uniform_track(24.0)
    n = track.support.size
    one, other = (track.with_(pad_stiffness=track.pad_stiffness * np.exp(0.3 * rng.normal(size=n))) for _ in range(2))
    found = []
    for first in (one, other):
        matrix_cache._templates.clear()
        matrices_of(first)
        found.append(matrices_of(one).stiffness)
    assert np.array_equal(*found)


@pytest.mark.parametrize("terms", [(), (physics.HeelSupport(22, 23, 0.3),)], ids=["none", "heel"])
def test_tracks_that_differ_in_chairs_and_toe_share_a_skeleton(terms):
    """The toe is between the supports at 6.6 and 7.2 m; nearer than a tenth of a bay it would be on a support."""
    track = uniform_track(24.0)
    matrix_cache._templates.clear()
    for toe, stiffness, damping in ((6.7, 3e8, 3e4), (6.73, 2e8, 5e4), (6.7, 2e8, 5e4)):
        blade = Blade(toe, 13.0, 18.0, track.rail, stiffness, damping, 2.0, 0.5)
        full, filled = (f(track.with_(blade=blade), terms) for f in (assemble, matrices_of))
        assert filled.index == full.index
        for name in ("mass", "damping", "stiffness"):
            a, b = getattr(full, name), getattr(filled, name)
            assert b == pytest.approx(a, rel=1e-9, abs=1e-9 * np.abs(a).max())
        assert filled.blade_rails == full.blade_rails and np.array_equal(filled.node, full.node)
    assert len(matrix_cache._templates) == 1


@pytest.mark.parametrize("first", [0, 1, 2, 3])
def test_blades_with_equal_nodes_and_other_heel_rail_or_direction_are_distinguished(first):
    """In all orders: matrices of one blade must not be used for another."""
    track = uniform_track(24.0)
    light = replace(track.rail, mass=0.7 * track.rail.mass)
    ends = (6.6, 13.2, 18.0, track.rail), (6.6, 10.2, 18.0, track.rail), (18.0, 13.2, 6.6, track.rail)
    blades = [Blade(*of_blade, 3e8, 3e4, 2.0, 0.5) for of_blade in (*ends, (6.6, 13.2, 18.0, light))]
    matrix_cache._templates.clear()
    for blade in (blades[first], *blades):
        full, filled = (f(track.with_(blade=blade)) for f in (assemble, matrices_of))
        assert filled.index == full.index and filled.blade_rails == full.blade_rails
        for name in ("mass", "damping", "stiffness"):
            a, b = getattr(full, name), getattr(filled, name)
            assert b == pytest.approx(a, rel=1e-9, abs=1e-9 * np.abs(a).max())


PAIR = SimpleNamespace(test=SimpleNamespace(place=10.7), seat=("S", 11.0))


def sensitivity_of(model, seat):
    """Of two impacts and a shifted sensor, not all of them paired, to detect confused pairs."""
    first, second = ("S", 8.0), ("S", 11.0)
    pairs = (9.1, first), (10.7, first), (10.7, second)
    zone = SimpleNamespace(first=18, last=19, castings=castings_of(model.track, 9.95, 11.4))
    return ReceptanceSensitivity(model, pairs, {first: 8.8, second: seat}, zone)


FOLLOWING = [
    physics.LocalBallast(18, 0.3),
    physics.LocalPad(19, 2.5),
    physics.HangingSleeper(19, 5e-4),
    physics.HangingSleeper(19, 5e-4, 0.4),
    physics.ZenerPad(0.8),
    physics.SleeperMode(0.3, 250.0),
    physics.PadTemperature(0.012).under_conditions({"rail_temperature": 35.0}),
]


@pytest.mark.parametrize("term", FOLLOWING, ids=lambda term: repr(term)[:30])
def test_derivatives_by_supports_include_terms_that_depend_on_them(term):
    """Against differences of the receptance: a free sleeper's ballast, a share of soft ballast, a pad's branch."""
    rng, track = np.random.default_rng(2), uniform_track(24.0)
    own = {o.field: np.exp(0.2 * rng.normal(size=track.support.size)) for o in SUPPORT_PARAMETERS}
    track = track.with_(**{field: getattr(track, field) * by for field, by in own.items()})
    found = sensitivity_of(ReceptanceModel(track, (term,)), 11.6).gradient(PAIR)
    size = np.abs(found).max(axis=0).max()

    def changed(field, where, step):
        by = np.ones(track.support.size)
        by[where] = np.exp(step)
        return ReceptanceModel(track.with_(**{field: getattr(track, field) * by}), (term,)).receptance(10.7, 11.6)

    columns = [(name, slice(None)) for name, *_ in COMMON_PARAMETERS] + [
        (o.field, j) for o in SUPPORT_PARAMETERS for j in (18, 19)
    ]
    for k, at in enumerate(columns):
        difference = (changed(*at, 1e-4) - changed(*at, -1e-4)) / 2e-4
        assert found[:, k] == pytest.approx(difference, rel=3e-3, abs=1e-5 * size), at  # the first order of SHARE


@pytest.mark.parametrize("name", ["bending_stiffness", "shear_stiffness"])
def test_the_derivative_of_the_rail_is_that_of_a_slightly_stiffer_rail(name):
    """Closed form by two modes of each element against differences of full solutions, to 1.5 %: the consistent mass
    depends on the share of shear. Impact and sensor at different positions, supports uneven."""
    rng, track = np.random.default_rng(3), uniform_track(24.0)
    track = track.with_(pad_stiffness=track.pad_stiffness * np.exp(0.2 * rng.normal(size=track.support.size)))

    def receptance(more):
        rail = replace(track.rail, **{name: getattr(track.rail, name) * np.exp(more)})
        return ReceptanceModel(track.with_(rail=rail), ()).receptance(10.7, 12.3)

    found = sensitivity_of(ReceptanceModel(track, ()), 12.3).rail_gradient(PAIR)[
        :, ("bending_stiffness", "shear_stiffness").index(name)
    ]
    exact = (receptance(1e-3) - receptance(-1e-3)) / 2e-3
    assert np.linalg.norm(found - exact) < 0.015 * np.linalg.norm(exact)


@pytest.mark.parametrize("name", ["bending_stiffness", "mass"])
def test_the_derivative_of_a_casting_is_that_of_a_slightly_changed_one(name):
    """For every piece of a casting of 3 m whose ends lie within elements, and for half a bay beyond the ends:
    differences of full solutions; the error is 0.2 %. A casting beyond the zone has no pieces; where a term has another
    rail a piece has no effect."""
    rng, track = np.random.default_rng(4), uniform_track(24.0)
    track = track.with_(pad_stiffness=track.pad_stiffness * np.exp(0.2 * rng.normal(size=track.support.size)))
    cast = replace(track.rail, bending_stiffness=1.8 * track.rail.bending_stiffness, mass=2.5 * track.rail.mass)
    track = track.with_(stretches=(RailStretch(2.0, 4.0, cast), RailStretch(10.27, 13.17, cast)))
    found = sensitivity_of(ReceptanceModel(track, ()), 12.3).rail_gradient(PAIR)
    pieces = castings_of(track, 9.98, 11.4)
    assert [c.inner for c in pieces] == [False, False, True, True]  # of seven, those that reach into the zone
    for k, c in enumerate(pieces):

        def receptance(more, c=c):
            rail = replace(c.piece.rail, **{name: getattr(c.piece.rail, name) * np.exp(more)})
            other = track.with_(stretches=(*track.stretches, replace(c.piece, rail=rail)))
            return ReceptanceModel(other, ()).receptance(10.7, 12.3)

        exact = (receptance(1e-3) - receptance(-1e-3)) / 2e-3
        column = found[:, 2 + 2 * k + ("bending_stiffness", "mass").index(name)]
        assert np.linalg.norm(column - exact) < 0.005 * np.linalg.norm(exact)
    over = ReceptanceModel(track, (physics.RailBending(9.5, 12.5, 1.3),))
    assert np.all(sensitivity_of(over, 12.3).rail_gradient(PAIR)[:, 2:][:, 2:] == 0.0)


@pytest.mark.parametrize("cast", [False, True])
def test_the_derivative_by_shear_is_a_share_for_a_rail_that_a_term_softens(cast):
    """Derivative by the shear stiffness of the file, with that of castings, beside a term of equal flexibility, against
    differences."""
    track, term = uniform_track(24.0), (physics.RailShear(4.0),)
    rail = track.rail
    heavy = replace(rail, mass=2.5 * rail.mass, shear_stiffness=2.5 * rail.shear_stiffness)
    track = track.with_(stretches=(RailStretch(10.2, 13.2, heavy),) if cast else ())

    def receptance(more):
        def stiffer(rail):
            return replace(rail, shear_stiffness=rail.shear_stiffness * np.exp(more))

        stretches = tuple(replace(s, rail=stiffer(s.rail)) for s in track.stretches)
        return ReceptanceModel(track.with_(rail=stiffer(rail), stretches=stretches), term).receptance(10.7, 12.3)

    found = sensitivity_of(ReceptanceModel(track, term), 12.3).rail_gradient(PAIR)[:, 1]
    exact = (receptance(1e-3) - receptance(-1e-3)) / 2e-3
    assert np.linalg.norm(found - exact) < 0.015 * np.linalg.norm(exact)
