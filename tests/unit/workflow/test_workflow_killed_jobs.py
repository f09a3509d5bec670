"""A unit that kills its process is reported and delays no other; the kill of a job puts no unit in quarantine."""

import os
import signal
import time
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path

import pytest
from length_fleet import Fleet, length

from turnout.workflow.quality_gate import judge
from turnout.workflow.retries import mark_started, read_postponed, started_units
from turnout.workflow.state import load_state
from turnout.workflow.tasks import Stage

UNITS = [f"t{i}/hammer/A/2024-05-13" for i in range(6)]


@pytest.fixture
def fleet(tmp_path):
    return Fleet(tmp_path, 6)


def run_night(fleet, **more):
    """Exit status of a job in its own process group, as the workflow starts it."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.setsid()
            fleet.run(**more)
            code = 0
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def statuses(fleet):
    return {unit: known.status for unit, known in load_state(fleet.state).units.items()}


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_a_unit_that_kills_its_process_is_in_quarantine_after_two_nights_and_the_others_are_computed(fleet, threads):
    fleet.put("t1/2024-05-13/A_1.txt", "kills its process")
    first, second = run_night(fleet, threads=threads), run_night(fleet, threads=threads)
    assert (first == 0, second) == (threads > 1, 0)
    assert statuses(fleet) == dict.fromkeys(UNITS, "ok") | {UNITS[1]: "internal_error"}
    (row,) = fleet.rows()[UNITS[1]]["quarantine"]
    assert (row["reason_code"], row["path"]) == ("internal_error", "t1/2024-05-13/A_1.txt")
    assert row["found"] == "the process died that computed it, and again where it was computed alone"
    assert {p.name for p in fleet.state.with_suffix("").glob("b*")} == set(load_state(fleet.state).batches)
    assert fleet.run(threads=threads).processed == 0
    fleet.put("t1/2024-05-13/A_1.txt", "fixed")
    assert fleet.run(threads=threads).processed == 1
    assert statuses(fleet) == dict.fromkeys(UNITS, "ok")


@pytest.mark.parametrize("threads", [2, 3])
def test_other_units_are_computed_in_the_same_night_and_the_faulty_unit_is_reported(fleet, threads):
    fleet.put("t4/2024-05-13/A_1.txt", "kills its process")
    summary = fleet.run(threads=threads)
    assert (summary.processed, summary.quarantined, summary.postponed) == (5, 0, 1)
    assert statuses(fleet) == dict.fromkeys([u for u in UNITS if u != UNITS[4]], "ok")
    jobs, left = read_postponed(fleet.state)
    assert jobs == 1 and left == {UNITS[4]: "the process died that computed it"}
    (complaint,) = judge([fleet.state], fleet.configuration).complaints
    assert f"1 units wait for the next run, first {UNITS[4]}: the process died that computed it" in complaint


@pytest.mark.parametrize("threads", [1, 2])
def test_repeated_attempts_within_one_run_put_no_unit_in_quarantine(fleet, threads):
    """Another program may need the memory of the machine for several minutes."""
    fleet.put("t1/2024-05-13/A_1.txt", "kills its process")
    first, second = datetime(2026, 11, 22, 2), datetime(2026, 11, 23, 2)
    for _ in range(3):
        run_night(fleet, threads=threads, launched=first)
    assert statuses(fleet) == dict.fromkeys([u for u in UNITS if u != UNITS[1]], "ok")
    assert read_postponed(fleet.state)[1] == {UNITS[1]: "the process died that computed it"}
    run_night(fleet, threads=threads, launched=second)
    assert statuses(fleet)[UNITS[1]] == "internal_error"


@pytest.mark.parametrize("threads", [1, 2])
def test_two_units_that_kill_their_processes_affect_no_other_unit(fleet, threads):
    for i in (0, 3):
        fleet.put(f"t{i}/2024-05-13/A_1.txt", "kills its process")
    for _ in range(3):
        run_night(fleet, threads=threads)
    assert statuses(fleet) == dict.fromkeys(UNITS, "ok") | {UNITS[i]: "internal_error" for i in (0, 3)}


@pytest.mark.parametrize("threads", [1, 2])
def test_a_job_that_is_killed_every_night_puts_no_unit_in_quarantine(fleet, threads):
    """Each of the two kills its job in two nights, once alone; after these four nights the others are computed."""
    fleet.put("t2/2024-05-13/A_1.txt", "kills the job")
    fleet.put("t5/2024-05-13/A_1.txt", "kills the job")
    for _ in range(2 * 2 + 1):
        assert run_night(fleet, threads=threads) < 0
    assert statuses(fleet) == dict.fromkeys([UNITS[i] for i in (0, 1, 3, 4)], "ok")
    (complaint,) = judge([fleet.state], fleet.configuration).complaints
    assert "wait for the next run, first t2/" in complaint and "its job ended while it was computed" in complaint
    for i in (2, 5):
        fleet.put(f"t{i}/2024-05-13/A_1.txt", "spared")
    assert run_night(fleet, threads=threads) == 0
    assert statuses(fleet) == dict.fromkeys(UNITS, "ok")
    assert judge([fleet.state], fleet.configuration).complaints == ()


def test_a_unit_that_kills_its_job_every_night_delays_no_unit_that_started_at_the_same_time(fleet):
    """A job that exceeds its memory is ended with all its processes and their units."""
    fleet.put("t2/2024-05-13/A_1.txt", "kills the job")
    child = os.fork()
    if child == 0:
        with mark_started(fleet.state, UNITS[2], "then"), mark_started(fleet.state, UNITS[3], "then"):
            with mark_started(fleet.state, UNITS[5], "then"):
                os._exit(0)
    os.waitpid(child, 0)
    assert set(started_units(fleet.state)) == {UNITS[2], UNITS[3], UNITS[5]}
    for _ in range(2):
        assert run_night(fleet) < 0
    assert statuses(fleet) == dict.fromkeys([u for u in UNITS if u != UNITS[2]], "ok")


def test_units_started_beside_two_that_kill_their_job_are_computed_after_three_nights(fleet):
    """The slowest order: both that kill the job started before the two others."""
    for i in (2, 5):
        fleet.put(f"t{i}/2024-05-13/A_1.txt", "kills the job")
    child = os.fork()
    if child == 0:
        with ExitStack() as marks:
            for i in (2, 5, 3, 4):
                marks.enter_context(mark_started(fleet.state, UNITS[i], "then"))
                time.sleep(0.02)  # marks within one clock tick have no order
            os._exit(0)
    os.waitpid(child, 0)
    assert list(started_units(fleet.state)) == [UNITS[i] for i in (2, 5, 3, 4)]
    known = []
    for _ in range(3):
        assert run_night(fleet) < 0
        known.append(sorted(statuses(fleet)))
    assert known == [[UNITS[i] for i in (0, 1)], [UNITS[i] for i in (0, 1)], [UNITS[i] for i in (0, 1, 3, 4)]]


def test_results_that_wait_for_a_checkpoint_are_kept_when_a_fault_ends_the_job(fleet):
    fleet.put("t4/2024-05-13/A_1.txt", "bug")
    with pytest.raises(ZeroDivisionError):
        fleet.run(strict=True)
    assert statuses(fleet) == dict.fromkeys(UNITS[:4], "ok")
    assert not list(fleet.state.with_suffix("").glob("begun-*"))


def test_the_mark_of_a_started_unit_is_removed_when_the_unit_is_no_longer_planned(fleet):
    fleet.put("t2/2024-05-13/A_1.txt", "kills the job")
    run_night(fleet)
    (fleet.raw / "t2/2024-05-13/A_1.txt").unlink()
    assert fleet.run(only=["t1"]).processed == 1
    assert list(fleet.state.with_suffix("").glob("begun-*"))
    assert fleet.run().processed == 4
    assert not list(fleet.state.with_suffix("").glob("begun-*"))


def test_strict_raises_an_error_if_a_process_dies(fleet):
    fleet.put("t1/2024-05-13/A_1.txt", "kills its process")
    with pytest.raises(RuntimeError, match=f"{UNITS[1]}: the process died that computed it"):
        fleet.run(threads=2, strict=True)


def test_a_unit_that_killed_its_process_is_tried_again_after_its_file_is_touched(fleet):
    """The memory may suffice later, and a correct file has no reason to change."""
    file, short = fleet.raw / "t1/2024-05-13/A_1.txt", fleet.folder / "memory is short"

    def needs_memory(unit, *more, **options):
        if unit.turnout == "t1" and short.exists():
            os._exit(9)
        return length(unit, *more, **options)

    stage = Stage("hammer", needs_memory, "1")
    short.touch()
    for _ in range(2):
        run_night(fleet, threads=2, stage=stage)
    assert statuses(fleet)[UNITS[1]] == "internal_error"
    short.unlink()
    assert fleet.run(stage=stage).processed == 0
    os.utime(file, ns=(0, file.stat().st_mtime_ns + 1_000_000_000))
    assert fleet.run(stage=stage).processed == 1
    assert statuses(fleet) == dict.fromkeys(UNITS, "ok")


@pytest.mark.parametrize("cut", ["", "2026-11-22T02:00:00\nt1/ham"])
def test_a_truncated_mark_is_written_again(fleet, cut):
    with mark_started(fleet.state, UNITS[1], "then"):
        (note,) = fleet.state.with_suffix("").glob("begun-*")
        name = note.name
    note.with_name(name).write_text(cut)
    fleet.put("t1/2024-05-13/A_1.txt", "kills its process")
    for _ in range(2):
        run_night(fleet)
    assert statuses(fleet) == dict.fromkeys(UNITS, "ok") | {UNITS[1]: "internal_error"}


def test_a_mark_that_is_truncated_within_a_letter_is_ignored(fleet):
    with mark_started(fleet.state, "t1/hammer/Ø/2024-05-13", "then"):
        (note,) = fleet.state.with_suffix("").glob("begun-*")
        assert started_units(fleet.state) == {"t1/hammer/Ø/2024-05-13": "then"}
        note.write_bytes(note.read_bytes()[: len(b"then\nt1/hammer/") + 1])
        assert started_units(fleet.state) == {}


def test_the_processes_of_a_killed_job_end_with_it(fleet, tmp_path):
    """Otherwise they would keep their memory for ever and remove the marks of the next job."""

    def never_done(unit, *_, **__):
        (tmp_path / f"pid-{os.getpid()}").touch()
        time.sleep(600)

    child = os.fork()
    if child == 0:
        fleet.run(threads=2, stage=Stage("hammer", never_done, "1"))
        os._exit(0)
    until = time.monotonic() + 60
    while len(pids := [int(p.name[4:]) for p in tmp_path.glob("pid-*")]) < 2 and time.monotonic() < until:
        time.sleep(0.05)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    try:
        while any(map(is_alive, pids)) and time.monotonic() < until:
            time.sleep(0.05)
        assert len(pids) == 2 and not any(map(is_alive, pids))
    finally:
        for pid in filter(is_alive, pids):
            os.kill(pid, signal.SIGKILL)


def is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
