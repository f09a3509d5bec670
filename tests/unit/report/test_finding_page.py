"""The page of mismatches: one sentence, one position, intervals, and a drawing of every answer without gaps."""

import json
import re
from datetime import datetime
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest
from jinja2 import Environment, PackageLoader

from turnout.errors import SimulationError
from turnout.report.finding_text import (
    ANSWERS,
    accepted_parameters,
    answer,
    check,
    facts,
    parameters,
    unmet_requirements,
)
from turnout.report.pages.finding import finding_page
from turnout.report.panels.finding import residual_panel
from turnout.report.panels.position import TurnoutDrawing, marked_position
from turnout.stages.accept_finding import _check_acceptable
from turnout.stages.mismatch_text import headline

SECTIONS = [
    {"label": "OT", "panel": "OT", "track": "both", "position_m": -12.0},
    {"label": "SP", "panel": "SP", "track": "both", "position_m": 3.6},
    {"label": "A7", "panel": "CP", "track": "main", "position_m": 24.6},
    {"label": "A9", "panel": "CP", "track": "diverging", "position_m": 28.2},
]
GAP = {
    "term": "hanging_sleeper",
    "fixed": {"sleeper": 24.6},
    "parameters": {"gap": {"value": 1.12e-3, "se": 0.05e-3, "unit": "m"}},
}
BALLAST = "ballast (95 % interval: 1.02 to 1.22 mm)"  # the end of the sentence on GAP
EVIDENCE = {
    "reason": "",
    "frames": [{"frame": "place", "level": "24.6", "effect_db": 6.1, "q": 0.002, "n": 80}],
    "posterior": {"hanging_sleeper": 0.97},
    "ranking": [{"family": "hanging_sleeper", "nats": 154.2, "explained": 0.93}],
    "by_condition": {"ic3 120 km/h": 80.0, "ic3 90 km/h": -2.0},
}


def finding(verdict="named", **more):
    row = {
        "finding_id": f"id-{verdict}-{more.get('sections', 'A7')}", "turnout_id": "t1", "section_id": "t1/A7",
        "found_at_utc": datetime(2026, 7, 25, 10), "verdict": verdict, "grade": None, "term": None, "rival_term": None,
        "locked_to": None, "position_m": None, "position_se_m": None, "channel": None, "band_low_hz": 21.0,
        "band_high_hz": 88.0, "probability": 0.97, "p_value": None, "fit_before_pct": 41.0, "fit_after_pct": None,
        "fit_rival_pct": None, "fit_decoy_pct": None, "n_held_out": 2, "sentence": "As the engine says it.",
        "next_measurement": "Look under this sleeper", "visit": "2026-07-25", "sections": "A7", "route": "main",
        "place_low_m": 24.6, "place_high_m": 24.6, "train": None, "axle": None, "wheel_within_m": 0.9,
        "n_hammer_tests": 1, "n_passages": 6, "n_sensors": 1, "level_before": 3.0, "level_after": 1.1,
        "term_json": None, "evidence_json": json.dumps(EVIDENCE), "notes": None,
    }  # fmt: skip
    return row | more


def test_effects_that_lack_the_same_measurement_are_one_row():
    no_passage = ("no passage", "passages")
    lacks = [("a dip", *no_passage), ("warm pads", "one temperature", "15 K"), ("a flat", *no_passage)]
    entries = [{"effect": what, "what": what, "lack": lack, "measurement": m} for what, lack, m in lacks]
    assert unmet_requirements({"evidence_json": json.dumps({"not_examined": entries})}) == [
        {"what": "a dip; a flat", "lack": "no passage", "measurement": "passages"},
        {"what": "warm pads", "lack": "one temperature", "measurement": "15 K"},
    ]
    assert unmet_requirements({"evidence_json": None}) == []


def named(**more):
    with_term = {
        "term": "hanging_sleeper",
        "grade": "A",
        "position_m": 24.6,
        "fit_after_pct": 78.0,
        "fit_rival_pct": 50.0,
    }
    return finding("named", **with_term, fit_decoy_pct=43.0, term_json=json.dumps([GAP]), **more)


