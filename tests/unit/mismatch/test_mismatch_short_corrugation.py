"""Corrugation above the band that is simulated: found by its wavelength, sized by the track's receptance."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout import physics
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.candidates.short_corrugation import (
    BandPower,
    _is_repeatable,
    corrugation_evidence,
    short_corrugation_candidates,
)
from turnout.mismatch.turnout.defect_priors import CORRUGATION
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.simulate.wheel_path import Corrugation


def looked_at(*terms, seed=7, plan=None):
    case = TrackCase(measured_campaign(plan or small_plan((15.0,), hammer_positions=()), terms, seed))
    return case, short_corrugation_candidates(
        case, SimpleNamespace(candidates=(), values={n.name: n.mean for n in case.nuisances})
    )


@pytest.mark.parametrize(("size", "wavelength", "seed"), [(3e-5, 0.16, 7), (2e-5, 0.09, 9)])
def test_short_corrugation_is_found_with_its_wavelength_and_its_size(size, wavelength, seed):
    """In recordings at 10 kHz with roughness, noise, scattered supports; both within 95 % of what is stated."""
    _, (found,) = looked_at(physics.RailCorrugation(20.5, 27.0, size, 0.3 * size, wavelength), seed=seed)
    for p, true in zip(found.parameters, (1.044 * size, wavelength)):  # sine and cosine: hypot(1, 0.3)
        assert p.prior[0] == pytest.approx(true, abs=1.96 * p.prior[1])
    assert found.parameters[0].prior[1] < 0.35 * size and found.parameters[1].prior[1] < 0.04 * wavelength
    assert 20.5 < found.where["place"] < 27.0


def test_sound_rail_and_the_wheel_of_one_train_are_no_corrugation():
    assert looked_at(seed=8)[1] == ()
    assert looked_at(physics.OutOfRound(1, 5e-5, 1.5e-5, 20, train="heavy"))[1] == ()


def test_one_train_alone_cannot_tell_a_rail_from_wheels():
    plan = small_plan((15.0,), hammer_positions=())
    plan = SimpleNamespace(**{**vars(plan), "trains": tuple(t for t in plan.trains if t.name == "heavy")})
    assert looked_at(physics.RailCorrugation(20.5, 27.0, 3e-5, 0.0, 0.16), plan=plan)[1] == ()


def hummed(speeds, seed=5):
    """Two trains at these speeds [m/s], a hum of 150 Hz in all sensors, as strong as the passage itself."""
    plan = small_plan((15.0,), hammer_positions=())
    trains = [replace(t, speed=v) for t, v in zip(plan.trains, speeds)]
    campaign = measured_campaign(SimpleNamespace(**{**vars(plan), "trains": tuple(trains)}), (), seed)
    passages = []
    for p in campaign.passages:
        time = np.arange(p.recording.samples.shape[1]) / p.recording.rate
        hum = np.std(p.recording.samples) * np.sin(2.0 * np.pi * 150.0 * time)
        passages.append(replace(p, recording=replace(p.recording, samples=p.recording.samples + hum)))
    case = TrackCase(replace(campaign, passages=tuple(passages)))
    return short_corrugation_candidates(
        case, SimpleNamespace(candidates=(), values={n.name: n.mean for n in case.nuisances})
    )


def test_a_hum_is_no_corrugation_nor_can_trains_of_one_speed_tell():
    assert hummed((28.0, 40.0, 28.4, 39.5)) == ()
    assert hummed((28.0, 28.4, 28.2, 28.3)) == ()


def test_corrugation_in_the_tracks_file_is_not_found_again():
    plan, true = small_plan((15.0,), hammer_positions=()), physics.RailCorrugation(20.5, 27.0, 3e-5, 0.0, 0.16)
    surfaces = {"main": ((Corrugation(20.5, 27.0, 3e-5, 0.16),),)}
    known = SimpleNamespace(**{**vars(plan), "turnout": replace(plan.turnout, routes=surfaces)})
    campaign = replace(measured_campaign(plan, (true,), 7), turnout=known.turnout)
    case = TrackCase(campaign)
    assert (
        short_corrugation_candidates(
            case, SimpleNamespace(candidates=(), values={n.name: n.mean for n in case.nuisances})
        )
        == ()
    )


def test_what_one_half_of_the_passages_does_not_show_is_no_finding():
    """By the line in each; where an equal wave is in all it holds."""

    def seen(*levels):
        return [
            BandPower("p", "t", 30.0, np.exp(np.full((2, 1), x)), np.ones((2, 1)), np.ones(2, bool)) for x in levels
        ]

    assert _is_repeatable(seen(2.0, 1.5, 1.8, 1.2), 0)
    assert not _is_repeatable(seen(2.0, 0.4, 1.8, 0.5), 0) and not _is_repeatable(seen(0.4, 2.0, 0.5, 1.8), 0)


def test_the_evidence_is_that_of_a_loudness_integrated_out():
    """By quadrature over what corrugation adds, N(0, LOUD²); the least of the trains counts, what is quiet does not."""
    level = np.array([[1.9, 0.4], [1.1, -3.0], [1.5, 0.2]])
    sound, all_ = np.ones((3, 2)), np.ones(3, dtype=bool)
    louder = [
        BandPower(n, n, v, np.exp(level + more), sound, all_) for n, v, more in (("x", 20.0, 0.0), ("y", 30.0, 1.0))
    ]
    sd, added = CORRUGATION.sensor_sd / np.sqrt(3.0), np.linspace(-40.0, 40.0, 200001)
    prior = np.exp(-0.5 * (added / CORRUGATION.corrugation_sd) ** 2) / (
        CORRUGATION.corrugation_sd * np.sqrt(2.0 * np.pi)
    )
    for z, nats in zip((1.5, 0.0), corrugation_evidence(louder, 3.0)):
        ratio = np.exp(-0.5 * ((z - added) / sd) ** 2 + 0.5 * (z / sd) ** 2)
        assert nats == pytest.approx(np.log(np.trapezoid(prior * ratio, added)), abs=1e-6)
