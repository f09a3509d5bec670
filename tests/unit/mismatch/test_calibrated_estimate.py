"""The recursive estimate of the calibrated model: exact on linear examples and independent of withdrawn visits."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from turnout.mismatch.calibrated import (
    Belief,
    Event,
    GroupInformation,
    StateParameter,
    VisitInformation,
    estimate_history,
)
from turnout.mismatch.calibrated.information import marginalize, repeated_error_weights, with_visit_deviations

N_MASS = 4
CHAIN = tuple(
    [StateParameter(f"spring_{k}", 100.0, 20.0, 3.0, "spring", k, 0.6 * k, "N/m") for k in range(N_MASS)]
    + [StateParameter(f"damper_{k}", 2.0, 1.0, 0.1, "damper", k, 0.6 * k, "N s/m") for k in range(N_MASS)]
)
NOISE = 0.5  # N


def chain_rows(rng):
    """(n_mass, 2 n_mass) derivatives of the forces on a chain of oscillators by its springs and dampers.

    The force on mass k is that of its spring to the mass before it, less that of the next spring.
    """
    motion = np.diff(rng.normal(0.0, 0.1, N_MASS), prepend=0.0)
    velocity = np.diff(rng.normal(0.0, 1.0, N_MASS), prepend=0.0)
    difference = np.eye(N_MASS) - np.eye(N_MASS, k=1)
    return np.hstack([difference * motion, difference * velocity])


def names_of(parameters):
    return tuple(p.name for p in parameters)


def information_of(parameters, rows, data, sd, group="g", count=1):
    weighted = rows / sd**2
    return GroupInformation(group, count, names_of(parameters), weighted.T @ rows, weighted.T @ data)


def chain_visits(rng, n_visit, truth, n_recording=3):
    """(visits, rows and data of each) of a chain whose parameters are ``truth``."""
    visits, raw = [], []
    for v in range(n_visit):
        groups, recordings = [], []
        for r in range(n_recording):
            rows = chain_rows(rng)
            data = rows @ truth + rng.normal(0.0, NOISE, N_MASS)
            groups.append(information_of(CHAIN, rows, data, NOISE, f"v{v}r{r}"))
            recordings.append((rows, data))
        visits.append(VisitInformation(f"visit {v}", 0.3 * v, tuple(groups)))
        raw.append(recordings)
    return visits, raw


def kalman(raw, walk, noise_after):
    """Textbook recursion with a gain vector for one number at a time; ``noise_after`` visit -> added variance."""
    mean = np.array([p.mean for p in CHAIN])
    covariance = np.diag([p.sd**2 for p in CHAIN])
    for v, recordings in enumerate(raw):
        if v:
            covariance = covariance + np.diag(0.3 * walk + noise_after.get(v, 0.0))
        for rows, data in recordings:
            for h, y in zip(rows, data):
                gain = covariance @ h / (h @ covariance @ h + NOISE**2)
                left = np.eye(mean.size) - np.outer(gain, h)
                mean = mean + gain * (y - h @ mean)
                covariance = left @ covariance @ left.T + NOISE**2 * np.outer(gain, gain)
    return mean, covariance


def test_a_chain_of_oscillators_is_estimated_as_by_the_exact_kalman_recursion():
    rng = np.random.default_rng(1)
    truth = rng.normal([p.mean for p in CHAIN], [p.sd for p in CHAIN])
    visits, raw = chain_visits(rng, 12, truth)
    opened = {"spring_1": 10.0}
    belief = estimate_history(CHAIN, visits, [Event(1.0, opened)], accepted=None).belief
    event = np.array([opened.get(p.name, 0.0) ** 2 for p in CHAIN])
    mean, covariance = kalman(raw, np.array([p.walk_sd**2 for p in CHAIN]), {4: event})
    sd = np.sqrt(np.diag(covariance))
    assert np.max(np.abs(belief.mean - mean) / sd) < 1e-10
    assert np.max(np.abs(belief.covariance - covariance) / np.outer(sd, sd)) < 1e-10
    assert np.all(np.abs(mean - truth) < 5.0 * sd)


def same_bits(a, b):
    return a.mean.tobytes() == b.mean.tobytes() and a.covariance.tobytes() == b.covariance.tobytes()


def test_a_withdrawn_visit_has_no_effect_on_the_estimate():
    visits, _ = chain_visits(np.random.default_rng(2), 8, np.array([p.mean for p in CHAIN]))
    with_faulty_month = estimate_history(CHAIN, visits, accepted=None).belief
    withdrawn = estimate_history(CHAIN, [v for v in visits if v.visit != "visit 3"], accepted=None).belief
    never_measured = [v for k, v in enumerate(visits) if k != 3]
    assert same_bits(withdrawn, estimate_history(CHAIN, never_measured[::-1], accepted=None).belief)
    assert not same_bits(withdrawn, with_faulty_month)


def test_a_gap_of_two_years_adds_only_the_random_walk_of_two_years():
    visits, _ = chain_visits(np.random.default_rng(4), 8, np.array([p.mean for p in CHAIN]))
    late = [replace(v, time=v.time + (2.0 if k >= 4 else 0.0)) for k, v in enumerate(visits)]
    before, after = estimate_history(CHAIN, late, accepted=None).steps[3:5]
    walk = np.array([p.walk_sd**2 for p in CHAIN])
    assert_allclose(after.predicted.sd**2, before.belief.sd**2 + 2.3 * walk, rtol=1e-12)
    assert_allclose(after.predicted.mean, before.belief.mean, rtol=1e-12)
    assert np.all(after.belief.sd < [p.sd for p in CHAIN])


def test_the_order_of_arrival_does_not_change_the_estimate():
    rng = np.random.default_rng(3)
    visits, _ = chain_visits(rng, 6, np.array([p.mean for p in CHAIN]), n_recording=5)
    shared = [VisitInformation(v.visit, v.time, tuple(
        GroupInformation(f"train {k % 2}", 1, g.names, g.matrix, g.vector) for k, g in enumerate(v.groups)
    )) for v in visits]  # fmt: skip
    expected = estimate_history(CHAIN, shared).belief
    for _ in range(5):
        shuffled = [
            VisitInformation(v.visit, v.time, tuple(v.groups[k] for k in rng.permutation(len(v.groups))))
            for v in (shared[k] for k in rng.permutation(len(shared)))
        ]
        assert same_bits(estimate_history(CHAIN, shuffled).belief, expected)


def test_errors_without_a_change_fall_with_the_root_of_the_number_of_visits():
    parameters = (StateParameter("a", 0.0, 1e3), StateParameter("b", 0.0, 1e3))
    rows = np.array([[1.0, 0.5], [0.2, 1.0]])
    one = np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
    for n in (1, 4, 100):
        visits = [
            VisitInformation(f"{v:03}", 0.01 * v, (information_of(parameters, rows, np.zeros(2), 1.0, f"{v}"),))
            for v in range(n)
        ]
        assert_allclose(estimate_history(parameters, visits).belief.sd, one / np.sqrt(n), rtol=1e-4)


def test_errors_do_not_fall_below_the_repeated_error_of_the_model():
    parameters = (StateParameter("a", 0.0, 1e3),)
    row = np.array([[1.0]])

    def sd(n):
        visits = [
            VisitInformation(f"{v:04}", 0.01 * v, (information_of(parameters, row, np.zeros(1), 1.0, "ic3, 150 km/h"),))
            for v in range(n)
        ]
        return estimate_history(parameters, visits, repeated_share=0.25, accepted=None).belief.sd[0]

    assert_allclose([sd(1), sd(5), sd(400)], np.sqrt([1.0, 0.25 + 0.75 / 5, 0.25 + 0.75 / 400]), rtol=1e-5)


def test_the_weight_of_a_group_is_that_of_its_random_effect():
    """Against the covariance of all recordings of a group with a common error, inverted as one matrix."""
    rng = np.random.default_rng(4)
    rows, n, share = rng.normal(size=(6, 3)), 7, 0.6
    shared = np.kron(np.ones((n, n)), share * np.eye(6)) + (1.0 - share) * np.eye(6 * n)
    stacked = np.tile(rows, (n, 1))
    exact = stacked.T @ np.linalg.solve(shared, stacked)
    names = ("a", "b", "c")
    groups = (GroupInformation("g", n, names, n * rows.T @ rows, np.zeros(3)),)
    visit = VisitInformation("v", 0.0, groups)
    assert_allclose(visit.total(names, repeated_error_weights([visit], share))[0], exact, rtol=1e-12)


@pytest.mark.parametrize("n_passage", [5, 50, 500])
def test_intervals_cover_with_few_and_many_passages_of_the_same_error(n_passage):
    """Three train types at two speeds in ten visits, each group with its own error in all of its passages."""
    rng = np.random.default_rng(n_passage)
    parameters = tuple(StateParameter(f"x{k}", 0.0, 1.0) for k in range(4))
    n_group, share, n_draw = min(6, n_passage), 0.8, 120
    rows = rng.normal(size=(n_group, 8, 4))
    count = np.array([n_passage // n_group + (g < n_passage % n_group) for g in range(n_group)])
    inside = {True: 0, False: 0}
    for _ in range(n_draw):
        truth = rng.normal(size=4)
        groups = [[] for _ in range(10)]
        for g in range(n_group):
            common = np.sqrt(share) * rng.normal(size=8)
            for v, members in enumerate(np.array_split(np.arange(count[g]), 10)):
                if members.size:
                    own = np.sqrt((1.0 - share) / members.size) * rng.normal(size=8)  # the mean of this many
                    data = rows[g] @ truth + common + own
                    info = information_of(parameters, rows[g], data, 1.0 / np.sqrt(members.size), f"{g}", members.size)
                    groups[v].append(info)
        visits = [VisitInformation(f"{v}", 0.1 * v, tuple(gs)) for v, gs in enumerate(groups) if gs]
        for with_repeats in inside:
            used_share = share if with_repeats else 0.0
            belief = estimate_history(parameters, visits, repeated_share=used_share, accepted=None).belief
            inside[with_repeats] += int(np.sum(np.abs(belief.mean - truth) < 1.96 * belief.sd))
    n = 4 * n_draw
    assert abs(inside[True] / n - 0.95) < 4.0 * np.sqrt(0.95 * 0.05 / n)
    if n_passage == 500:  # with independent errors of these recordings wrong values would become certain
        assert inside[False] / n < 0.4


def test_marginalized_information_is_the_inverse_of_the_marginal_covariance():
    rng = np.random.default_rng(5)
    root = rng.normal(size=(6, 6))
    matrix, vector = root @ root.T, rng.normal(size=6)
    prior = np.array([2.0, 3.0])
    full = matrix + np.diag([0.0, 0.0, 0.0, 0.0, *prior])
    covariance = np.linalg.inv(full)
    expected = np.linalg.inv(covariance[:4, :4])
    remaining, right = marginalize(matrix, vector, [4, 5], prior)
    assert_allclose(remaining, expected, rtol=1e-9)
    assert_allclose(np.linalg.solve(remaining, right), (covariance @ vector)[:4], rtol=1e-9)


def test_deviations_of_a_visit_add_to_the_covariance_of_its_data():
    """Data y = A (x + d) + noise, d of the visit alone: the generalized least squares information of x."""
    rng = np.random.default_rng(5)
    rows, y, sds = rng.normal(size=(8, 4)), rng.normal(size=8), np.array([0.0, 0.7, 0.0, 2.0])
    precision = np.linalg.inv(np.eye(8) + rows @ np.diag(sds**2) @ rows.T)
    matrix, vector = with_visit_deviations(rows.T @ rows, rows.T @ y, sds)
    assert_allclose(matrix, rows.T @ precision @ rows, atol=1e-12)
    assert_allclose(vector, rows.T @ precision @ y, atol=1e-12)


def test_a_visit_may_have_deviations_of_its_own_that_others_do_not_have():
    """As a support that only the first visit has at the edge. Against the covariance of all data in one matrix."""
    rng = np.random.default_rng(8)
    parameters = tuple(StateParameter(f"x{k}", 0.0, 1.0) for k in range(3))
    rows, data = rng.normal(size=(2, 5, 3)), rng.normal(size=(2, 5))
    own = {"x1": 0.8}
    visits = [
        VisitInformation(f"v{k}", 0.1 * k, (information_of(parameters, rows[k], data[k], 1.0, f"g{k}"),), given)
        for k, given in enumerate((own, {}))
    ]
    belief = estimate_history(parameters, visits, repeats_between_visits=False, accepted=None).belief
    deviations = np.array([own.get(p.name, 0.0) ** 2 for p in parameters])
    noise = [np.eye(5) + rows[0] @ np.diag(deviations) @ rows[0].T, np.eye(5)]
    precision = np.eye(3) + sum(h.T @ np.linalg.solve(r, h) for h, r in zip(rows, noise))
    mean = np.linalg.solve(precision, sum(h.T @ np.linalg.solve(r, y) for h, r, y in zip(rows, noise, data)))
    assert_allclose(belief.covariance, np.linalg.inv(precision), rtol=1e-9, atol=1e-12)
    assert_allclose(belief.mean, mean, rtol=1e-9, atol=1e-12)


def test_innovations_of_intact_visits_are_chi_squared_and_a_jump_is_named():
    rng = np.random.default_rng(6)
    truth = rng.normal([p.mean for p in CHAIN], [p.sd for p in CHAIN])
    chances = []
    for _ in range(60):
        visits, _ = chain_visits(rng, 3, truth)
        chances += [s.innovation.chance for s in estimate_history(CHAIN, visits).steps[1:]]
    assert 0.4 < np.mean(chances) < 0.6 and min(chances) > 1e-5
    visits, _ = chain_visits(rng, 6, truth)
    changed = truth * np.where(np.array(names_of(CHAIN)) == "spring_2", 0.4, 1.0)
    late, _ = chain_visits(rng, 1, changed, n_recording=8)
    visits.append(VisitInformation("late", 2.0, late[0].groups))
    history = estimate_history(CHAIN, visits)
    last = history.steps[-1]
    assert not last.is_used and last.innovation.parameter == "spring_2" and last.innovation.deviates < -5.0
    assert history.belief is last.predicted
    assert estimate_history(CHAIN, visits, accepted={"late"}).steps[-1].is_used


def test_the_wrong_layout_is_rejected_by_its_first_visit():
    truth = np.array([p.mean + 12.0 * p.sd for p in CHAIN])
    visits, _ = chain_visits(np.random.default_rng(7), 1, truth)
    (step,) = estimate_history(CHAIN, visits).steps
    assert not step.is_used and step.innovation.chance < 1e-10


def test_a_sensor_of_unknown_gain_gives_information_only_by_ratios_to_other_sensors():
    """The gain of this visit is unknown: the remaining information is that of ratios between sensors."""
    parameters = (StateParameter("gain", 0.0, 0.02), StateParameter("stiffness", 0.0, 0.2))
    rows = np.array([[1.0, 1.0], [0.0, 1.0]])  # the second channel has no gain
    group = information_of(parameters, rows, np.array([-0.5, 0.1]), np.array([[0.01], [0.01]]))
    visit = VisitInformation("v", 0.0, (group,))
    belief = estimate_history(parameters, [visit.without(["gain"])], accepted=None).belief
    assert belief.value("gain") == 0.0 and belief.sd[0] == pytest.approx(0.02)
    assert belief.value("stiffness") == pytest.approx(0.1 / (1.0 + (0.01 / 0.2) ** 2))
    assert estimate_history(parameters, [visit], accepted=None).belief.value("stiffness") < 0.03  # 0.1


def test_errors_about_wrong_input_state_the_cause():
    visits, _ = chain_visits(np.random.default_rng(9), 2, np.zeros(8))
    with pytest.raises(ValueError, match="visit 1 is given twice"):
        estimate_history(CHAIN, [*visits, visits[1]])
    with pytest.raises(ValueError, match="'damper_3' is no parameter of this model"):
        estimate_history(CHAIN[:-1], visits)
    with pytest.raises(ValueError, match=r"event at 0\.1 years: 'pad' is no parameter"):
        estimate_history(CHAIN, visits, [Event(0.1, {"pad": 1.0})])
    with pytest.raises(ValueError, match="'spring_0' is given twice"):
        Belief.of_file([*CHAIN, CHAIN[0]])
    with pytest.raises(ValueError, match="must be finite"):
        GroupInformation("g", 1, ("a",), np.array([[np.nan]]), np.zeros(1))
    assert estimate_history(CHAIN, []).belief.sd[0] == 20.0
