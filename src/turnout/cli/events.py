"""List maintenance, enter it, or show whether it helped: tamping, exchanged pads, another sensor, another method.

  turnout events                                      everything that is entered
  turnout events tommerup_s1                          what is entered for this turnout
  turnout events --effect                             whether the work helped, and for how long
  turnout events tommerup_s1/A7 tamping 2026-04-02 --note "machine 09-3X"

An event that resets a resonance starts a new epoch of its charts: they learn the new level before they raise an alarm
again. Each kind of work resets certain resonances (docs/settings.md); --resets states others.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.options import add_configuration, add_registry, add_result

if TYPE_CHECKING:
    from collections.abc import Collection
    from datetime import datetime

GROUP = "Worklist and maintenance"
HELP = "list or enter maintenance, and show whether it helped"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The event to enter, or the options of the list.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("id", metavar="ID", nargs="?", help="turnout, or turnout/section; all if not given")
    parser.add_argument("kind", metavar="KIND", nargs="?", help="tamping, pad_exchange, sensor_change ...")
    when = "YYYY-MM-DD or YYYY-MM-DDTHH:MM, UTC; a day alone begins at 00:00, before the tests of that day"
    parser.add_argument("date", metavar="DATE", nargs="?", help=when)
    parser.add_argument("--resets", default="", help="'ballast', 'railpad', 'ballast railpad' or 'none'")
    parser.add_argument("--note", default="", help="free text")
    parser.add_argument("--effect", action="store_true", help="what the entered work did, from the registry")
    add_registry(parser)
    add_configuration(parser)


def run(args: argparse.Namespace) -> int:
    """List events, enter one, or print the effect of maintenance; ConfigError for an incomplete event.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    from turnout.errors import ConfigError

    if args.effect and args.kind:
        problem, remedy = f"{args.kind!r} beside --effect", "Enter the work first, then ask for its effect"
        raise ConfigError("events", "the command line", problem, remedy)
    if args.effect:
        return _effect(args)
    if not args.kind:
        return _list(args)
    if not args.date:
        raise ConfigError("events", "the command line", "a kind without a date", "Write: turnout events ID KIND DATE")
    return _enter(args)


def _list(args: argparse.Namespace) -> int:
    """Print all events, or those of one turnout; those of one section with the work on its whole turnout."""
    from dataclasses import asdict

    from turnout.config import load_configuration

    configuration = load_configuration(args.configuration)
    turnout, section = _turnout_and_section(args, {*configuration.ids, *(e.turnout for e in configuration.events)})
    if turnout in configuration.variants:
        labels = configuration.variants[turnout].tree["sections"]
        _check_section(turnout, section, {*labels, *(e.section for e in configuration.events if e.turnout == turnout)})
    events = [
        e
        for e in configuration.events
        if (not turnout or e.turnout == turnout) and (not section or e.section in (None, section))
    ]
    add_result(args, [asdict(e) for e in events])
    if not events:
        of_id = f" of {args.id}" if args.id else ""
        print(f"{args.configuration}/events.csv: no event{of_id} yet. Enter one: turnout events ID KIND DATE")
    for e in events:
        where = f"{e.turnout}/{e.section}" if e.section else e.turnout
        resets = " and ".join(e.resets) or "nothing"
        print(f"{_time(e.at):<16}  {where:<28} {e.kind:<16} resets {resets}  {e.note}".rstrip())
    return 0


def _turnout_and_section(args: argparse.Namespace, ids: set[str]) -> tuple[str, str]:
    """Turnout and section of the id on the command line, "" for all; ConfigError for a turnout that is not known."""
    from turnout.config.schema import NO_TURNOUT, suggestion
    from turnout.config.table_edits import turnout_and_section
    from turnout.errors import ConfigError

    turnout, section = turnout_and_section(args.id) if args.id else ("", "")
    if turnout and turnout not in ids:
        remedy = suggestion(turnout, sorted(ids), NO_TURNOUT)
        raise ConfigError("the command line", "ID", f"turnout {turnout!r} is not known", remedy)
    return turnout, section


