"""Scores of tools whose scores are known beforehand: perfect, silent, random and confidently wrong ones."""

import json
from collections import Counter

import numpy as np
import pytest
from scipy.stats import binom

from turnout_blind.score.answers import answers_of
from turnout_blind.score.calibration import by_answer, reliability, worst_difference
from turnout_blind.score.intervals import clopper_pearson
from turnout_blind.score.matching import gain_of, judge
from turnout_blind.score.metrics import confusion, figures
from turnout_blind.score.names import RIGHT_LOCKS, RIGHT_NAMES, SAME_PARAMETERS, right_names
from turnout_blind.score.report import failure_table, oracle_text, read_oracle
from turnout_blind.seal import BlindError

SINGLES = ("void", "dip", "flat", "gain", "pad_temperature")
WHERE = {
    "void": {"sleeper": 47, "position": 4.2},
    "dip": {"position": 6.0},
    "flat": {"train": "railcar", "axle": 3},
    "gain": {"sensor": "A2"},
    "pad_temperature": {},
    "guard_rail_rattle": {"position": 5.0},
    "bottomless_void": {"sleeper": 50, "position": 6.0},
}
LOCK = {"void": "place", "dip": "place", "flat": "wheel", "gain": "sensor", "pad_temperature": "condition"}
LOCK |= {"guard_rail_rattle": "place", "bottomless_void": "place"}
VALUES = {"void": {"gap": 1e-3}, "dip": {"depth": 5e-4}, "flat": {"length": 0.05}, "gain": {"gain": 1.3}}
VALUES |= {"pad_temperature": {"coefficient": 0.01}, "guard_rail_rattle": {}, "bottomless_void": {"gap": 0.02}}


def truth(case, stratum, *kinds, share=60.0):
    effects = [{"kind": k, "locked_to": LOCK[k], "where": WHERE[k], "parameters": VALUES[k], "rung": 5} for k in kinds]
    seen = {"hammer_pct": 0.0, "passage_pct": share if kinds else 0.0}
    return {"case": case, "stratum": stratum, "effects": effects, "visible": seen}


def truths():
    made = [truth(f"c{i}", "control") for i in range(60)]
    made += [truth(f"s{i}", "single", SINGLES[i % 5]) for i in range(50)]
    made += [truth(f"d{i}", "double", "void", "gain") for i in range(20)]
    made += [truth(f"o{i}", "outside", "guard_rail_rattle") for i in range(20)]
    made += [truth(f"u{i}", "unidentifiable", "bottomless_void") for i in range(16)]
    return made


def row(effect, name, probability=0.95, **more):
    where, values = effect["where"], effect["parameters"]
    parameters = [
        {"name": own, "value": values[o], "se": 0.05 * abs(values[o])}
        for o, own in SAME_PARAMETERS.get(effect["kind"], {}).items()
    ]
    return {
        "verdict": "named", "term": name, "rival_term": None, "locked_to": effect["locked_to"],
        "position_m": where.get("position"), "channel": where.get("sensor"), "probability": probability,
        "sentence": f"axle {where['axle']} of {where['train']}" if "axle" in where else "",
        "fit_before_pct": 20.0, "fit_after_pct": 50.0, "parameters_json": json.dumps(parameters), **more,
    }  # fmt: skip


def perfect(t):
    if t["stratum"] == "control":
        return [{"verdict": "none", "probability": 0.98}]
    if t["stratum"] == "outside":
        e = t["effects"][0]
        return [row(e, None, verdict="unknown")]
    if t["stratum"] == "unidentifiable":
        return [row(t["effects"][0], "local_ballast", verdict="a_or_b", rival_term="hanging_sleeper")]
    return [row(e, RIGHT_NAMES[e["kind"]][0]) for e in t["effects"]]


def table(tool, **more):
    judged = [judge(t, answers_of(tool(t))) for t in truths()]
    return judged, {f.name: f for f in figures(judged, **more)}


def test_a_perfect_tool_meets_every_bar():
    judged, found = table(perfect, oracle={j["case"]: (20.0, 52.0) for j in truths()})
    assert [f.name for f in found.values() if f.is_met is False] == []
    assert found["what: top-1 (clear singles)"].share == 100.0
    assert found["where: axle right (clear singles)"].n == 10
    assert found["parameters: median error"].value == 0.0
    assert found["held-out fit: gap to the oracle closed, median"].value == pytest.approx(100.0 * 30 / 32)
    assert found["probability: worst fifth, stated from seen"].is_met
    assert all(set(counts) <= {"none", "unknown", "a_or_b", "hanging_sleeper", "surface_dip", "wheel_flat",
                               "sensor_gain", "pad_temperature"} for counts in confusion(judged).values())  # fmt: skip


