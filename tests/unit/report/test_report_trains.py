"""The part about trains on the page of a turnout: bars, texts and effects agree with the rows."""

import re
from datetime import datetime

import pytest

from turnout.report.panels.train_bars import train_bars
from turnout.report.panels.weekly_peaks import weekly_peaks_panel
from turnout.report.site import page_environment
from turnout.report.trains import score_words, train_rows, trains_part

SECTIONS = [{"section_id": f"t/{s}", "label": s} for s in ("OT", "A7")]


def bar(section, name, score, **more):
    row = {
        "section_id": f"t/{section}", "score": "fit", "factor": "train type", "class": name, "class_from": None,
        "n": 20, "n_passages": 20, "score_pct": score, "score_sd_pct": 4.0, "score_se_pct": 0.9, "null_pct": 12.0,
        "adjusted_pct": score - 1.0, "adjusted_se_pct": 1.1,
    }  # fmt: skip
    return row | more


def heights(svg):
    return [float(h) for h in re.findall(r'<rect x="[\d.]+" y="[-\d.]+" width="[\d.]+" height="([\d.]+)" fill', svg)]


def test_bars_have_the_height_and_the_text_of_their_scores():
    svg = train_bars("train type", [bar("OT", "IC3", 10.0), bar("OT", "freight", 30.0)], SECTIONS)
    low, high = sorted(heights(svg)[:2])
    assert high == pytest.approx(3.0 * low, rel=0.02)
    assert "freight: 30.0 %, n = 20, spread 4.0; others held fixed 29.0" in svg
    assert ">OT<" in svg and ">A7<" not in svg, "a section without scores has no space in the chart"


def test_the_classes_with_most_passages_are_drawn_and_the_number_of_others_is_stated():
    """Nine classes of 20 km/h from 20 to 200 km/h; nearly all trains are in the fastest class."""
    rows = [
        bar("OT", f"{v}-{v + 20} km/h", 10.0, factor="speed", class_from=float(v), n_passages=1 if v < 180 else 500)
        for v in range(20, 200, 20)
    ]
    svg = train_bars("speed", rows[::-1], SECTIONS)
    assert "180-200 km/h: 10.0 %" in svg and "1 class with fewer passages is not drawn" in svg
    assert svg.count("others held fixed 9.0") == 8 and "not drawn" not in train_bars("speed", rows[1:], SECTIONS)


def test_a_factor_without_data_has_no_chart():
    assert train_bars("axle load", [bar("OT", "IC3", 10.0)], SECTIONS) == ""


def test_one_passage_has_a_bar_without_spread_or_interval():
    lone = bar("OT", "IC3", 10.0, n=1, n_passages=1, score_sd_pct=None, score_se_pct=None, adjusted_se_pct=None)
    svg = train_bars("train type", [lone], SECTIONS)
    assert "nan" not in svg and "spread" not in svg.split("</text>", 2)[2]


def test_the_text_states_how_many_scores_exceed_those_of_random_models():
    shared = {"n_best": 3, "n_compared": 10, "n_no_impulse": 7}
    words = score_words([{"status": "null_explains", "n": 10} | shared, {"status": "accepted", "n": 2} | shared])
    assert words.startswith("12 records of single sensors, compared with the model of the section.")
    assert "Better than random models, and the wheels act as impacts: 2." in words
    assert "No better than random models: 10." in words and "in 6 of 20" in words
    assert score_words([]) == ""


PASSAGE = {
    "passed_at_utc": datetime(2026, 7, 24, 1, 18), "speed_kmh": 142.5, "speed_se_kmh": 0.2, "axle_load_t": None,
    "axle_load_se_t": None, "axle_load_source": "unavailable", "axle_load_listed_t": None,
    "speed_listed_kmh": 140.0, "train_type_listed": "IC3", "train_type": "IC3",
    "n_axles": 8, "direction": "facing", "track": "main", "status": "accepted", "detail": None,
}  # fmt: skip


