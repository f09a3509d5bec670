"""Tables that users edit: every faulty entry is reported, and no row is lost because of a fault in another."""

import resource
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest

from turnout.cli.main import main
from turnout.config import load_configuration
from turnout.config.acknowledgements import read_acknowledgements
from turnout.config.campaign_notes import read_campaigns, read_trains
from turnout.config.events import read_events
from turnout.config.table_edits import added_row
from turnout.config.turnouts_table import ROW
from turnout.registry import schema as registry_schema

HEADER = "turnout,section,date,kind,resets,note\n"


def events(folder, text):
    path = folder / "events.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    found, errors, _ = read_events(path, "config/events.csv", None, {})
    return [(e.turnout, e.resets, e.note) for e in found], [str(e) for e in errors]


def test_an_unknown_column_of_events_csv_is_an_error(tmp_path):
    _, errors = events(tmp_path, "turnout,section,date,kind,reset,note\nt1,,2025-01-01,sensor_change,none,same type\n")
    assert errors == [
        "config/events.csv, line 1, column 27: unknown column 'reset'. "
        "Did you mean 'resets'? Allowed: date, kind, note, resets, section, turnout."
    ]


def test_a_repeated_column_is_an_error(tmp_path):
    _, errors = events(tmp_path, "turnout,section,date,kind,note,note\n")
    assert errors == ["config/events.csv, line 1, column 32: column 'note' for the second time. Keep one of them."]


def test_an_unclosed_quote_affects_no_other_row(tmp_path):
    rows = 't2,,2025-11-05,tamping,,"machine 09-3X\nt1,A7,2025-11-06,pad_exchange,,"a, b"\n'
    found, errors = events(tmp_path, HEADER + rows)
    assert found == [("t1", ("railpad",), "a, b")]
    assert len(errors) == 1 and "line 2, column 1: a double quote that is not closed in its line" in errors[0]


@pytest.mark.parametrize("row", ["t1;;2025-01-01;tamping;;", "t1\t\t2025-01-01\ttamping"])
def test_a_row_with_another_separator_is_reported(tmp_path, row):
    found, errors = events(tmp_path, f"{HEADER}{row}\nt2,,2025-01-02,tamping,,a; b\n")
    separator = "semicolons" if ";" in row else "tabs"
    assert errors == [
        f"config/events.csv, line 2, column 1: {separator} between the columns. Put commas between the columns, and a "
        "point before decimals."
    ]
    assert [note for *_, note in found] == ["a; b"]


def test_letters_behind_a_closed_quote_are_an_error(tmp_path):
    found, errors = events(tmp_path, HEADER + 't2,,2025-11-05,tamping,,"machine" 09\n')
    assert not found and "line 2, column 1: ',' expected after '\"'. Write each row in one line" in errors[0]


def test_a_byte_that_is_not_utf8_is_reported_with_line_and_column(tmp_path):
    found, errors = events(tmp_path, (HEADER + "t1,,2025-11-05,tamping,,Århus\n").encode("latin-1"))
    assert not found
    assert errors == ["config/events.csv, line 2, column 25: a byte that is not UTF-8. Save the file as UTF-8."]


def test_byte_order_mark_empty_columns_and_line_ends_of_a_spreadsheet_are_accepted(tmp_path):
    text = '\ufeff"turnout",section,date,kind,resets,note,,\r\n\r\nt1,,2025-11-05,tamping,,a\u2028b,,\r\n'
    assert events(tmp_path, text) == ([("t1", ("ballast",), "a\u2028b")], [])


def test_a_suppression_without_a_column_for_its_end_is_not_used(tmp_path):
    path = tmp_path / "acknowledgements.csv"
    path.write_text("turnout,section,band,action,by,at,untill,reason\nt1,,,suppress,me,2026-01-01,2026-02-01,x\n")
    rows, errors = read_acknowledgements(path)
    assert rows == [] and "unknown column 'untill'. Did you mean 'until'?" in str(errors[0])