def test_bars_also_apply_to_effects_whose_oracle_gains_over_3_points():
    """The true effects gain 2 or 4 points. Only the latter count, for any fit that the tool states."""
    oracle = {f"s{i}": (20.0, 22.0 if i % 2 else 24.0) for i in range(40)}
    silent = table(lambda t: [{"verdict": "none", "probability": 0.9}], oracle=oracle)[1]
    found = table(lambda t: perfect(t) if t["case"] != "s0" else [{"verdict": "none"}], oracle=oracle)[1]
    name = "what: top-1 (singles whose oracle gains over 3 points)"
    assert (silent[name].k, silent[name].n) == (0, 20)
    assert (found[name].k, found[name].n) == (19, 20)
    assert found["what: top-1 (clear singles)"].n == 50


def test_a_silent_tool_has_no_false_alarm_and_no_right_name():
    _, found = table(lambda t: [{"verdict": "none", "probability": 0.9}])
    assert found["controls: false alarms"].k == 0
    assert found["not identifiable: 'a or b' with the truth, or none"].share == 100.0
    for name in ("what: top-1 (clear singles)", "what: top-2 (clear singles)", "where: lock right (clear singles)",
                 "two effects: both right", "outside the library: detected (clear)"):  # fmt: skip
        assert found[name].k == 0
        assert found[name].n > 0
    assert found["parameters: median error"].n == 0
    assert found["parameters: median error"].is_met is None  # without a measured value a bar is not met
    # The answer "none" with 0.9 in 166 cases is right in 60 controls and 16 cases that are not identifiable: 76/166.
    assert found["probability: worst fifth, stated from seen"].value == pytest.approx(abs(0.9 - 76 / 166))


def test_a_tool_without_answers_differs_from_a_silent_one():
    _, found = table(lambda t: None)
    assert found["cases without an answer"].k == 166
    assert found["not identifiable: 'a or b' with the truth, or none"].k == 0
    assert found["controls: false alarms"].k == 0


def test_a_random_tool_is_right_as_often_as_by_chance():
    rng = np.random.default_rng(5)
    names = [RIGHT_NAMES[k][0] for k in SINGLES]

    def tool(t):
        e = (t["effects"] or [{"where": {}, "parameters": {}, "kind": "", "locked_to": "place"}])[0]
        return [row(e, str(rng.choice(names)), 0.2)]

    _, found = table(tool)
    top = found["what: top-1 (clear singles)"]
    low, high = clopper_pearson(top.k, top.n, 0.999)
    assert low < 0.2 < high
    assert found["controls: false alarms"].share == 100.0
    assert found["outside the library: named wrongly"].share == 100.0


def test_a_confidently_wrong_tool_fails_the_bars_of_names_and_probabilities():
    _, found = table(lambda t: [row(e, "rail_shear", 0.99) for e in t["effects"]] or [{"verdict": "none"}])
    assert found["what: a wrong name (clear singles)"].share == 100.0
    assert found["not identifiable: a wrong name"].is_met is False
    assert found["two effects: one right and none wrong"].k == 0
    assert found["probability: worst fifth, stated from seen"].value > 0.9


def test_a_wrong_position_axle_train_or_sensor_is_detected():
    def wrong_positions(t):
        rows = perfect(t)
        for r in rows:
            if r.get("position_m") is not None:
                r["position_m"] += 0.61
            r["channel"] = "A4" if r.get("channel") else None
            if "axle" in r.get("sentence", ""):
                r["sentence"] = "axle 4 of railcar"
        return rows

    _, found = table(wrong_positions)
    assert found["what: top-1 (clear singles)"].share == 100.0
    for what in ("place", "axle", "sensor"):
        assert found[f"where: {what} right (clear singles)"].k == 0


def test_one_right_and_one_wrong_name_in_a_double_do_not_meet_the_bars():
    t = truth("d", "double", "void", "gain")
    right, wrong = row(t["effects"][0], "hanging_sleeper"), row(t["effects"][1], "time_offset")
    judged = judge(t, answers_of([right, wrong]))
    assert judged.matches == ("named", "")
    assert judged.wrong_names == ("time_offset",)
    found = {f.name: f for f in figures([judged])}
    assert found["two effects: one right and none wrong"].k == 0
    assert found["two effects: both right"].k == 0