def curves(row):
    x = np.linspace(0.01, 0.8, 100)
    base = {"finding_id": row["finding_id"], "turnout_id": "t1", "channel": "A7", "recording": "p1"}
    lists = {name: np.sin(9 * x + k) + 1.5 for k, name in enumerate(("measured", "before", "after", "rival"))}
    kinds = [("waveform", "time", "s", "m/s²"), ("spectrum", "frequency", "Hz", "(m/s²)²/Hz"),
             ("receptance", "frequency", "Hz", "m/N"), ("latent", "displacement of the sleeper", "m", "N")]  # fmt: skip
    return [
        base | lists | {"curve": c, "curve_no": k, "label": f"{c} of p1, held out", "x": x, "x_label": name,
                        "x_unit": unit, "y_unit": y}
        for k, (c, name, unit, y) in enumerate(kinds)
    ]  # fmt: skip


def page(*findings, parameters=(), quarantine=()):
    template = Environment(loader=PackageLoader("turnout.report", "templates"), trim_blocks=True, autoescape=True)
    rows = {
        "sections": SECTIONS, "mismatch_findings": list(findings), "quarantine": list(quarantine),
        "mismatch_parameters": list(parameters), "mismatch_curves": [c for f in findings for c in curves(f)],
    }  # fmt: skip
    shared = {"css": "", "finding_css": "", "version": "1", "generation": 3}
    return finding_page({"turnout_id": "t1", "name": "Test"}, rows, template.get_template("finding.html"), shared)


class Balanced(HTMLParser):
    """Parser that counts open elements."""

    VOID = {"meta", "br", "img", "link"}

    def __init__(self):
        super().__init__()
        self.open = []

    def handle_starttag(self, tag, attrs):
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, f"</{tag}> closes something else"


ROWS = {
    "named": named(),
    "a_or_b": named() | {"verdict": "a_or_b", "rival_term": "local_ballast", "finding_id": "two", "grade": None},
    "unknown": finding("unknown"),
    "numerics": finding("numerics", band_low_hz=None, band_high_hz=None, wheel_within_m=None),
    "none": finding("none"),
}


@pytest.mark.parametrize("verdict", ROWS)
def test_the_page_of_every_answer_is_valid_html(verdict):
    text = page(ROWS[verdict])
    parser = Balanced()
    parser.feed(text)
    assert not parser.open
    for drawing in re.findall(r"<svg.*?</svg>(?:</svg>)?", text, re.S):
        assert "nan" not in drawing and "inf" not in drawing
    assert "None" not in re.sub(r"<[^>]*>", " ", text)
    ElementTree.fromstring(re.search(r'<svg class="diagram".*?</svg>', text, re.S)[0])


def test_a_named_finding_states_effect_position_size_and_what_to_check():
    text = page(named())
    assert f"<h1>The sleeper at 24.6 m hangs 1.12 mm above its {BALLAST}.</h1>" in text.replace("\n", "")
    # 1.12 mm and 0.05 mm of standard error: 1.959964 * 0.05 = 0.098
    assert "1.02 to 1.22 mm" in text
    for words in (
        "21 to 88 Hz",
        "a wheel is within 0.9 m",
        "120 km/h (80 nats, odds above 1,000,000 to 1)",
        "Look under this sleeper.",
    ):
        assert words in text
    for fit in ("41 %", "78 %", "50 %", "43 %"):
        assert f">{fit}</text>" in text
    assert "--accept" in text and "held out" in text and "evidence [nats]" in text


def test_the_names_of_the_answers_are_those_of_the_documentation(repository):
    table = (
        (repository / "docs" / "mismatch.md")
        .read_text(encoding="utf-8")
        .partition("| answer |")[2]
        .partition("\n\n")[0]
    )
    documented = {cell.split(", grade")[0] for cell in re.findall(r"^\| ([^|]+?) \|", table, re.M)}
    assert {word for word, _ in ANSWERS.values()} == documented and len(documented) == 5
    assert all(f"<b>{word}</b>: {meaning}" in page(named()) for word, meaning in ANSWERS.values())


def test_the_sentence_of_a_named_effect_states_a_second_effect_without_a_name():
    reason = "a second effect without a name remains in channel A8: the residual is larger than in the intact state"
    row = named() | {"evidence_json": json.dumps(EVIDENCE | {"reason": reason})}
    expected = f"{BALLAST}. A second effect without a name remains in channel A8: the residual"
    assert expected in headline(row) and headline(named()).endswith(f"above its {BALLAST}.")
    heading = page(row).split("<h1>")[1].split("</h1>")[0]
    assert heading.endswith("1.22 mm).")  # the reason is under "How sure"
    assert reason in dict(facts(row))["How sure"]


