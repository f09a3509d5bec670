"""Print Tables 1 to 4 of the paper for a turnout and a campaign, each value with ± and n.

  turnout paper tommerup_s1                                the newest campaign
  turnout paper tommerup_s1 --campaign 2024-09-14
  turnout paper tommerup_s1 --format latex
  turnout paper tommerup_s2 --table 4 --figure bars.html   fits to trains, and charts by type, speed and axle load

Table 1: matrices of the ballast resonance. Table 2: of the railpad resonance. Table 3: poles, frequencies and damping
ratios. Table 4: fit of the model to hammer tests and to trains. ± is the standard error of the campaign value, in
Table 4 the standard deviation over the trains. n is the number of impacts or trains. Table 4 has the trains of the
paper, IC3 at 160 km/h, beside what random models reach on the same data. Table 5 has the fits of all trains by type,
speed and axle load, which the paper shows as bars; it is printed on request.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.option_types import SPEED, whole_number
from turnout.cli.options import add_figure, add_former, add_registry, check_output_files

if TYPE_CHECKING:
    from typing import Any

    import duckdb

GROUP = "Results"
HELP = "print the tables of the paper for a turnout and a campaign"
PAPER_TRAIN = "IC3"  # the trains of Table 4, also where none has been recorded


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
    parser.add_argument(
        "--table", type=whole_number, choices=(1, 2, 3, 4, 5), help="only this table; by default 1 to 4"
    )
    parser.add_argument("--train-type", default=PAPER_TRAIN, help="trains of Table 4 (%(default)s)")
    parser.add_argument(
        "--speed", type=SPEED, default=160.0, help="their speed on the main track in km/h (%(default)g)"
    )
    add_figure(parser, "draw bar charts of the fit by type, speed and axle load into this HTML file")
    add_former(parser, "--bars", "--figure")
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
    from turnout.report.paper_tables import class_rows, class_table, paper_tables, render

    check_output_files(args, "--figure")
    with open_registry(args.registry) as connection:
        _check_train_type(connection, args.turnout, args.train_type)
        campaign = _campaign(connection, args.turnout, args.campaign)
        tables = list(paper_tables(connection, args.turnout, campaign, args.train_type, args.speed))
        bars = class_rows(connection, args.turnout)
        if args.table is not None:
            tables = [table for table in (*tables, class_table(bars)) if table.number == args.table]
        if args.figure:
            _write_bars(args.figure, connection, args.turnout, bars)
    print(render(tables, args.format), end="")
    return 0


def _write_bars(path: str, connection: duckdb.DuckDBPyConnection, turnout: str, rows: list[dict[str, Any]]) -> None:
    """Write the bar charts of a turnout; ConfigError without a scored passage."""
    from turnout.errors import ConfigError
    from turnout.files import write_text
    from turnout.report.site import bars_page

    if not rows:
        remedy = "Record passages, or raise passage.scored_share"
        raise ConfigError("--figure", "passages", f"no scored passage of {turnout}", remedy)
    cursor = connection.execute("select * from sections where turnout_id = ? order by position_m, label", [turnout])
    sections = [dict(zip((d[0] for d in cursor.description), row)) for row in cursor.fetchall()]
    write_text(path, bars_page(turnout, rows, sections))


def _check_train_type(connection: duckdb.DuckDBPyConnection, turnout: str, wanted: str) -> None:
    """ConfigError for a train type that no passage of the turnout has."""
    from turnout.errors import ConfigError

    query = (
        "select distinct train_type from passages_current where turnout_id = ? and train_type is not null order by 1"
    )
    known = [row[0] for row in connection.execute(query, [turnout]).fetchall()]
    if wanted not in (*known, PAPER_TRAIN):
        remedy = (
            f"Write one of {', '.join(known)}" if known else f"Leave it out: {turnout} has no passage of a known type"
        )
        raise ConfigError("turnout paper", "--train-type", f"no train of the type {wanted!r}", remedy)


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
