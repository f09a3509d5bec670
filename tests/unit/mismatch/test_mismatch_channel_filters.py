"""Faults of a channel in the passages alone: one filter explains all trains, and impacts do not show it."""

import numpy as np
import pytest

from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.component_evidence import evidence_of_a_changed_stretch
from turnout.mismatch.engine.localization import _faults_in_passages, locate, locate_component
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.residual_space import ResidualSpace
from turnout.mismatch.engine.space_evidence import weigh_spaces
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.residual_spaces import source_spaces
from turnout.physics import LowPass, OutOfRound, PassageDelay, PassageGain

N, SENSORS = 60, ("S0", "S1", "S2")
TRAINS = ("slow", "fast")
FORCE = np.array([0.3, 1.0, 0.5])  # response of the sensors to a force at 1.2 m


class Passages(Case):
    """Two trains and an impact at three sensors. A force at 1.2 m is free in each train, as is what a channel adds.

    ``filtered`` is what one filter makes of the trains in S1, the same of three shapes in both, and ``beside`` in S0.
    One support, at 1.2 m, acts on all sensors.
    """

    def __init__(self, filtered, force=0.0, impact=0.0, support=0.0, beside=0.0):
        rng = np.random.default_rng(11)
        self.shapes = {train: rng.normal(size=(N, 3)) for train in TRAINS}
        self.component = {name: rng.normal(size=3 * N) for name in (*TRAINS, "impact")}
        self.nuisances = (Nuisance("support", "-", 0.0, 0.1, group="support", index=0, at=("place", 1.2)),)
        self.observations = ()
        for name in (*TRAINS, "impact"):
            rows = 0.5 * rng.normal(size=(3, N))
            if name in TRAINS:
                rows += force * np.outer(FORCE, rng.normal(size=N))
                rows[1] += filtered * self.shapes[name] @ np.array([1.0, -2.0, 0.5])
                rows[0] += beside * self.shapes[name] @ np.array([0.5, 1.5, -1.0])
                rows += support * self.component[name].reshape(3, N)
            else:
                rows[1] += impact
            data_type = "passage" if name in TRAINS else "hammer"
            self.observations += (Observation(name, name, rows.ravel(), 0.5, data_type=data_type),)
        self.control_level = {"passage": 1.0, "hammer": 1.0}

    def is_hammer_test(self, observation):
        return observation.name == "impact"

    def predict(self, values, terms, observations):
        return [values["support"] * self.component[o.name] for o in observations]

    def residual_spaces(self, fit):
        free, eye = np.eye(N), np.eye(3)
        for train in TRAINS:
            parts = {("place", 1.2): np.kron(FORCE[:, None], free)}
            parts |= {("sensor", name): np.kron(eye[:, s : s + 1], free) for s, name in enumerate(SENSORS)}
            yield ResidualSpace((train,), np.eye(3 * N), parts)
        both = [np.kron(eye, self.shapes[train]) for train in TRAINS]
        levels = {("sensor", name): np.arange(3 * s, 3 * s + 3) for s, name in enumerate(SENSORS)}
        yield ResidualSpace(TRAINS, np.concatenate(both), levels, "one filter")
        levels = {("sensor", name): np.arange(s, s + 1) for s, name in enumerate(SENSORS)}
        yield ResidualSpace(("impact",), np.kron(eye, np.ones((N, 1))), levels, "linear")


@pytest.mark.parametrize(
    "facts, text",
    [
        ({"filtered": 0.5}, "in channel S1"),
        ({"filtered": 0.5, "impact": 1.0}, "in channel S1"),
        ({"filtered": 0.0, "force": 2.0}, "at 1.2 m, between 1.2 and 1.2 m"),
    ],
)
def test_a_channel_without_impacts_that_show_it_counts_with_what_one_filter_explains(facts, text):
    case = Passages(**facts)
    assert str(locate(case, fit_jointly(case))) == text


def test_recordings_without_a_fault_have_no_location():
    """No component differs either: the evidence for that is negative."""
    case = Passages(0.0)
    case.place_level = 10.0
    fit = fit_jointly(case)
    assert evidence_of_a_changed_stretch(case, fit) < 0.0
    assert locate(case, fit) is None and not _faults_in_passages(case, fit, weigh_spaces(case, fit, case.control_level))


def test_a_channel_whose_fault_is_another_one_in_each_train_needs_impacts():
    """Only the sensor S1 is loud, by noise of its own in each train: a cause of any kind beside it may do that."""
    case = Passages(0.0)
    rng = np.random.default_rng(12)
    loud = np.concatenate([np.zeros(N), 2.0 * rng.normal(size=N), np.zeros(N)])
    case.observations = (
        *(Observation(o.name, o.name, o.data + loud, 0.5, data_type="passage") for o in case.observations[:2]),
        case.observations[2],
    )
    evidence = {(w.frame, w.level): w for w in weigh_spaces(case, fit_jointly(case), case.control_level)}
    s1 = evidence["sensor", "S1"]
    assert s1.nats > evidence["place", 1.2].nats and sum(s1.by_common_law.values()) < 6.0
    assert locate(case, fit_jointly(case)).frame == "place"


@pytest.mark.parametrize(
    "facts, text",
    [
        ({"filtered": 0.5}, "in channel S1"),
        ({"filtered": 0.0, "support": 0.5}, "at 1.2 m"),
        ({"filtered": 0.4, "support": 0.6}, "in channel S1"),
        ({"filtered": 0.4, "support": 0.6, "beside": 0.4}, "at 1.2 m"),
    ],
)
def test_what_differs_between_trains_and_impacts_is_a_component_or_a_channel(facts, text):
    """The fault of the channel moves the support as well. What two channels show belongs to the track."""
    case = Passages(**facts)
    assert str(locate_component(case, fit_jointly(case), -9.0)).startswith(text)


@pytest.fixture(scope="module")
def recorded():
    plan = small_plan((15.0, 22.0), hammer_positions=(24.0,))
    case = TrackCase(measured_campaign(plan, (), 3))
    fit = fit_jointly(case, iterations=0)
    (space,) = (s for s in source_spaces(case, fit) if s.law == "one filter")
    return case, fit, space


def share_outside(recorded, term, channel):
    """Share of what an effect changes in all passages that no filter of the channel makes."""
    case, fit, space = recorded
    passages = [o for o in case.observations if o.name in space.names]
    change = np.concatenate(
        [a - b for a, b in zip(case.predict(fit.values, (term,), passages), case.predict(fit.values, (), passages))]
    )
    columns = space.columns[:, space.combinations["sensor", channel]]
    left = change - columns @ np.linalg.lstsq(columns, change, rcond=1e-12)[0]
    return np.linalg.norm(left) / np.linalg.norm(change)


def test_one_filter_makes_a_gain_a_delay_and_a_low_pass_of_a_channel_in_all_trains(recorded):
    """A gain is a constant filter. A wheel out of round is in no filter of one channel.

    Up to a tenth is left where the recording begins and ends.
    """
    channels = [channel for _, channel in recorded[2].combinations]
    first, second = channels[:2]
    for term in (PassageGain(first, 1.3), PassageDelay(first, 5e-4), LowPass(first, 1.0 / 300.0)):
        assert share_outside(recorded, term, first) < 0.1
        assert share_outside(recorded, term, second) > 0.99
    assert share_outside(recorded, OutOfRound(0, 1e-4), first) > 0.5