PAD = {"term": "local_pad", "fixed": {"sleeper": 8.4}, "probability": 0.97,
       "parameters": {"factor": {"value": 0.3, "se": 0.02, "unit": "-"}}}  # fmt: skip


def test_each_of_two_effects_is_stated_with_its_probability_and_its_rival():
    gap = GAP | {"probability": 0.8, "or": "local_ballast"}
    first, second = ({"term": t["term"], "probability": t["probability"], "reason": ""} for t in (PAD, gap))
    row = named(probability=0.8) | {
        "term_json": json.dumps([PAD, gap]), "evidence_json": json.dumps(EVIDENCE | first | {"beside": [second]})
    }  # fmt: skip
    expected = headline(row)
    assert "at 8.4 m is 0.30 times as stiff as its neighbours' (95 % interval: 0.26 to 0.34)" in expected
    rival_sentence = f"{BALLAST}, or the effect is “local ballast”: these recordings cannot distinguish the two."
    assert expected.endswith(rival_sentence)
    sure = dict(facts(row))["How sure"]
    assert sure.startswith("probability 0.80") and "local pad 0.97, hanging sleeper 0.80" in sure
    with pytest.raises(SimulationError, match="hanging_sleeper is as probable as local_ballast"):
        _check_acceptable(row, "t1", False)


@pytest.mark.parametrize(
    ("delay", "expected"),
    [
        (9.3e-4, "A2 lags by 0.930 ms (95 % interval: 0.910 to 0.950 ms)"),
        (-9.3e-4, "A2 is early by 0.930 ms (95 % interval: 0.910 to 0.950 ms)"),
    ],
)
def test_the_sentence_states_whether_a_channel_lags_or_is_early(delay, expected):
    number = {"value": delay, "se": 1e-5, "unit": "s"}
    lag = {"term": "time_offset", "fixed": {"channel_name": "A2"}, "parameters": {"delay": number}}
    assert expected in headline(named() | {"term_json": json.dumps([lag])})


def test_axes_have_units():
    text = page(named())
    for label in ("time [s]", "frequency [Hz]", "displacement of the sleeper [m]", "force [N]"):
        assert label in text


def test_the_answer_a_or_b_states_the_measurement_that_distinguishes_the_two():
    row = ROWS["a_or_b"] | {"next_measurement": "Measure passages of a lighter and a heavier train"}
    assert "or the effect is “local ballast”: these recordings cannot distinguish the two" in headline(row)
    assert check(row) == "Measure passages of a lighter and a heavier train."


def test_the_answer_unknown_states_the_position_and_offers_no_effect_to_accept():
    text = page(ROWS["unknown"])
    assert "Something is missing about 24.6 m, and no known effect explains it." in text
    assert "position 24.6 m (+6.1 dB, false discovery rate 0.002, n = 80)" in text and "--accept" not in text


def test_an_unfinished_search_does_not_state_that_an_effect_is_missing():
    row = ROWS["unknown"] | {"evidence_json": json.dumps(EVIDENCE | {"is_finished": False})}
    text = page(row)
    assert "Whether something is missing is open, as the search was not finished." in text
    assert "The simulation differs most about 24.6 m." in text and "Something is missing" not in text


def test_the_answers_none_and_numerics_require_no_inspection():
    assert check(ROWS["none"]) == "Nothing to check."
    assert "refine" in check(ROWS["numerics"]) and answer(ROWS["numerics"]) == "numerics"


def test_the_most_severe_finding_is_first_and_the_others_are_collapsed():
    text = page(finding("none", sections="OT"), named(), finding("unknown", sections="SP"))
    order = [text.index(words) for words in ("named, grade A", "unknown</span> SP", "simulation and recordings agree")]
    assert order[0] < order[1] and '<details><summary><span class="badge ok">OT' in text


@pytest.mark.parametrize(("n_passages", "agreeing"), [(0, "hammer tests"), (3, "recordings")])
def test_a_page_without_compared_passages_states_that_only_hammer_tests_agree(n_passages, agreeing):
    assert f"<h1>Simulation and {agreeing} agree</h1>" in page(finding("none", n_passages=n_passages))


