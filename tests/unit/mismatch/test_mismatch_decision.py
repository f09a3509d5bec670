"""The decision as tables: every rule has a reason and a page, can apply, and is in the trail of its verdict."""

import ast
import re
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine import decision
from turnout.mismatch.engine.ambiguity import Ambiguity
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.decision import EFFECT_RULES, NAME_RULES, RULES, grade_name, judge
from turnout.mismatch.engine.decision_facts import (
    EffectEvidence,
    NameEvidence,
    NumericalError,
    ReservedEvidence,
    ToleratedEvidence,
    UnprovenEvidence,
)
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.score import Score
from turnout.mismatch.engine.search_limit import SearchLimit
from turnout.mismatch.engine.strained_values import StrainedValue
from turnout.mismatch.engine.thresholds import THRESHOLDS, threshold_rows
from turnout.mismatch.engine.two_effects import PairEvidence
from turnout.mismatch.engine.verdict import ANSWERS, Verdict
from turnout.mismatch.engine.verification import Verification
from turnout.mismatch.turnout.planned_case import PlannedCase, small_plan
from turnout.physics import MountResonance, Parameter

TABLES = (
    "NUMERICS_RULES",
    "EFFECT_RULES",
    "SECOND_RULES",
    "PAIR_RULES",
    "NAME_RULES",
    "TOLERATED_RULES",
    "LIMIT_RULES",
    "UNPROVEN_RULES",
    "RESERVED_RULES",
)
SIZE = (Parameter("size", "-", 0.0, (0.0, 9.0), "of a shape", "made up 2026"),)


def score(family="soft", gain=40.0, worst=0.0, explained=1.0, size=1.0, **more):
    where = more.pop("where", {"place": 3.0})
    candidate = Candidate.of(family, SIZE, dict, ((1.0,),), where, **more.pop("flags", {}))
    fit = SimpleNamespace(psi=np.array([size]), psi_se=np.array([more.pop("error", 0.1)]), part=lambda _: slice(0, 1))
    return Score(candidate, gain, worst, explained, fit, **more)


LAG = {"where": {"sensor": "A2"}, "flags": {"general_form": "time_offset"}}


@pytest.mark.parametrize(
    ("general", "special", "names", "words"),
    [
        (40.0, 38.0, ("time_offset",), "one type alone"),
        (38.0, 40.0, ("time_offset",), "one type alone"),  # the passages cannot tell that the lag is not in them
        (33.0, 40.0, ("hammer_delay",), ""),
        (40.0, 33.0, ("time_offset",), ""),
    ],
)
def test_a_fault_is_of_one_type_of_recordings_only_by_a_margin(general, special, names, words):
    lags = [score("time_offset", general, where=LAG["where"]), score("hammer_delay", special, **LAG)]
    verdict = judge(lags, 2.0, MismatchSettings())
    assert (verdict.answer, verdict.names) == ("named", names) and words in verdict.reason
    assert verdict.probability > 0.9  # both are the same fault


def test_candidates_of_a_case_know_their_general_form_if_it_is_in_the_library():
    with_both = PlannedCase(small_plan(), families=("sensor_gain", "hammer_gain")).candidates
    assert {(c.family, c.effect.general_form) for c in with_both} == {
        ("sensor_gain", ""),
        ("hammer_gain", "sensor_gain"),
    }
    alone = PlannedCase(small_plan(), families=("hammer_gain",)).candidates
    assert {(c.family, c.effect.general_form) for c in alone} == {("hammer_gain", "")}


def test_lags_of_two_channels_stay_a_choice():
    there = {**LAG, "where": {"sensor": "A3"}}
    verdict = judge(
        [score("time_offset", 40.0, where=LAG["where"]), score("hammer_delay", 38.0, **there)], 2.0, MismatchSettings()
    )
    assert verdict.answer == "a_or_b"


@pytest.mark.parametrize(("quality", "has_meaning"), [(1.5, False), (1.51, True), (12.0, True), (80.0, False)])
def test_a_resonance_at_the_end_of_its_range_of_quality_is_another_effect(quality, has_meaning):
    """A low-pass of 500 Hz in one channel was a loose mounting of quality 1.5. A period of 0 stays possible."""
    candidate = Candidate.of("mount_resonance", MountResonance.parameters, dict, ((0.002, 5.0),), {"sensor": "A2"})
    fit = SimpleNamespace(psi=np.array([0.0, quality]), psi_se=np.array([6e-4, 0.08]), part=lambda _: slice(0, 2))
    assert Score(candidate, 40.0, 0.0, 1.0, fit).has_meaning is has_meaning


def test_every_rule_has_a_unique_name_and_an_existing_page(repository):
    names = [rule.name for rule in RULES]
    assert len(names) == len(set(names)) and all(re.fullmatch(r"[a-z_]+", name) for name in names)
    assert all((repository / "docs" / rule.page).is_file() for rule in RULES)
    assert RULES == tuple(rule for table in TABLES for rule in getattr(decision, table))


