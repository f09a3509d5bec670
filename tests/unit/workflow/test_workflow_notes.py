"""`turnout check` compares campaigns.csv and trains.csv with the recording files."""

from datetime import datetime, timedelta

import pytest

from turnout.cli.main import main

HEADER = "campaign,started_at_utc,rail_temperature_c\n"


@pytest.fixture
def raw(tmp_path, repository, monkeypatch):
    """The raw folder of the first of two turnouts, with the files of two campaigns."""
    import shutil

    shutil.copytree(repository / "config", tmp_path / "config", ignore=shutil.ignore_patterns("overrides"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config/turnouts.tsv").write_text("turnout\tlayout\traw\ntommerup_s1\ttommerup\tline_7/s1\n")
    (tmp_path / "config/events.csv").unlink(missing_ok=True)
    (tmp_path / "config/acknowledgements.csv").unlink(missing_ok=True)
    for campaign in ("2024-05-13", "2024-09-02"):
        folder = tmp_path / "raw/line_7/s1/hammer" / campaign
        folder.mkdir(parents=True)
        for name in ("A7_1.uff", "A8_1.uff"):
            (folder / name).write_bytes(b"x")
    return tmp_path / "raw/line_7/s1"


def check_lines(capsys):
    code = main(["check"])
    return code, [
        line.strip()
        for line in capsys.readouterr().out.splitlines()
        if ".csv, " in line and "rail temperatures:" not in line
    ]


def test_campaigns_that_agree_with_the_files_give_no_message(raw, capsys):
    assert check_lines(capsys) == (0, [])  # no notes at all give no message
    (raw / "campaigns.csv").write_text(f"{HEADER}2024-05-13,2024-05-13T09:00,12\n20240902,2024-09-02T09:00,14\n")
    assert check_lines(capsys) == (0, [])


@pytest.mark.parametrize(
    "text", [None, "campaign,started_at_utc\n2024-05-13,2024-05-13T09:00\n2024-09-02,2024-09-02T09:00\n"]
)
def test_a_turnout_without_any_rail_temperature_has_a_remark(raw, capsys, text):
    """It is no fault, as recordings may state it. The file may be missing, elsewhere, or lack the column."""
    if text:
        (raw / "campaigns.csv").write_text(text)
    code = main(["check"])
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "rail temperature" in line)
    assert code == 0 and line.startswith("  line_7/s1/campaigns.csv, rail temperatures: ")
    assert ("no such file" if text is None else "no column rail_temperature_c") in line
    (raw / "campaigns.csv").write_text(f"{HEADER}2024-05-13,2024-05-13T09:00,12\n2024-09-02,2024-09-02T09:00,\n")
    assert main(["check"]) == 0 and "rail temperature" not in capsys.readouterr().out


def readable_tests(raw, temperature):
    """Hammer tests of the newest campaign that state this rail temperature, or none with None."""
    for section in ("A7", "A8"):
        path = raw / "hammer/2024-09-02" / f"{section}_1.uff"
        path.unlink()
        noted = [] if temperature is None else ["--temperature", str(temperature)]
        command = ["simulate", "hammer", "--section", section, "--impacts", "1", "--at", "2024-09-02T09:00", *noted]
        assert main([*command, "--turnout", "tommerup_s1", "--out", str(path)]) == 0


@pytest.mark.parametrize("temperature", [None, 14.0])
def test_a_turnout_whose_recordings_state_no_temperature_either_has_a_problem(raw, capsys, temperature):
    readable_tests(raw, temperature)
    capsys.readouterr()
    code, printed = main(["check"]), capsys.readouterr().out
    assert code == (1 if temperature is None else 0)
    problem = "there is no such file, and the recordings of 2024-09-02 state no rail temperature"
    assert (problem in printed) == (temperature is None) == ("1 problem." in printed)


def test_temperatures_of_other_days_than_those_of_the_files_are_named(raw, capsys):
    (raw / "campaigns.csv").write_text(f"{HEADER}2024-05-14,2024-05-14T09:00,12\n")
    main(["check"])
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "rail temperatures:" in line)
    assert "it has a rail temperature of 2024-05-14 only, and no hammer file is of such a campaign" in line


