"""A turnout with hammer tests alone: possible answers, and rejected input."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout import physics
from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch import diagnose
from turnout.mismatch.turnout import CampaignInput, TrackCase, receptance_observation, sensitivity
from turnout.mismatch.turnout.campaign import HammerInput
from turnout.mismatch.turnout.observed_tests import observe_tests
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.receptance_model import ReceptanceModel
from turnout.simulate import uniform_track
from turnout.simulate.frequency_response import receptance
from turnout.simulate.hammer import Hammer, simulate_hammer
from turnout.simulate.matrices import assemble
from turnout.simulate.sensor import Sensor
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.stages.finding_row import finding_row

IDENTITY = {"finding_id": "f", "turnout_id": "t", "section_id": None, "found_at_utc": None, "result_id": "r"}


@pytest.fixture(scope="module")
def plan():
    small = small_plan((5.0, 25.0), passages=False, hammer_positions=(21.6, 24.0))
    turnout = TurnoutTrack(uniform_track(21.6, start=12.0), {"main": ((),)})
    return replace(small, turnout=turnout, n_impacts=3, sensors=small.sensors[:3])


def diagnosis_of(plan, *terms, seed=3):
    case = TrackCase(measured_campaign(plan, terms, seed))
    return case, diagnose(case)


@pytest.mark.slow
def test_without_a_missing_effect_the_answer_is_none(plan):
    _, found = diagnosis_of(plan)
    assert found.verdict.answer == "none"
    assert found.verdict.probability > 0.5
    assert max(found.base.level.values()) < 1.6


@pytest.mark.slow
def test_warm_pads_are_named_from_two_temperatures(plan):
    _, found = diagnosis_of(plan, physics.PadTemperature(0.012))
    assert found.names[:1] == ("pad_temperature",)
    assert found.fit.psi[0] == pytest.approx(0.012, abs=0.001)
    row = finding_row(found, IDENTITY)
    assert row["term"] == "pad_temperature" and row["position_m"] is None and row["next_measurement"]
    assert "per kelvin" in row["sentence"]
    (estimate,) = json.loads(row["parameters_json"])
    # the row carries the fit's value, rounded to what its standard error is worth
    assert estimate["value"] == pytest.approx(found.fit.psi[0], abs=estimate["se"])


@pytest.mark.slow
def test_a_sensor_with_reversed_polarity_is_named(plan):
    """Its signal has the other sign in every band, which no delay causes."""
    _, found = diagnosis_of(plan, physics.SensorGain("S3", -1.0))
    assert found.names == ("sensor_gain",)
    assert found.fit.candidates[0].where == {"sensor": "S3"}
    assert abs(found.fit.psi[0] + 1.0) < 2.0 * found.fit.psi_se[0]


def test_a_campaign_without_recordings_is_an_error():
    with pytest.raises(SimulationError, match="neither a hammer test nor a passage"):
        CampaignInput(TurnoutTrack(uniform_track(12.0)), ())


def test_an_error_names_a_missing_reserved_recording(plan):
    campaign = measured_campaign(replace(plan, hammer_points=plan.hammer_points[:1]), seed=1)
    with pytest.raises(SimulationError, match="light 9"):
        replace(campaign, reserved=("light 9",))
    with pytest.raises(SimulationError, match="stands for two recordings"):
        replace(campaign, hammer=campaign.hammer * 2)
    with pytest.raises(SimulationError, match="nothing is left to fit"):
        TrackCase(replace(campaign, reserved=(campaign.hammer[0].name,)))


def test_fits_start_from_tests_that_are_not_held_out(plan):
    """The content of a reserved test does not matter, even if it is three times as large."""
    campaign, starts = measured_campaign(replace(plan, hammer_points=plan.hammer_points[:2]), seed=1), []
    kept = campaign.hammer[1]
    for factor in (1.0, 3.0):
        size = [[1.0 if c.name == kept.force else factor] for c in kept.recordings[0].channels]
        scaled = tuple(replace(r, samples=np.array(size) * r.samples) for r in kept.recordings)
        hammer = (campaign.hammer[0], replace(kept, recordings=scaled))
        starts.append(TrackCase(replace(campaign, hammer=hammer, reserved=(kept.name,)), families=()).start_values)
    assert starts[0] == starts[1] and any(starts[0].values())


def test_channels_without_impacts_are_left_out_with_a_note(plan):
    campaign = measured_campaign(replace(plan, hammer_points=plan.hammer_points[:2]), seed=1)
    silent = replace(campaign.hammer[0], recordings=campaign.hammer[0].recordings[:1])
    case = TrackCase(replace(campaign, hammer=(silent, campaign.hammer[1])))
    assert any("impacts 1" in note and "accepted impacts" in note for note in case.notes)
    assert {o.name.split(":")[0] for o in case.observations} == {"impacts 2"}
    with pytest.raises(SimulationError, match="nothing to diagnose"):
        TrackCase(replace(campaign, hammer=(silent,)))


def test_the_note_on_a_test_without_impacts_states_why_they_were_rejected(plan):
    campaign = measured_campaign(replace(plan, hammer_points=plan.hammer_points[:2]), seed=1)
    first = campaign.hammer[0]
    row = first.recordings[0].index(first.force)
    level = 0.6 * min(r.samples[row].max() for r in first.recordings)

    def limited(recording):
        samples = recording.samples.copy()
        samples[row] = np.minimum(samples[row], level)
        return replace(recording, samples=samples)

    clipped = replace(first, recordings=tuple(map(limited, first.recordings)))
    (note,) = (
        n
        for n in TrackCase(replace(campaign, hammer=(clipped, campaign.hammer[1])), families=()).notes
        if "accepted impacts" in n
    )
    assert first.name in note and "rejected, counted for each channel: overload, a channel left its range" in note


@pytest.mark.slow
def test_the_size_of_a_soft_rail_in_shear_refers_to_the_rail_of_the_file(plan):
    """The fits start from a rail that impacts have calibrated. The named size still refers to the rail of the file,
    4 per GN beside its own 4.1."""
    case, found = diagnosis_of(plan, physics.RailShear(4.0))
    assert case.predictor.rail["rail_shear"] < -0.05
    assert found.names[:1] == ("rail_shear",)
    assert abs(found.fit.psi[0] - 4.0) < 2.0 * found.fit.psi_se[0]


def test_a_shear_stiffness_is_applied_to_the_rail_that_impacts_calibrated():
    """A term of the rail is relative to its file; other values stay as impacts calibrated them, also for passages."""
    case = TrackCase(measured_campaign(small_plan((15.0,), hammer_positions=(24.0,), passages=False), (), 3))
    predictor = case.predictor.recentre({"rail_bending": 0.03, "rail_shear": -0.2})
    file, bent = predictor.site.nominal.turnout.track.rail, predictor.track().rail
    assert bent.shear_stiffness == pytest.approx(np.exp(-0.2) * file.shear_stiffness)
    sheared = predictor.track(terms=(physics.LocalPad(3, 2.0), physics.RailShear(2.0))).rail
    assert sheared.shear_stiffness == file.shear_stiffness
    assert sheared.bending_stiffness == pytest.approx(np.exp(0.03) * file.bending_stiffness)
    assert predictor.track(terms=(physics.LocalPad(3, 2.0),)).rail == bent
    predictor = predictor.recentre({"rail_bending": 0.01})
    assert predictor.track(terms=(physics.RailShear(2.0),)).rail.bending_stiffness < sheared.bending_stiffness


def test_a_receptance_is_that_of_the_rail_also_far_from_the_file(plan):
    """A rail whose shear stiffness is exp(-0.41) of its file's: the receptance is that of such a rail, to 1e-3."""
    case = TrackCase(measured_campaign(plan, (), 3))
    (name, pair), *_ = case.frf_pairs.items()
    values = {n.name: n.mean for n in case.nuisances} | {"rail_shear": -0.41}
    (found,) = case.predict(values, (), [o for o in case.observations if o.name == name])
    track = case.data.site.nominal.turnout.track
    softer = replace(track.rail, shear_stiffness=track.rail.shear_stiffness * np.exp(-0.41))
    model = ReceptanceModel(track.with_(rail=softer), ())
    exact = receptance_observation.split_complex(
        receptance_observation.scale_lines(pair, model.receptance(pair.test.place, model.position_of(pair.sensor)))
    )
    assert np.linalg.norm(found - exact) < 1e-3 * np.linalg.norm(exact)


