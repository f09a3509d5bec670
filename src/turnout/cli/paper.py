"""Print Tables 1 to 4 of the paper for a turnout and a campaign, each value with ± and n.

  turnout paper tommerup_s1                              the newest campaign
  turnout paper tommerup_s1 --campaign 2024-09-14
  turnout paper tommerup_s1 --format latex

Table 1: matrices of the ballast resonance. Table 2: of the railpad resonance. Table 3: poles, frequencies and damping
ratios. Table 4: fit of the model to hammer tests and to trains. ± is the standard error of the campaign value, in
Table 4 the standard deviation over the trains. n is the number of impacts or trains.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.options import add_registry

if TYPE_CHECKING:
    from typing import Any

    import duckdb

GROUP = "Simulate and diagnose"
HELP = "print Tables 1 to 4 of the paper for a turnout and a campaign"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Turnout, campaign, form of the tables and registry.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("turnout", help="turnout, as in turnouts.tsv")
    parser.add_argument("--campaign", metavar="DATE", help="its date, YYYY-MM-DD; by default the newest")
    parser.add_argument("--format", choices=("text", "csv", "latex"), default="text", help="form (%(default)s)")
    add_registry(parser)


def run(args: argparse.Namespace) -> int:
    """Print the tables; ConfigError for a turnout or campaign without models.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    from turnout.registry.database import open_registry
    from turnout.report.paper_tables import paper_tables, render

    with open_registry(args.registry) as connection:
        campaign = _campaign(connection, args.turnout, args.campaign)
        print(render(paper_tables(connection, args.turnout, campaign), args.format), end="")
    return 0


def _campaign(connection: duckdb.DuckDBPyConnection, turnout: str, date: str | None) -> str:
    """Id of the campaign."""
    from turnout.errors import ConfigError

    query = "select campaign_id from models_current where turnout_id = ? group by all order by max(measured_at_utc)"
    known: list[Any] = [row[0] for row in connection.execute(query, [turnout]).fetchall()]
    if not known:
        turnouts = connection.execute("select distinct turnout_id from models_current order by 1").fetchall()
        names = ", ".join(row[0] for row in turnouts) or "no turnout"
        raise ConfigError("turnout paper", "turnout", f"no model of {turnout!r}", f"The registry has models of {names}")
    if date is None:
        return str(known[-1])
    wanted = f"{turnout}/{date}"
    if wanted not in known:
        days = ", ".join(name.split("/", 1)[1] for name in known[-5:])
        observation = f"no campaign {date!r} of {turnout}; the newest are {days}"
        raise ConfigError("--campaign", "date", observation, "Write one of them as YYYY-MM-DD")
    return wanted
