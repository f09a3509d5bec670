"""Entries of a raw folder that cannot be used: each is a reported problem, and every correct file gives a unit."""

import errno
import os

import pytest

from turnout.config import load_configuration
from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawDescription
from turnout.workflow.plan import read_plan, read_problems, write_plans
from turnout.workflow.scan import RawFolder

LAYOUT = """\
sections: {A: {panel: CP, track: main, position: 1}}
hammer:
  files: "hammer/{campaign}/{section}_{test}.uff"
  force: force
  response: rail
  channels:
    force: {source: 0, quantity: force}
    rail: {source: 1, quantity: acceleration}
"""
DAY = "hammer/2024-05-13"


@pytest.fixture
def fleet(tmp_path):
    (tmp_path / "config/layouts").mkdir(parents=True)
    (tmp_path / "config/layouts/main.yaml").write_text(LAYOUT)
    (tmp_path / "config/turnouts.tsv").write_text("turnout\tlayout\nt1\tmain\nt2\tmain\n")
    for turnout in ("t1", "t2"):
        (tmp_path / "raw" / turnout / DAY).mkdir(parents=True)
        (tmp_path / "raw" / turnout / DAY / "A_1.uff").write_bytes(b"x")
    return tmp_path


def planned(fleet):
    """(turnouts with units, problems as path, place and message)."""
    write_plans(load_configuration(fleet / "config"), fleet / "raw", fleet / "plan", 1, accept_vanished=True)
    units = [p.unit for p in read_plan(fleet / "plan/00of01.json")]
    problems = [(p["path"], p["where"], p["found"]) for _, p in read_problems(fleet / "plan/00of01.json")]
    return [u.turnout for u in units], problems


@pytest.mark.parametrize(
    ("link", "target", "place", "found"),
    [
        (f"{DAY}/A_2.uff", "A_2.uff", "entry", os.strerror(errno.ELOOP)),
        (f"{DAY}/A_2.uff", "A_1.uff/x", "entry", os.strerror(errno.ENOTDIR)),
        (f"{DAY}/A_2.uff", "nothing", "link", "leads to nothing"),
        ("hammer/up", "..", "link", "leads back to a folder that it lies in"),
        ("hammer/root", "../..", "link", "leads back to a folder that it lies in"),
    ],
)
def test_a_broken_or_circular_link_is_a_problem(fleet, link, target, place, found):
    (fleet / "raw/t1" / link).symlink_to(target)
    assert planned(fleet) == (["t1", "t2"], [(f"t1/{link}", place, found)])


@pytest.mark.parametrize("content", [(), ("x",)])
def test_a_folder_with_the_name_of_a_recording_is_a_problem(fleet, content):
    folder = fleet / "raw/t1" / DAY / "A_2.uff"
    folder.mkdir()
    for name in content:
        (folder / name).touch()
    turnouts, problems = planned(fleet)
    assert turnouts == ["t1", "t2"]
    assert problems[0] == (f"t1/{DAY}/A_2.uff", "folder", "is a folder with the name of a recording")
    assert len(problems) == 1 + len(content)


def test_two_links_to_the_folder_of_the_other_are_followed_once(fleet):
    for name, other in (("a", "b"), ("b", "a")):
        (fleet / "raw/t1" / name).mkdir()
        (fleet / "raw/t1" / name / "over").symlink_to(f"../{other}")
    turnouts, problems = planned(fleet)
    assert turnouts == ["t1", "t2"]
    assert [path for path, *_ in problems] == ["t1/a/over/over", "t1/b/over/over"]


def test_a_link_to_another_folder_of_the_raw_root_is_followed(fleet):
    (fleet / "raw/t1/hammer/2024-06-13").symlink_to("../../t2/hammer/2024-05-13")
    assert planned(fleet) == (["t1", "t1", "t2"], [])


