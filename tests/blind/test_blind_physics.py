"""The physics of the blind generator against closed forms and exact series, which do not use its time integration."""

from dataclasses import replace

import numpy as np
import pytest
from tests.oracles.uniform_world import uniform_world

from turnout_blind.grid import Rail, interpolation_weights, lost_compliance
from turnout_blind.march import TIME_STEP, _ballast_force, hertz_force
from turnout_blind.run import simulate_impacts, simulate_passage
from turnout_blind.true_site import SPACING
from turnout_blind.vehicle import GRAVITY, Car, Train

CAR = Car(32e3, 1.8e6, 3000.0, 3000.0, 1500.0, 1.2e6, 60e3, 0.5e6, 80e3, 2.5, 8.0, 12.0)


def series(world, x, xi, omega=0.0, n=3000):
    """Receptance between positions of a simply supported Timoshenko beam, by the exact sum over sines."""
    rail, grid = world.rail, world.grid
    length = grid.end - grid.start
    k = np.arange(1, n + 1) * np.pi / length
    shear = rail.shear * k**2 - rail.mass * omega**2 + 1j * omega * rail.damping
    turn = rail.shear + rail.bending * k**2 - rail.rotary * omega**2
    flexibility = 2.0 / length / (shear - (rail.shear * k) ** 2 / turn)
    waves = [np.sin(np.outer(np.asarray(p) - grid.start, k)) for p in (x, xi)]
    return (waves[0] * flexibility) @ waves[1].T


def on_supports(world, x, xi, omega=0.0, branch=0.0):
    """The same on the world's supports; ``branch`` is added to all pads' relative stiffness."""
    pad = world.pad * (1.0 + branch) + 1j * omega * world.pad_damping
    below = world.ballast + 1j * omega * world.ballast_damping - omega**2 * world.mass
    springs = np.diag(1.0 / pad + 1.0 / below)
    among = series(world, world.position, world.position, omega)
    reaction = np.linalg.solve(among + springs, series(world, world.position, xi, omega))
    return series(world, x, xi, omega) - series(world, x, world.position, omega) @ reaction


def receptance(world, places, hit, duration=0.2, dt=TIME_STEP):
    """(frequency, receptance) that an impact on the marched track gives."""
    force, a, _ = simulate_impacts(world, places, hit, [0.002], [1.2], duration, dt=dt)
    n = 1 << int(np.ceil(np.log2(force.size)) + 1)
    f = np.fft.rfftfreq(n, dt)[1:]
    return f, np.fft.rfft(a, n)[:, 1:] / np.fft.rfft(force, n)[1:] / -((2.0 * np.pi * f) ** 2)


def at(f, h, frequency):
    return h[:, int(np.argmin(np.abs(f - frequency)))], f[int(np.argmin(np.abs(f - frequency)))]


def winkler(per_metre, rail, damping=0.0, length=60.0):
    """Rail on a foundation [N/m²]: a spring at every node, on sleepers too heavy to move."""
    world = uniform_world(length, 0.1, 1.0, 0.0, 1e12, 0.0, 0.0, rail)
    half = int(0.5 * length / 0.1) - 3
    place = 0.1 * np.arange(-half, half + 1)
    ones = np.ones(place.size)
    return replace(
        world, position=place, pad=0.1 * per_metre * ones, pad_damping=0.1 * damping * ones, mass=1e12 * ones,
        ballast=0.0 * ones, ballast_damping=0.0 * ones, lift=ones, gap=-ones, seated=0.0 * ones, close=1e-4 * ones,
        hardening=0.0 * ones, drift=0.0 * ones,
    )  # fmt: skip


# Shear ten times that of a rail: a bending beam to 1 %, and half the step keeps the march stable.
BENDING_ONLY = Rail(bending=6.42e6, shear=2e9, mass=60.21, rotary=0.24, damping=0.0)


@pytest.mark.parametrize("front", [4.0, 4.3, 4.13])
def test_static_deflection_under_four_wheels(front):
    """Within 2 %: pads and wheels are 0.4 m wide here, and points in the exact series."""
    world = uniform_world(length=36.0)
    train = Train("car", (CAR,))
    places = front - (train.axles() - train.axles()[0])
    load = np.full(4, 0.5 * train.axle_load)
    exact = (on_supports(world, places, places) @ load).real
    _, force, state = simulate_passage(world, train, 1e-9, [front], 1.4, 0.0)
    first, weights = interpolation_weights(world.grid, places)
    found = np.array([state[0][i : i + 4] @ w for i, w in zip(first, weights)])
    assert force[:, 1390] == pytest.approx(load, rel=1e-3)  # at rest again
    assert found == pytest.approx(exact, rel=0.02)


