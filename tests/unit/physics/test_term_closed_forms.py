"""Each term against a closed form or a published number."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from turnout import physics
from turnout.mismatch.turnout.receptance_model import tangent_links
from turnout.physics.hypothesis import ContactSite, SupportMotion
from turnout.simulate import car, uniform_track
from turnout.simulate.frequency_response import receptance, responses
from turnout.simulate.matrices import assemble
from turnout.simulate.sensor import Sensor
from turnout.simulate.track import RailStretch
from turnout.simulate.turnout_track import TurnoutTrack

TRACK = uniform_track(24.0)
A = Sensor("A", 12.0)
F = np.array([30.0, 90.0, 240.0, 600.0])


def effect_of_one_link(stiffness, row_a, row_b=None):
    """Sherman-Morrison: receptance at 12 m after one link of complex stiffness (n,) is added to the base track."""
    matrices = assemble(TRACK)
    place, index = 12.0, matrices.index
    u = responses(matrices, F, [place])[:, 0]
    reach_u = u[:, index[row_a]] - (u[:, index[row_b]] if row_b else 0.0)
    own = responses(matrices, F, [row_a])[:, 0]
    other = responses(matrices, F, [row_b])[:, 0] if row_b else 0.0 * own
    v = own - other
    compliance = v[:, index[row_a]] - (v[:, index[row_b]] if row_b else 0.0)
    base = receptance(matrices, F, place, place)
    return base - stiffness * reach_u**2 / (1.0 + stiffness * compliance)


def with_term(term):
    return receptance(assemble(TRACK, (term,)), F, 12.0, 12.0)


def test_local_ballast_is_a_rank_one_change():
    omega = 2j * np.pi * F
    expected = effect_of_one_link(-0.7 * 90e6 + omega * (0.3**0.5 - 1.0) * 80e3, ("sleeper", 20))
    assert np.allclose(with_term(physics.LocalBallast(20, 0.3)), expected, atol=0.0, rtol=1e-9)


def test_local_pad_is_a_rank_one_change():
    omega = 2j * np.pi * F
    expected = effect_of_one_link(2.0 * 300e6 + omega * (3.0**0.5 - 1.0) * 30e3, ("rail", 20), ("sleeper", 20))
    assert np.allclose(with_term(physics.LocalPad(20, 3.0)), expected, atol=0.0, rtol=1e-9)


def test_a_resonator_on_the_rail_is_den_hartogs_auxiliary_mass():
    term = physics.AttachedResonator(20, 25.0, 180.0, 0.05)
    expected = effect_of_one_link(term.dynamic_stiffness(F), ("rail", 20))
    assert np.allclose(with_term(term), expected, atol=0.0, rtol=1e-9)


def test_a_resonator_in_the_middle_of_a_bay_acts_there():
    term = physics.AttachedResonator(20, 25.0, 180.0, 0.05, beyond=0.5)
    middle = ("rail", 20, TRACK.elements_per_bay // 2)
    expected = effect_of_one_link(term.dynamic_stiffness(F), middle)
    assert np.allclose(with_term(term), expected, atol=0.0, rtol=1e-9)
    assert [ends for ends, _ in term.condensed_links(TRACK, F)] == [((middle, 1.0),)]
    assert "between sleepers 20 and 21" in term.sentence()


@pytest.mark.parametrize("elements", [2, 3, 4, 5])
@pytest.mark.parametrize("beyond", [0.0, 0.25, 0.5, 0.75])
def test_a_resonator_anywhere_in_a_bay_is_carried_at_its_position(elements, beyond):
    """The weights of its nodes add up to 1 and have their centre at its position, on every mesh."""
    track = TRACK.with_(elements_per_bay=elements)
    term = physics.AttachedResonator(20, 25.0, 180.0, 0.05, beyond=beyond)
    ((ends, _),) = term.condensed_links(track, F)
    places = {name: 20.0 + (name[1] - 20) + (name[2] if len(name) > 2 else 0) / elements for name, _ in ends}
    assert sum(weight for _, weight in ends) == pytest.approx(1.0, abs=1e-12)
    assert sum(weight * places[name] for name, weight in ends) == pytest.approx(20.0 + beyond, abs=1e-12)
    assert len(ends) == (1 if (beyond * elements) % 1 == 0 else 2)
    assert np.isfinite(receptance(assemble(track, (term,)), F, 12.0, 12.0)).all()


@pytest.mark.parametrize("beyond", [0.0, 0.25])
def test_the_stated_error_of_a_frequency_covers_a_mass_between_two_tested_positions(beyond):
    """A mass of 70 kg at an eighth of a bay, farthest from the quarters that are tested, fitted at both of these."""
    track, at = TRACK.with_(elements_per_bay=8), (10.8, 12.0, 13.2)
    frequency = np.geomspace(80.0, 400.0, 60)

    def responses_of(values, share):
        term = physics.AttachedResonator(20, *values, beyond=share)
        matrices = assemble(track, (term,))
        return np.concatenate([receptance(matrices, frequency, a, b) for a in at for b in at])

    true = responses_of((70.0, 201.0, 0.03), 0.125)

    def residual(values):
        misfit = (responses_of(values, beyond) - true) / np.abs(true)
        return np.concatenate([misfit.real, misfit.imag])

    bounds = ([1.0, 50.0, 0.005], [150.0, 800.0, 0.3])
    fit = least_squares(residual, [70.0, 201.0, 0.03], bounds=bounds, x_scale=[10.0, 10.0, 0.01])
    (share,) = (p.model_error_share for p in physics.AttachedResonator.parameters if p.name == "frequency")
    assert 0.001 < abs(fit.x[1] / 201.0 - 1.0) < 1.96 * share


def test_both_supports_of_a_bay_carry_half_of_a_mass_that_is_fixed_to_the_rail():
    time = np.arange(0.0, 0.2, 1e-4)
    motion = SupportMotion(1e-4 * np.sin(60.0 * time), np.zeros(time.size), 1e4, 300e6, 90e6)
    over, between = (physics.AttachedResonator(20, 25.0, 180.0, beyond=share) for share in (0.0, 0.5))
    assert (list(over.supports), list(between.supports)) == ([20], [20, 21])
    inertia = 25.0 * 60.0**2 * 1e-4 * np.sin(60.0 * time)
    for term in (over, between):
        target, force = term.pseudo_force(motion)
        # central differences of a sine: (60 rad/s * 1e-4 s)^2 / 3 of it; the ends are one-sided
        assert target == "rail"
        assert np.allclose(len(term.supports) * force[2:-2], inertia[2:-2], atol=2e-5 * np.max(inertia), rtol=0.0)


def test_a_zener_pad_on_every_support_is_the_track_with_that_complex_stiffness():
    term = physics.ZenerPad(0.8)
    for k, f in enumerate(F):
        stiffness = term.dynamic_stiffness(TRACK, np.array([f]))[0]
        same = TRACK.with_(pad_stiffness=stiffness.real, pad_damping=stiffness.imag / (2.0 * np.pi * f))
        assert np.isclose(with_term(term)[k], receptance(assemble(same), [f], 12.0, 12.0)[0], atol=0.0, rtol=1e-9)


def test_the_stiffness_of_pads_falls_by_one_percent_per_kelvin():
    term = physics.PadTemperature(0.01).under_conditions({"rail_temperature": 35.0})
    assert np.allclose(
        with_term(term),
        receptance(assemble(TRACK.with_(pad_stiffness=0.8 * 300e6)), F, 12.0, 12.0),
        atol=0.0,
        rtol=1e-9,
    )
    assert physics.PadTemperature(0.01).under_conditions({}).links(TRACK) == []


def test_pads_under_a_train_gain_slope_times_seat_load_and_none_under_a_hammer():
    loaded = physics.PadPreload(4e3).under_conditions({"axle_loads": (100e3, 120e3)})
    stiff = 300e6 + 4e3 * 0.45 * 55e3
    assert np.allclose(
        with_term(loaded), receptance(assemble(TRACK.with_(pad_stiffness=stiff)), F, 12.0, 12.0), atol=0.0, rtol=1e-9
    )
    assert physics.PadPreload(4e3).under_conditions({}).links(TRACK) == []


def test_ballast_inertia_is_a_heavier_and_more_damped_sleeper():
    other = TRACK.with_(sleeper_mass=350.0, ballast_damping=110e3)
    expected = receptance(assemble(other), F, 12.0, 12.0)
    assert np.allclose(with_term(physics.BallastInertia(200.0, 30e3)), expected, atol=0.0, rtol=1e-9)


@pytest.mark.parametrize("layers", [2, 3])
def test_a_track_with_less_radiation_absorbs_power_at_every_point(layers):
    """A passive structure absorbs power at every driving point: Im H < 0 there. 8 kN s/m, less 30."""
    subgrade = {"ballast_mass": 300.0, "subgrade_stiffness": 78e6, "subgrade_damping": 8e3} if layers == 3 else {}
    track = uniform_track(12.0, ballast_damping=8e3, layers=layers, **subgrade)
    matrices = assemble(track, (physics.BallastInertia(50.0, -3e4),))
    points = [(kind, j) for kind in ("rail", "sleeper") for j in range(21)]
    rows = [matrices.index[point] for point in points]
    driven = np.einsum("fii->fi", responses(matrices, np.linspace(20.0, 600.0, 30), points, rows))
    assert np.max(driven.imag) < 0.0


def test_radiation_with_three_layers_is_that_of_a_heavier_ballast_on_a_stronger_damper():
    base = TRACK.with_(layers=3, ballast_mass=300.0, subgrade_stiffness=78e6, subgrade_damping=31e3)
    other = base.with_(ballast_mass=500.0, subgrade_damping=61e3)
    found = receptance(assemble(base, (physics.BallastInertia(200.0, 30e3),)), F, 12.0, 12.0)
    assert np.allclose(found, receptance(assemble(other), F, 12.0, 12.0), atol=0.0, rtol=1e-9)


def test_a_sleeper_mode_far_above_the_band_is_a_rigid_sleeper():
    """Below its resonance the modal mass moves with the rest of it: error (f/f0)² with f/f0 = 30/800."""
    expected = receptance(assemble(TRACK), F[:1], 12.0, 12.0)
    assert np.isclose(with_term(physics.SleeperMode(0.6, 800.0))[0], expected[0], atol=0.0, rtol=(30.0 / 800.0) ** 2)


def test_a_sleeper_that_bends_has_the_dynamic_mass_of_its_mode_with_the_seats_held():
    """m (1 - r + r (1 + 2ijz) / (1 - j² + 2ijz)) at j = f / f0: its imaginary part damps like the ballast."""
    share, own, loss = 0.3, 200.0, 0.03
    term = physics.SleeperMode(share, own, loss)
    for k, f in enumerate(F):
        j = f / own
        mass = 1.0 - share + share * (1.0 + 2j * loss * j) / (1.0 - j**2 + 2j * loss * j)
        damping = TRACK.ballast_damping - 2.0 * np.pi * f * mass.imag * TRACK.sleeper_mass
        same = TRACK.with_(sleeper_mass=TRACK.sleeper_mass * mass.real, ballast_damping=damping)
        assert np.isclose(with_term(term)[k], receptance(assemble(same), [f], 12.0, 12.0)[0], atol=0.0, rtol=1e-9)


def test_shear_changes_an_euler_rail_into_a_timoshenko_rail_of_the_same_flexibility():
    rail = TRACK.rail
    euler = TRACK.with_(rail=type(rail)(rail.bending_stiffness, rail.mass, 1.0, rail.rotary_inertia, 20.0, "euler"))
    term = physics.RailShear(1e9 / rail.shear_stiffness)
    expected = receptance(assemble(TRACK), F, 12.0, 12.0)
    assert np.allclose(receptance(assemble(euler, (term,)), F, 12.0, 12.0), expected, atol=0.0, rtol=1e-9)


def test_a_casting_yields_in_shear_in_the_same_proportion_as_the_rail():
    """A too high shear coefficient is too high in every section: all stiffness in shear is divided by 1.5.
    Where the file states none, a casting of 2.5 times the section has 1 / 2.5 of the flexibility of the rail."""
    rail = TRACK.rail
    cast = replace(rail, bending_stiffness=1.8 * rail.bending_stiffness, mass=2.5 * rail.mass)
    own = replace(cast, shear_stiffness=2.2 * rail.shear_stiffness)
    filed = TRACK.with_(stretches=(RailStretch(11.1, 14.2, own),))
    soft = TRACK.with_(
        rail=replace(rail, shear_stiffness=rail.shear_stiffness / 1.5),
        stretches=(RailStretch(11.1, 14.2, replace(own, shear_stiffness=own.shear_stiffness / 1.5)),),
    )
    term = physics.RailShear(0.5e9 / rail.shear_stiffness)
    expected = receptance(assemble(soft), F, 10.7, 12.3)
    assert np.allclose(receptance(assemble(filed, (term,)), F, 10.7, 12.3), expected, atol=0.0, rtol=1e-9)

    slender = TRACK.with_(
        rail=replace(rail, beam="euler"), stretches=(RailStretch(11.1, 14.2, replace(cast, beam="euler")),)
    )
    sheared = TRACK.with_(
        stretches=(RailStretch(11.1, 14.2, replace(cast, shear_stiffness=2.5 * rail.shear_stiffness)),)
    )
    term = physics.RailShear(1e9 / rail.shear_stiffness)
    expected = receptance(assemble(sheared), F, 10.7, 12.3)
    assert np.allclose(receptance(assemble(slender, (term,)), F, 10.7, 12.3), expected, atol=0.0, rtol=1e-9)


def test_a_stretch_with_four_times_the_stiffness_is_a_softer_spring_by_the_winkler_formula():
    """Point stiffness of a long beam on springs goes as EI^(1/4) (Hetényi 1946): 4^(1/4) = 1.41 at 1 Hz."""
    term = physics.RailBending(0.0, 24.0, 4.0)
    rail = type(TRACK.rail)(6.42e6, 60.21, 1e8, beam="euler")
    one_layer = uniform_track(24.0, rail=rail, layers=1, pad_stiffness=20e6)
    h = [abs(receptance(assemble(one_layer, t), [1.0], 12.0, 12.0)[0]) for t in ((), (term,))]
    assert h[0] / h[1] == pytest.approx(4.0**0.25, rel=0.02)  # discrete supports: 2 %


@pytest.mark.parametrize(
    ("term", "frequency", "expected"),
    [
        (physics.SensorGain("A", 1.3), 77.0, 1.3),
        (physics.MountResonance("A", 1 / 400.0, 12.0), 400.0, -12.0j),  # at resonance -iQ
        (physics.TimeOffset("A", 1e-3), 250.0, np.exp(-0.5j * np.pi)),  # a quarter period
        (physics.PassageDelay("A", 2e-3), 125.0, -1j),  # a quarter period
        (physics.PassageGain("A", -0.7), 77.0, -0.7),
        (physics.HighPass("A", 10.0), 10.0, 0.5 + 0.5j),  # 3 dB and 45 degrees ahead
        (physics.LowPass("A", 1 / 500.0), 500.0, -1j / np.sqrt(2.0)),  # 3 dB and 90 degrees behind
    ],
)
def test_channels_have_the_transfer_function_of_the_textbook(term, frequency, expected):
    assert np.isclose(term.transfer(np.array([frequency]))[0], expected, atol=0.0, rtol=1e-12)
    t = np.arange(20000) / 20e3
    output = term.channel(np.sin(2.0 * np.pi * frequency * t), 20e3, A)[6000:14000]
    inside = t[6000:14000]
    wave = abs(expected) * np.sin(2.0 * np.pi * frequency * inside + np.angle(expected))
    assert np.max(np.abs(output - wave)) < 0.02 * abs(expected)  # the rest of the initial transient
    other = np.ones(10)
    assert term.channel(other, 20e3, Sensor("B", 12.0)) is other


def test_a_sine_clipped_at_half_its_peak_keeps_its_fundamental():
    """First harmonic of a clipped sine: (2/π)(asin c + c sqrt(1 - c²)) with c = 1/2 is 0.6090."""
    t = np.arange(20000) / 20e3
    output = physics.Clipping("A", 0.5).channel(np.sin(2.0 * np.pi * 50.0 * t), 20e3, A)
    first = 2.0 * np.mean(output * np.sin(2.0 * np.pi * 50.0 * t))
    assert first == pytest.approx(2.0 / np.pi * (np.pi / 6.0 + 0.5 * np.sqrt(0.75)), rel=1e-4)


def test_a_fast_clock_shows_a_line_at_a_higher_frequency():
    t = np.arange(40000) / 20e3
    output = physics.ClockDrift("A", 5e-3).channel(np.sin(2.0 * np.pi * 200.0 * t), 20e3, A)
    spectrum = np.abs(np.fft.rfft(output[:38000] * np.hanning(38000), 1 << 20))
    assert np.argmax(spectrum) * 20e3 / (1 << 20) == pytest.approx(201.0, abs=0.05)


def test_hum_has_its_stated_amplitude():
    output = physics.Hum("A", 3.0, 4.0).channel(np.zeros(20000), 20e3, A)
    assert np.sqrt(2.0 * np.mean(output**2)) == pytest.approx(5.0, rel=1e-6)
    assert "5 m/s²" in physics.Hum("A", 3.0, 4.0).sentence()


def test_the_position_of_a_sensor_changes_by_the_stated_shift():
    assert physics.SensorPosition("A", 0.3).sensor(A).place == pytest.approx(12.3)


def test_only_the_pads_support_a_hanging_sleeper_within_its_gap():
    (port,) = physics.HangingSleeper(20, 1e-3).ports(TRACK)
    for y in (-9e-4, 3e-4, 9e-4):
        assert -90e6 * y - port.law.force(y) == pytest.approx(0.0, abs=1e-3)
    assert -90e6 * 1.5e-3 - port.law.force(1.5e-3) == pytest.approx(-90e6 * 0.5e-3)  # k (y - g) beyond it


def test_a_sleeper_that_is_partly_seated_keeps_that_share_of_its_ballast_within_the_gap():
    (port,) = physics.HangingSleeper(20, 1e-3, 0.3).ports(TRACK)
    for y in (-9e-4, 3e-4, 9e-4):
        assert -90e6 * y - port.law.force(y) == pytest.approx(-0.3 * 90e6 * y)
    beyond = 0.3 * 90e6 * 1.5e-3 + 0.7 * 90e6 * 0.5e-3  # the other share bears after the gap has closed
    assert -90e6 * 1.5e-3 - port.law.force(1.5e-3) == pytest.approx(-beyond)


def test_ballast_under_lifting_sleepers_presses_and_does_not_pull_in_any_state():
    """The force on the sleeper is max(0, W + k y + c v) - W, at any velocity."""
    position, velocity = np.meshgrid(np.linspace(-3e-4, 3e-4, 41), np.linspace(-0.3, 0.3, 31))
    for term, share in ((physics.LiftingSleepers(0, 40, 1.0, 400.0), 1.0), (physics.LiftingSleepers(0, 40, 0.4), 0.4)):
        for y, v in zip(position, velocity):
            state = SimpleNamespace(track=TRACK, sleeper_position=y, sleeper_velocity=v)
            linear = 90e6 * y + 80e3 * v
            left = np.maximum(0.0, term.dead_load + linear) - term.dead_load
            assert linear - term.force(state) == pytest.approx(share * left + (1.0 - share) * linear, abs=1e-6)


def test_hardening_doubles_the_tangent_at_the_deflection_of_duffings_law():
    """k(1 + h (y/1mm)²) has the tangent k(1 + 3h) at 1 mm."""
    (port,) = physics.BallastHardening(20, 20, 1.0).ports(TRACK)
    slope = (port.law.force(1.005e-3) - port.law.force(0.995e-3)) / 1e-5
    assert slope / 90e6 == pytest.approx(3.0, rel=0.03)  # pieces of 50 µm


def test_a_mass_on_a_loose_fastening_has_the_period_of_a_piecewise_linear_oscillator():
    """Half a period of each stiffness, pi sqrt(m / k). A quarter of the stiffness in uplift: 1.5 times the period."""
    (port,) = physics.LooseFastening(20, 20, 0.75).ports(TRACK)
    stiffness, mass = 300e6, 60.0

    def motion(_, state):
        return state[1], -(stiffness * state[0] + float(port.law.force(state[0], 0.0))) / mass

    def rises_through_zero(_, state):
        return state[0]

    rises_through_zero.direction = 1.0
    path = solve_ivp(motion, (0.0, 0.02), (0.0, 0.1), events=rises_through_zero, rtol=1e-9, atol=1e-12)
    periods = np.diff([t for t in path.t_events[0] if t > 1e-6])
    assert periods.size >= 3
    assert np.allclose(periods, 1.5 * 2.0 * np.pi * (mass / stiffness) ** 0.5, rtol=1e-4, atol=0.0)


def test_a_loose_fastening_pulls_with_what_its_clips_give_and_presses_like_any_pad():
    """Three fastenings without clips cancel spring and damper of the pad where the rail lifts, and nothing else."""
    ports = physics.LooseFastening(19, 21, 1.0, 1.0).ports(TRACK)
    assert [port.ends for port in ports] == [TRACK.pad_link(j).ends for j in (19, 20, 21)]
    for port in ports:
        assert float(port.law.force(-2e-4, -0.3)) == pytest.approx(300e6 * 2e-4 + 30e3 * 0.3)
        assert float(port.law.force(2e-4, 0.3)) == 0.0


def test_pads_under_loose_fastenings_have_the_mean_of_both_stiffnesses_in_a_hammer_test():
    """The describing function of a piecewise linear spring: 1 - 0.8 / 2 of the spring, 1 - 0.5 / 2 of the damper."""
    (link,) = tangent_links((physics.LooseFastening(20, 20, 0.8, 0.5),), TRACK)
    assert link.stiffness == pytest.approx(-0.4 * 300e6) and link.damping == pytest.approx(-0.25 * 30e3)


def test_friction_dissipates_the_energy_of_its_describing_function():
    """A cycle of amplitude V at ω loses 4 F0 V/ω; the equivalent damper c = 4 F0 / (π V) loses π c V²/ω."""
    term = physics.DryFriction(20, 1000.0)
    (port,) = term.ports(TRACK)
    phase = np.linspace(0.0, 2.0 * np.pi, 20001)[:-1]
    velocity = 0.5 * np.cos(phase)
    lost = np.mean(port.law.force(0.0, velocity) * velocity)
    assert lost == pytest.approx(4.0 * 1000.0 / (np.pi * 0.5) * 0.5**2 / 2.0, rel=0.01)


def test_a_kink_of_5_mrad_is_that_of_jenkins_joint():
    (_, kink) = physics.SurfaceDip(12.0, 0.3125e-3, 0.5, 1.0).paths(TRACK, car())
    assert kink.angle == pytest.approx(5e-3)  # 2α = 8 d / L: two parabolas of slope 4 d / L at the joint
    smooth, sharp = physics.SurfaceDip(12.0, 1e-3, 0.5, 0.3).paths(TRACK, car())
    assert smooth(12.0) + sharp(12.0) == pytest.approx(1e-3)


def test_a_flat_of_50_mm_drops_the_wheel_by_newton_and_clarks_number():
    (path,) = physics.WheelFlat(2, 0.05, 0.43).paths(TRACK, car())
    assert path.depth == pytest.approx(0.36e-3, abs=0.5e-5) and path.wheel == 2
    assert physics.WheelFlat(2, 0.05, train="ICE").under_conditions({"train": "freight"}).paths(TRACK, car()) == ()


def test_three_waves_around_a_wheel_repeat_every_third_of_a_turn():
    cosine, sine = physics.OutOfRound(0, 3e-4, 4e-4, 3, 0.43).paths(TRACK, car())
    x = np.linspace(0.0, 5.0, 1001)
    wave = cosine(x, 0) + sine(x, 0)
    assert np.max(wave) == pytest.approx(5e-4, rel=1e-3)
    assert np.allclose(cosine(x + 2.0 * np.pi * 0.43 / 3.0, 0), cosine(x, 0), atol=1e-12)


def test_a_dip_that_is_shifted_is_deepest_there():
    """A positive shift is towards larger x; smooth and kinked part sum to the depth at the lowest point only."""
    x = np.linspace(11.0, 13.0, 2001)
    parts = physics.SurfaceDip(12.0, 1e-3, 0.6, sharpness=0.4, shift=0.25).paths(TRACK, None)
    dip = sum(part(x) for part in parts)
    assert x[np.argmax(dip)] == pytest.approx(12.25) and np.max(dip) == pytest.approx(1e-3)
    assert np.allclose(dip[np.abs(x - 12.25) > 0.3], 0.0, atol=1e-12)


def test_sentences_count_wheels_from_one_and_add_the_amplitudes_of_both_phases():
    sentence = physics.OutOfRound(2, 3e-4, 4e-4, 5).sentence()
    assert sentence == "wheel 3 of every train has 5 waves around it with an amplitude of 5.00e-04 m"


def test_candidates_of_corrugation_extend_beyond_all_sensors():
    hypotheses = list(physics.RailCorrugation.hypotheses(ContactSite((10.0, 12.1, 14.0))))
    assert hypotheses
    for fixed in (h.fixed for h in hypotheses):
        assert fixed["start"] < 10.0 and fixed["end"] > 14.0


def test_corrugation_excites_at_speed_over_wavelength():
    (path,) = physics.RailCorrugation(0.0, 20.0, 3e-5, 4e-5, 0.25).paths(TRACK, car())
    t = np.arange(4000) / 10e3
    spectrum = np.abs(np.fft.rfft(path(2.0 + 40.0 * t) * np.hanning(4000), 1 << 18))
    assert np.argmax(spectrum) * 10e3 / (1 << 18) == pytest.approx(160.0, abs=0.5)


def test_roughness_scales_with_its_amplitude():
    one, two = (physics.RoughnessLevel(a).paths(TRACK, car())[0](np.linspace(5.0, 19.0, 50)) for a in (1.0, 2.0))
    assert np.allclose(two, 2.0 * one, atol=0.0) and np.std(one) > 0.0


def test_a_heavier_wheelset_increases_the_load_by_its_weight():
    heavier = physics.UnsprungMass(1.4).vehicle(car())
    assert heavier.static_loads - car().static_loads == pytest.approx(0.4 * 750.0 * 9.81, rel=1e-6)


def test_roughness_on_top_of_a_rough_rail_adds_its_power():
    """Both have the same seed by default: the sum of two roughnesses of equal power is 3 dB more, not 6."""
    rail = TurnoutTrack(TRACK, {"main": ((),)}, roughness_level=0.0)
    x = np.arange(0.0, 24.0, 0.005)
    base = rail.roughness_parts(TRACK.start - 5.0, TRACK.end + 5.0, 0)[0](x)
    more = physics.RoughnessLevel(1.0).paths(TRACK, car())[0](x)
    assert np.std(more) == pytest.approx(np.std(base), rel=0.3)  # waves up to 3 m in 24 m
    assert abs(np.corrcoef(base, more)[0, 1]) < 0.5  # some sixteen independent waves carry most of it


def test_half_the_contact_constant_has_the_stiffness_of_hertz():
    """1.5 k^(2/3) W^(1/3): a factor 0.5 gives 0.63 at 75 kN."""
    soft, base = physics.ContactStiffness(0.5).vehicle(car()).contact, car().contact
    assert soft.tangent(75e3) / base.tangent(75e3) == pytest.approx(0.5 ** (2 / 3), rel=1e-9)


@pytest.mark.parametrize("shape", [lambda u: 1.0 - u, lambda u: np.cos(0.5 * np.pi * u) ** 2, lambda u: (1.0 - u) ** 2])
def test_the_error_of_the_length_of_a_dip_covers_shapes_that_its_formula_does_not_have(shape):
    """A V, a cosine and a cusp of 0.7 m: the least-squares fit of the formula to each of them. [m]"""
    x = np.linspace(-1.0, 1.0, 2001)
    true = np.where(np.abs(x) < 0.35, shape(np.minimum(np.abs(x) / 0.35, 1.0)), 0.0)

    def formula(parameters):
        depth, length, sharpness = parameters
        dip = physics.SurfaceDip(0.0, depth, length, sharpness)
        return sum(path(x) for path in dip.paths(None, None))

    sign = np.sign(formula((1e-3, 0.7, 0.0))[1000])
    bounds = ([0.0, 0.1, 0.0], [6e-3, 2.0, 1.0])
    found = least_squares(
        lambda p: 1e3 * formula(p) - sign * true, (1e-3, 0.6, 0.5), bounds=bounds, x_scale=(1e-3, 1.0, 1.0)
    )
    length = found.x[1]
    (share,) = (p.model_error_share for p in physics.SurfaceDip.parameters if p.name == "length")
    assert abs(length - 0.7) < 1.96 * share * length
