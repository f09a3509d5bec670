"""Tomorrow's list: what to inspect, what to plan, where nothing can be said.

turnout worklist                      the list of the newest measurement
turnout worklist --asof 2026-03-01    the list as it would have been then
turnout worklist --csv list.csv
"""

import argparse
import csv

from turnout.commands.query import opened

HELP = "tomorrow's list: what to inspect, what to plan, where nothing can be said"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where the registry lies, the date asked about and where to write."""
    parser.add_argument("--registry", default="results/registry", help="folder of the registry (%(default)s)")
    parser.add_argument("--asof", metavar="DATE", help="as it was then: YYYY-MM-DD, UTC")
    parser.add_argument("--csv", metavar="FILE", help="write comma-separated values there, '-' = standard output")


def run(args: argparse.Namespace) -> int:
    """Print the list, or write it as comma-separated values."""
    from turnout.registry.database import open_registry

    with open_registry(args.registry) as con:
        if args.asof:
            cursor = con.execute("select * from worklist(?::timestamp)", [_date(args.asof)])
        else:
            cursor = con.execute("select * from worklist")
        names = [d[0] for d in cursor.description]
        rows = cursor.fetchall()
    if args.csv:
        with opened(args.csv) as stream:
            _write(stream, names, rows)
    else:
        print(as_text([dict(zip(names, row)) for row in rows]))
    return 0


def as_text(rows) -> str:
    """The list for a terminal: one paragraph per row."""
    if not rows:
        return "Nothing to do: no chart in alarm, none that drifts, none that cannot tell."
    return "\n".join(_paragraph(row) for row in rows)


def _paragraph(row) -> str:
    where = row["turnout_id"] + (f" ({row['name']})" if row["name"] else "")
    lines = [
        f"{row['rank']:>2}. {row['state'].upper()}: {where}, {row['sections']}, {row['band']}",
        f"    {row['sentence']}",
    ]
    if row["false_alarm_words"] != "no statement":
        lines.append(f"    How sure: {row['false_alarm_words']}.")
    lines.append(f"    Last maintenance: {row['last_maintenance'] or 'none known'}. Look at: {row['look_at']}.")
    return "\n".join(lines)


def _write(stream, names, rows):
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)


def _date(text):
    from datetime import datetime

    from turnout.config.events import wrong_time
    from turnout.errors import ConfigError

    if wrong := wrong_time(text):
        raise ConfigError("--asof", "date", f"{text!r}{wrong[0]}", wrong[1])
    return datetime.fromisoformat(text.removesuffix("Z"))
