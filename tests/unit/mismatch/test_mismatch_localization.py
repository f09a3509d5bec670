"""Localization of a residual without a name: evidence for subspaces, quiet segments, and losses of the fit."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import f

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.decision import calibrate, judge
from turnout.mismatch.engine.diagnose import _locate_unknown
from turnout.mismatch.engine.evidence import assess, score_of
from turnout.mismatch.engine.findings import Findings
from turnout.mismatch.engine.fit_quality import is_significantly_worse
from turnout.mismatch.engine.localization import (
    Location,
    _credible_evidence,
    _location_of_candidate,
    evidence_left_at,
    locate,
    location_of_left_force,
)
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.residual_space import ResidualSpace
from turnout.mismatch.engine.score import Score
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.space_evidence import (
    AMPLITUDES,
    NOISE_FACTORS,
    SpaceEvidence,
    subspace_evidence,
    weigh_spaces,
)
from turnout.mismatch.engine.strained_values import StrainedValue
from turnout.mismatch.turnout import disturbances
from turnout.mismatch.turnout.priors import DISTURBANCE
from turnout.physics import Parameter
from turnout.stages.mismatch_text import title

N, K = 60, 6


def orthonormal(n, k, seed=3):
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(n, k)))[0]


@pytest.mark.parametrize("i, j", [(9, 4), (14, 9)])
def test_evidence_of_a_subspace_is_the_closed_form(i, j):
    """Residual with mean square f outside and f + a² inside a subspace of k of n dimensions:
    (n/2) ln(mean over f) - (k/2) ln(1 + a²/f), here with both maxima on the grid."""
    floor = K / N * AMPLITUDES[i] / (NOISE_FACTORS[j] - 1.0)
    inside = np.sqrt(floor + AMPLITUDES[i])
    basis = orthonormal(N, N)
    r = basis @ np.concatenate([np.full(K, inside), np.full(N - K, np.sqrt(floor))])
    b = 7.0 * basis[:, :K]  # independent of the scale of the columns
    expected = 0.5 * N * np.log(NOISE_FACTORS[j]) - 0.5 * K * np.log1p(AMPLITUDES[i] / floor)
    assert subspace_evidence(b.T @ b, b.T @ r, r @ r, N, floor) == pytest.approx(expected, rel=1e-9)


def test_the_residual_of_intact_recordings_is_no_evidence():
    basis = orthonormal(N, N)
    r = basis @ np.full(N, np.sqrt(0.5))
    b = basis[:, :K]
    assert subspace_evidence(b.T @ b, b.T @ r, r @ r, N, 0.5) == 0.0
    assert subspace_evidence(b.T @ b, b.T @ r, r @ r, N, 2.0) == 0.0


class Places(Case):
    """Three sensors that respond to a force at place 0, 1 or 2 with the rows of ``seen``; no nuisance."""

    seen = np.array([[1.0, 0.5, 0.2], [0.5, 1.0, 0.5], [0.2, 0.5, 1.0]])

    def __init__(self, rows):
        self.observations = (Observation("a", "a", rows.ravel(), 1.0, data_type="passage"),)
        self.n = rows.shape[1]

    def predict(self, values, terms, observations):
        return [np.zeros(o.data.size) for o in observations]

    def residual_spaces(self, fit):
        free, eye = np.eye(self.n), np.eye(3)
        parts = {("place", float(x)): np.kron(self.seen[:, x : x + 1], free) for x in range(3)}
        parts |= {("sensor", f"S{s}"): np.kron(eye[:, s : s + 1], free) for s in range(3)}
        yield ResidualSpace(("a",), np.eye(3 * self.n), parts)


@pytest.mark.parametrize(
    "mix, frame, level", [([0.2, 0.5, 1.0], "place", 2.0), ([0.5, 1.0, 0.5], "place", 1.0), ([0, 1, 0], "sensor", "S1")]
)
def test_a_force_is_distinguished_from_a_channel(mix, frame, level):
    rng = np.random.default_rng(8)
    rows = 0.5 * rng.normal(size=(3, 40)) + 4.0 * np.outer(mix, rng.normal(size=40))
    case = Places(rows)
    fit = fit_jointly(case)
    best = weigh_spaces(case, fit, {"passage": 1.0})[0]
    assert (best.frame, best.level) == (frame, level)
    found = locate(case, fit)
    assert (found.frame, found.place) == (frame, level if frame == "place" else None)
    assert found.sensor == (level if frame == "sensor" else None)


@pytest.mark.parametrize("mix, frame", [([0.2, 0.5, 1.0], "place"), ([0, 1, 0], "sensor")])
def test_a_residual_like_that_of_intact_turnouts_has_no_position(mix, frame):
    """The limit applies to positions: a channel with the same evidence is stated."""
    rng = np.random.default_rng(8)
    case = Places(0.5 * rng.normal(size=(3, 40)) + 4.0 * np.outer(mix, rng.normal(size=40)))
    fit = fit_jointly(case)
    nats = locate(case, fit).nats
    case.place_level = 0.9 * nats
    assert locate(case, fit).frame == frame
    case.place_level = 1.1 * nats
    assert (locate(case, fit) is None) is (frame == "place")


@pytest.mark.parametrize("position", [0, 1, 2])
def test_an_absorbed_cause_is_located_also_if_the_residual_is_below_the_control_level(position):
    """The residual is 0.3 of the control level: with that level as the noise no position would have evidence."""
    rng = np.random.default_rng(8)
    rows = 0.3 * rng.normal(size=(3, 150)) + 0.7 * np.outer(Places.seen[position], rng.normal(size=150))
    case = Places(rows)
    fit = fit_jointly(case)
    assert fit.level["passage"] < 0.5
    assert all(w.nats == 0.0 for w in weigh_spaces(case, fit, {"passage": 1.0}))
    absorbed = StrainedValue(Nuisance("mass", "-", 0.0, 0.1), 6.0, 15.0)
    assert locate(case, fit) is None and locate(case, fit, absorbed=absorbed).place == position


@pytest.mark.parametrize(
    "at, text", [(("train", "railcar"), "on railcar"), (("frequency", "track"), "along the whole track"),
                 (("sensor", "S1"), "in channel S1")],
)  # fmt: skip
def test_a_value_that_has_absorbed_the_whole_effect_is_the_location(at, text):
    """The residual is noise, and equal at all positions."""
    rows = np.random.default_rng(8).normal(size=(3, 150))
    case = Places(0.3 * rows)
    absorbed = StrainedValue(Nuisance("value", "-", 0.0, 0.1, at=at), 6.0, 15.0)
    assert str(locate(case, fit_jointly(case), absorbed=absorbed)) == text


class Bursts(Places):
    """A force acts during five samples only."""

    def residual_spaces(self, fit):
        for space in super().residual_spaces(fit):
            short = np.eye(self.n)[:, :5]
            parts = {("place", float(x)): np.kron(self.seen[:, x : x + 1], short) for x in range(3)}
            yield ResidualSpace(space.names, space.columns, parts)


@pytest.mark.parametrize("noise, frame", [(0.2, "train"), (1.2, "place")])
def test_a_residual_like_that_of_intact_recordings_does_not_change_the_location_of_an_absorbed_effect(noise, frame):
    """In both cases one position has more evidence than the value. In the first case the whole residual is below the
    control level: the track differs from its model there, as in recordings without an effect."""
    rng = np.random.default_rng(8)
    burst = 6.0 * np.sin(1.0 + np.arange(400.0)) * (np.arange(400) < 5)
    case = Bursts(noise * rng.normal(size=(3, 400)) + np.outer(Places.seen[2], burst))
    case.control_level = {"passage": 1.0}
    fit, absorbed = (
        fit_jointly(case),
        StrainedValue(Nuisance("value", "-", 0.0, 0.1, at=("train", "railcar")), 6.0, 3.0),
    )
    first, second = weigh_spaces(case, fit, {"passage": 1.0})[:2]
    assert first.level == 2.0 and first.nats - second.nats > absorbed.nats
    assert (fit.level["passage"] < 1.0) is (frame == "train")
    assert locate(case, fit, absorbed=absorbed).frame == frame


@pytest.mark.parametrize("nats, frame", [(15.0, "place"), (1e4, "train")])
def test_the_residual_at_one_position_outweighs_an_absorbing_value_by_evidence_over_all_other_positions(nats, frame):
    rng = np.random.default_rng(8)
    case = Places(rng.normal(size=(3, 150)) + 3.0 * np.outer(Places.seen[2], rng.normal(size=150)))
    absorbed = StrainedValue(Nuisance("value", "-", 0.0, 0.1, at=("train", "railcar")), 6.0, nats)
    assert locate(case, fit_jointly(case), absorbed=absorbed).frame == frame


class Stretches(Places):
    """With spaces of two neighbouring places."""

    def residual_spaces(self, fit):
        for space in super().residual_spaces(fit):
            pairs = {
                ("place", (x, x + 1.0)): np.concatenate(
                    [space.combinations["place", x], space.combinations["place", x + 1.0]], axis=1
                )
                for x in (0.0, 1.0)
            }
            yield ResidualSpace(space.names, space.columns, {**space.combinations, **pairs})


def test_a_name_leaves_the_force_that_is_strongest_at_its_position():
    rng = np.random.default_rng(8)
    case = Stretches(0.5 * rng.normal(size=(3, 40)) + 4.0 * np.outer(Places.seen[2], rng.normal(size=40)))
    fit = fit_jointly(case)
    of_places = [w for w in weigh_spaces(case, fit, {"passage": 1.0}) if w.frame == "place"]
    assert weigh_spaces(case, fit, {"passage": 1.0}, "place") == of_places
    strongest = of_places[0]
    assert strongest.level == (1.0, 2.0) or strongest.level == 2.0
    left = evidence_left_at(case, fit, 2.0)
    assert (left.level, left.nats) == (strongest.level, strongest.nats) and left.nats > 40.0
    assert evidence_left_at(case, fit, 0.0) is None and evidence_left_at(case, fit, 2.1) is None
    location = location_of_left_force(case, SimpleNamespace(fit=fit, candidate=SimpleNamespace(position=2.0)))
    assert (location.frame, location.high) == ("place", 2.0)


class PartlyNamed(Bursts):
    """The candidate at place 2 is the force there during its first samples alone."""

    def __init__(self, n_named):
        samples = np.arange(400)
        burst = 9.0 * np.sin(1.0 + samples) * (samples < 5)
        rng = np.random.default_rng(8)
        super().__init__(0.2 * rng.normal(size=(3, 400)) + np.outer(Places.seen[2], burst))
        self.control_level, self.place_level = {"passage": 1.0}, 200.0
        self.shape = np.outer(Places.seen[2], burst * (samples < n_named)).ravel()
        size = (Parameter("size", "-", 0.0, (-9.0, 9.0), "", "made up 2026"),)
        self.candidates = (Candidate.of("local_pad", size, dict, ((0.5,),), {"place": 2.0}),)

    def predict(self, values, terms, observations):
        return [sum((term["size"] * self.shape for term in terms), np.zeros(1200))]


@pytest.mark.parametrize(("n_named", "answer"), [(1, "unknown"), (5, "named")])
def test_a_name_that_explains_less_than_it_leaves_at_its_position_is_located_and_not_named(n_named, answer):
    """Before and after, the residual is that of intact recordings, and each name has more than 12 nats.

    What is left has less evidence than a residual without any name needs for a position.
    """
    case = PartlyNamed(n_named)
    search, (candidate,) = Search(case), case.candidates
    base, refit = fit_jointly(case), fit_jointly(case, (candidate,), [0.5])
    score = score_of(search, base, refit, candidate)
    assert base.level["passage"] < 1.0 and score.gain > search.settings.threshold
    verdict, _ = assess(search, base, [score])
    assert verdict.answer == answer
    location = _locate_unknown(Findings(search, base, base, (verdict,)), verdict)
    assert (location and location.place) == (2.0 if answer == "unknown" else None)


def test_recordings_like_intact_ones_and_fits_without_derivatives_leave_no_force():
    rng = np.random.default_rng(8)
    case = Stretches(0.05 * rng.normal(size=(3, 40)) + 0.4 * np.outer(Places.seen[2], rng.normal(size=40)))
    case.control_level = {"passage": 1.0}
    fit = fit_jointly(case)
    left = evidence_left_at(case, fit, 2.0)
    assert left is None or left.nats == 0.0
    assert evidence_left_at(case, replace(fit, jacobian={}), 2.0) is None


def test_an_effect_in_all_trains_is_not_located_in_one_train():
    """Only the part of the evidence that other trains do not have counts for a train."""
    of_trains = [
        SpaceEvidence("train", "A", 30.0),
        SpaceEvidence("train", "B", 26.0),
        SpaceEvidence("clock", "p1", 7.0),
    ]
    credible = {(w.frame, w.level): w.nats for w in _credible_evidence(Places(np.zeros((3, 9))), None, of_trains)}
    assert credible == {("train", "A"): 4.0, ("clock", "p1"): 7.0}


class Support(Case):
    """Two recordings with six nuisances. In the first, an unknown cause acts along ``columns``, which the nuisances can
    imitate."""

    def __init__(self, rng, n=40, k=3):
        self.nuisances = tuple(Nuisance(f"n{i}", "-", 0.2 * i, 0.3 + 0.2 * i) for i in range(6))
        self.sd = np.array([x.sd for x in self.nuisances])
        self.mean = np.array([x.mean for x in self.nuisances])
        self.jacobian = {"a": rng.normal(size=(n, 6)), "b": rng.normal(size=(5, 6))}
        self.columns = 2.0 * self.jacobian["a"][:, :k] + 0.3 * rng.normal(size=(n, k))
        truth = self.mean + self.sd * rng.normal(size=6)
        data = {name: j @ truth + rng.normal(size=len(j)) for name, j in self.jacobian.items()}
        data["a"] += self.columns @ rng.normal(size=k)
        self.observations = tuple(Observation(name, name, y, 1.0, data_type=name) for name, y in data.items())

    def predict(self, values, terms, observations):
        return [self.jacobian[o.name] @ np.array(list(values.values())) for o in observations]

    def residual_spaces(self, fit):
        yield ResidualSpace(("a",), self.columns, {("place", 0.0): None})


@pytest.mark.parametrize("seed", range(3))
def test_the_prior_cost_of_nuisances_that_imitate_a_cause_is_evidence_for_the_cause(seed):
    """The evidence is that of dense covariances: the data given the other recording, N(m, C), with the cause
    N(m, C + a²BBᵀ)."""
    case = Support(np.random.default_rng(seed))
    fit = fit_jointly(case)
    j, k = case.jacobian["a"], case.jacobian["b"]
    covariance = np.linalg.inv(k.T @ k / fit.scale["b"] + np.diag(case.sd**-2))
    estimate = case.mean + covariance @ k.T @ (case.observations[1].data - k @ case.mean) / fit.scale["b"]
    deviation, c = case.observations[0].data - j @ estimate, np.eye(len(j)) + j @ covariance @ j.T / fit.scale["a"]
    b = case.columns / np.sqrt(np.linalg.eigvalsh(case.columns.T @ np.linalg.solve(c, case.columns)).mean())

    def log_likelihood(noise, amplitude):
        total = noise * c + amplitude * b @ b.T
        return -0.5 * (np.linalg.slogdet(total)[1] + deviation @ np.linalg.solve(total, deviation))

    expected = np.array([[log_likelihood(noise, a) for a in AMPLITUDES] for noise in NOISE_FACTORS])
    (evidence,) = weigh_spaces(case, fit, {"a": 1.0, "b": 1.0})
    assert evidence.nats == pytest.approx(expected.max() - expected[:, 0].max(), rel=1e-6)
    assert evidence.nats > 1.0


class TrainAndImpacts(Case):
    """A passage and two impacts. The passage shows a force at 0 or 1. The impacts show a change at one or both of
    these, equal in all impacts or not."""

    def __init__(self, passage, impacts):
        data = {"p": passage, "h1": impacts[0], "h2": impacts[1]}
        kinds = {"p": "passage", "h1": "hammer", "h2": "hammer"}
        self.observations = tuple(Observation(name, name, y, 1.0, data_type=kinds[name]) for name, y in data.items())

    def predict(self, values, terms, observations):
        return [np.zeros(o.data.size) for o in observations]

    def residual_spaces(self, fit):
        eye, first, second, both = np.eye(40), np.arange(10), np.arange(10, 20), np.arange(20)
        yield ResidualSpace(("p",), eye, {("place", 0.0): first, ("place", 1.0): second})
        levels = {("place", 0.0): first, ("place", 1.0): second, ("place", (0.0, 1.0)): both}
        yield ResidualSpace(("h1", "h2"), np.concatenate([eye, eye]), levels, "linear")
        yield ResidualSpace(("h1",), eye, levels, "free")
        yield ResidualSpace(("h2",), eye, levels, "free")


def test_a_cause_at_two_positions_that_differs_between_impacts_is_located_between_them():
    rng, is_changed = np.random.default_rng(5), np.arange(40) < 20
    y = 0.3 * rng.normal(size=(3, 40))
    y[0, :10] += 6.0 * rng.normal(size=10)  # the train shows a force at 0 alone
    y[1:] += 6.0 * is_changed * rng.normal(size=(2, 40))
    case = TrainAndImpacts(y[0], y[1:])
    fit = fit_jointly(case)
    evidence = {(w.frame, w.level): w for w in weigh_spaces(case, fit, {"passage": 1.0, "hammer": 1.0})}
    both, zero = evidence["place", (0.0, 1.0)], evidence["place", 0.0]
    assert set(both.by_space) == {"p", "h1", "h2"}  # one of the two effects counts
    assert both.by_space["p"] == zero.by_space["p"] > evidence["place", 1.0].by_space["p"]
    found = locate(case, fit)
    assert (found.level, found.place, found.low, found.high) == ((0.0, 1.0), 0.5, 0.0, 1.0)


def test_nothing_is_located_in_noise():
    case = Places(0.5 * np.random.default_rng(2).normal(size=(3, 40)))
    assert locate(case, fit_jointly(case)) is None


def test_a_rejected_candidate_is_the_location_if_it_explains_more():
    case = Places(0.5 * np.random.default_rng(2).normal(size=(3, 40)))
    candidate = SimpleNamespace(frame="wheel", where={"train": "freight", "axle": 3}, key="k", position=None)
    rejected = SimpleNamespace(candidate=candidate, gain=30.0, explained=0.4, possible_positions=None)
    found = locate(case, fit_jointly(case), rejected)
    assert (found.frame, found.train, found.axle) == ("wheel", "freight", 3)
    rejected.explained = 0.1
    assert locate(case, fit_jointly(case), rejected) is None


def levels_of(rng, n_sensor=4, n=2500, rate=5000.0, scale=1.0):
    return disturbances.band_level(scale * rng.normal(size=(n_sensor, n)), rate)


def test_degrees_of_freedom_of_a_quiet_segment():
    """Variance of the band's mean square over its mean squared is 2 / degrees of freedom."""
    rng = np.random.default_rng(1)
    drawn = [levels_of(rng, n_sensor=500) for _ in range(4)]
    power = np.concatenate([p for p, _ in drawn])
    seen = np.var(power) / np.mean(power) ** 2
    assert seen == pytest.approx(2.0 / drawn[0][1], rel=4.0 * np.sqrt(2.0 / power.size))


