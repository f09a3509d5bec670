"""The command line: ``turnout <command>``."""

from __future__ import annotations

import argparse
import json
import logging
import os
import re
import sys
import time
import traceback
from contextlib import contextmanager, redirect_stdout
from difflib import get_close_matches
from importlib import import_module
from io import StringIO
from typing import TYPE_CHECKING

from turnout import __version__
from turnout.cli import COMMANDS, GROUPS
from turnout.cli.options import add_common, leaf_parsers
from turnout.errors import TurnoutError
from turnout.threads import use_one_thread

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

# Exit codes. `turnout nightly` also ends with that of Snakemake, and with 124 at its limit of time.
DONE, PROBLEM_FOUND, NOT_FOLLOWED, PROGRAM_FAULT, INTERRUPTED = 0, 1, 2, 3, 130
EXIT_CODES = """\
exit codes:
  0    done, nothing wrong
  1    done, and a problem was found
  2    not done: the command line, an input or a file is wrong; the message says what to do
  3    not done: a fault of the program
  124  nightly: ended at the limit of time
  130  interrupted"""
COMMON_DEFAULTS = {"json": False, "quiet": False, "verbose": False, "result": None}


def build_parser() -> argparse.ArgumentParser:
    """Parser with one subcommand per module of ``turnout.cli``.

    Returns
    -------
    argparse.ArgumentParser
        Its values include ``run``, the function of the command.
    """
    modules = {name: import_module(f"turnout.cli.{name}") for name in COMMANDS}
    groups_and_texts = {name: (getattr(m, "GROUP", GROUPS[-1]), m.HELP) for name, m in modules.items()}
    parser = argparse.ArgumentParser(
        prog="turnout",
        usage="turnout [-h] [--version] command ...",
        description="Monitor railway switches and crossings with hammer tests and train passages.",
        epilog=f"{_command_list(groups_and_texts)}\n\n"
        f"turnout COMMAND --help shows the options of a command. Every command has --json, -q and -v.\n\n{EXIT_CODES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"turnout {__version__}")
    subparsers = parser.add_subparsers(
        dest="command", metavar="command", required=True, help=argparse.SUPPRESS, prog=parser.prog
    )
    for name, module in modules.items():
        sub = subparsers.add_parser(
            name.replace("_", "-"),
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(sub)
        for leaf in leaf_parsers(sub):
            add_common(leaf)
            leaf.set_defaults(parser=leaf)
        sub.set_defaults(run=module.run)
    parser.set_defaults(**COMMON_DEFAULTS)
    return parser


def _command_list(commands: dict[str, tuple[str, str]]) -> str:
    """The commands by group, one line each, in the order of ``COMMANDS``."""
    lines = []
    for group in GROUPS:
        lines.append(f"{group}:")
        lines += [f"  {n.replace('_', '-'):<12} {text}" for n, (own, text) in commands.items() if own == group]
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; an error of the input or of a file is one message and exit code 2.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments of the command line; by default those of this process.

    Returns
    -------
    int
        Exit code, see ``EXIT_CODES``.
    """
    use_one_thread()
    args = _parse(sys.argv[1:] if argv is None else argv)
    started = time.monotonic()
    if args.quiet:
        os.environ["TQDM_DISABLE"] = "1"
    logging.basicConfig(
        level="ERROR" if args.quiet else "INFO" if args.verbose else "WARNING", format="%(levelname)s %(message)s"
    )
    if args.json:
        return _run_for_json(args)
    code, message = _run(args)
    if message:
        print(f"turnout {args.command}: {message}", file=sys.stderr)
    if args.verbose:
        print(f"turnout {args.command}: exit code {code} after {time.monotonic() - started:.1f} s", file=sys.stderr)
    return code


def _parse(words: Sequence[str]) -> argparse.Namespace:
    """Options of a command line. Without a command the help is printed; a wrong one ends with exit code 2."""
    parser = build_parser()
    if not words:
        parser.print_help(sys.stderr)
        parser.exit(NOT_FOLLOWED)
    first = words[0]
    if not first.startswith("-") and first not in (commands := [name.replace("_", "-") for name in COMMANDS]):
        close = "".join(f" Did you mean {name!r}?" for name in get_close_matches(first, commands, n=1))
        parser.exit(NOT_FOLLOWED, f"turnout: no command {first!r}.{close} 'turnout --help' lists the commands.\n")
    args, unknown = parser.parse_known_args(words)
    if unknown:
        args.parser.error(f"unknown: {' '.join(unknown)}. '{args.parser.prog} --help' lists the options")
    return args


def _run(args: argparse.Namespace) -> tuple[int, str]:
    """Exit code of a command and the message of its error, "" without one."""
    try:
        return args.run(args) or DONE, ""
    except BrokenPipeError:
        return DONE, ""
    except KeyboardInterrupt:
        return INTERRUPTED, "interrupted"
    except (TurnoutError, OSError) as error:
        if args.verbose:
            traceback.print_exc()
        return NOT_FOLLOWED, _message(error, args)
    except Exception as error:
        traceback.print_exc()
        fault = f"{type(error).__name__}: {error}"
        return PROGRAM_FAULT, f"a fault of the program, {fault}. Please report it with the lines above"


def _message(error: TurnoutError | OSError, args: argparse.Namespace) -> str:
    """What went wrong. The name of the command stands before it already, and is left out where an error begins so."""
    if isinstance(error, TurnoutError):
        pattern = rf"^(turnout )?{re.escape(args.command)}, "
        return re.sub(pattern, "", str(error), flags=re.MULTILINE)
    paths = getattr(args, "file", None) or ()  # a fault while reading names no file
    name = error.filename or ", ".join(map(str, [paths] if isinstance(paths, str) else paths))
    where = f"{name}: {error.strerror}" if name and error.strerror else str(error)
    return f"{where}. Correct this, or name another file or folder, then run again."


def _run_for_json(args: argparse.Namespace) -> int:
    """Run a command and print one JSON object. Output of its subprocesses goes to standard error."""
    text = StringIO()
    with _standard_output_to_error(), redirect_stdout(text):
        code, message = _run(args)
    document = {
        "command": args.command,
        "exit_code": code,
        "text": text.getvalue().splitlines(),
        "result": args.result,
        "error": message or None,
    }
    print(json.dumps(document, default=str, ensure_ascii=False, indent=1))
    return code


@contextmanager
def _standard_output_to_error() -> Iterator[None]:
    """Direct the file descriptor of standard output to that of standard error for a while."""
    sys.stdout.flush()
    original = os.dup(1)
    try:
        os.dup2(2, 1)
        yield
    finally:
        os.dup2(original, 1)
        os.close(original)


if __name__ == "__main__":
    sys.exit(main())
