"""Leave one effect out: the list covers the library, and the table counts each kind of answer correctly."""

import json

import pytest
from benchmarks import bench_leave_one_out as bench
from benchmarks.left_out_library import OWN_NAMES, WITHOUT_KIND, kinds_of_effects, library

from turnout import physics
from turnout.mismatch.turnout.planned_case import PlannedCase, small_plan
from turnout_blind.history import GROWING
from turnout_blind.score.matching import gain_of
from turnout_blind.score.names import right_names


def test_every_effect_of_the_library_has_a_kind_or_the_reason_why_it_has_none():
    tested = {effect.name for effect in physics.TERMS if effect.asked}
    with_kind = {name for name, effect in library().items() if effect.kinds}
    assert set(library()) == tested
    assert with_kind | set(WITHOUT_KIND) == tested
    assert not with_kind & set(WITHOUT_KIND)


def test_every_kind_with_a_right_name_belongs_to_that_effect():
    """Only kinds that are not identifiable have no right name."""
    for kind, effect in kinds_of_effects().items():
        for name in right_names(kind, OWN_NAMES) if effect.stratum != "unidentifiable" else ():
            assert kind in library()[name].kinds


def test_relatives_are_mutual_and_are_effects_of_one_component_or_part():
    relatives = {name: set(effect.relatives) for name, effect in library().items()}
    assert all(name in relatives[other] and name != other for name, others in relatives.items() for other in others)
    assert relatives["hanging_sleeper"] == {"local_ballast", "ballast_hardening"}
    assert relatives["wheel_flat"] == {"out_of_round"}
    assert relatives["sensor_gain"] == {"passage_gain", "hammer_gain"}
    assert relatives["local_pad"] == {"loose_fastening"}


def test_each_question_has_sites_of_every_effect_that_can_be_its_answer(monkeypatch):
    monkeypatch.setenv("TURNOUT_LEFT_OUT_SITES", "2")
    visits, changes = ({site.effect for site in bench.sites(q)} for q in ("visit", "change"))
    in_switches = {"slide_chair_gap", "heel_support", "worn_toe"}
    assert visits == set(library()) - set(WITHOUT_KIND) - in_switches
    named_changes = {"local_ballast", "hanging_sleeper", "ballast_hardening", "local_pad"}
    assert changes == named_changes | {"sensor_gain", "sensor_position", "surface_dip"}
    assert {site.kind for site in bench.sites("visit") if site.effect == "surface_dip"} == {"dip", "nose"}
    assert {site.kind for site in bench.sites("change")} <= set(GROWING)  # a history can conceal it


@pytest.mark.parametrize(
    ("families", "forms"),
    [
        (("hanging_sleeper", "local_pad"), {("", ())}),
        (("hanging_sleeper", "local_ballast"), {("local_ballast", ("local_ballast", 1)), ("", ())}),
        (None, {("local_ballast", ("local_ballast", 1)), ("", ())}),
    ],
)
def test_an_effect_that_is_left_out_is_no_form_of_another_effect(families, forms):
    """Formerly the answer to a gap with only a lower bound named soft ballast, although that was left out."""
    effects = [c.effect for c in PlannedCase(small_plan(), families=families).candidates]
    assert {(effect.unbounded_form, effect.simpler_form) for effect in effects} == forms


def row(verdict, position=None, names=(), lock=None, **where):
    first, second = (*names, None, None)[:2]
    return {
        "verdict": verdict, "term": first, "rival_term": second, "locked_to": lock, "position_m": position,
        "channel": where.get("sensor"), "parameters_json": json.dumps({"where": where}), "probability": 0.9,
    }  # fmt: skip


HANGING = {"kind": "void", "locked_to": "place", "where": {"position": 4.2}, "rung": 5, "parameters": {}}
SHEAR = {"kind": "rail_shear", "locked_to": "condition", "where": {}, "rung": 5, "parameters": {}}


