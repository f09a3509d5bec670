"""Error of the shape of tops in a switch: its covariance, its scale from the file, and where it acts."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout.planned_case import small_plan
from turnout.mismatch.turnout.rail_roughness import Waves
from turnout.mismatch.turnout.running_surface import RunningSurface
from turnout.mismatch.turnout.surface_priors import TOP_SHAPE
from turnout.mismatch.turnout.top_shape import principal_modes, top_covariance, top_shapes
from turnout.mismatch.turnout.wheel_line import top
from turnout.mismatch.turnout.wheel_roughness import _components
from turnout.physics.term import Parameter
from turnout.simulate.blade import Blade
from turnout.simulate.wheel_path import BladeTop, StockFall

STOCK, TOP = StockFall(21.0, 4.0, 0.02, 1.0), BladeTop(20.0, 4.0, 0.02, 1.0)  # two lines, level at 22.5 m
PLAN = small_plan((15.0,), hammer_positions=(24.0,))
TRACK = PLAN.turnout.track
FILED = replace(
    PLAN.turnout,
    track=TRACK.with_(blade=Blade(20.0, 27.0, 32.0, TRACK.rail, 3e8, 3e4)),
    routes={"main": ((STOCK,), (TOP,))},
    spreads={STOCK: {"depth": 0.1}, TOP: {"depth": 0.2}},
)
WAVES = Waves([s.place for s in PLAN.sensors], 0.0)


def test_all_modes_together_have_the_covariance_of_the_process():
    distance = np.linspace(-TOP_SHAPE.reach, TOP_SHAPE.reach, 41)
    covariance = top_covariance(distance, 3e-4)
    modes = principal_modes(covariance, 1.0 - 1e-12)
    assert modes.T @ modes == pytest.approx(covariance, abs=1e-9 * 9e-8)
    assert covariance[20, 20] == pytest.approx(9e-8) and covariance[0, 0] < 1e-20  # full at the change, none beyond
    near, far = covariance[19, 21], covariance[10, 30]
    lag = 2.0 * (distance[21] - distance[20])
    weight = np.cos(0.5 * np.pi * distance[21] / TOP_SHAPE.reach) ** 4
    assert near == pytest.approx(9e-8 * weight * np.exp(-0.5 * (lag / TOP_SHAPE.correlation_length) ** 2))
    assert far < 0.1 * near


def test_beyond_the_reach_of_the_change_the_top_is_exact():
    distance = TOP_SHAPE.reach * np.array([-1.6, -1.2, 0.0, 1.2, 1.6])
    covariance = top_covariance(distance, 1.0)
    assert covariance[2, 2] == 1.0 and np.abs(np.delete(np.delete(covariance, 2, 0), 2, 1)).max() < 1e-30


def test_kept_modes_are_the_fewest_with_the_stated_share_of_the_variance():
    distance = np.linspace(-TOP_SHAPE.reach, TOP_SHAPE.reach, 41)
    covariance = top_covariance(distance, 1.0)
    kept = principal_modes(covariance, TOP_SHAPE.kept_variance)
    assert np.sum(kept**2) >= TOP_SHAPE.kept_variance * np.trace(covariance)
    assert np.sum(kept[:-1] ** 2) < TOP_SHAPE.kept_variance * np.trace(covariance)
    assert np.all(np.diag(covariance) - np.sum(kept**2, axis=0) > -1e-12)  # never more than the process


def test_the_scale_is_the_tolerance_of_the_file_where_both_tops_are_level():
    """Two straight tops: 5 (x - 21) = 20 - 5 (x - 20) mm at x = 22.5 m, 7.5 mm below the rail."""
    shapes = top_shapes(FILED, "main", {STOCK: 0.1, TOP: 0.2})
    assert [s.position for s in shapes] == pytest.approx([22.5, 22.5], abs=0.005)
    assert [s.sd for s in shapes] == pytest.approx([0.75e-3, 1.5e-3], rel=0.01)
    assert [s.on_blade for s in shapes] == [False, True]
    assert [s.on_blade for s in top_shapes(FILED, "main", {TOP: 0.2})] == [True]  # the other top is exact
    assert top_shapes(PLAN.turnout, "main", {STOCK: 0.1}) == []  # no blade


def test_an_error_acts_on_its_own_top_near_the_change_and_on_all_wheels():
    surface = RunningSurface(FILED, WAVES, ("main",))
    assert set(surface.shape_names) <= set(surface.names) and len(surface.shape_names) >= 4
    known = {n.name: n for n in surface.nuisances()}
    assert all((known[n].mean, known[n].sd, known[n].group) == (0.0, 1.0, "top_shape") for n in surface.shape_names)
    zero = dict.fromkeys(surface.names, 0.0)
    assert surface.surfaces("main", zero) == FILED.surfaces("main")
    name = next(n for n in surface.shape_names if n.startswith("blade"))
    changed = surface.surfaces("main", {**zero, name: 2.0})
    assert changed[0] == (STOCK,) and hash(changed) == hash(surface.surfaces("main", {**zero, name: 2.0}))
    assert changed != surface.surfaces("main", {**zero, name: 2.1})  # a key of simulations
    x = np.linspace(20.0, 25.0, 251)
    shape = next(s for s in surface.shapes["main"] if s.on_blade)
    error = top(changed, x, True) - top(FILED.surfaces("main"), x, True)
    within = np.abs(x - shape.position) < TOP_SHAPE.reach
    assert np.max(np.abs(error[~within])) < 1e-9 < np.max(np.abs(error[within]))
    grid = shape.position + TOP_SHAPE.step * np.arange(-10, 11)
    expected = 2.0 * shape.modes[0][40:61]
    assert top(changed, grid, True) - top(FILED.surfaces("main"), grid, True) == pytest.approx(expected, abs=1e-9)
    assert _components(changed[1]) == [TOP]  # no error of single wheels


class Bumps(Case):
    """Heights of a line with a Gaussian-process error, the modes of which are nuisances; a bump is the only effect."""

    def __init__(self, modes, data):
        self.modes, size = modes, (Parameter("size", "-", 0.0, (-9.0, 9.0), "of a bump", "made up 2026", (0.0, 3.0)),)
        self.nuisances = tuple(Nuisance(f"a{k}", "-", 0.0, 1.0) for k in range(len(modes)))
        self.observations = tuple(Observation(f"o{k}", f"c{k}", d, 0.1, 1.0, "height") for k, d in enumerate(data))
        self.bump = Candidate.of("bump", size, lambda psi: psi["size"], ((1.0,),))

    def predict(self, values, terms, observations):
        error = sum((values[n.name] * m for n, m in zip(self.nuisances, self.modes)), 0.0 * self.modes[0])
        return [error + sum(terms) * self.modes[0] for _ in observations]


@pytest.mark.parametrize("trains", [1, 4])
def test_a_hump_has_to_exceed_the_error_for_any_number_of_trains(trains):
    """Evidence of the joint fit, against that of one Gaussian with the covariance of the process in closed form."""
    distance = np.linspace(-TOP_SHAPE.reach, TOP_SHAPE.reach, 21)
    modes = principal_modes(top_covariance(distance, 1.0), TOP_SHAPE.kept_variance)
    data = np.tile(1.5 * modes[0] + 0.02 * np.cos(9.0 * distance), (trains, 1))
    case = Bumps(modes, data)
    gain = fit_jointly(case, (case.bump,)).evidence - fit_jointly(case).evidence
    ones = np.ones((trains, trains))
    noise = 0.01 * np.eye(data.size)

    def log_density(covariance):
        c = noise + np.kron(ones, covariance)
        return -0.5 * (data.ravel() @ np.linalg.solve(c, data.ravel()) + np.linalg.slogdet(c)[1])

    with_error = modes.T @ modes
    expected = log_density(with_error + 9.0 * np.outer(modes[0], modes[0])) - log_density(with_error)
    assert gain == pytest.approx(expected, abs=0.02)
    assert gain < 1.0  # against an exact top it would be 100 nats and more