def test_a_suppression_needs_the_day_on_which_it_ends(tmp_path):
    """Without an end it would hide every alarm of the section for ever."""
    path = tmp_path / "acknowledgements.csv"
    seen = "t1,,,acknowledge,me,2026-01-01,,seen"
    path.write_text(f"turnout,section,band,action,by,at,until,reason\n{seen}\nt1,,,suppress,me,2026-01-01,,x\n")
    rows, errors = read_acknowledgements(path)
    assert [row["action"] for row in rows] == ["acknowledge"]
    assert len(
        errors
    ) == 1 and "line 3, column 29: until is empty. Write the day from which the alarm is shown again" in str(errors[0])


def test_an_unknown_name_of_the_temperature_column_is_reported_and_the_other_cells_are_used(tmp_path):
    path = tmp_path / "campaigns.csv"
    path.write_text("campaign,started_at_utc,rail_temp_c\n2024-05-13,2024-05-13T09:30,18.5\n")
    campaigns, errors = read_campaigns(path, "t1/campaigns.csv")
    assert list(campaigns) == ["2024-05-13"]
    assert "line 1, column 25: unknown column 'rail_temp_c'. Did you mean 'rail_temperature_c'?" in str(errors[0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("passed_at_utc;train_type\n2024-05-13T10:00;IC3\n", "line 1, column 1: semicolons between the columns"),
        ("passed_at_utc,axle_load\n", "unknown column 'axle_load'. Did you mean 'axle_load_t'?"),
        ("passed_at_utc,speed\n", "unknown column 'speed'. Did you mean 'speed_kmh'?"),
        ("passed_at_utc\n2024-05-13 noon\n", "line 2, column 1: passed_at_utc is '2024-05-13 noon'. Write YYYY"),
        ("passed_at_utc\n2024-05-13T10:00+02:00\n", "with a time zone. Write the time in UTC"),
        ("passed_at_utc,train_type\n2024-05-13T10:00,IC3,x\n", "line 2, column 22: more cells than columns"),
        ("passed_at_utc,speed_kmh\n2024-05-13T10:00,16O\n", "column 18: speed_kmh is '16O'. Write a number from 1"),
        ("passed_at_utc,axle_load_t\n2024-05-13T10:00,22500\n", "axle_load_t is '22500'. Write a number from 0.1"),
        ("passed_at_utc,n_axles\n2024-05-13T10:00,-8\n", "n_axles is '-8'. Write a whole number from 1 to 2000"),
        ("passed_at_utc,n_axles\n2024-05-13T10:00,8.5\n", "n_axles is '8.5'. Write a whole number from 1 to 2000"),
        ("passed_at_utc,track\n2024-05-13T10:00,left\n", "track is 'left'. Write main or diverging, or nothing"),
    ],
)
def test_trains_that_cannot_be_used_are_reported(tmp_path, text, message):
    path = tmp_path / "trains.csv"
    path.write_text(text)
    trains, errors = read_trains(path, "t1/trains.csv")
    assert len(errors) == 1 and message in str(errors[0])
    # a cell beside a valid time counts as empty, and the train is used
    usable = ",2024-05-13T10:00," in text.replace("\n", ",") and "more cells" not in message
    assert [set(train.values()) for train in trains] == [{"2024-05-13T10:00", ""}] * usable


def test_a_train_that_is_listed_twice_is_used_once(tmp_path):
    path = tmp_path / "trains.csv"
    rows = "2024-05-13T10:00,main,8\n2024-05-13T10:00,diverging,16\n2024-05-13T10:00:00Z,main,12\n"
    path.write_text("passed_at_utc,track,n_axles\n" + rows)
    trains, errors = read_trains(path, "t1/trains.csv")
    assert [train["n_axles"] for train in trains] == ["8", "16"]
    assert "line 4, column 1: a train at 2024-05-13T10:00:00Z for the second time. Keep one" in str(errors[0])


