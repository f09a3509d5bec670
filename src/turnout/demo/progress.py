"""Run Snakemake with one line per stage; its own output goes to a log."""

from __future__ import annotations

import re
import subprocess
import time
from typing import TYPE_CHECKING

from turnout.child_processes import process_group
from turnout.workflow.project import snakemake_environment

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

STAGE_NAMES = {
    "hammer": "hammer tests",
    "passage": "passages",
    "mismatch": "diagnoses",
    "register": "registry",
    "verdict": "check of the run",
    "trend": "trends",
    "change": "diagnoses of open alarms",
    "worklist": "worklist",
    "report": "pages",
}
RULE_START = re.compile(r"^(?:local)?rule (\w+):$")
JOB_END = re.compile(r"^Finished jobid: \d+ \(Rule: (\w+)\)")


def stage_lines(output: Iterable[str], clock: Callable[[], float] = time.monotonic) -> Iterable[str]:
    """A line for each stage as soon as its last started job has ended.

    Parameters
    ----------
    output : iterable of str
        Lines that Snakemake prints.
    clock : callable
        Time. [s]

    Yields
    ------
    str
        Name of the stage and how long it took.

    Examples
    --------
    >>> output = ["localrule hammer:", "Finished jobid: 3 (Rule: hammer)"]
    >>> list(stage_lines(output, clock=iter([0.0, 71.2]).__next__))
    ['hammer tests: 71 s']
    """
    begun: dict[str, list[float]] = {}
    for line in output:
        if (match := RULE_START.match(line)) and match[1] in STAGE_NAMES:
            begun.setdefault(match[1], []).append(clock())
        elif (match := JOB_END.match(line)) and match[1] in begun:
            starts = begun[match[1]]
            if len(starts) == 1:
                yield f"{STAGE_NAMES[match[1]]}: {clock() - starts[0]:.0f} s"
                del begun[match[1]]
            else:  # shards at the same time: the stage has begun with the first of them
                starts.pop()


def run_with_progress(command: Sequence[str], log: Path, say: Callable[[str], object] = print) -> int:
    """Run a command line of Snakemake.

    Parameters
    ----------
    command : sequence of str
        Program and options.
    log : Path
        File for its output, which is replaced.
    say : callable
        Called with a line per stage, and with the last lines of the output where the run fails.

    Returns
    -------
    int
        Exit code.
    """
    log.parent.mkdir(parents=True, exist_ok=True)
    with open(log, "w", encoding="utf-8") as stream:
        lines = []
        with process_group(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, encoding="utf-8", errors="replace",
            env=snakemake_environment(),
        ) as process:  # fmt: skip

            def log_lines() -> Iterable[str]:
                for line in process.stdout or ():
                    stream.write(line)
                    lines.append(line.rstrip("\n"))
                    yield lines[-1]

            for text in stage_lines(log_lines()):
                say(f"   {text}")
            code = process.wait()
    if code:
        say("\n".join(["   the run failed; its last lines:", *(f"      {line}" for line in lines[-12:])]))
        say(f"   All of its output: {log}")
    return code
