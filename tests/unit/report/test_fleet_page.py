"""The page of the fleet: consistent counts, a diagram of each line, the alert and the long-term score."""

import math
import re
from datetime import datetime

import duckdb
import pytest

from turnout.config.settings.trend import TrendSettings
from turnout.report.pages.fleet import fleet_page
from turnout.report.panels.lines import line_diagrams
from turnout.report.site import page_environment, shared_by_pages
from turnout.report.source import SCORES


class Source:
    """Rows given by the test, in place of a registry."""

    day = "timestamp '2026-07-25'"

    def __init__(self, turnouts, states=(), listed=(), scores=(), learning=None, kinds=()):
        self.rows = {"turnouts": turnouts, "states": states, "listed_states": listed, "scores": scores}
        self.rows["chart_kinds"] = kinds
        self.learned = {"n": 0, "n_again": 0, "n_campaigns": 0, "n_days": 0} | (learning or {})

    def __getattr__(self, name):
        return lambda: list(self.rows.get(name, []))

    def learning(self):
        return self.learned


def turnout(name, km=1.0, line="L1"):
    counts = dict.fromkeys(("n_sections", "n_models", "n_rejected", "n_quarantined"), 2)
    return {"turnout_id": name, "name": "", "line": line, "km": km, "latest": None, "layout": "m"} | counts


def state(name, words, n=1):
    return {"turnout_id": name, "state": words, "n": n}


def page(*arguments, **rows):
    source = Source(*arguments, **rows)
    return fleet_page(source, page_environment().get_template("fleet.html"), shared_by_pages(1))


def cards(text):
    return {words: int(n) for n, words in re.findall(r"<b>(\d+)</b><span[^>]*>([^<]*)", text)}


def test_the_cards_add_up_to_all_turnouts_and_the_kinds_to_all_charts():
    states = [
        state("a", "plan"),
        state("a", "inspect this week", 2),
        state("b", "ok", 3),
        state("c", "not measured", 4),
    ]
    listed = [state("d", "cannot tell")]
    kinds = [{"kind": "resonance", "n": 6}, {"kind": "damping", "n": 3}, {"kind": "whole turnout", "n": 1}]
    text = page([turnout(name) for name in "abcde"], states, listed, kinds=kinds)
    counts = cards(text)
    expected = {"inspect this week": 1, "plan": 0, "cannot tell": 1, "not measured": 1, "ok": 1, "no chart yet": 1}
    assert counts == expected and sum(counts.values()) == 5
    kinds_expected = "10 charts (6 frequencies of resonances, 3 damping ratios, 1 of a whole turnout)"
    assert kinds_expected + ": 2 inspect this week, 1 plan, 4 not measured, 3 ok" in text


def test_turnouts_are_sorted_by_urgency_and_then_by_drift():
    scores = [
        {"turnout_id": t, "score": s, "section_id": f"{t}/A7", "band": "ballast"} for t, s in (("b", 9.0), ("c", 31.4))
    ]
    text = page(
        [turnout(name) for name in "abc"],
        [state("a", "inspect this week"), state("b", "ok"), state("c", "ok")],
        scores=scores,
    )
    rows = text[text.index('<table id="fleet">') :].split("<tr>")[2:]
    assert [re.search(r"turnouts/(\w+)", row)[1] for row in rows[:3]] == ["a", "c", "b"]
    assert '<td class="n" data-key="31">31 <span class="soft">A7 ballast</span></td>' in rows[1]
    assert '<td class="n" data-key="–">–</td>' in rows[0]


def test_a_first_campaign_is_reported_as_progress():
    states = [state("a", "learning", 2), state("a", "not measured", 10)]
    text = page([turnout("a")], states, learning={"n": 2, "n_campaigns": 1})
    assert "Your measurements are in. 2 charts learn what is normal. The most advanced one has 1 campaign in" in text
    assert "Nothing to do" not in text and "10 charts without a recent campaign" in text


def test_a_fleet_without_recent_measurements_is_not_reported_as_intact():
    text = page([turnout("a")], [state("a", "not measured", 12)])
    assert "No answer: no chart has recent measurements by which it can be judged." in text
    assert "Nothing to do" not in text and "12 charts without a recent campaign" in text


def test_weekly_campaigns_of_half_a_year_are_enough_in_number_but_too_short_for_a_baseline():
    learning = {"n": 2, "n_campaigns": 20, "n_days": 133, "n_again": 3}
    text = page([turnout("a")], [state("a", "learning", 5)], learning=learning)
    needs = f"at least {TrendSettings().baseline_campaigns} campaigns with a rail temperature, over at least 357 days"
    assert "has 20 campaigns in 133 days; with " + needs in text and "20 of 12" not in text
    assert "3 charts learn the level after recorded work." in text
    after_work = page([turnout("a")], [state("a", "learning", 3)], learning={"n_again": 3})
    assert "Your measurements are in" not in after_work and "No answer" not in after_work