@pytest.mark.parametrize("table", TABLES)
def test_only_the_last_rule_of_a_table_applies_to_all_cases(table):
    rules = getattr(decision, table)
    assert rules[-1].applies(None)
    for rule in rules[:-1]:
        with pytest.raises(AttributeError):
            rule.applies(None)


def line_of(nats):
    return Ambiguity(nats, "a level is high", "passages at another speed", "wavelength", "0.15 m", 2.0, 6.0)


CASES = {
    "explains_too_little": ([score(explained=0.4)], 2.0, {}),
    "leaves_too_much": ([score()], 2.0, {"residual_excess": 4.1}),
    "excess_without_candidate": ([score(gain=11.0)], 1.1, {}),
    "sensors_shake_without_wheel": ([], 0.9, {"disturbed": True, "mismatched_trains": ("ic3",)}),
    "train_unlike_its_file": ([], 0.9, {"mismatched_trains": ("ic3",)}),
    "no_train_matches": ([], 0.9, {"no_train_matches": True, "strained": "mass of the rail"}),
    "no_tolerance_explains_it": ([], 0.9, {"strained": "mass of the rail"}),
    "component_differs_under_trains": ([score(gain=11.0)], 0.9, {"local_change": 12.1}),
    "component_unlike_its_kind": ([score(gain=11.0)], 0.9, {"local_deviation": 12.1}),
    "recordings_cannot_decide": ([score(gain=11.0)], 0.9, {"ambiguity": line_of(12.1)}),
    "no_candidate_passes": ([], 0.9, {"local_change": 11.9, "local_deviation": 11.9, "ambiguity": line_of(11.9)}),
    "weak_and_contradicted": ([score(gain=23.0)], 0.9, {"consistent": False}),
    "reserved_not_predicted": ([score(gain=25.0)], 0.9, {"consistent": False}),
    "residual_has_structure": ([score()], 2.0, {"structure": 0.5, "residual_excess": 1.5}),
    "leaves_force_at_its_position": ([score(gain=35.0)], 0.9, {"left_at_position": 41.0}),
    "value_without_meaning": ([score(size=-0.0034)], 2.0, {}),
    "single_source": ([score(single_source="day 2")], 2.0, {}),
    "condition_contradicts": ([score(worst=-9.0)], 2.0, {}),
    "size_at_limit": ([score(size=0.05, flags={"limit_form": "gap"}), score("gap", 20.0)], 2.0, {}),
    "rival_within_margin": ([score(), score("gap", 35.0)], 2.0, {}),
    "exempt_from_explaining": (
        [score(explained=0.1, flags={"external_evidence": 38.0, "evidence_suffices": True})],
        2.0,
        {},
    ),
    "may_be_in_one_type_of_recordings": ([score(), score("gap", 36.0, flags={"general_form": "soft"})], 2.0, {}),
    "passes": ([score(), score("gap", 33.0)], 2.0, {"local_change": 90.0, "local_deviation": 90.0}),
}


@pytest.mark.parametrize("name", [rule.name for rule in EFFECT_RULES])
def test_each_rule_on_an_effect_applies_to_a_case_of_its_own(name):
    scores, excess, facts = CASES[name]
    verdict = judge(scores, excess, MismatchSettings(), **facts)
    (rule,) = (r for r in EFFECT_RULES if r.name == name)
    assert verdict.trail == (name,) and verdict.answer == rule.answer in ANSWERS and verdict.cause == rule.cause
    assert "{" not in verdict.reason and bool(verdict.reason) == bool(rule.reason)


@pytest.mark.parametrize(
    ("gain", "left", "answer"), [(35.0, 39.0, "named"), (45.0, 44.0, "named"), (45.0, 46.0, "unknown")]
)
def test_a_name_explains_more_than_it_leaves_at_its_position_or_leaves_no_more_than_intact_turnouts(gain, left, answer):
    assert judge([score(gain=gain)], 0.9, MismatchSettings(), left_at_position=left).answer == answer


def test_the_reason_states_the_figures_of_the_case():
    verdict = judge([score(explained=0.4)], 2.0, MismatchSettings())
    assert verdict.reason == (
        "the best candidate effect explains only 40 % of the residual in excess of the intact state"
    )
    assert "explains only 0 % of" in judge([score(explained=-0.001)], 2.0, MismatchSettings()).reason  # not -0 %
    verdict = judge([score(worst=-9.0)], 2.0, MismatchSettings())
    assert verdict.reason == (
        "with soft at 3.0 m, recordings of one condition are predicted worse than without it "
        "(evidence against it: 9.0 nats, odds of 8,100 to 1)"
    )


