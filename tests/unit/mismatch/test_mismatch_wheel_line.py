"""Linear responses in a switch: the rail and the surface that carry each wheel."""

from collections import OrderedDict
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.constants import GRAVITY
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout.passage_observation import with_chatter
from turnout.mismatch.turnout.priors import SIMULATION
from turnout.mismatch.turnout.sensitivity import _difference
from turnout.mismatch.turnout.track_under_wheels import TrackUnderWheels
from turnout.mismatch.turnout.wheel_line import load_transfer, static_compliances
from turnout.physics import HangingSleeper, SensorGain
from turnout.simulate.blade import Blade, transfer_position
from turnout.simulate.frequency_response import receptance
from turnout.simulate.matrices import assemble
from turnout.simulate.preparation import prepare
from turnout.simulate.run import Drive, run
from turnout.simulate.track import uniform_track
from turnout.simulate.vehicle import lone_wheels
from turnout.simulate.wheel_path import BladeTop, StockFall

TRACK = uniform_track(30.0, elements_per_bay=2)
BLADE = Blade(9.0, 15.0, 24.0, TRACK.rail, 3e8, 3e4)
SURFACES = ((StockFall(10.5, 3.0, 0.02),), (BladeTop(9.0, 3.0, 0.015),))
FREQUENCY = np.linspace(20.0, 112.0, 8)
MASS = 6000.0  # kg on a wheel


@pytest.fixture(scope="module")
def change():
    return load_transfer(assemble(TRACK.with_(blade=BLADE)), BLADE, SURFACES, lone_wheels(MASS))


def test_a_slow_wheel_changes_to_the_blade_over_the_stated_distance(change, monkeypatch):
    """At walking pace, over chairs that do not open, with the nonlinear contact and the deflection of both rails."""
    monkeypatch.setattr(Blade, "ports", lambda *_: [])
    prepared = prepare(TRACK.with_(blade=BLADE), 5e-4)
    outcome = run(prepared, 1.0, vehicle=lone_wheels(MASS), drive=Drive(10.3, 2.0, surfaces=SURFACES))
    x, (stock, blade) = 10.3 + 2.0 * outcome.time, outcome.surface_force[0]
    both = x[(stock > 0.0) & (blade > 0.0)]
    assert both[0] == pytest.approx(change.start, abs=0.01)
    assert both[-1] == pytest.approx(change.end, abs=0.01)
    assert change.end - change.start > 0.04
    middle = np.interp(0.5 * MASS * GRAVITY, blade[(x > both[0]) & (x < both[-1])], both[1:-1])
    assert middle == pytest.approx(0.5 * (change.start + change.end), abs=0.01)


def test_a_force_between_both_rails_is_shared_by_their_flexibility(change):
    """Two springs: the stiffer side takes more. A pair of opposite forces opens both rails and both contacts."""
    matrices = assemble(TRACK.with_(blade=BLADE))
    stock, cross, blade = static_compliances(matrices, transfer_position(SURFACES, BLADE))
    contact = 1.0 / lone_wheels(MASS).wheel_values("contact")[0].tangent(0.5 * MASS * GRAVITY)
    assert change.flexibility == pytest.approx(stock + blade - 2.0 * cross + 2.0 * contact)
    moved = change.share * (blade + contact) + (1.0 - change.share) * cross
    assert moved == pytest.approx(change.share * cross + (1.0 - change.share) * (stock + contact))  # both move alike


def test_the_weight_of_the_blade_rises_over_the_change(change):
    x = np.array([change.start - 0.01, 0.5 * (change.start + change.end), change.end + 0.01])
    assert change.blade_weight(x) == pytest.approx([0.0, change.share, 1.0])
    grid = np.arange(5.0, 20.0, 0.6)
    averaged = change.mean_blade_weight(grid, 0.6)
    integral = (change.end - change.start) * change.share + grid[-1] - change.end
    assert 0.6 * (averaged.sum() - 0.5 * averaged[-1]) == pytest.approx(integral, abs=0.015)


def test_a_wave_acts_on_the_stock_rail_before_the_change_and_on_the_blade_behind_it(change):
    matrices = assemble(TRACK.with_(blade=BLADE))
    near = np.flatnonzero((matrices.node > 8.0) & (matrices.node < 16.0))
    near = near[near[0] % 2 :: 2]
    track = SimpleNamespace(matrices=matrices, load_transfer=change, positions=[12.6])
    h, about = TrackUnderWheels._receptances_under_wheels(track, FREQUENCY, near)
    nodes = matrices.node[near]
    before, behind = int(np.searchsorted(nodes, change.start)) - 2, int(np.searchsorted(nodes, change.end)) + 1
    assert h[:, 0, before] == pytest.approx(receptance(matrices, FREQUENCY, float(nodes[before]), 12.6), rel=1e-6)
    name = ("blade", *divmod(int(near[behind]), 2))
    on_blade = receptance(matrices, FREQUENCY, name, 12.6)
    assert h[:, 0, behind] == pytest.approx(on_blade, rel=1e-6)
    on_rail = receptance(matrices, FREQUENCY, float(nodes[behind]), 12.6)
    assert np.max(np.abs(on_blade / on_rail - 1.0)) > 0.05
    assert about[:, behind + 2] == pytest.approx(receptance(matrices, FREQUENCY, name, name), rel=0.15)


