"""The panels of the calibrated model show values and intervals along the track, and how visits narrow them."""

import re
from datetime import datetime

import duckdb
import numpy as np
import pytest
from tests.unit.report.test_turnout_page import page

from turnout.report.panels.calibrated_model import (
    KINDS,
    along_track_panels,
    calibrated_panels,
    depth_panels,
    narrowing_panel,
)
from turnout.report.source import ROWS


def state(parameter, position, value, sd, n_visits=2, day=1):
    return {
        "turnout_id": "t", "visit": f"2026-05-{day:02}", "found_at_utc": datetime(2026, 5, day), "parameter": parameter,
        "position_m": position, "value": value, "sd": sd, "prior_sd": 0.1, "n_visits": n_visits, "n_recordings": 8,
    }  # fmt: skip


STATES = [state(f"pad@{0.6 * k:.2f}", 0.6 * k, 0.0, 0.05, day=2) for k in range(4)]
SOFT = state("pad@2.40", 2.4, np.log(0.3), 0.02, day=2)
FIRST = [state(f"pad@{0.6 * k:.2f}", 0.6 * k, 0.5, 0.08, n_visits=1, day=1) for k in range(4)]


def test_a_soft_pad_is_marked_with_its_factor_and_interval():
    svg = along_track_panels([*FIRST, *STATES, SOFT])
    assert svg.count('<svg class="chart"') == 1 and "pad stiffness over file; 2 visits, 8 recordings" in svg
    low, high = (f"{v:.3g}" for v in 0.3 * np.exp(np.array([-1.0, 1.0]) * 1.96 * 0.02))
    assert f"pad@2.40: 0.3 ({low} to {high}, 95 %), visit 2026-05-02" in svg
    assert len(re.findall(r'<circle class="alarm"', svg)) == 1 and len(re.findall(r'<circle class="point"', svg)) == 4
    assert "0.5" not in re.findall(r"pad@0.00: ([^ ]*)", svg)  # the newest state of each parameter


def test_the_panel_shows_how_intervals_narrow_from_visit_to_visit():
    svg = narrowing_panel([*FIRST, *STATES])
    assert "pad: 0.50" in svg  # 0.05 of 0.1 after two visits
    assert narrowing_panel(STATES) == ""


@pytest.mark.parametrize("states", [[], [state("ballast_stiffness", None, 0.1, 0.02)], [STATES[0]]])
def test_no_panel_is_drawn_without_values_along_the_track(states):
    assert calibrated_panels(states) == ""


def test_the_page_of_the_turnout_has_the_panels():
    assert "Calibrated model</h2>" in page(calibrated=STATES) and "Calibrated model" not in page()


def test_the_page_states_the_number_of_used_visits_and_the_meaning_of_red():
    """The second of three visits has an open finding: the newest values are based on two visits."""
    later = [state(f"pad@{0.6 * k:.2f}", 0.6 * k, 0.0, 0.05, n_visits=2, day=3) for k in range(4)]
    unchanged = [{**row, "n_visits": 1} for row in STATES]
    text = page(calibrated=[*FIRST, *unchanged, *later])
    assert "from 2 visits (1 left out: an open finding, an unexpected change, or fitted with another version" in text
    assert "Red: the whole interval is outside." in text and "all visits" not in text
    assert "from 1 visit; shaded" in page(calibrated=FIRST)


def test_each_kind_of_parameter_has_a_line_of_its_own_look(repository):
    """Two lines of one colour have no legend."""
    ballast = [{**s, "parameter": s["parameter"].replace("pad", "ballast")} for s in (*FIRST, *STATES)]
    svg = narrowing_panel([*FIRST, *STATES, *ballast])
    assert re.findall(r'<path class="(curve [^"]*)" data-series="(\w+)"', svg) == [
        ("curve kind-ballast", "ballast"),
        ("curve kind-pad", "pad"),
    ]
    css = (repository / "src" / "turnout" / "report" / "templates" / "page.css").read_text(encoding="utf-8")
    looks = [css.partition(f".curve.kind-{kind}{{")[2].partition("}")[0] for kind in KINDS]
    assert len(set(looks)) == len(KINDS)


