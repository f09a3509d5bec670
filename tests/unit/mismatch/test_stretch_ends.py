"""Ends of a change along the track: closed form of the intervals, open ends, and coverage on linear histories."""

import numpy as np
import pytest

from turnout.mismatch.calibrated import (
    ChangeEffect,
    GroupInformation,
    StateParameter,
    VisitInformation,
    compare_onsets,
    estimate_history,
)
from turnout.mismatch.calibrated.change import OnsetEvidence
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.stretch_ends import changes_alike, stretch_ends

N_SUPPORT, SPACING, SD, N_VISIT = 12, 0.6, 0.05, 6
SUPPORTS = tuple(
    StateParameter(f"ballast@{SPACING * k:.2f}", 0.0, 0.1, 0.01, "ballast", k, SPACING * k) for k in range(N_SUPPORT)
)
BY_NAME = {p.name: p for p in SUPPORTS} | {"gain@1.00": StateParameter("gain@1.00", 0.0, 0.1, 0.0, "gain", 0, 1.0)}
ROWS = np.array([0.5 ** abs(i - j) for i in range(N_SUPPORT) for j in range(N_SUPPORT)]).reshape(N_SUPPORT, N_SUPPORT)
RUNS = [(i, j) for i in range(N_SUPPORT) for j in range(i, min(i + 4, N_SUPPORT))]


def effect(first, last):
    return ChangeEffect(f"{first} to {last}", {p.name: 1.0 for p in SUPPORTS[first : last + 1]}, 0.4, group="ballast")


def evidence(first, last, gain, size=-0.3):
    one = np.array([1.0])
    return OnsetEvidence(effect(first, last), ("a", "b"), np.array([0.0, 1.0]), gain * one, size * one, 0.1 * one)


def test_an_interval_contains_the_ends_whose_likelihoods_sum_to_its_probability():
    alike = [evidence(3, 5, np.log(90.0)), evidence(3, 6, np.log(6.0)), evidence(2, 5, np.log(4.0))]
    assert stretch_ends(alike, BY_NAME).first == pytest.approx((1.8, 1.8))  # 96 of 100 begin there
    assert stretch_ends(alike, BY_NAME).last == pytest.approx((3.0, 3.6))  # 94 of 100 end at 3.0 m
    assert stretch_ends(alike, BY_NAME, 0.99).first == pytest.approx((1.2, 1.8))
    assert stretch_ends(alike, BY_NAME, 0.93).last == pytest.approx((3.0, 3.0))


@pytest.mark.parametrize(
    ("first", "last", "open_ends"),
    [(0, 2, (True, False)), (N_SUPPORT - 1, N_SUPPORT - 1, (False, True)), (3, 4, (False, False))],
)
def test_an_end_at_the_outermost_support_is_open(first, last, open_ends):
    ends = stretch_ends([evidence(first, last, 20.0)], BY_NAME)
    assert (ends.first[0] is None, ends.last[1] is None) == open_ends


def test_an_end_that_may_be_the_outermost_support_is_open():
    beside = stretch_ends([evidence(10, 10, 20.0), evidence(10, 11, 20.0)], BY_NAME)
    assert beside.first == pytest.approx((6.0, 6.0)) and beside.last == (pytest.approx(6.0), None)
    beside = stretch_ends([evidence(1, 1, 20.0), evidence(0, 1, 20.0)], BY_NAME)
    assert beside.first == (None, pytest.approx(0.6)) and beside.last == pytest.approx((0.6, 0.6))


def test_a_change_as_long_as_the_longest_stretch_is_open_at_both_ends():
    ends = stretch_ends([evidence(2, 1 + CALIBRATION.max_stretch, 20.0)], BY_NAME)
    assert ends.first == (None, pytest.approx(1.2)) and ends.last[1] is None


def test_supports_that_cannot_change_are_no_edge_and_other_parameters_have_no_ends():
    beyond = StateParameter("ballast@7.20", 0.0, 0.1, 0.0, "ballast", N_SUPPORT, 7.2, may_change=False)
    ends = stretch_ends([evidence(10, 11, 20.0)], BY_NAME | {beyond.name: beyond})
    assert ends.last[1] is None  # 6.6 m is the last support that can be identified
    gain = OnsetEvidence(ChangeEffect("gain@1.00", {"gain@1.00": 1.0}, 0.1), ("a", "b"), *np.ones((4, 1)))
    assert stretch_ends([gain], BY_NAME) is None


def test_similar_changes_have_the_same_name_and_sign():
    softer, stiffer, stretch = evidence(3, 3, 9.0), evidence(4, 4, 8.0, size=0.3), evidence(3, 5, 2.0)
    gain = OnsetEvidence(ChangeEffect("gain@1.00", {"gain@1.00": -1.0}, 0.1), ("a", "b"), *-np.ones((4, 1)))
    assert changes_alike([softer, stiffer, stretch, gain], softer, BY_NAME) == [softer, stretch]


def test_true_ends_lie_inside_their_intervals():
    """Of 150 stretches of one to four supports drawn from the prior, at any position: 95 % at least, less chance."""
    rng = np.random.default_rng(5)
    effects = [effect(*run) for run in RUNS]
    inside = n_certain = n = 0
    while n < 150:
        first, last = RUNS[rng.integers(len(RUNS))]
        onset, size = rng.integers(1, N_VISIT), rng.normal(0.0, 0.4)
        change = np.where((np.arange(N_SUPPORT) >= first) & (np.arange(N_SUPPORT) <= last), size, 0.0)
        x, visits = rng.normal(0.0, 0.1, N_SUPPORT), []
        for v in range(N_VISIT):
            x = x + rng.normal(0.0, 0.01 * np.sqrt(0.25), N_SUPPORT)
            y = ROWS @ (x + change * (v >= onset)) + rng.normal(0.0, SD, N_SUPPORT)
            names = tuple(p.name for p in SUPPORTS)
            group = GroupInformation(f"{v}", 1, names, ROWS.T @ ROWS / SD**2, ROWS.T @ y / SD**2)
            visits.append(VisitInformation(f"v{v}", 0.25 * v, (group,)))
        history = estimate_history(SUPPORTS, visits, repeats_between_visits=False, accepted=None)
        found = compare_onsets(history, effects)
        if found[0].gain < 12.0:
            continue  # no name
        n += 1
        ends = stretch_ends(changes_alike(found, found[0], BY_NAME), BY_NAME)
        for at, (low, high) in ((SPACING * first, ends.first), (SPACING * last, ends.last)):
            low, high = -np.inf if low is None else low, np.inf if high is None else high
            inside += low - 1e-9 <= at <= high + 1e-9
            n_certain += high - low < 1e-9
    assert inside >= 273  # of 300: 95 % less 2.5 standard deviations of that count, so that chance fails it once in 160
    assert n_certain >= 150  # and not because the intervals are wide
