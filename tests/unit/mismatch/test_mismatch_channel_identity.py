"""Channels and impacts that are not where the layout states: exchanged cables, dead sensors, misnamed files."""

from dataclasses import replace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.turnout.case_data import case_data
from turnout.mismatch.turnout.channel_identity import Comparison, channel_faults, exchanged_channels
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan

NAMES = ("A1", "A2", "A3", "A4")


def comparison(recorded, own=0.95, other=0.1, names=NAMES):
    """Row ``i`` correlates by ``own`` with the sensor ``recorded[i]``, or with none, at the middle of three lags."""
    at_lag = np.full((len(names), len(names)), other)
    for i, sensor in enumerate(recorded):
        at_lag[i, :] = other if sensor is not None else 0.02
        if sensor is not None:
            at_lag[i, names.index(sensor)] = own
    return Comparison(names, names, np.stack([0.1 * at_lag, at_lag, 0.2 * at_lag], axis=-1), np.ones(len(names)))


@pytest.mark.parametrize(
    ("recorded", "exchanged"),
    [
        (("A1", "A2", "A3", "A4"), {}),
        (("A1", "A3", "A2", "A4"), {"A2": "A3", "A3": "A2"}),
        (("A2", "A1", "A4", "A3"), {"A1": "A2", "A2": "A1", "A3": "A4", "A4": "A3"}),
        (("A2", "A3", "A1", "A4"), {"A1": "A2", "A2": "A3", "A3": "A1"}),
    ],
)
def test_every_exchange_of_channels_is_found_from_the_sensors_that_they_record(recorded, exchanged):
    faults = channel_faults("passages", [comparison(recorded)] * 3)
    assert faults.sensor_of == exchanged and faults.unrelated == {}
    assert bool(faults) is bool(exchanged)


def test_a_channel_is_exchanged_only_if_it_agrees_clearly_better_with_the_other_sensor():
    """The limit is 0.5 more than with its own sensor: of 0.95, a correlation of 0.4 is clear and one of 0.5 is not."""

    def with_own(own):
        at_lag = comparison(("A1", "A3", "A2", "A4")).correlations.copy()
        at_lag[[1, 2], [1, 2]] = own
        return exchanged_channels("hammer tests", [Comparison(NAMES, NAMES, at_lag, np.ones(4))] * 2)

    assert with_own(0.4) and not with_own(0.5)


def test_a_channel_that_agrees_with_no_sensor_is_not_used_and_one_of_wrong_polarity_is():
    noise = [comparison(("A1", None, "A3", "A4"))] * 4
    assert channel_faults("passages", noise).unrelated == {"A2": 0.02}
    inverted = comparison(NAMES)
    inverted.correlations[1] *= -1.0
    assert not channel_faults("passages", [inverted] * 4)  # as in its hammer tests: a fault of the sensor
    assert channel_faults("passages", [inverted] * 4, NAMES).inverted == {"A2": -0.95}
    assert not channel_faults("passages", [comparison(NAMES)] * 4, NAMES)


def test_recordings_that_agree_with_no_sensor_show_no_fault_of_a_channel():
    """The train has another type than noted: no channel agrees, and no channel has a fault."""
    assert not channel_faults("passages", [comparison((None,) * 4)] * 4)
    assert not channel_faults("passages", [comparison((None, None, "A3", "A4"))] * 4)
    mixed = [comparison((None,) * 4), *[comparison(("A1", "A2", None, "A4"))] * 2]
    assert list(channel_faults("passages", mixed).unrelated) == ["A3"]


@pytest.fixture(scope="module")
def campaign():
    return measured_campaign(small_plan((15.0, 25.0), hammer_positions=(21.6, 24.0)), (), 3)


def faults_of(campaign):
    data, _ = case_data(campaign, MismatchSettings(), Track1D())
    return data, {faults.recording_type: faults for faults in data.layout_faults}


def exchange_rows(recording, names):
    """The recording with exchanged rows of the channels ``names``."""
    rows = [recording.index(n) for n in names]
    samples = recording.samples.copy()
    samples[rows] = samples[rows[::-1]]
    return replace(recording, samples=samples)


def test_recordings_that_agree_with_the_layout_have_no_fault(campaign):
    assert faults_of(campaign)[1] == {}


