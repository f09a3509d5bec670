"""Rows beside the recordings that a command cannot use are stated by every command that reads these tables."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from turnout.cli.main import main

LAYOUT = """
sections:
  A7: {panel: CP, track: main, position: 5.4}
passages:
  files: "{time}.csv"
  rate: 5000
  channels:
    A7: {source: web, quantity: acceleration, unit: m/s², mounting: rail web, section: A7}
"""
COMMANDS = {
    "twin": ["--turnout", "t1"],
    "diagnose": ["--turnout", "t1"],
    "compare": ["raw/t1/20260501T090000Z.csv", "--turnout", "t1"],
    "trains": ["--turnouts", "t1"],
}


@pytest.fixture
def site(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in {
        "config/turnouts.tsv": "turnout\tlayout\nt1\tmain\n",
        "config/layouts/main.yaml": LAYOUT,
        "config/events.csv": "turnout,section,date,kind\nt11,A7,2026-04-20,tamping\n",
        "raw/t1/20260501T090000Z.csv": "web\n0\n",
    }.items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(text)
    return tmp_path


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("trains.csv", "time,type\n2026-05-01T09:00,ic3\n", "no column 'passed_at_utc'"),
        ("trains.csv", "passed_at_utc,train_type\n1.5.2026 9:00,ic3\n", "1.5.2026 9:00"),
        ("campaigns.csv", "day,rail_temperature_c\n2026-05-01,12\n", "day"),
    ],
)
def test_a_table_that_cannot_be_used_is_stated_with_its_name(site, capsys, command, name, text, expected):
    (site / "raw" / "t1" / name).write_text(text)
    main([command, *COMMANDS[command]])
    lines = [line for line in capsys.readouterr().err.splitlines() if name in line]
    assert len(lines) == 1 and expected in lines[0]


@pytest.mark.parametrize("command", COMMANDS)
def test_with_json_the_warnings_are_in_its_object(site, capsys, command):
    (site / "raw" / "t1" / "trains.csv").write_text("time,type\n")
    main([command, *COMMANDS[command], "--json"])
    warnings = json.loads(capsys.readouterr().out)["warnings"]
    assert [w for w in warnings if "trains.csv" in w]


@pytest.mark.parametrize("command", COMMANDS)
def test_good_tables_give_no_warning(site, capsys, command):
    (site / "raw" / "t1" / "trains.csv").write_text("passed_at_utc,train_type,wagons\n2026-05-01T09:00,ic3,4\n")
    (site / "raw" / "t1" / "campaigns.csv").write_text(
        "campaign,started_at_utc,rail_temperature_c\n2026-05-01,2026-05-01T09:00,12\n"
    )
    main([command, *COMMANDS[command]])
    text = capsys.readouterr().err
    assert "trains.csv" not in text and "campaigns.csv" not in text


def test_a_diagnosis_states_recordings_that_are_dated_in_the_future(site, capsys):
    ahead = datetime.now(UTC) + timedelta(days=40)
    (site / "raw" / "t1" / f"{ahead:%Y%m%d}T090000Z.csv").write_text("web\n0\n")
    main(["diagnose", "--turnout", "t1"])
    assert f"{ahead:%Y-%m-%d} is in the future" in capsys.readouterr().err
