"""Errors of single wheels over the tops of a switch: together the simulated response, each alone close to its own."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.surface_priors import WHEELS
from turnout.mismatch.turnout.wave_response import WaveTransfer
from turnout.mismatch.turnout.wheel_roughness import profile_modes
from turnout.mismatch.turnout.wheel_tops import TopChange, TopDeviation, share_difference
from turnout.simulate.blade import Blade
from turnout.simulate.wheel_path import BladeTop, StockFall

STOCK, TOP = StockFall(21.6, 3.0, 0.02), BladeTop(20.1, 3.0, 0.015)


def test_the_responses_of_all_wheels_sum_to_the_common_one_and_each_keeps_its_time():
    linear = np.zeros((2, 80, 1))
    linear[0, 5:10], linear[1, 25:30] = 1.0, 2.0  # two wheels, apart in time; two sensors of 40 samples
    common = 2.5 * linear.sum(axis=0)
    shared = share_difference(linear, common, 2, 3)
    assert shared.sum(axis=0) == pytest.approx(common)
    assert shared == pytest.approx(2.5 * linear, abs=1e-9)
    alike = share_difference(np.ones((2, 80, 1)), np.full((80, 1), 5.0), 2, 3)
    assert alike == pytest.approx(np.full((2, 80, 1), 2.5))


def test_a_deviation_is_the_stated_share_of_a_top_or_its_slope():
    x = np.linspace(20.0, 26.0, 61)
    deeper, further = (TopDeviation(STOCK, shift, 0.5, False) for shift in (False, True))
    assert deeper(x) == pytest.approx(0.5 * WHEELS.depth_sd * STOCK(x))
    moved = STOCK(x + 0.5 * WHEELS.position_sd) - STOCK(x)
    assert further(x)[20:44] == pytest.approx(moved[20:44], rel=0.02, abs=1e-6)


def test_a_change_of_the_stock_rail_does_not_change_the_blade():
    x = np.linspace(20.0, 26.0, 61)
    for change, on_blade in ((TopChange(STOCK, False, False), False), (TopChange(TOP, False, True), True)):
        both = sum((p(x) for p in change.paths(None, None) if not p.on_blade), 0.0 * x)
        blade = both + sum(p(x) for p in change.paths(None, None) if p.on_blade)
        deviation = WHEELS.depth_sd * (TOP if on_blade else STOCK)(x)
        assert both == pytest.approx(0.0 * x if on_blade else deviation)
        assert blade == pytest.approx(deviation if on_blade else 0.0 * x, abs=1e-15)


@dataclass(frozen=True)
class OneWheel(TopChange):
    """Only one wheel has the deviation."""

    wheel: int = 1

    def paths(self, track, vehicle):
        return tuple(Alone(p, self.wheel, p.on_blade) for p in super().paths(track, vehicle))


@dataclass(frozen=True)
class Alone:
    part: TopDeviation
    of_wheel: int
    on_blade: bool

    @property
    def wheel(self):
        return self.of_wheel

    def __call__(self, x, wheel=0):
        return self.part(x) if wheel == self.of_wheel else 0.0 * np.asarray(x)


@pytest.fixture(scope="module")
def switch():
    """A case, its first passage, and modes of its wheels: deeper and further on the stock rail, then on the blade."""
    plan = small_plan((15.0,), hammer_positions=(24.0,))
    track = plan.turnout.track
    turnout = replace(
        plan.turnout,
        track=track.with_(blade=Blade(20.1, 27.0, 32.0, track.rail, 3e8, 3e4)),
        routes={"main": ((STOCK,), (TOP,))},
    )
    case = TrackCase(replace(measured_campaign(replace(plan, turnout=turnout), (), 3), turnout=turnout))
    passage = next(o for o in case.observations if o.name in case.aligned_passages)
    values = {n.name: case.start_values.get(n.name, n.mean) for n in case.nuisances}
    values |= dict.fromkeys(case.predictor.waves.names, 0.0)
    aligned = case.aligned_passages[passage.name]
    transfer = WaveTransfer(case.predictor, values, aligned, beyond=WHEELS.roughness_margin)
    modes = profile_modes(case.predictor, values, aligned, transfer)
    return case, passage, values, modes.reshape(len(modes), len(aligned.passage.vehicle.wheels), 4)


def response(switch, term):
    case, passage, values, _ = switch
    return (case.predict(values, (term,), [passage])[0] - case.predict(values, (), [passage])[0]) / term.amount


@pytest.mark.parametrize(
    ("k", "top", "is_shift"), [(0, STOCK, False), (1, STOCK, True), (2, TOP, False), (3, TOP, True)]
)
def test_all_wheels_together_respond_as_simulated(switch, k, top, is_shift):
    common = response(switch, TopChange(top, is_shift, top is TOP, WHEELS.deviation_step))
    assert switch[3][:, :, k].sum(axis=1) == pytest.approx(common, abs=1e-6 * np.max(np.abs(common)))


@pytest.mark.parametrize(("k", "top", "is_shift"), [(0, STOCK, False), (3, TOP, True)])
def test_a_single_wheel_responds_nearly_as_simulated(switch, k, top, is_shift):
    """The linear response alone has a cosine of 0.977 and 1.09 to 1.17 of the size here, and half of it elsewhere."""
    alone, mode = response(switch, OneWheel(top, is_shift, top is TOP, WHEELS.deviation_step)), switch[3][:, 1, k]
    cosine = mode @ alone / np.sqrt((mode @ mode) * (alone @ alone))
    size = np.linalg.norm(mode) / np.linalg.norm(alone)
    assert cosine > 0.99 and 0.95 < size < 1.05
