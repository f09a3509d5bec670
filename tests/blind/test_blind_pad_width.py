"""A fit to impacts of the generator estimates too light sleepers, since its pads are wide and its sleepers coupled."""

from dataclasses import replace

import numpy as np
import pytest
from tests.oracles.uniform_world import uniform_world

from turnout.simulate.frequency_response import responses
from turnout.simulate.matrices import assemble
from turnout.simulate.rail import Rail
from turnout.simulate.track import Track
from turnout_blind.march import TIME_STEP
from turnout_blind.run import simulate_impacts

LINES = np.geomspace(36.0, 900.0, 22)
IMPACTS, SENSORS = (0.0, 0.9), (0.0, 0.9, 2.1)
# prior standard deviations of a diagnosis [ln]: values of all supports, and stiffness of the rail
PRIORS = {
    "pad_stiffness": 0.25, "pad_damping": 0.5, "sleeper_mass": 0.06, "ballast_stiffness": 0.25,
    "ballast_damping": 0.5, "bending_stiffness": 0.015, "shear_stiffness": 0.12,
}  # fmt: skip


def world(coupling=0.0):
    rail = replace(uniform_world().rail, damping=4000.0)
    made = uniform_world(rail=rail)
    return replace(made, shear=coupling * float(made.ballast[0]), shear_damping=2e3 if coupling else 0.0)


def simulated_receptances(true):
    columns = []
    for x in IMPACTS:
        force, acceleration, _ = simulate_impacts(true, SENSORS, x, [0.01], [0.95], 0.3)
        wave = np.exp(-2j * np.pi * np.outer(LINES, TIME_STEP * np.arange(force.size)))
        columns.append((wave @ acceleration.T).T / (wave @ force) / -((2.0 * np.pi * LINES) ** 2))
    return np.array(columns)


def model_receptances(true, pad_width, changes):
    factor = {name: np.exp(changes.get(name, 0.0)) for name in PRIORS}
    r = true.rail
    rail = Rail(
        r.bending * factor["bending_stiffness"], r.mass, r.shear * factor["shear_stiffness"], r.rotary, r.damping
    )
    track = Track(
        rail, true.position, true.pad * factor["pad_stiffness"], true.pad_damping * factor["pad_damping"],
        true.mass * factor["sleeper_mass"], true.ballast * factor["ballast_stiffness"],
        true.ballast_damping * factor["ballast_damping"], pad_width=pad_width, end_length=12.0, end_damping=400.0,
    )  # fmt: skip
    matrices = assemble(track)
    motion = responses(matrices, LINES, list(IMPACTS))
    found = np.empty((len(IMPACTS), len(SENSORS), LINES.size), dtype=complex)
    for i, x in enumerate(IMPACTS):
        for k, y in enumerate(SENSORS):
            rows, weights = matrices.weights(y)
            found[i, k] = motion[:, i][:, rows] @ weights + matrices.compliance(x, y)
    return found


def estimate(true, pad_width, relative_error=0.1):
    """Logarithmic errors of all values in a linear fit with these priors, errors of the model of a tenth."""
    base = model_receptances(true, pad_width, {})
    columns = [np.log(model_receptances(true, pad_width, {name: 0.02}) / base).ravel() / 0.02 for name in PRIORS]
    rows = np.array(columns).T / relative_error
    target = np.log(simulated_receptances(true) / base).ravel() / relative_error
    stacked = np.vstack([rows.real, rows.imag, np.diag(1.0 / np.array(list(PRIORS.values())))])
    right = np.concatenate([target.real, target.imag, np.zeros(len(PRIORS))])
    return dict(zip(PRIORS, np.linalg.lstsq(stacked, right, rcond=None)[0]))


@pytest.fixture(scope="module")
def uncoupled_world():
    return world()


def test_pads_without_width_give_too_light_sleepers_and_pads_of_the_true_width_do_not(uncoupled_world):
    """The spline that carries a pad is as wide as a uniform pad of 0.2 m (3 times 0.6556 steps of 0.1 m)."""
    point, wide = (estimate(uncoupled_world, width)["sleeper_mass"] for width in (0.0, 0.2))
    assert -0.04 < point < -0.015
    assert abs(wide) < 0.012


def test_ballast_that_couples_sleepers_reduces_their_estimated_mass(uncoupled_world):
    """The coupling of 4 % of the ballast stiffness is unknown to the library."""
    assert -0.04 < estimate(world(0.04), 0.2)["sleeper_mass"] - estimate(uncoupled_world, 0.2)["sleeper_mass"] < -0.012
