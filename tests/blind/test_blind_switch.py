"""Switch panels of the blind generator: its second rail against the library's, its files, its effects."""

from dataclasses import replace

import numpy as np
import pytest
from tests.oracles.uniform_world import uniform_world

import turnout_blind.switch as module
from turnout.config.load import load_configuration
from turnout.config.parameter_files import read_parameters
from turnout.mismatch.turnout.passage_band import limit_band, read_at
from turnout.simulate.blade import Blade, transfer_position
from turnout.simulate.preparation import prepare
from turnout.simulate.rail import Rail
from turnout.simulate.run import Drive, Probe, run
from turnout.simulate.track import Track
from turnout.simulate.track_file import turnout_track
from turnout.simulate.vehicle import car
from turnout_blind import vehicle
from turnout_blind.effect import load_effects
from turnout_blind.grid import Grid
from turnout_blind.grid import Rail as GridRail
from turnout_blind.history import SWITCH_EFFECTS, HistoryPlan, make_history, plan_histories
from turnout_blind.march import TIME_STEP
from turnout_blind.nominal_files import track, write_configuration
from turnout_blind.run import simulate_impacts, simulate_passage
from turnout_blind.site import PLAIN, SWITCH, draw_site
from turnout_blind.strata import plan_cases
from turnout_blind.switch import Switch, TrueBlade

GEOMETRY = Switch(2.2, 8.1, 0.015, 2.5, 2.7, 0.012, 4.6, 3e8, 2e4)
SUPPORTS = {"pad": 2.5e8, "pad_damping": 2e4, "mass": 190.0, "ballast": 9e7, "ballast_damping": 6e4}
SPEED, SENSORS, LEAD = 30.0, (2.4, 4.5, 6.6, 8.7), 0.3


class Top:
    """A top of the generator as a surface of the library."""

    def __init__(self, top, on_blade):
        self.top, self.on_blade = top, on_blade

    def __call__(self, x, wheel=0):
        return self.top(np.asarray(x, float))


@pytest.fixture(scope="module")
def wheel_forces():
    """Force of the first wheel along the switch by both codes, and the signals of the sensors.

    (position [m], generator [N], library [N]), then (generator, library with the section of the generator, library with
    its mean section all along) [m/s²].
    """
    rail, c = Rail(6.378e6, 60.2, 2.435e8, 0.2384, 4000.0), vehicle.RAILCAR
    world = uniform_world(length=96.0, rail=GridRail(damping=4000.0), **SUPPORTS)
    under = np.flatnonzero(world.position > GEOMETRY.toe + 0.2)
    gap = np.where(world.position[under] < GEOMETRY.heel, 0.0, -1.0)
    chairs = np.full(under.size, GEOMETRY.chair), np.full(under.size, GEOMETRY.chair_damping)
    world.blade = TrueBlade(GEOMETRY, under, *chairs, gap)
    train = vehicle.Train("railcar", (c,), 0.43, 9.3e10)
    acceleration, force, _ = simulate_passage(world, train, SPEED, SENSORS, 0.8, LEAD)
    values = [SUPPORTS[name] for name in ("pad", "pad_damping", "mass", "ballast", "ballast_damping")]
    chair = GEOMETRY.chair, GEOMETRY.chair_damping
    planed = Blade(GEOMETRY.toe, GEOMETRY.heel, 36.0, rail, *chair, GEOMETRY.length, module.PLANED_SHARE)
    average = replace(rail, bending_stiffness=0.85 * rail.bending_stiffness, mass=0.85 * rail.mass)
    uniform = Blade(GEOMETRY.toe, GEOMETRY.heel, 36.0, average, *chair)
    library = Track(rail, world.position, *values, end_length=9.0, end_damping=400.0, blade=planed)
    half = car(
        body_mass=0.5 * c.body, body_inertia=0.5 * c.body_inertia, bogie_mass=0.5 * c.bogie,
        bogie_inertia=0.5 * c.bogie_inertia, wheel_mass=0.5 * c.wheelset,
        primary=(0.5 * c.primary, 0.5 * c.primary_damping), half_base=0.5 * c.base, half_pivot=0.5 * c.pivots,
        secondary=(0.5 * c.secondary, 0.5 * c.secondary_damping),
    )  # fmt: skip
    surfaces = ((Top(GEOMETRY.stock_top, False),), (Top(GEOMETRY.blade_top, True),))
    drive, probes = Drive(SENSORS[0] - SPEED * LEAD, SPEED, surfaces=surfaces), [Probe(x) for x in SENSORS]
    outcomes = [run(prepare(library.with_(blade=b), 5e-5), 0.8, probes, half, drive) for b in (planed, uniform)]
    time = np.arange(force.shape[1]) * 1e-3
    mean = np.convolve(outcomes[0].force[0], np.ones(20) / 20.0, "same")
    forces = SENSORS[0] + SPEED * (time - LEAD), force[0], np.interp(time, outcomes[0].time, mean)
    grid = np.arange(0.2, 0.75, 1.0 / 600.0)
    recorded = read_at(limit_band(acceleration, 1.0 / TIME_STEP, high=75.0), 1.0 / TIME_STEP, grid)
    simulated = [read_at(limit_band(o.signals, 2e4, high=75.0), 2e4, grid) for o in outcomes]
    return forces, (recorded, *simulated)


