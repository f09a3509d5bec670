"""Corrugation above the simulated band: found by its wavelength, with a size by the receptance of the track."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout import physics
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.candidates.corrugation_levels import (
    BandPower,
    bin_wavelengths,
    corrugation_evidence,
    is_repeatable,
    n_widths,
    sensor_stretches,
    stretch_evidence,
)
from turnout.mismatch.turnout.candidates.short_corrugation import (
    ambiguous_line,
    line_wavelength,
    short_corrugation_candidates,
)
from turnout.mismatch.turnout.defect_priors import CORRUGATION
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.simulate.wheel_path import Corrugation


def corrugation_findings(*terms, seed=7, plan=None):
    case = TrackCase(measured_campaign(plan or small_plan((15.0,), hammer_positions=()), terms, seed))
    return case, short_corrugation_candidates(
        case, SimpleNamespace(candidates=(), values={n.name: n.mean for n in case.nuisances})
    )


@pytest.mark.parametrize(("size", "wavelength", "seed"), [(3e-5, 0.16, 7), (2e-5, 0.09, 9)])
def test_short_corrugation_is_found_with_its_wavelength_and_its_size(size, wavelength, seed):
    """In recordings at 10 kHz with roughness, noise, scattered supports; both are in the stated 95 % intervals."""
    _, (found,) = corrugation_findings(physics.RailCorrugation(20.5, 27.0, size, 0.3 * size, wavelength), seed=seed)
    for p, true in zip(found.parameters, (1.044 * size, wavelength)):  # sine and cosine: hypot(1, 0.3)
        assert p.prior[0] == pytest.approx(true, abs=1.96 * p.prior[1])
    assert found.parameters[0].prior[1] < 0.35 * size and found.parameters[1].prior[1] < 0.04 * wavelength
    assert 20.5 < found.where["place"] < 27.0


def test_intact_rail_and_the_wheel_of_one_train_are_no_corrugation():
    assert corrugation_findings(seed=8)[1] == ()
    assert corrugation_findings(physics.OutOfRound(1, 5e-5, 1.5e-5, 20, train="heavy"))[1] == ()


def test_one_train_alone_does_not_distinguish_a_rail_from_wheels():
    plan = small_plan((15.0,), hammer_positions=())
    plan = SimpleNamespace(**{**vars(plan), "trains": tuple(t for t in plan.trains if t.name == "heavy")})
    case, found = corrugation_findings(physics.RailCorrugation(20.5, 27.0, 3e-5, 0.0, 0.16), plan=plan)
    line = ambiguous_line(case)
    assert found == () and line.nats > 12.0 and "waves of the wheels of this train" in line.words
    assert ambiguous_line(corrugation_findings(plan=plan)[0]) is None
    assert [u.words for u in case.unmet_requirements if u.effect == "rail_corrugation"] == [
        "corrugation shorter than 0.3 m"
    ]


def findings_with_hum(speeds, seed=5):
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
    found = short_corrugation_candidates(
        case, SimpleNamespace(candidates=(), values={n.name: n.mean for n in case.nuisances})
    )
    return found, ambiguous_line(case)


def test_a_hum_is_no_corrugation_and_trains_of_one_speed_are_not_enough():
    """At one speed the answer states the line, its frequency, possible causes, and a measurement that would decide."""
    assert findings_with_hum((28.0, 40.0, 28.4, 39.5)) == ((), None)
    found, line = findings_with_hum((28.0, 28.4, 28.2, 28.3))
    assert found == () and line.nats > 12.0
    assert (
        re.search("1(49|50) Hz", line.words) and "a vibration of this frequency" in line.words and "0.18" in line.words
    )
    assert "wheels" not in line.words and line.measurement == "passages at speeds a quarter apart"


def test_passages_of_exactly_one_speed_have_one_group_of_speeds():
    levels = np.zeros((4, 1))
    equal = passages_with(levels, trains=(("x", 20.0), ("x", 20.0), ("y", 20.0)))
    assert np.isfinite(corrugation_evidence(equal, POSITIONS)).all()


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


POSITIONS = np.array([2.1, 4.2, 6.6, 9.0])  # m, more than 2 m apart: each measures different rail
TRAINS = (("x", 20.0), ("x", 25.0), ("y", 30.0), ("y", 38.0))


def passages_with(levels, positions=POSITIONS, trains=TRAINS):
    """``BandPower`` of each train with ``levels`` (n_sensor, n_bin), or one such array per passage."""
    levels = np.broadcast_to(levels, (len(trains), len(positions), np.shape(levels)[-1]))
    return [
        BandPower(str(k), t, v, np.exp(x), np.ones(x.shape), np.ones(len(x), bool), np.asarray(positions))
        for k, ((t, v), x) in enumerate(zip(trains, levels))
    ]


def expected_nats(z, n_sensors):
    """By quadrature over what corrugation adds to the mean level z of so many sensors, N(0, corrugation_sd²)."""
    sd, added = CORRUGATION.sensor_sd / np.sqrt(n_sensors), np.linspace(-40.0, 40.0, 200001)
    log_prior = -0.5 * (added / CORRUGATION.corrugation_sd) ** 2
    density = np.exp(log_prior) / (CORRUGATION.corrugation_sd * np.sqrt(2.0 * np.pi))
    return np.log(np.trapezoid(density * np.exp(-0.5 * ((z - added) / sd) ** 2 + 0.5 * (z / sd) ** 2), added))


def test_a_line_in_one_half_of_the_passages_alone_is_no_finding():
    """By the line in each passage, which an equal wave would have in all; sensors beyond the stretch do not count."""

    def passages_with_line(*levels):
        levels = [np.array([[x], [x], [0.0], [0.0]]) for x in levels]
        return passages_with(levels)

    stretch = (2.1, 4.2)
    assert is_repeatable(passages_with_line(2.0, 1.5, 1.8, 1.2), 0, stretch)
    assert not is_repeatable(passages_with_line(2.0, 0.4, 1.8, 0.5), 0, stretch)
    assert not is_repeatable(passages_with_line(0.4, 2.0, 0.5, 1.8), 0, stretch)


def test_the_evidence_of_a_stretch_is_that_of_a_level_integrated_out():
    """The lowest level of trains and speeds counts; quiet sensors do not."""
    levels = [np.array([[1.9, 0.4], [1.1, -3.0], [1.5, 0.2]]) + (t == "y") for t, _ in TRAINS]
    nats = stretch_evidence(passages_with(levels, POSITIONS[:3]), POSITIONS[:3])
    for row, (first, last) in zip(nats, sensor_stretches(POSITIONS[:3])):
        inside = (POSITIONS[:3] >= first) & (POSITIONS[:3] <= last)
        z = np.maximum(levels[0][inside].mean(axis=0), 0.0)
        np.testing.assert_allclose(row, [expected_nats(v, inside.sum()) for v in z], atol=1e-6)


@pytest.mark.parametrize("first", range(4))
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_the_penalty_of_an_unknown_stretch_is_at_most_that_of_the_number_of_stretches(first, n):
    """For any ends: the evidence of the true stretch less ln 10 at most."""
    if first + n > 4:
        return
    level = np.zeros((4, 1))
    level[first : first + n] = 4.0
    nats = corrugation_evidence(passages_with(level), POSITIONS)[0]
    known = expected_nats(4.0, n)
    assert known - np.log(10.0) <= nats <= known


def test_sensors_beyond_the_corrugation_are_no_evidence_against_it():
    """A mean over all sensors would lose the evidence as their number grows."""
    many = 2.1 * np.arange(1, 13)
    level = np.where((many > 5.0) & (many < 9.0), 4.0, 0.0)[:, None]  # two of twelve
    nats = corrugation_evidence(passages_with(level, many), many)[0]
    assert nats > expected_nats(4.0, 2) - np.log(78.0) > 12.0


def test_levels_of_intact_rail_are_rarely_evidence():
    """The mean of the likelihood ratio is 1 at most on intact rail: above x nats with the probability exp(-x) at most.

    Rail of the stated scatter under each sensor, the same in all passages. Sensors that measure the same rail agree.
    """
    rng = np.random.default_rng(4)
    level = CORRUGATION.sensor_sd * rng.standard_normal((4, 20000))
    for positions, rail in ((POSITIONS, level), (POSITIONS[0] + 1e-3 * np.arange(4), level[[0] * 4])):
        nats = corrugation_evidence(passages_with(rail, positions), positions)
        assert np.mean(np.exp(nats)) < 1.1
        for x in (2.0, 4.0):
            assert np.mean(nats > x) <= np.exp(-x) + 1e-3


def test_the_best_of_overlapping_bins_is_rarely_evidence():
    """Bins are means of two halves, of which the neighbour has one. The price is that of the bins side by side."""
    rng = np.random.default_rng(6)
    halves = CORRUGATION.sensor_sd * np.sqrt(2.0) * rng.standard_normal((4, 4000, 73))
    rail = 0.5 * (halves[..., 1:] + halves[..., :-1])
    nats = corrugation_evidence(passages_with(rail.reshape(4, -1)), POSITIONS).reshape(4000, 72)
    best = nats.max(axis=1) - np.log(n_widths(np.arange(72.0)))
    for x in (1.0, 3.0):
        assert np.mean(best > x) <= np.exp(-x)


def test_a_line_of_one_train_or_of_one_speed_is_no_evidence_in_any_stretch():
    for loud in (lambda t, v: t == "x", lambda t, v: v > 26.0, lambda t, v: v < 26.0):
        levels = [np.full((4, 1), 5.0 * loud(t, v)) for t, v in TRAINS]
        assert corrugation_evidence(passages_with(levels), POSITIONS)[0] < 0.0


def test_a_sensor_without_a_signal_gives_no_evidence():
    """Neither for its stretch nor for another one."""
    level = np.array([[0.0], [0.0], [4.0]])
    quiet = corrugation_evidence(passages_with(level[:2], POSITIONS[:2]), POSITIONS)[0]
    assert quiet < 0.0 < corrugation_evidence(passages_with(level, POSITIONS[:3]), POSITIONS)[0]


def test_one_of_the_bins_contains_nearly_the_whole_line():
    """At least three quarters of the width of a bin, for any frequency of the line."""
    train = SimpleNamespace(speed=30.0, passage=SimpleNamespace(recording=SimpleNamespace(rate=10000.0)))
    bins = bin_wavelengths([train])
    length = np.random.default_rng(2).uniform(0.06, 0.29, 200)
    distance = np.abs(np.log(length[:, None] / bins)).min(axis=1)
    assert distance.max() <= 0.25 * CORRUGATION.bin_width + 1e-9


def test_the_centre_of_a_line_and_not_its_bin_decides_whether_it_is_short():
    """One of 0.292 m, with the bin of 0.3 m or its neighbours chosen; beyond the stretch there are other lines."""
    train = SimpleNamespace(speed=30.0, passage=SimpleNamespace(recording=SimpleNamespace(rate=10000.0)))
    bins = bin_wavelengths([train])
    level = np.log(
        1.0 + 60.0 * np.exp(-0.5 * (np.log(bins / np.array([[0.292], [0.292], [0.35], [0.35]])) / 0.02) ** 2)
    )
    nearest = int(np.argmin(np.abs(bins - 0.3)))
    for k in (nearest - 1, nearest, nearest + 1):
        assert line_wavelength(bins, k, passages_with(level), (2.1, 4.2)) == pytest.approx(0.292, rel=0.005)
