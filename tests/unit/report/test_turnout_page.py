"""The page of one turnout from given rows: curves belong to the test that is named, and long lists are shortened."""

import errno
import re
from datetime import datetime

import duckdb
import numpy as np
import pytest

from turnout.report import panels
from turnout.report.departures import departure_rows, departure_sentences
from turnout.report.pages.turnout import turnout_page
from turnout.report.site import page_environment, replace_page, shared_by_pages
from turnout.report.source import ROWS
from turnout.report.trains import ROWS as OF_TRAINS

SECTION = {"section_id": "t/A7", "turnout_id": "t", "label": "A7", "panel": "CP", "track": "main", "position_m": 21.4}
REJECTED = {
    "section_id": "t/A7", "model_id": "new", "measured_at_utc": datetime(2026, 7, 1, 9), "status": "rejected",
    "reason": "too_few_impacts", "detail": "2 of 10 impacts accepted, 5 needed", "n_impacts_used": 2, "model_order": 0,
    "hammer_fit_pct": None, "hammer_fit_null_pct": None,
}  # fmt: skip
CURVES = ("h1_real_m_n", "h1_imag_m_n", "h2_abs_m_n", "coherence", "coherence_low", "coherence_high")
RECEPTANCE = dict.fromkeys(CURVES, np.full(40, 0.5)) | {
    "section_id": "t/A7", "model_id": "old", "measured_at_utc": datetime(2026, 5, 1, 9), "n_impacts": 30,
    "frequency_hz": np.linspace(20.0, 1600.0, 40), "passed": np.ones(40, dtype=bool), "gate": "limit",
    "valid_to_hz": None, "decay_ms2": None, "decay_model_ms2": None, "stabilisation_json": "[]",
}  # fmt: skip


def page(**rows):
    turnout = {"turnout_id": "t", "name": None, "line": None, "km": None, "layout": "main"}
    rows = {kind: [] for kind in (*ROWS, *OF_TRAINS)} | {"sections": [SECTION]} | rows
    return turnout_page(rows, turnout, page_environment().get_template("turnout.html"), shared_by_pages(1))


def test_a_rejected_test_is_not_shown_with_the_curves_of_an_earlier_test():
    text = page(models=[REJECTED], receptances=[RECEPTANCE])
    assert "Latest hammer test, 2026-07-01: 2 of 10 impacts accepted, 5 needed." in text
    assert "n = 30 impacts" not in text and "<details" not in text


def test_the_curves_of_the_latest_test_are_shown():
    used = REJECTED | {"model_id": "old", "measured_at_utc": datetime(2026, 5, 1, 9), "status": "accepted"}
    text = page(models=[used | {"reason": None, "detail": None}], receptances=[RECEPTANCE])
    assert "Latest hammer test, 2026-05-01: receptance" in text and "n = 30 impacts" in text


def departure(**more):
    """Row of ``modes_off_track``: a mode that differs from the nine campaigns before."""
    row = {
        "section_id": "t/A7", "band": "ballast", "measured_at_utc": datetime(2026, 5, 1, 9), "frequency_hz": 162.0,
        "damping_ratio": 0.05, "frequency_track_hz": 178.0, "damping_track": 0.067, "residue_ratio": 0.84,
        "n_history": 9, "shape_mac": None, "verdict": "departs", "frequency_se_hz": 1.0, "damping_se": 0.004,
        "frequency_distance": 6.0, "damping_distance": 4.0,
    }  # fmt: skip
    return row | more


@pytest.mark.parametrize(("mac", "words"), [(None, "–"), (0.034, "0.03")])
def test_a_mode_off_its_history_is_in_a_table_with_its_shape_if_there_is_a_second_response(mac, words):
    text = page(models=[REJECTED], off_track=[departure(shape_mac=mac)])
    cells = re.findall(r'<td class="n">([^<]*)</td>', text[text.index("squared residue") :])
    assert cells[:7] == ["162.0 ± 2.0", "178.0", "0.050 ± 0.008", "0.067", "9", "0.84", words]


@pytest.mark.parametrize(
    ("frequencies", "departing", "expected"),
    [
        ((178, 172, 166, 162), (1, 2), "From 2026-02-01 on the ballast mode differs from that before: 162.0 to 172.0"),
        ((178, 172, 166, 177), (1, 2), "From 2026-02-01 to 2026-03-01 the ballast mode differs"),
        ((178, 172, 178, 178), (1,), "On 2026-02-01 the ballast mode differs from that before: 172.0 Hz against 178.0"),
        ((178, 178, 178, 162), (3,), "From 2026-04-01 on the ballast mode differs from that before: 162.0 Hz"),
    ],
    ids=["lasting", "over", "one campaign", "the newest"],
)  # fmt: skip
def test_one_sentence_states_from_when_to_when_a_mode_differs(frequencies, departing, expected):
    """The newest campaign belongs to a lasting change, although it is compared with a history that contains it."""
    modes = [
        departure(measured_at_utc=datetime(2026, 1 + k, 1), frequency_hz=float(f)) for k, f in enumerate(frequencies)
    ]
    (sentence,) = departure_sentences([modes[k] for k in departing][::-1], modes)
    assert sentence.startswith(expected) and "median of 9 before" in sentence
    assert departure_rows([modes[k] for k in departing][::-1])[0]["when"] == f"2026-0{1 + departing[0]}-01"


