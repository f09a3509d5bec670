"""Options that several commands share, each declared once."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from turnout.cli.option_types import at_least_one

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from typing import Any

DEFAULT_REGISTRY = "results/registry"
RAW_HELP = "raw root, the folder of all recordings"
TRACK_HELP = "file in config/tracks, or its path (default: the turnout's own, else tommerup)"


def add_configuration(
    parser: argparse.ArgumentParser,
    help: str = "folder of the configuration (%(default)s)",
    dest: str = "configuration",
) -> None:
    """Add ``--configuration``, the folder of the configuration.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    help : str
        What the command uses it for.
    dest : str
        Name of the value.
    """
    parser.add_argument("--configuration", "--config", dest=dest, default="config", help=help)


def add_registry(parser: argparse.ArgumentParser, help: str = "folder of the registry (%(default)s)") -> None:
    """Add ``--registry``, the folder of the registry.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    help : str
        What the command uses it for.
    """
    parser.add_argument("--registry", default=DEFAULT_REGISTRY, help=help)


def add_raw(
    parser: argparse.ArgumentParser, help: str = f"{RAW_HELP} (%(default)s)", default: str | None = "raw"
) -> None:
    """Add ``--raw``, the folder that holds the raw folders of all turnouts.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    help : str
        What the command uses it for.
    default : str or None
        None for a command that tells whether it was given.
    """
    parser.add_argument("--raw", default=default, help=help)


def add_work(parser: argparse.ArgumentParser, help: str) -> None:
    """Add ``--work``, the folder of results of the stages.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    help : str
        What the command uses it for.
    """
    parser.add_argument("--work", default="work", help=help)


def add_pages(parser: argparse.ArgumentParser, help: str) -> None:
    """Add ``--pages``, the folder of the pages.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    help : str
        What the command writes there.
    """
    parser.add_argument("--pages", default="results/pages", help=help)


def add_turnout(parser: argparse.ArgumentParser, help: str, required: bool = True) -> None:
    """Add ``--turnout``, the id of one turnout.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    help : str
        What the command uses it for.
    required : bool
        Whether the command needs it.
    """
    parser.add_argument("--turnout", required=required, help=help)


def add_turnouts(parser: argparse.ArgumentParser, help: str) -> None:
    """Add ``--turnouts``, the ids of some turnouts; all where it is not given.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    help : str
        What the command does with them alone.
    """
    parser.add_argument("--turnouts", nargs="+", action="extend", metavar="ID", help=help)


def add_figure(parser: argparse.ArgumentParser, help: str) -> None:
    """Add ``--figure``, the file of a drawing of the result.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    help : str
        What is drawn, and in which format.
    """
    parser.add_argument("--figure", metavar="FILE", help=help)


def check_output_files(args: argparse.Namespace, *options: str) -> None:
    """Check the files that a command is to write, before it computes anything.

    Every command with such options calls it first. Missing folders are made when a file is written.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.
    *options : str
        Names of the options with their dashes. One that was not given, or is '-' for standard output, is no file.

    Raises
    ------
    ConfigError
        A file cannot be written: it is a folder, lies below a file, or the permission is missing.
    """
    from turnout.errors import ConfigError
    from turnout.files import output_problem

    for option in options:
        path = getattr(args, option.lstrip("-").replace("-", "_"), None)
        if path and path != "-" and (problem := output_problem(path)):
            raise ConfigError(path, option, *problem)


def check_work_folder(args: argparse.Namespace) -> None:
    """Check ``--work`` before anything is computed that is to be stored there.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Raises
    ------
    ConfigError
        Nothing can be written in it: it is a file, its disk is mounted for reading, or the permission is missing.
    """
    from pathlib import Path

    from turnout.errors import ConfigError
    from turnout.files import output_problem

    if problem := output_problem(Path(args.work) / "stored"):
        raise ConfigError(args.work, "--work", problem[0], "Correct this, or name another folder")


def add_track(parser: argparse.ArgumentParser, help: str = TRACK_HELP, default: str | None = None) -> None:
    """Add ``--track``, the track file.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    help : str
        Which file is used without the option.
    default : str or None
        Name of that file, None where it depends on the turnout.
    """
    parser.add_argument("--track", default=default, help=help)


def add_csv(parser: argparse.ArgumentParser) -> None:
    """Add ``--csv``, the file of comma-separated values.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("--csv", metavar="FILE", help="write comma-separated values there, '-' = standard output")


