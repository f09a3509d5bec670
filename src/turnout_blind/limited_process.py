"""Run one process with limits of wall clock and CPU time, and return its output and cost."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from threading import Event
    from typing import Any

POLL_INTERVAL = 0.2  # interval at which a running process is polled [s]
MAX_LINE_LENGTH = 300  # length to which the last line of output is cut [characters]


@dataclass(frozen=True)
class ProcessResult:
    """Exit ``code`` (negative: a signal), output ``out`` and ``err``, ``cpu`` and ``wall`` [s].

    ``stop_reason`` says why the process was stopped, "" if it was not.
    """

    code: int
    out: str
    err: str
    cpu: float
    wall: float
    stop_reason: str = ""

    @property
    def last_line(self) -> str:
        """Last line of output, or why the process was stopped."""
        return self.stop_reason or next(reversed((self.out + self.err).strip().splitlines()), "")[:MAX_LINE_LENGTH]


def with_cpu_limit(command: Iterable[Any], cpu: float) -> list[str]:
    """A command with a limit of CPU time, after which the system ends it by a signal.

    Parameters
    ----------
    command : iterable
        Command and its arguments.
    cpu : float
        Limit, cut to whole seconds. [s]

    Returns
    -------
    list of str
        The command with its limit.
    """
    soft = int(cpu)
    return ["sh", "-c", f"ulimit -S -t {soft}; ulimit -H -t {soft + 5}; exec {shlex.join(map(str, command))}"]


def run(
    command: Sequence[str], folder: str | Path, logs: str | Path, wall: float, cpu: float, stop: Event | None = None
) -> ProcessResult:
    """Run a command in a folder; its output goes to files.

    It is killed with all its children after the limit of wall clock or when ``stop`` is set, and by the system after
    the limit of CPU time. CPU time is that of the process and of the children it has waited for.

    Parameters
    ----------
    command : sequence of str
        Command and its arguments.
    folder : str or Path
        Working folder.
    logs : str or Path
        Folder of the output.
    wall : float
        Limit of wall clock. [s]
    cpu : float
        Limit of CPU time that the command has. [s]
    stop : threading.Event or None
        Set by another thread to end the process.

    Returns
    -------
    ProcessResult
        Exit code, output and cost.
    """
    logs = Path(logs)
    logs.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    with open(logs / "out.txt", "wb") as out, open(logs / "err.txt", "wb") as err:
        process = subprocess.Popen(command, stdout=out, stderr=err, cwd=folder, start_new_session=True)
        try:
            status, usage, was_killed = _wait_until(process.pid, start + wall, stop)
        except BaseException:  # interrupted: leave no process running
            _kill(process.pid)
            os.wait4(process.pid, 0)
            raise
    process.returncode = code = os.waitstatus_to_exitcode(status)
    cpu_time = usage.ru_utime + usage.ru_stime
    stop_reason = ""
    if was_killed:
        stop_reason = "interrupted" if stop and stop.is_set() else f"no answer within {wall:.0f} s of the clock"
    # the system counts in ticks and may stop a process before its exact CPU time reaches the limit
    if not stop_reason and (code == -signal.SIGXCPU or (code == -signal.SIGKILL and cpu_time >= 0.8 * cpu)):
        stop_reason = f"no answer within {cpu:.0f} s of the processor"
    texts = [(logs / name).read_text(encoding="utf-8", errors="replace") for name in ("out.txt", "err.txt")]
    return ProcessResult(code, texts[0], texts[1], cpu_time, time.monotonic() - start, stop_reason)


def _wait_until(pid: int, deadline: float, stop: Event | None) -> tuple[int, Any, bool]:
    """(status, usage, whether it was killed at the deadline or by ``stop``)."""
    while True:
        finished_pid, status, usage = os.wait4(pid, os.WNOHANG)
        if finished_pid:
            return status, usage, False
        if time.monotonic() > deadline or (stop is not None and stop.is_set()):
            _kill(pid)
            _, status, usage = os.wait4(pid, 0)
            return status, usage, True
        time.sleep(POLL_INTERVAL)


def _kill(pid: int) -> None:
    """Kill the process and its children: it leads a session of its own."""
    try:
        os.killpg(pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