@pytest.mark.parametrize(
    ("effect", "answers", "outcome"),
    [
        (HANGING, [row("none")], "none"),
        (HANGING, [row("unknown", 4.6, lock="place")], "unknown"),
        (HANGING, [row("unknown", 5.4, lock="place")], "elsewhere"),
        (HANGING, [row("unknown", lock="sensor", sensor="A2")], "elsewhere"),
        (HANGING, [row("unknown")], "elsewhere"),
        (HANGING, [row("named", 4.2, ["local_ballast"], "place")], "right"),
        (HANGING, [row("named", 5.4, ["local_ballast"], "place")], "elsewhere"),
        (HANGING, [row("named", 4.2, ["local_pad"], "place")], "other"),
        (HANGING, [row("a_or_b", 4.2, ["local_ballast", "local_pad"], "place")], "other"),
        (HANGING, [row("named", 4.2, ["local_ballast"], "place"), row("named", 4.2, ["wheel_flat"])], "other"),
        (SHEAR, [row("unknown", lock="frequency")], "unknown"),
        (SHEAR, [row("unknown", 4.2, lock="place")], "elsewhere"),
    ],
)
def test_answers_of_a_visit_without_the_effect(monkeypatch, effect, answers, outcome):
    families = []
    monkeypatch.setattr(bench, "campaigns_of", lambda folder, case: ["campaign"])
    monkeypatch.setattr(bench, "TrackCase", lambda campaign, families: families)
    monkeypatch.setattr(bench, "diagnose", families.append)
    monkeypatch.setattr(bench, "rows_of", lambda diagnosis: answers)
    truth = {
        "case": "T1", "stratum": "single", "effects": [effect], "visible": {"hammer_pct": 20.0, "passage_pct": 0.0},
        "sensors": {"A1": 4.2, "A2": 5.4},
    }  # fmt: skip
    (left_out,) = right_names(effect["kind"])
    assert bench.answer_of_visit("folder", truth, (left_out,), library()[left_out].relatives)[0] == outcome
    assert families == [set(library()) - {left_out}]


@pytest.mark.parametrize("visible", [[0.5, 20.0], [20.0, 0.5], 20.0])
def test_the_clarity_of_an_effect_is_that_of_the_visit_with_the_largest_visibility(monkeypatch, visible):
    """A single visit has one pair of shares, a history one for each visit."""
    shares = [{"hammer_pct": v, "passage_pct": 0.0} for v in (visible if isinstance(visible, list) else [visible])]
    truth = {"visible": shares if isinstance(visible, list) else shares[0]}
    monkeypatch.setattr(bench, "make_history", lambda *args: truth)
    assert bench.largest_gain(truth["visible"]) == pytest.approx(gain_of({"hammer_pct": 20.0, "passage_pct": 0.0}))
    assert bench.make_site(None, bench.Site("local_pad", "pad", 0, "plain")) is truth


def test_stored_answers_are_not_computed_again(monkeypatch, tmp_path):
    site = bench.Site("hanging_sleeper", "void", 0, "plain")
    calls = []

    def answer(question, site, without):
        calls.append(without)
        return bench.Answer("unknown", "unknown at 4.2 m", 70.0, 5.0) if without else None

    monkeypatch.setenv("TURNOUT_LEFT_OUT_STORE", str(tmp_path / "answers"))
    monkeypatch.setattr(bench, "_answer", answer)
    for _ in range(2):
        assert bench._stored("visit", site, without=True) == answer("visit", site, True)
        assert bench._stored("visit", site, without=False) is None  # not clear
    assert calls.count(False) == 1


def test_the_table_states_every_failure_and_the_interval():
    sites = [bench.Site("local_pad", "pad", k, "plain") for k in range(3)]
    outcomes = ("unknown", "none", "other")
    missing = [(s, bench.Answer(o, f"answer {s.k}", 1.0, 4.0)) for s, o in zip(sites, outcomes)]
    text = bench.table(missing, [], 3.0)
    assert "| pad (plain), 4 points | `local_pad` | answer 1 (not seen) |" in text
    assert "Another name: 1 of 3 (95 %: 1 to 91 %; bar 3 %)." in text
    assert "Located: 1 of 3 (95 %: 1 to 91 %; bar 80 %)." in text


def test_effects_that_the_whole_library_does_not_detect_are_counted_separately():
    sites = [bench.Site("local_pad", "pad", k, "plain") for k in range(3)]
    missing = [(s, bench.Answer(o, o)) for s, o in zip(sites, ("unknown", "none", "none"))]
    present = [(s, bench.Answer(o, o)) for s, o in zip(sites, ("right", "right", "none"))]
    text = bench.table(missing, present, 3.0)
    assert "Located: 1 of 3 " in text and "Located, of those that are seen with it: 1 of 2 " in text