@pytest.mark.parametrize("frequency", [60.0, 120.0, 300.0, 450.0])
def test_bending_beam_on_an_elastic_foundation(frequency):
    """1/(8 EI b^3), b^4 = (k + i w c - m w^2)/4EI: below and above the cut-on at 205 Hz; 2 % for shear and mesh."""
    k, c = 1e8, 1.5e4
    world = winkler(k, BENDING_ONLY, c)
    f, h = receptance(world, [0.0], 0.0, 0.12, TIME_STEP / 2)
    h, f0 = at(f, h, frequency)
    omega = 2.0 * np.pi * f0
    b = ((k + 1j * omega * c - 60.21 * omega**2) / (4.0 * 6.42e6)) ** 0.25
    candidates = [b * 1j**n for n in range(4)]
    b = next(x for x in candidates if x.real > 0 and abs(np.angle(x)) <= np.pi / 4 + 1e-9)
    assert h[0] == pytest.approx(1.0 / (8.0 * 6.42e6 * b**3), rel=0.03)


@pytest.mark.parametrize("frequency", [60.0, 120.0, 300.0])
def test_two_rails_that_meet_on_an_elastic_foundation(frequency):
    """An impact at the joint of two half-infinite bending beams: each end has the stiffness 4 EI b^3, 2 EI b^2 and 2
    EI b (Hetényi 1946), b^4 = (k + i w c - m w^2)/4EI. 1.9 times the stiffness and 2.2 the mass: 3 %, as of one rail;
    above
    300 Hz waves in the heavy rail are shorter than 2 m, and shear and rotary inertia cost them 2 % each."""
    k, c, factor, heavier = 1e8, 1.5e4, 1.9, 2.2
    world = winkler(k, BENDING_ONLY, c)
    side = np.sign(np.round(world.grid.start + world.grid.step * np.arange(world.grid.n), 6))
    world.profile = tuple(1.0 + 0.5 * (1.0 + side) * (f - 1.0) for f in (factor, heavier))
    f, h = receptance(world, [0.0], 0.0, 0.12, TIME_STEP / 2)
    h, f0 = at(f, h, frequency)
    omega = 2.0 * np.pi * f0
    ends = []
    for bending, mass in ((6.42e6, 60.21), (factor * 6.42e6, heavier * 60.21)):
        b = ((k + 1j * omega * c - mass * omega**2) / (4.0 * bending)) ** 0.25
        b = next(x for x in (b * 1j**n for n in range(4)) if x.real > 0 and abs(np.angle(x)) <= np.pi / 4 + 1e-9)
        ends.append((4.0 * bending * b**3, 2.0 * bending * b**2, 2.0 * bending * b))
    (p1, c1, t1), (p2, c2, t2) = ends
    exact = 1.0 / (p1 + p2 - (c1 - c2) ** 2 / (t1 + t2))
    assert h[0] == pytest.approx(exact, rel=0.03)


def steady_peak(load, speed, foundation, damping, rail):
    """Largest deflection under a load that moves for ever: the Fourier integral of the Timoshenko beam [m]."""
    k = np.linspace(-40.0, 40.0, 20001)
    turn = rail.bending * k**2 - rail.rotary * (k * speed) ** 2
    beam = rail.shear * k**2 * turn / (rail.shear + turn)
    stiffness = beam - rail.mass * (k * speed) ** 2 + foundation - 1j * damping * k * speed
    x = np.linspace(-0.3, 0.3, 61)
    return max(np.trapezoid(np.exp(1j * k * place) / stiffness, k).real for place in x) * load / (2.0 * np.pi)