def test_parameters_are_compared_with_the_concealed_ones():
    t = truth("s", "single", "void")
    inside, outside = row(t["effects"][0], "hanging_sleeper"), row(t["effects"][0], "hanging_sleeper")
    inside["parameters_json"] = '[{"name": "gap", "value": 0.0011, "se": 0.0001}]'
    outside["parameters_json"] = '{"gap": {"value": 0.0013, "se": 0.0001}, "where": {"sleeper": 47}}'
    assert judge(t, answers_of([inside])).parameters == ((pytest.approx(0.1), True),)
    assert judge(t, answers_of([outside])).parameters == ((pytest.approx(0.3), False),)


@pytest.mark.parametrize(
    ("train", "right"), [("railcar, axle 3", True), ("railcar, axle 4", False), ("loaded, axle 3", False)]
)
def test_train_and_axle_are_read_from_their_column(train, right):
    """The sentence may contain another number."""
    t = truth("s", "single", "flat")
    answer_row = {"verdict": "unknown", "locked_to": "wheel", "train": train, "sentence": "forces at axle 7 of a train"}
    assert judge(t, answers_of([answer_row])).located == {"lock": True, "axle": right}


def test_the_gap_of_a_sleeper_that_hangs_in_part_is_not_compared():
    t = truth("s", "single", "void")
    named = row(t["effects"][0], "hanging_sleeper")
    t["effects"][0]["parameters"] = {"gap": 1e-3, "seated": 0.35}
    judged = judge(t, answers_of([named]))
    assert judged.matches == ("named",)
    assert judged.parameters == ()


def test_effects_too_small_to_reduce_the_fit_do_not_count_against_the_tool():
    assert gain_of({"hammer_pct": 0.0, "passage_pct": 5.0}) < 0.3
    hidden = judge(truth("s", "single", "void", share=5.0), answers_of([{"verdict": "none"}]))
    found = {f.name: f for f in figures([hidden])}
    assert found["what: top-1 (clear singles)"].n == 0


def test_a_user_can_add_a_right_name():
    assert right_names("squeal") == ()
    assert right_names("squeal", {"squeal": ["hum"]}) == ("hum",)
    assert set(RIGHT_LOCKS) <= set(RIGHT_NAMES)


def test_reliability_includes_a_probability_of_one():
    judged = [judge(truth("c", "control"), answers_of([{"verdict": "none", "probability": p}])) for p in (0.05, 1.0)]
    assert reliability(judged) == [(0.05, 1.0, 1), (1.0, 1.0, 1)]


def test_a_second_term_among_the_parameters_is_an_answer_of_its_own():
    entries = [
        {"term": "hanging_sleeper", "name": "gap", "value": 1e-3, "se": 1e-4},
        {"term": "sensor_gain", "name": "gain", "value": 1.31, "se": 0.01},
    ]
    rows = [{"verdict": "named", "term": "hanging_sleeper", "parameters_json": json.dumps(entries)}]
    judged = judge(truth("d", "double", "void", "gain"), answers_of(rows))
    assert judged.matches == ("named", "named")
    assert judged.wrong_names == ()
    assert judged.parameters == ((0.0, True), (pytest.approx(0.01 / 0.3), True))


def test_each_false_alarm_wrong_name_and_missed_effect_is_a_row_of_failures():
    def rows(tool):
        judged, _ = table(tool)
        return [line.split(" | ")[0].strip("| ")[0] for line in failure_table(judged).splitlines()[2:]]

    judged, _ = table(perfect)
    assert failure_table(judged) == "None."
    silent = rows(lambda t: [{"verdict": "none", "probability": 0.9}])
    # "none" is right for controls and for cases that are not identifiable
    assert Counter(silent) == {"s": 50, "d": 20, "o": 20}
    unknown = rows(lambda t: [{"verdict": "unknown", "probability": 0.9}])
    # "unknown" is right for effects outside the library
    assert Counter(unknown) == {"c": 60, "s": 50, "d": 20, "u": 16}
    assert len(rows(lambda t: None)) == 166


def test_an_empty_list_of_rows_is_no_answer():
    """A tool that ends without a row has not answered "none"."""
    _, found = table(lambda t: [])
    assert found["cases without an answer"].k == 166
    assert found["not identifiable: 'a or b' with the truth, or none"].k == 0


def test_two_wrong_names_of_one_answer_count_as_a_wrong_name():
    t = truth("s", "single", "void")
    answer_row = row(t["effects"][0], "rail_shear", verdict="a_or_b", rival_term="time_offset")
    assert judge(t, answers_of([answer_row])).wrong_names == ("rail_shear",)
    assert judge(t, answers_of([answer_row | {"rival_term": "hanging_sleeper"}])).wrong_names == ()