def test_the_diagram_of_a_line_is_to_scale_and_has_a_link_for_each_turnout():
    """Kilometres 10, 11 and 14: the second is at a quarter of the distance from the first to the third."""
    fleet = [turnout("a", 10.0), turnout("b", 11.0), turnout("c", 14.0), turnout("d", None), turnout("e", 3.0, "L2")]
    worst = {"a": "ok", "b": "ok", "c": "ok", "d": "ok", "e": "inspect this week"}
    first, second = line_diagrams([t | {"worst": worst[t["turnout_id"]]} for t in fleet])
    assert (first["line"], first["n"], first["n_urgent"]) == ("L2", 1, 1) and (second["line"], second["n"]) == ("L1", 3)
    x = [float(v) for v in re.findall(r'cx="([\d.]+)"', second["svg"])]
    assert math.isclose((x[1] - x[0]) / (x[2] - x[0]), 0.25, abs_tol=0.001)
    assert re.findall(r"turnouts/(\w)\.html", second["svg"]) == ["a", "b", "c"]


def test_two_close_turnouts_are_labelled_in_two_rows_and_of_three_the_most_urgent():
    calm, urgent = turnout("calm", 12.4) | {"worst": "cannot tell"}, turnout("urgent", 12.5) | {"worst": "plan"}
    far = turnout("far", 50.0) | {"worst": "ok"}
    labels = re.compile(r'class="place" x="[\d.]+" y="(\d+)"[^>]*>(\w+)<')
    (drawing,) = line_diagrams([calm, urgent, far])
    assert labels.findall(drawing["svg"]) == [("11", "urgent"), ("24", "calm"), ("11", "far")]
    assert min(float(y) for y in re.findall(r'cy="([\d.]+)"', drawing["svg"])) - 7.0 > 24.0  # no circle on a label
    (crowded,) = line_diagrams([calm, urgent, far, calm | {"turnout_id": "third", "worst": "inspect this week"}])
    assert {name for _, name in labels.findall(crowded["svg"])} == {"third", "urgent", "far"}


def test_turnouts_of_one_station_do_not_overlap_in_the_diagram():
    fleet = [turnout(f"t{k}", 5.0 + 0.01 * k) | {"worst": "ok"} for k in range(9)]
    (drawing,) = line_diagrams([*fleet, turnout("far", 99.0) | {"worst": "ok"}])
    dots = [(float(x), float(y)) for x, y in re.findall(r'cx="([\d.]+)" cy="([\d.]+)"', drawing["svg"])]
    assert len(dots) == 10
    assert min(math.dist(a, b) for k, a in enumerate(dots) for b in dots[:k]) >= 14.0  # two radii


def test_the_page_states_that_everything_was_used_in_place_of_an_empty_table():
    sentence = "Nothing: no impact was rejected, and nothing is in quarantine."
    source = Source([turnout("a")])
    assert sentence in page([turnout("a")])
    source.rows["reasons"] = [{"reason": "overload", "impacts": 2, "rows": 0}]
    text = fleet_page(source, page_environment().get_template("fleet.html"), shared_by_pages(1))
    assert sentence not in text and "<td>overload</td>" in text


def test_a_section_with_a_step_has_no_long_term_score():
    """14.6 %/a through a step is no drift. A drift of 2.94 ± 0.48 %/a: 100 (1 - exp(-0.2 (2.94 - 1.96 0.48)))."""
    with duckdb.connect() as con:
        con.execute("""
            create table states as select * from (values
                ('a', 'a/ASM', 'ballast', 'step', -14.6, 2.6), ('a', 'a/ASM', 'railpad', null, -0.9, 0.1),
                ('a', 'a/OT', 'ballast', null, 0.1, 0.1), ('b', 'b/A8', 'ballast', 'drift', -2.94, 0.48),
                ('b', 'b/A9', 'ballast', 'step', -9.0, 0.1), ('c', 'c/A8', 'ballast', null, 0.1, 0.1)
            ) s(turnout_id, section_id, band, change_kind, drift_pct_per_year, drift_se_pct_per_year)""")
        con.execute("create macro chart_states_on(day) as table from states")
        rows = con.execute(SCORES.replace(":today", "null") + " order by turnout_id").fetchall()
    assert [row[0] for row in rows] == ["b", "c"] and rows[0][2:] == ("b/A8", "ballast")
    assert rows[0][1] == pytest.approx(100.0 * (1.0 - math.exp(-0.2 * (2.94 - 1.96 * 0.48)))) and rows[1][1] == 0.0


def test_the_newest_campaign_has_the_name_of_its_folder_and_not_the_day_in_utc():
    night = turnout("a") | {"latest": datetime(2026, 5, 12, 22, 30), "campaign_id": "a/2026-05-13"}
    before = turnout("b") | {"latest": datetime(2026, 5, 12, 9, 0), "campaign_id": "b/2026-05-12"}
    text = page([night, before])
    assert "latest campaign 2026-05-13" in text and text.count("2026-05-12") == 1
    assert "latest campaign –" in page([turnout("a")])