def test_a_departure_has_the_name_of_its_campaign_which_is_the_local_day():
    """Its start in UTC lies on the day before."""
    begun = datetime(2026, 4, 30, 22, 30)
    uncertain = departure(band="railpad", verdict="uncertain", measured_at_utc=begun, campaign_id="t/2026-05-01")
    departing = departure(measured_at_utc=begun, campaign_id="t/2026-05-01")
    text = page(models=[REJECTED], off_track=[departing, uncertain])
    assert "From 2026-05-01 on the ballast mode differs" in text
    assert "whether the railpad mode continues that before: 2026-05-01." in text
    assert text.count('<td class="date">2026-05-01</td>') == 2 and "2026-04-30" not in text


def test_a_mode_with_a_large_error_is_reported_as_uncertain():
    mode = departure(verdict="uncertain", frequency_hz=307.37, frequency_se_hz=77.8, damping_se=0.338)
    text = page(models=[REJECTED], off_track=[mode])
    assert "Too uncertain to show whether the ballast mode continues that before: 2026-05-01." in text
    assert "<td>too uncertain to compare</td>" in text and ">307 ± 152<" in text
    assert "the track has changed" not in text


def test_a_new_panel_needs_a_function_and_one_line(monkeypatch):
    def count_panel(test):
        return f"<svg><text>{len(test.impacts)} impacts in a new panel</text></svg>"

    monkeypatch.setattr(panels, "HAMMER_PANELS", (*panels.HAMMER_PANELS, count_panel))
    model = REJECTED | {"model_id": "old", "status": "accepted", "reason": None, "detail": None}
    impact = {"section_id": "t/A7", "status": "accepted", "reason": None, "record": 0, "test": 1, "peak_n": 4e3}
    text = page(models=[model], receptances=[RECEPTANCE], impacts=[impact | {"path": "A7_1.uff"}] * 3)
    assert "3 impacts in a new panel" in text


def test_the_page_shows_a_section_that_the_configuration_does_not_have():
    """The section was measured and left the layout before its registration."""
    text = page(sections=[SECTION | dict.fromkeys(("panel", "track", "position_m"))])
    assert "A7 (panel not configured, track not configured" in text and "None" not in text


def test_many_rows_of_a_dead_sensor_do_not_hide_other_rows_of_the_quarantine():
    with duckdb.connect() as con:
        con.execute("""
            create table quarantine_open as
            select 't' as turnout_id, 'passage' as kind, printf('t/passages/%05d.tdms', i) as path, 0 as record,
                'dead_channel' as reason_code, 'A7' as place, 'all 0' as found, 'Look at it' as remedy
            from range(1000) r(i)
            union all select 't', 'passage', printf('t/passages/%05d.tdms', i), 0, 'entry_unknown', 'record 1',
                printf('Hub: %d', i), if(i % 2 = 0, 'name it: Hub', 'name it: Lot') from range(1000) r(i)
            union all select 't', 'hammer', 't/hammer/A7.uff', null, 'truncated', 'record 3', 'ends early', 'Copy it'
            union all select 'u', 'hammer', 'u/hammer/A7.uff', null, 'truncated', 'record 3', 'ends early', 'Copy it'
        """)
        found = con.execute(ROWS["quarantine"], {"turnouts": ["t"]})
        rows = [dict(zip([d[0] for d in found.description], row)) for row in found.fetchall()]
    remarks = [row for row in rows if row["reason_code"] == "entry_unknown"]
    assert [row["remedy"][-3:] for row in remarks] == ["Hub", "Lot"] and remarks[0]["n_alike"] == 1000
    rows = [row for row in rows if row not in remarks]
    text = page(quarantine=rows)
    assert "t/passages/00999.tdms" in text and "t/hammer/A7.uff" in text and text.count("00999.tdms") == 1
    n_rows = text.count("<td>dead_channel</td>")
    assert n_rows < 50 and f"and {1000 - n_rows} more of dead_channel" in text and "more of truncated" not in text


def test_collapsed_parts_are_printed():
    """A closed element hides its content by ``content-visibility`` of ``::details-content``."""
    printed = shared_by_pages(1)["css"].partition("@media print")[2]
    assert "details::details-content{display:block;content-visibility:visible}" in printed