def both(gap_at, sensor):
    """A void and a sensor's gain in one row, as ``term_json`` has them."""
    terms = [
        {"term": "hanging_sleeper", "fixed": {"sleeper": gap_at}, "parameters": {"gap": {"value": 1e-3, "se": 1e-4}}},
        {"term": "sensor_gain", "fixed": {"channel_name": sensor}, "parameters": {"gain": {"value": 1.3, "se": 0.01}}},
    ]
    return [{"verdict": "named", "term": "hanging_sleeper", "position_m": gap_at, "term_json": json.dumps(terms)}]


@pytest.mark.parametrize(("gap_at", "sensor", "right"), [(4.2, "A2", True), (8.2, "A2", False), (4.2, "A3", False)])
def test_both_names_of_two_effects_are_right_only_at_their_positions(gap_at, sensor, right):
    judged = judge(truth("d", "double", "void", "gain"), answers_of(both(gap_at, sensor)))
    assert judged.matches == ("named", "named")
    found = {f.name: f for f in figures([judged])}
    assert bool(found["two effects: both right"].k) is right
    assert found["two effects: one right and none wrong"].k == 1


def test_a_name_given_twice_for_one_effect_counts_as_wrong_once_and_its_size_does_not_count():
    gain = {"term": "sensor_gain", "fixed": {"channel_name": "A2"}, "parameters": {"gain": {"value": 1.3, "se": 0.01}}}
    other = {"term": "sensor_gain", "fixed": {"channel_name": "A3"}, "parameters": {"gain": {"value": 0.8, "se": 0.01}}}
    rows = [{"verdict": "named", "term": "sensor_gain", "channel": "A2", "term_json": json.dumps([gain, other])}]
    judged = judge(truth("s", "single", "gain"), answers_of(rows))
    assert judged.wrong_names == ("sensor_gain",)
    assert judged.parameters == ((0.0, True),)


def test_a_silent_tool_closes_no_gap_to_the_oracle_and_small_gains_of_the_oracle_do_not_count():
    """An oracle counts from a gain of three points on: 24.0 against 20.0 counts, 22.0 does not."""
    oracle = {f"s{i}": (20.0, 24.0 if i < 10 else 22.0) for i in range(50)}
    name = "held-out fit: gap to the oracle closed, median"
    _, silent = table(lambda t: [{"verdict": "none", "fit_before_pct": 20.0}], oracle=oracle)
    assert (silent[name].n, silent[name].value, silent[name].is_met) == (10, 0.0, False)

    def halfway(t):
        effects = [e for e in t["effects"][:1] if RIGHT_NAMES[e["kind"]]]
        return [row(e, RIGHT_NAMES[e["kind"]][0], fit_after_pct=22.0) for e in effects]

    half = table(halfway, oracle=oracle)[1]
    assert half[name].value == pytest.approx(50.0)


def test_a_fall_of_the_fit_counts_for_every_name():
    """Also for a false alarm, for two effects, and where the named model predicts nothing."""
    fell = {"fit_before_pct": 50.0, "fit_after_pct": 20.0}
    alarm = judge(truth("c", "control"), answers_of([{"verdict": "named", "term": "rail_shear", **fell}]))
    mute = judge(truth("d", "double", "void", "gain"), answers_of([both(4.2, "A2")[0] | {"fit_before_pct": 50.0}]))
    intact = judge(
        truth("s", "single", "void"), answers_of([row(truth("s", "single", "void")["effects"][0], "hanging_sleeper")])
    )
    found = {f.name: f for f in figures([alarm, mute, intact])}["held-out fit: fell by more than its standard error"]
    assert (found.k, found.n) == (2, 3)


@pytest.mark.parametrize(
    ("after", "error", "fallen"), [(47.0, 2.5, 1), (47.0, 3.5, 0), (49.5, 0.4, 1), (48.5, None, 1)]
)
def test_a_fall_of_the_fit_is_compared_with_the_standard_error_that_the_row_states(after, error, fallen):
    """Without a stated error the limit is one point."""
    fits = {"fit_before_pct": 50.0, "fit_after_pct": after, "fit_gain_se_pct": error}
    rows = [row(truth("s", "single", "void")["effects"][0], "hanging_sleeper", **fits)]
    named = judge(truth("s", "single", "void"), answers_of(rows))
    found = {f.name: f for f in figures([named])}
    assert found["held-out fit: fell by more than its standard error"].k == fallen
    assert found["held-out fit: fell by over a point"].k == (after < 49.0)