def test_moving_load_on_an_elastic_foundation():
    """0.3 of the critical speed, 10 % damping. The integral itself gives the printed 0.4414 mm without shear."""
    k, v = 1e8, 0.3 * (4.0 * 1e8 * 6.42e6 / 60.21**2) ** 0.25
    c = 0.2 * np.sqrt(k * 60.21)
    bending = replace(BENDING_ONLY, shear=1e14, rotary=0.0)
    assert steady_peak(60e3, v, k, c, bending) == pytest.approx(0.4414e-3, abs=1.5e-7)
    world = winkler(k, BENDING_ONLY, c, 80.0)
    train = Train("far apart", (replace(CAR, base=6.0, pivots=14.0),))
    load = 0.5 * train.axle_load
    _, force, state = simulate_passage(world, train, v, [20.0], 0.2, 0.18, dt=TIME_STEP / 2)
    assert force[0, -30] == pytest.approx(load, rel=0.02)
    # The rail lies spread under the wheel: 1 % of the peak.
    assert state[0].max() == pytest.approx(steady_peak(force[0, -30], v, k, c, BENDING_ONLY), rel=0.015)


@pytest.mark.parametrize("hit", [0.0, 0.3])
def test_receptance_of_a_track_on_sleepers(hit):
    """Two layers, 50 to 800 Hz, at the impact and 1.2 m away, against the exact series of the same track."""
    world = uniform_world(pad_damping=3e4, ballast_damping=8e4, sponge=0.0)
    places = [hit, 1.2]
    f, h = receptance(world, places, hit)
    for frequency in (50.0, 100.0, 200.0, 400.0, 600.0, 800.0):
        found, f0 = at(f, h, frequency)
        exact = on_supports(world, places, [hit], 2.0 * np.pi * f0)[:, 0]
        assert abs(found[0] - exact[0]) < 0.09 * abs(exact[0]), frequency  # pads 0.4 m wide stiffen by this much
        assert abs(found[1] - exact[1]) < 0.15 * abs(exact).max(), frequency


def test_the_mesh_error_falls_with_the_mesh():
    """A spline half as wide comes at least half nearer to the point supports."""
    error = []
    for step, dt in ((0.1, TIME_STEP), (0.05, TIME_STEP / 2)):
        world = uniform_world(36.0, step, pad_damping=3e4, ballast_damping=8e4, sponge=0.0)
        f, h = receptance(world, [0.0], 0.0, 0.1, dt)
        worst = 0.0
        for frequency in (150.0, 300.0, 600.0):
            found, f0 = at(f, h, frequency)
            exact = on_supports(world, [0.0], [0.0], 2.0 * np.pi * f0)[0, 0]
            worst = max(worst, abs(found[0] - exact) / abs(exact))
        error.append(worst)
    assert error[1] < 0.55 * error[0]


def test_pinned_pinned_resonance():
    """1070 Hz for 60E1 on 0.6 m: roots of the simply supported Timoshenko beam with half waves of one bay; 3 %."""
    rail = Rail(6.42e6, 0.4 * 81e9 * 76.7e-4, 60.21, 7850 * 3.055e-5, 2.0)
    world = uniform_world(pad=3e8, pad_damping=3e4, mass=150.0, ballast=9e7, ballast_damping=8e4, rail=rail)
    f, h = receptance(world, [0.3], 0.3)
    inside = (f > 850.0) & (f < 1250.0)
    assert f[inside][np.argmax(np.abs(h[0, inside]))] == pytest.approx(1070.0, rel=0.03)


def test_a_sleeper_without_ballast_vibrates_on_its_pad():
    """The receptance near it follows the exact series with a free mass there: new peak and antiresonance."""
    world = uniform_world(pad_damping=1e4, ballast_damping=8e4, sponge=0.0)
    j = world.nearest(0.0)
    world.ballast[j] = world.ballast_damping[j] = 0.0
    hanging = world.copy()
    hanging.gap[j] = 0.01  # never closes under a hammer
    for track in (world, hanging):
        f, h = receptance(track, [0.0], 0.0)
        for frequency in (60.0, 110.0, 160.0, 300.0):
            found, f0 = at(f, h, frequency)
            exact = on_supports(world, [0.0], [0.0], 2.0 * np.pi * f0)[0, 0]
            assert abs(found[0] - exact) < 0.06 * abs(exact), frequency