def test_the_part_states_speed_and_load_with_intervals_and_effects_with_the_factors_held_fixed():
    effect = {
        "section_id": "t/A7", "score": "fit", "factor": "speed", "per": "10 km/h", "held_fixed": "train type", "n": 40,
        "raw_change_pct": 0.5, "change_pct": -1.0, "low_pct": -1.5, "high_pct": -0.5,
    }  # fmt: skip
    rows = {"passages": [PASSAGE], "scores": [], "weeks": [], "bars": [bar("A7", "IC3", 10.0)], "effects": [effect]}
    part = trains_part(rows, SECTIONS)
    assert part["passages"][0]["speed"] == "142.5 ± 0.4" and part["passages"][0]["load"] == "not measured"
    assert part["passages"][0]["listed"] == "140 km/h, IC3"
    assert part["effects"][0]["held"] == "-1.00 [-1.50, -0.50]" and part["effects"][0]["verdict"] == "differs from none"
    assert part["loads_known"] is False and trains_part(rows | {"passages": []}, SECTIONS) is None


@pytest.mark.parametrize(
    ("source", "error", "load"),
    [("recording", 0.2, "13.9 ± 0.4"), ("both", 0.2, "13.9 ± 0.4"), ("timetable", None, "not measured")],
)  # fmt: skip
def test_an_axle_load_of_the_train_data_is_not_shown_as_measured(source, error, load):
    passage = PASSAGE | {"axle_load_t": 13.9, "axle_load_se_t": error, "axle_load_source": source}
    listed = None if source == "recording" else 13.86
    rows = {
        "passages": [passage | {"axle_load_listed_t": listed}],
        "scores": [],
        "weeks": [],
        "bars": [],
        "effects": [],
    }
    row = trains_part(rows, SECTIONS)["passages"][0]
    assert (row["load"], row["listed"]) == (load, "140 km/h, IC3" + (", 13.9 t" if listed else ""))


def test_names_with_quotes_are_escaped_in_queries():
    queries = []
    train_rows(lambda sql: queries.append(sql) or [], ["o'hara"])
    assert all("'o''hara'" in sql for sql in queries) and len(queries) == 5
    assert train_rows(lambda sql: 1 / 0, [])["bars"] == {}


def test_no_bar_overlaps_the_legend():
    rows = [bar("OT", name, 95.0) for name in ("IC3", "freight", "regional")]
    svg = train_bars("train type", rows, SECTIONS)
    swatches = [float(y) for y in re.findall(r'<rect x="\d+" y="(\d+)" width="10"', svg)]
    tops = [float(y) for y in re.findall(r'<rect x="[\d.]+" y="([-\d.]+)" width="[\d.]+" height="[\d.]+" fill', svg)]
    window = float(re.search(r'<svg x="62" y="(\d+)"', svg)[1])
    assert len(swatches) == 3 and max(swatches) + 10 <= window <= min(t for t in tops if t not in swatches)


def test_weekly_peaks_are_shown_before_the_collapsed_scores():
    """Four weeks, the last two in alarm: the chart shows their values; the scores are below a closed summary."""
    weeks = [
        {"section_id": "W1/OT", "week_utc": datetime(2026, 1, 5 + 7 * k), "peak_ms2": value, "peak_se_ms2": 2.0,
         "state": state, "expected_low_ms2": 92.0, "expected_high_ms2": 108.0}
        for k, (value, state) in enumerate([(100.0, "ok"), (102.0, "ok"), (140.0, "alarm up"), (150.0, "alarm up")])
    ]  # fmt: skip
    svg = weekly_peaks_panel("OT", weeks)
    assert "OT: 150 ± 4 m/s² (95 %), in alarm; 4 weeks" in svg
    assert "week of 2026-01-19: 140.0 m/s² ± 3.9 (95 %)" in svg
    assert weekly_peaks_panel("OT", []) == "" and 'class="expected"' in svg
    low, high = (float(end) for end in re.search(r'data-y="([\d.]+) ([\d.]+)', svg).groups())
    assert 80.0 < low < 92.0 and 153.9 < high < 162.0, "the axis follows weeks, intervals and the expected band"
    without = [w | {"expected_low_ms2": None, "expected_high_ms2": None} for w in weeks]
    assert 'class="expected"' not in weekly_peaks_panel("OT", without)
    part = {
        "weeks": svg, "words": "12 records", "n_scores": 12, "n_beyond": 2, "passages": [], "effects": [],
        "charts": {"fit": "<svg>bars</svg>", "forecast": ""}, "loads_known": True,
    }  # fmt: skip
    page = page_environment().get_template("trains.html").render(part=part)
    scores = page.index("<details><summary>Scores of the sections' models: 2 of 12 predict more")
    assert page.index("(95 %), in alarm") < page.index('aria-label="Passages"') < scores < page.index("bars</svg>")
