"""Find what the simulation of a turnout lacks, from its hammer tests and passages.

  turnout diagnose --turnout tommerup_s1
  turnout diagnose --turnout tommerup_s1 --sections A7 A8 --limit-minutes 10
  turnout diagnose --turnout tommerup_s1 --accept

The newest visit is diagnosed, neighbouring sections together as one group, and a page is written. An interrupted
diagnosis, or one that reaches its --limit-minutes, continues where it stopped; groups that are done have findings.
--accept writes the named effect into the track file of the turnout and diagnoses nothing. From then on the simulation
contains the effect.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.cli.input_warnings import input_warnings
from turnout.cli.option_types import zero_or_more
from turnout.cli.options import (
    add_configuration,
    add_former,
    add_pages,
    add_raw,
    add_registry,
    add_result,
    add_track,
    add_turnout,
    add_use,
    add_warnings,
    add_work,
    check_work_folder,
)
from turnout.counts import count_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from typing import Any, Literal, TextIO

    from turnout.stages.mismatch_groups import Group
    from turnout.stages.mismatch_results import Results

GROUP = "Simulate and diagnose"
HELP = "find what the simulation of a turnout lacks"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    add_turnout(parser, "id in config/turnouts.tsv")
    parser.add_argument("--sections", nargs="+", default=(), help="only these sections")
    parser.add_argument(
        "--visit",
        help="YYYY-MM-DD, YYYY-MM, or 'all' visits together (for effects of temperature); default: the newest",
    )
    add_track(parser, help="file in config/tracks; default: the turnout's own, else its layout's")
    add_configuration(parser)
    add_raw(parser)
    add_work(parser, "folder of fits and results (%(default)s)")
    add_registry(parser, help="folder of the registry, for --accept (%(default)s)")
    add_pages(parser, "folder of the page (%(default)s)")
    parser.add_argument("--limit-minutes", type=zero_or_more, help="stop after so many minutes; a next run continues")
    add_former(parser, "--budget", "--limit-minutes", type=zero_or_more)
    parser.add_argument("--accept", action="store_true", help="write the named effect into the turnout's track file")
    parser.add_argument(
        "--finding",
        metavar="ID",
        help="finding to accept, if several are named, or the sections of a change in the worklist",
    )
    parser.add_argument("--anyway", action="store_true", help="accept a finding that is not named with grade A or B")


def run(args: argparse.Namespace) -> int:
    """Diagnose and print, or accept a finding.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.

    Raises
    ------
    ConfigError
        An option is given that acts with --accept only.
    """
    from turnout.errors import ConfigError
    from turnout.stages.mismatch_results import Results

    for option in () if args.accept else ("finding", "anyway"):
        if getattr(args, option):
            raise ConfigError(f"--{option}", "option", "it acts with --accept only", "Add --accept, or leave it out")
    results = Results(args.work, args.turnout, args.registry)
    if args.accept:
        return _accept(args, results)
    check_work_folder(args)
    from turnout.stages.budget import BudgetSpentError

    try:
        _save_and_print(args, results, _diagnose(args))
    except BudgetSpentError as spent:
        if spent.n_done:  # with no finished group the older result of all groups stays
            _save_and_print(args, results, spent.rows)
        raise
    return 0


def _save_and_print(args: argparse.Namespace, results: Results, rows: dict[str, list[dict]]) -> None:
    """Save, draw and print the rows."""
    from turnout.report.finding_pages import write_diagnosis_page

    results.save(rows)
    page = write_diagnosis_page(rows, args.configuration, args.turnout, args.pages)
    add_result(args, rows["mismatch_findings"])
    add_use(args, len(rows["mismatch_findings"]), len(rows["quarantine"]))
    print(_findings_text(rows))
    print(f"page: {page}")


def _diagnose(args: argparse.Namespace) -> dict[str, list[dict]]:
    """Rows by table of the requested visit."""
    from turnout.config import load_configuration
    from turnout.stages.mismatch_results import diagnose_turnout
    from turnout.workflow.future_dates import future_files
    from turnout.workflow.scan import scan

    configuration = load_configuration(args.configuration)
    add_warnings(args, input_warnings(configuration, args.turnout, args.raw))
    add_warnings(args, map(str, future_files(scan(configuration.turnout(args.turnout), Path(args.raw)).units)))
    with DiagnoseBar() as bar:
        return diagnose_turnout(
            args.turnout, args.configuration, args.raw, args.work, args.visit, args.track, tuple(args.sections),
            None if args.limit_minutes is None else 60.0 * args.limit_minutes, bar,
        )  # fmt: skip


def _accept(args: argparse.Namespace, results: Results) -> int:
    """Write the finding into the track file and print the change."""
    from turnout.stages.accept_finding import accept

    finding = results.finding(args.finding)
    path, words = accept(finding, args.configuration, args.turnout, args.track, args.anyway)
    print(f"{path}: {words}")
    if "onset_by_utc" in finding:
        print("From now on the calibrated model contains it; later changes are reported.")
    else:
        print("From now on the simulation contains it; each visit estimates it again, see mismatch_parameters.")
    return 0


def _findings_text(rows: dict[str, list[dict]]) -> str:
    """Findings, quarantine and notes in words."""
    lines = []
    for row in rows["mismatch_findings"]:
        verdict = row["verdict"].replace("_", " ") + (f", grade {row['grade']}" if row["grade"] else "")
        lines.append(f"sections {row['sections']}: {verdict}, probability {row['probability']:.2f}. {row['sentence']}")
        lines += [f"   {line}" for line in _details(row)]
    for row in rows["quarantine"]:
        lines.append(f"no answer for {row['place']}: {row['found']}")
    notes = dict.fromkeys(n for row in rows["mismatch_findings"] for n in (row["notes"] or "").splitlines())
    return "\n".join([*lines, *(f"note: {note}" for note in notes)])


def _details(row: Mapping[str, Any]) -> Iterator[str]:
    if row["n_held_out"]:
        names = ("before", "after", "rival", "decoy")
        fits_text = ", ".join(f"{n} {row[f'fit_{n}_pct']:.1f} %" for n in names if row[f"fit_{n}_pct"] is not None)
        yield f"fit on {count_of(row['n_held_out'], 'held-out recording')}: {fits_text}"
    if row["next_measurement"]:
        yield row["next_measurement"] + "."
    counts = ("hammer_tests", "hammer test"), ("passages", "passage"), ("sensors", "sensor")
    yield "from " + ", ".join(count_of(row[f"n_{column}"], noun) for column, noun in counts)


LOG_INTERVAL = 20.0  # s between two lines in a log
TIME_HINT = "neighbouring sections together; a group takes a minute to ten, more with many axles"


class DiagnoseBar:
    """Progress of a diagnosis: joint fits of a group, and simulations so far, which move during a long fit."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self.stream = stream or sys.stderr
        self.bar = None
        self.group_text, self.next_line, self.stage_text = "", time.monotonic() + LOG_INTERVAL, ""
        self.started_at: float | None = None

    def __enter__(self) -> DiagnoseBar:
        if self.stream.isatty():
            from tqdm import tqdm

            self.bar = tqdm(total=None, unit="fit", file=self.stream)
        return self

    def __exit__(self, *_: object) -> Literal[False]:
        if self.bar is not None:
            self.bar.close()
        return False

    def group(self, group: Group, number: int, count: int) -> Callable[[int, int, str], None]:
        """Begin a group; returns the callable that reports its joint fits.

        Parameters
        ----------
        group : Group
            Neighbouring sections that are diagnosed together.
        number, count : int
            Its number, from 0, and the number of groups.

        Returns
        -------
        callable
            Called with (number of joint fits done, total, candidate).
        """
        self._print_extent(number, count)
        self.group_text = f"{'+'.join(group.labels)} ({number + 1} of {count})"
        self.stage_text = "base fit"
        if self.bar is not None:
            self.bar.reset()
        self.simulations(0)

        def fits(n_done: int, n_total: int, what: str) -> None:
            self.stage_text = f"{n_done} of {n_total} joint fits, {what}"
            if self.bar is not None:
                self.bar.total = n_total
                self.bar.update(n_done - self.bar.n)

        return fits

    def _print_extent(self, number: int, count: int) -> None:
        """Print the number of groups at the start, and the finished ones later."""
        if self.started_at is None:
            self.started_at = time.monotonic()
            text = f"{count} {'group' if count == 1 else 'groups'}: {TIME_HINT}"
        else:
            text = f"{number} of {count} groups done, {(time.monotonic() - self.started_at) / 60.0:.1f} minutes so far"
        if self.bar is not None:
            self.bar.write(text, file=self.stream)
        else:
            print(text, file=self.stream, flush=True)

    def simulations(self, count: int) -> None:
        """Called at every prediction.

        Parameters
        ----------
        count : int
            Simulations of the group so far.
        """
        text = f"{self.group_text}: {self.stage_text[:60]}, {count} simulations"
        if self.bar is not None:
            self.bar.set_description(text, refresh=count % 10 == 0)
        elif time.monotonic() >= self.next_line:
            self.next_line = time.monotonic() + LOG_INTERVAL
            print(text, file=self.stream, flush=True)
