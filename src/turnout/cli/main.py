"""The command line: ``turnout <command>``."""

from __future__ import annotations

import argparse
import sys
from importlib import import_module
from typing import TYPE_CHECKING

from turnout import __version__
from turnout.cli import COMMANDS
from turnout.errors import TurnoutError

if TYPE_CHECKING:
    from collections.abc import Sequence


def build_parser() -> argparse.ArgumentParser:
    """Parser with one subcommand per module of ``turnout.cli``.

    Returns
    -------
    argparse.ArgumentParser
        Its values include ``run``, the function of the command.
    """
    parser = argparse.ArgumentParser(
        prog="turnout",
        description="Watch railway switches and crossings from hammer tests and train passages.",
    )
    parser.add_argument("--version", action="version", version=f"turnout {__version__}")
    subparsers = parser.add_subparsers(dest="command", metavar="command", required=True)
    for name in COMMANDS:
        module = import_module(f"turnout.cli.{name}")
        sub = subparsers.add_parser(
            name.replace("_", "-"),
            help=module.HELP,
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(sub)
        sub.set_defaults(run=module.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; an error of the input or of a file is one message and exit code 2.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments of the command line; by default those of this process.

    Returns
    -------
    int
        Exit code: 0, 1 where the command found a problem, 2 where it could not be followed.
    """
    args = build_parser().parse_args(argv)
    try:
        return args.run(args) or 0
    except TurnoutError as error:
        print(f"turnout {args.command}: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        return 0
    except OSError as error:
        where = f"{error.filename}: {error.strerror}" if error.filename and error.strerror else str(error)
        remedy = "Put that right, or name another place, then run again"
        print(f"turnout {args.command}: {where}. {remedy}.", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