def test_components_that_the_track_file_has_no_more_are_not_shown():
    """New sleepers 0.1 m off the old ones: formerly both were shown. A part that was not measured since stays."""
    moved = [state(f"pad@{0.6 * k + 0.1:.2f}", 0.6 * k + 0.1, 0.0, 0.05, day=3) for k in range(4)]
    beyond = [state("pad@9.00", 9.0, 0.0, 0.05), state("pad@9.60", 9.6, 0.0, 0.05)]
    other_route = state("diverging pad@1.20", 1.2, 0.0, 0.05)
    silent = [state(f"gain_A{k}", 0.6 * k, 0.0, 0.05, day=1 if k == 1 else 3) for k in range(3)]  # one for a day
    svg = along_track_panels([*STATES, *beyond, other_route, *moved, *silent])
    shown = re.findall(r"((?:\w+ )?(?:pad@|gain_A)[\d.]+):", svg)
    assert sorted(shown) == [
        "diverging pad@1.20", "gain_A0", "gain_A1", "gain_A2", "pad@0.10", "pad@0.70", "pad@1.30", "pad@1.90",
        "pad@9.00", "pad@9.60",
    ]  # fmt: skip


def test_the_factor_of_all_supports_is_stated_beside_that_of_each():
    """With all pads softer by half each support was shown at the value of the file."""
    svg = along_track_panels([*STATES, state("pad_stiffness", None, np.log(0.5), 0.05, day=2)])
    assert "multiply by 0.5 (0.453 to 0.551, 95 %), common to all" in re.sub(r"</text><text[^>]*>", " ", svg)
    assert "multiply" not in along_track_panels(STATES)
    assert narrowing_panel([*FIRST, *STATES, state("pad_stiffness", None, 0.0, 0.9, 1)]).count("pad: 0.50") == 1


def test_the_depth_of_a_nose_is_shown_after_each_visit():
    """The main value of a crossing was in no panel."""
    nose = [state("ln depth of the kink at 5.24 m", 5.24, 0.1 * day, 0.05, day, day) for day in (1, 2, 3)]
    svg = depth_panels([*STATES, *nose])
    assert svg.count('<svg class="chart"') == 1 and "depth of the kink at 5.24 m over file, after each visit" in svg
    assert "1.22 (1.11 to 1.35, 95 %), visit 2026-05-02" in svg and depth_panels(STATES) == ""
    assert svg in calibrated_panels([*STATES, *nose])


@pytest.mark.parametrize(("section", "shown"), [("null", ["pad@18.00", "pad_stiffness"]), ("'t/A'", ["pad@18.00"] * 2)])
def test_states_from_before_a_renewal_are_not_read(section, shown):
    """A planned renewal has not happened, and that of a section is not one of the turnout. Waves are not drawn."""
    con = duckdb.connect()
    con.execute("create table superseded (old_id varchar)")
    con.execute("create table events (turnout_id varchar, section_id varchar, kind varchar, event_at_utc timestamp)")
    con.execute(f"""insert into events values
        ('t', {section}, 'renewal', '2026-05-02'), ('t', null, 'renewal', '2027-01-01'),
        ('t', null, 'tamping', '2026-05-20'), ('other', null, 'renewal', '2026-05-20')""")
    con.execute("""create table twin_states as select * from (values
        ('t', 'f1', '2026-05-01', timestamp '2026-05-01 12:00', 0, 'pad@18.00', 18.0, 0.0, 0.1, 0.1, 1, 4),
        ('t', 'f2', '2026-05-03', timestamp '2026-05-03 12:00', 0, 'pad@18.00', 18.0, 0.0, 0.1, 0.1, 1, 4),
        ('t', 'f2', '2026-05-03', timestamp '2026-05-03 12:00', 1, 'pad_stiffness', null, 0.0, 0.1, 0.1, 1, 4),
        ('t', 'f2', '2026-05-03', timestamp '2026-05-03 12:00', 2, 'cos_wave_3@0.00-9.00', null, 0.0, 0.1, 0.1, 1, 4)
        ) as t(turnout_id, finding_id, visit, found_at_utc, parameter_no, parameter, position_m, value, sd, prior_sd,
            n_visits, n_recordings)""")
    rows = con.execute(ROWS["calibrated"].replace(":today", "date '2026-06-01'"), {"turnouts": ["t"]}).fetchall()
    assert [row[4] for row in rows][: len(shown)] == shown and len(rows) == (2 if section == "null" else 3)