def test_an_impact_is_not_compared_at_sensors_far_from_it():
    """At 8 m the tolerance of a model has 1 + (8 / 1.5)^2 = 29 times its variance at the impact."""
    plan = small_plan((15.0,), hammer_positions=(20.4, 30.0), passages=False)
    pairs = observe_tests(measured_campaign(plan), MismatchSettings().pair_tolerance).frf_pairs
    compared = {(p.test.place, p.channel) for p in pairs.values()}
    assert compared == {(20.4, s.name) for s in plan.sensors} | {(30.0, "S2"), (30.0, "S3"), (30.0, "S4")}


@pytest.mark.parametrize(("spacing", "lower"), [(0.55, 880.0), (0.72, 640.0)])
def test_impacts_are_compared_below_the_pinned_pinned_resonance_alone(plan, spacing, lower):
    """Bending alone: 512.9 / 0.72^2 = 989 Hz; shear and rotary inertia leave 796 Hz, of which 85 % are used."""
    track = uniform_track(36.0, start=6.0, spacing=spacing)
    pinned_pinned = track.rail.pinned_pinned_frequency(spacing)
    plan = replace(plan, turnout=TurnoutTrack(track, {"main": ((),)}))
    pairs = observe_tests(measured_campaign(plan, (), 3), MismatchSettings().pair_tolerance).frf_pairs
    highest = max(p.frequency.max() for p in pairs.values())
    assert lower < highest < min(900.1, 0.86 * pinned_pinned)


