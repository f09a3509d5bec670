"""Make a demonstration fleet, run the whole workflow on it, and compare the results with the truth.

Three turnouts with the paper's eight locations over three years: raw files in five formats below raw/,
with double impacts, overloads, a cut-off file, a dead channel, a reversed sign, a missing temperature, maintenance,
one true drift and one sleeper that comes to hang. One turnout has five trains a week for 70 weeks, and a weld that
becomes a dip, which only trains show. The true values are below truth/, which the workflow does not read. The same seed
gives the same samples. The configuration that comes with the program (config/) describes these turnouts.
"""

import argparse

from turnout.cli.option_types import whole_number
from turnout.cli.options import add_cores

GROUP = "Examples"
HELP = "make a demonstration fleet and run the whole workflow on it"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("--seed", type=whole_number, default=1, help="another seed makes another fleet (default 1)")
    parser.add_argument("--campaigns", type=whole_number, default=24, help="campaigns per turnout (default 24)")
    parser.add_argument(
        "--passages",
        type=whole_number,
        default=6,
        help="train passages per turnout without weekly trains, 0: no trains at all (default 6)",
    )
    add_cores(parser, "processors to use (default: all)", default=None)
    parser.add_argument("--only-raw", action="store_true", help="make the raw files and stop")


def run(args: argparse.Namespace) -> int:
    """Make the fleet, run the workflow, print the results.

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
        A number is too small, or the folder holds other turnouts.
    """
    import os
    from pathlib import Path

    from turnout.config.turnouts_table import read_table
    from turnout.demo.fleet import make_fleet, run_pipeline
    from turnout.demo.scenario import FLEET, campaign_days
    from turnout.demo.summary import print_summary
    from turnout.demo.train_clusters import write_clusters
    from turnout.errors import ConfigError
    from turnout.workflow.project import use_demonstration

    for option, minimum in (("campaigns", 1), ("passages", 0)):
        if getattr(args, option) < minimum:
            observation = f"{getattr(args, option)}, and the fewest are {minimum}"
            raise ConfigError(f"--{option}", "number", observation, f"Write {minimum} or more")
    use_demonstration(Path())
    rows, _ = read_table(Path("config", "turnouts.tsv"), "config/turnouts.tsv")
    if missing := sorted({turnout.turnout for turnout in FLEET} - {row.id for row in rows}):
        remedy = "Run the command in an empty folder: it writes recordings into raw/"
        raise ConfigError("config/turnouts.tsv", "the table", f"no turnout {missing[0]!r} of the demonstration", remedy)
    cores = args.cores or os.cpu_count() or 1
    print("1. Raw files of the demonstration fleet", flush=True)
    n = make_fleet("raw", "truth", seed=args.seed, n_campaign=args.campaigns, n_passage=args.passages, workers=cores)
    print(f"   {n} files below raw/. What is true of them lies below truth/, which the workflow does not read.")
    if args.passages:
        write_clusters("raw")
    if args.only_raw:
        return 0
    print("2. The workflow; all of its output is in logs/workflow.log", flush=True)
    last = max(campaign_days(args.campaigns))  # list and pages of that day, not of one years later
    code = run_pipeline(cores, "--config", f"day={last}")
    if code == 0:
        print("3. What was found\n", flush=True)
        print_summary("results/registry", "results/pages", day=last.isoformat(), truth="truth")
    return code
