"""The panels of the calibrated model show values and intervals along the track, and how visits narrow them."""

import re
from datetime import datetime

import numpy as np
import pytest
from tests.unit.report.test_turnout_page import page

from turnout.report.panels.calibrated_model import KINDS, along_track_panels, calibrated_panels, narrowing_panel


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
    assert "from the 2 visits without an open finding or an unexpected change (1 left out)" in text
    assert "Red: the whole interval is outside." in text and "all visits" not in text
    assert "from the 1 visit without an open finding or an unexpected change; shaded" in page(calibrated=FIRST)


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