def test_a_channel_whose_impacts_are_all_rejected_is_stated_once(plan):
    campaign, tolerance = measured_campaign(plan), MismatchSettings().pair_tolerance
    assert observe_tests(campaign, tolerance).notes == ()
    name = campaign.sensors[1].name

    def drop_out(recording):
        samples, row = recording.samples.copy(), recording.index(name)
        first = int(np.argmax(np.abs(samples[row]))) + 3
        samples[row, first : first + 60] = samples[row, first]
        return replace(recording, samples=samples)

    tests = observe_tests(campaign.with_recordings("hammer tests", drop_out), tolerance)
    n = len(campaign.hammer)
    assert n > 1 and name not in {p.channel for p in tests.frf_pairs.values()}
    (note,) = tests.notes
    assert note.startswith(f"channel {name} is not used in {n} of {n} hammer tests (drop_out: ")


@pytest.mark.slow
@pytest.mark.parametrize(("limit", "most"), [(1000.0, 0.8), (4000.0, 0.45)])
def test_dry_friction_slips_at_a_low_limit_and_sticks_at_a_high_one(plan, limit, most):
    """Time histories with dry friction against its equivalent damper: a common rate for both limits leaves 0.77 and
    0.54 of the change at 20 mm/s, 0.98 and 0.41 at 2 mm/s."""
    plan = replace(plan, turnout=TurnoutTrack(uniform_track(36.0, start=6.0), {"main": ((),)}))
    support = plan.turnout.track.nearest_support(22.2)
    case = TrackCase(measured_campaign(plan, (physics.DryFriction(support, limit),), 3))
    values = {n.name: n.mean for n in case.nuisances}
    term = physics.DryFriction(case.data.site.nominal.turnout.track.nearest_support(22.2), limit)
    before, after = (case.predict(values, terms, case.observations) for terms in ((), (term,)))
    left, change = (sum(np.sum((o.data - p) ** 2) for o, p in zip(case.observations, q)) for q in (after, before))
    assert left < most**2 * change


def test_a_derivative_uses_the_side_on_which_the_simulation_succeeds():
    """A passage is quadratic in the load and fails above a limit: the slope from below is 2 x 3 less the step."""

    def simulated(values, terms, made, with_probes):
        if values["load"] > 3.0:
            raise SimulationError("too heavy")
        return np.array([values["load"] ** 2])

    predictor = SimpleNamespace(predict_passage=simulated)
    found = sensitivity._quotient(predictor, {"load": 3.0}, (), None, np.array([9.0]), "load", 0.1)
    assert found == pytest.approx([5.9])


@pytest.mark.slow
def test_a_record_that_ends_before_the_decay_gives_the_receptance_of_the_model():
    """Ballast of 2 % of critical damping, as under the switch panel at Tommerup: a record of 0.15 s lacks the last
    tenth of the motion, which changes a quotient of transforms at 36 Hz by a quarter."""
    values = {"ballast_stiffness": 238e6, "ballast_damping": 7.9e3, "sleeper_mass": 170.0}
    track, sensor = uniform_track(60.0, **values), Sensor("S1", 30.0)
    recordings = simulate_hammer(track, 30.0, Hammer(position_spread=0.0), (sensor,), 4, seed=5, duration=0.15)
    assert recordings[0].duration == pytest.approx(0.15)
    test = HammerInput("impacts", 30.0, recordings, "hammer", "", {})
    ((pair, seen),) = receptance_observation.pairs_of_test(test, (sensor,), 0.03)
    n = pair.lines.size
    measured = (seen.data[:n] + 1j * seen.data[n:]) * pair.size
    model = receptance(assemble(track), receptance_observation.SHIFTED_LINES[pair.lines], 30.0, 30.0)
    low = pair.frequency < 300.0
    assert low.sum() > 20 and pair.frequency[0] < 40.0
    # 0.1 s after the impact exp(-(21 + 20) 0.1 s) = 1.7 % are left, and an amplifier of 0.4 Hz turns 36 Hz by 1.1 %
    assert np.max(np.abs(measured / model - 1.0)[low]) < 0.04