def test_fifths_have_equal_numbers_of_answers_and_equal_probabilities_stay_together():
    stated = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.6, 0.6, 0.9, 1.0]
    judged = [judge(truth("c", "control"), answers_of([{"verdict": "none", "probability": p}])) for p in stated]
    assert [n for _, _, n in reliability(judged)] == [2, 2, 4, 2]
    assert reliability(judged)[0][0] == pytest.approx(0.15)


def test_exact_probabilities_differ_from_the_shares_by_the_binomial_distribution():
    """One group of 25 answers stated with 0.8: 2.5 and 97.5 % points of |k/25 - 0.8|, k binomial."""
    results = [judge(truth("c", "control"), answers_of([{"verdict": "none", "probability": 0.8}])) for _ in range(25)]
    k = np.arange(26)
    differences, order = np.abs(k / 25.0 - 0.8), np.argsort(np.abs(k / 25.0 - 0.8), kind="stable")
    below = np.cumsum(binom.pmf(k, 25, 0.8)[order])
    expected = [differences[order][np.searchsorted(below, q)] for q in (0.025, 0.975)]
    difference, by_chance = worst_difference(results)
    assert difference == pytest.approx(0.2)  # all 25 are right
    assert by_chance == pytest.approx(expected, abs=1e-12)


def test_certain_answers_have_no_scatter_and_fewer_than_five_answers_are_not_compared():
    control = truth("c", "control")
    sure = [judge(control, answers_of([{"verdict": "none", "probability": 1.0}])) for _ in range(5)]
    assert worst_difference(sure) == (0.0, (0.0, 0.0))
    assert worst_difference(sure[:4]) == (None, None)


def test_probabilities_are_compared_for_each_kind_of_answer():
    """Two names of one effect, one of them wrong; two answers of none, one of them beside a clear effect."""
    clear = truth("s", "single", "void")
    named = [row(clear["effects"][0], name, probability=0.9) for name in ("hanging_sleeper", "rail_shear")]
    none = [{"verdict": "none", "probability": p} for p in (0.6, 0.8)]
    results = [judge(clear, answers_of([r])) for r in (*named, none[0])]
    results += [judge(truth("c", "control"), answers_of([none[1]]))]
    assert by_answer(results) == {"none": (pytest.approx(0.7), 1, 2), "one name": (pytest.approx(0.9), 1, 2)}


def test_an_oracle_by_another_tool_is_rejected(tmp_path):
    """Its fits and the tool's would be compared, and are those of two engines."""
    held = {"tool_sha256": "a" * 64, "commit_sha256": "b" * 64}
    oracle = held | {"asked": ["s0", "s1"], "fits": {"s0": {"before": 20.0, "oracle": 30.0}, "s1": {"error": "no"}}}
    (tmp_path / "diagnosis.json").write_text(json.dumps(held))
    (tmp_path / "oracle.json").write_text(json.dumps(oracle))
    assert read_oracle(tmp_path) == {"s0": (20.0, 30.0)}
    assert oracle_text(tmp_path) == [
        "Oracle: 2 of 2 clear singles asked, in the order of their ids, 1 without an answer (s1: no)."
    ]
    (tmp_path / "oracle.json").write_text(json.dumps(oracle | {"asked": ["s0", "s1", "s2"]}))
    assert "2 of 3 clear singles asked, in the order of their ids (1 not yet), 1 without" in oracle_text(tmp_path)[0]
    (tmp_path / "oracle.json").write_text(json.dumps(oracle | {"tool_sha256": "c" * 64}))
    with pytest.raises(BlindError, match="Ask the oracle with that tool"):
        read_oracle(tmp_path)


@pytest.mark.parametrize(
    ("wheel", "train", "right"), [(2, "railcar", True), (3, "railcar", False), (2, "loaded", False)]
)
def test_the_axle_of_a_second_effect_is_counted_from_one(wheel, train, right):
    """``term_json`` counts wheels from 0, a campaign its axles from 1: the concealed flat is on axle 3."""
    flat = {"term": "wheel_flat", "fixed": {"wheel": wheel, "train": train}, "parameters": {}}
    gap = {"term": "hanging_sleeper", "fixed": {"sleeper": 4.2}, "parameters": {}}
    rows = [{"verdict": "named", "term": "hanging_sleeper", "position_m": 4.2, "term_json": json.dumps([gap, flat])}]
    assert judge(truth("d", "double", "void", "flat"), answers_of(rows)).is_located == (True, right)