def luminance(colour):
    """Relative luminance of a colour #rrggbb, as WCAG 2.2 defines it."""
    share = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    red, green, blue = (s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in share)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one, other):
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def colours(scheme):
    """The colours of the pages by name, in the light or the dark scheme."""
    blocks = re.findall(r":root\{([^}]*)\}", shared_by_pages(1)["css"])
    chosen = "".join(blocks if scheme == "dark" else blocks[:1])
    return {name: "#" + "".join(2 * c for c in value) if len(value) == 3 else "#" + value
            for name, value in re.findall(r"--([\w-]+):#(\w+)", chosen)}  # fmt: skip


def style(selector, scheme="light"):
    """The rule of the style of the pages, with the values of its colour variables."""
    rule = shared_by_pages(1)["css"].partition(selector + "{")[2].partition("}")[0]
    return re.sub(r"var\(--([\w-]+)\)", lambda m: colours(scheme)[m[1]], rule)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("state", ["inspect", "plan", "learning", "ok"])
def test_the_text_of_a_badge_has_enough_contrast(state, scheme):
    """WCAG 2.2, success criterion 1.4.3: at least 4.5 to 1."""
    words = colours(scheme)["badge-ink"]
    assert contrast(words, re.search("background:(#[0-9a-f]+)", style(f".badge.{state}", scheme))[1]) >= 4.5


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", ["ink", "soft", "blue", "orange", "red", "violet"])
def test_text_has_enough_contrast_on_the_page_and_on_its_panels(name, scheme):
    table = colours(scheme)
    assert min(contrast(table[name], table[ground]) for ground in ("ground", "panel")) >= 4.5


def test_an_alarm_differs_from_an_intact_section_in_lightness_or_outline():
    """Some readers and printers do not distinguish red and green: lightness differs 3 to 1, or the outline."""
    alarm, intact = style(".state-inspect"), style(".state-ok")
    fills = (re.search("fill:(#[0-9a-f]+)", rule)[1] for rule in (alarm, intact))
    assert contrast(*fills) >= 3.0 or ("stroke" in alarm and "stroke" not in intact)