def test_quiet_segments_of_noise_have_uniform_p_values():
    rng = np.random.default_rng(5)
    chances = np.array([disturbances.excess_over(levels_of(rng), [levels_of(rng)])[1] for _ in range(600)])
    for q in (0.1, 0.5):
        assert abs(np.mean(chances < q) - q) < 4.0 * np.sqrt(q * (1.0 - q) / chances.size)


def test_another_train_raises_the_level_of_all_sensors_and_a_noisy_channel_only_its_own():
    rng = np.random.default_rng(6)
    others = [levels_of(rng) for _ in range(5)]
    excess, p = disturbances.excess_over(levels_of(rng, scale=2.0), others)  # twice the amplitude: 6 dB
    assert excess == pytest.approx(6.0, abs=1.0)
    assert p < DISTURBANCE.max_chance
    power, freedom = levels_of(rng)
    excess, p = disturbances.excess_over((power * np.array([100.0, 1.0, 1.0, 1.0]), freedom), others)
    assert excess < DISTURBANCE.min_excess
    assert p > DISTURBANCE.max_chance


def test_a_fall_of_the_held_out_fit_counts_beyond_two_standard_errors():
    rng = np.random.default_rng(7)
    y, e = rng.normal(size=2500) * 10.0, rng.normal(size=2500)
    held = [Observation("a", "a", y, 1.0)]
    assert is_significantly_worse(held, [y - e], [y - 2.0 * e], 0.5)  # every stretch is worse
    assert not is_significantly_worse(held, [y - 2.0 * e], [y - e], 0.5)
    assert not is_significantly_worse(held, [y - e], [y - e], 0.0)
    mixed = (
        np.where(np.arange(2500) < 1250, 0.0, np.sqrt(2.05)) * e
    )  # one half gains nearly as much as the other half loses
    assert not is_significantly_worse(held, [y - e], [y - mixed], 0.0)
    assert not is_significantly_worse(held, [y - e], [y - 1.001 * e], 0.5)  # worse everywhere, but not by half a point


