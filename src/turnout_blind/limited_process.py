"""One process under a budget: it ends, one way or another, and what it said and cost is known."""

import os
import shlex
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

LOOK = 0.2  # between two looks at a running process [s]
TOLD = 300  # letters kept of what it said last


@dataclass(frozen=True)
class Ran:
    """``code`` as the shell has it (negative: a signal), words ``out`` and ``err``, ``spent``: why it was stopped."""

    code: int
    out: str
    err: str
    cpu: float
    wall: float
    spent: str = ""

    @property
    def last_words(self):
        """The last line it said, or why it was stopped."""
        return self.spent or next(reversed((self.out + self.err).strip().splitlines()), "")[:TOLD]


def limited(command, cpu):
    """``command`` (list) that the system ends after ``cpu`` seconds of its processor [s], by a signal of its own."""
    soft = int(cpu)
    return ["sh", "-c", f"ulimit -S -t {soft}; ulimit -H -t {soft + 5}; exec {shlex.join(map(str, command))}"]


def run(command, folder, logs, wall, cpu):
    """``Ran`` of ``command`` (list) in ``folder``; its words go to files in ``logs``.

    It is killed with all its children after ``wall`` seconds of the clock, and by the system after ``cpu`` seconds of
    the processor. CPU time is that of the process and of the children it has waited for.
    """
    logs = Path(logs)
    logs.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    with open(logs / "out.txt", "wb") as out, open(logs / "err.txt", "wb") as err:
        process = subprocess.Popen(command, stdout=out, stderr=err, cwd=folder, start_new_session=True)
        try:
            status, usage, late = _until(process.pid, began + wall)
        except BaseException:  # interrupted: nothing is left running
            _kill(process.pid)
            os.wait4(process.pid, 0)
            raise
    process.returncode = code = os.waitstatus_to_exitcode(status)
    used = usage.ru_utime + usage.ru_stime
    spent = f"no answer within {wall:.0f} s of the clock" if late else ""
    # the system counts in ticks, what is reported is exact: they differ where the machine is shared
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
    """The process and whatever it started: it leads a session of its own."""
    try:
        os.killpg(pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
