"""The command events: the list of maintenance and its effect, of all turnouts, of one, or of one section."""

import json

import duckdb
import pytest

from turnout.cli.main import main

LAYOUT = """
sections:
  A7: {panel: CP, track: main, position: 1.5}
  A8: {panel: CP, track: main, position: 2.5}
hammer:
  files: "hammer/{campaign}/{section}_{test}.{ext}"
  rate: 5000
  force: force
  response: rail
  channels:
    force: {source: force, quantity: force, unit: N}
    rail: {source: rail, quantity: acceleration, unit: m/s²}
"""
EVENTS = """turnout,section,date,kind,note
t1,,2026-01-05,tamping,
t1,A7,2026-02-05T14:30,grinding,after the test of that day
t1,A8,2026-03-05,pad_exchange,
t2,A7,2026-04-05,tamping,
"""
EFFECTS = """create table maintenance_effect as
    select *, timestamp '2026-04-02 14:30' as event_at_utc, 'ballast' as band, 'tamping' as kinds, 'stiffer' as verdict,
        3.0 as gain_pct, 2.0 as gain_low_pct, 4.0 as gain_high_pct, 8 as n_before, 3 as n_after,
        null::timestamp as held_until_utc, timestamp '2026-06-01 09:00' as last_measured_at_utc
    from (values ('t1', 't1/A7'), ('t1', 't1/A8'), ('t2', 't2/A7')) as of_section (turnout_id, section_id)"""


@pytest.fixture
def project(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config/layouts").mkdir(parents=True)
    (tmp_path / "config/layouts/main.yaml").write_text(LAYOUT)
    (tmp_path / "config/turnouts.tsv").write_text("turnout\tlayout\nt1\tmain\nt2\tmain\nt3\tmain\n")
    (tmp_path / "config/events.csv").write_text(EVENTS)

    def registry(folder):
        connection = duckdb.connect()
        connection.execute("create table turnouts as select 't1' as turnout_id union select 't2' union select 't3'")
        connection.execute("create table events as select 't9' as turnout_id")
        connection.execute("create table sections as select 't1' as turnout_id, unnest(['A7', 'A8']) as label")
        connection.execute(EFFECTS)
        return connection

    monkeypatch.setattr("turnout.registry.database.open_registry", registry)


@pytest.mark.parametrize(
    ("id", "days"),
    [
        ((), ["2026-01-05", "2026-02-05", "2026-03-05", "2026-04-05"]),
        (("t1",), ["2026-01-05", "2026-02-05", "2026-03-05"]),
        (("t1/A7",), ["2026-01-05", "2026-02-05"]),
        (("t3",), []),
    ],
)
def test_the_list_is_of_all_turnouts_or_of_the_one_that_is_named(project, capsys, id, days):
    """Work on the whole turnout is work on each of its sections."""
    assert main(["events", *id, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert [e["at"][:10] for e in answer["result"]] == days
    assert [line[:10] for line in answer["text"]] == days or "no event of t3 yet" in answer["text"][0]


def test_work_with_a_time_of_day_is_listed_with_it(project, capsys):
    assert main(["events"]) == 0 and main(["events", "--effect"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("2026-01-05   ") and lines[1].startswith("2026-02-05 14:30 ")
    assert lines[-1].startswith("2026-04-02 14:30 t2/A7 ballast, tamping: stiffer")


@pytest.mark.parametrize(
    ("id", "sections"),
    [((), ["t1/A7", "t1/A8", "t2/A7"]), (("t1",), ["t1/A7", "t1/A8"]), (("t1/A8",), ["t1/A8"]), (("t9",), [])],
)
def test_the_effect_is_that_of_the_turnout_that_is_named(project, capsys, id, sections):
    """t9 was removed; its events are still known."""
    assert main(["events", *id, "--effect", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert [row["section_id"] for row in answer["result"]] == sections
    assert len(answer["text"]) == max(len(sections), 1)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["t11"], "turnout 't11' is not known. Did you mean 't1'?"),
        (["t11", "--effect"], "turnout 't11' is not known. Did you mean 't1'?"),
        (["t1/A9"], "turnout 't1' has no section 'A9'. Allowed: A7, A8."),
        (["t1/A9", "--effect"], "turnout 't1' has no section 'A9'. Allowed: A7, A8."),
        (["t1", "tamping"], "a kind without a date. Write: turnout events ID KIND DATE."),
        (["t1", "tamping", "2026-05-01", "--effect"], "'tamping' beside --effect. Enter the work first"),
    ],
)
def test_what_is_neither_a_list_nor_an_entry_is_an_error(project, capsys, words, message):
    assert main(["events", *words]) == 2 and message in capsys.readouterr().err
