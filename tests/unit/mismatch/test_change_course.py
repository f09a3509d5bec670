"""Onset and present size of a change, a step or growth from an unknown day, on seeded histories of four visits."""

import numpy as np
import pytest

from turnout.mismatch.calibrated import (
    ChangeEffect,
    GroupInformation,
    StateParameter,
    VisitInformation,
    change_answer,
    change_candidates,
    compare_onsets,
    estimate_history,
)
from turnout.mismatch.calibrated.change_course import courses_of

PARAMETER = StateParameter("ballast@1.20", 0.0, 0.1, 0.03, "ballast", 2, 1.2)
EFFECT = ChangeEffect("softer", {PARAMETER.name: -1.0}, 0.5)
TIMES = (0.0, 0.7, 1.3, 2.0)  # years
SD = 0.05


def history(rng, change, times=TIMES, sd=SD):
    """Visits at which ``change(time)`` is added to the parameter, with an error of ``sd``."""
    x, visits = rng.normal(0.0, PARAMETER.sd), []
    for v, (time, before) in enumerate(zip(times, (times[0], *times))):
        x += rng.normal(0.0, PARAMETER.walk_sd * np.sqrt(time - before))
        y = x + change(time) + sd * rng.normal()
        group = GroupInformation("A", 1, (PARAMETER.name,), np.array([[sd**-2]]), np.array([y / sd**2]))
        visits.append(VisitInformation(f"v{v}", time, (group,)))
    return estimate_history([PARAMETER], visits, repeats_between_visits=False, accepted=None)


def growth(start, size):
    """Growth of one year to its full size."""
    return lambda time: -size * np.clip(time - start, 0.0, 1.0)


@pytest.mark.parametrize("grows", [False, True])
def test_intervals_contain_the_onset(grows):
    """300 of each at an unknown day; growth up to half a year before the last visit. 95 % with the error of n."""
    rng, inside = np.random.default_rng(41), 0
    for _ in range(300):
        start, size = rng.uniform(0.0, TIMES[-1] - 0.5 * grows), rng.uniform(0.5, 1.5)
        change = growth(start, size) if grows else lambda time: -size * (time > start)  # noqa: B023
        low, high = courses_of(history(rng, change), EFFECT).onset_interval()
        inside += low <= start <= high
    assert inside >= 275  # 285 expected, three standard errors of n


@pytest.mark.parametrize("start", [0.55, 0.65])
def test_the_onset_of_growth_just_before_a_visit_is_not_after_that_visit(start):
    """That visit shows hardly any of it. A change of the later visits alone would have its onset between them."""
    for seed in range(20):
        low, high = courses_of(
            history(np.random.default_rng(seed), growth(start, 1.5), sd=0.02), EFFECT
        ).onset_interval()
        assert low <= start <= high


@pytest.mark.parametrize("size", [0.5, 5.0])
def test_a_change_of_the_last_visit_alone_is_a_step_of_any_size(size):
    """Growth from the previous visit on is equivalent. The prior of a step is that of the change, not of a rate."""
    effects = [ChangeEffect("f", EFFECT.direction, EFFECT.sd, grows) for grows in (False, True)]
    changed = history(np.random.default_rng(1), lambda time: -size * (time > 1.9))
    first, second = compare_onsets(changed, effects)
    assert not first.effect.grows and first.onset == "v3"
    assert second.gains[-1] == -np.inf and first.gain > second.gain + 3.0
    two_visits = history(np.random.default_rng(1), lambda time: -size * (time > 0.0), TIMES[:2])
    assert [e.effect for e in compare_onsets(two_visits, effects)] == [effects[0]]


def test_a_change_has_two_visits_and_begins_after_an_accepted_one():
    rng = np.random.default_rng(2)
    with pytest.raises(ValueError, match="two visits"):
        courses_of(history(rng, lambda time: 0.0, times=TIMES[:1]), EFFECT).onset_interval()
    assert courses_of(history(rng, lambda time: 0.0, times=TIMES[:2]), EFFECT).onset_interval() == TIMES[:2]
    late = ChangeEffect("softer", EFFECT.direction, EFFECT.sd, not_before=TIMES[2])
    assert courses_of(history(rng, growth(0.0, 1.0)), late).onset_interval() == TIMES[2:]


