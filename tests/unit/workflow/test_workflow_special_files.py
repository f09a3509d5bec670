"""A name that is no regular file, or an error code of one file, affects only that file; other units are computed."""

import errno
import json
import os
import re
import socket
import stat
from datetime import datetime
from types import SimpleNamespace

import pytest
from length_fleet import Fleet, length

from turnout.errors import DATA_ERRNOS, ReadError, is_infrastructure
from turnout.files import sparse_size
from turnout.readers import read
from turnout.records import RawDescription
from turnout.workflow import tasks
from turnout.workflow.plan import read_plan, read_problems
from turnout.workflow.retries import read_postponed
from turnout.workflow.state import load_state
from turnout.workflow.tasks import Stage

OTHERS = {"t0/hammer/A/2024-05-13", "t2/hammer/A/2024-05-13"}
UNIT = "t1/hammer/A/2024-05-13"


def make_socket(path):
    folder = os.getcwd()
    os.chdir(path.parent)  # the name of a socket has at most 107 bytes
    try:
        with socket.socket(socket.AF_UNIX) as end:
            end.bind(path.name)
    finally:
        os.chdir(folder)


def make_device(path):
    try:
        os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 5))  # /dev/zero: reading it never ends
    except PermissionError:
        pytest.skip("only root can create a device file")


def make_sparse_file(path):
    """A file with a size of 1 TB and a content of a few bytes."""
    with path.open("wb") as stream:
        stream.write(b"1 2\n")
        stream.truncate(10**12)


@pytest.mark.parametrize("suffix", ["csv", "uff", "tdms", "h5", "mat", "wav", "lvm", "npz", "parquet"])
def test_a_sparse_file_is_rejected_without_reading_it(tmp_path, suffix):
    make_sparse_file(tmp_path / f"A7_1.{suffix}")
    with pytest.raises(ReadError, match=f"A7_1.{suffix}, the file: it has a size of 1000000000000 bytes") as caught:
        read(f"A7_1.{suffix}", tmp_path, RawDescription(channels=()))
    assert caught.value.reason == "claims_too_much"


def make_dangling_link(path):
    path.symlink_to(path.with_name("nothing"))


# kind: function that creates it, message of the plan, reason
NO_FILES = {
    "sparse file": (make_sparse_file, "has a size of 1000000000000 bytes", "claims_too_much"),
    "dangling link": (make_dangling_link, "leads to nothing", "unreadable"),
    "link in a circle": (lambda path: path.symlink_to(path.name), os.strerror(errno.ELOOP), "unreadable"),
}


@pytest.mark.parametrize("kind", NO_FILES)
def test_the_plan_reports_a_name_without_content_in_every_run_and_all_others_are_computed(fleet, kind):
    make, finding, reason = NO_FILES[kind]
    path = fleet.raw / "t1/2024-05-13/A_1.txt"
    path.unlink()
    make(path)
    for _ in range(2):
        fleet.run()
        assert set(fleet.lengths()) == OTHERS and read_postponed(fleet.state)[1] == {}
        problems = [problem for turnout, problem in read_problems(fleet.plan) if turnout == "t1"]
        assert (problems[0]["path"], problems[0]["reason"]) == ("t1/2024-05-13/A_1.txt", reason)
        assert finding in problems[0]["found"]


SPECIAL = {"socket": make_socket, "pipe": os.mkfifo, "character device": make_device, "folder": os.mkdir}


@pytest.mark.parametrize("kind", [kind for kind in SPECIAL if kind != "folder"])
def test_the_plan_reports_a_special_file_in_every_run_and_all_others_are_computed(fleet, kind):
    path = fleet.raw / "t1/2024-05-13/A_1.txt"
    path.unlink()
    SPECIAL[kind](path)
    for _ in range(3):
        fleet.run()
        assert set(fleet.lengths()) == OTHERS and read_postponed(fleet.state)[1] == {}
        ((turnout, problem), *_) = read_problems(fleet.plan)
        assert (turnout, problem["path"], problem["found"], problem["reason"]) == (
            "t1", "t1/2024-05-13/A_1.txt", f"is a {kind}", "no_file",
        )  # fmt: skip


@pytest.mark.parametrize("kind", SPECIAL)
def test_a_reader_rejects_a_special_file_without_opening_it(tmp_path, kind):
    SPECIAL[kind](tmp_path / "A7_1.uff")
    with pytest.raises(ReadError, match=f"A7_1.uff, the path: it is a {kind}"):
        read("A7_1.uff", tmp_path, RawDescription(channels=()))


@pytest.mark.parametrize("kind", SPECIAL)
def test_a_special_file_that_replaced_a_file_after_the_plan_delays_nothing(fleet, kind):
    fleet.run()
    path = fleet.raw / "t1/2024-05-13/A_1.txt"
    (planned,) = [p for p in read_plan(fleet.plan) if p.unit.turnout == "t1"]
    path.unlink()
    SPECIAL[kind](path)
    assert tasks.contents_of(planned, fleet.raw) == [None]