def test_trains_may_have_further_columns(tmp_path):
    path = tmp_path / "trains.csv"
    path.write_text("train_number,passed_at_utc,train_type\n814,2024-05-13T10:00:00Z,IC3\n")
    trains, errors = read_trains(path, "t1/trains.csv")
    assert [dict(t) for t in trains] == [
        {"train_number": "814", "passed_at_utc": "2024-05-13T10:00:00Z", "train_type": "IC3"}
    ] and not errors


@pytest.fixture
def config(tmp_path, repository, monkeypatch):
    import shutil

    shutil.copytree(repository / "config", tmp_path / "config", ignore=shutil.ignore_patterns("overrides"))
    monkeypatch.chdir(tmp_path)
    return tmp_path / "config"


EVENT = ["events", "tommerup_s1", "tamping", "2026-04-02"]
ACK = ["acknowledge", "tommerup_s1", "--by", "M. Jensen", "--reason", "seen", "--at", "2026-03-01"]
ADD = ["add", "new", "tommerup"]
ACKNOWLEDGED = "turnout,section,band,action,by,at,until,reason\n"


@pytest.mark.parametrize(
    ("command", "table", "content", "message"),
    [
        (EVENT, "events.csv", (HEADER + "tommerup_s1,,2025-11-05,tamping,,Århus\n").encode("latin-1"), "not UTF-8"),
        (EVENT, "events.csv", b"", "an empty table. Write its header"),
        ([*EVENT, "--resets", "none"], "events.csv", b"turnout,section,date,kind\n", "no column 'resets' for 'none'"),
        ([*EVENT, "--note", "hi"], "events.csv", b"turnout,section,date,kind,resets\n", "no column 'note' for 'hi'"),
        (ACK, "acknowledgements.csv", (ACKNOWLEDGED + "# Århus\n").encode("latin-1"), "not UTF-8"),
        (ACK, "acknowledgements.csv", b"", "an empty table. Write its header"),
        (ACK, "acknowledgements.csv", ACKNOWLEDGED.replace("until", "untill").encode(), "unknown column 'untill'"),
        ([*ACK, "--suppress-until", "2026-05-01"], "acknowledgements.csv", b"turnout,section,band,action,by,at,reason",
         "no column 'until' for '2026-05-01'"),
        (ADD, "turnouts.tsv", "turnout\tlayout\tname\nx\ttommerup\tÅrhus\n".encode("latin-1"), "not UTF-8"),
        (ADD, "turnouts.tsv", b"# nothing yet\n", "an empty table. Write a header"),
        (["add", "#x", "tommerup"], "turnouts.tsv", b"turnout\tlayout\na\ttommerup\n", "no turnout '#x'"),
    ],
)  # fmt: skip
def test_a_command_reports_the_fault_of_a_table_and_does_not_change_it(
    config, capsys, command, table, content, message
):
    (config / "events.csv").unlink()
    (config / table).write_bytes(content)
    assert main(command) == 2
    err = capsys.readouterr().err
    assert message in err and table in err
    assert (config / table).read_bytes() == content


def test_a_rejected_first_event_leaves_no_file(config):
    (config / "events.csv").unlink()
    assert main(["events", "nowhere", "tamping", "2026-04-02"]) == 2 and not (config / "events.csv").exists()


def test_a_new_row_has_the_columns_and_line_ends_of_its_table(config):
    (config / "events.csv").write_bytes(b'"note","date",kind,section,turnout\r\n,2025-04-02,grinding,A8,tommerup_s1')
    (config / "acknowledgements.csv").write_text("reason,until,at,by,action,band,section,turnout\n")
    assert main([*EVENT, "--note", "machine\n09-3X, night"]) == 0
    assert main([*ACK, "--suppress-until", "2026-05-01", "--band", "ballast"]) == 0
    read = load_configuration(config)
    assert [(e.kind, e.note) for e in read.events] == [("grinding", ""), ("tamping", "machine 09-3X, night")]
    (row,) = read.acknowledgements
    assert (row["band"], row["by_whom"], row["reason"], row["action"]) == ("ballast", "M. Jensen", "seen", "suppress")
    assert (
        (config / "events.csv").read_bytes().endswith(b'\r\n"machine 09-3X, night",2026-04-02,tamping,,tommerup_s1\r\n')
    )


