"""An alarm and the diagnosis of the same section: the worklist has one statement, or states why there is none."""

import numpy as np
import pandas as pd
import pytest
from tests.unit.trend.evaluated_views import evaluated_views
from tests.unit.trend.test_trend_list import fallen

SECTION = "T00001/S4"


def finding(found_at, verdict, sentence, sections="S3, S4"):
    row = {
        "finding_id": "f1", "turnout_id": "T00001", "found_at_utc": found_at, "verdict": verdict, "sentence": sentence,
        "sections": sections, "visit": f"{found_at:%Y-%m-%d}",
    }  # fmt: skip
    return pd.DataFrame([row])


@pytest.fixture(scope="module")
def rows():
    return fallen()


@pytest.mark.parametrize(
    ("weeks_ago", "verdict", "sections", "expected"),
    [
        (0, "named", "S3, S4", "soft ballast at 21.6 m"),
        (0, "none", "S3, S4", "no decision: within the tolerances of the track file"),
        (110, "named", "S3, S4", "is older than the change"),
        (0, "named", "S1", "no decision: no diagnosis of this section yet"),
    ],
    ids=["one result", "tolerances", "too old", "of another section"],
)
def test_an_alarm_has_the_diagnosis_of_its_section_or_a_reason(settings, rows, weeks_ago, verdict, sections, expected):
    found_at = rows["measured_at_utc"].max() - pd.Timedelta(weeks=weeks_ago)
    findings = finding(found_at, verdict, "soft ballast at 21.6 m", sections)
    query = "select diagnosis, state from worklist where section_id = ?"
    with evaluated_views(rows, settings, mismatch_findings=findings) as con:
        ((diagnosis, state),) = con.execute(query, [SECTION]).fetchall()
        others = con.execute("select diagnosis from worklist where raised_at_utc is null").fetchall()
    assert state == "inspect this week" and expected in diagnosis
    assert all(d is None for (d,) in others)


def change(found_at, verdict="named", **more):
    """Row of ``change_findings`` of S3 and S4: soft ballast at S4, since the alarm's own time."""
    row = {
        "turnout_id": "T00001", "sections": "S3, S4", "found_at_utc": found_at, "verdict": verdict,
        "visit": f"{found_at:%Y-%m-%d}", "sentence": "soft ballast at 21.6 m", "term": "local_ballast",
        "component": "ballast", "position_m": 21.6, "first_m": 21.6, "last_m": 21.6, "change": -0.2, "grows": False,
    }  # fmt: skip
    return pd.DataFrame([row | more])


def diagnosis_of(rows, settings, **tables):
    with evaluated_views(rows, settings, **tables) as con:
        query = "select state, diagnosis, since_earliest_utc, since_latest_utc from worklist where section_id = ?"
        ((state, words, *since),) = con.execute(query, [SECTION]).fetchall()
    assert state == "inspect this week"
    return words, since


def test_alarm_and_diagnosis_of_change_are_one_row_with_one_result(settings, rows):
    newest = rows["measured_at_utc"].max()
    assert diagnosis_of(rows, settings, change_findings=change(newest))[0] == "soft ballast at 21.6 m"
    agreeing = finding(newest, "named", "words of the file").assign(term="local_ballast")
    none = finding(newest, "none", "")
    for against_file in (agreeing, none):
        words, _ = diagnosis_of(rows, settings, change_findings=change(newest), mismatch_findings=against_file)
        assert words == "soft ballast at 21.6 m"


@pytest.mark.parametrize(
    ("more", "weeks_ago", "expected"),
    [
        ({"verdict": "no_decision", "sentence": "no diagnosis: no track file"}, 0, "no diagnosis: no track file"),
        ({"verdict": "none", "sentence": "3 tests name no change"}, 0, "no decision: 3 tests name no change"),
        ({"verdict": "unknown", "sentence": "no effect explains it"}, 0, "no effect explains it"),
        ({}, 110, "is older than the change"),
    ],
    ids=["no track file", "cannot tell", "unknown", "too old"],
)
def test_a_diagnosis_without_a_result_states_the_reason(settings, rows, more, weeks_ago, expected):
    found_at = rows["measured_at_utc"].max() - pd.Timedelta(weeks=weeks_ago)
    assert expected in diagnosis_of(rows, settings, change_findings=change(found_at, **more))[0]


