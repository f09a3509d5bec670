"""The command line: ``turnout <command>``."""

import argparse
import sys
from importlib import import_module

from turnout import __version__
from turnout.cli import COMMANDS
from turnout.errors import TurnoutError


def build_parser() -> argparse.ArgumentParser:
    """Parser with one subcommand per module of ``turnout.cli``."""
    parser = argparse.ArgumentParser(
        prog="turnout",
        description="Watch railway switches and crossings from hammer tests and train passages.",
    )
    parser.add_argument("--version", action="version", version=__version__)
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


def main(argv=None) -> int:
    """Run one command; an error of the input or of a file is one message and exit code 2."""
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
