"""Run the workflow once, unattended: no other run at the same time, cleanup of a killed run, one line of report."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from filelock import FileLock, Timeout

from turnout.child_processes import process_group
from turnout.counts import count_of, first_texts
from turnout.errors import TurnoutError
from turnout.files import changed_at
from turnout.installation import shipped_path
from turnout.workflow.output_places import nearly_full_disks, require_writable_places
from turnout.workflow.plan import is_cut_plan, read_plan
from turnout.workflow.project import profile_folder, snakefile_options, snakemake_environment
from turnout.workflow.run_report import (
    configuration_errors,
    excluded_entries,
    failure_reason,
    rejected_units,
    unread_files,
    unused_turnouts,
)
from turnout.workflow.scan import unit_id
from turnout.workflow.state import VANISHED, load_state, states_below

JOB_NAMES = "turnouts"
LEFT_OUT_CODE = 1  # exit code of a run that left turnouts out for an error in their configuration
EXIT_TIME_LIMIT = 124  # exit code of a run ended by the time limit, as of timeout(1)
SIGNAL_BASE = 128  # exit code of a process that a signal ended, less the number of the signal, as of a shell
PUBLISHING_SHARE = 1 / 6  # share of the time limit reserved for publishing
MAX_TURNOUTS_SHOWN = 3  # turnouts named in the report
MAX_EXCLUDED_SHOWN = 1  # entries of no unit, and unread files, quoted in the report
QUERY_HINT = 'turnout query "from quarantine_open" and "from rejected"'
GENERATION = Path("results/registry/_generation.json")
WORKLIST = Path("results/worklist.csv")
PUBLISHING_RULES = ("all", "register", "verdict", "trend", "worklist", "report")


@dataclass(frozen=True)
class NightReport:
    """Report of a run; ``code`` is 0 only if all went well, else ``reason`` says why not.

    ``vanished`` is the number of units gone since the last run. ``worst`` are the turnouts with most unused units, and
    their numbers. ``unused`` are the turnouts without any usable unit so far; ``nothing_usable`` is True if that holds
    for the whole fleet. ``excluded`` are files and rows in quarantine that belong to no unit. ``unread`` are files that
    are there and could not be read; they leave the code as it is. ``left_out`` are errors of the configuration for
    which turnouts were left out; the code is then at least 1.
    """

    code: int
    units: int
    processed: int
    quarantined: int
    vanished: int
    published: bool = True
    rejected: int = 0
    worst: tuple[tuple[str, int], ...] = ()
    unused: tuple[str, ...] = ()
    nothing_usable: bool = False
    excluded: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    reason: str = ""
    left_out: tuple[str, ...] = ()

    @property
    def has_ended_well(self) -> bool:
        """Whether every job ran, also of a run that left turnouts out."""
        return self.code == 0 or (self.code == LEFT_OUT_CODE and bool(self.left_out) and not self.reason)

    def __str__(self) -> str:
        well = "ok"
        if self.left_out:
            well = f"every job ran, but {count_of(len(self.left_out), 'error')} in the configuration left turnouts out"
        elif self.nothing_usable:
            well = "every job ran, but nothing could be used"
        elif self.unread:
            well = f"every job ran, but {count_of(len(self.unread), 'file')} could not be read"
        outcome = {0: well, EXIT_TIME_LIMIT: "stopped at the time limit"}.get(
            self.code, f"failed with exit code {self.code}"
        )
        outcome = well if self.has_ended_well else outcome
        return (
            f"{outcome}: {self.units} units known, {self.processed} processed, "
            f"{self.quarantined} of these with rows in quarantine, "
            + (f"{self.rejected} hammer test{'s' * (self.rejected > 1)} rejected, " if self.rejected else "")
            + f"{self.vanished} vanished"
            + (f"; nothing could be used yet of {first_texts(self.unused, MAX_TURNOUTS_SHOWN)}" if self.unused else "")
            + (f"; worst: {', '.join(f'{t} ({n})' for t, n in self.worst)}" if self.worst else "")
            + (f"; left out: {first_texts(self.left_out, MAX_EXCLUDED_SHOWN)}" if self.left_out else "")
            + (f"; not read: {first_texts(self.unread, MAX_EXCLUDED_SHOWN)}" if self.unread else "")
            + (f"; in no unit: {first_texts(self.excluded, MAX_EXCLUDED_SHOWN)}" if self.excluded else "")
            + (f", see {QUERY_HINT}" if self.worst or self.unused or self.excluded or self.unread else "")
            + ("" if self.published else "; the registry was not published")
            + (f"; why: {self.reason}" if self.reason else "")
        )


def nightly(
    options: Sequence[str], profile: str, limit: float | None = None, work: Path = Path("work"), quiet: bool = False
) -> NightReport:
    """Run the workflow once.

    If jobs die or are ended, the finished results are published without the rest. A signal that ends this process ends
    Snakemake first.

    Parameters
    ----------
    options : sequence of str
        Options of Snakemake.
    profile : str
        Folder of profiles/.
    limit : float or None
        Time after which a run is ended that hangs or takes longer than the night; None: no limit. [s]
    work : Path
        Folder ``work`` of the workflow.
    quiet : bool
        Show nothing of Snakemake; its log keeps what it says.

    Returns
    -------
    NightReport
        The report of the run.

    Raises
    ------
    TurnoutError
        If there is no such profile, a folder cannot be written, or another run is active.
    """
    profile = profile_folder(profile)
    _require_profile(Path(profile))
    require_writable_places()
    work.mkdir(exist_ok=True)
    lock = FileLock(work / ".nightly.lock")
    try:
        with lock.acquire(timeout=0), _signals_raise():
            _require_no_other_run()
            _clear(options, Path(profile).name)
            before, planned, started = _batches(work), _planned_units(work), time.time_ns()
            code = _run([*options, "--workflow-profile", profile, "--rerun-incomplete"], limit, work, quiet)
            reason = _reason(code, started, quiet)
            return _report(SIGNAL_BASE - code if code < 0 else code, before, planned, reason, work)
    except Timeout:
        message = f"{work / '.nightly.lock'} is held: another nightly run is going on"
        raise TurnoutError(f"{message}. Wait for it, or end it.") from None


def _reason(code: int, started: int, quiet: bool) -> str:
    """Why Snakemake ended with this code, "" if it did its work; a negative code is minus the signal that ended it."""
    if code in (0, EXIT_TIME_LIMIT):
        return ""
    if code < 0:
        name = signal.Signals(-code).name
        return f"Snakemake was ended by {name}, as by a lack of memory or a person: the next run continues"
    place = "run again without --quiet to see its message" if quiet else "its message stands above"
    reason = failure_reason(started) or f"Snakemake stopped before any job: {place}"
    return "; ".join([reason, *nearly_full_disks()])  # a full disk stores no log either


def _require_profile(profile: Path) -> None:
    """TurnoutError without the profile; Snakemake's own message would only be about cores."""
    if not any(profile.glob("config*.yaml")):
        folders = Path("profiles"), shipped_path("profiles")
        profiles = sorted({f"profiles/{p.parent.name}" for folder in folders for p in folder.glob("*/config*.yaml")})
        problem = "holds no config.yaml" if profile.is_dir() else "there is no such folder"
        remedy = f"Write one of {', '.join(profiles)}, or the folder of your own"
        raise TurnoutError(f"{profile}, the profile: {problem}. {remedy}.")