def test_the_row_states_how_alarm_and_diagnosis_differ(settings, rows):
    newest = rows["measured_at_utc"].max()
    early, late = diagnosis_of(rows, settings)[1]
    after = {"onset_after_utc": late + pd.Timedelta(days=9), "onset_by_utc": late + pd.Timedelta(days=30)}
    words, _ = diagnosis_of(rows, settings, change_findings=change(newest, **after))
    assert words.startswith("soft ballast") and f"dates the change differently, from {early:%Y-%m-%d}" in words
    within = {"onset_after_utc": early - pd.Timedelta(days=9), "onset_by_utc": late}
    assert "otherwise" not in diagnosis_of(rows, settings, change_findings=change(newest, **within))[0]
    other = finding(newest, "named", "words of the file").assign(term="local_pad")
    words, _ = diagnosis_of(rows, settings, change_findings=change(newest), mismatch_findings=other)
    assert words.startswith("soft ballast") and "name another effect, local pad" in words


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ({"component": "railpad"}, "the resonances point to the ballast, the diagnosis to the railpads"),
        ({"change": 0.2}, "the resonance fell, and the diagnosis finds more stiffness"),
        ({"position_m": 26.0, "first_m": 25.0, "last_m": 27.0}, "at 21.6 m, and what has changed is more than 3 m"),
        ({"first_m": 20.0, "last_m": 27.0}, None),
    ],
    ids=["component", "direction", "position", "a stretch around it"],
)
def test_a_diagnosis_of_another_component_direction_or_position_gives_no_decision(settings, rows, more, expected):
    sections = pd.DataFrame([{"section_id": SECTION, "turnout_id": "T00001", "label": "S4", "position_m": 21.6}])
    findings = change(rows["measured_at_utc"].max(), **more)
    with evaluated_views(rows, settings, change_findings=findings, sections=sections) as con:
        query = "select * replace (case when section_id = ? then 'ballast' end as changed_component) from chart_status"
        con.register("chart_status", con.execute(query, [SECTION]).df())
        query = "select diagnosis from worklist where section_id = ? and raised_at_utc is not null"
        ((diagnosis,),) = con.execute(query, [SECTION]).fetchall()
    assert diagnosis.endswith("soft ballast at 21.6 m")
    assert diagnosis == "soft ballast at 21.6 m" if expected is None else expected in diagnosis
    assert diagnosis.startswith("no decision: ") == (expected is not None)


def test_the_advice_for_a_chart_of_trains_is_more_trains(settings, rows):
    """Only recordings of the same kind improve a chart."""
    noise = np.exp(np.random.default_rng(1).normal(0.0, 0.3, len(rows)))
    peaks = rows.assign(band="amplitude", source="passage", frequency_hz=100.0 * noise)
    query = "select distinct source, look_at from worklist where state = 'cannot tell'"
    with evaluated_views(peaks, settings) as con:
        ((source, look_at),) = con.execute(query).fetchall()
    assert source == "passage" and "more trains" in look_at and "impacts" not in look_at


def peaks_of(rows, power):
    """Peak accelerations that rise in percent ``power`` times as much as the resonances of ``rows`` fall."""
    rise = (rows["frequency_hz"].max() / rows["frequency_hz"]) ** power
    return rows.assign(band="amplitude", source="passage", frequency_hz=100.0 * rise)


def test_a_certain_rise_of_acceleration_below_its_target_needs_no_visit(settings, rows):
    """Some 4 % are an alarm of a frequency, of which 1.5 % matter, and not of an acceleration, of which 10 % do."""
    query = "select state, sentence, change_high_pct from worklist where section_id = ? and raised_at_utc is not null"
    with evaluated_views(peaks_of(rows, 1.0), settings) as con:
        ((state, sentence, high),) = con.execute(query, [SECTION]).fetchall()
    assert state == "plan" and "below the target of 10.0 %: nobody needs to go there" in sentence and 1.5 < high < 10.0


def amplitude_row(rows, settings, **tables):
    """Diagnosis and advice of an alarm of trains at S4, whose peak accelerations rise by a quarter."""
    with evaluated_views(peaks_of(rows, 5.0), settings, **tables) as con:
        query = """
            select state, direction, diagnosis, look_at from worklist
            where section_id = ? and raised_at_utc is not null"""
        ((state, direction, diagnosis, look_at),) = con.execute(query, [SECTION]).fetchall()
    assert (state, direction) == ("inspect this week", "up")
    return diagnosis, look_at


