"""A signal to a command ends its child processes, which remove their unfinished files."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from turnout.child_processes import ENDING_SIGNALS, ProcessPool, signals_interrupt

# A command with a pool: two tasks of an hour, each with an unfinished file, and six that must not begin.
POOL = """
import os, signal, sys, time
from pathlib import Path
from turnout.child_processes import ProcessPool, signals_interrupt

def task(k):
    unfinished = Path(f"{os.getpid()}.tmp")
    unfinished.write_text("")
    try:
        time.sleep(3600)
    finally:
        unfinished.unlink()

if __name__ == "__main__":
    numbers = []
    try:
        with signals_interrupt(numbers), ProcessPool(2, METHOD) as pool:
            list(pool.map(task, range(8)))
    except KeyboardInterrupt:
        sys.exit(100 + numbers[0])
"""
# A command like `turnout demo`: it runs Snakemake, here a process with a child that ignores SIGTERM.
SNAKEMAKE = """
import subprocess, sys
from pathlib import Path
from turnout.child_processes import signals_interrupt
from turnout.demo.progress import run_with_progress

JOB = ("import os, signal, sys, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); "
       "open(f'{os.getpid()}.tmp', 'w'); time.sleep(3600)")
HEAD = f"import os, subprocess, sys; open(f'{{os.getpid()}}.tmp', 'w'); subprocess.run([sys.executable, '-c', {JOB!r}])"
numbers = []
try:
    with signals_interrupt(numbers):
        run_with_progress([sys.executable, "-c", HEAD], Path("workflow.log"))
except KeyboardInterrupt:
    sys.exit(100 + numbers[0])
"""


def started(script, folder):
    """The process of a command, and those of its two children."""
    (folder / "command.py").write_text(script)
    process = subprocess.Popen(
        [sys.executable, "command.py"], cwd=folder, start_new_session=True, stderr=subprocess.PIPE,
        preexec_fn=lambda: [signal.signal(number, signal.SIG_DFL) for number in ENDING_SIGNALS],
    )  # fmt: skip
    while len(files := list(folder.glob("*.tmp"))) < 2:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.05)
    return process, [int(path.stem) for path in files]


def alive(pids):
    """The processes that run, a second after the command at the latest."""
    deadline = time.monotonic() + 1.0
    while (running := list(filter(_is_alive, pids))) and time.monotonic() < deadline:
        time.sleep(0.05)
    return running


def _is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("method", ["fork", "spawn"])
@pytest.mark.parametrize("number", ENDING_SIGNALS)
def test_a_signal_ends_the_processes_of_a_pool_in_the_middle_of_their_tasks(tmp_path, number, method):
    command, pids = started(POOL.replace("METHOD", repr(method)), tmp_path)
    command.send_signal(number)
    assert command.wait(20) == 100 + number and command.stderr.read() == b""
    assert not alive(pids) and not list(tmp_path.glob("*.tmp"))


def test_a_second_signal_kills_tasks_that_do_not_end(tmp_path):
    """As in compiled code, which sees no signal. Formerly the command waited for such tasks to finish."""
    deaf = POOL.replace("    unfinished =", "    signal.signal(signal.SIGTERM, signal.SIG_IGN)\n    unfinished =")
    command, pids = started(deaf.replace("METHOD", "None"), tmp_path)
    command.send_signal(signal.SIGTERM)
    time.sleep(0.5)  # it waits for its processes now, MAX_TASK_END at most
    command.send_signal(signal.SIGTERM)
    try:
        assert command.wait(20) == 100 + signal.SIGTERM and not alive(pids)
    finally:
        for pid in alive(pids):
            os.kill(pid, signal.SIGKILL)


def test_the_processes_of_a_pool_end_with_a_parent_that_is_killed(tmp_path):
    command, pids = started(POOL.replace("METHOD", "None"), tmp_path)
    command.kill()
    command.wait(20)
    assert not alive(pids)


@pytest.mark.parametrize("number", ENDING_SIGNALS)
def test_a_signal_to_a_demonstration_ends_snakemake_and_its_jobs(tmp_path, number):
    command, pids = started(SNAKEMAKE, tmp_path)
    command.send_signal(number)
    assert command.wait(20) == 100 + number
    assert not alive(pids)


def test_a_pool_computes_all_tasks_without_a_signal():
    with ProcessPool(2) as pool:
        assert list(pool.map(abs, range(-20, 0), chunksize=3)) == list(range(20, 0, -1))


def test_an_error_of_a_task_ends_the_other_tasks():
    start = time.monotonic()
    with pytest.raises(TypeError), ProcessPool(2) as pool:
        tasks = [pool.submit(time.sleep, 3600), pool.submit(time.sleep, "no number")]
        tasks[1].result()
    assert time.monotonic() - start < 20


def test_a_signal_that_is_ignored_stays_so_and_the_handlers_return():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as below nohup
    term = signal.getsignal(signal.SIGTERM)
    numbers = []
    try:
        with signals_interrupt(numbers):
            os.kill(os.getpid(), signal.SIGHUP)
            with pytest.raises(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGTERM)
                time.sleep(5)
        assert numbers == [signal.SIGTERM] and signal.getsignal(signal.SIGTERM) is term
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_thread_sets_no_handlers():
    errors = []

    def run():
        try:
            with signals_interrupt([]):
                pass
        except ValueError as error:
            errors.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert not errors
