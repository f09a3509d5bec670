"""Run the whole workflow unattended. Only one run is possible at a time. The last line states the result.

  0 2 * * *   cd /srv/turnouts && mkdir -p logs && /opt/env/bin/turnout nightly --limit-hours 6 >> logs/nightly.log 2>&1
  0 14 1 * *  cd /srv/turnouts && /opt/env/bin/turnout registry vacuum && /opt/env/bin/turnout registry compact
  turnout nightly --profile profiles/slurm
  turnout nightly -- --config accept_vanished=true

The first two lines are for cron: the folder of the project, and what `command -v turnout` prints.
The exit code is 0 only if every job ran and the results may be trusted. The registry is published in any case, with
what was computed until a job failed or was ended. The last sixth of --limit-hours is reserved for publishing. The next
run continues where this one ended. docs/operation.md lists the options after --config.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from turnout.cli.option_types import above_zero
from turnout.cli.options import add_result, add_use

if TYPE_CHECKING:
    from collections.abc import Sequence

GROUP = "Run"
HELP = "run the whole workflow unattended"
INTERRUPTED = 130
CONFIG_OPTIONS = ("--config", "-C")
# Options of Snakemake with which the configuration may be elsewhere.
MOVING_OPTIONS = ("--configfile", "--directory", "-d", "--snakefile", "-s")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Profile, time limit [h] and options of Snakemake.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("--profile", default="profiles/default", help="folder of the profile (%(default)s)")
    parser.add_argument("--limit-hours", type=above_zero, default=None, help="end a run that takes longer")
    parser.add_argument("options", nargs="*", help="options of Snakemake, after --")


def run(args: argparse.Namespace) -> int:
    """Run the workflow once, print its one line, and return its exit code.

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
        A word that is no option, an option with a wrong value, or a folder that is no project.
    ConfigErrors
        The configuration has errors.
    """
    from dataclasses import asdict

    from turnout.workflow.nightly import nightly

    _require_options(args.options)
    if not any(word.startswith(MOVING_OPTIONS) for word in args.options):
        _require_valid_project(args.options)
    limit = None if args.limit_hours is None else 3600.0 * args.limit_hours
    try:
        night = nightly(args.options, args.profile, limit, quiet=args.quiet)
    except KeyboardInterrupt:
        return INTERRUPTED
    add_result(args, asdict(night))
    add_use(args, n_used=0 if night.nothing_usable else 1, n_left_out=len(night.unused))
    print(night)
    not_sent = _alert(args.options) if night.has_ended_well and night.published else 0
    return night.code or not_sent


def _configuration_folder(options: Sequence[str]) -> str:
    return str(_config_options(options).get("configuration", "config"))


def _config_options(options: Sequence[str]) -> dict[str, Any]:
    """Keys and values behind ``--config``, typed as Snakemake types them, for the checks before it starts."""
    values: dict[str, Any] = {}
    is_behind = False
    for word in options:
        option, _, rest = word.partition("=")
        if word.startswith("-"):
            is_behind = option in CONFIG_OPTIONS
            word = rest if is_behind else ""
        if is_behind and "=" in word:
            key, _, value = word.partition("=")
            values[key] = int(value) if value.isdecimal() else value.strip("'\"")
    return values


def _require_options(options: Sequence[str]) -> None:
    """ConfigError if the first word is no option: Snakemake would take it for a file to make."""
    from turnout.errors import ConfigError

    if options and not options[0].startswith("-"):
        word = options[0]
        key = f"turnouts={word}" if "=" not in word else word
        remedy = f"Options of Snakemake stand behind --, as in 'turnout nightly -- --config {key}'"
        raise ConfigError("turnout nightly", "options", f"{word!r} is no option", remedy)


def _require_valid_project(options: Sequence[str]) -> None:
    """Check table, configuration and options before anything is written; Snakemake's message would be a traceback."""
    from pathlib import Path

    from turnout.config.turnouts_table import read_table
    from turnout.readers.formats import FORMATS
    from turnout.units import to_si
    from turnout.workflow.launch import launch
    from turnout.workflow.output_places import require_writable_places
    from turnout.workflow.project import snakefile_options

    values = _config_options(options)
    table = Path(_configuration_folder(options)) / "turnouts.tsv"
    if table.exists():
        require_writable_places()
        launch({name: values[name] for name in values if name != "functions"}, False, FORMATS, to_si)
    elif "configuration" in values or snakefile_options(Path()):  # else the own Snakefile may name another folder
        raise read_table(table, str(table))[1][0]


def _alert(options: Sequence[str]) -> int:
    """Send new entries of the worklist if the configuration asks for it; 1 if a server does not take them."""
    import sys

    from turnout.config import load_configuration
    from turnout.errors import TurnoutError
    from turnout.workflow.alerts import has_channel, send_new_entries
    from turnout.workflow.nightly import GENERATION

    settings = load_configuration(_configuration_folder(options), leave_out=True).settings["alerts"]
    if not has_channel(settings):
        return 0
    try:
        send_new_entries(GENERATION.parent, settings)
    except TurnoutError as error:
        print(f"turnout nightly: {error}", file=sys.stderr)
        return 1
    return 0