def _check_section(turnout: str, section: str, labels: Collection[str | None]) -> None:
    """ConfigError for a section that is none of the ``labels``."""
    from turnout.config.schema import suggestion
    from turnout.errors import ConfigError

    if section and section not in labels:
        problem = f"turnout {turnout!r} has no section {section!r}"
        raise ConfigError("the command line", "ID", problem, suggestion(section, sorted(filter(None, labels))))


def _time(at: datetime) -> str:
    """The day of work, with its time if it has one: it decides about the tests of that day."""
    return f"{at:%Y-%m-%d %H:%M}" if at.hour or at.minute else f"{at:%Y-%m-%d}"


def _enter(args: argparse.Namespace) -> int:
    """Append the line and read the configuration again; an invalid line is removed."""
    from pathlib import Path

    from turnout.config import load_configuration
    from turnout.config.events import COLUMNS, date_problem, event_of, now, read_events, reset_remark, turnout_problems
    from turnout.config.table_edits import added_row, turnout_and_section
    from turnout.errors import ConfigError, ConfigErrors

    path = Path(args.configuration) / "events.csv"
    turnout, label = turnout_and_section(args.id)
    cells = dict(turnout=turnout, section=label, date=args.date, kind=args.kind, resets=args.resets, note=args.note)
    with added_row(path, cells, COLUMNS) as tables:
        after = load_configuration(args.configuration, tables=tables)
        if problems := list(turnout_problems(cells, after.ids, after.variants)):
            raise ConfigErrors([ConfigError(path, column, *content) for column, *content in problems])
        entered = event_of(cells)
        if problem := date_problem(entered):
            raise ConfigError(path, "date", *problem)
        if entered.at.year < (earliest := after.settings["trend"].earliest_year):
            observation = (
                f"date {entered.at:%Y-%m-%d} is before {earliest} (trend.earliest_year): no chart begins so early"
            )
            raise ConfigError(path, "date", observation, "Correct its year")
        if entered.work in (event.work for event in read_events(path, str(path), None, {})[0]):
            repetition = f"{args.kind} at {args.id}, {args.date}, is there already"
            raise ConfigError(path, "the work", repetition, "To change its row, edit the file")
    begin = "from its day" if entered.at > now() else "from the next run"
    print(f"{path}: {args.kind} at {args.id}, {args.date}. It counts {begin} on.")
    if remark := reset_remark(entered):
        print(f"Note: {remark}.")
    return 0


def _effect(args: argparse.Namespace) -> int:
    """Print what the work of all turnouts did, or of one turnout or section."""
    from turnout.registry.database import open_registry

    with open_registry(args.registry) as con:
        rows = con.execute("select turnout_id from turnouts union select turnout_id from events").fetchall()
        turnout, section = _turnout_and_section(args, {name for (name,) in rows})
        cursor = con.execute(
            "select event_at_utc, section_id, band, kinds, verdict, gain_pct, gain_low_pct, gain_high_pct, "
            "n_before, n_after, held_until_utc, last_measured_at_utc from maintenance_effect "
            "where turnout_id = coalesce(nullif($1, ''), turnout_id) and "
            "section_id = coalesce(nullif($2, ''), section_id) order by event_at_utc, section_id, band",
            [turnout, section and f"{turnout}/{section}"],
        )
        names = [column[0] for column in cursor.description]
        rows = cursor.fetchall()
        if not rows:  # a section without effects must be known
            labels = con.execute("select label from sections where turnout_id = $1", [turnout]).fetchall()
            _check_section(turnout, section, {label for (label,) in labels} or {section})
    add_result(args, [dict(zip(names, row)) for row in rows])
    for at, section, band, kinds, verdict, gain, low, high, before, after, retention, last in rows:
        retention = (
            f"half of it lost by {retention:%Y-%m-%d}"
            if retention
            else f"holds until {last:%Y-%m-%d}, the newest campaign"
        )
        interval = "no interval" if low is None or high is None else f"{low:+z.1f} to {high:+z.1f}, 95 %"
        size = "" if gain is None else f", {gain:+z.1f} %"
        print(
            f"{_time(at)} {section} {band}, {kinds}: {verdict}{size} ({interval}; {before} and {after} campaigns)"
            + (f"; {retention}" if verdict == "stiffer" else "")
        )
    if not rows:
        print("No event that resets a resonance has campaigns on both sides yet; of others ask change_since_event().")
    return 0
