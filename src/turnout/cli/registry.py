"""Maintain the registry.

check      compare every valid file with the list: size, hash, row count, types
compact    merge the many files of a table and year into one
vacuum     delete files that interrupted runs have left
relocate   write registry.duckdb again after the folder was moved
rebuild    write all files again after an update that changed columns
describe   show tables, views and macros with their columns, units and meanings
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.option_types import at_least_one
from turnout.cli.options import add_registry
from turnout.counts import count_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

GROUP = "Results"
HELP = "check, compact, move or describe the registry"
ACTIONS = ("check", "compact", "vacuum", "relocate", "rebuild", "describe")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The action, the folder and the options of single actions.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("action", choices=ACTIONS)
    parser.add_argument("name", nargs="?", help="describe: only this table, view or macro")
    add_registry(parser)
    parser.add_argument("--quick", action="store_true", help="check: do not read the files whole")
    parser.add_argument(
        "--at-least", type=at_least_one, default=2, metavar="N", help="compact: only where N files lie (2)"
    )


def run(args: argparse.Namespace) -> int:
    """Run the action; exit code 1 if the check finds a problem.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    return {"check": _check, "compact": _compact, "vacuum": _vacuum, "relocate": _relocate}.get(
        args.action, _describe if args.action == "describe" else _rebuild
    )(args)


def _check(args: argparse.Namespace) -> int:
    from turnout.registry.integrity import check

    problems = check(_registry_folder(args), hashes=not args.quick)
    print("\n".join(problems) or "The files of the registry agree with its list.")
    return 1 if problems else 0


def _compact(args: argparse.Namespace) -> int:
    from turnout.registry.compaction import compact

    folder = _registry_folder(args)
    return _print_changes(compact(folder, args.at_least), "merged", folder)


def _rebuild(args: argparse.Namespace) -> int:
    from turnout.registry.compaction import rebuild

    folder = _registry_folder(args)
    return _print_changes(rebuild(folder), "written again", folder)


def _print_changes(changes: Mapping[str, tuple[int, int]], verb: str, registry: Path) -> int:
    """Print the changes; exit code 1 if damaged files were found, which the log names."""
    from turnout.registry.generation import load

    for folder, (files, rows) in sorted(changes.items()):
        print(f"{folder}: {count_of(files, 'file')} with {count_of(rows, 'row')} {verb}")
    if not changes:
        print("Nothing to do.")
    if incomplete := load(registry).incomplete:
        print(f"Damaged files of {', '.join(incomplete)} count no longer. Run the workflow, which restores their rows.")
        return 1
    return 0


def _vacuum(args: argparse.Namespace) -> int:
    from turnout.registry.integrity import vacuum

    deleted = vacuum(_registry_folder(args))
    print("\n".join(deleted) or "Nothing to delete.")
    return 0


def _relocate(args: argparse.Namespace) -> int:
    from turnout.registry.database import rebuild_database

    folder = _registry_folder(args)
    generation = rebuild_database(folder)
    print(f"{folder.resolve() / 'registry.duckdb'}: views over {len(generation.files)} files")
    return 0


def _describe(args: argparse.Namespace) -> int:
    from turnout.registry.documentation import describe

    print(describe(args.name))
    return 0


def _registry_folder(args: argparse.Namespace) -> Path:
    from pathlib import Path

    from turnout.errors import RegistryError
    from turnout.registry.generation import GENERATION_FILE

    folder = Path(args.registry)
    if not (folder / GENERATION_FILE).exists():
        raise RegistryError(f"{folder}: there is no registry here. 'turnout nightly' makes one; or give --registry")
    return folder