def test_the_arrow_points_at_the_position_or_the_sensor():
    drawing = TurnoutDrawing(SECTIONS)
    # the drawing ends 4 m beyond the sections, 20 pixels from the edges: -16 m at 20, 32.2 m at 900
    assert drawing.px(-16.0) == 20 and drawing.px(32.2) == pytest.approx(900)
    assert marked_position(named(), SECTIONS) == (24.6, "24.6 m")
    assert marked_position(finding("named", channel="A9"), SECTIONS) == (28.2, "sensor A9")
    assert marked_position(finding("unknown"), SECTIONS) == (None, "")


def test_accepted_parameters_are_shown_over_the_visits():
    rows = [
        {
            "finding_id": "id-none-A7" if day == 25 else f"old{day}", "turnout_id": "t1", "parameter_no": 0,
            "found_at_utc": datetime(2026, 7, day), "term": "hanging_sleeper", "position_m": 24.6, "channel": None,
            "parameter": "gap", "value": 1e-3 + 1e-5 * day, "value_se": 1e-5, "value_low": 1e-3, "value_high": 1.3e-3,
            "unit": "m", "accepted": True,
        }
        for day in (1, 12, 25)
    ]  # fmt: skip
    text = page(finding("none"), parameters=rows)
    assert "hanging sleeper, gap: 3 visits" in text and "In the track file, estimated again" in text
    nose = rows[-1] | {"term": "running_surface_kink", "parameter": "place", "value": 27.041, "value_low": 27.013}
    assert accepted_parameters([nose | {"value_high": 27.079}]) == [
        {
            "effect": "running surface kink at 24.6 m",
            "name": "place",
            "value": "27.04 m",
            "interval": "27.01 to 27.08 m",
        }
    ]
    assert accepted_parameters([nose | {"accepted": False}]) == []


def test_the_page_states_the_reason_for_no_answer():
    problem = "no channel with 2 accepted impacts"
    row = {"stage": "mismatch", "place": "sections A7", "found": problem, "remedy": "See docs"}
    text = page(quarantine=[row])
    assert "<h2>No answer</h2>" in text and "no channel with 2 accepted impacts" in text


def test_numbers_have_engineering_units_and_meaningful_digits():
    (row,) = parameters(named())
    assert (row["value"], row["interval"]) == ("1.12 mm", "1.02 to 1.22 mm")
    wide = GAP | {"parameters": {"gap": {"value": 1.12e-3, "se": 2.3e-3, "unit": "m"}}}
    (row,) = parameters(named() | {"term_json": json.dumps([wide])})
    assert (row["value"], row["interval"]) == ("1 mm", "0 to 6 mm")  # two more digits would be meaningless
    assert dict(facts(named()))["From"] == "1 hammer test, 6 passages, 1 installed sensor"


def test_every_effect_of_the_catalogue_has_a_sentence():
    from turnout.physics import TERMS

    for term in TERMS:
        made = {
            p.name: {"value": getattr(term.example(), p.name, p.neutral), "se": 0.0, "unit": p.unit}
            for p in term.parameters
        }
        row = named() | {"term_json": json.dumps([{"term": term.name, "fixed": {"sleeper": 24.6}, "parameters": made}])}
        assert not {"{", "–"} & set(headline(row)) and headline(row).endswith(".")


@pytest.mark.parametrize(
    "error, expected",
    [(1e-4, "1.12 mm above its ballast (95 % interval: 0.92 to 1.32 mm)"), (2e-3, "no train here closes the gap")],
)
def test_a_gap_with_only_a_lower_limit_has_no_size(error, expected):
    gap = {**GAP, "parameters": {**GAP["parameters"], "gap": {**GAP["parameters"]["gap"], "se": error}}}
    assert expected in headline(named() | {"term_json": json.dumps([gap])})


@pytest.mark.parametrize(
    "gain, expected", [(1.3, "A2 reads 1.30 times"), (-1.0, "A2 has the wrong polarity: it reads -1.00 times")]
)
def test_the_sentence_states_the_gain_or_the_wrong_polarity_of_a_sensor(gain, expected):
    term = {
        "term": "sensor_gain",
        "fixed": {"channel_name": "A2"},
        "parameters": {"gain": {"value": gain, "se": 0.03, "unit": "-"}},
    }
    assert expected in headline(named() | {"term_json": json.dumps([term])})