@contextmanager
def full_disk():
    """No file may grow beyond 4 kB: for a program this is a disk that becomes full during a write."""
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.parametrize(("name", "tab"), [("events.csv", ","), ("t.tsv", "\t")])
def test_a_table_is_unchanged_if_the_disk_is_full(tmp_path, name, tab):
    path, columns = tmp_path / name, ("turnout", "layout")
    rows = [tab.join(columns), *(tab.join((f"t{k:04d}", "main")) for k in range(800))]
    path.write_text("\n".join(rows) + "\n")
    before = path.read_bytes()
    assert len(before) > 8192
    with (
        pytest.raises(OSError, match="too large"),
        full_disk(),
        added_row(path, {"turnout": "t1", "layout": "main"}, columns),
    ):
        pass
    assert path.read_bytes() == before
    assert files_in(tmp_path) == [name]


def files_in(folder):
    return sorted(p.name for p in folder.iterdir() if p.name != ".lock")


def test_a_row_is_added_after_its_check_and_mode_link_and_other_bytes_stay(tmp_path):
    path, link = tmp_path / "kept" / "events.csv", tmp_path / "events.csv"
    path.parent.mkdir()
    path.write_bytes(b"turnout,section\r\nt1,A7")
    path.chmod(0o640)
    link.symlink_to(path)
    before = path.read_bytes()
    with pytest.raises(KeyError), added_row(link, {"turnout": "t2"}, ("turnout", "section")) as tables:
        assert tables["events.csv"].read_bytes() == before + b"\r\nt2,\r\n"
        assert path.read_bytes() == before  # what another run reads now, or after this process is killed
        raise KeyError
    assert path.read_bytes() == before and files_in(tmp_path) == ["events.csv", "kept"]
    with added_row(link, {"turnout": "t2"}, ("turnout", "section")):
        pass
    assert path.read_bytes() == before + b"\r\nt2,\r\n"
    assert link.is_symlink() and path.stat().st_mode & 0o777 == 0o640
    assert files_in(tmp_path) == ["events.csv", "kept"] and files_in(path.parent) == ["events.csv"]


def test_no_new_table_is_written_for_a_wrong_row(tmp_path):
    with pytest.raises(KeyError), added_row(tmp_path / "events.csv", {"turnout": "t2"}, ("turnout", "section")) as t:
        assert t["events.csv"].read_text() == "turnout,section\nt2,\n"
        raise KeyError
    assert files_in(tmp_path) == []


def test_rows_that_are_added_at_the_same_time_are_all_in_the_table(tmp_path):
    path, columns = tmp_path / "events.csv", ("turnout", "section")

    def enter(k):
        with added_row(path, {"turnout": f"t{k}"}, columns):
            time.sleep(0.01)

    with ThreadPoolExecutor(6) as pool:
        list(pool.map(enter, range(6)))
    assert sorted(path.read_text().split()[1:]) == [f"t{k}," for k in range(6)]


@pytest.mark.parametrize("command", [EVENT, ["add", "t1", "tommerup"]])
def test_a_folder_that_does_not_exist_is_reported_and_not_created(tmp_path, capsys, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    assert main([*command[:4], "--configuration", "nowhere"]) == 2
    err = capsys.readouterr().err
    assert "nowhere" in err and "no such folder" in err and "turnout init" in err
    assert not (tmp_path / "nowhere").exists()


@pytest.mark.parametrize("command", [EVENT, ACK])
def test_an_empty_argument_ends_the_command_before_it_writes(config, capsys, command):
    before = {path: path.read_bytes() for path in config.glob("*.csv")}
    with pytest.raises(SystemExit) as ended:
        main([command[0], "", *command[2:]])
    assert ended.value.code == 2 and "argument 2, behind" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in config.glob("*.csv")} == before


