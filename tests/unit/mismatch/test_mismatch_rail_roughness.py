"""Usual roughness beyond the stretch of free waves is no mismatch on track with a low decay rate."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.mismatch.intact_campaigns import intact_campaign

from turnout import physics
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.observed_passages import with_errors
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.priors import TRACK
from turnout.mismatch.turnout.rail_roughness import amplitude_sd, wave_columns
from turnout.simulate.roughness import level


@pytest.fixture(scope="module")
def lightly_damped():
    """A case, values of a track with a low decay rate, and a heavy train at 144 km/h with its errors there."""
    case = TrackCase(intact_campaign((24.0,), 7))
    values = {n.name: case.start_values.get(n.name, n.mean) for n in case.nuisances}
    values |= {"ballast_damping": -1.6, "pad_damping": -0.7}
    (seen,) = (o for o in case.observations if o.name == "heavy 2")
    return case, values, with_errors(case.predictor, values, case.aligned_passages[seen.name], seen)


@pytest.mark.slow
@pytest.mark.parametrize(("behind", "wavelength"), [(False, 0.36), (True, 0.3)])
def test_the_errors_of_a_passage_include_rough_rail_beyond_the_free_waves(lightly_damped, behind, wavelength):
    """The whole limit of ISO 3095 in a third octave, as one line, is one standard deviation of the errors: no sample
    may exceed two. Without these errors some exceed three, with a mean square near the control level.
    """
    case, values, seen = lightly_damped
    allowed = np.sqrt(2.0) * 1e-6 * 10.0 ** (float(level(np.array([wavelength]), 0.0)[0]) / 20.0)
    waves = case.predictor.waves
    a, b = (waves.end + 0.5, waves.end + 4.5) if behind else (waves.start - 4.5, waves.start - 0.5)
    rough = physics.RailCorrugation(a, b, allowed, 0.0, wavelength)
    plain, with_it = (case.predict(values, terms, [seen])[0] for terms in ((), (rough,)))
    squares = [o.whiten(with_it - plain) ** 2 for o in (replace(seen, modes=None), seen)]
    assert np.mean(squares[0]) > 0.5 and np.max(squares[0]) > 9.0
    assert np.max(squares[1]) < 4.0


def test_candidates_of_a_mass_on_the_rail_are_over_sleepers_and_in_the_middle_between_them(lightly_damped):
    case, _, _ = lightly_damped
    masses = [c for c in case.candidates if c.family == "attached_resonator"]
    over = sorted(c.position for c in masses if "sleeper" in c.where)
    between = sorted(c.position for c in masses if "sleeper" not in c.where)
    assert len(over) > 3
    assert np.allclose(between, 0.5 * (np.array(over[:-1]) + over[1:]), atol=1e-3, rtol=0.0)  # rounded to mm
    track = case.predictor.track()
    node = {c.position: c.term(c.starts[0]).links(track)[0].ends[0][0] for c in masses}
    assert {node[x][:1] + node[x][2:] for x in over} == {("rail",)}
    assert {node[x][:1] + node[x][2:] for x in between} == {("rail", track.elements_per_bay // 2)}


def test_no_effect_is_tested_more_than_a_bay_beyond_the_measured_range(lightly_damped):
    """Effects farther out cannot be distinguished from each other; they have values and no names."""
    case, _, _ = lightly_damped
    measured = case.campaign.positions()
    positions = [c.where["place"] for c in case.candidates if "sleeper" in c.where]
    free = case.predictor.track().support[list(case.predictor.zone.supports)]
    assert min(positions) >= min(measured) - TRACK.effect_reach and max(positions) <= max(measured) + TRACK.effect_reach
    assert free.min() < min(positions) and free.max() > max(positions)
    assert {"local_pad", "local_ballast", "hanging_sleeper"} <= {c.family for c in case.candidates}


@pytest.fixture(scope="module")
def slow_train():
    """A case with a train at 72 km/h, whose band ends at 67 Hz, and the errors of this passage."""
    case = TrackCase(measured_campaign(small_plan((15.0,), (20.0,), hammer_positions=(24.0,)), (), 7))
    values = {n.name: case.start_values.get(n.name, n.mean) for n in case.nuisances}
    (seen,) = (o for o in case.observations if o.name == "heavy 1")
    return case, values, with_errors(case.predictor, values, case.aligned_passages[seen.name], seen)


@pytest.mark.parametrize("wavelength", [0.293, 0.286])
def test_ordinary_waves_beyond_the_band_leave_no_evidence_for_other_effects(slow_train, wavelength):
    """A wave of one prior standard deviation raises the cost of a joint fit by its prior penalty at most, 1.

    Its frequency is beyond the band, but its line is wide, since a wheel passes a sensor in a short time. So a part is
    within the band. Without free waves of this length the cost rises by 8, which would be evidence for a sharp dip.
    """
    case, values, seen = slow_train
    change = _whitened_change(slow_train, wavelength)
    waves = wave_columns(case.predictor, values, (), case.aligned_passages[seen.name]) * case.predictor.waves.sd
    columns = np.sqrt(seen.effective) * seen.whiten(waves)
    along = columns.T @ change
    assert change @ change - along @ np.linalg.solve(columns.T @ columns + np.eye(along.size), along) < 1.0


def test_waves_just_below_the_shortest_free_one_have_no_visible_effect(slow_train):
    """The first harmonic that is not free adds less than a tenth in chi-squared; from 0.3 m on it would add 12."""
    waves = slow_train[0].predictor.waves
    change = _whitened_change(slow_train, waves.length / (round(waves.length / waves.lengths.min()) + 1))
    assert change @ change < 0.1


@pytest.mark.parametrize(("centre", "offset"), [(0.8, 0.0), (0.4, 6.0)])
def test_the_waves_of_a_third_octave_have_the_power_of_the_limit_curve(centre, offset):
    """ISO 3095: 10^(L / 10) µm², here the mean over the octave. Cosine and sine of one standard deviation each are a
    wave of this variance. 0.5 %: whole waves in a period of 2 km, and the width of the band for its logarithm."""
    length, edge = 2000.0, 2.0 ** (1 / 6)
    orders = np.arange(np.ceil(length / (centre * edge)), length * edge / centre)
    power = np.sum(amplitude_sd(length / orders, length, offset) ** 2)
    wavelengths = np.geomspace(centre / edge, centre * edge, 20001)
    expected = 1e-12 * np.mean(10.0 ** ((level(wavelengths, 0.0) + offset) / 10.0))
    assert power == pytest.approx(expected, rel=5e-3, abs=0.0)


def _whitened_change(passage, wavelength):
    """(n,) simulated change of a passage by a wave of one prior standard deviation along all free waves."""
    case, values, seen = passage
    waves = case.predictor.waves
    size = float(amplitude_sd(np.array([wavelength]), waves.length, 0.0)[0])
    rough = physics.RailCorrugation(waves.start, waves.end, size, 0.0, wavelength)
    plain, with_it = (case.predict(values, terms, [seen])[0] for terms in ((), (rough,)))
    return np.sqrt(seen.effective) * seen.whiten(with_it - plain)
