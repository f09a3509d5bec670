"""A source that does not move with a train: quiet stretches are compared with wheels at equal distances."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.unit.mismatch.intact_campaigns import intact_campaign

from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout import case as cases
from turnout.mismatch.turnout.disturbances import Disturbance, disturbances, independent_of_trains

RATE, DURATION, SPAN, SENSORS = 2000.0, 4.0, 20.0, (0.0, 2.0, 4.0, 6.0)


def passage_of(name, rng, speed, roughness=1.0, train="ic3", source=None, floor=1e-3):
    """Noise that falls by 20 dB a decade of distance from the nearest wheel, on a floor of all sensors."""
    reference = 1.5
    time = np.arange(int(RATE * DURATION)) / RATE
    before = speed * (reference - time)
    after = speed * (time - reference) - SPAN - np.ptp(SENSORS)
    distance = np.maximum(1.0, np.maximum(before, after))
    samples = roughness / distance * rng.normal(size=(4, time.size)) + floor * rng.normal(size=(4, time.size))
    if source is not None:
        samples = samples + source(time) * rng.normal(size=time.size)
    recording = SimpleNamespace(samples=samples, rate=RATE, duration=DURATION, index=lambda n: int(n[1:]))
    vehicle = SimpleNamespace(wheel_positions=np.array([0.0, SPAN]))
    sensors = [SimpleNamespace(name=f"A{i}", place=x) for i, x in enumerate(SENSORS)]
    passage = SimpleNamespace(recording=recording, vehicle=vehicle)
    return SimpleNamespace(
        name=name, passage=passage, sensors=sensors, reference=reference, speed=speed, train=train, time=time
    )


def disturbances_of(passages, unmatched=()):
    return disturbances({p.name: p for p in passages}, {p.name: p for p in unmatched})


def test_a_slow_train_that_is_never_far_away_is_no_other_source():
    """At 12 m/s the last wheel is 12 to 17 m away when the recording ends, at 40 m/s 60 to 80 m: 13 dB more."""
    rng = np.random.default_rng(1)
    speeds = [12.0, 40.0, 38.0, 36.0, 42.0, 12.5, 12.2]
    assert disturbances_of([passage_of(f"p{k}", rng, v) for k, v in enumerate(speeds)]) == []


def test_a_train_with_rough_wheels_has_a_higher_level_at_every_distance_and_is_no_other_source():
    rng = np.random.default_rng(2)
    passages = [passage_of(f"p{k}", rng, 25.0, roughness=6.0 if k == 3 else 1.0) for k in range(6)]
    assert disturbances_of(passages) == []


@pytest.mark.parametrize("level", [0.3, 3.0])
def test_another_train_is_detected_in_the_passages_that_it_disturbs(level):
    rng = np.random.default_rng(3)

    def source(time):
        return level * np.exp(-(((time - 0.4) / 0.5) ** 2))

    passages = [
        passage_of(f"p{k}", rng, 20.0 + 2.0 * k, source=source if k in (2, 5) else None, train=f"t{k % 2}")
        for k in range(7)
    ]
    events = disturbances_of(passages)
    assert {e.name for e in events} == {"p2", "p5"} and {e.when for e in events} == {"before"}
    assert all(e.excess > 10.0 for e in events)
    assert len(independent_of_trains(events)) == 2


def test_a_train_that_may_be_longer_by_a_car_is_compared_behind_that_car():
    """The last known wheel is 26 m before the last one."""
    rng = np.random.default_rng(4)
    passages = [passage_of(f"p{k}", rng, 30.0) for k in range(5)]
    longer = passage_of("p9", rng, 30.0)
    longer.reference -= 26.0 / 30.0
    at_once = {e.name: e for e in disturbances_of([*passages, longer])}
    assert at_once["p9"].when == "after"
    assert all(e.when == "before" for e in disturbances_of(passages, [longer]))


def test_one_passage_with_a_higher_level_after_its_train_is_no_other_source():
    def event(when, excess, train="ic3", name="p1"):
        return Disturbance(name, when, excess, 1e-9, train)

    assert independent_of_trains([]) == ()
    assert independent_of_trains([event("after", 40.0)]) == ()
    assert independent_of_trains([event("before", 9.0)]) == ()
    assert independent_of_trains([event("before", 11.0)])
    assert independent_of_trains([event("after", 5.0), event("after", 9.0, name="p2")]) == ()  # of one train
    assert len(independent_of_trains([event("after", 5.0), event("after", 5.0, "re")])) == 2
    assert len(independent_of_trains([event("after", 11.0), event("after", 12.0, name="p2")])) == 2
    assert independent_of_trains([event("after", 5.0, ""), event("after", 5.0, "", "p2")])  # trains without a name


def test_only_a_source_that_does_not_move_with_a_train_disturbs_a_case(monkeypatch):
    """Both passages are left out of the fit. They change the answer only if two trains show the source."""
    campaign = intact_campaign((24.0,), 3)
    case_data = cases.case_data

    def disturbed_by(*trains):
        events = tuple(Disturbance(f"p{k}", "after", 5.0, 1e-9, train) for k, train in enumerate(trains))

        def with_disturbances(*arguments):
            data, predictor = case_data(*arguments)
            return replace(data, disturbed=events), predictor

        monkeypatch.setattr(cases, "case_data", with_disturbances)
        return [e.name for e in TrackCase(campaign).disturbed_recordings]

    assert disturbed_by("ic3", "ic3") == []
    assert disturbed_by("ic3", "re") == ["p0", "p1"]
