"""Show the worklist: what to inspect, what to plan, and where the data allow no answer.

turnout worklist                      the list of today
turnout worklist --as-of 2026-03-01   the list of that day, from what was measured and entered by then
turnout worklist --all                every row, also beyond the limit of the list
turnout worklist --csv list.csv
"""

from __future__ import annotations

import argparse
import csv
from typing import TYPE_CHECKING

from turnout.cli.options import add_csv, add_former, add_registry, add_result, check_output_files
from turnout.cli.query import open_output
from turnout.counts import count_of
from turnout.registry.spreadsheet import without_formula

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from datetime import datetime
    from typing import Any, TextIO

    import duckdb

FIRST_MEASUREMENT_QUERY = "select min(measured_at_utc) from charts where state <> 'wrong_time'"
NEWEST_CAMPAIGN_QUERY = """
    select coalesce(min(split_part(campaign_id, '/', -1)), '') from models_current
    where measured_at_utc = newest_charted()"""
GROUP = "Worklist and maintenance"
HELP = "show what to inspect, what to plan, and where the data allow no answer"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Folder of the registry, date of the list and output file.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    add_registry(parser)
    parser.add_argument("--as-of", metavar="DATE", help="as it was then: YYYY-MM-DD, UTC")
    add_former(parser, "--asof", "--as-of")
    parser.add_argument("--all", action="store_true", help="every row; open alarms are never left out anyway")
    add_csv(parser)


def run(args: argparse.Namespace) -> int:
    """Print the list, or write it as comma-separated values.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    from turnout.registry.as_of import counts_of, list_day, whole_list
    from turnout.registry.database import open_registry

    check_output_files(args, "--csv")
    with open_registry(args.registry) as con:
        day = [_day(args.as_of, con)] if args.as_of else []
        today = list_day(con)
        asof = "?::timestamp" if args.as_of else today
        rows_of = whole_list(asof) if args.all else f"worklist({asof})"
        question = f"select * from {rows_of} order by rank"
        cursor = con.execute(question, day)
        names = [d[0] for d in cursor.description]
        rows = cursor.fetchall()
        ((newest,),) = con.execute("select newest_charted()").fetchall()
        is_past = bool(day) and newest is not None and day[0] < newest
        counts = counts_of(con, today if is_past or not day else f"timestamp '{day[0]}'")
        ((campaign,),) = con.execute(NEWEST_CAMPAIGN_QUERY).fetchall()
    add_result(args, [dict(zip(names, row)) for row in rows])
    if args.csv:
        with open_output(args.csv) as stream:
            _write(stream, names, rows)
    else:
        print(as_text([dict(zip(names, row)) for row in rows], *(counts[:1] if is_past else (*counts, campaign))))
    return 0


def as_text(
    rows: Sequence[Mapping[str, Any]],
    n_charts: int = 0,
    n_suppressed: int = 0,
    n_unmeasured: int = 0,
    newest: datetime | None = None,
    campaign: str = "",
) -> str:
    """The list for a terminal: one paragraph per row, then the number of rows left out and of charts.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the view ``worklist``, in their order.
    n_charts, n_suppressed, n_unmeasured : int
        Number of charts, of those that somebody suppressed, and of those not measured for too long.
    newest : datetime, optional
        Time of the newest campaign; None for the list of an earlier day.
    campaign : str
        Name of the newest campaign; "" for the day of ``newest``.

    Returns
    -------
    str
        Several lines.
    """
    text = [_paragraph(row) for row in rows]
    if not rows and n_charts:
        n_judged = n_charts - n_suppressed - n_unmeasured
        text = [
            f"Nothing to do: of {count_of(n_judged, 'chart')} none is in alarm or drifts."
            if n_judged
            else "No answer: no chart has recent measurements by which it can be judged."
        ]
    if rows and rows[0]["n_in_all"] > len(rows):
        text.append(f"... and {rows[0]['n_in_all'] - len(rows)} more: turnout worklist --all")
    if not n_charts:
        return "\n".join([*text, "No chart has been computed yet: the registry holds no campaign that can be used."])
    if newest is None:  # a list of an earlier day: suppressed and unmeasured charts are not counted
        return "\n".join(text)
    exclusions = [(n_suppressed, "suppressed by a user"), (n_unmeasured, "not measured for too long")]
    phrases = [f"{n} {word}" for n, word in exclusions if n]
    text.append(
        f"Of {n_charts} charts, newest campaign {campaign or f'{newest:%Y-%m-%d}'}"
        + (": " + ", ".join(phrases) if phrases else "")
        + "."
    )
    if n_unmeasured:
        from turnout.registry.as_of import past_day_hint

        text.append(past_day_hint(newest, "turnout worklist --as-of", "list"))
    return "\n".join(text)


def _paragraph(row: Mapping[str, Any]) -> str:
    from turnout.registry.as_of import chart_in_words

    where = row["turnout_id"] + (f" ({row['name']})" if row["name"] else "")
    lines = [
        f"{row['rank']:>2}. {row['state'].upper()}: {where}, {row['sections']}, {chart_in_words(row['component'])}",
        f"    {row['sentence']}",
    ]
    lines.append(f"    How sure: {row['false_alarm_words']}.")
    lines.append(f"    Last maintenance: {row['last_maintenance'] or 'none known'}. Look at: {row['look_at']}.")
    if row.get("diagnosis"):
        lines.append(f"    Diagnosis: {row['diagnosis']}.")
    return "\n".join(lines)


def _write(stream: TextIO, names: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([without_formula(value) for value in row] for row in rows)


def _day(text: str, con: duckdb.DuckDBPyConnection) -> datetime:
    """The time of ``--as-of``; ConfigError if it is invalid or before the first measurement."""
    from turnout.config.events import parse_utc, time_problem
    from turnout.errors import ConfigError

    if fault := time_problem(text):
        raise ConfigError("--as-of", "date", f"{text!r}{fault[0]}", fault[1])
    day = parse_utc(text)
    ((first,),) = con.execute(FIRST_MEASUREMENT_QUERY).fetchall()
    if first is not None and day < first:
        observation = f"{text!r}: nothing was measured by then, the first measurement is of {first:%Y-%m-%d %H:%M} UTC"
        raise ConfigError("--as-of", "date", observation, "Ask for a later day")
    return day