@pytest.mark.parametrize("name", ["campaigns.csv", "trains.csv"])
def test_a_pipe_in_place_of_notes_does_not_stop_the_plan(fleet, name):
    os.mkfifo(fleet.raw / "t1" / name)
    fleet.run()
    assert set(fleet.lengths()) >= OTHERS
    problems = [problem["found"] for turnout, problem in read_problems(fleet.plan) if turnout == "t1"]
    assert problems == ["it is a pipe, not a file"]


VANISHED_CODES = {errno.ENOENT, errno.ENOTDIR, errno.EISDIR}  # the file is missing: its stage reports it
CODES = dict(enumerate(sorted(errno.errorcode), 1))  # turnout -> every code of this platform; t0 is intact


def code_of(path):
    """The error code with which the file of a turnout fails, 0 for t0."""
    return CODES.get(int(re.search(r"\bt(\d+)", str(path))[1]), 0)


def test_an_error_code_of_one_file_postpones_only_its_unit(tmp_path, monkeypatch):
    """In the first run each file but one fails with its own code when it is hashed; in the second run none fails."""
    fleet, hashed = Fleet(tmp_path, len(CODES) + 1), tasks.sha256_of

    def failing(path):
        if code := code_of(path):
            raise OSError(code, os.strerror(code), str(path))
        return hashed(path)

    monkeypatch.setattr(tasks, "sha256_of", failing)
    fleet.run()
    waiting = read_postponed(fleet.state)[1]
    assert "t0/hammer/A/2024-05-13" in fleet.lengths()
    assert {code_of(unit) for unit in (*waiting, *fleet.lengths())} == {0, *CODES.values()}
    assert all(f"[Errno {code_of(unit)}]" in fault for unit, fault in waiting.items())
    monkeypatch.undo()
    fleet.run()
    assert len(fleet.lengths()) == len(CODES) + 1 and read_postponed(fleet.state)[1] == {}


def test_an_error_code_during_the_computation_is_reported_for_its_unit(tmp_path):
    """Damaged data can cause some of the codes: these give rows of quarantine, the others are machine faults."""
    fleet = Fleet(tmp_path, len(CODES) + 1)

    def failing(unit, turnout, raw_root, algo=""):
        if code := code_of(unit.turnout):
            raise OSError(code, os.strerror(code))
        return length(unit, turnout, raw_root, algo)

    fleet.run(stage=Stage("hammer", failing, "1"))
    waiting = {code_of(unit) for unit in read_postponed(fleet.state)[1]}
    rows = {code_of(unit) for unit, tables in fleet.rows().items() if tables["quarantine"]}
    assert rows == DATA_ERRNOS and waiting == set(CODES.values()) - DATA_ERRNOS
    assert all(is_infrastructure(OSError(code, "")) for code in waiting)


def test_a_lack_of_memory_is_a_row_of_the_quarantine_in_the_second_run(fleet):
    """So the run does not fail for ever; the unit is tried again when its file is touched."""
    fleet.put("t1/2024-05-13/A_1.txt", "too large")
    assert str(fleet.run()) == "hammer 00of01: 3 known, 2 processed, 0 quarantined, 1 postponed"
    summary = fleet.run()
    assert (summary.processed, summary.quarantined, summary.postponed, summary.internal_errors) == (1, 1, 0, 0)
    (row,) = fleet.rows()[UNIT]["quarantine"]
    assert (row["reason_code"], row["path"]) == ("too_large", "t1/2024-05-13/A_1.txt")
    assert fleet.run().processed == 0 and read_postponed(fleet.state)[1] == {}
    fleet.put("t1/2024-05-13/A_1.txt", "smaller")
    assert fleet.run().processed == 1
    assert fleet.rows()[UNIT]["quarantine"] == []


def test_further_attempts_in_the_same_run_are_not_counted_as_a_second_run(fleet):
    fleet.put("t1/2024-05-13/A_1.txt", "too large")
    first, second = datetime(2026, 11, 22, 2), datetime(2026, 11, 23, 2)
    for _ in range(3):
        assert fleet.run(launched=first).postponed == 1
    assert json.loads((fleet.state.with_suffix("") / "postponed.json").read_text())["runs"] == {UNIT: first.isoformat()}
    assert fleet.run(launched=second).quarantined == 1


def quarantine(fleet, unit=UNIT):
    return [(r["reason_code"], r["path"], r["found"]) for r in fleet.rows()[unit]["quarantine"]]


