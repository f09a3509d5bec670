"""Run one process with limits of wall clock and CPU time, and return its output and cost."""

import os
import shlex
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

LOOK = 0.2  # interval at which a running process is polled [s]
TOLD = 300  # length to which the last line of output is cut [characters]


@dataclass(frozen=True)
class Ran:
    """Exit ``code`` (negative: a signal), output ``out`` and ``err``, ``cpu`` and ``wall`` [s].

    ``stop_reason`` says why the process was stopped, "" if it was not.
    """

    code: int
    out: str
    err: str
    cpu: float
    wall: float
    spent: str = ""

    @property
    def last_words(self):
        """Last line of output, or why the process was stopped."""
        return self.spent or next(reversed((self.out + self.err).strip().splitlines()), "")[:TOLD]


def limited(command, cpu):
    """``command`` (list) with a limit of ``cpu`` [s], after which the system ends it by a signal."""
    soft = int(cpu)
    return ["sh", "-c", f"ulimit -S -t {soft}; ulimit -H -t {soft + 5}; exec {shlex.join(map(str, command))}"]


def run(command, folder, logs, wall, cpu):
    """``ProcessResult`` of ``command`` (list) in ``folder``; its output goes to files in ``logs``.

    It is killed with all its children after ``wall`` [s] of wall clock, and by the system after ``cpu`` [s].
    CPU time is that of the process and of the children it has waited for.
    """
    logs = Path(logs)
    logs.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    with open(logs / "out.txt", "wb") as out, open(logs / "err.txt", "wb") as err:
        process = subprocess.Popen(command, stdout=out, stderr=err, cwd=folder, start_new_session=True)
        try:
            status, usage, late = _until(process.pid, began + wall)
        except BaseException:  # interrupted: leave no process running
            _kill(process.pid)
            os.wait4(process.pid, 0)
            raise
    process.returncode = code = os.waitstatus_to_exitcode(status)
    used = usage.ru_utime + usage.ru_stime
    spent = f"no answer within {wall:.0f} s of the clock" if late else ""
    # the system counts in ticks and may stop a process before its exact CPU time reaches the limit
    if not spent and (code == -signal.SIGXCPU or (code == -signal.SIGKILL and used >= 0.8 * cpu)):
        spent = f"no answer within {cpu:.0f} s of the processor"
    words = [(logs / name).read_text(encoding="utf-8", errors="replace") for name in ("out.txt", "err.txt")]
    return Ran(code, *words, used, time.monotonic() - began, spent)


def _until(pid, deadline):
    """(status, usage, whether it was killed at the deadline)."""
    while True:
        found, status, usage = os.wait4(pid, os.WNOHANG)
        if found:
            return status, usage, False
        if time.monotonic() > deadline:
            _kill(pid)
            _, status, usage = os.wait4(pid, 0)
            return status, usage, True
        time.sleep(LOOK)


def _kill(pid):
    """Kill the process and its children: it leads a session of its own."""
    try:
        os.killpg(pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
