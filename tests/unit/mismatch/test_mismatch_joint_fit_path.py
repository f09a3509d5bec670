"""Joint fits with many steps: outdated Jacobians, predicted gains that are not reached, and clipped peaks."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine import map_fit, refit
from turnout.mismatch.engine.candidate import EffectSite, RefitStarts
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.hammer_prescreen import _Prescreen, _Start
from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.mismatch.engine.levenberg_marquardt import DampedSteps
from turnout.mismatch.engine.map_fit import fit_jointly, steps_from
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.score import Score
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.mismatch.turnout.passage_observation import AlignedPassage, _clipped_samples, observation_of
from turnout.mismatch.turnout.priors import PASSAGE
from turnout.records import Channel, Recording


class Bent(Case):
    """Sixty numbers by hyperbolic tangents and sines of twelve nuisances, far from the prior."""

    def __init__(self, frozen):
        rng = np.random.default_rng(4)
        self.along, self.across = rng.normal(size=(60, 12)), rng.normal(size=(60, 12))
        self.is_large = frozen
        self.nuisances = tuple(Nuisance(f"x{k}", "-", 0.0, 3.0) for k in range(12))
        data = self._shown(rng.normal(size=12)) + 0.1 * rng.normal(size=60)
        self.observations = (Observation("all", "all", data, np.full(60, 0.1)),)

    def _shown(self, x):
        return self.along @ np.tanh(0.5 * x) + 0.3 * np.sin(self.across @ x)

    def predict(self, values, terms, observations):
        return [self._shown(np.array([values[n.name] for n in self.nuisances]))]


def test_a_large_fit_computes_its_jacobian_again_far_from_its_start():
    """The fit ends where one with new derivatives at every step ends, to the limit of the iteration, 0.1 of its cost.
    A fit that only updates its first derivatives does not."""
    full, renewed = fit_jointly(Bent(False), iterations=40), fit_jointly(Bent(True), iterations=25)
    first = fit_jointly(Bent(True), iterations=1).jacobian
    updated = fit_jointly(Bent(True), reused_jacobian=first, iterations=25)
    assert renewed.cost == pytest.approx(full.cost, abs=0.2)
    assert updated.cost > full.cost + 1.0


def test_after_a_step_with_a_higher_cost_new_derivatives_precede_smaller_steps(monkeypatch):
    """Updated derivatives of the wrong sign cause one more trial each time, and the fit ends at the same values."""
    trials, first_improvement = [], DampedSteps.first_improvement

    def recorded(self, cost, damping, max_tries=None):
        before = self.joint.evaluations
        result = first_improvement(self, cost, damping, max_tries)
        trials.append((self.joint.evaluations - before, result[0] is not None))
        return result

    monkeypatch.setattr(DampedSteps, "first_improvement", recorded)
    monkeypatch.setattr(map_fit, "broyden_update", lambda jacobian, *_: [-j for j in jacobian])
    case = Bent(True)
    case.reuses_derivatives = True
    fit = fit_jointly(case, iterations=40)
    failed = [n for n, improved in trials[:-1] if not improved]
    assert len(failed) >= 3 and max(failed) == 1
    assert fit.cost == pytest.approx(fit_jointly(Bent(False), iterations=40).cost, abs=0.2)


def test_a_large_fit_that_decides_the_answer_continues_for_smaller_gains(monkeypatch):
    """A limit of twenty per sample, 1,200 in all, ends the fit early; leaders continue for a fifth of the usual
    limit."""
    early, late = (fit_jointly(Bent(True), iterations=25, stall=s) for s in (20.0, THRESHOLDS.fine_stall))
    assert early.cost > late.cost + 1.0
    assert fit_jointly(Bent(False), iterations=25, stall=20.0).cost == pytest.approx(
        late.cost, abs=0.2
    )  # a small case has no such limit
    calls = []
    search = Search(Bent(True))
    monkeypatch.setattr(Search, "fit", lambda *a, stall=THRESHOLDS.stall: calls.append(stall) or late)
    search.converge(early)
    search.continue_fit(early)
    assert set(calls[:-1]) == {THRESHOLDS.fine_stall} and calls[-1] == THRESHOLDS.stall > THRESHOLDS.fine_stall


@pytest.mark.parametrize(("gain", "ended"), [(5.0, 0), (8.0, 1), (20.0, 1)])
def test_effects_near_the_threshold_are_fitted_to_convergence_like_leaders(monkeypatch, gain, ended):
    """A name needs 12 nats; from half of them on the fit continues to convergence."""
    score, calls = SimpleNamespace(gain=gain, is_reportable=True, family="a"), []
    monkeypatch.setattr(
        refit, "shortlist", lambda *a: [SimpleNamespace(rival=False, promise=0.0, candidate=SimpleNamespace(key="a"))]
    )
    monkeypatch.setattr(refit, "_score_task", lambda *a: score)
    monkeypatch.setattr(refit, "refit_to_convergence", lambda *a: calls.append(a) or score)
    monkeypatch.setattr(refit, "at_best_position", lambda search, fit, s: s)
    monkeypatch.setattr(refit, "restart_leader", lambda search, fit, s: s)
    monkeypatch.setattr(refit, "_with_condition_gains", lambda search, fit, s: s)
    monkeypatch.setattr(refit, "_base_from_leader", lambda *a: None)
    plain = SimpleNamespace(candidates=())
    refit.score_candidates(Search(Bent(True)), plain, None)
    assert len(calls) == ended


@pytest.mark.parametrize(("beside", "begun"), [((), ["a"]), (("a name",), [])])
def test_only_the_first_leader_of_a_first_effect_is_restarted(monkeypatch, beside, begun):
    """Of two leaders; beside a name the residual may be an error of the shape of that name."""
    scores = {f: SimpleNamespace(gain=g, is_reportable=True, family=f, fit=None) for f, g in (("a", 20.0), ("b", 19.0))}
    entries = [SimpleNamespace(rival=False, promise=0.0, candidate=SimpleNamespace(key=f)) for f in "ba"]
    calls = []
    monkeypatch.setattr(refit, "shortlist", lambda *a: entries)
    monkeypatch.setattr(refit, "_score_task", lambda search, fit, entry, *a: scores[entry.candidate.key])
    monkeypatch.setattr(refit, "_refit_equivalent_forms", lambda search, fit, ranked: ranked)
    monkeypatch.setattr(refit, "refit_to_convergence", lambda search, fit, s: s)
    monkeypatch.setattr(refit, "at_best_position", lambda search, fit, s: s)
    monkeypatch.setattr(refit, "restart_leader", lambda search, fit, s: calls.append(s.family) or s)
    monkeypatch.setattr(refit, "correct_for_leader", lambda search, fit, ranked: ranked)
    monkeypatch.setattr(refit, "_with_condition_gains", lambda search, fit, s: s)
    monkeypatch.setattr(refit, "_base_from_leader", lambda *a: None)
    plain = SimpleNamespace(candidates=beside)
    refit.score_candidates(Search(Bent(True)), plain, None)
    assert calls == begun


@pytest.mark.parametrize(("stall", "again"), [(20.0, True), (0.05, False)])
def test_the_missing_convergence_of_the_base_fit_is_no_evidence_for_an_effect(monkeypatch, stall, again):
    """A leader with 20 nats of its own is fitted to convergence, the base fit has stopped earlier. From the nuisances
    of the leader the base fit converges as well. Its gain is subtracted from the evidence. If it exceeds the threshold
    of a name, all candidates are scored again with the better base fit."""
    early, late = (fit_jointly(Bent(True), iterations=25, stall=s) for s in (stall, THRESHOLDS.fine_stall))
    owed = late.evidence - early.evidence
    assert (owed > MismatchSettings().threshold) == again
    calls, prescreens, of_the_prescreen = [], [], ["entry"]

    def ranked(search, fit, prescreened):
        calls.append(fit.evidence)
        assert prescreened is of_the_prescreen
        debt = late.evidence - fit.evidence
        return [Score(SimpleNamespace(key=k), debt + g, 0.0, 1.0, late) for k, g in (("a", 20.0), ("b", 3.0))]

    monkeypatch.setattr(refit, "_rank_families", ranked)
    monkeypatch.setattr(refit, "prescreened_entries", lambda *a: prescreens.append(a) or of_the_prescreen)
    monkeypatch.setattr(refit, "correct_for_leader", lambda search, fit, found: found)
    monkeypatch.setattr(refit, "_with_condition_gains", lambda search, fit, s: s)
    found, fit = refit.score_candidates(Search(Bent(True)), early)
    assert [s.gain for s in found] == pytest.approx([20.0, 3.0], abs=0.5)
    assert len(calls) == 1 + again and fit.evidence == pytest.approx(calls[-1])
    assert len(prescreens) == 1  # it does not depend on the fit without effects
    assert fit.evidence == pytest.approx(late.evidence, abs=0.5 if again else MismatchSettings().threshold)


def test_a_fit_ends_early_only_if_its_steps_do_not_lead_to_the_target_cost():
    """At the start, without a step, if the target is far below the optimum; never if the optimum is below the
    target."""
    optimum = fit_jointly(Bent(True), iterations=25)
    start = fit_jointly(Bent(True), iterations=0)
    found = fit_jointly(Bent(True), iterations=25, sought_cost=optimum.cost + 1.0)
    given_up = fit_jointly(Bent(True), iterations=25, sought_cost=-1e6)
    assert found.cost == optimum.cost < start.cost
    assert given_up.cost == start.cost and given_up.evaluations < found.evaluations


def test_the_predicted_gain_of_a_step_is_its_gain_where_the_model_is_linear():
    """With the prior of all numbers, so that the fit is at its optimum after one step."""
    case = Bent(False)
    case._shown = lambda x: 0.02 * case.along @ x  # residuals below their errors: a noise scale of one
    case.observations = (Observation("all", "all", 0.05 * np.cos(np.arange(60.0)), np.full(60, 0.1)),)
    joint = JointProblem(case)
    theta = np.full(12, 0.2)
    predictions = joint.predict(theta)
    residuals = joint.residuals(predictions)
    steps = DampedSteps(joint, theta, residuals, joint.jacobian(theta, predictions))
    gained = joint.cost(theta, residuals) - fit_jointly(case).cost
    assert steps.promise == pytest.approx(gained, rel=1e-4) and gained > 0.01


def test_a_trial_has_the_cost_of_the_fit_without_its_last_derivatives(monkeypatch):
    calls, jacobian = [], JointProblem.jacobian
    monkeypatch.setattr(JointProblem, "jacobian", lambda self, *a: calls.append(1) or jacobian(self, *a))
    case, at = Bent(False), {f"x{k}": 0.5 for k in range(12)}
    cost, values, _ = steps_from(case, (), np.zeros(0), at, 3)
    assert len(calls) == 3  # where each of the three steps starts
    fit = fit_jointly(case, values=at, iterations=3)
    assert (cost, values) == (fit.cost, fit.values) and len(calls) == 3 + 4


def test_a_trial_ends_early_only_if_its_steps_do_not_lead_to_the_target_cost():
    case, at = Bent(False), {f"x{k}": 0.5 for k in range(12)}
    start, end = (steps_from(case, (), np.zeros(0), at, steps)[0] for steps in (0, 3))
    assert steps_from(case, (), np.zeros(0), at, 3, end + 1.0)[0] == end < start
    assert steps_from(case, (), np.zeros(0), at, 3, -1e6)[0] == start


def test_a_fit_continues_from_the_end_of_its_trial(monkeypatch):
    """It ends where a fit from the priors ends, and does not repeat the steps of the trial."""
    case, base, predicted = Bent(False), fit_jointly(Bent(False), iterations=40), []
    monkeypatch.setattr(Bent, "predict", lambda *given, predict=Bent.predict: predicted.append(1) or predict(*given))
    candidate = SimpleNamespace(
        key="a", parameters=(), term=lambda psi: None, refit=SimpleNamespace(prescreen_group=""),
        site=EffectSite(),
    )  # fmt: skip
    fits = []
    for tried in (False, True):
        step = _Prescreen(MismatchSettings(), case, case, (), base, replace(base, evidence=0.0))
        if tried:
            step._trial_gain(candidate, np.zeros(0), -np.inf)
        n_before = len(predicted)
        fits.append((step.fit(candidate, np.zeros(0)), len(predicted) - n_before))
    (alone, n_alone), (after_trial, n_after) = fits
    assert after_trial.gain == pytest.approx(alone.gain, abs=1e-6)
    assert after_trial.values == pytest.approx(alone.values, abs=1e-6)
    assert n_after < n_alone


def test_sites_are_tried_until_they_are_not_among_the_two_best(monkeypatch):
    """In the order of the predicted gains of their columns; a further effect of the group uses the same trials."""
    gains, sought = {"a": 10.0, "b": 30.0, "c": 20.0, "d": 5.0}, []

    def trial_gain(step, candidate, start, sought_gain):
        sought.append((candidate.key, sought_gain))
        return gains[candidate.key]

    def starts():
        candidate = [
            SimpleNamespace(key=k, where={"place": k}, refit=SimpleNamespace(prescreen_group="g")) for k in "abcd"
        ]
        return [_Start(promise, c, np.zeros(1)) for promise, c in zip((4.0, 9.0, 8.0, 7.0), candidate)]

    monkeypatch.setattr(_Prescreen, "_trial_gain", trial_gain)
    step = _Prescreen(MismatchSettings(), Bent(False), Bent(False), (), SimpleNamespace(), SimpleNamespace())
    for _ in range(2):
        assert [c.key for c, _ in step.likeliest_starts(starts())] == ["b", "c"]
    assert sought == [("b", -np.inf), ("c", -np.inf), ("d", 20.0), ("a", 20.0)]


@pytest.mark.parametrize("order", [(1.0, 2.0, 3.0), (3.0, 1.0, 2.0)])
def test_of_the_starts_of_an_effect_of_the_whole_track_the_best_one_is_used(monkeypatch, order):
    sought = []

    def trial_gain(step, candidate, start, sought_gain):
        sought.append(sought_gain)
        return start[0]

    monkeypatch.setattr(_Prescreen, "_trial_gain", trial_gain)
    step = _Prescreen(MismatchSettings(), Bent(False), Bent(False), (), SimpleNamespace(), SimpleNamespace())
    candidate = SimpleNamespace(key="a", where={}, refit=SimpleNamespace(prescreen_group="g"))
    starts = [_Start(float(k), candidate, np.array([gain])) for k, gain in enumerate(order)]
    assert step.likeliest_starts(starts)[0][1] == [3.0]
    assert sought == [-np.inf, *np.maximum.accumulate(order[::-1])[:-1]]  # the most promising start is the last


def test_the_base_fit_is_not_repeated_if_no_effect_would_be_named():
    late = fit_jointly(Bent(True), iterations=25, stall=THRESHOLDS.fine_stall)
    silent = [Score(SimpleNamespace(key="a"), 11.0, 0.0, 1.0, late)]
    assert refit._base_from_leader(Search(Bent(True)), late, silent) is None


def test_samples_at_the_range_of_a_channel_have_errors_of_the_size_of_its_signal():
    rate, n = 4000.0, 4000
    samples = 3.0 * np.sin(2 * np.pi * 20.0 * np.arange(n) / rate) * np.ones((2, 1))
    samples[0, 2000] = -50.0
    channels = tuple(Channel(name, "acceleration", "m/s²", limit=50.0) for name in ("A1", "A2"))
    recording = Recording(samples, rate, channels)
    sensors = [SimpleNamespace(name=name, place=x) for name, x in (("A1", 0.0), ("A2", 2.0))]
    time = np.arange(0.1, 0.9, 0.005) + 0.0013
    topped = _clipped_samples(recording, sensors, time)
    assert np.array_equal(topped[0], np.abs(time - 0.5) < PASSAGE.clipping_blur)
    assert not topped[1].any()
    vehicle = SimpleNamespace(wheel_positions=np.array([0.0]), static_loads=np.array([5e4]))
    passage = SimpleNamespace(
        recording=recording, train="ic3", speed=20.0, direction="facing", conditions={}, vehicle=vehicle
    )
    rolling = AlignedPassage("p", passage, tuple(sensors), time, 0.2, 20.0)
    data = np.array([np.interp(time, np.arange(n) / rate, row) for row in samples])
    sigma = observation_of(rolling, data, np.full(2, 0.01), 0.06, topped).sigma.reshape(2, -1)
    plain = observation_of(rolling, data, np.full(2, 0.01), 0.06).sigma.reshape(2, -1)
    assert np.all(sigma[topped] >= np.abs(data[0]).max())
    assert np.array_equal(sigma[~topped], plain[~topped])


@pytest.mark.parametrize("gain, gives_up", [(40.0, False), (60.0, True)])
def test_with_a_strong_leader_only_a_base_fit_better_by_a_threshold_is_searched(monkeypatch, gain, gives_up):
    """The base fit is at its optimum already; from the nuisances of the leader the fit would return to it."""
    case, continued = Bent(True), []
    base = fit_jointly(case, iterations=25)
    elsewhere = replace(base, values={name: 0.9 * value for name, value in base.values.items()})
    leader = Score(SimpleNamespace(key="a"), gain, 0.0, 1.0, elsewhere)
    monkeypatch.setattr(Search, "converge", lambda search, fit: continued.append(fit) or fit)
    found = refit._base_from_leader(Search(case), base, [leader])
    assert bool(continued) == (not gives_up)
    assert (found.cost > base.cost + 0.2) == gives_up


@pytest.mark.parametrize(("gain", "kept"), [(30.0, 30.0), (-100.0, 7.5)])
def test_the_limit_of_a_leader_is_refitted_from_its_nuisances(monkeypatch, gain, kept):
    """From its own start the fit of a gap of 2.5 mm ended 250 nats too low. The better of both fits counts."""
    calls = []

    def refitted(search, fit, task, is_far):
        calls.append((task.start.tolist(), task.values, is_far))
        return SimpleNamespace(candidates=(task.candidate,), gain=gain)

    monkeypatch.setattr(refit, "_refit", refitted)
    monkeypatch.setattr(refit, "score_of", lambda search, fit, refitted, *a: SimpleNamespace(gain=refitted.gain))
    store = {}
    monkeypatch.setattr(Search, "stored_fit", lambda self, key, compute, _: store.setdefault(key, compute()))
    plain, at_bound = SimpleNamespace(candidates=()), {"x0": 2.0}
    candidate = SimpleNamespace(frame="place", key="gap", site=EffectSite(n_scanned=30), refit=RefitStarts(((1e-3,),)))
    limit = SimpleNamespace(gain=7.5, candidate=candidate, estimates=(np.array([1e-3]), np.array([1e-4])))
    limit.is_limit_of = limit.is_simpler_form_of = lambda rival: rival is leader
    unrelated = SimpleNamespace(gain=9.0, is_limit_of=lambda rival: False, is_simpler_form_of=lambda rival: False)
    leader = SimpleNamespace(gain=40.0, fit=SimpleNamespace(values=at_bound))
    ranked = refit._refit_equivalent_forms(Search(Bent(True)), plain, [leader, unrelated, limit])
    assert calls == [([1e-3], at_bound, False)] and len(store) == 1
    assert [s.gain for s in ranked] == sorted([40.0, kept, 9.0], reverse=True)