def test_both_codes_agree_on_the_change_of_the_wheel_to_the_blade(wheel_forces):
    """Finite differences and elements, explicit and implicit: the force over 15 cm within 4 % of the load."""
    x, generator, library = wheel_forces[0]
    smooth = [np.convolve(f, np.ones(5) / 5.0, "same") for f in (generator, library)]
    inside = (x > 1.5) & (x < 11.0)
    difference = np.abs(smooth[0] - smooth[1])[inside]
    assert np.ptp(smooth[1][inside]) > 8e3, "the change must show"
    assert difference.max() < 0.04 * 57e3
    assert abs(np.mean(generator[inside]) / np.mean(library[inside]) - 1.0) < 0.005


def test_signals_behind_the_change_need_the_section_of_the_blade(wheel_forces):
    """The stock rail is hardly loaded there: with a mean section of the blade, its motion is wrong by up to 40 %."""
    recorded, planed, uniform = wheel_forces[1]

    def errors(simulated):
        return np.sqrt(np.mean((simulated - recorded) ** 2, axis=1) / np.mean(recorded**2, axis=1))

    assert np.all(errors(planed)[1:] < 0.25)  # the blade ends before the last sensor; 0.04, 0.12, 0.21
    assert np.all(errors(uniform)[1:] > 1.6 * errors(planed)[1:])


def test_the_file_of_the_owner_has_the_blade_and_both_tops(tmp_path):
    site = draw_site(np.random.default_rng(3), panel=SWITCH)
    path = tmp_path / "site.yaml"
    path.write_text(track(site))
    turnout = turnout_track(read_parameters(path))
    blade = turnout.track.blade
    assert (blade.toe, blade.heel) == pytest.approx((site.switch.toe, site.switch.heel), abs=1e-4)
    transfer = transfer_position(turnout.surfaces("main"), blade)
    assert site.switch.toe < transfer < site.switch.toe + site.switch.length
    chairs = turnout.track.support[blade.slide_chairs(turnout.track)]
    assert np.all((chairs > site.switch.toe - 0.08) & (chairs < site.switch.heel)) and chairs.size >= 7


@pytest.mark.parametrize(("panel", "is_requested"), [(SWITCH, True), (PLAIN, False)])
def test_a_proof_requests_unproven_names_at_switch_panels(tmp_path, panel, is_requested):
    write_configuration(tmp_path, "t", draw_site(np.random.default_rng(3), panel=panel))
    assert load_configuration(tmp_path).turnout("t").settings["mismatch"].unproven_names is is_requested


@pytest.mark.parametrize("kind", ["chair_gap", "heel", "toe"])
def test_an_effect_of_the_blade_grows_with_its_rung_and_is_planned_in_switch_panels_alone(kind):
    effects = load_effects()
    assert not any(kind in dict(p.effects) for p in plan_cases(1, effects))
    assert any(kind in dict(p.effects) for p in plan_cases(1, effects, panel=SWITCH))
    changes = []
    for rung in (0, len(effects[kind].ladder) - 1):
        rng = np.random.default_rng(8)
        site = draw_site(rng, panel=SWITCH)
        world = site.world.copy()
        concealed = effects[kind].draw_concealed(rng, site, rung)
        effects[kind].act(world, site, concealed.where, concealed.parameters)
        train = site.true_trains["railcar"]
        a, b = (simulate_passage(w, train, SPEED, SENSORS, 0.8, LEAD)[0] for w in (site.world, world))
        changes.append(np.linalg.norm(a - b) / np.linalg.norm(a))
    assert 0.0 < changes[0] < changes[1]
    assert changes[1] > 0.05


def test_histories_of_switch_panels_have_its_effects_and_grow(tmp_path):
    effects = load_effects()
    plans = plan_histories(5, 40, effects, panel=SWITCH)
    assert {p.panel for p in plans} == {SWITCH}
    assert {p.effect[0] for p in plans if p.effect} == set(SWITCH_EFFECTS)
    plan = HistoryPlan("start", ("chair_gap", 5), (1, 2), SWITCH, n_visits=2)
    truth = make_history(tmp_path, "site", plan, effects)
    assert truth["severities"] == [1.0, 1.0] and truth["visible"][0]["passage_pct"] > 1.0
    assert "slide" not in (tmp_path / "site" / "config" / "tracks" / "site.yaml").read_text()
    assert len([*(tmp_path / "site" / "raw").rglob("passages/*.npz")]) == 2