@pytest.mark.parametrize(
    ("weeks_ago", "verdict", "is_surface"), [(0, "none", True), (0, "named", False), (110, "none", False)],
    ids=["support unchanged", "support changed", "before the change"],
)  # fmt: skip
def test_an_alarm_of_trains_alone_has_a_reason_and_a_next_step(settings, rows, weeks_ago, verdict, is_surface):
    sections = pd.DataFrame([{"section_id": SECTION, "turnout_id": "T00001", "label": "S4", "position_m": 36.3}])
    found_at = rows["measured_at_utc"].max() - pd.Timedelta(weeks=weeks_ago)
    findings = change(found_at, verdict, sentence="3 tests name no change")
    diagnosis, look_at = amplitude_row(rows, settings, change_findings=findings, sections=sections)
    assert ("only trains show it" in diagnosis and "no decision" not in diagnosis) == is_surface
    assert ("straightedge from 33.3 to 39.3 m: a dipped weld" in look_at) == is_surface


@pytest.mark.parametrize(
    ("panel", "parts"),
    [
        ("CP", "joint, a worn nose or wing rail, corrugation"),
        ("SP", "joint, a worn blade or stock rail, corrugation"),
        ("AS", "weld or joint, corrugation"),
        (None, "weld or joint, corrugation"),
    ],
)
def test_only_a_panel_with_a_nose_or_a_blade_has_one_to_look_at(settings, rows, panel, parts):
    section = {"section_id": SECTION, "turnout_id": "T00001", "label": "S4", "position_m": 36.3, "panel": panel}
    tables = {"change_findings": change(rows["measured_at_utc"].max(), "none"), "sections": pd.DataFrame([section])}
    _, look_at = amplitude_row(rows, settings, **tables)
    assert parts in look_at and ("nose" in look_at) == (panel == "CP") and ("blade" in look_at) == (panel == "SP")


VOID = "the void under the sleeper at 21.6 m: measure it with a void meter, or with a level while a train passes"
SLEEPER = "voids and wet or fouled ballast under the sleeper at 21.6 m"
SLEEPERS = "voids and wet or fouled ballast under the sleepers from 20.4 to 22.2 m"


@pytest.mark.parametrize(
    ("weeks_ago", "more", "expected"),
    [
        (0, {}, SLEEPER),
        (0, {"first_m": 20.4, "last_m": 22.2}, SLEEPERS),
        (0, {"term": "hanging_sleeper"}, VOID),
        (0, {"term": "hanging_sleeper", "verdict": "a_or_b", "rival_term": "local_ballast"}, SLEEPER),
        (0, {"verdict": "unknown"}, None),
        (0, {"component": None}, None),
        (0, {"first_m": 25.0, "last_m": 27.0}, None),
        (110, {}, None),
    ],
    ids=[
        "a sleeper",
        "a stretch",
        "a void",
        "a void or soft ballast",
        "without a name",
        "no support",
        "more than 3 m away",
        "older than the alarm",
    ],
)
def test_the_worklist_names_the_sleepers_of_the_diagnosis(settings, rows, weeks_ago, more, expected):
    """Alarms alone would name the pads of the section, and alarms of trains its running surface."""
    sections = pd.DataFrame([{"section_id": SECTION, "turnout_id": "T00001", "label": "S4", "position_m": 21.6}])
    findings = change(rows["measured_at_utc"].max() - pd.Timedelta(weeks=weeks_ago), **more)
    tables = {"change_findings": findings, "sections": sections}
    with evaluated_views(rows, settings, **tables) as con:
        query = "select look_at from worklist where section_id = ? and raised_at_utc is not null"
        ((of_impacts,),) = con.execute(query, [SECTION]).fetchall()
    _, of_trains = amplitude_row(rows, settings, **tables)
    assert of_impacts == (expected or "worn, cracked or displaced pads, loose fastenings")
    assert of_trains == (expected or "running surface, fastenings and voids; the mounting of the sensor")


def test_where_the_resonances_do_not_decide_the_advice_names_both_components(settings, rows):
    """The sentence said that they do not decide, and the advice sent to one component alone."""
    query = "select * replace (case when section_id = ? then 'either' end as changed_component) from chart_status"
    with evaluated_views(rows, settings) as con:
        con.register("chart_status", con.execute(query, [SECTION]).df())
        query = "select sentence, look_at from worklist where section_id = ? and raised_at_utc is not null"
        ((sentence, look_at),) = con.execute(query, [SECTION]).fetchall()
    assert "do not decide between ballast and railpads" in sentence
    pads, ballast = look_at.split("; ")
    assert pads.startswith("worn, cracked or displaced pads") and ballast.startswith("voids and wet or fouled ballast")