@contextmanager
def _signals_raise() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise SystemExit, as Ctrl-C raises KeyboardInterrupt, so that Snakemake is ended."""

    def end(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    ending = [n for n in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(n) is not signal.SIG_IGN]  # nohup
    before = {number: signal.signal(number, end) for number in ending}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _require_no_other_run() -> None:
    """TurnoutError if another Snakemake works in this folder, for then its lock is not that of a killed run."""
    here = os.getcwd()
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes().split(b"\0")
            works_here = os.readlink(process / "cwd") == here
        except OSError:  # it has ended, or belongs to another user
            continue
        head = any(w == b"snakemake" or w.endswith(b"/snakemake") for w in words[:3]) and b"--mode" not in words
        if works_here and head:  # with --mode it is one job of a run, such as _clear cancels
            raise TurnoutError(f"process {process.name} is a Snakemake run in this folder. Wait for it, or end it.")


def _unlock() -> None:
    """Remove the lock and the backups of a killed Snakemake."""
    shutil.rmtree(Path(".snakemake") / "backups", ignore_errors=True)
    shutil.rmtree(Path(".snakemake") / "locks", ignore_errors=True)


def _clear(options: Sequence[str], profile: str) -> None:
    """Remove Snakemake's lock and backups, and cancel jobs that a killed run left in the queue."""
    _unlock()
    if profile == "slurm" and shutil.which("scancel"):
        command = ["squeue", "--me", "-h", "-o", "%i %j %Z"]  # number, name, folder
        queue = subprocess.run(command, capture_output=True, text=True, check=False)
        jobs = [line.split(maxsplit=2) for line in queue.stdout.splitlines()]
        job_ids = [job[0] for job in jobs if job[1].startswith(JOB_NAMES) and job[2:] == [os.getcwd()]]
        if job_ids:
            subprocess.run(["scancel", *job_ids], check=False)


