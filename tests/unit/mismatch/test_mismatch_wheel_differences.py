"""Each wheel meets a nose differently from the file: an error of each passage, which agrees with simulations."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.candidates.out_of_roundness import _products
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.surface_priors import WHEELS
from turnout.mismatch.turnout.wave_response import WaveTransfer
from turnout.mismatch.turnout.wheel_flights import Deviation
from turnout.mismatch.turnout.wheel_roughness import (
    _components,
    _deviations,
    principal_directions,
    profile_modes,
)
from turnout.physics.term import PhysicsTerm
from turnout.simulate.wheel_path import Corrugation, Kink, Sections

PLAN = small_plan((15.0,), hammer_positions=(24.0,))
NOSE = Kink(25.2, 0.3e-3, 0.9, 0.55)
FILED = replace(PLAN.turnout, routes={"main": ((NOSE,),)}, spreads={NOSE: {"depth": 0.5}})


def test_deviations_of_wheels_are_those_of_noses_that_differ_by_a_standard_deviation():
    """Against the difference by a tenth of each, with an error by curvature. The deviation of the sharper nose is 0 at
    both ends and at the deepest point."""
    way = np.linspace(24.0, 26.5, 25001)
    deeper, further, longer, sharper = _deviations(NOSE, way)
    others = (
        (deeper, replace(NOSE, depth=NOSE.depth * (1.0 + 0.1 * WHEELS.depth_sd)), 0.1),
        (further, replace(NOSE, place=NOSE.place - 0.1 * WHEELS.position_sd), 0.1),
        (longer, replace(NOSE, length=NOSE.length * (1.0 - 0.1 * WHEELS.length_sd)), 0.1),
    )
    smooth = np.abs(way - NOSE.place) > 0.1 * WHEELS.position_sd + 1e-3  # the kink itself moves
    for found, nose, share in others:
        change = (nose(way) - NOSE(way)) / share
        assert found[smooth] == pytest.approx(change[smooth], abs=0.03 * np.abs(found).max())
    assert sharper[[0, -1]].tolist() == [0.0, 0.0] and abs(sharper[np.argmax(NOSE(way))]) < 1e-9
    assert sharper.max() == pytest.approx(0.5 * NOSE.depth * (0.75**3 - 0.75**4), rel=1e-3)  # where s = 0.75^4


def test_on_level_rail_wheels_do_not_differ():
    assert _deviations(replace(NOSE, depth=1e-8), np.linspace(24.0, 26.5, 500)) == []


def test_deviations_at_a_measured_surface_have_no_step_and_corrugation_has_none():
    """Level beyond its ends, where deviations of wheels are 0; in the middle they are a fifth of the depth of 0.4 m
    below the line between the ends. Waves of the rail are no nose."""
    profile = Sections((24.6, 25.2, 25.8), (0.0, 2.0e-3, 1.6e-3))
    way = np.linspace(22.0, 28.0, 6001)
    deeper, further, longer, sharper = _deviations(profile, way)
    outside = (way < 24.59) | (way > 25.81)
    assert all(np.all(w[outside] == 0.0) for w in (deeper, sharper))
    assert all(np.abs(w[outside]).max() < 1e-12 for w in (further, longer))
    assert deeper[np.argmin(np.abs(way - 25.2))] == pytest.approx(WHEELS.depth_sd * (2.0e-3 - 0.8e-3))
    assert max(np.abs(w).max() for w in (deeper, further, longer, sharper)) < 0.5e-3
    waves = Corrugation(20.0, 28.0, 5e-5, 0.35)
    assert _components((waves, NOSE)) == [NOSE]


@dataclass(frozen=True)
class OneWheel(PhysicsTerm):
    """Only the second wheel falls deeper, by ``DEPTH``."""

    name, kind = "one_wheel", "path"

    def paths(self, track, vehicle):
        part = lambda x, wheel=0: WHEELS.depth_sd * NOSE(x)  # noqa: E731
        deeper = type("Deeper", (), {"wheel": 1, "__call__": lambda self, x, wheel=0: part(x)})()
        return (deeper,)


@pytest.mark.slow
def test_the_signal_of_a_wheel_with_a_deeper_path_is_that_of_a_simulation():
    """First mode of the second wheel against the simulation with the path of that wheel. Like the column of a wave it
    is that of a linear track: 0.99 and 5 % are met. A spacing of 15 cm between positions would raise the error by
    half."""
    case = TrackCase(replace(measured_campaign(replace(PLAN, turnout=FILED), (), 7), turnout=FILED))
    fit = fit_jointly(case, iterations=6)
    o, before = next((o, p) for o, p in zip(case.observations, fit.predictions) if o.name in case.aligned_passages)
    made = case.aligned_passages[o.name]
    filed = fit.values | dict.fromkeys(case.predictor.surface.names, 0.0)
    modes = profile_modes(
        case.predictor, filed, made, WaveTransfer(case.predictor, fit.values, made, beyond=WHEELS.roughness_margin)
    )
    assert modes.shape == (o.data.size, 4 * len(made.passage.vehicle.wheels))
    change = case.predict(fit.values, (OneWheel(),), [o])[0] - before
    found = modes[:, 4]
    assert found @ change / np.sqrt((found @ found) * (change @ change)) > 0.97
    assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(change), rel=0.1)


DEEP = replace(NOSE, depth=1.6e-3)


@pytest.mark.slow
def test_errors_of_wheels_that_leave_the_rail_are_those_of_simulations_with_single_paths():
    """A deep nose at 44 m/s: every wheel leaves the rail and lands behind it.

    The linear response has a cosine below 0.6 with the simulated one there.
    """
    turnout = replace(FILED, routes={"main": ((DEEP,),)}, spreads={DEEP: {"depth": 0.5}})
    case = TrackCase(replace(measured_campaign(replace(PLAN, turnout=turnout), (), 7), turnout=turnout))
    aligned = max(case.aligned_passages.values(), key=lambda a: a.speed)
    values = {n.name: case.start_values.get(n.name, n.mean) for n in case.nuisances}
    values |= dict.fromkeys((*case.predictor.waves.names, *case.predictor.surface.names), 0.0)
    signal, forces = case.predictor.predict_over(values, aligned, ())
    assert np.all(forces.min(axis=1) == 0.0)
    transfer = WaveTransfer(case.predictor, values, aligned, beyond=WHEELS.roughness_margin)
    modes = profile_modes(case.predictor, values, aligned, transfer)
    n_wheel, grid = len(forces), transfer.fine_grid
    deeper = _deviations(DEEP, grid)[0]
    linear = transfer.tops_response(deeper[None], deeper[None], [transfer.wheel(1)])[0, :, 0]
    up, down = (
        case.predictor.predict_over(values, aligned, (OfOneWheel(grid, sign * deeper),))[0] - signal
        for sign in (1.0, -1.0)
    )
    odd, even = modes.reshape(len(modes), n_wheel, 8)[:, 1, [0, 4]].T
    assert cosine(odd, up - down) > 0.95 and cosine(even, up + down) > 0.95
    assert np.linalg.norm(odd) == pytest.approx(0.5 * np.linalg.norm(up - down), rel=0.15)
    assert np.linalg.norm(even) == pytest.approx(0.5 * 3.0**0.5 * np.linalg.norm(up + down), rel=0.15)
    assert cosine(linear, up - down) < 0.6


class OfOneWheel(Deviation):
    """Only the second wheel deviates."""

    wheel = 1


def cosine(a, b):
    return a @ b / np.sqrt((a @ a) * (b @ b))


class CountedTransfer(WaveTransfer):
    """One line and one sensor, with a response that is the sum of the path; counts how often it is computed."""

    def __init__(self, n_wheel):
        self.load_transfer, self.grid, self.wheel_delays, self.n_computed = None, np.ones(1), np.arange(n_wheel), 0
        self.start, self.period = 0.0, 1.0

    def _harmonics(self, paths):
        self.n_computed += 1
        return np.ones((1, 1, 1)), np.ones((1, 1, 1)), paths.sum(axis=1, keepdims=True)

    def _on_clock(self, spectrum):
        return spectrum[0]


def test_the_response_to_a_path_is_computed_once_for_all_wheels():
    transfer, path = CountedTransfer(8), np.array([[1.0, 2.0]])
    delays = [np.full(1, w + 1.0) for w in range(8)]
    together = transfer.tops_response(path, path, delays)
    assert transfer.n_computed == 1
    assert together.ravel() == pytest.approx([6.0 * (w + 1.0) for w in range(8)])
    assert [d.tolist() for d in transfer.wheels()] == [transfer.wheel(w).tolist() for w in range(8)]


class RandomTransfer(WaveTransfer):
    """Random spectra of seven waves on the lines 5 to 24 of a transform of 64 samples, for three sensors."""

    def __init__(self, rng):
        self.size, self.inside, self.sign = 64, np.arange(5, 25), -1.0
        self.aligned = SimpleNamespace(time=np.arange(40), sensors=("a", "b", "c"))
        self.clock = complex_normal(rng, (20, 3))


def complex_normal(rng, shape):
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def test_products_with_a_residual_are_those_of_the_columns():
    rng = np.random.default_rng(4)
    transfer, residual = RandomTransfer(rng), rng.normal(size=120)
    spectra, delays = (complex_normal(rng, (20, 3, 7)), complex_normal(rng, (20, 3, 7))), complex_normal(rng, (2, 20))
    columns = [transfer.signals_from(spectra, delay) for delay in delays]
    assert columns[0].shape == (120, 14)
    products = _products(transfer, residual, spectra, delays)
    assert products == pytest.approx(np.array([c.T @ residual for c in columns]), rel=1e-12, abs=1e-12)


def test_principal_directions_are_those_of_the_whole_matrix():
    """60 waves that are combinations of 15, and 5 more, half of which are too weak."""
    rng = np.random.default_rng(2)
    strong = rng.normal(size=(80, 15)) @ rng.normal(size=(15, 60))
    faint = np.linalg.qr(rng.normal(size=(80, 5)))[0] * np.sqrt([0.2, 0.1, 1e-3, 1e-3, 1e-3])
    waves = np.column_stack([strong, faint])
    gram = waves.T @ waves
    power, vectors = np.linalg.eigh(gram)
    kept = vectors[:, power > 0.02]
    found = principal_directions(gram, 0.02)
    assert found.shape[1] == kept.shape[1]
    through = waves @ kept
    assert waves @ found @ (waves @ found).T == pytest.approx(through @ through.T, abs=2e-3)
