"""Closed forms of flats by their impacts, dips absorbed by waves of the rail, and polygons by their line."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout import physics
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout.candidates import out_of_roundness, rail_defects
from turnout.mismatch.turnout.candidates.out_of_roundness import AMPLITUDES, _passage_evidence
from turnout.mismatch.turnout.candidates.rail_defects import RailScan, scan_rail
from turnout.mismatch.turnout.candidates.wheel_flats import (
    band_excess,
    best_flat_on_wheel,
    log_density,
)
from turnout.mismatch.turnout.defect_priors import FLATS
from turnout.mismatch.turnout.rail_roughness import Waves
from turnout.simulate.vehicle import lone_wheels

TURN, SPEED, RATE = 2.0 * np.pi * 0.46, 25.0, 5000.0
WHEELS = np.array([0.0, 1.8, 10.7, 12.5])
PLACES = (2.4, 4.5, 6.6, 8.7)


def wagon(places):
    return lone_wheels(900.0, tuple(float(place) for place in places), radius=0.46)


def passage(phase, wheel, name, radius=0.46, strength=30.0, seed=0):
    """Noise, and bursts of 4 ms when the flat of ``wheel`` meets the rail: less by a fifth per metre to the sensor."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 2.4, 1.0 / RATE)
    samples = rng.normal(size=(len(PLACES), time.size))
    reference = 0.5
    turn = 2.0 * np.pi * radius
    for k in range(-3, 8):
        place = phase + k * turn
        moment = reference + (place - PLACES[0] + WHEELS[wheel]) / SPEED
        inside = (time >= moment) & (time < moment + 0.004)
        for row, x in zip(samples, PLACES):
            row[inside] += strength * 0.8 ** abs(place - x) * rng.normal(size=inside.sum())
    sensors = tuple(SimpleNamespace(name=f"A{i}", place=x) for i, x in enumerate(PLACES))
    vehicle = wagon(WHEELS)
    recording = SimpleNamespace(samples=samples, rate=RATE, index=lambda n: int(n[1]))
    run = SimpleNamespace(direction="facing", vehicle=vehicle, recording=recording)
    return SimpleNamespace(name=name, sensors=sensors, reference=reference, speed=SPEED, time=time, passage=run)


def scanned(passages):
    excesses = [band_excess(m) for m in passages]
    return [best_flat_on_wheel(passages, excesses, w) for w in range(len(WHEELS))]


def test_a_series_of_impacts_identifies_wheel_radius_and_angle_of_a_flat():
    passages = [passage(1.1, 1, "a", 0.446, seed=1), passage(2.3, 1, "b", 0.446, seed=2)]
    found = scanned(passages)
    nats = [n for n, *_ in found]
    assert int(np.argmax(nats)) == 1 and nats[1] > 20.0
    _, radius, phases = found[1]
    assert radius == pytest.approx(0.446, abs=0.0046)  # one step of the scan
    # impacts near the sensors, at about the third turn, have the true positions
    for (_, at), true in zip(phases, (1.1, 2.3)):
        way = np.array([at + k * 2 * np.pi * radius for k in range(4)])[:, None]
        assert np.abs(way - [true + k * 2 * np.pi * 0.446 for k in range(4)]).min() < 0.2


def test_noise_and_impacts_at_one_position_are_no_flat():
    assert max(n for n, *_ in scanned([passage(1.1, 1, "a", strength=0.0, seed=s) for s in (3, 4)])) < 4.0
    with_impact = passage(1.1, 1, "a", strength=0.0, seed=5)
    with_impact.passage.recording.samples[:, 5000:5020] *= 30.0  # one impact, all sensors
    assert max(n for n, *_ in scanned([with_impact])) < 4.0


def with_nose(made, place, strengths, seed):
    """The same passage, every wheel with an impact at ``place``; axles a turn apart in a bogie."""
    rng = np.random.default_rng(seed)
    made.passage.vehicle = wagon([0.0, TURN, 10.7, 10.7 + TURN])
    for behind, strength in zip(made.passage.vehicle.wheel_positions, strengths):
        moment = made.reference + (place - PLACES[0] + behind) / SPEED
        inside = (made.time >= moment) & (made.time < moment + 0.004)
        for row, x in zip(made.passage.recording.samples, PLACES):
            row[inside] += strength * 0.8 ** abs(place - x) * rng.normal(size=inside.sum())
    return made


