"""Analyse one hammer test: whether it is good enough, and its resonances.

  turnout hammer raw/tommerup_s1/hammer/2024-01-23/A7_*.uff --turnout tommerup_s1
  turnout hammer /media/stick/log_17.uff --turnout tommerup_s1 --section A7 --campaign 2024-05-13 --figure a7.svg

It shows which files and records were read, which impacts are accepted or rejected and why, the coherence, and
frequency, damping and dynamic stiffness of both resonances with their 95 % intervals, or why there is none. Impacts and
records are counted from 1. Nothing is written except the figure of --figure.

The computation and the settings are those of the nightly run. Name all files of a section, because impacts are compared
with each other. Files outside the raw folder need --section and --campaign if their names and times do not state them.
Files of averaged frequency responses (UFF58 function type 4, text with complex columns, npz) give modes with errors,
but no impact can be judged.

Exit code 1 if a test gives no resonance, 2 if the command line or an input is wrong.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.options import add_configuration, add_figure, add_raw, add_turnout, check_output_files

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from turnout.stages.requested_units import RequestedUnit

GROUP = "Look at recordings"
HELP = "analyse one hammer test, without storing results"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The files, the turnout, and options for what the file names do not give.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("file", nargs="+", help="files of the test, in any format that is read")
    add_turnout(parser, "id of the turnout, for its sections and channels")
    parser.add_argument("--section", help="label of the section, if the file name does not state it")
    parser.add_argument("--campaign", help="day of the campaign, YYYY-MM-DD, if neither name nor file states it")
    add_figure(parser, "draw receptance, coherence, decay and impacts into this SVG file")
    add_configuration(parser)
    add_raw(parser, help="raw root, with the campaigns.csv of the turnout (raw)", default=None)


def run(args: argparse.Namespace) -> int:
    """Print the results of each section's test; exit code 1 if one gives no resonance.

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
        The raw folder is absent, or the figure cannot be written.
    """
    from pathlib import Path

    from turnout.config import load_configuration
    from turnout.errors import ConfigError
    from turnout.report.hammer_text import hammer_words, is_usable
    from turnout.stages.requested_units import requested_units

    check_output_files(args, "--figure")
    if args.raw and not Path(args.raw).is_dir():
        raise ConfigError(
            args.raw, "--raw", "no such folder", "Write the folder that holds the folders of the turnouts"
        )
    configuration = load_configuration(args.configuration)
    folders = {name: row.raw for name, row in configuration.rows.items()}
    turnout, raw = configuration.turnout(args.turnout), Path(args.raw or "raw")
    tests = requested_units(args.file, turnout, raw, args.section, args.campaign, folders)
    if args.figure:
        _check_figure(Path(args.figure), tests)
    usable = True
    for k, test in enumerate(tests):
        if k:
            print()
        rows = test.rows()
        usable = is_usable(rows) and usable
        print("\n".join(hammer_words(rows, test.unit, test.turnout, test.remarks)))
        if args.figure:
            _draw(Path(args.figure), rows, test)
    return 0 if usable else 1


def _check_figure(path: Path, tests: Sequence[RequestedUnit]) -> None:
    """ConfigError for a figure that cannot be written, before anything is computed."""
    from turnout.errors import ConfigError

    if path.suffix.lower() != ".svg":
        remedy = "Write a name that ends in .svg; every browser shows and prints it"
        raise ConfigError(path, "--figure", f"{path.suffix!r} is not a supported figure format", remedy)
    if len(tests) > 1:
        labels = ", ".join(test.unit.label for test in tests)
        raise ConfigError(path, "--figure", f"one figure for {labels}", "Name the files of one section and campaign")


def _draw(path: Path, rows: dict[str, list[dict]], test: RequestedUnit) -> None:
    from turnout.report.hammer_figure import hammer_figure
    from turnout.report.site import replace_page

    drawing = hammer_figure(rows, test.unit, test.turnout)
    if not drawing:
        print("  figure     none: no impact was read")
        return
    replace_page(path, drawing)
    print(f"  figure     {path}")