def test_exchanged_cables_give_the_same_observations_as_correct_ones(campaign):
    first, second = (s.name for s in campaign.sensors[1:3])
    tests = [
        replace(t, recordings=tuple(exchange_rows(r, (first, second)) for r in t.recordings)) for t in campaign.hammer
    ]
    passages = [replace(p, recording=exchange_rows(p.recording, (first, second))) for p in campaign.passages]
    data, faults = faults_of(replace(campaign, hammer=tuple(tests), passages=tuple(passages)))
    exchanged = {first: second, second: first}
    assert {kind: dict(f.sensor_of) for kind, f in faults.items()} == dict.fromkeys(
        ("hammer tests", "passages"), exchanged
    )
    right, _ = case_data(campaign, MismatchSettings(), Track1D())
    assert sorted(o.name for o in data.observations) == sorted(o.name for o in right.observations)
    by_name = {o.name: o.data for o in right.observations}
    for o in data.observations:  # rows of a passage are in the order of the sensors, by name
        np.testing.assert_allclose(o.data, by_name[o.name], rtol=1e-6, atol=1e-9 * np.max(np.abs(o.data)))
    position_of = {s.name: s.place for s in campaign.sensors}
    for recording in (
        *(p.recording for p in data.campaign.passages),
        *(r for t in data.campaign.hammer for r in t.recordings),
    ):
        named = {c.name: c.position for c in recording.channels if c.name in (first, second)}
        assert named == {n: position_of[n] for n in (first, second)}
    (sentence,) = faults["passages"].sentences()
    assert f"{first} records sensor {second}, {second} records sensor {first}" in sentence


def test_a_channel_of_noise_in_passages_is_left_out_there_and_used_in_hammer_tests(campaign):
    name, rng = campaign.sensors[1].name, np.random.default_rng(5)

    def with_noise(recording):
        samples = recording.samples.copy()
        samples[recording.index(name)] = 3.0 * rng.standard_normal(recording.n_sample)
        return replace(recording, samples=samples)

    noisy = replace(campaign, passages=tuple(replace(p, recording=with_noise(p.recording)) for p in campaign.passages))
    data, faults = faults_of(noisy)
    assert list(faults) == ["passages"] and list(faults["passages"].unrelated) == [name]
    assert all(name not in [s.name for s in a.sensors] for a in data.aligned_passages.values())
    assert any(pair.channel == name for pair in data.frf_pairs.values())


@pytest.mark.parametrize("in_tests", [False, True])
def test_a_polarity_that_is_wrong_in_the_passages_alone_is_corrected(campaign, in_tests):
    name = campaign.sensors[2].name

    def inverted(recording):
        samples = recording.samples.copy()
        samples[recording.index(name)] *= -1.0
        return replace(recording, samples=samples)

    changed = campaign.with_recordings("passages", inverted)
    changed = changed.with_recordings("hammer tests", inverted) if in_tests else changed
    data, faults = faults_of(changed)
    if in_tests:
        assert faults == {}
        return
    assert list(faults) == ["passages"] and list(faults["passages"].inverted) == [name]
    (sentence,) = faults["passages"].sentences()
    assert f"channel {name} has the wrong polarity, and in other recordings the right one" in sentence
    right, _ = case_data(campaign, MismatchSettings(), Track1D())
    by_name = {o.name: o.data for o in right.observations}
    for o in data.observations:
        np.testing.assert_allclose(o.data, by_name[o.name], rtol=1e-6, atol=1e-9 * np.max(np.abs(o.data)))


def test_impacts_in_misnamed_files_are_used_at_their_true_position(campaign):
    first, second = campaign.hammer[0].place, campaign.hammer[-1].place
    other = {first: second, second: first}
    moved = replace(campaign, hammer=tuple(replace(t, place=other.get(t.place, t.place)) for t in campaign.hammer))
    data, faults = faults_of(moved)
    assert dict(faults["positions of impacts"].positions) == {
        t.name: (t.place, other[t.place]) for t in moved.hammer if t.place in other
    }
    assert [t.place for t in data.campaign.hammer] == [t.place for t in campaign.hammer]
    assert f"agree with impacts at {first:.2f} m" in " ".join(faults["positions of impacts"].sentences())