def test_a_nose_at_which_every_wheel_has_an_impact_is_no_flat_of_the_strongest():
    """The axles of a bogie are a turn apart. So the rear one seems to have two impacts, its own and that of the axle
    ahead, in eight passages, which is evidence against a flat. A flat of the last wheel beside that nose is found in
    its bogie, whose other wheel is a turn away, with more evidence for the last wheel."""
    uneven = (20.0, 30.0, 20.0, 20.0)
    intact = [with_nose(passage(1.1, 3, f"{s}", strength=0.0, seed=s), 4.5, uneven, s + 50) for s in range(20, 28)]
    assert max(n for n, *_ in scanned(intact)) < 0.0
    flat = [with_nose(passage(p, 3, f"{p}", seed=int(9 * p)), 4.5, uneven, int(9 * p) + 50) for p in (1.1, 2.3)]
    nats = [n for n, *_ in scanned(flat)]
    assert int(np.argmax(nats)) == 3 and nats[3] > 20.0 + max(nats[:2])


def test_a_flat_of_one_of_two_wheels_is_no_impact_of_the_rail():
    """A wagon of two axles: the lower of two is not the one with the flat. One wheel alone gives no position."""
    for wheels in ([0.0, 4.9], [0.0]):
        made = passage(1.1, 0, "a", seed=6)
        made.passage.vehicle = wagon(wheels)
        assert best_flat_on_wheel([made], [band_excess(made)], 0)[0] > 15.0  # less than the larger of two


def test_no_single_impact_has_more_evidence_than_its_bound():
    """ln of ((1-e) / sqrt(2 pi) + e U) / (e U), the density of noise at its maximum over that of outliers."""
    bound = np.log(
        ((1.0 - FLATS.outlier_share) / np.sqrt(2.0 * np.pi) + FLATS.outlier_share * FLATS.outlier_density)
        / (FLATS.outlier_share * FLATS.outlier_density)
    )

    def likelihood_ratio(deviations, expected):
        return log_density(deviations, expected) - log_density(deviations, 0.0)

    z, m = np.meshgrid(np.linspace(-5.0, 100.0, 200), np.linspace(0.0, 30.0, 50))
    assert np.all(np.abs(likelihood_ratio(z, m)) <= bound)
    assert likelihood_ratio(-1e3, 0.0) == 0.0 == likelihood_ratio(0.7, 0.0)
    bell = (
        (1.0 - FLATS.outlier_share) * np.exp(-0.5 * (30.0 / 8.5) ** 2) / (np.sqrt(2.0 * np.pi) * 8.5)
    )  # spread 1 + 30 / 4
    assert likelihood_ratio(0.0, 30.0) == pytest.approx(
        np.log1p(bell / (FLATS.outlier_share * FLATS.outlier_density)) - bound
    )


def test_the_evidence_of_a_wave_is_that_of_two_normal_amplitudes_integrated_out():
    """By quadrature: the mean over amplitudes N(0, a^2) of exp(s.c - c.M.c / 2)."""
    m = np.array([[3e10, 4e9], [4e9, 2e10]])
    s = np.array([6e5, -3e5])
    (row,) = _passage_evidence(s[None], m[None])[2:3]
    a = AMPLITUDES[2]
    grid = np.linspace(-8.0, 8.0, 1601) * a
    x, y = np.meshgrid(grid, grid, indexing="ij")
    weight = np.exp(-0.5 * (x**2 + y**2) / a**2) / (2.0 * np.pi * a**2) * (grid[1] - grid[0]) ** 2
    power = s[0] * x + s[1] * y - 0.5 * (m[0, 0] * x * x + 2.0 * m[0, 1] * x * y + m[1, 1] * y * y)
    assert row[0] == pytest.approx(np.log(np.sum(weight * np.exp(power))), abs=1e-6)


def test_a_wheel_without_a_known_angle_is_simulated_as_round():
    term = physics.OutOfRound(2, 1e-4, 0.0, order=5, radius=0.45, train="loaded", phases=(("a", 0.3),))
    assert term.under_conditions({"train": "railcar", "name": "a"}).paths(None, None) == ()
    assert term.under_conditions({"train": "loaded", "name": "b"}).paths(None, None) == ()
    x = np.linspace(0.0, 3.0, 50)
    parts = term.under_conditions({"train": "loaded", "name": "a"}).paths(None, None)
    assert sum(p(x, 2) for p in parts) == pytest.approx(1e-4 * np.cos(5.0 * (x - 0.3) / 0.45))
    flat = physics.WheelFlat(2, 0.05, 0.45, train="loaded", phases=(("a", 0.3),))
    assert flat.under_conditions({"train": "loaded", "name": "b"}).paths(None, None) == ()
    assert flat.under_conditions({"train": "loaded", "name": "a"}).phase == 0.3


