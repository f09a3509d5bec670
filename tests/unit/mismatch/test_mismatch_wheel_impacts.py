"""Impacts at one position, of any cause: found above the rolling noise by the wheels that pass there."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.unit.mismatch.intact_campaigns import intact_campaign

from turnout.mismatch.engine.localization import location_of_ambiguity
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout import wheel_impacts as module
from turnout.mismatch.turnout.defect_priors import IMPACTS
from turnout.mismatch.turnout.wheel_impacts import (
    ImpactSignal,
    _known_stretches,
    _signal,
    impact_levels,
    impact_signals,
    wheel_impacts,
)
from turnout.simulate.wheel_path import Corrugation, Kink

SENSORS, RATE = np.array([2.0, 4.1, 6.2, 8.3]), 200.0  # positions [m], bins per second


def signal(train, speed, n_axle, rng, impacts=None, direction=1.0, channel=None, turn=None):
    """A passage whose level falls with the distance of the wheels; ``impacts`` (position, wheels, level): of them.

    ``turn`` [m]: every axle is one further, and the first wheel has an impact at 3.1 m and every turn from there.
    """
    time = np.arange(0.0, 60.0 / speed, 1.0 / RATE)
    axles = np.concatenate([[0.0, 2.7], [14.0, 16.7], [20.0, 22.7], [34.0, 36.7]])[:n_axle]
    axles = axles if turn is None else turn * np.arange(n_axle)
    wheels = direction * (speed * time[:, None] - axles - 10.0) + (0.0 if direction > 0 else 10.0)
    distance = np.min(np.abs(wheels[None] - SENSORS[:, None, None]), axis=2)
    level = -0.4 * distance + np.log(rng.chisquare(10, distance.shape) / 10)
    if impacts is not None:
        position, which, loudness = impacts if len(impacts) == 3 else (*impacts, 5.0)
        near = np.any(np.abs(wheels[:, which] - position) < 0.25, axis=1)
        recorded = np.ones(SENSORS.size, bool) if channel is None else np.arange(SENSORS.size) == channel
        level += np.where(near & recorded[:, None], loudness, 0.0)
    if turn is not None:
        level += 5.0 * (np.abs((wheels[:, 0] - 3.1 + 0.5 * turn) % turn - 0.5 * turn) < 0.25)
    names = tuple(f"A{i}" for i in range(SENSORS.size))
    return ImpactSignal(train, level, names, SENSORS, wheels, 0.0, np.ones(time.size, dtype=bool))


def visit(seed, impacts=lambda train, k: None, **options):
    rng = np.random.default_rng(seed)
    trains = [("a", 25.0, 8), ("b", 31.0, 4), ("a", 38.0, 8), ("b", 22.0, 4), ("a", 29.0, 8), ("b", 35.0, 4)]
    return [signal(t, v, n, rng, impacts(t, k), **options) for k, (t, v, n) in enumerate(trains)]


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("position", [2.9, 5.3, 7.7])
def test_impacts_of_many_wheels_are_located(position, direction):
    levels = impact_levels(visit(1, lambda t, k: (position, slice(None)), direction=direction))
    assert levels.evidence() > 12.0 and abs(levels.position() - position) < 0.5


def at(position, wheels=slice(None), level=5.0):
    return (position, wheels, level)


def test_impacts_of_one_train_alone_belong_to_the_train():
    """A part may rattle under one train only, and a flat causes impacts while other wheels of its train are there."""
    levels = impact_levels(visit(2, lambda t, k: at(5.3) if k == 2 else None))
    assert levels.evidence() > 12.0 and levels.train() == "a" and abs(levels.position() - 5.3) < 0.5
    both = impact_levels(visit(2, lambda t, k: at(5.3) if k in (2, 3) else None))
    assert both.evidence() > 12.0 and both.train() is None


@pytest.mark.parametrize("level", [2.0, 3.0])
def test_a_train_with_stronger_impacts_does_not_hide_those_of_the_others(monkeypatch, level):
    """Others also cause weak impacts there: all count as evidence, for track or train."""
    levels = impact_levels(visit(2, lambda t, k: at(5.3, level=6.0 if t == "a" else level)))
    monkeypatch.setattr(module, "impact_signals", lambda case: [])
    monkeypatch.setattr(module, "impact_levels", lambda signals: levels)
    assert wheel_impacts(None).nats == levels.evidence() > 12.0 > module._evidence(levels.common)


def test_impacts_of_a_few_wheels_of_several_trains_belong_to_no_train():
    """Without one of three trains fewer wheels than the minimum remain, and no train alone has the minimum."""
    rng = np.random.default_rng(3)
    passages = [signal(t, v, 8, rng, at(5.3, slice(0, 2))) for t, v in (("a", 25.0), ("b", 31.0), ("c", 38.0))]
    levels = impact_levels(passages)
    assert levels.evidence() > 12.0 and levels.train() is None and abs(levels.position() - 5.3) < 0.5


def test_impacts_of_one_wheel_once_a_turn_belong_to_its_train():
    """Axles are a turn apart, so that another wheel of the train is at 3.1 m at each impact."""
    rng = np.random.default_rng(3)
    passages = [signal("flat", v, 8, rng, turn=2.7) for v in (25.0, 29.0, 38.0)]
    passages += [signal("b", v, 4, rng) for v in (31.0, 22.0)]
    levels = impact_levels(passages)
    assert levels.evidence() > 12.0 and levels.train() == "flat"


def test_intact_track_a_flat_and_a_faulty_channel_are_no_impacts_at_a_position():
    assert max(impact_levels(visit(seed)).evidence() for seed in range(8)) < 0.0
    flat = impact_levels(visit(3, lambda t, k: (3.0 + 1.1 * k, slice(2, 3)) if t == "a" else None))
    assert flat.evidence() < 3.0
    channel = impact_levels(visit(4, lambda t, k: (4.1, slice(None)), channel=1))
    assert channel.evidence() < 3.0


def test_fewer_wheels_than_must_agree_give_no_level():
    rng = np.random.default_rng(5)
    assert impact_levels([signal("b", 30.0, 4, rng) for _ in range(6)]) is None and impact_levels([]) is None


def test_bins_near_a_known_irregularity_do_not_count_at_any_position():
    passages = visit(6, lambda t, k: (5.3, slice(None)))
    free = [replace(s, is_free=~np.any((s.wheels > 4.3) & (s.wheels < 7.3), axis=1)) for s in passages]
    assert impact_levels(passages).evidence() > 12.0 and impact_levels(free).evidence() < 0.0
    parts = (Kink(5.5, 0.002, 0.4), Corrugation(2.0, 4.0, 1e-5, 0.1), SimpleNamespace(places=(1.0, 3.0)), np.sin)
    assert list(_known_stretches(parts)) == [(5.5, 5.5), (1.0, 3.0)]


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_impacts_are_located_at_the_wheels_one_lag_before(direction):
    passages = [replace(s, lag=direction * 1.5) for s in visit(1, lambda t, k: (5.3, slice(None)), direction=direction)]
    assert abs(impact_levels(passages).position() - (5.3 - direction * 1.5)) < 0.5


@pytest.mark.parametrize(("direction", "sign"), [("facing", 1.0), ("trailing", -1.0)])
def test_a_known_irregularity_is_left_out_from_1_m_before_to_2_m_behind_it_in_travel_direction(direction, sign):
    case = TrackCase(intact_campaign((), 7))
    aligned = case.fitted_passages()[0]
    aligned = replace(aligned, passage=replace(aligned.passage, direction=direction))
    position = float(np.mean([s.place for s in aligned.sensors]))
    signal = _signal(aligned, IMPACTS.high_frequency, [(position, position)])
    beyond = sign * (signal.wheels - position)
    assert np.array_equal(signal.is_free, ~np.any((beyond > -1.0) & (beyond < 2.0), axis=1))
    assert 0 < signal.is_free.sum() < signal.is_free.size and signal.lag == sign * IMPACTS.lag


def with_impacts(aligned, position):
    """The passage with a short vibration of 2 kHz in all channels whenever a wheel is at ``position``."""
    recording = aligned.passage.recording
    samples, time = recording.samples.astype(float), np.arange(recording.samples.shape[1]) / recording.rate
    for wheel in aligned.positions(time):
        since = time - np.interp(position + 0.2, wheel, time)
        pulse = np.where(since > 0.0, np.exp(-since / 0.003) * np.sin(2e3 * 2.0 * np.pi * since), 0.0)
        samples = samples + 10.0 * np.std(samples, axis=1)[:, None] * pulse
    return with_recording(aligned, samples=samples)


def with_recording(aligned, **changes):
    recording = replace(aligned.passage.recording, **changes)
    return replace(aligned, passage=replace(aligned.passage, recording=recording))


def test_a_case_reports_impacts_and_intact_track_has_none():
    """Simulated recordings with roughness; the band of a slower recorder ends too low."""
    case = TrackCase(intact_campaign((), 7))
    assert wheel_impacts(case) is None and case.ambiguity() is None
    passages = case.fitted_passages()
    position = float(np.mean([s.place for s in passages[0].sensors])) + 0.3
    case.fitted_passages = lambda: [with_impacts(p, position) for p in passages]
    found = case.ambiguity()
    assert found.frame == "place" and found.nats > 12.0 and "rattles" in found.words
    assert abs(0.5 * (found.low + found.high) - position) < 0.6
    case.fitted_passages = lambda: [with_recording(p, rate=2000.0) for p in passages]
    assert impact_signals(case) == [] and 2.0 * IMPACTS.low_frequency > 2000.0


def test_impacts_of_one_train_alone_are_located_on_the_train(monkeypatch):
    levels = impact_levels(visit(2, lambda t, k: (5.3, slice(None)) if k == 2 else None))
    monkeypatch.setattr(module, "impact_levels", lambda signals: levels)
    case = TrackCase(intact_campaign((), 7))
    location = location_of_ambiguity(case)
    assert str(location) == "on a" and location.place is None and location.nats > 12.0
    ambiguity = case.ambiguity()
    assert "wheels of a cause impacts" in ambiguity.words and "no other train" in ambiguity.words
    assert "near 5.3 m" in ambiguity.measurement
