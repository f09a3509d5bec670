"""Impacts beside fastenings that hardly pull: both codes agree, a linear track with their mean stiffness does not."""

import numpy as np
import pytest
from tests.blind.test_blind_pad_width import LINES, world

from turnout.mismatch.turnout.bilinear_supports import bilinear_terms
from turnout.mismatch.turnout.priors import RECEPTANCE
from turnout.mismatch.turnout.receptance_model import linear_matrices
from turnout.physics import BallastHardening, DryFriction, HangingSleeper, LooseFastening
from turnout.simulate import uniform_track
from turnout.simulate.preparation import prepare
from turnout.simulate.rail import Rail
from turnout.simulate.run import Probe, run
from turnout.simulate.track import Track
from turnout_blind.march import TIME_STEP
from turnout_blind.run import simulate_impacts

SENSORS = (0.0, 0.9, 2.1)
LOST = 0.8


@pytest.fixture(scope="module")
def impact():
    """Force and accelerations of an impact of the generator, whose middle three fastenings pull with a fifth."""
    true = world()
    middle = true.nearest(0.0)
    true.lift[middle - 1 : middle + 2] = 1.0 - LOST
    force, accelerations, _ = simulate_impacts(true, SENSORS, 0.0, [0.01], [0.95], 0.3)
    return middle, force, accelerations


def track():
    true = world()
    r = true.rail
    return Track(
        Rail(r.bending, r.mass, r.shear, r.rotary, r.damping), true.position, true.pad, true.pad_damping, true.mass,
        true.ballast, true.ballast_damping, end_length=12.0, end_damping=400.0,
    )  # fmt: skip


def spectra(time, signals):
    return np.asarray(signals) @ np.exp(-2j * np.pi * np.outer(time, LINES))


def error_with(impact, terms, matrices=None):
    """Difference of the receptances of both codes over those of the generator, rms over lines and sensors."""
    _, force, accelerations = impact
    time = TIME_STEP * np.arange(force.size)
    truth = spectra(time, accelerations) / spectra(time, force)
    prepared = prepare(track(), 1.0 / RECEPTANCE.lifting_rate, "radau", terms, matrices=matrices)
    outcome = run(
        prepared, 0.3, [Probe(x) for x in SENSORS], pulses=[(0.0, lambda t: np.interp(t, time, force))]
    )  # fmt: skip
    found = spectra(outcome.time, outcome.signals) / spectra(outcome.time, np.interp(outcome.time, time, force))
    return float(np.sqrt(np.mean(np.abs(found - truth) ** 2) / np.mean(np.abs(truth) ** 2)))


def test_an_impact_beside_loose_fastenings_is_that_of_the_generator(impact):
    """Mesh and time step leave less than a tenth; a linear track errs by a third and more."""
    loose = (LooseFastening(impact[0] - 1, impact[0] + 1, LOST),)
    assert error_with(impact, loose) < 0.1
    assert error_with(impact, (), linear_matrices(track(), loose)) > 0.33
    assert error_with(impact, ()) > 0.33


def test_only_loose_fastenings_press_and_pull_with_different_stiffness():
    """A gap, friction and hardening are odd about rest: a tangent describes small impacts."""
    loose = LooseFastening(20, 20, 0.5)
    odd = (HangingSleeper(20, 3e-4), DryFriction(20, 1000.0), BallastHardening(19, 21, 3.0))
    assert bilinear_terms((*odd, loose, loose.neutral()), uniform_track(24.0)) == (loose,)