@pytest.mark.parametrize("seated", [0.8, 0.35])
def test_a_partly_hanging_sleeper_has_the_share_of_ballast_that_bears(seated):
    """Under a hammer the gap stays open: the exact series with the share of ballast that bears."""
    world = uniform_world(pad_damping=1e4, ballast_damping=8e4, sponge=0.0)
    j = world.nearest(0.0)
    softer = world.copy()
    softer.ballast[j] *= seated
    softer.ballast_damping[j] *= seated
    world.gap[j], world.seated[j] = 0.01, seated
    f, h = receptance(world, [0.0], 0.0)
    for frequency in (60.0, 110.0, 160.0, 300.0):
        found, f0 = at(f, h, frequency)
        exact = on_supports(softer, [0.0], [0.0], 2.0 * np.pi * f0)[0, 0]
        assert abs(found[0] - exact) < 0.06 * abs(exact), frequency


def test_maxwell_branches_stiffen_the_pads():
    """k (1 + sum g i w/(i w + r)) in the exact series."""
    world = uniform_world(pad_damping=1e4, sponge=0.0)
    world.branch_share, world.branch_rate = np.array([0.6, 0.4]), 2.0 * np.pi * np.array([60.0, 500.0])
    f, h = receptance(world, [0.0], 0.0)
    for frequency in (100.0, 300.0, 500.0):
        found, f0 = at(f, h, frequency)
        iw = 2j * np.pi * f0
        branch = np.sum(world.branch_share * iw / (iw + world.branch_rate))
        exact = on_supports(world, [0.0], [0.0], 2.0 * np.pi * f0, branch)[0, 0]
        plain = on_supports(world, [0.0], [0.0], 2.0 * np.pi * f0)[0, 0]
        assert abs(found[0] - exact) < 0.08 * abs(exact), frequency
        assert abs(found[0] - exact) < 0.5 * abs(plain - exact), frequency


def test_an_attached_mass_stops_the_rail_at_its_own_frequency():
    """The driving-point receptance at a dynamic absorber is nearly 0 at the resonance of the absorber."""
    world = uniform_world(sponge=0.0)
    free = on_supports(world, [0.0], [0.0], 2.0 * np.pi * 150.0)[0, 0]
    k = 60.0 * (2.0 * np.pi * 150.0) ** 2
    world.attached_masses.append((0.0, 60.0, k, 0.01 * np.sqrt(k * 60.0), 1.0, 0.0))
    f, h = receptance(world, [0.0], 0.0, 0.4)
    found, _ = at(f, h, 150.0)
    assert abs(found[0]) < 0.1 * abs(free)


def test_energy_is_conserved_without_damping():
    """Kinetic and elastic energy after the impact equal the energy that the hammer lost, to 2 %, at two times."""
    rail = replace(Rail(), damping=0.0)
    world = uniform_world(36.0, pad_damping=0.0, ballast_damping=0.0, rail=rail, sponge=0.0)
    for duration in (0.02, 0.12):
        force, _, state = simulate_impacts(world, [0.0], 0.0, [0.002], [1.2], duration, loss=0.0)
        w, v, turn, q, moment, y, rate = state
        left = 1.2 - force.sum() * TIME_STEP / 5.5
        given = 0.5 * 5.5 * (1.2**2 - left**2)
        h = world.grid.step
        elastic = 0.5 * h * (np.sum(q**2) / rail.shear + np.sum(moment**2) / rail.bending)
        moving = 0.5 * h * (rail.mass * np.sum(v**2) + rail.rotary * np.sum(turn**2)) + 0.5 * np.sum(
            world.mass * rate**2
        )
        first, weights = world.supports()[:2]
        pad = np.array([w[i : i + 4] @ a for i, a in zip(first, weights)]) - y
        springs = 0.5 * np.sum(world.pad * pad**2) + 0.5 * np.sum(world.ballast * y**2)
        assert elastic + moving + springs == pytest.approx(given, rel=0.02)