@pytest.mark.parametrize(
    ("value", "expected"), [("59", "in °F it would be 15 °C"), ("-15", "is 14 °C. Correct"), ("35", None)]
)
def test_a_temperature_far_from_its_season_has_a_remark(raw, capsys, value, expected):
    rows = [f"202{year}-05-13,202{year}-05-13T09:00,{12 + 2 * year}\n" for year in range(3)]
    (raw / "campaigns.csv").write_text(HEADER + "".join(rows) + f"2024-05-13,2024-05-13T09:00,{value}\n")
    main(["check"])
    lines = [line for line in capsys.readouterr().out.splitlines() if "the other campaigns of its season" in line]
    assert len(lines) == (expected is not None)
    if expected:
        assert f"campaign 2024-05-13 has a rail temperature of {value} °C" in lines[0] and expected in lines[0]


def test_a_campaign_without_files_and_files_without_a_campaign_are_reported(raw, capsys):
    rows = "2024-05-13,2024-05-13T09:00,12\n\n2024-09-20,2024-09-20T09:00,14\n"
    (raw / "campaigns.csv").write_text(HEADER + rows)
    code, lines = check_lines(capsys)
    assert code == 1 and lines == [
        "line_7/s1/campaigns.csv, line 4, column 1: no hammer file is of campaign 2024-09-20. Correct its day, put its "
        "files there, or remove the row.",
        "line_7/s1/campaigns.csv, line 1: no row for campaign 2024-09-02, of which there are 2 files: it counts as "
        "measured at noon, without a rail temperature. Add a line '"
        "2024-09-02,<start in UTC>,<rail temperature in °C>'.",
    ]


@pytest.mark.parametrize("rows", ["2024-05-13;2024-05-13T09:00;12,5\n", ""])
def test_the_line_to_add_has_the_separator_of_the_table(raw, capsys, rows):
    """Also of a table that has its header alone."""
    (raw / "campaigns.csv").write_text(f"sep=;\ncampaign;started_at_utc;rail_temperature_c\n{rows}")
    line = check_lines(capsys)[1][-1]
    assert line.endswith("Add a line '2024-09-02;<start in UTC>;<rail temperature in °C>'.")


def test_a_row_that_cannot_be_used_is_reported_once(raw, capsys):
    (raw / "campaigns.csv").write_text(f"{HEADER}2024-05-13,2024-05-13T09:00,12\n2024-09-02,2024-09-02T09:00,warm\n")
    code, (lines,) = check_lines(capsys)
    assert code == 1 and "rail_temperature_c is 'warm'" in lines


def passages(raw, seconds):
    """A file at each of these seconds after 10:15."""
    (raw / "passages").mkdir()
    for moment in (datetime(2024, 5, 13, 10, 15) + timedelta(seconds=s) for s in seconds):
        (raw / "passages" / f"{moment:%Y%m%dT%H%M%SZ}.h5").write_bytes(b"x")


TRAINS = (0, 1340, 2950, 4610, 7333, 11020)


@pytest.mark.parametrize("hours", [2, -5])
def test_trains_listed_in_local_time_are_reported(raw, capsys, hours):
    passages(raw, TRAINS)
    times = [datetime(2024, 5, 13, 10 + hours, 15, 20) + timedelta(seconds=s) for s in TRAINS[1:]]
    (raw / "trains.csv").write_text("passed_at_utc\n" + "".join(f"{t:%Y-%m-%dT%H:%M:%S}\n" for t in times))
    code, (lines,) = check_lines(capsys)
    late = "after" if hours > 0 else "before"
    assert code == 1 and lines == (
        f"line_7/s1/trains.csv, column passed_at_utc: of 6 passages none has a train within 90 s, and 5 have one "
        f"{abs(hours)} h {late}. Write passed_at_utc in UTC, not in local time."
    )


@pytest.mark.parametrize("listed", [TRAINS, TRAINS[:1], (600, 5000), ()])
def test_trains_without_recordings_and_recordings_without_trains_give_no_message(raw, capsys, listed):
    """A timetable may contain more trains than were recorded, or fewer."""
    passages(raw, TRAINS)
    times = [datetime(2024, 5, 13, 10, 15, 20) + timedelta(seconds=s) for s in listed]
    (raw / "trains.csv").write_text("passed_at_utc\n" + "".join(f"{t:%Y-%m-%dT%H:%M:%S}\n" for t in times))
    assert check_lines(capsys) == (0, [])