def test_the_stated_probability_is_between_the_observed_share_and_the_softmax():
    """On the logit scale, the softmax counts for a share; the posterior goes on summing to 1."""
    settings = MismatchSettings()
    posterior = {"none": 0.2, "unknown": 0.05, "a": 0.6, "b": 0.15}
    sure = calibrate(posterior, ("a",), 0.9, settings)
    share = settings.softmax_share
    odds = 9.0 ** (1.0 - share) * 1.5**share
    assert sure == pytest.approx(odds / (1.0 + odds))
    assert posterior["a"] == pytest.approx(sure)
    assert sum(posterior.values()) == pytest.approx(1.0)
    assert posterior["none"] / posterior["b"] == pytest.approx(0.2 / 0.15)


def test_another_train_changes_the_answer_none_to_unknown():
    settings = MismatchSettings()
    assert judge([], 0.5, settings).answer == "none"
    verdict = judge([], 0.5, settings, disturbed=True)
    assert (verdict.answer, verdict.cause) == ("unknown", "clock")
    assert verdict.probability > judge([], 5.0, settings).probability


def test_recordings_that_were_not_fitted_localize_only_if_they_are_the_reason():
    """The excess over controls is in the fitted recordings: a force at a position. A disturbance in another recording
    and an unknown train in a third one do not change that."""
    rng, settings = np.random.default_rng(8), MismatchSettings()
    case = Places(0.5 * rng.normal(size=(3, 40)) + 4.0 * np.outer([0.2, 0.5, 1.0], rng.normal(size=40)))
    case.disturbed_recordings, case.mismatched_trains = (
        (disturbances.Disturbance("p7", "before", 16.0, 1e-9),),
        ("freight",),
    )
    fit = fit_jointly(case)
    for disturbed, foreign in ((True, ()), (False, ("freight",))):
        verdict = judge([], 5.0, settings, disturbed=disturbed, mismatched_trains=foreign)
        assert (verdict.answer, verdict.cause) == ("unknown", "")
        assert verdict.probability == judge([], 5.0, settings).probability
        assert locate(case, fit, None, verdict.cause).place == 2.0
    assert judge([], 0.5, settings, mismatched_trains=("freight",)).cause == "train"
    assert locate(case, fit, None, "clock").frame == "clock"
    assert locate(case, fit, None, "train").train == "freight"