def test_a_rejected_effect_is_not_offered_for_acceptance():
    """The answer unknown may contain a tested effect: the page states that it is rejected."""
    text = page(finding("unknown", term_json=json.dumps([GAP]), fit_after_pct=26.0))
    assert "with the rejected effect" in text and "with the effect" not in text and "--accept" not in text
    assert "base model with the effect" in page(named()) and "--accept" in page(named())


def test_a_single_fit_is_a_sentence_and_no_chart():
    """The fit of an intact turnout is compared with nothing; four fits of a named effect are compared."""
    quiet = page(finding("none"))
    assert re.search(r"examined: [\d.]+ to [\d.]+ m", quiet) and "somewhere in" not in quiet
    assert "Fit on held-out recordings" not in quiet and "fit 41 % on 2 held-out recordings" in quiet
    assert "It is fixed to" not in quiet and "Largest deviation" in quiet
    text = page(named())
    assert "Fit on held-out recordings" in text and "fit 41 % on 2" not in text and "It is fixed to" in text


def test_the_residual_is_the_recording_less_the_prediction():
    """The base model predicts four fifths of a sine: the residual has 4 % of the energy, and none with the effect."""
    x = np.linspace(0.0, 1.0, 201)
    row = {"curve": "waveform", "x": x, "x_label": "time", "x_unit": "s", "y_unit": "m/s²", "label": "passage 1"}
    row |= {"measured": np.sin(40 * x), "before": 0.8 * np.sin(40 * x), "after": np.sin(40 * x)}
    svg = residual_panel(row, "the effect")
    assert "4.0 % of the energy by the base model, 0.0 % with the effect" in svg
    path = re.search(r'<path class="curve-before"[^>]* d="M([^"]*)"', svg)[1]
    y = np.cumsum(np.array(re.findall(r"-?[\d.]+", path), dtype=float).reshape(-1, 2)[:, 1])
    # the axis reaches 1.25 times the largest residual on both sides of the middle of 190 - 26 - 40 px
    assert np.ptp(y) == pytest.approx(124.0 / 1.25, abs=0.5)
    assert residual_panel(row, "") == "" and residual_panel(row | {"curve": "spectrum"}, "it") == ""


def test_the_sentence_of_a_second_effect_on_a_wheel_states_its_axle():
    """The columns of a finding contain the position of the first effect, which is fixed to a position here."""
    length = {"length": {"value": 0.04, "se": 0.008, "unit": "m"}}
    flat = {"term": "wheel_flat", "fixed": {"wheel": 3, "train": "loaded"}, "parameters": length}
    text = headline(finding(term="hanging_sleeper", position_m=24.6, term_json=json.dumps([GAP, flat])))
    assert "A wheel on axle 4 of loaded has a flat of 40 mm" in text


@pytest.mark.parametrize("order", [1, -1])
def test_effects_of_two_trains_keep_their_own_trains_in_a_sentence(order):
    """The column of the train has that of the first effect alone."""
    length = {"length": {"value": 0.04, "se": 0.008, "unit": "m"}}
    factor = {"factor": {"value": 1.6, "se": 0.1, "unit": "-"}}
    flat = {"term": "wheel_flat", "fixed": {"wheel": 3, "train": "loaded"}, "parameters": length}
    heavy = {"term": "unsprung_mass", "fixed": {"train": "railcar"}, "parameters": factor}
    trains = [{"train": "loaded, axle 4", "axle": 4}, {"train": "railcar", "axle": None}][::order]
    terms = [flat, heavy][::order]
    text = headline(finding(term=terms[0]["term"], **trains[0], term_json=json.dumps(terms)))
    assert "A wheel on axle 4 of loaded has a flat of 40 mm" in text
    assert "The wheelsets of railcar are 1.6" in text


def test_the_sentence_states_the_range_of_possible_positions():
    gap = {**GAP, "possible_positions": [24.6, 25.2]}
    text = headline(finding(term="hanging_sleeper", position_m=24.6, term_json=json.dumps([gap])))
    assert "24.6 m (24.6 to 25.2 m)" in text
    assert "24.6 m (" not in headline(finding(term="hanging_sleeper", position_m=24.6, term_json=json.dumps([GAP])))