def add_cores(parser: argparse.ArgumentParser, help: str, default: int | None) -> None:
    """Add ``--cores``, the number of processes.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    help : str
        What they do.
    default : int or None
        None for all processors.
    """
    parser.add_argument("--cores", type=at_least_one, default=default, help=help)


class _FormerOption(argparse.Action):
    """Stores the value of the present option, and warns."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: str | None = None
    ) -> None:
        print(f"{parser.prog}: {option} is called {self.const} now; the former name goes away.", file=sys.stderr)
        parser._option_string_actions[str(self.const)].required = False  # this option stands for it
        setattr(namespace, self.dest, values)


def add_former(parser: argparse.ArgumentParser, former: str, present: str, **options: Any) -> None:
    """Accept an option under its former name, with a warning; it is not in the help.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command, which has the present option.
    former, present : str
        Names with their dashes.
    **options : any
        Type and number of values, as for ``add_argument``.
    """
    dest = present.lstrip("-").replace("-", "_")
    parser.add_argument(
        former, dest=dest, action=_FormerOption, const=present, default=argparse.SUPPRESS, help=argparse.SUPPRESS,
        **options,
    )  # fmt: skip


def add_common(parser: argparse.ArgumentParser, default: object = argparse.SUPPRESS) -> None:
    """Add the options of every command: ``--json``, ``-v`` and ``-q``, as far as it has none of its own.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the program, of a command or of one of its actions.
    default : object
        Value without the options; those of a command leave what was given before it.
    """
    common = (
        (("--json",), "print one JSON object: command, exit_code, text, result, warnings, error"),
        (("-q", "--quiet"), "no progress and no warnings"),
        (("-v", "--verbose"), "show what is done, and where in the program an error arose"),
    )
    group = parser.add_argument_group("options of every command")
    for names, text in common:
        if not any(name in parser._option_string_actions for name in names):
            group.add_argument(*names, action="store_true", default=default, help=text)


def leaf_parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """The parsers that a command line ends in: those of the actions of a command, else its own.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of a command.

    Yields
    ------
    argparse.ArgumentParser
        Each once.
    """
    subparsers = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    for action in subparsers:
        for inner in dict.fromkeys(action.choices.values()):
            yield from leaf_parsers(inner)
    if not subparsers:
        yield parser


def add_use(args: argparse.Namespace, n_used: int, n_left_out: int) -> None:
    """State how many of the inputs were used and left out. The exit code is 1 if there are only inputs left out.

    Every command that goes on without an unusable input (file, test, visit, section, turnout, case) calls it once, and
    prints itself what it left out and why.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.
    n_used : int
        Number of inputs that gave a result.
    n_left_out : int
        Number of inputs without one.

    Examples
    --------
    >>> args = argparse.Namespace(nothing_used=False)
    >>> add_use(args, n_used=0, n_left_out=3)
    >>> args.nothing_used
    True
    """
    args.nothing_used = n_left_out > 0 and n_used == 0


def add_warnings(args: argparse.Namespace, warnings: Iterable[str]) -> None:
    """State what is doubtful though the command goes on: on standard error, or with ``--json`` in its object.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.
    warnings : iterable of str
        Sentences. Those that were stated before are left out.
    """
    new = [text for text in dict.fromkeys(warnings) if text not in (args.warnings or ())]
    args.warnings = [*(args.warnings or ()), *new]
    for text in () if args.quiet or args.json else new:
        print(f"turnout {args.command}: {text}", file=sys.stderr)


def add_result(args: argparse.Namespace, result: object) -> None:
    """Hand on what ``--json`` prints as ``result``.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.
    result : object
        Rows or counts; times and paths in it are printed as text.
    """
    args.result = result
