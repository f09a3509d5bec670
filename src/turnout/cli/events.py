"""List maintenance, enter it, or show whether it helped: tamping, exchanged pads, another sensor, another method.

  turnout events                                      everything that is entered
  turnout events --effect                             whether the work helped, and for how long
  turnout events tommerup_s1/A7 tamping 2026-04-02 --note "machine 09-3X"

An event that resets a resonance starts a new epoch of its charts: they learn the new level before they raise an alarm
again. Each kind of work resets certain resonances (docs/settings.md); --resets states others.
"""

import argparse

from turnout.cli.options import add_configuration, add_registry, add_result

GROUP = "Worklist and maintenance"
HELP = "list or enter maintenance, and show whether it helped"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The event to enter, or the options of the list.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("id", metavar="ID", nargs="?", help="turnout, or turnout/section")
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
    from dataclasses import asdict

    from turnout.config import load_configuration
    from turnout.errors import ConfigError

    if args.effect:
        return _effect(args.registry)
    if args.id is None:
        events = load_configuration(args.configuration).events
        add_result(args, [asdict(e) for e in events])
        if not events:
            print(f"{args.configuration}/events.csv: no event yet. Enter one: turnout events ID KIND DATE")
        for e in events:
            where = f"{e.turnout}/{e.section}" if e.section else e.turnout
            resets = " and ".join(e.resets) or "nothing"
            print(f"{e.at:%Y-%m-%d}  {where:<28} {e.kind:<16} resets {resets}  {e.note}")
        return 0
    if not (args.kind and args.date):
        raise ConfigError(
            "events", "the command line", "an id without kind and date", "Write: turnout events ID KIND DATE"
        )
    return _enter(args)


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


def _effect(registry: str) -> int:
    from turnout.registry.database import open_registry

    with open_registry(registry) as con:
        rows = con.execute(
            "select event_at_utc, section_id, band, kinds, verdict, gain_pct, gain_low_pct, gain_high_pct, "
            "n_before, n_after, held_until_utc, last_measured_at_utc from maintenance_effect "
            "order by event_at_utc, section_id, band"
        ).fetchall()
    for at, section, band, kinds, verdict, gain, low, high, before, after, retention, last in rows:
        retention = (
            f"half of it lost by {retention:%Y-%m-%d}"
            if retention
            else f"holds until {last:%Y-%m-%d}, the newest campaign"
        )
        interval = "no interval" if low is None or high is None else f"{low:+z.1f} to {high:+z.1f}, 95 %"
        size = "" if gain is None else f", {gain:+z.1f} %"
        print(
            f"{at:%Y-%m-%d} {section} {band}, {kinds}: {verdict}{size} ({interval}; {before} and {after} campaigns)"
            + (f"; {retention}" if verdict == "stiffer" else "")
        )
    if not rows:
        print("No event that resets a resonance has campaigns on both sides yet; of others ask change_since_event().")
    return 0