def test_every_bearer_that_the_file_puts_under_the_blade_has_a_chair_in_the_generator():
    """Formerly a toe less than 0.2 m before a bearer left it without a chair: a defect that the truth did not state."""
    positions, grid = np.arange(-45.0, 57.0, 0.6), Grid(start=-48.0, n=1001)
    rail = Rail(6.378e6, 60.2, 2.435e8, 0.2384, 4000.0)
    values = [SUPPORTS[name] for name in ("pad", "pad_damping", "mass", "ballast", "ballast_damping")]
    plain = Track(rail, positions, *values, end_length=9.0, end_damping=400.0)
    errors = []
    for seed in range(300):
        true, nominal = module.draw_switch(np.random.default_rng(seed), positions, grid)
        errors.append(nominal.toe - true.toe)
        assert 4.4 < true.heel - true.toe < 6.1
        blade = Blade(round(nominal.toe, 5), round(nominal.heel, 5), 36.0, rail, nominal.chair, nominal.chair_damping)
        chairs = blade.chairs(plain.with_(blade=blade))
        behind = np.flatnonzero(positions > true.toe + module.FIRST_CHAIR)
        assert chairs[0] == behind[0], (seed, true.toe)
    # the standard deviation of 300 errors scatters by 4 %
    assert np.std(errors) == pytest.approx(module.TOE_ERROR, rel=0.15) and np.max(np.abs(errors)) <= 0.03 + 1e-9


@pytest.mark.parametrize("seed", range(8))
def test_the_blade_begins_at_the_toe_that_the_truth_states(seed):
    """Formerly it began at the nearest node, up to 5 cm away, and receptances beside it were those of another panel."""
    world = draw_site(np.random.default_rng(seed), panel=SWITCH).world
    first_node = world.grid.start + world.grid.step * world.blade_inputs().start
    assert first_node == pytest.approx(world.blade.switch.toe, abs=1e-9)


def changes_by_open_chairs(toe, toe_of_library):
    """Change of receptances at 1.8 m by chairs that open, from the generator and from the library [m/N].

    Two (3, n_line) arrays from 120 to 480 Hz, for sensors at the impact, 2.1 and 4.5 m behind it.
    """
    geometry, impact, duration = replace(GEOMETRY, toe=toe), 1.8, 0.25
    probes, lines = [Probe(x) for x in (impact, impact + 2.1, impact + 4.5)], np.arange(120.0, 480.0, 5.0)

    def receptances(signals, time, force):
        kernel = np.exp(-2j * np.pi * lines[:, None] * time)
        return -(signals @ kernel.T) / ((kernel @ force) * (2.0 * np.pi * lines) ** 2)

    world = uniform_world(length=96.0, rail=GridRail(damping=4000.0), **SUPPORTS)
    under = np.flatnonzero(world.position > toe + module.FIRST_CHAIR)
    chairs = np.full(under.size, geometry.chair), np.full(under.size, geometry.chair_damping)
    by_generator, by_library = [], []
    for slides in (0.0, -1.0):  # chairs that only press, and chairs that also pull
        gap = np.where(world.position[under] < geometry.heel, slides, -1.0)
        world.blade = TrueBlade(geometry, under, *chairs, gap)
        force, signals, _ = simulate_impacts(world, [p.place for p in probes], impact, [0.005], [0.8], duration)
        time = TIME_STEP * np.arange(force.size)
        by_generator.append(receptances(signals, time, force))
    rail = Rail(6.378e6, 60.2, 2.435e8, 0.2384, 4000.0)
    values = [SUPPORTS[name] for name in ("pad", "pad_damping", "mass", "ballast", "ballast_damping")]
    chair = geometry.chair, geometry.chair_damping
    blade = Blade(toe_of_library, geometry.heel, 36.0, rail, *chair, geometry.length, module.PLANED_SHARE)
    track = Track(rail, world.position, *values, end_length=9.0, end_damping=400.0, blade=blade)
    press = prepare(track, 1e-4)
    for prepared in (press, replace(press, track=track.with_(blade=None))):
        pulses = [(impact, lambda t: np.interp(t, time, force))]
        outcome = run(prepared, duration, probes, pulses=pulses)
        by_library.append(receptances(outcome.signals, outcome.time, np.interp(outcome.time, time, force)))
    return by_generator[0] - by_generator[1], by_library[0] - by_library[1]


@pytest.mark.parametrize("toe", [1.3, 1.5])
def test_both_codes_open_the_chairs_alike_under_an_impact(toe):
    """11 kN beside the toe. The remaining error of 0.08 to 0.24 is that of the grid, as on plain track.

    With a toe 5 cm away it is as large as the change itself: 0.35 to 1.2.
    """
    generator, library = changes_by_open_chairs(toe, toe)
    size = np.linalg.norm(generator, axis=1)
    assert np.all(np.linalg.norm(library - generator, axis=1) < 0.3 * size)
    _, moved = changes_by_open_chairs(toe, toe + 0.05)
    assert np.max(np.linalg.norm(moved - generator, axis=1) / size) > 0.8
