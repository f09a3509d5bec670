"""Write the pages of a registry: one for the fleet, one for each turnout.

turnout report                       all pages, as of today
turnout report --day 2026-03-01      list and states as of that day, as far as they change without a measurement
turnout report --turnouts tommerup_s1 tommerup_s2
"""

import argparse

from turnout.cli.options import add_cores, add_pages, add_registry, add_turnouts
from turnout.counts import count_of

GROUP = "Run"
HELP = "write the pages of the fleet and of each turnout"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    add_registry(parser)
    add_pages(parser, "where the pages go (%(default)s)")
    add_turnouts(parser, "only these turnouts' pages, and the fleet's")
    parser.add_argument("--day", metavar="DATE", help="list and states of that day, YYYY-MM-DD, instead of today")
    add_cores(parser, "processes that draw pages (%(default)s)", default=1)


def run(args: argparse.Namespace) -> int:
    """Write the pages and print their folder.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    from turnout.report.job import report_job

    day = _day(args.day)
    n = report_job(args.registry, args.pages, args.turnouts, threads=args.cores, day=day)
    print(f"{count_of(n, 'page')} written, the others had not changed: {args.pages}/index.html")
    if note := f"As of {day}." if day else _older_day_hint(args.registry):
        print(note)
    return 0


def _day(text: str | None) -> str | None:
    """The requested day, None without one; ConfigError if it is invalid."""
    from datetime import date

    from turnout.config.events import day_problem
    from turnout.errors import ConfigError

    if not text:
        return None
    if problem := day_problem(text):
        raise ConfigError("--day", "date", f"{text!r}{problem[0]}", problem[1])
    return date.fromisoformat(text).isoformat()


def _older_day_hint(registry: str) -> str:
    """A hint to an earlier day if charts of today's pages are too old, else ""."""
    from turnout.registry.as_of import counts_of, list_day, past_day_hint
    from turnout.registry.database import open_registry

    with open_registry(registry) as con:
        *_, n_unmeasured, newest = counts_of(con, list_day(con))
    return past_day_hint(newest, "turnout report --day", "pages") if n_unmeasured and newest else ""
