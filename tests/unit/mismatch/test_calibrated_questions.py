"""Differences from the file, and changes with their onset: against closed forms and on seeded linear histories."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from turnout.mismatch.calibrated import (
    ChangeEffect,
    Event,
    GroupInformation,
    StateParameter,
    VisitInformation,
    compare_onsets,
    deviations_from_file,
    drift_since,
    estimate_history,
)
from turnout.mismatch.calibrated.change_course import courses_of
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.file_comparison import evidence_from_first, model_error

N_SUPPORT = 5
SUPPORTS = tuple(
    StateParameter(f"ballast@{0.6 * k:.1f}", 0.0, 0.1, 0.03, "ballast", k, 0.6 * k) for k in range(N_SUPPORT)
)
NAMES = tuple(p.name for p in SUPPORTS)
ROWS = np.array([0.6 ** abs(i - j) for i in range(6) for j in range(N_SUPPORT)]).reshape(6, N_SUPPORT)
SD = 0.05  # of each datum
STEP = 0.25  # years between visits


def histories(rng, n_visit, size=0.0, first=None, growth=0.0, support=2):
    """(visits, data) of supports that walk at random; one of them changes by ``size`` at visit ``first``."""
    x = rng.normal(0.0, [p.sd for p in SUPPORTS])
    visits, data = [], []
    for v in range(n_visit):
        if v:
            x = x + rng.normal(0.0, np.sqrt(STEP) * np.array([p.walk_sd for p in SUPPORTS]))
        change = np.zeros(N_SUPPORT)
        if first is not None and v >= first:
            change[support] = size + growth * STEP * (v - first + 1)
        y = ROWS @ (x + change) + rng.normal(0.0, SD, len(ROWS))
        group = GroupInformation(f"{v}", 1, NAMES, ROWS.T @ ROWS / SD**2, ROWS.T @ y / SD**2)
        visits.append(VisitInformation(f"v{v:02}", STEP * v, (group,)))
        data.append(y)
    return visits, data


def change_history(visits, **options):
    return estimate_history(SUPPORTS, visits, repeats_between_visits=False, accepted=None, **options)


EFFECTS = [ChangeEffect(f"{p.name} softer", {p.name: -1.0}, 0.5) for p in SUPPORTS]


def joint_covariance(n_visit):
    """Covariance of the parameters at all visits: scatter, and a random walk."""
    p0, q = np.diag([p.sd**2 for p in SUPPORTS]), np.diag([p.walk_sd**2 for p in SUPPORTS])
    return np.block([[p0 + STEP * min(i, j) * q for j in range(n_visit)] for i in range(n_visit)])


def test_the_evidence_of_an_onset_is_the_ratio_of_the_probabilities_of_all_data():
    visits, data = histories(np.random.default_rng(1), 6, -0.3, 3)
    effects = [EFFECTS[2], ChangeEffect("grows", {NAMES[2]: -1.0, NAMES[3]: -0.5}, 0.4, grows=True)]
    history = change_history(visits)
    evidence = {e.effect.name: e for e in compare_onsets(history, effects)}
    from_first, *_ = evidence_from_first(history, effects)  # with the random walk, which is not constant in the data
    design = np.kron(np.eye(6), ROWS)
    null = design @ joint_covariance(6) @ design.T + SD**2 * np.eye(len(design))
    y = np.concatenate(data)
    for k, effect in enumerate(effects):
        weights = np.array([effect.direction.get(name, 0.0) for name in NAMES])
        for j in range(6):
            time = np.array([(v - j + 1.0 if effect.grows and j else 1.0) * (v >= j) for v in range(6)])
            time /= time[-1]  # of growth, the prior is that of the size at the last visit
            response = design @ np.kron(time, weights)
            changed = null + effect.sd**2 * np.outer(response, response)
            mean = np.zeros(len(y))
            ratio = stats.multivariate_normal(mean, changed).logpdf(y) - stats.multivariate_normal(mean, null).logpdf(y)
            if effect.grows and j == 5:  # the same as a step
                assert evidence[effect.name].gains[j - 1] == -np.inf
                continue
            gain = evidence[effect.name].gains[j - 1] if j else from_first[k]
            assert gain == pytest.approx(ratio, abs=1e-8)


def test_the_drift_is_that_of_all_visits_together():
    visits, data = histories(np.random.default_rng(2), 7, growth=-0.2, first=2)
    design = np.kron(np.eye(7), ROWS)
    prior = joint_covariance(7)
    gain = prior @ design.T @ np.linalg.inv(design @ prior @ design.T + SD**2 * np.eye(len(design)))
    mean, covariance = gain @ np.concatenate(data), prior - gain @ design @ prior
    difference = np.kron(np.eye(7)[6] - np.eye(7)[1], np.eye(N_SUPPORT))
    drift, drift_covariance = drift_since(change_history(visits), "v01")
    assert_allclose(drift, difference @ mean, atol=1e-12)
    assert_allclose(drift_covariance, difference @ covariance @ difference.T, atol=1e-13)
    none, no_covariance = drift_since(change_history(visits), "v06")
    assert np.all(none == 0.0) and np.max(np.abs(no_covariance)) < 1e-15


def test_onsets_are_inside_their_intervals_and_the_support_is_right():
    """120 histories of 12 visits with one support softer by 0.4 from an unknown visit."""
    rng = np.random.default_rng(3)
    inside = right = size_inside = 0
    for _ in range(120):
        first, support = int(rng.integers(1, 12)), int(rng.integers(N_SUPPORT))
        visits, _ = histories(rng, 12, -0.4, first, support=support)
        history = change_history(visits)
        best = compare_onsets(history, EFFECTS)[0]
        right += best.effect is EFFECTS[support]
        low, high = courses_of(history, best.effect).onset_interval()
        inside += low <= STEP * (first - 0.5) <= high
        mean, sd = best.size
        size_inside += abs(mean - 0.4) < 2.0 * sd
    assert right >= 118  # 98 %
    assert inside >= 108  # 90 %: the bar of a stated onset
    assert size_inside >= 106


def test_without_change_no_effect_has_evidence():
    """200 histories of 12 visits: evidence above 6 nats has a probability of at most e^-6 for each effect (Markov)."""
    rng = np.random.default_rng(4)
    gains = [compare_onsets(change_history(histories(rng, 12)[0]), EFFECTS)[0].gain for _ in range(200)]
    assert max(gains) < 6.0
    assert np.mean(np.array(gains) > 2.0) < 0.05


def test_slow_growth_that_the_random_walk_follows_is_detected_by_the_drift():
    """Growth of 0.16 a year: each visit agrees with its prediction, and the drift of three years is beyond 3 sd."""
    rng = np.random.default_rng(5)
    detected, unexpected, sizes = 0, 0, []
    for _ in range(40):
        visits, _ = histories(rng, 13, growth=-0.16, first=1)
        history = estimate_history(SUPPORTS, visits, repeats_between_visits=False)
        unexpected += sum(not s.is_used for s in history.steps)
        drift, covariance = drift_since(history, "v00")
        growth = compare_onsets(change_history(visits), [ChangeEffect("growth", {NAMES[2]: -1.0}, 0.2, grows=True)])[0]
        sizes.append(growth.size[0])
        detected += drift[2] < -3.0 * np.sqrt(covariance[2, 2])
    assert detected >= 38 and unexpected <= 2  # of 520 visits
    assert np.mean(sizes) == pytest.approx(0.16, abs=0.02)  # the drift lags behind, the growing effect does not


def test_a_drift_without_growth_is_that_of_the_random_walk():
    rng = np.random.default_rng(6)
    deviates = []
    for _ in range(200):
        visits, _ = histories(rng, 9)
        drift, covariance = drift_since(change_history(visits), "v00")
        expected = covariance.diagonal()
        walk = np.array([p.walk_sd**2 for p in SUPPORTS]) * 8 * STEP
        deviates.append(drift / np.sqrt(walk - expected))  # variance of the estimate of a walk: prior less posterior
    assert np.std(deviates) == pytest.approx(1.0, abs=0.12)  # 1000 dependent numbers


def test_a_history_of_one_visit_has_no_onset_and_wrong_names_are_errors():
    visits, _ = histories(np.random.default_rng(7), 3)
    assert compare_onsets(change_history(visits[:1]), EFFECTS) == []
    with pytest.raises(ValueError, match="'pad' is no parameter"):
        compare_onsets(change_history(visits), [ChangeEffect("x", {"pad": 1.0}, 1.0)])
    with pytest.raises(ValueError, match="'v99' is no visit of this history"):
        drift_since(change_history(visits), "v99")


# --- against the file

TRACK = tuple(
    [StateParameter(f"pad@{k}", 0.0, 0.1, 0.0, "pad", k, 0.6 * k) for k in range(20)]
    + [StateParameter(f"ballast@{k}", 0.0, 0.1, 0.0, "ballast", k, 0.6 * k) for k in range(20)]
    + [StateParameter("nose_depth", 0.43e-3, 0.2e-3, 0.0, "nose", None, 26.0, "m")]
)
LEAST = {"pad": 0.2, "ballast": 0.2, "nose": 0.3e-3}
TRACK_NAMES = tuple(p.name for p in TRACK)


def history_of(x, rng, sd=0.25):
    """History of one direct measurement of each parameter with an error of ``sd`` prior standard deviations."""
    errors = sd * np.array([p.sd for p in TRACK])
    y = x + rng.normal(0.0, errors)
    group = GroupInformation("g", 1, TRACK_NAMES, np.diag(errors**-2.0), y / errors**2)
    return estimate_history(TRACK, [VisitInformation("v", 0.0, (group,))], accepted=None)


def intact(rng):
    return np.array([rng.normal(p.mean, p.sd) for p in TRACK])


def test_five_soft_sleepers_are_one_finding_although_none_is_beyond_three_deviations():
    rng = np.random.default_rng(8)
    x = np.zeros(len(TRACK))
    x[-1] = TRACK[-1].mean
    x[27:32] = -0.27  # 2.7 prior standard deviations each
    deviation, *others = deviations_from_file(history_of(x, rng, 0.1), TRACK, LEAST)
    assert not others
    assert deviation.names == tuple(f"ballast@{k}" for k in range(7, 12))
    assert deviation.positions == pytest.approx((4.2, 6.6))
    assert deviation.size == pytest.approx(-0.27, abs=4.0 * deviation.sd)
    assert deviation.deviates < -5.0


def test_a_worn_nose_is_a_finding():
    x = intact(np.random.default_rng(9))
    x[-1] = 1.54e-3
    (nose,) = (
        d for d in deviations_from_file(history_of(x, np.random.default_rng(1)), TRACK, LEAST) if d.group == "nose"
    )
    assert nose.size == pytest.approx(1.11e-3, abs=0.2e-3) and nose.deviates > 5.0 and nose.unit == "m"


def test_intact_tracks_rarely_differ_from_their_file():
    """400 tracks with the scatter of the file; three groups at the chance of three deviations each: 0.8 %."""
    rng = np.random.default_rng(10)
    alarms = sum(bool(deviations_from_file(history_of(intact(rng), rng), TRACK, LEAST)) for _ in range(400))
    assert alarms <= stats.binom.ppf(0.999, 400, 3.0 * 2.0 * stats.norm.sf(3.0))


@pytest.mark.parametrize("is_recorded", [True, False])
def test_a_change_by_recorded_tamping_is_no_difference_from_the_file(is_recorded):
    """200 sites of five supports, each moved by twice the scatter of the file; without the record many deviate."""
    rng, alarms = np.random.default_rng(12), 0
    event = Event(0.5 * STEP, {p.name: 2.0 * p.sd for p in SUPPORTS})
    for _ in range(200):
        x, visits = rng.normal(0.0, [p.sd for p in SUPPORTS]), []
        for v in range(4):
            if v == 1:
                x = x + rng.normal(0.0, [2.0 * p.sd for p in SUPPORTS])
            y = x + 0.02 * rng.normal(size=N_SUPPORT)
            group = GroupInformation("A", 1, NAMES, np.eye(N_SUPPORT) / 0.02**2, y / 0.02**2)
            visits.append(VisitInformation(f"v{v}", STEP * v, (group,)))
        history = estimate_history(SUPPORTS, visits, [event] if is_recorded else [], accepted=None)
        alarms += bool(deviations_from_file(history, SUPPORTS, {"ballast": 0.2}))
    assert alarms <= 4 if is_recorded else alarms > 20  # 0.3 % of 200 sites are 0.5


@pytest.mark.parametrize("is_known", [True, False])
def test_absorbed_errors_of_pads_beyond_the_sensors_are_no_difference_from_the_file(is_known):
    """300 sites of four pads whose fitted values have errors of 0.1 and a scatter of 0.1; many differ if the error
    is not known. A pad with a third of its stiffness differs in both cases."""
    pads = [
        StateParameter(f"pad@{k}", 0.0, 0.1, 0.0, "pad", k, 0.6 * k, is_beyond_sensors=is_known) for k in (0, 1, 18, 19)
    ]
    error, rng = dict(CALIBRATION.model_errors_beyond_sensors)["pad"], np.random.default_rng(13)
    names, information = tuple(p.name for p in pads), np.eye(len(pads)) / 0.03**2

    def differences(x):
        group = GroupInformation("A", 1, names, information, information @ x)
        history = estimate_history(pads, [VisitInformation("v", 0.0, (group,))], [model_error(pads)], accepted=None)
        return deviations_from_file(history, pads, {"pad": 0.35})

    sites = [rng.normal(0.0, np.hypot(0.1, error), len(pads)) for _ in range(300)]
    alarms = sum(bool(differences(x)) for x in sites)
    assert alarms <= 3 if is_known else alarms > 8  # 0.3 % of 300 sites are 0.8
    (soft,) = differences(np.array([0.0, np.log(0.33), 0.0, 0.0]))
    assert soft.names == ("pad@1",)


def test_an_uncertain_or_too_small_difference_is_no_finding():
    x = np.array([p.mean for p in TRACK])
    x[5] = -0.6
    assert not deviations_from_file(history_of(x, np.random.default_rng(1), sd=3.0), TRACK, LEAST)
    clear = history_of(x, np.random.default_rng(1), sd=0.1)
    assert [d.names for d in deviations_from_file(clear, TRACK, LEAST)] == [("pad@5",)]
    assert not deviations_from_file(clear, TRACK, {"pad": 0.7})
    assert not deviations_from_file(estimate_history(TRACK, []), TRACK, LEAST)
