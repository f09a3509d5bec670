"""``turnout check --read`` reports files whose content contradicts their folder or name, and dates in the future."""

import shutil
from datetime import UTC, datetime, timedelta

import pytest

from turnout.cli.main import main
from turnout.workflow.future_dates import is_future
from turnout.workflow.project import create_project

DAY = "2026-05-13"
HEAD = "campaign,started_at_utc,rail_temperature_c\n"


@pytest.fixture(scope="module")
def template(tmp_path_factory):
    """A project with one turnout, of which two sections were measured at 15 °C."""
    folder = tmp_path_factory.mktemp("filing")
    create_project(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for section in ("A7", "A8"):
            file = f"raw/W1/hammer/{DAY}/{section}_1.csv"
            options = ["--at", f"{DAY}T09:00:00", "--temperature", "15", "--impacts", "2", "--out", file]
            assert main(["simulate", "hammer", "--section", section, *options]) == 0
        files = [f"raw/W1/hammer/{DAY}/{section}_1.csv" for section in ("A7", "A8")]
        assert main(["layout", "new", "--from", *files, "--name", "own"]) == 0
        layout = folder / "config/layouts/own.yaml"
        lines = [line.partition("  # DECIDE")[0] for line in layout.read_text(encoding="utf-8").splitlines()]
        layout.write_text("\n".join(lines) + "\n", encoding="utf-8")
        assert main(["add", "W1", "own"]) == 0
        assert main(["add", "W2", "own"]) == 0
    (folder / "raw/W1/campaigns.csv").write_text(f"{HEAD}{DAY},{DAY}T09:00:00,15\n")
    return folder


@pytest.fixture
def project(template, tmp_path, monkeypatch):
    shutil.copytree(template, tmp_path / "project")
    monkeypatch.chdir(tmp_path / "project")
    return tmp_path / "project"


def check_output(capsys):
    capsys.readouterr()
    return main(["check", "--read"]), capsys.readouterr().out


def test_files_in_the_right_folders_are_reported_to_agree(project, capsys):
    _, printed = check_output(capsys)
    assert "W1, A7: " in printed and printed.count(": agrees: ") == 2


def test_a_file_that_was_recorded_in_another_year_is_reported(project, capsys):
    (project / f"raw/W1/hammer/{DAY}").rename(project / "raw/W1/hammer/2025-05-13")
    (project / "raw/W1/campaigns.csv").write_text(f"{HEAD}2025-05-13,2025-05-13T09:00:00,15\n")
    code, printed = check_output(capsys)
    assert code == 1
    assert printed.count("says it was recorded on 2026-05-13 09:00, and is filed under 2025-05-13 09:00") == 2


@pytest.mark.parametrize("copy", [f"W1/hammer/{DAY}/A8_1.csv", f"W2/hammer/{DAY}/A7_1.csv"])
def test_a_copy_of_the_file_of_another_section_or_turnout_is_reported(project, capsys, copy):
    (project / "raw" / copy).parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(project / f"raw/W1/hammer/{DAY}/A7_1.csv", project / "raw" / copy)
    code, printed = check_output(capsys)
    assert code == 1 and f"{copy}, the file: same bytes as W1/hammer/{DAY}/A7_1.csv" in printed


@pytest.mark.parametrize("noted, is_named", [(59, True), (20, False), (-2, True)])
def test_a_temperature_that_differs_from_that_of_the_file_is_reported(project, capsys, noted, is_named):
    (project / "raw/W1/campaigns.csv").write_text(f"{HEAD}{DAY},{DAY}T09:00:00,{noted}\n")
    _, printed = check_output(capsys)
    assert (f"its rail temperature is 15 °C, that in campaigns.csv {noted} °C" in printed) == is_named


def test_a_fault_of_all_impacts_is_one_line_that_states_the_key_to_change(project, capsys):
    layout = project / "config/layouts/own.yaml"
    text = layout.read_text(encoding="utf-8")
    layout.write_text(text.replace("quantity: force", "quantity: force\n      sign: -1", 1), encoding="utf-8")
    code, printed = check_output(capsys)
    assert code == 1 and printed.count("A7_1.csv, impacts 1, 2: hammer reads -") == 1
    assert printed.count("Look at 'sign' of 'hammer': -1 reverses it") == 2


def test_a_campaign_and_a_train_with_future_dates_are_reported(project, capsys):
    (project / "raw/W1/campaigns.csv").write_text(f"{HEAD}{DAY},{DAY}T09:00:00,15\n2098-05-13,2098-05-13T09:00:00,15\n")
    (project / "raw/W1/trains.csv").write_text("passed_at_utc,train_type\n2098-05-13T10:00:00,IC3\n")
    layout = project / "config/layouts/own.yaml"
    passages = '\npassages:\n  files: "passages/{time}.{ext}"\n  rate: 20000\n  channels:\n'
    channel = "    web: {source: web, quantity: acceleration, unit: m/s², section: A8}\n"
    layout.write_text(layout.read_text(encoding="utf-8") + passages + channel, encoding="utf-8")
    code, printed = check_output(capsys)
    assert code == 1
    assert "campaigns.csv, line 3, column 1: the campaign 2098-05-13 is in the future" in printed
    assert "trains.csv, column passed_at_utc: a train at 2098-05-13T10:00:00, in the future" in printed


def test_a_folder_and_a_file_with_a_name_in_the_future_are_reported(project, capsys):
    """Without a row of campaigns.csv, too. Each day is one line."""
    ahead = datetime.now(UTC) + timedelta(days=40)
    raw = project / "raw" / "W1"
    test = next(path for path in raw.rglob("A7_1.csv"))
    folder = test.parent.with_name(f"{ahead:%Y-%m-%d}")
    folder.mkdir()
    for name in ("A7_1.csv", "A7_2.csv"):
        (folder / name).write_bytes(test.read_bytes() + b"\n" * len(name))
    code, printed = check_output(capsys)
    (line,) = [line for line in printed.splitlines() if f"{ahead:%Y-%m-%d} is in the future" in line]
    assert code == 1 and "A7_1.csv and 1 more" in line and "no visit" in line


def test_a_time_of_tomorrow_in_another_time_zone_is_not_in_the_future():
    now = datetime.now(UTC).replace(tzinfo=None)
    assert not is_future(now + timedelta(hours=14)) and is_future(now + timedelta(days=2))