class OnlyWaves(Case):
    """One recording that depends on a few waves of the rail by a random matrix."""

    def __init__(self):
        rng = np.random.default_rng(11)
        self.waves = Waves(PLACES, 0.0)
        self.predictor = SimpleNamespace(waves=self.waves)
        self.nuisances = tuple(self.waves.nuisances())
        self.observations = (Observation("a", "a", rng.normal(size=400), 1.0, data_type="passage"),)
        self.columns = rng.normal(size=(400, len(self.nuisances))) / self.waves.sd

    def predict(self, values, terms, observations):
        return [self.columns @ [values[n] for n in self.waves.names]]

    def nuisance_jacobian(self, values, terms, observations, base):
        return [self.columns]


def test_the_gain_of_a_shape_is_that_of_a_least_squares_fit_with_the_waves():
    case = OnlyWaves()
    fit = fit_jointly(case, iterations=3)
    scan = RailScan(case, fit)
    shape = np.where(np.abs(scan.x - 5.0) < 0.4, 1e-3 * np.cos(np.pi * (scan.x - 5.0) / 0.8) ** 2, 0.0)
    slope, size = scan.score(shape[None])

    column = case.columns @ (shape @ scan.basis * case.waves.sd)  # what the shape's waves show
    prior = np.diag(1.0 / case.waves.sd)
    rows, right = np.vstack([case.columns, prior]), np.append(case.observations[0].data, np.zeros(prior.shape[0]))
    wider = np.column_stack([rows, np.append(column, np.zeros(prior.shape[0]))])
    costs = [np.sum((right - m @ np.linalg.lstsq(m, right, rcond=None)[0]) ** 2) for m in (rows, wider)]
    assert slope[0] ** 2 / size[0, 0] == pytest.approx(costs[0] - costs[1], rel=1e-6)

    theta = np.linalg.lstsq(wider, right, rcond=None)[0]  # the remaining waves are those of that fit
    height = slope[0] / size[0, 0]
    left = scan.waves_without(height * shape)
    assert [left[n] for n in case.waves.names] == pytest.approx(theta[:-1], rel=1e-5, abs=1e-6 * case.waves.sd.max())


class RoughCase(OnlyWaves):
    """The same, of rail that is corrugated between the sensors."""

    def __init__(self, wavelength):
        super().__init__()
        rng = np.random.default_rng(12)
        self.campaign = SimpleNamespace(sensors=[SimpleNamespace(place=x) for x in PLACES])
        x = np.arange(self.waves.start, self.waves.end, 0.01)
        path = physics.RailCorrugation(PLACES[0] - 3.0, PLACES[-1] + 3.0, 6e-5, 4e-5, wavelength).paths(None, None)[0]
        amplitudes = 0.01 * 2.0 / self.waves.length * self.waves.shapes(x) @ path(x)
        data = self.columns @ amplitudes + rng.normal(size=400)
        self.observations = (Observation("a", "a", data, 1.0, data_type="passage"),)


@pytest.mark.parametrize("wavelength", [0.26, 0.285, 0.31, 0.45, 0.7])
def test_corrugation_of_each_length_of_free_waves_is_found(wavelength):
    """Corrugation that the free waves absorb has a candidate of its length, down to 0.25 m. Formerly the search ended
    earlier."""
    case = RoughCase(wavelength)
    (found,) = scan_rail(case, fit_jointly(case, iterations=3), ["rail_corrugation"])
    assert found.where["wavelength"] == pytest.approx(wavelength, rel=0.02)


def test_waves_of_rail_and_wheels_are_tested_from_the_shortest_free_wave_on():
    """Neighbours of rail 3 % apart, of wheels 1.2 %: over 10 m half a period of the shortest."""
    shortest = Waves(PLACES, 0.0).lengths.min()
    for module, step in ((rail_defects, 0.03), (out_of_roundness, 0.0125)):
        lengths = module.WAVELENGTHS
        assert lengths[0] <= 1.025 * shortest and np.max(np.diff(np.log(lengths))) <= step
