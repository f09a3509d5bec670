"""Simulate a hammer test or a train passage, and write a raw file like that of a measuring system.

  turnout simulate hammer  --track tommerup --section A7 --tests 3
  turnout simulate passage --track tommerup --vehicle ic3 --speed 160 --turnout tommerup_s1
  turnout simulate figures --out docs/gallery

With --turnout the channels are those of the configuration, and the file goes to the raw folder of the turnout, where
the workflow finds it. A file of the same name below --truth holds the true values: the track and its effects, position
and force of each impact, or the forces of the wheels.
"""

import argparse

from turnout.cli.option_types import RAIL_TEMPERATURE, SPEED, finite_number, whole_number
from turnout.cli.options import (
    add_configuration,
    add_former,
    add_raw,
    add_track,
    add_turnout,
    add_warnings,
    check_output_files,
)

GROUP = "Simulate and diagnose"
HELP = "simulate a hammer test or a train passage"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    subcommands = parser.add_subparsers(dest="kind", metavar="kind", required=True)
    hammer = subcommands.add_parser("hammer", help="impacts of a hammer at one section")
    hammer.add_argument(
        "--section", required=True, help="section of the track file, or, without --turnout, a position [m]"
    )
    hammer.add_argument(
        "--tests", type=whole_number, default=1, help="tests, one file each; --out takes one (default 1)"
    )
    hammer.add_argument("--impacts", type=whole_number, default=10, help="impacts per test (default 10)")
    add_former(hammer, "--blows", "--impacts", type=whole_number)
    passage = subcommands.add_parser("passage", help="one train over the turnout")
    passage.add_argument("--vehicle", default="ic3", help="file in config/vehicles, or its path (default ic3)")
    passage.add_argument("--speed", type=SPEED, default=160.0, help="speed [km/h] (default 160)")
    passage.add_argument(
        "--load",
        type=finite_number,
        default=0.5,
        help="share of the payload, 0 (empty) to 1 (full), overloaded up to 1.5 (default 0.5)",
    )
    passage.add_argument("--units", type=whole_number, default=1, help="coupled units (default 1)")
    passage.add_argument("--route", default="main", help="route of the track file (default main)")
    passage.add_argument("--direction", choices=("facing", "trailing"), default="facing")
    for sub in (hammer, passage):
        add_track(sub)
        add_turnout(sub, "id in config/turnouts.tsv", required=False)
        add_configuration(sub, dest="config")
        add_raw(sub)
        sub.add_argument("--truth", help="folder of the true values; the workflow does not read it")
        sub.add_argument("--out", help="file to write, instead of one below --raw")
        sub.add_argument("--format", help="format of the file (default: by the ending of --out, else hdf5)")
        sub.add_argument("--at", default="2024-05-13T09:00:00", help="UTC of the first sample, no zone (%(default)s)")
        sub.add_argument("--temperature", type=RAIL_TEMPERATURE, help="rail temperature to note [°C]")
        sub.add_argument(
            "--seed",
            type=whole_number,
            default=0,
            help="seed of noise, scatter of supports and roughness; the same for trains on one rail (default 0)",
        )
    figures = subcommands.add_parser("figures", help="the figures of docs/simulation.md")
    figures.add_argument("--out", default="docs/gallery", help="folder (default docs/gallery)")


def run(args: argparse.Namespace) -> int:
    """Simulate and write.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    if args.kind == "figures":
        from turnout.report.simulation_figures import draw_all

        for path in draw_all(args.out):
            print(path)
        return 0
    from turnout.stages.parameter_ranges import improbable_in_files
    from turnout.stages.simulate import hammer_warnings, model_files, write_hammer, write_passage

    check_output_files(args, "--out")
    add_warnings(args, improbable_in_files(model_files(vars(args))))
    if args.kind == "hammer":
        add_warnings(args, hammer_warnings(vars(args)))
    write = write_hammer if args.kind == "hammer" else write_passage
    for path, note in write(vars(args)):
        print(f"{path}: {note}")
    return 0