@pytest.mark.parametrize("place", [" ", "/", "/A7", "tommerup_s1/"])
@pytest.mark.parametrize("command", [EVENT, ACK])
def test_an_empty_turnout_or_section_does_not_stand_for_all(config, capsys, command, place):
    """A script whose variable is empty writes such an argument."""
    before = {path: path.read_bytes() for path in config.glob("*.csv")}
    assert main([command[0], place, *command[2:]]) == 2
    assert "Write TURNOUT or TURNOUT/SECTION" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in config.glob("*.csv")} == before


SAME_MAINTENANCE = "t1,A7,2025-11-05,tamping"


@pytest.mark.parametrize(
    ("resets", "other", "message"),
    [
        ("", "", "the same work as in line 2. Remove one of the rows."),
        ("", "ballast", "the same work as in line 2. Remove one of the rows."),  # what tamping resets by default
        ("none", "none", "the same work as in line 2. Remove one of the rows."),
        (
            "ballast",
            "none",
            "line 2 says that the same work resets ballast, this line nothing. Correct one of the rows",
        ),
        ("", "ballast railpad", "the same work resets ballast, this line ballast and railpad. Correct one"),
    ],
)
def test_two_rows_of_the_same_maintenance_are_reported(tmp_path, resets, other, message):
    (tmp_path / "events.csv").write_text(f"{HEADER}{SAME_MAINTENANCE},{resets},\n{SAME_MAINTENANCE},{other},again\n")
    found, errors, warnings = read_events(tmp_path / "events.csv", "events.csv", None, {})
    assert len(found) == 1
    (fault,) = errors if "this line" in message else warnings
    assert str(fault).startswith("events.csv, line 3, column 26: ") and message in str(fault)
    assert len(errors) + len(warnings) == 1


@pytest.mark.parametrize("row", ["t1,A8,2025-11-05,tamping", "t1,,2025-11-05,tamping", "t1,A7,2025-11-05,grinding",
                                 "t1,A7,2025-11-06,tamping", "t2,A7,2025-11-05,tamping"])  # fmt: skip
def test_other_maintenance_is_no_repetition(tmp_path, row):
    (tmp_path / "events.csv").write_text(f"{HEADER}{SAME_MAINTENANCE},,\n{row},,\n")
    found, errors, warnings = read_events(tmp_path / "events.csv", "events.csv", None, {})
    assert len(found) == 2 and not errors and not warnings


def test_a_year_that_lacks_a_digit_is_reported(tmp_path):
    (tmp_path / "events.csv").write_text(f"{HEADER}t1,A7,0225-11-05,tamping,,\n")
    _, errors, (warning,) = read_events(tmp_path / "events.csv", "events.csv", None, {})
    assert not errors and "column 7: date 0225-11-05 is before 1900. Correct its year." in str(warning)


def test_none_together_with_a_resonance_is_an_error(tmp_path):
    (tmp_path / "events.csv").write_text(f"{HEADER}{SAME_MAINTENANCE},none ballast,\n")
    found, (error,), _ = read_events(tmp_path / "events.csv", "events.csv", None, {})
    assert not found and "resets is 'none ballast'. Write the resonances, or 'none' alone." in str(error)


def test_turnouts_tsv_and_the_registry_have_the_same_limits():
    columns = {column.name: column for column in registry_schema.tables()["turnouts"]}
    limits = {name: (key.minimum, key.maximum) for name, key in ROW.items() if name in columns and key.maximum}
    assert {"km", "lat_deg", "lon_deg"} <= set(limits)
    assert limits == {name: (columns[name].minimum, columns[name].maximum) for name in limits}