@pytest.mark.parametrize(
    "name, excess, more, facts",
    [
        ("strained_value_remains", 0.9, {}, {"strained": "mass of the rail"}),
        ("local_change_remains", 0.9, {"where": {}}, {"local_change": 12.1}),
        ("reaches_control_level", 0.9, {"where": {}}, {"local_change": 11.9}),
        ("reaches_control_level", 0.9, {}, {"local_change": 90.0}),
        ("size_known_from_below", 0.9, {"error": 0.6, "flags": {"unbounded_form": "gap"}}, {}),
        ("reaches_control_level", 1.0, {"flags": {"must_reach_control_level": True}}, {}),
        ("must_reach_control_level", 1.1, {"flags": {"must_reach_control_level": True}}, {}),
        ("leaves_some_residual", 1.1, {}, {}),
    ],
)
def test_each_rule_on_a_name_applies_to_a_case_of_its_own(name, excess, more, facts):
    settings = MismatchSettings()
    named = judge([score(**more)], 2.0, settings)
    verdict, rule, reason = grade_name(named, named.scores[0].fit, excess, settings, **facts)
    assert rule.name == name == verdict.trail[-1] and rule in NAME_RULES
    assert verdict.answer == ("a_or_b" if name == "size_known_from_below" else "named")
    assert verdict.grade == {"size_known_from_below": "", "reaches_control_level": "A"}.get(name, "B")
    assert ("gap" in verdict.names) is (name == "size_known_from_below") and "{" not in reason


def evidence_with_names_of_two_words():
    """Evidence of every table, with effects and values whose names have an underscore."""
    soft = score("soft_pad", single_source="day 2", flags={"external_evidence": 38.0, "evidence_suffices": True})
    gap = score("slide_chair_gap", 38.0, where={})
    strained = str(StrainedValue(Nuisance("rail_mass", "-", 0.0, 1.0), 5.0, 20.0))
    settings, case = MismatchSettings(), {"strained": strained, "local_change": 20.0}
    effect = EffectEvidence([soft, gap], 2.0, settings, mismatched_trains=("ic3",), ambiguity=line_of(12.1), **case)
    named = Verdict("named", ("soft_pad",), scores=(soft, gap))
    choice = Verdict("a_or_b", ("soft_pad", "slide_chair_gap"), scores=(soft, gap))
    pair = PairEvidence(SimpleNamespace(verdicts=(named, named)))
    pair.__dict__["second_score"] = soft
    return {
        "NUMERICS_RULES": NumericalError(2.0, 3.0, 1.0, 0.1),
        "EFFECT_RULES": effect,
        "SECOND_RULES": SimpleNamespace(location="", alternative=", or soft pad is only similar", second=choice),
        "PAIR_RULES": pair,
        "NAME_RULES": NameEvidence(soft, 2.0, 0.5, **case),
        "TOLERATED_RULES": ToleratedEvidence(soft, settings),
        "LIMIT_RULES": SearchLimit(4, 3),
        "UNPROVEN_RULES": UnprovenEvidence((choice, Verdict("named", ("not_scored",))), "Not proven."),
        "RESERVED_RULES": ReservedEvidence((named,), Verification(2, 93.0, 91.0, lost_evidence=4.0), settings),
    }


@pytest.mark.parametrize("table", TABLES)
def test_reasons_are_sentences_without_internal_names(table):
    evidence = evidence_with_names_of_two_words()[table]
    for rule in getattr(decision, table):
        reason = rule.reason_for(evidence)
        assert "_" not in reason and "{" not in reason, (rule.name, reason)


def test_the_reason_of_a_slightly_worse_prediction_explains_it():
    """It states no loss of evidence, since a loss of 0 would seem to contradict the sentence."""
    (rule,) = (r for r in decision.RESERVED_RULES if r.name == "reserved_fit_falls_for_little_evidence")
    reason = rule.reason_for(evidence_with_names_of_two_words()["RESERVED_RULES"])
    assert reason.startswith("with soft pad at 3.0 m, held-out recordings are predicted slightly worse")
    assert "nats" not in reason and "grade B" in reason


def test_every_threshold_has_a_reason_and_a_source(repository):
    rows = threshold_rows()
    assert len(rows) == len({name for name, *_ in rows}) > 70
    for name, value, unit, reason, source in rows:
        assert getattr(THRESHOLDS, name) == value and unit and len(reason.split()) >= 3, name
        is_page = source.endswith(".md")
        assert not is_page or (repository / "docs" / source).is_file(), source
        assert is_page or source in ("convention", "numerical") or re.search(r"(19|20)\d\d$", source), source


def test_no_module_of_the_engine_has_thresholds_of_its_own(repository):
    """Only whole numbers up to 4, halves and guards against a division by zero or an underflow are in the code."""
    plain = {0, 1, 2, 3, 4, 0.5, 9, 10, 12, 100, 1e7}  # 9, 12: digits; 10, 100: decibels and percent; 1e7: a width
    folder = repository / "src" / "turnout" / "mismatch" / "engine"
    for path in sorted(folder.glob("*.py")):
        if path.name == "thresholds.py":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
                guard = 0.0 < abs(node.value) <= 1e-6
                assert guard or abs(node.value) in plain, f"{path.name}:{node.lineno}: {node.value}"