@pytest.mark.parametrize("when", ["hashed", "computed"])
def test_every_permanent_error_code_is_a_row_of_the_quarantine_in_the_second_run(tmp_path, monkeypatch, when):
    """Every code of the platform at once, each for its own file: no unit is left for a third run."""
    fleet, hashed = Fleet(tmp_path, len(CODES) + 1), tasks.sha256_of

    def fail(path):
        if code := code_of(path):
            raise OSError(code, os.strerror(code), str(path))

    def failing_length(unit, turnout, raw_root, algo=""):
        fail(unit.turnout)
        return length(unit, turnout, raw_root, algo)

    def failing_hash(path):
        fail(path)
        return hashed(path)

    if when == "hashed":
        monkeypatch.setattr(tasks, "sha256_of", failing_hash)
    stage = Stage("hammer", failing_length if when == "computed" else length, "1")
    for _ in range(2):
        fleet.run(stage=stage)
    assert read_postponed(fleet.state)[1] == {}
    first = load_state(fleet.state)
    for unit in first.units:
        code, rows = code_of(unit), quarantine(fleet, unit)
        if code and (when == "computed" or code not in VANISHED_CODES):
            ((reason, path, found),) = rows
            assert path == f"t{unit.split('/')[0][1:]}/2024-05-13/A_1.txt"
            assert reason == ("internal_error" if code in DATA_ERRNOS and when == "computed" else "read_fault")
            assert f"[Errno {code}]" in found and str(tmp_path) not in found
    assert len(first.units) == len(CODES) + 1
    summary = fleet.run(stage=stage)  # the third run tries the units again with the same result
    assert (summary.processed, summary.postponed) == (0, 0) and load_state(fleet.state) == first
    monkeypatch.undo()
    assert fleet.run().retried == 0
    assert [unit for unit in fleet.rows() if quarantine(fleet, unit)] == [
        unit for unit in fleet.rows() if when == "computed" and code_of(unit) in DATA_ERRNOS
    ]


def make_unreadable(monkeypatch, *names):
    """Make the reading of files with these names fail with EIO."""
    hashed = tasks.sha256_of

    def failing(path):
        if any(str(path).endswith(name) for name in names):
            raise OSError(errno.EIO, "Input/output error", str(path))
        return hashed(path)

    monkeypatch.setattr(tasks, "sha256_of", failing)


def test_the_readable_files_of_a_unit_with_a_permanently_unreadable_file_are_used(fleet, monkeypatch):
    fleet.put("t1/2024-05-13/A_2.txt", "another impact")
    make_unreadable(monkeypatch, "t1/2024-05-13/A_1.txt")
    assert fleet.run().postponed == 1
    assert (summary := fleet.run()).postponed == 0 and summary.retried == 1
    assert fleet.lengths()[UNIT] == [len("another impact")]
    assert quarantine(fleet) == [("read_fault", "t1/2024-05-13/A_1.txt", "OSError: [Errno 5] Input/output error")]
    fleet.put("t1/2024-05-13/A_3.txt", "a third")
    assert fleet.run().processed == 1
    assert fleet.lengths()[UNIT] == [len("another impact"), len("a third")]
    monkeypatch.undo()
    assert fleet.run().processed == 1 and quarantine(fleet) == []
    assert len(fleet.lengths()[UNIT]) == 3 and fleet.run().processed == 0


def test_the_rows_of_a_file_that_becomes_unreadable_are_kept(fleet, monkeypatch):
    """A new version of the program computes all units again; a disk that fails meanwhile removes no measurement."""
    fleet.run()
    before = fleet.lengths()
    make_unreadable(monkeypatch, "t1/2024-05-13/A_1.txt")
    for _ in range(3):
        fleet.run(algo="2")
        assert fleet.lengths() == before
    for _ in range(2):  # the next version has the same result
        fleet.run(algo="3")
        assert fleet.lengths() == before
    fleet.put("t1/2024-05-13/A_2.txt", "another impact")
    for _ in range(2):
        fleet.run(algo="3")
        assert fleet.lengths() == before
    assert [reason for reason, *_ in quarantine(fleet)] == ["read_fault"]
    monkeypatch.undo()
    assert fleet.run(algo="3").processed == 1 and quarantine(fleet) == []
    assert sorted(fleet.lengths()[UNIT]) == sorted([*before[UNIT], len("another impact")])


def test_a_file_that_changes_during_the_computation_is_computed_again_after_it_is_restored(fleet):
    """Between hash and rows it has other bytes: these rows must not be stored under the first hash."""
    path = fleet.raw / "t1/2024-05-13/A_1.txt"
    content, times = path.read_text(), (path.stat().st_atime_ns, path.stat().st_mtime_ns)

    def replaced(unit, turnout, raw_root, algo=""):
        if unit.turnout == "t1":
            path.write_text("other bytes of another length")
        return length(unit, turnout, raw_root, algo)

    fleet.run(stage=Stage("hammer", replaced, "1"))
    path.write_text(content)
    os.utime(path, ns=times)
    assert fleet.run().processed == 1
    assert fleet.lengths()[UNIT] == [len(content)] and fleet.run().processed == 0


def test_a_file_system_that_reports_no_blocks_has_files_with_content(tmp_path):
    """Several network file systems report 0 blocks for every file."""
    full, empty = tmp_path / "full.csv", tmp_path / "empty.csv"
    full.write_bytes(bytes(2**20))
    empty.touch()
    os.truncate(empty, 2**27)
    no_blocks = SimpleNamespace(st_size=2**27, st_blocks=0)
    assert sparse_size(full, no_blocks) == -1 and sparse_size(empty, no_blocks) == 0
    assert sparse_size(tmp_path / "cannot be opened", no_blocks) == -1