def test_a_name_that_is_not_utf8_is_a_problem_with_an_escaped_path(fleet):
    with open(os.fsencode(fleet / "raw/t1" / DAY) + b"/Pr\xfcfung.uff", "wb"):
        pass
    os.mkdir(os.fsencode(fleet / "raw/t2") + b"/\xe4lter")
    turnouts, problems = planned(fleet)
    assert turnouts == ["t1", "t2"]
    assert problems == [
        (f"t1/{DAY}/Pr\\xfcfung.uff", "name", "is not UTF-8"), ("t2/\\xe4lter", "name", "is not UTF-8"),
    ]  # fmt: skip


def closed(*_, **__):
    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def test_a_file_whose_status_cannot_be_read_is_a_problem(fleet):
    class Closed:
        """An entry of a folder that can be listed but not entered, as root can enter every folder."""

        def stat(self):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    folder = RawFolder(fleet / "raw", "t1")
    assert folder.stat("hammer/A_1.uff", Closed()) is None
    assert [(p.path, p.problem, p.remedy, p.reason) for p in folder.problems] == [
        ("t1/hammer/A_1.uff", "Permission denied", "Correct its permissions", "no_access"),
    ]  # fmt: skip


def test_a_file_without_read_permission_is_planned_after_it_gets_the_permission(fleet, monkeypatch):
    """Its permission changes neither its size nor its time, but the plan must change."""
    path = fleet / f"raw/t1/{DAY}/A_1.uff"
    path.chmod(0o600)
    monkeypatch.setattr(
        "turnout.workflow.scan.os.access", lambda path, mode: "t1" not in path
    )  # as root can read every file
    turnouts, problems = planned(fleet)
    assert turnouts == ["t2"] and problems == [(f"t1/{DAY}/A_1.uff", "file", "may not be read")]
    assert [p["reason"] for _, p in read_problems(fleet / "plan/00of01.json")] == ["no_access"]
    path.chmod(0o644)
    assert planned(fleet) == (["t1", "t2"], [])


def test_notes_without_read_permission_are_stated_as_such(fleet, monkeypatch):
    (fleet / "raw/t1/campaigns.csv").write_text("campaign\n")
    monkeypatch.setattr("turnout.config.csv_table.read_regular", closed)  # root can read every file
    planned(fleet)
    problems = {p["path"]: p["reason"] for _, p in read_problems(fleet / "plan/00of01.json")}
    assert problems["t1/campaigns.csv"] == "no_access"


def test_a_recording_without_read_permission_is_stated_as_such(tmp_path, monkeypatch):
    (tmp_path / "a.uff").write_bytes(b"x")
    monkeypatch.setattr("pathlib.Path.open", closed)
    with pytest.raises(ReadError, match="Correct its permissions") as caught:
        read("a.uff", tmp_path, RawDescription(channels=()))
    assert caught.value.reason == "no_access"


def test_notes_that_cannot_be_read_are_a_problem(fleet):
    (fleet / "raw/t1/campaigns.csv").mkdir()
    turnouts, problems = planned(fleet)
    assert turnouts == ["t1", "t2"]
    assert [(path, found) for path, _, found in problems] == [("t1/campaigns.csv", "Is a directory")]


def test_a_file_in_place_of_the_folder_of_a_turnout_is_a_problem(fleet):
    (fleet / "raw/t1").rename(fleet / "away")
    (fleet / "raw/t1").write_bytes(b"")
    turnouts, problems = planned(fleet)
    assert turnouts == ["t2"]
    assert problems[0] == ("t1", "folder", "Not a directory")


@pytest.mark.parametrize("name", ["Campaigns.csv", "campaign.csv", "trains.CSV"])
def test_a_table_with_a_misspelt_name_is_reported(fleet, name):
    (fleet / "raw/t1" / name).write_bytes(b"x")
    write_plans(load_configuration(fleet / "config"), fleet / "raw", fleet / "plan", 1, accept_vanished=True)
    (problem,) = [p for _, p in read_problems(fleet / "plan/00of01.json")]
    table = "trains.csv" if "train" in name else "campaigns.csv"
    assert problem["path"] == f"t1/{name}" and problem["remedy"].startswith(f"If it is the table {table}, rename it")