def test_passages_with_different_sensors_are_compared_by_their_common_sensors():
    levels = {
        "a": ({"S1": 4.0, "S2": 8.0, "S3": 1.0}, 50.0),
        "b": ({"S1": 1.0, "S2": 2.0}, 50.0),
        "c": ({"S1": 1.0}, 50.0),
    }
    excess, p = disturbances.excess_over(*disturbances._shared_levels(levels, "a"))
    assert excess == pytest.approx(10.0 * np.log10(4.0))  # S3, which no other passage has, does not count
    assert p == pytest.approx(f.sf(4.0, 50.0, 50.0) ** 2)  # both sensors
    assert disturbances.excess_over(*disturbances._shared_levels(levels, "c")) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("place", "text"),
    [
        (3.6, "at 3.6 m, between 3.0 and 4.2 m"),
        (0.6, "before 2.4 m, at an unknown distance"),
        (9.0, "beyond 8.1 m, at an unknown distance"),
    ],
)
def test_a_position_beyond_the_measured_range_is_stated_as_such(place, text):
    found = Location("place", place, 40.0, place, place - 0.6, place + 0.6, measured_range=(2.4, 8.1))
    assert str(found) == text


@pytest.mark.parametrize(
    ("frame", "where", "text"),
    [
        (
            "condition",
            {},
            "along the whole track",
        ),  # for example pads that soften with temperature: not in one recording alone
        ("frequency", {}, "along the whole track"),
        ("clock", {"sensor": "S1"}, "in channel S1"),  # for example a time offset
        ("wavelength", {"wavelength": 0.05}, "along the rail, at the wavelength 0.050 m"),
        ("wheel", {"train": "railcar", "axle": 3}, "on axle 3 of railcar"),
        ("place", {"place": 3.0}, "at 3.0 m, between 3.0 and 3.0 m"),
    ],
)
def test_a_candidate_without_a_name_is_stated_as_the_location(frame, where, text):
    candidate = Candidate.of("soft", (), dict, (), where, frame=frame)
    location = _location_of_candidate(Score(candidate, 40.0, 0.0, 1.0, None))
    assert str(location) == text
    assert location.frame == ("sensor" if "sensor" in where else frame)  # that it is its clock was rejected


