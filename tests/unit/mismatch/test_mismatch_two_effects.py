"""Two effects together: each alone is rejected, both are named; and effects with fewer numbers are preferred."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch import diagnose
from turnout.mismatch.engine.candidate import Candidate, EffectSite, NamingRules
from turnout.mismatch.engine.candidate_search import Entry, is_same_site, required_promise
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.decision import grade_name, judge
from turnout.mismatch.engine.diagnose import grade_names
from turnout.mismatch.engine.findings import Findings
from turnout.mismatch.engine.hammer_prescreen import informed_values
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation, Whitened
from turnout.mismatch.engine.projector import Projector
from turnout.mismatch.engine.residual_space import ResidualSpace
from turnout.mismatch.engine.score import Score
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.second_effect import add_second
from turnout.mismatch.engine.two_effects import settle_pair
from turnout.mismatch.engine.verdict import Verdict
from turnout.physics import Parameter
from turnout.stages.mismatch_rows import _evidence

AMOUNT = (Parameter("amount", "-", 0.0, (-9.0, 9.0), "share of a shape", "made up 2026"),)
X = np.linspace(0.0, 1.0, 300)
SHAPES = {"wave": np.sin(9.0 * X), "ramp": X - 0.5, "ripple": np.sin(40.0 * X), "bowl": (X - 0.4) ** 2}


class Shapes(Case):
    """Sums of shapes of the ``known`` kinds in three conditions, under noise of 0.1."""

    def __init__(self, known, component="", **true):
        rng = np.random.default_rng(11)
        data = [sum(a * SHAPES[n] for n, a in true.items()) + 0.1 * rng.normal(size=X.size) for _ in range(3)]
        self.observations = tuple(Observation(f"o{k}", f"day {k}", d, np.full(X.size, 0.1)) for k, d in enumerate(data))
        self.candidates = tuple(
            Candidate.of(n, AMOUNT, lambda p, n=n: (n, p["amount"]), ((0.5,),), {"shape": n}, component=component)
            for n in known
        )

    def predict(self, values, terms, observations):
        return [sum((a * SHAPES[n] for n, a in terms), np.zeros(X.size)) for _ in observations]


def test_two_effects_that_are_insufficient_alone_are_both_named():
    """The larger one alone leaves twenty times the control level. Both sizes are the true ones."""
    found = diagnose(Shapes(("wave", "ramp", "bowl"), wave=1.2, ripple=0.0, ramp=2.5))
    assert found.names == ("ramp", "wave") or found.names == ("wave", "ramp")
    for candidate, size in zip(found.fit.candidates, found.fit.psi):
        assert size == pytest.approx({"wave": 1.2, "ramp": 2.5}[candidate.family], abs=0.06)  # four standard errors
    assert all(v.answer == "named" for v in found.verdicts)


def test_two_effects_of_one_part_do_not_confirm_one_another():
    """The same with effects on one part: two of them fit nearly any shape, so the answer is unknown."""
    found = diagnose(Shapes(("wave", "ramp", "bowl"), component="spring", wave=1.2, ramp=2.5))
    assert found.verdict.answer == "unknown" and not found.names


def test_with_an_effect_outside_the_library_the_first_name_is_rejected_as_well():
    """The residual beside the best shape is a ripple, which no candidate describes."""
    found = diagnose(Shapes(("wave", "ramp", "bowl"), ripple=1.5, ramp=2.5))
    assert found.verdict.answer == "unknown" and not found.names
    assert found.fit is found.base


def test_a_second_effect_without_a_name_is_reported_beside_the_first():
    """A ripple that no candidate describes does not affect the ramp, but the ramp does not explain everything."""
    found = diagnose(Shapes(("wave", "ramp"), ramp=2.5, ripple=0.12))
    assert found.names == ("ramp",) and found.verdict.grade == "B"
    expected = "a second effect without a name remains, or ramp is only similar to the true effect: "
    assert found.verdict.reason.startswith(expected)
    assert diagnose(Shapes(("wave", "ramp"), ramp=2.5)).verdict.reason == ""


class LocatedShapes(Shapes):
    """A ripple of any amplitude is a fault of channel A8, a bowl one of channel A9; neither is a candidate."""

    def residual_spaces(self, fit):
        columns = np.stack([SHAPES["ripple"], SHAPES["bowl"]], axis=1)
        levels = {("sensor", name): np.eye(2)[:, [k]] for k, name in enumerate(("A8", "A9"))}
        return [ResidualSpace((o.name,), columns, levels) for o in self.observations]


def test_the_sentence_on_a_second_effect_without_a_name_states_its_location():
    found = diagnose(LocatedShapes(("wave", "ramp"), ramp=2.5, ripple=0.12))
    assert found.names == ("ramp",)
    assert found.verdict.reason.startswith("a second effect without a name remains in channel A8: ")


def test_the_grade_of_a_name_follows_from_the_residual_of_the_last_fit():
    """The ramp alone leaves twice the control level; with the wave the residual is at the control level."""
    found = diagnose(Shapes(("wave", "ramp"), ramp=2.5, wave=0.2))
    assert [(v.names, v.grade) for v in found.verdicts] == [(("ramp",), "A"), (("wave",), "A")]
    assert found.probability == min(v.probability for v in found.verdicts)


def test_two_effects_with_equal_gains_are_both_named_and_no_choice():
    """A wave and a ripple of one size gain 80 nats each, within the margin of one another, and explain
    different things."""
    found = diagnose(Shapes(("wave", "ripple"), wave=0.06, ripple=0.06))
    assert [v.answer for v in found.verdicts] == ["named", "named"] and set(found.names) == {"wave", "ripple"}
    gains = [s.gain for s in found.verdicts[0].scores]
    assert gains[0] > 50.0 and len(gains) == 1  # the other is no rival of it


def test_two_shapes_of_one_effect_are_a_choice(monkeypatch):
    """Beside the wave the same wave with a shift of 0.01 has no residual to explain."""
    monkeypatch.setitem(SHAPES, "twin", np.sin(9.0 * X + 0.01))
    found = diagnose(Shapes(("wave", "twin"), wave=0.08))
    assert (
        found.verdict.answer == "a_or_b" and set(found.verdict.names) == {"wave", "twin"} and len(found.verdicts) == 1
    )


@pytest.mark.parametrize("wave, ramp", [(1.2, 0.8), (0.12, 2.5)])
def test_an_effect_beside_two_forms_of_another_is_found(monkeypatch, wave, ramp):
    """No data distinguish a wave from the same wave with a shift of 0.01, two effects of one spring. The ramp is
    another effect and is named, whether it is found after or before that choice."""
    monkeypatch.setitem(SHAPES, "twin", np.sin(9.0 * X + 0.01))
    case = Shapes(("wave", "twin"), component="spring", wave=wave, ramp=ramp)
    case.candidates += Shapes(("ramp",)).candidates
    found = diagnose(case)
    names_by_answer = {v.answer: set(v.names) for v in found.verdicts}
    assert names_by_answer == {"a_or_b": {"wave", "twin"}, "named": {"ramp"}}
    sizes = dict(zip((c.family for c in found.fit.candidates), found.fit.psi))
    assert sizes["ramp"] == pytest.approx(ramp, abs=0.06)  # three standard errors or more


class Trains(Shapes):
    """Two trains with a wave each, of twenty times the noise; ``told``: whether candidates name their train."""

    def __init__(self, has_trains):
        super().__init__(())
        rng, self.of = np.random.default_rng(12), {"o0": "a", "o1": "b", "o2": "a", "o3": "b"}
        self.observations = tuple(
            Observation(name, f"day {name}", 2.0 * SHAPES["wave"] + 0.1 * rng.normal(size=X.size), 0.1)
            for name in self.of
        )
        self.candidates = tuple(
            Candidate.of(
                "wave", AMOUNT, lambda p, t=t: (t, p["amount"]), ((0.5,),), {"train" if has_trains else "part": t}
            )
            for t in "ab"
        )

    def predict(self, values, terms, observations):
        return [sum(a * SHAPES["wave"] for t, a in terms if t == self.of[o.name]) + 0.0 * X for o in observations]


@pytest.mark.parametrize("has_trains, names", [(True, ("wave", "wave")), (False, ())])
def test_wheels_of_two_trains_confirm_one_another(has_trains, names):
    """No recording shows both. Two of one kind that may act on the same recordings do not confirm each other."""
    found = diagnose(Trains(has_trains))
    assert found.names == names
    if has_trains:
        assert {c.where["train"] for c in found.fit.candidates} == {"a", "b"}


def score_of_candidate(candidate, values, errors, nats=100.0):
    """Score of so many ``nats`` with these parameters."""
    fit = SimpleNamespace(psi=np.array(values), psi_se=np.array(errors), part=lambda _: slice(0, len(values)))
    return Score(candidate, nats, 0.0, 1.0, fit)


FACTOR = (Parameter("factor", "-", 1.0, (0.05, 20.0), "share of stiffness", "made up 2026"),)
GAP = (
    Parameter("gap", "m", 0.0, (0.0, 5e-3), "clearance", "made up 2026"),
    Parameter("seated", "-", 0.0, (0.0, 0.95), "share that bears", "made up 2026"),
)


@pytest.mark.parametrize(
    "seated, nats, names",
    [
        (0.33, 93.9, ("local_ballast",)),
        (
            0.33,
            94.1,
            ("local_ballast", "hanging_sleeper"),
        ),  # the lead is the penalty of the further parameter of the gap
        (0.33, 102.0, ("hanging_sleeper", "local_ballast")),
        (0.75, 94.1, ("local_ballast", "hanging_sleeper")),  # seated on more than the ballast carries: another effect
        (0.33, 107.0, ("hanging_sleeper",)),
    ],
)
def test_a_gap_and_softer_ballast_of_equal_probability_are_a_choice(seated, nats, names):
    """A third of the ballast bears, and no train closes the gap: the same response as ballast of a third."""
    here = {"sleeper": 7, "place": 4.2}
    ballast = Candidate.of("local_ballast", FACTOR, lambda p: p, ((0.4,),), here)
    gap = Candidate.of("hanging_sleeper", GAP, lambda p: p, ((1e-3, 0.0),), here, simpler_form=("local_ballast", 1))
    scores = [score_of_candidate(gap, [3e-3, seated], [1e-3, 0.03], nats), score_of_candidate(ballast, [0.35], [0.04])]
    verdict = judge(scores, 2.0, MismatchSettings())
    assert verdict.names == names
    assert verdict.scores[0].family == names[0]  # whose fit and position are stated


def test_the_size_of_an_effect_with_two_amplitudes_is_that_of_both():
    """0.3 and 0.4 are half a metre per second squared."""
    pair = (AMOUNT[0], Parameter("cosine", "-", 0.0, (-9.0, 9.0), "the other part", "made up 2026"))
    hum = Candidate.of(
        "hum", pair, lambda p: p, ((1.0, 0.0),), {"sensor": "A"}, smallest_reportable=0.49, n_size_parameters=2
    )
    assert score_of_candidate(hum, [0.3, 0.4], [0.01, 0.01]).is_reportable
    assert not score_of_candidate(hum, [0.3, 0.38], [0.01, 0.01]).is_reportable


@pytest.mark.parametrize("error, is_reportable", [(1.0, True), (4.0, False)])
def test_a_mass_that_may_be_negligible_is_not_named(error, is_reportable):
    """8 kg, with a smallest reported mass of 5 kg: certain by three standard errors, or uncertain."""
    mass = (Parameter("mass", "kg", 0.0, (0.0, 200.0), "what hangs there", "made up 2026"),)
    hung = Candidate.of(
        "attached_resonator",
        mass,
        lambda p: p,
        ((15.0,),),
        {"place": 7.2},
        smallest_reportable=5.0,
        min_significance=1.0,
    )
    assert score_of_candidate(hung, [8.0], [error]).is_reportable == is_reportable


@pytest.mark.parametrize("whole, share", [(False, 1.0 / 3.0), (True, 1.0)])
def test_the_predicted_gain_of_a_start_is_that_along_its_direction(whole, share):
    """The data need a third of the start; half of the cost falls by 2 s q - s² q with q its size and s the share."""
    case = Shapes(("wave",), wave=1.0)
    projector = Projector(case, fit_jointly(case))
    candidate = Candidate.of("wave", AMOUNT, lambda p: p, ((3.0,),), nonlinear_in_size=whole)
    gain, found = projector.score([3.0 * SHAPES["wave"]] * 3, candidate, 0)
    assert found == pytest.approx(share, rel=0.02)
    assert (gain < 0.0) == whole


def test_columns_are_scored_together_as_alone():
    """More columns than one block holds, among them a zero, a whitened and a missing column. The gain is that of the
    joint problem of nuisances and size."""
    case = Shapes(("wave",), wave=1.0)
    fit = fit_jointly(case)
    projector = Projector(case, fit)
    candidate = Candidate.of("wave", AMOUNT, lambda p: p, ((3.0,),))
    rng = np.random.default_rng(1)
    columns = [[rng.normal(size=SHAPES["wave"].size) for _ in range(3)] for _ in range(70)]
    columns[0] = [3.0 * SHAPES["wave"]] * 3
    columns[5], columns[6] = None, [0.0 * c for c in columns[6]]
    columns[7] = [Whitened(o.whiten(c)) for o, c in zip(case.observations, columns[7])]
    together = projector.scores(columns, [candidate] * 70, [0] * 70)
    assert together[5] == together[6] == (0.0, 1.0)
    for column, found in zip(columns, together):
        assert projector.score(column, candidate, 0) == pytest.approx(found, rel=1e-9)
    weights = [np.sqrt(o.effective / fit.scale[o.data_type]) for o in case.observations]
    white = np.concatenate([w * o.whiten(c) for w, o, c in zip(weights, case.observations, columns[0])])
    rows = np.column_stack([projector.scaled, white])
    normal = rows.T @ rows + np.diag([1.0] * projector.scaled.shape[1] + [0.0])
    right = rows.T @ projector.right + np.append(projector.pull, 0.0)
    size = np.linalg.solve(normal, right)
    without = np.linalg.solve(normal[:-1, :-1], right[:-1])
    assert together[0] == pytest.approx((right @ size - right[:-1] @ without, size[-1]), rel=1e-6)


def test_a_masking_parameter_is_reset_with_its_effect_also_without_information_on_it():
    """There is no information on seat_A2 either, and it has no entry."""
    case = SimpleNamespace(nuisances=[Nuisance(n, "-", 0.0, 0.1) for n in ("seat_A1", "gain_A1", "seat_A2")])
    values = {"seat_A1": 0.0, "gain_A1": 0.03, "seat_A2": 0.0}
    fit = SimpleNamespace(covariance=np.diag([1e-2, 1e-4, 1e-2]), values=values)
    moved = SimpleNamespace(site=EffectSite(masking_parameter="seat_A1"))
    assert informed_values(case, fit, moved) == {"seat_A1": 0.0, "gain_A1": 0.03}


@pytest.mark.parametrize("error, names", [(3e-3, ("hanging_sleeper", "local_ballast")), (1e-4, ("hanging_sleeper",))])
def test_a_gap_that_no_train_closes_may_be_missing_ballast(error, names):
    """2.5 ± 3 mm has no upper bound: the sleeper never touched the ballast, which may be missing."""
    here, settings = {"sleeper": 7, "place": 4.2}, MismatchSettings()
    gap = Candidate.of("hanging_sleeper", GAP, lambda p: p, ((1e-3, 0.0),), here, unbounded_form="local_ballast")
    alone = judge([score_of_candidate(gap, [2.5e-3, 0.04], [error, 0.01])], 2.0, settings)
    verdict, _, _ = grade_name(alone, alone.scores[0].fit, 0.9, settings)
    assert verdict.names == names and verdict.answer == ("named" if len(names) == 1 else "a_or_b")
    assert bool(verdict.grade) == (len(names) == 1) and verdict.probability > 0.9


@pytest.mark.parametrize("error, answer", [(3e-3, "a_or_b"), (1e-4, "named")])
def test_a_second_gap_that_no_train_closes_may_be_missing_ballast_too(error, answer):
    """Its size is certain when it is named, and uncertain in the fit with both."""
    settings = MismatchSettings()
    gap = Candidate.of(
        "hanging_sleeper", GAP, lambda p: p, ((1e-3, 0.0),), {"place": 4.2}, unbounded_form="local_ballast"
    )
    second = judge([score_of_candidate(gap, [2.5e-3, 0.04], [1e-4, 0.01])], 2.0, settings)
    both = SimpleNamespace(
        psi=np.array([0.3, 2.5e-3, 0.04]), psi_se=np.array([0.02, error, 0.01]), part=lambda _: slice(1, 3),
        level={"passage": 0.8}, white=[],
    )  # fmt: skip
    case = SimpleNamespace(
        control_level={"passage": 0.7}, cell_level={}, observations=(), free_laws=(), candidates=(), nuisances=()
    )
    (stated,) = grade_names(Findings(Search(case), both, both, (second,))).verdicts
    assert (stated.answer, stated.grade) == (answer, "B" if answer == "named" else "")


def test_a_second_effect_of_a_kind_two_bays_away_is_an_error_of_shape_of_the_first():
    def at(family, place):
        return Candidate.of(family, FACTOR, lambda p: p, ((0.4,),), {"place": place})

    first = at("local_ballast", 4.2)
    assert is_same_site(at("local_ballast", 5.4), first) and not is_same_site(at("local_pad", 5.4), first)
    assert not is_same_site(at("local_ballast", 6.0), first) and is_same_site(at("local_pad", 4.8), first)


@pytest.mark.parametrize("known, offered, same", [
    ({"train": "a"}, {"train": "a", "axle": 2}, False),  # heavy wheels, and a wheel flat
    ({"train": "a", "axle": 1}, {"train": "a", "axle": 2}, True),  # two flats
])  # fmt: skip
def test_a_wheel_flat_with_impacts_is_no_error_of_shape_of_heavy_wheels(known, offered, same):
    """A wheel has a flat and all wheels of its train are heavy: two effects. An out-of-round wheel has no impacts that
    identify it, and may be an error of the shape of heavy wheels."""

    def of(where, sounding):
        return Candidate.of(
            "flat" if "axle" in where else "mass", AMOUNT, tuple, ((0.5,),), where, evidence_suffices=sounding
        )

    first, second = of(known, "axle" in known), of(offered, True)
    assert is_same_site(second, first) == is_same_site(first, second) == same
    assert is_same_site(of(offered, False), first) and is_same_site(first, of(offered, False))


@pytest.mark.parametrize("left, answer", [(50.0, "named"), (5.0, "a_or_b")])
def test_an_effect_that_keeps_its_gain_beside_the_leader_is_no_rival(left, answer):
    """Wave and ripple are both in the data. The ramp alone gains as much as each. Beside the wave it gains 50 nats, and
    is a rival of the ripple alone, or nothing, and is a rival of the wave."""
    case = Shapes(("wave", "ripple", "ramp"), wave=0.06, ripple=0.06)
    fits = [fit_jointly(case, (c,), [0.06], iterations=20) for c in case.candidates]
    scores = tuple(Score(c, g, 0.0, 1.0, f) for c, g, f in zip(case.candidates, (60.0, 59.0, 58.0), fits))
    torn = judge(list(scores), 0.9, MismatchSettings())
    assert torn.names == ("wave", "ripple")
    on_top = tuple(Score(c, g, 0.0, 1.0, f) for c, g, f in zip(case.candidates[1:], (59.0, left), fits[1:]))
    second = Verdict("named", ("ripple",), "A", 0.97, {}, on_top)
    base = fit_jointly(case)
    choice = Findings(Search(case), base, fits[0], (torn,))
    found, stands = add_second(replace(choice, choice=choice), second, on_top[0])
    assert found.verdicts[0].answer == answer and found.verdicts[0].names[0] == "wave"
    assert stands is (answer == "named") and len(found.verdicts) == 1 + stands


@pytest.mark.parametrize("promised, scouted, required", [(7.0, 7.0, 6.0), (7.0, 5.0, 12.0)])
def test_a_second_effect_with_half_of_the_threshold_in_impacts_alone_is_refitted(promised, scouted, required):
    """Trains add evidence: a soft rail of 12 nats in impacts had 20 in total. The predicted gain of a column is that of
    all recordings and has to reach the threshold; a first effect is refitted from 2 nats on."""
    settings, candidate = MismatchSettings(), Candidate.of("soft_rail", AMOUNT, tuple, ((0.5,),))
    entry, beside = Entry(promised, candidate, np.array([0.5]), {}), SimpleNamespace(candidates=("pad",))
    assert required_promise(entry, beside, {candidate.key: scouted}, settings) == required
    assert required_promise(entry, SimpleNamespace(candidates=()), {candidate.key: scouted}, settings) == 2.0


def test_the_evidence_of_a_row_has_an_entry_for_each_verdict():
    rows = (("a", 0.97, "x"), ("b", 0.7, "y"))
    first, second = (Verdict("named", (n,), "A", p, reason=r) for n, p, r in rows)
    lacking = SimpleNamespace(effect="c", words="what c changes", lack="passages", measurement="passages")
    case = SimpleNamespace(unmet_requirements=(lacking,))
    evidence = _evidence(SimpleNamespace(verdicts=(first, second), frames=()), case)
    assert [u["effect"] for u in evidence["not_examined"]] == ["c"]
    assert (evidence["term"], evidence["probability"], evidence["reason"]) == ("a", 0.97, "x")
    assert [(e["term"], e["probability"], e["reason"]) for e in evidence["beside"]] == [("b", 0.7, "y")]


def test_a_first_name_without_a_gain_beside_the_second_is_withdrawn():
    """Only a ramp is in the recordings. A bowl that was named before it, and is half a ramp, has no gain beside it. If
    both are in the recordings, both stay."""
    for true, left in (({"ramp": 2.5}, ("ramp",)), ({"ramp": 2.5, "bowl": 2.5}, ("bowl", "ramp"))):
        case = Shapes(("ramp", "bowl"), **true)
        pair = case.candidates[::-1]
        first, fit = (fit_jointly(case, pair[:n], [0.1] * n, iterations=20) for n in (1, 2))
        scores = [Score(c, 50.0, 0.0, 1.0, f) for c, f in zip(pair, (first, fit))]
        verdicts = [Verdict("named", (s.family,), "A", 0.97, {}, (s,)) for s in scores]
        found = settle_pair(Findings(Search(case), fit_jointly(case), fit, tuple(verdicts)))
        assert tuple(v.names[0] for v in found.verdicts) == left == tuple(c.family for c in found.fit.candidates)
    assert found.fit.psi == pytest.approx([2.5, 2.5], abs=0.15)


@pytest.mark.parametrize("ripple, answer", [(0.0, "named"), (3.0, "unknown")])
def test_a_second_name_that_remains_alone_has_to_explain_the_residual(ripple, answer):
    """Beside a bowl that was named first it had not to: the ripple could have been an error of the shape of the
    bowl."""
    case = Shapes(("ramp", "bowl"), ramp=2.5, ripple=ripple)
    pair = case.candidates[::-1]
    fit = fit_jointly(case, pair, [0.1, 0.1], iterations=20)
    verdicts = [
        Verdict("named", (c.family,), "A", 0.97, {}, (Score(c, 50.0, 0.0, 0.1, fit, unmasked_gain=40.0),)) for c in pair
    ]
    verdicts = tuple(replace(v, posterior={v.names[0]: 0.9, "unknown": 0.1}) for v in verdicts)
    found = settle_pair(Findings(Search(case), fit_jointly(case), fit, verdicts))
    assert [v.answer for v in found.verdicts] == [answer]
    assert len(found.fit.candidates) == (answer == "named")


@pytest.mark.parametrize("reserved, left", [(0.0, ("ramp",)), (0.55, ("ramp", "bowl")), (1.0, ("ramp", "bowl"))])
def test_a_second_name_that_reserved_recordings_contradict_is_withdrawn(reserved, left):
    """A bowl of 1.0 is in all fitted recordings. If it is not in the reserved recording, the pair loses there as much
    as it gains elsewhere; with a share of 0.55 it gains a little there, and stays."""
    case = Shapes(("ramp", "bowl"), ramp=2.5, bowl=1.0)
    kept = 2.5 * SHAPES["ramp"] + reserved * SHAPES["bowl"] + 0.1 * np.random.default_rng(6).normal(size=X.size)
    case.reserved = (Observation("kept", "day 9", kept, np.full(X.size, 0.1)),)
    alone = fit_jointly(case, case.candidates[:1], [0.1], iterations=20)
    fit = fit_jointly(case, case.candidates, [0.1, 0.1], iterations=20)
    scores = [Score(c, 50.0, 0.0, 1.0, f) for c, f in zip(case.candidates, (alone, fit))]
    verdicts = tuple(Verdict("named", (s.family,), "A", 0.97, {}, (s,)) for s in scores)
    found = settle_pair(Findings(Search(case), fit_jointly(case), fit, verdicts))
    assert tuple(v.names[0] for v in found.verdicts) == left == tuple(c.family for c in found.fit.candidates)
    assert ("bowl" in found.verdicts[0].reason) is (len(left) == 1)


@pytest.mark.parametrize("last, grade, n_named", [("ramp", "A", 2), ("ramp", "B", 1), ("", "B", 2)])
def test_an_effect_that_has_to_explain_everything_has_no_name_if_an_excess_remains(last, grade, n_named):
    """A drifting clock can imitate many other effects in its channel: as first or second name it has to explain all."""
    rules = {name: NamingRules(must_reach_control_level=name == last) for name in ("bowl", "ramp")}
    pair = [replace(c, naming=rules[c.family]) for c in Shapes(("bowl", "ramp")).candidates]
    posterior = {"bowl": 0.9, "ramp": 0.05, "unknown": 0.05}
    case = SimpleNamespace(
        control_level={"passage": 0.7}, cell_level={}, observations=(), free_laws=(), candidates=(), nuisances=()
    )
    base, fit = (SimpleNamespace(level={"passage": 0.6 if grade == "A" else 0.8}, white=[]) for _ in range(2))
    verdicts = tuple(
        Verdict("named", (c.family,), "", 0.97, dict(posterior), (Score(c, 50.0, 0.0, 1.0, fit),)) for c in pair
    )
    found = grade_names(Findings(Search(case), base, fit, verdicts))
    assert [v.grade for v in found.verdicts] == ([grade, grade] if n_named == 2 else [""])
    assert found.fit is (fit if n_named == 2 else base)
    first = found.verdicts[0]
    assert n_named == 2 or (first.answer == "unknown" and "ramp can imitate many other effects" in first.reason)
    assert n_named == 2 or "must_reach_control_level" in first.trail


@pytest.mark.parametrize("ripple, answer", [(0.0, "named"), (0.12, "unknown")])
def test_a_diagnosis_withdraws_an_effect_that_has_to_explain_everything_and_does_not(ripple, answer):
    """The ramp is in the data. With a ripple that no candidate describes its grade is B, which this effect must not
    have."""
    case = Shapes(("wave", "ramp"), ramp=2.5, ripple=ripple)
    rules = NamingRules(must_reach_control_level=True)
    case.candidates = tuple(replace(c, naming=rules) for c in case.candidates)
    found = diagnose(case)
    assert found.verdict.answer == answer
    assert bool(found.fit.candidates) == (answer == "named")


class OneDayOfRipple(Shapes):
    """The same with a ripple on the first day alone, which no effect describes."""

    def __init__(self, known, component="", **true):
        super().__init__(known, component, **true)
        first, *others = self.observations
        self.observations = (replace(first, data=first.data + 0.2 * SHAPES["ripple"]), *others)


def test_an_effect_that_would_have_a_name_is_named_beside_a_leader_that_gets_none():
    """The ripple leads by 23 nats, and the other days contradict it. The wave is in all recordings."""
    found = diagnose(OneDayOfRipple(("wave", "ripple"), wave=0.06))
    assert [(v.answer, v.names) for v in found.verdicts] == [("named", ("wave",))]
    assert found.verdict.reason.startswith("a second effect without a name remains: with ripple, ")
    assert found.fit.psi == pytest.approx([0.06], abs=0.02)  # four standard errors
    assert "second_passes_without_first" in found.verdict.trail


def test_an_effect_is_not_named_beside_a_rejected_leader_of_the_same_part():
    """One of them may stand for an error in the shape of the other."""
    found = diagnose(OneDayOfRipple(("wave", "ripple"), "spring", wave=0.06))
    assert (found.verdict.answer, found.verdict.names) == ("unknown", ())