def test_hertz_approach_and_stiffness():
    """93 GN/m^1.5: 66, 87, 114 µm and 1.13, 1.30, 1.49 GN/m under 50, 75, 112.5 kN; the force is never a pull."""
    for load, approach, stiffness in ((50e3, 66e-6, 1.13e9), (75e3, 87e-6, 1.30e9), (112.5e3, 114e-6, 1.49e9)):
        assert hertz_force(93e9, 0.0, (load / 93e9) ** (2 / 3), 1e4) == pytest.approx(load, rel=1e-6)
        assert (load / 93e9) ** (2 / 3) == pytest.approx(approach, rel=0.01)
        slope = (hertz_force(93e9, 0.0, approach + 1e-9, load) - hertz_force(93e9, 0.0, approach - 1e-9, load)) / 2e-9
        assert slope == pytest.approx(stiffness, rel=0.01)
    local = lost_compliance(uniform_world(12.0).grid, Rail())
    force = hertz_force(93e9, local, 1e-4, 1e5)
    assert force == pytest.approx(93e9 * (1e-4 - local * force) ** 1.5, rel=1e-9)
    assert hertz_force(93e9, local, -1e-5, 1e4) == 0.0


def test_hammer_on_a_rigid_rail_is_a_hertz_impact():
    """Hertz 1881: longest approach (5 m v²/4k)^(2/5), contact 2.9432 times that over v."""
    heavy = replace(Rail(), mass=1e9, rotary=1e9, bending=1.0, shear=1.0)
    world = uniform_world(12.0, rail=heavy)
    force, _, _ = simulate_impacts(world, [0.0], 0.0, [0.001], [1.1], 0.01, mass=5.5, tip=1.2e9, loss=0.0)
    deepest = (5.0 * 5.5 * 1.1**2 / (4.0 * 1.2e9)) ** 0.4
    assert force.max() == pytest.approx(1.2e9 * deepest**1.5, rel=0.01)
    assert np.count_nonzero(force) * TIME_STEP == pytest.approx(2.9432 * deepest / 1.1, abs=2 * TIME_STEP)
    assert force.sum() * TIME_STEP == pytest.approx(2.0 * 5.5 * 1.1, rel=0.01)


def test_a_wheel_leaves_the_rail_at_a_deep_dip():
    """Contact forces fall to zero and never below, and the sum of forces returns to the weight."""
    world = uniform_world()
    world.surface.append(lambda x: 5e-3 * np.clip(1.0 - np.abs(x) / 0.3, 0.0, None))
    train = Train("car", (CAR,))
    _, force, _ = simulate_passage(world, train, 40.0, [0.0], 1.2, 0.6)
    assert force.min() == 0.0
    assert np.any((force == 0.0).any(axis=1))
    weight = GRAVITY * (0.25 * CAR.body + 0.5 * CAR.bogie + CAR.wheelset) * 0.5
    assert np.mean(force[:, 100:500]) == pytest.approx(weight, rel=0.02)


def test_a_gap_closes_gradually():
    """The force is 0 within the gap, below k d shortly beyond it, and k (d - close) far beyond it."""
    world = uniform_world(12.0)
    world.gap[3], world.close[3] = 1e-3, 2e-4
    s = world.supports()
    k = world.ballast[3]
    assert _ballast_force(s, 3, 0.9e-3, 0.0, 0.0) == 0.0
    assert _ballast_force(s, 3, 1.1e-3, 0.0, 0.0) < 0.35 * k * 1e-4
    assert _ballast_force(s, 3, 4e-3, 0.0, 0.0) == pytest.approx(k * (3e-3 - 2e-4), rel=1e-6)
    assert _ballast_force(s, 4, -1e-3, 0.0, 0.0) == pytest.approx(-k * 1e-3)  # an ordinary sleeper is held both ways
    world.seated[3] = 0.4
    s = world.supports()
    assert _ballast_force(s, 3, 0.9e-3, 0.0, 0.0) == pytest.approx(0.4 * k * 0.9e-3)
    assert _ballast_force(s, 3, 4e-3, 0.0, 0.0) == pytest.approx(k * (0.4 * 4e-3 + 0.6 * (3e-3 - 2e-4)), rel=1e-6)


def test_the_sleepers_excite_a_wheel_at_speed_over_spacing():
    """On a smooth rail the force of a wheel has lines at v/L and its multiples, and hardly any others."""
    world = uniform_world(96.0)
    _, force, _ = simulate_passage(world, Train("car", (CAR,)), 40.0, [10.0], 1.9, 1.3)
    steady = force[0, 700:1900] - force[0, 700:1900].mean()
    spectrum = np.abs(np.fft.rfft(steady * np.hanning(steady.size)))
    f = np.fft.rfftfreq(steady.size, 1e-3)
    assert f[np.argmax(spectrum)] == pytest.approx(40.0 / SPACING, abs=1.0)