FORMS = ("step", "growth up to the last visit", "growth that has ended")


def drawn_change(rng, form):
    """A change of this form, drawn from its prior, as a function of time."""
    size, n = rng.normal(0.0, EFFECT.sd), len(TIMES) - 1
    first = rng.integers(n)  # visit before its begin
    begin, end = first + rng.uniform(), rng.uniform(first, n)
    while form == "growth that has ended" and end < begin:
        begin, end = first + rng.uniform(), rng.uniform(first, n)
    start, stop = np.interp([begin, end if form == "growth that has ended" else n], np.arange(n + 1), TIMES)
    if form == "step":
        return lambda time: -size * (time > start)
    return lambda time: -size * np.clip((time - start) / (stop - start), 0.0, 1.0)


@pytest.mark.parametrize("form", FORMS)
def test_intervals_contain_the_size_at_the_last_visit(form):
    """1000 of each form, drawn from its prior; 95 % is promised. For growth a step gives the mean of all visits
    with the effect instead: its interval contains the size less often."""
    rng, inside, of_step = np.random.default_rng(43), 0, 0
    for _ in range(1000):
        change = drawn_change(rng, form)
        changed, present = history(rng, change), -change(TIMES[-1])
        mean, sd = courses_of(changed, EFFECT).last_size
        inside += abs(mean - present) <= 1.96 * sd
        step = compare_onsets(changed, [EFFECT])[0].size
        of_step += abs(step[0] - present) <= 1.96 * step[1]
    assert inside >= 930  # 950 expected, three standard errors of n
    assert form == "step" or of_step < 930


def test_the_size_at_the_last_visit_is_that_of_exact_data():
    """Growth that has ended: half of it at the third visit, all of it at the fourth, as near as courses
    that begin and end on a grid of days can be to it."""
    exact = [StateParameter(PARAMETER.name, 0.0, 0.1, 0.0, "ballast", 2, 1.2)]
    visits = []
    for v, (time, value) in enumerate(zip(TIMES, (0.0, 0.0, -0.4, -0.8))):
        group = GroupInformation("A", 1, (PARAMETER.name,), np.array([[1e8]]), np.array([1e8 * value]))
        visits.append(VisitInformation(f"v{v}", time, (group,)))
    changed = estimate_history(exact, visits, repeats_between_visits=False, accepted=None)
    size, sd = courses_of(changed, EFFECT).last_size
    assert size == pytest.approx(0.8, abs=0.01) and sd < 0.02
    assert compare_onsets(changed, [EFFECT])[0].size[0] == pytest.approx(0.6, abs=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_an_answer_states_the_present_size_of_growth_with_the_error_of_the_model(seed):
    """Growth that has ended: the whole size, although half of the visits with it show less. The constant error of
    the model changes with the value: at least a tenth of the change is uncertain even with exact recordings."""
    times = tuple(0.5 * v for v in range(8))
    reached = dict(zip(times, (0.0, 0.0, 0.0, -0.2, -0.4, -0.6, -0.8, -0.8)))
    rng, visits = np.random.default_rng(seed), []
    for v, time in enumerate(times):
        y = reached[time] + 0.01 * rng.normal()
        group = GroupInformation("A", 1, (PARAMETER.name,), np.array([[1e4]]), np.array([1e4 * y]))
        visits.append(VisitInformation(f"v{v}", time, (group,)))
    answer = change_answer([PARAMETER], visits, [], change_candidates([PARAMETER]), 12.0, 6.0)
    assert "local_ballast" in answer.names
    assert answer.total == pytest.approx(-0.8, abs=0.1) and answer.total_sd >= 0.1 * abs(answer.total)
    assert answer.sd >= 0.1 * abs(answer.size)
    assert answer.grows or (answer.size, answer.sd) == (answer.total, answer.total_sd)