def test_all_wheels_are_on_the_rail_without_a_top_of_the_blade():
    matrices = assemble(TRACK.with_(blade=BLADE))
    assert load_transfer(matrices, BLADE, SURFACES[:1], lone_wheels(MASS)) is None
    assert load_transfer(assemble(TRACK), None, SURFACES, lone_wheels(MASS)) is None


def quotient(predictor, moved, terms=(), load=1.0, step=0.1):
    """Whether a quotient by a load is simulated at a ballast stiffness that has ``moved``."""
    aligned = SimpleNamespace(name="a passage", train="a train", passage=SimpleNamespace(load_sd=0.05, route="main"))
    before = len(predictor.values_seen)
    values = {"load": 1.0, "ballast_stiffness": moved, "load@a passage": load}
    column = _difference(predictor, values, terms, aligned, np.array([1.0]), "load", 0.1)
    assert column == pytest.approx(2.0 + step)
    return len(predictor.values_seen) > before


def quotients(surfaces=()):
    """A predictor whose only passage is the square of its load."""
    values_seen = []

    def predict_passage(values, terms, aligned, with_probes):
        values_seen.append(values["load"])
        return np.array([values["load"] ** 2])

    return SimpleNamespace(
        predict_passage=predict_passage, differences=OrderedDict(), values_seen=values_seen,
        site=SimpleNamespace(common_sds={"ballast_stiffness": 0.25}, support_sds={"ballast_3": 0.2}),
        waves=SimpleNamespace(names=("cos_wave_9",), sd=np.array([1e-5])),
        surface=SimpleNamespace(turnout=SimpleNamespace(surfaces=lambda route: surfaces)),
    )  # fmt: skip


@pytest.mark.parametrize(("surfaces", "simulated"), [(SURFACES, [True, False]), (SURFACES[:1], [True, True])])
def test_in_a_switch_a_quotient_is_reused_until_common_values_have_changed(surfaces, simulated):
    """The load of the passage has changed by four prior sd. Steps are larger in a switch, where contacts open and
    close."""
    predictor, step = quotients(surfaces), 0.1 if all(simulated) else 0.1 * SIMULATION.switch_step_factor
    assert [quotient(predictor, 0.0, load=load, step=step) for load in (1.0, 1.2)] == simulated


def test_a_quotient_is_reused_until_a_value_has_changed():
    """By 0, 0.4, 0.8 and 0.6 of its prior standard deviation: the last is near the one before."""
    predictor = quotients()
    assert [quotient(predictor, moved) for moved in (0.0, 0.1, 0.2, 0.15)] == [True, False, True, False]


def test_a_quotient_with_an_effect_is_reused_until_its_size_has_changed_by_a_fifth():
    predictor, gaps = quotients(), (3e-4, 3.5e-4, 4e-4)
    assert quotient(predictor, 0.0)
    assert [quotient(predictor, 0.0, (HangingSleeper(5, gap),)) for gap in gaps] == [True, False, True]
    assert quotient(predictor, 0.0, (HangingSleeper(6, 4e-4),))  # of another sleeper
    assert [quotient(predictor, 0.0, (SensorGain("A", gain),)) for gain in (1.1, 1.1, 1.11)] == [True, False, True]


@pytest.mark.parametrize(
    ("name", "value", "small", "large"),
    [
        ("load", "ballast_3", 0.09, 0.11),  # of a support: half of 0.2
        ("load", "time@a passage", 0.14e-3, 0.16e-3),  # a tenth of 1.5 ms
        ("load", "speed@a passage", 3.9e-4, 4.1e-4),  # a tenth of 0.4 %
        ("wheels_a train", "cos_wave_9", 4.9e-6, 5.1e-6),  # half of 10 um, for the mass of a wheel alone
    ],
)
def test_a_quotient_is_reused_until_a_support_the_clock_or_a_wave_has_changed(name, value, small, large):
    aligned = SimpleNamespace(name="a passage", train="a train", passage=SimpleNamespace(load_sd=0.05, route="main"))
    for moved, is_simulated in ((small, False), (large, True)):
        predictor = quotients()
        for size in (0.0, moved):
            values = {"load": 1.0, name: 1.0, value: size}
            _difference(predictor, values, (), aligned, np.array([1.0]), name, 0.1)
        assert (len(predictor.values_seen) == 2) is is_simulated


def test_a_sample_in_a_switch_has_an_error_of_a_tenth_of_its_channel():
    """Also for samples of 0, since the blade vibrates after a wheel."""
    rows = np.array([[0.0, 3.0, 4.0, 0.0], [0.0, 0.3, 0.4, 0.0]])
    plain = Observation("a", "a", rows.ravel(), 0.2, rows=2)
    rms = np.array([2.5, 2.5, 2.5, 2.5, 0.25, 0.25, 0.25, 0.25])
    assert with_chatter(plain).sigma == pytest.approx(np.hypot(0.2, 0.1 * rms))
    assert with_chatter(plain).data == pytest.approx(plain.data)
