"""The comparison lists each result beside the true value, and a run prints one line per stage."""

import json
import sys

import duckdb
import pytest

from turnout.demo.comparison import compare, comparison_table
from turnout.demo.progress import run_with_progress, stage_lines

TRUTH = {
    "turnout": "W1", "days": ["2024-01-01", "2025-01-01", "2026-01-01"],
    "changes": [
        {"section": "A8", "component": "ballast", "since": "2025-01-01", "step": 1.0, "per_year": -0.15, "event": ""},
        {"section": "CLP", "component": "railpad", "since": "2025-01-01", "step": 1.21, "per_year": 0.0,
         "event": "pad_exchange"},
    ],
    "gaps_m": {"ASM": [0.0, 0.0003, 0.0012]},
    "weld": {"section": "OT", "position": -11.7, "since": "2025-11-01", "depth_on_last_day": 0.00032},
    "file_faults": [["W1", 1, "SP", 2, "cut_off"], ["W1", 2, "OT", 1, "swapped_sign"]],
}  # fmt: skip


@pytest.fixture
def truth(tmp_path):
    (tmp_path / "impacts").mkdir()
    (tmp_path / "W1.json").write_text(json.dumps(TRUTH))
    (tmp_path / "W1_passages.json").write_text("[]")
    faults = [
        {"test": 1, "record": 4, "fault": "double_hit", "file_fault": ""},
        {"test": 1, "record": 5, "fault": "double_hit", "file_fault": ""},
        {"test": 2, "record": 4, "fault": "double_hit", "file_fault": "cut_off"},
    ]
    (tmp_path / "impacts/W1_2025-01-01_SP.json").write_text(json.dumps(faults))
    return tmp_path


@pytest.fixture
def connection():
    """The columns that are compared, with one missed file, one missed impact and one false alarm."""
    con = duckdb.connect()
    con.execute("""
        create table listed as from (values
            ('W1', 'W1/A8', 'ballast', -8.0::double, timestamp '2025-01-20', 'inspect this week'),
            ('W1', 'W1/ASM', 'ballast', -30.0, timestamp '2025-01-10', 'inspect this week'),
            ('W1', 'W1/ASM', 'ballast_damping', -50.0, timestamp '2025-01-10', 'inspect this week'),
            ('W1', 'W1/A7', 'railpad', -2.0, timestamp '2025-02-10', 'inspect this week'),
            ('W1', 'W1/A9', 'railpad', null, null, 'cannot tell'),
            ('W1', 'W1/A9', 'ballast', -4.0, timestamp '2025-01-20', 'inspect this week'),
            ('W1', 'W1/OT', 'amplitude', 31.4, timestamp '2025-11-17', 'inspect this week')
        ) t(turnout_id, section_id, band, change_pct, since_at_utc, state);
        create table maintenance_effect as select 'W1/CLP' as section_id, 'railpad' as band,
            timestamp '2025-01-01' as event_at_utc, 10.0::double as gain_pct,
            9.0::double as gain_low_pct, 11.0::double as gain_high_pct;
        create table quarantine_open as
            select 'W1/hammer/2025-01-01/SP_2.uff' as path, 'truncated' as reason_code;
        create table recordings_current as select 'r' as recording_id, 'W1/hammer/2025-01-01/SP_1.uff' as path;
        create table impacts_current as from (values ('r', 4, 'rejected', 'double_hit'), ('r', 5, 'accepted', null))
            t(recording_id, record, status, reason);
        create table findings_newest as select 'W1' as turnout_id, 'named' as verdict, 'A9+ASM' as sections,
            'a hanging sleeper at 36.0 m' as sentence;
        create table change_findings as select 'W1' as turnout_id, 'A9, ASM' as sections,
            'hanging sleeper or local ballast at 36.0 m' as sentence;
    """)
    return con


def test_every_fault_and_change_has_a_row_with_the_result(connection, truth):
    rows = {row.where: row for row in compare(connection, truth, "listed")}
    drift = rows["W1 A8 ballast"]
    assert drift.truth == "stiffness -15 % by 2026-01-01, from 2025-01-01"
    assert drift.found == "inspect this week: frequency -8.0 %, stiffness about -15 %, from 2025-01-20"  # 0.92² = 0.846
    work = rows["W1 CLP railpad"]
    assert work.truth == "stiffness +21 % by 2026-01-01, from 2025-01-01, pad exchange"
    assert work.found == "frequency +10.0 % (+9.0 to +11.0), stiffness about +21 %"  # 1.1² = 1.21
    gap = rows["W1 ASM ballast"]
    assert gap.truth == "hanging sleeper, 1.2 mm by 2026-01-01, first on 2025-01-01"
    assert gap.found.endswith("stiffness about -51 %, from 2025-01-10; diagnosis: a hanging sleeper at 36.0 m")
    diagnosis = rows["W1 ASM diagnosis"]
    assert (diagnosis.truth, diagnosis.found) == (gap.truth, "hanging sleeper or local ballast at 36.0 m")
    assert (
        rows["W1 A8 diagnosis"].found == "no diagnosis" and "W1 CLP diagnosis" not in rows
    )  # its maintenance is recorded
    weld = rows["W1 OT trains"]
    assert weld.truth == "weld at -11.7 m dips by 0.32 mm by 2026-01-01, from 2025-11-01"
    assert weld.found == "inspect this week: weekly peak acceleration +31 %, from 2025-11-17"
    assert rows["W1 SP, test 2"].found == "truncated"
    assert rows["W1 OT, test 1"].found == "nothing (another reason)"
    # A9 is diagnosed together with ASM, which has a hanging sleeper; A7 only with sections without a change
    assert rows["other charts there and beside"].found == "2 alarms: W1/ASM ballast damping, W1/A9 ballast"
    assert rows["all other sections"].found == "1 alarm: W1/A7 railpad"


def test_impacts_of_damaged_files_are_not_counted(connection, truth):
    rows = [(r.truth, r.found) for r in compare(connection, truth, "listed") if r.where == "all turnouts"]
    assert rows == [("2 double impacts", "1 rejected"), ("0 overloaded impacts", "0 rejected")]


def test_columns_are_aligned(connection, truth):
    lines = comparison_table(compare(connection, truth, "listed")).splitlines()
    start = lines[0].index("true")
    assert lines[0].split() == ["where", "true", "found"] and all(line[start - 1] == " " for line in lines)


def test_shards_that_run_at_the_same_time_are_one_line():
    output = ["rule hammer:", "rule hammer:", "Finished jobid: 3 (Rule: hammer)", "Finished jobid: 4 (Rule: hammer)"]
    output += ["localrule all:", "Finished jobid: 0 (Rule: all)"]
    assert list(stage_lines(output, iter([0.0, 1.0, 90.0]).__next__)) == ["hammer tests: 90 s"]


@pytest.mark.parametrize(("code", "expected"), [(0, ["   pages: 0 s"]), (3, ["   pages: 0 s", "more"])])
def test_output_goes_to_the_log_and_a_failure_is_shown(tmp_path, code, expected):
    script = "print('rule report:\\nFinished jobid: 1 (Rule: report)\\nlast words'); raise SystemExit(" + f"{code})"
    printed = []
    log = tmp_path / "logs/run.log"
    assert run_with_progress([sys.executable, "-c", script], log, printed.append) == code
    assert "last words" in log.read_text() and printed[0] == expected[0]
    assert len(printed) == (1 if code == 0 else 3) and (code == 0 or "last words" in printed[1])