def _run(options: Sequence[str], limit: float | None, work: Path, quiet: bool = False) -> int:
    """Exit code of Snakemake; if jobs died or were ended before registry and list were published, publish them."""
    started, launched, generation = time.monotonic(), changed_at(work / "launched"), changed_at(GENERATION)
    code = _snakemake(options, None if limit is None else (1.0 - PUBLISHING_SHARE) * limit, quiet)
    had_jobs, registered = changed_at(work / "launched") != launched, changed_at(GENERATION) != generation
    is_listed = changed_at(WORKLIST) >= changed_at(work / "trend.json")  # the list waits for the diagnoses of alarms
    if code != 0 and had_jobs and not (registered and is_listed):
        remaining = None if limit is None else max(0.0, started + limit - time.monotonic())
        _unlock()
        _snakemake([*options, "--allowed-rules", *PUBLISHING_RULES], remaining, quiet)
    return code


def _snakemake(options: Sequence[str], limit: float | None, quiet: bool = False) -> int:
    """Exit code of Snakemake, run in its own process group so that the limit or a signal ends its jobs, too."""
    with suppress(subprocess.TimeoutExpired):
        with process_group(
            [sys.executable, "-m", "snakemake", *snakefile_options(Path()), *options],
            env=snakemake_environment(),
            stdout=subprocess.DEVNULL if quiet else None,  # what the jobs print is progress, too
            stderr=subprocess.DEVNULL if quiet else None,
        ) as process:
            return process.wait(limit)
    return EXIT_TIME_LIMIT


def _batches(work: Path) -> set[tuple[Path, str]]:
    return {(path, batch) for path in states_below(work) for batch in load_state(path).batches}


def _planned_units(work: Path) -> set[str]:
    """Units in the plans."""
    plans = [plan for plan in sorted((work / "plan").glob("*.json")) if not is_cut_plan(plan)]
    return {unit_id(p.unit) for plan in plans for p in read_plan(plan)}


def _report(code: int, before: set, planned_before: set[str], reason: str, work: Path) -> NightReport:
    missing = planned_before - _planned_units(work)
    units: set[str] = set()  # states of an earlier number of shards may remain
    processed, quarantined = [], []
    for path in states_below(work):
        for name, entry in load_state(path).units.items():
            units.add(name)
            if (path, entry.batch) not in before and entry.status != VANISHED:  # its files are gone: nothing to compute
                processed.append(name)
                quarantined += [name] if entry.status != "ok" else []
    newest = max(map(changed_at, states_below(work)), default=0)
    published = code == 0 or 0 < newest <= changed_at(GENERATION)
    tests = rejected_units(processed, GENERATION.parent)
    unused, nothing_usable = unused_turnouts(GENERATION.parent)
    by_turnout = Counter(name.partition("/")[0] for name in {*quarantined, *tests})
    worst = sorted(by_turnout.items(), key=lambda item: (-item[1], item[0]))[:MAX_TURNOUTS_SHOWN]
    counts = len(units), len(processed), len(quarantined), len(missing & units)
    left_out = tuple(configuration_errors(GENERATION.parent)) if published else ()
    code = LEFT_OUT_CODE if code == 0 and left_out else code
    excluded, unread = tuple(excluded_entries(GENERATION.parent, unused)), tuple(unread_files(GENERATION.parent))
    return NightReport(
        code, *counts, published, len(tests), tuple(worst), tuple(unused), nothing_usable, excluded, unread, reason,
        left_out,
    )  # fmt: skip
