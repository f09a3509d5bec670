"""Acknowledge an alarm, or suppress a chart until a date. The reason is stored.

  turnout acknowledge tommerup_s1/A7 --band ballast --by "M. Jensen" --reason "tamping ordered for week 14"
  turnout acknowledge tommerup_s1 --suppress-until 2030-05-01 --by "M. Jensen" --reason "track works"

An acknowledged alarm moves from "inspect this week" to "plan"; an alarm raised later is a new one. A suppressed
chart is not on the list until the date. Both are lines of config/acknowledgements.csv and count from the next run.
Nothing is written if no open alarm was raised by the time of the acknowledgement.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.options import add_configuration, add_registry
from turnout.config.acknowledgements import BANDS
from turnout.constants import DAYS_PER_YEAR

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

OPEN_ALARMS_QUERY = """
    select 1 from alarms
    where closed_at_utc is null and turnout_id = $1 and section_id = coalesce($2, section_id)
        and band = coalesce($3, band) and raised_at_utc <= $4
    limit 1"""
NAMED_ALARMS_QUERY = """
    select section_id, band, raised_at_utc from alarms where closed_at_utc is null and turnout_id = $1
    order by section_id, band, raised_at_utc"""
MAX_ALARMS_NAMED = 4
WHOLE_TURNOUT = "*"  # section of the median of all
SUPPRESSED_QUERY = """
    select count(*), count(*) filter (exists (
        select 1 from alarms a where a.closed_at_utc is null and a.turnout_id = s.turnout_id
            and a.section_id = s.section_id and a.band = s.band and a.source = s.source))
    from chart_status s
    where turnout_id = $1 and section_id = coalesce($2, section_id) and band = coalesce($3, band)"""
GROUP = "Worklist and maintenance"
HELP = "acknowledge an alarm, or suppress a chart until a date"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Turnout or section, person, reason and date of an acknowledgement.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("id", metavar="ID", help="turnout, or turnout/section")
    parser.add_argument("--band", default="", help=f"{', '.join(BANDS)} (under trains); all if not given")
    parser.add_argument("--by", required=True, help="name of the person")
    parser.add_argument("--reason", required=True, help="reason, stored with it")
    parser.add_argument("--suppress-until", metavar="DATE", default="", help="suppress the chart until this day")
    parser.add_argument("--at", default="", help="time of the acknowledgement, UTC; now if not given")
    add_registry(parser, help="where open alarms are looked up (%(default)s)")
    add_configuration(parser)


def run(args: argparse.Namespace) -> int:
    """Append the line to acknowledgements.csv; ConfigError for an invalid turnout, section or date.

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
    ConfigErrors
        A cell of the new row is wrong.
    ConfigError
        The row refers to no open alarm.
    """
    from datetime import UTC, datetime
    from pathlib import Path

    from turnout.config import load_configuration
    from turnout.config.acknowledgements import COLUMNS, acknowledgement_row, row_problems
    from turnout.config.table_edits import added_row, one_line, turnout_and_section
    from turnout.errors import ConfigError, ConfigErrors, RegistryError

    turnout, label = turnout_and_section(args.id)
    configuration = load_configuration(args.configuration)
    at = args.at or datetime.now(UTC).replace(tzinfo=None).isoformat(timespec="minutes")
    action = "suppress" if args.suppress_until else "acknowledge"
    cells = dict(turnout=turnout, section=label, band=args.band, action=action, by=args.by, at=at)
    cells |= dict(until=args.suppress_until, reason=args.reason)
    cells = {column: one_line(content) for column, content in cells.items()}
    path = Path(args.configuration) / "acknowledgements.csv"
    if problems := list(row_problems(cells, configuration.ids, configuration.variants)):
        raise ConfigErrors([ConfigError(path, column, *content) for column, *content in problems])
    row = acknowledgement_row(cells)
    try:
        remark = _effect(args.registry, row)
    except RegistryError as error:
        remark = f"Note: not compared with the open alarms. {error}"
    if remark is None:
        observation = f"no alarm of {args.id}, {args.band or 'all bands'}, is open that was raised by {at}"
        raise ConfigError(args.registry, "open alarms", observation, _remedy(args.registry, turnout))
    with added_row(path, cells, COLUMNS) as tables:
        after = load_configuration(args.configuration, tables=tables)
        if row not in after.acknowledgements:
            raise ConfigErrors(after.warnings)
    print(f"{path}: {action} {args.id} {args.band or 'all bands'}. It counts from the next run on.")
    if remark:
        print(remark)
    return 0


def _remedy(registry: str, turnout: str) -> str:
    """Which alarms of a turnout are open: the worklist names what has changed, which may be another resonance."""
    from turnout.counts import first_texts
    from turnout.registry.database import open_registry

    with open_registry(registry) as con:
        rows = con.execute(NAMED_ALARMS_QUERY, [turnout]).fetchall()
    if not rows:
        return f"No alarm of {turnout} is open. Nothing was written"
    names = [
        f"{f'{turnout}/*' if section == WHOLE_TURNOUT else section} --band {band}, raised {raised:%Y-%m-%d %H:%M}"
        for section, band, raised in rows
    ]
    return f"Open are, times in UTC: {first_texts(names, MAX_ALARMS_NAMED, '; ', 'more')}. Nothing was written"


def _effect(registry: str, row: Mapping[str, Any]) -> str | None:
    """What a row of ``acknowledgements`` does, "" without a registry; None if it refers to no open alarm."""
    from pathlib import Path

    from turnout.counts import count_of
    from turnout.registry.database import DATABASE, open_registry

    if not (Path(registry) / DATABASE).exists():
        return ""
    place = [row[name] for name in ("turnout_id", "section_id", "band")]
    with open_registry(registry) as con:
        if row["action"] == "acknowledge":
            return "" if con.execute(OPEN_ALARMS_QUERY, [*place, row["at_utc"]]).fetchall() else None
        ((n_charts, n_alarms),) = con.execute(SUPPRESSED_QUERY, place).fetchall()
    days = (row["until_utc"] - row["at_utc"]).days
    extent = f"{days / DAYS_PER_YEAR:.1f} years" if days > DAYS_PER_YEAR else count_of(days, "day")
    return f"It hides {count_of(n_charts, 'chart')} for {extent}, {n_alarms} of them with an open alarm."