def test_the_sentence_of_a_flat_states_all_wheels_that_may_have_it():
    length = {"length": {"value": 0.04, "se": 0.008, "unit": "m"}}
    fixed = {"wheel": 1, "train": "railcar"}
    flat = {"term": "wheel_flat", "fixed": fixed, "rival_axles": [1], "parameters": length}
    row = finding(term="wheel_flat", train="railcar, axle 2", axle=2, term_json=json.dumps([flat]))
    assert headline(row).startswith("A wheel on axle 2 or 1 of railcar has a flat of 40 mm")


def test_the_sentence_of_a_wheel_out_of_round_states_its_waves_and_their_amplitude():
    """0.032 ± 0.006 mm: the interval is 0.032 ± 1.96 * 0.006 = 0.020 to 0.044 mm, of either sign of the cosine."""
    for sign in (1.0, -1.0):
        cosine = {"cosine": {"value": sign * 3.2e-5, "se": 6e-6, "unit": "m"}}
        wheel = {"term": "out_of_round", "fixed": {"wheel": 0, "train": "loaded", "order": 5}, "parameters": cosine}
        assert headline(finding(term="out_of_round", term_json=json.dumps([wheel]))) == (
            "A wheel on axle 1 of loaded is out of round: 5 waves around it with an amplitude of 0.032 mm "
            "(95 % interval: 0.020 to 0.044 mm)."
        )


def test_the_size_follows_in_parentheses_if_the_sentence_of_an_effect_does_not_contain_it():
    """0.3 ± 0.05: the interval is 0.3 ± 1.96 * 0.05 = 0.20 to 0.40."""
    hardening = {"hardening": {"value": 0.3, "se": 0.05, "unit": "-"}}
    term = {"term": "ballast_hardening", "fixed": {"first": 24.0, "last": 25.2}, "parameters": hardening}
    assert headline(named() | {"term_json": json.dumps([term])}) == (
        "The ballast about 24.6 m stiffens under load (share of stiffness added at 1 mm: 0.30, "
        "95 % interval 0.20 to 0.40)."
    )


def colours(row):
    """Style and both ends [px] of each stretch of the drawing."""
    paths = re.findall(r'<path class="stretch (\S+)" d="M([\d.]+) [^"]*L([\d.]+) [\d.]+"', page(row))
    return {style: (float(low), float(high)) for style, low, high in paths}


def test_a_named_position_is_drawn_as_wide_as_its_interval_and_not_as_all_that_was_examined():
    row = named(place_low_m=20.0, place_high_m=28.0, position_se_m=0.5)
    drawing = TurnoutDrawing(SECTIONS)
    ends = colours(row)
    for style, low, high in (("found-named", 24.6 - 0.98, 24.6 + 0.98), ("found-examined", 18.7, 29.3)):
        assert ends[style] == pytest.approx((drawing.px(low), drawing.px(high)), abs=0.1)
    certain = colours(row | {"position_se_m": None})["found-named"]
    assert certain == pytest.approx((drawing.px(24.3), drawing.px(24.9)), abs=0.1)
    assert list(colours(finding("unknown", place_low_m=20.0))) == ["found-unknown"]


@pytest.mark.parametrize(("error", "is_decided"), [(1.3, False), (1.0, True)])
def test_the_page_states_what_a_name_rests_on_if_the_held_out_recordings_do_not_decide(error, is_decided):
    """2.2 points with a standard error of 1.3 are +2.2 ± 2.5 (95 %)."""
    impacts = {"impacts at 18.6 m 2026-07-25": 17.0, "ic3 120 km/h": 1.2}
    row = named(fit_before_pct=92.8, fit_gain_se_pct=error, n_held_out=1) | {"fit_after_pct": 95.0}
    row |= {"evidence_json": json.dumps(EVIDENCE | {"by_condition": impacts}), "band_high_hz": 718.0}
    answers = dict(facts(row))
    assert answers["The name rests on"].startswith("impacts at 18.6 m 2026-07-25 (17 nats")
    words = "1 held-out recording alone would not decide (+2.2 ± 2.5 points of fit)"
    assert (words in answers["The name rests on"]) != is_decided
    assert f": +2.2 ± {1.96 * error:.1f} points" in page(row)
    assert answers["Band"] == "21 to 718 Hz under impacts; trains are compared in a lower band, see their spectra"
    assert dict(facts(named()))["Band"] == "21 to 88 Hz"
