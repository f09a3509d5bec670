"""Test the diagnosis on recordings in which an effect is concealed, on your own machine.

  turnout blind make --out proof --truth proof-truth           campaigns, and the sealed true effects
  turnout blind diagnose --out proof --truth proof-truth       the tool reads the campaigns and cannot read the truth
  turnout blind reveal --out proof --truth proof-truth         opens the envelopes, verifies every hash
  turnout blind score --out proof                              every figure with its interval

An interrupted make or diagnose continues where it stopped. --fast makes 40 cases instead of 235. --effects-folder adds
effects of your own, one file each. --panel crossing or switch puts all cases into such panels. --histories N makes N
sites that are visited for two years; diagnose --histories uses the calibrated model, and score --histories its answers.
make prints the hash of commit.json: publish it before the diagnosis.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.option_types import above_zero, at_least_one
from turnout.cli.options import add_cores, add_former, add_use, check_output_files
from turnout.counts import count_of

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Any

GROUP = "Simulate and diagnose"
HELP = "test the diagnosis on concealed effects: make, diagnose, reveal, score"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    steps = parser.add_subparsers(dest="step", metavar="step", required=True)
    make = steps.add_parser("make", help="make a set and seal its truth")
    make.add_argument(
        "--seed", type=_seed,
        help="seed of the set; 'tool': the hash of the tool's sources, which nobody can choose (default: random)",
    )  # fmt: skip
    make.add_argument("--fast", action="store_true", help="the fast tier of 40 cases")
    make.add_argument("--effects-folder", action="append", default=[], help="folder with effects of your own")
    make.add_argument("--only", help="kinds of effects beside the controls, separated by commas, such as void,dip")
    make.add_argument("--limit", type=at_least_one, help="the first so many cases of the shuffled set")
    make.add_argument(
        "--panel", choices=("plain", "crossing", "switch"), default="plain", help="panel of all cases (default: plain)"
    )
    add_cores(make, "processes (%(default)s)", default=1)
    add_former(make, "--workers", "--cores", type=at_least_one)
    make.add_argument("--histories", type=at_least_one, metavar="N", help="N sites with a history of two years")
    make.add_argument(
        "--passages", type=at_least_one, help="passages at each visit of a history (default 1; with --histories)"
    )
    diagnose = steps.add_parser("diagnose", help="diagnose every case without access to the truth")
    diagnose.add_argument(
        "--command", dest="tool", help="command of the tool; {python}, {case}, {folder}, {out} are filled in"
    )
    diagnose.add_argument("--histories", action="store_true", help="the set has histories: use the calibrated model")
    diagnose.add_argument("--cases", help="only these cases, separated by commas")
    diagnose.add_argument("--timeout", type=above_zero, default=1800.0, help="elapsed time per case [s] (default 1800)")
    diagnose.add_argument("--cpu", type=above_zero, default=900.0, help="CPU time per case [s] (default 900)")
    diagnose.add_argument("--again", action="store_true", help="also cases that failed or exceeded their budget")
    diagnose.add_argument("--ablation", metavar="NAME", help="store the findings as those of a reduced tool")
    add_cores(diagnose, "processes, each with one case at a time (%(default)s)", default=1)
    add_former(diagnose, "--workers", "--cores", type=at_least_one)
    reveal = steps.add_parser("reveal", help="open the envelopes and verify every hash")
    reveal.add_argument(
        "--incomplete", action="store_true", help="although cases are not diagnosed: they count as cases without answer"
    )
    score = steps.add_parser("score", help="print every figure with its interval")
    score.add_argument("--histories", action="store_true", help="the set has histories")
    score.add_argument("--names", help="JSON file {effect: [names of the tool that are right]} to add")
    score.add_argument("--report", help="file to write the report to, as Markdown")
    score.add_argument("--page", help="page with marks for report, pictures and stories, as docs/blind_figures.md")
    score.add_argument("--stories", help="cases described on the page, separated by commas (default: three)")
    score.add_argument("--effects-folder", action="append", default=[], help="folder with effects of your own")
    keep = steps.add_parser("keep", help="store a revealed set without recordings: seals, truths, findings")
    keep.add_argument("--folder", required=True, help="folder to write")
    for sub in (make, diagnose, reveal, score, keep):
        if sub is score:
            sub.add_argument("--out", required=True, nargs="+", help="folder of the set; several are pooled")
            continue
        sub.add_argument("--out", required=True, help="folder of the set")
        sub.add_argument("--truth", help="folder of the truth (default: --out followed by -truth)")


def run(args: argparse.Namespace) -> None:
    """Run the step.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.
    """
    {"make": _make, "diagnose": _diagnose, "reveal": _reveal, "score": _score, "keep": _keep}[args.step](args)


def _seed(text: str) -> str | int:
    from argparse import ArgumentTypeError

    if text != "tool" and not text.isdecimal():
        raise ArgumentTypeError(f"{text!r} is neither a whole number nor 'tool'")
    return text if text == "tool" else int(text)


def _truth(args: argparse.Namespace) -> str:
    return args.truth or args.out.rstrip("/") + "-truth"


def _make(args: argparse.Namespace) -> None:
    from pathlib import Path

    from turnout.child_processes import ProcessPool
    from turnout_blind.make import make_set
    from turnout_blind.seal import BlindError

    for folder in args.effects_folder:
        if not any(path for path in Path(folder).glob("*.py") if not path.name.startswith("_")):
            raise BlindError(
                folder, "--effects-folder", "no file of an effect", "Name a folder with one file .py per effect"
            )
    if args.passages and not args.histories:
        raise BlindError("--passages", args.passages, "only histories have this option", "Give --histories N, too")
    only = args.only.split(",") if args.only else None
    histories = (args.histories, args.passages or 1) if args.histories else None
    sha = make_set(
        args.out, _truth(args), args.seed, not args.fast, args.effects_folder, only, args.limit, args.panel, args.cores,
        _bar, histories, ProcessPool,
    )  # fmt: skip
    print(f"sealed: SHA-256 of commit.json is {sha}; the truth lies in {_truth(args)}")


def _bar(results: Iterable[Any], total: int) -> Iterable[Any]:
    from tqdm import tqdm

    return tqdm(results, desc="cases", unit="case", total=total, disable=None)


def _diagnose(args: argparse.Namespace) -> None:
    from turnout_blind.diagnose import COMMAND, HISTORY_COMMAND, diagnose_set
    from turnout_blind.seal import check_kind

    if not args.tool:
        check_kind(args.out, _truth(args), args.histories)
    command = args.tool or (HISTORY_COMMAND if args.histories else COMMAND)
    only = args.cases.split(",") if args.cases else None
    record = diagnose_set(
        args.out, _truth(args), command, only, args.timeout, args.cores, cpu=args.cpu,
        again=args.again, progress=_bar, label=args.ablation,
    )  # fmt: skip
    failed = sum(run["status"] != "answered" for run in record["cases"].values())
    add_use(args, len(record["cases"]) - failed, failed)
    print(f"{len(record['cases'])} cases diagnosed, {failed} without an answer; truth hidden by {record['isolation']}")


def _reveal(args: argparse.Namespace) -> None:
    from pathlib import Path

    from turnout_blind.reveal import reveal, undiagnosed_cases
    from turnout_blind.seal import BlindError

    left, is_begun = undiagnosed_cases(args.out), (Path(args.out) / "diagnosis.json").exists()
    if left and is_begun and not (args.incomplete or (Path(args.out) / "revealed").exists()):
        remedy = "Go on with turnout blind diagnose: a revealed set cannot be diagnosed. Or give --incomplete"
        raise BlindError(args.out, "reveal", f"{count_of(len(left), 'case')} not diagnosed yet", remedy)
    truths = reveal(args.out, _truth(args))
    without = f", {count_of(len(left), 'case')} without a diagnosis" if left else ""
    print(f"{len(truths)} envelopes opened, every hash verified{without}: {args.out}/revealed")


def _score(args: argparse.Namespace) -> None:
    import json
    from pathlib import Path

    from turnout.files import write_text
    from turnout_blind.score.histories import history_text
    from turnout_blind.score.report import report_text
    from turnout_blind.seal import BlindError, check_kind

    check_output_files(args, "--report", "--page")
    for out in args.out:
        check_kind(out, Path(out) / "revealed", args.histories)
    if args.page and (args.histories or len(args.out) > 1):
        raise BlindError(args.page, "--page", "a page shows one set of single visits", "Give one --out, no --histories")
    if args.histories:
        text = history_text(args.out)
        if args.report:
            write_text(args.report, text)
        print(text)
        return
    names = json.loads(Path(args.names).read_text()) if args.names else None
    text = report_text(args.out, names)
    if args.page:
        from turnout_blind.score.page import write_page

        write_page(
            args.page, args.out[0], names, args.effects_folder, args.stories.split(",") if args.stories else None
        )
    if args.report:
        write_text(args.report, text)
    print(text)


def _keep(args: argparse.Namespace) -> None:
    from turnout_blind.archive import write_archive

    path = write_archive(args.out, args.folder, _truth(args))
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")