def test_a_candidate_without_a_name_is_located_at_all_its_possible_positions():
    candidate = Candidate.of("soft", (), dict, (), {"place": 8.4}, frame="place")
    score = Score(candidate, 40.0, 0.0, 1.0, None, possible_positions=(7.8, 8.4))
    assert str(_location_of_candidate(score)) == "at 8.4 m, between 7.8 and 8.4 m"


@pytest.mark.parametrize(
    ("frame", "text"),
    [("clock", "in all channels of the recording r 7"), ("condition", "in the recordings of r 7")],
)
def test_the_location_states_the_recording_or_visit_with_the_evidence(frame, text):
    assert str(Location(frame, "r 7", 40.0)) == text


@pytest.mark.parametrize(
    ("error", "text"), [(0.3, "at 8.4 m, between 7.8 and 9.0 m, and"), (0.15, "at 8.4 m, and"), (None, "at 8.4 m, and")]
)
def test_a_position_at_several_possible_supports_is_stated_with_its_interval(error, text):
    fields = {"verdict": "unknown", "position_m": 8.4, "position_se_m": error, "place_low_m": 1.8, "place_high_m": 8.1}
    assert text in title({**fields, "term_json": None})


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_the_loss_of_a_prediction_does_not_depend_on_the_unit_of_a_recording(unit):
    """One recording halves its residual, the other gains a tenth: in errors squared -0.75 and +0.21."""
    e, y = np.random.default_rng(4).standard_normal((2, 400))
    pair = [Observation("a", "a", y, 1.0), Observation("b", "b", unit * y, unit)]
    before, after = [y - e, unit * (y - e)], [y - 0.5 * e, unit * (y - 1.1 * e)]
    assert not is_significantly_worse(pair, before, after, -np.inf)
    assert is_significantly_worse(pair[1:], before[1:], after[1:], -np.inf)