def test_a_full_disk_leaves_only_the_old_page(tmp_path, monkeypatch):
    (tmp_path / "t.html").write_text("old")

    def full(descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        replace_page(tmp_path / "t.html", "new")
    assert [p.name for p in tmp_path.iterdir()] == ["t.html"] and (tmp_path / "t.html").read_text() == "old"


def test_records_of_one_file_that_fail_in_the_same_way_share_one_row_of_the_quarantine():
    row = {
        "turnout_id": "t", "kind": "hammer", "path": "t/ASM_1.h5", "record": 0, "reason_code": "not_finite",
        "place": "record 1 of 10", "found": "5 samples are not finite", "remedy": "Export it again", "n_alike": 5,
    }  # fmt: skip
    cut = row | {"record": None, "reason_code": "truncated", "place": "byte 81920", "n_alike": 1}
    text = page(quarantine=[*(row | {"record": k, "place": f"record {k + 1} of 10"} for k in (9, 1, 2, 0, 5)), cut])
    assert text.count("<td>t/ASM_1.h5</td>") == 2
    assert "<td>5 records: 1 to 3, 6, 10</td><td>5 samples are not finite</td>" in text
    whole = [row | {"record": None, "place": f"record {k + 1} of 3, channel &"} for k in (2, 0, 1)]
    assert "<td>all 3 records, channel &amp;</td>" in page(quarantine=whole)
    assert "<td>2 records: 1, 3, channel &amp;</td>" in page(quarantine=whole[:2])
    assert "<td>byte 81920</td>" in text and "more of" not in text


@pytest.mark.parametrize(
    ("kind", "section", "status"),
    [
        ("hammer", "t/A7", "not read, see quarantine"),
        ("hammer", "t/A8", "not measured"),
        ("hammer", None, "not measured"),
        ("passage", "t/A7", "not measured"),
    ],
)
def test_a_section_whose_files_cannot_be_read_is_not_reported_as_not_measured(kind, section, status):
    row = {
        "turnout_id": "t", "kind": kind, "section_id": section, "path": "t/A7_1.csv", "record": None, "place": "line 1",
        "reason_code": "truncated", "found": "no line break", "remedy": "Copy it again", "n_alike": 1,
    }  # fmt: skip
    measured = SECTION | {"section_id": "t/A9", "label": "A9"}
    tested = REJECTED | {"section_id": "t/A9"}  # a page without any test has no table of resonances
    text = page(sections=[SECTION, measured], models=[tested], quarantine=[row])
    assert text.count(f"<td>{status}</td>") == 1 and text.count("<td>rejected: too_few_impacts</td>") == 1


def test_two_channels_of_one_record_have_a_row_each():
    row = {
        "turnout_id": "t", "kind": "passage", "path": "t/p.h5", "record": 0, "reason_code": "dead_channel",
        "remedy": "Check the cable", "n_alike": 2,
    }  # fmt: skip
    dead = [row | {"channels": [c], "place": f"channel '{c}'", "found": f"{c} is constant"} for c in ("A7", "A8")]
    text = page(quarantine=dead)
    assert "<td>A7 is constant</td>" in text and "<td>A8 is constant</td>" in text and "records:" not in text


def test_the_diagram_shows_hammer_tests_and_trains_each_by_itself():
    """A chart of trains that cannot tell leaves the green circle of the hammer tests."""
    charts = [
        {"section_id": "t/A7", "source": source, "state": state, "band": band}
        for source, state, band in (("hammer", "ok", "ballast"), ("passage", "cannot tell", "amplitude"))
    ]
    text = page(chart_states=charts)
    assert re.search(r'<circle class="state-ok"[^>]*><title>A7, CP panel: hammer tests ok<', text)
    assert re.search(r'<rect class="state-unknown"[^>]*><title>A7: trains cannot tell<', text)
    assert "a square that of accelerations under trains" in text
    alone = page(chart_states=charts[:1])
    assert '<rect class="state' not in alone and "a square" not in alone


def test_the_page_states_what_was_found_first_and_what_it_rests_on_in_a_detail():
    row = {
        "turnout_id": "t", "section_id": "t/A7", "sections": "A7", "band": "ballast", "state": "inspect this week",
        "change_pct": -9.0, "sentence": "ballast resonance of A7 fell", "look_at": "the void",
        "changed_component": None, "diagnosis": "hanging sleeper at 36.0 m; 24 hammer tests; 2 trains fit by 12.4 %",
    }  # fmt: skip
    text = page(worklist=[row])
    assert "Diagnosis: hanging sleeper at 36.0 m<br>" in text
    assert "</summary>24 hammer tests; 2 trains fit by 12.4 %</details>" in text
    assert "its value counts" not in text and "its value counts" in page(worklist=[row | {"changed_component": "pad"}])


def test_faults_of_a_file_with_other_remedies_have_rows_of_their_own_and_those_of_records_come_first():
    """The page of a file that was cut off showed the last fault alone, "add the line break if it is whole"."""
    row = {
        "turnout_id": "t", "kind": "hammer", "path": "t/A7_1.csv", "record": None, "reason_code": "truncated",
        "place": "line 408", "found": "the last line has no line break", "remedy": "add it", "n_alike": 3,
    }  # fmt: skip
    cut = row | {"place": "record 1 of 1", "found": "389 of 3000 samples", "remedy": "copy 3000 samples again"}
    fewer = row | {"place": "record 2 of 10", "found": "1 of 10 records", "remedy": "correct the layout"}
    text = page(quarantine=[row, fewer, cut])
    found = [text.index(f"<td>{words}</td>") for words in ("389 of 3000 samples", "1 of 10 records", row["found"])]
    assert found == sorted(found) and text.count("<td>t/A7_1.csv</td>") == 3
    alike = [cut | {"place": f"record {k} of 4", "remedy": f"copy {k} samples again"} for k in (1, 2, 3)]
    assert "<td>3 records: 1 to 3</td>" in page(quarantine=alike)


def test_resonances_that_were_not_used_stand_in_the_order_of_their_frequencies():
    detail = "701 Hz not used: too weak; 99 Hz not used: damping too high"
    text = page(models=[REJECTED | {"status": "accepted", "reason": None, "detail": detail}], receptances=[])
    assert "99 Hz not used: damping too high; 701 Hz not used: too weak" in text


def test_a_campaign_of_the_night_has_the_name_of_its_folder():
    """00:30 local time on 13 May is 22:30 UTC on 12 May; raw/t/hammer/2026-05-13 holds the files."""
    model = REJECTED | {"campaign_id": "t/2026-05-13", "measured_at_utc": datetime(2026, 5, 12, 22, 30)}
    used = model | {"model_id": "old", "status": "accepted", "reason": None, "detail": None}
    earlier = {
        "section_id": "t/A7", "campaign_id": "t/2026-04-13", "measured_at_utc": datetime(2026, 4, 12, 22, 30),
        "reason": "low_coherence", "detail": None,
    }  # fmt: skip
    text = page(models=[used], receptances=[RECEPTANCE], unused=[earlier])
    assert "latest campaign 2026-05-13" in text and "Latest hammer test, 2026-05-13" in text
    assert "2026-04-13 (low coherence)" in text
    assert "2026-05-12" not in text and "2026-04-12" not in text
