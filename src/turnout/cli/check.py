"""Check the configuration and, if the raw files are available, their names.

Every error is one line: file, line, column, the present value, and what to write instead. --read opens the newest file
of every section and of the passages and compares rate, channels, units and counts with the layout. It also checks
whether stiffness and acceleration are in the range of a track.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.cli.options import RAW_HELP, add_configuration, add_raw, add_result, add_turnout
from turnout.counts import count_of, first_texts

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

    from turnout.config import Configuration, Event, TurnoutConfig
    from turnout.errors import ReadError
    from turnout.units import Conversion

YAML_FOLDERS = ("layouts", "overrides", "tracks", "vehicles")
MAX_TYPES = 6  # of trains that a remark names
TABLE_SUFFIXES = (".csv", ".ods", ".tsv", ".txt", ".xls", ".xlsx", ".yaml")
GROUP = "Set up"
HELP = "check the configuration and the names of raw files"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Folders of configuration and raw files.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    add_configuration(parser)
    add_raw(parser, help=f"{RAW_HELP} (raw, where it is there)", default=None)
    parser.add_argument("--read", action="store_true", help="read one file per section and compare it with the layout")
    add_turnout(parser, "only this one", required=False)
    parser.add_argument("--formats", action="store_true", help="list the raw formats")


def run(args: argparse.Namespace) -> int:
    """Print the counts and each problem; exit code 1 if there is one, even if no turnout is affected yet.

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
        The raw folder is absent.
    """
    from turnout.config import load_configuration
    from turnout.errors import ConfigError
    from turnout.readers.formats import FORMATS
    from turnout.units import to_si

    if args.formats:
        print("\n".join(f"{name:<10} {' '.join(f.extensions):<24} {f.meaning}" for name, f in FORMATS.items()))
        return 0
    configuration = load_configuration(args.configuration, FORMATS, to_si)
    ids = [configuration.turnout(args.turnout).id] if args.turnout else list(configuration.ids)
    faults = [*dict.fromkeys(_faults(configuration, FORMATS, to_si))]  # a train repeats those of its vehicles
    add_result(args, {"turnouts": list(configuration.ids), "faults": faults})
    layouts = {row.values["layout"] for row in configuration.rows.values()}
    n_events = len(configuration.events)
    n_acks = len(configuration.acknowledgements)
    counts = (
        f"{count_of(len(configuration.ids), 'turnout')} with {count_of(len(layouts), 'layout')}, "
        f"{count_of(n_events, 'event')}, {count_of(n_acks, 'acknowledgement')}"
    )
    print(f"{args.configuration}: {counts}, {'with faults' if faults else 'no fault'}.")
    for fault in faults:
        print(f"  {fault}")
    for path in _unread_files(configuration.folder):
        print(f"  {path}: no command reads a file of this name. Rename it, or move it out of the configuration")
    from turnout.stages.layout_checks import mounting_remarks

    for remark in (
        *_unnamed_tracks(configuration),
        *_event_remarks(configuration.events),
        *_position_remarks(configuration),
        *mounting_remarks(configuration),
    ):
        print(f"  {remark}")
    if not configuration.ids:
        print("  no turnout yet: `turnout add ID LAYOUT` adds one")
    for decision in _open_decisions(configuration.folder / "layouts"):
        print(f"  {decision}")
    raw = Path(args.raw or "raw")
    if not raw.is_dir() and (args.raw or raw.exists()):
        problem = "it is a file" if raw.exists() else "no such folder"
        raise ConfigError(str(raw), "--raw", problem, "Write the folder that holds the folders of the turnouts")
    if not raw.is_dir():
        print(f"{raw}: no such folder, file names not checked.")
        return 1 if faults or args.read else 0
    n_fault = _report_left_out(configuration, raw, ids) + len(faults)
    if args.read:
        n_fault += _report_readings(configuration, raw, ids)
    return 1 if n_fault else 0


def _faults(configuration: Configuration, formats: Collection[str], to_si: Callable[..., Conversion]) -> Iterator[str]:
    """Each fault that stops no turnout, with its consequence."""
    from turnout.config.load import errors_of_unused_layouts
    from turnout.stages.layout_checks import faults_of_sections, faults_of_tracks, faults_of_vehicles

    for warning in configuration.warnings:
        yield f"does not count: {warning}"
    for error in errors_of_unused_layouts(configuration, formats, to_si):
        yield f"used by no turnout: {error}"
    yield from faults_of_sections(configuration)
    yield from faults_of_tracks(configuration)
    yield from faults_of_vehicles(configuration)


def _unread_files(folder: Path) -> list[Path]:
    """Files of the configuration that no command reads for their name, such as a copy, and folders of such files."""
    from turnout.config.load import TABLES

    tables = [p for p in folder.iterdir() if p.suffix in TABLE_SUFFIXES and p.name not in (*TABLES, "config.yaml")]
    strays = [
        path
        for name in YAML_FOLDERS
        for path in folder.joinpath(name).glob("*")
        if path.is_file() and path.suffix not in (".yaml", ".md") and not _is_hidden(path)
    ]
    read_folders = (*YAML_FOLDERS, "schema", "passages")
    folders = [p for p in folder.iterdir() if p.is_dir() and p.name not in read_folders and not _is_hidden(p)]
    return sorted(tables + strays + [p for p in folders if any(p.glob("[!.]*.yaml"))])


def _is_hidden(path: Path) -> bool:
    """Whether a file is of an editor or of the system, not of a person."""
    return path.name.startswith(".") or path.name.endswith("~")


def _unnamed_tracks(configuration: Configuration) -> Iterator[str]:
    """A remark on each track file that belongs to no turnout or layout by its name, and that no other track extends."""
    from turnout.config.parameter_files import read_unchanged_parameters
    from turnout.errors import ConfigError

    names = {*configuration.ids, *(path.stem for path in (configuration.folder / "layouts").glob("[!.]*.yaml"))}
    paths = sorted((configuration.folder / "tracks").glob("[!.]*.yaml"))
    for path in paths:
        with suppress(ConfigError):  # a fault of its own
            names.add(str(read_unchanged_parameters(path).get("extends")))
    for path in paths:
        if path.stem not in names:
            yield (
                f"{path}: no turnout and no layout has this name, so it is used only where --track names it. "
                "A turnout uses the track file of its id, else that of its layout"
            )


def _open_decisions(folder: Path) -> Iterator[str]:
    """Each line of a layout, used or not, that a person has yet to decide, as `turnout layout new` marks it."""
    from turnout.stages.layout_draft import decisions

    for path in sorted(path for path in folder.glob("[!.]*.yaml") if path.is_file()):
        for decision in decisions(path.read_text(encoding="utf-8", errors="replace")):
            yield f"{path}, {decision}: still marked with DECIDE. Write the value, and remove the mark"


def _event_remarks(events: Iterable[Event]) -> Iterator[str]:
    """Each event that may be a mistake: of the next year (later ones are warnings already), or with unusual resets."""
    from datetime import timedelta

    from turnout.config.events import MAX_LEAD_TIME, now, reset_remark

    for e in events:
        where = f"{e.turnout}/{e.section}" if e.section else e.turnout
        if remark := reset_remark(e):
            yield f"{e.kind} at {where}, {e.at:%Y-%m-%d} (events.csv): {remark}"
        if timedelta(days=1) < e.at - now() <= MAX_LEAD_TIME:
            yield f"planned, counts from its day: {e.kind} at {where}, {e.at:%Y-%m-%d} (events.csv)"


def _position_remarks(configuration: Configuration) -> Iterator[str]:
    """Remarks on positions in turnouts.tsv that other rows or the time zone of the layout contradict."""
    from turnout.config.positions import position_remarks

    def zone_of(name: str) -> str:
        turnout = configuration.turnout(name)
        descriptions = [*turnout.hammer.descriptions.values()] if turnout.hammer else []
        descriptions += [turnout.passages.description] if turnout.passages else []
        return next((d.time_zone for d in descriptions), "")

    return position_remarks(configuration.rows, zone_of)


def _remarks_on_train_types(turnout: TurnoutConfig) -> Iterator[str]:
    """A remark on the types of trains.csv that no axle pattern has: recordings cannot show them."""
    from turnout.errors import ConfigError
    from turnout.stages.passage_context import known_patterns

    path = turnout.settings["passage"].axle_patterns
    try:
        types = {pattern.type for pattern in known_patterns(path)}
    except ConfigError:  # a fault of its own
        return
    listed = {row["train_type"] for row in turnout.trains if row.get("train_type")}
    if types and (without := sorted(listed - types)):
        names = first_texts([*map(repr, without)], MAX_TYPES)
        yield (
            f"{turnout.raw}/trains.csv: no axle pattern is called {names}, so no recording is recognised as "
            f"such a train. Correct the name, or add its axle distances to {path}"
        )


def _report_left_out(configuration: Configuration, raw: Path, ids: Sequence[str]) -> int:
    """Print the number of raw files and each problem with them; returns the number of problems."""
    from turnout.config.campaign_notes import read_notes
    from turnout.stages.layout_reading import lack_of_temperature
    from turnout.workflow.notes_check import improbable_temperatures, note_contradictions
    from turnout.workflow.scan import scan

    n_units = n_files = 0
    problems: list[ReadError] = []
    remarks: list[str] = []
    for turnout in map(configuration.turnout, ids):
        scanned = scan(turnout, raw)
        n_units += len(scanned.units)
        n_files += sum(len(u.files) for u in scanned.units)
        noted_turnout, note_errors = read_notes(turnout, raw)
        problems += [*scanned.problems, *note_errors, *note_contradictions(noted_turnout, raw, scanned.units)]
        if not note_errors:
            if lack := lack_of_temperature(noted_turnout, raw, scanned.units):
                problems += [lack.error] if lack.is_certain else []
                remarks += [] if lack.is_certain else [str(lack.error)]
            remarks += _remarks_on_train_types(noted_turnout)
        remarks += improbable_temperatures(noted_turnout)
    problem_count = count_of(len(problems), "problem") if problems else "no problem"
    print(f"{raw}: {count_of(n_files, 'file')} in {count_of(n_units, 'unit')}, {problem_count}.")
    for problem in problems:
        print(f"  {problem}")
    for remark in remarks:
        print(f"  {remark}")
    for folder in _folders_without_turnout(configuration, raw):
        print(f"  {folder}: no turnout reads this folder. `turnout add ID LAYOUT --raw {folder.name}` adds one")
    return len(problems)


def _folders_without_turnout(configuration: Configuration, raw: Path) -> list[Path]:
    """Folders directly below the raw root from which no turnout reads and into which no turnout's folder leads."""
    first = {Path(configuration.turnout(name).raw).parts[:1] for name in configuration.ids}
    if () in first:  # a turnout whose folder is the raw root itself
        return []
    return sorted(p for p in raw.iterdir() if p.is_dir() and not p.name.startswith(".") and (p.name,) not in first)


def _report_readings(configuration: Configuration, raw: Path, ids: Sequence[str]) -> int:
    """Print what the reading of one file per section gave; returns the number of faults."""
    from turnout.config.campaign_notes import with_raw
    from turnout.stages.layout_reading import file_readings, sections_without_files
    from turnout.workflow.scan import scan

    n_fault = 0
    paths_by_content: dict[str, str] = {}
    for name in ids:
        turnout = with_raw(configuration.turnout(name), raw)
        units = scan(turnout, raw).units
        for reading in file_readings(turnout, raw, units, paths_by_content):
            verdict = "agrees" if not reading.faults else count_of(len(reading.faults), "fault")
            print(
                f"{reading.turnout}, {reading.section}: {reading.path}: {verdict}{reading.text and ': '}{reading.text}"
            )
            for fault in reading.faults:
                print(f"  {fault}")
            n_fault += len(reading.faults)
        if missing := sections_without_files(turnout, units):
            print(f"{turnout.id}: no hammer test of {', '.join(missing)} yet.")
    return n_fault
