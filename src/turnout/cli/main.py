"""The command line: ``turnout <command>``."""

from __future__ import annotations

import argparse
import errno
import gc
import json
import logging
import math
import os
import re
import sys
import time
import traceback
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from decimal import Decimal
from difflib import get_close_matches
from importlib import import_module
from io import StringIO
from typing import TYPE_CHECKING

from turnout import __version__
from turnout.child_processes import signals_interrupt
from turnout.cli import COMMANDS, GROUPS
from turnout.cli.options import DEFAULT_REGISTRY, add_common, leaf_parsers
from turnout.errors import TurnoutError, installation_error, remedy_of_access
from turnout.threads import use_one_thread

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

# Exit codes. `turnout nightly` also ends with that of Snakemake, and with 124 at its limit of time.
DONE, PROBLEM_FOUND, NOT_FOLLOWED, PROGRAM_FAULT, INTERRUPTED = 0, 1, 2, 3, 130
EXIT_CODES = """\
exit codes:
  0    done, nothing wrong
  1    done, and a problem was found, or none of the inputs could be used
  2    not done: the command line, an input or a file is wrong; the message says what to do
  3    not done: a fault of the program
  124  nightly: ended at the limit of time
  130  interrupted by Ctrl-C (129: by the end of the terminal, 143: by SIGTERM)"""
COLLECTION_THRESHOLD = 50_000  # new containers between searches for cycles; Python's 700 cost 1 % of a diagnosis
COMMON_DEFAULTS = {
    "json": False,
    "quiet": False,
    "verbose": False,
    "result": None,
    "warnings": None,
    "nothing_used": False,
}


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
    _prepare_output()
    try:
        return _main(sys.argv[1:] if argv is None else argv)
    except KeyboardInterrupt:  # outside the command itself, as while its modules are loaded
        print("turnout: interrupted", file=sys.stderr)
        return INTERRUPTED


def _main(words: Sequence[str]) -> int:
    use_one_thread()
    gc.set_threshold(COLLECTION_THRESHOLD)
    args = _parse_for_json(words) if "--json" in words else _parse(words)
    started = time.monotonic()
    if args.quiet:
        os.environ["TQDM_DISABLE"] = "1"
    logging.basicConfig(
        level="ERROR" if args.quiet else "INFO" if args.verbose else "WARNING", format="%(levelname)s %(message)s"
    )
    code, message = _run_for_json(args) if args.json else _run(args)
    if message:
        print(f"turnout {args.command}: {message}", file=sys.stderr)
    if args.verbose:
        print(f"turnout {args.command}: exit code {code} after {time.monotonic() - started:.1f} s", file=sys.stderr)
    return code


def _prepare_output() -> None:
    """Write characters that the encoding of the terminal lacks as escapes; a closed stream is an empty one."""
    if sys.stdin is None:
        sys.stdin = open(os.devnull, encoding="utf-8")
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _parse(words: Sequence[str]) -> argparse.Namespace:
    """Options of a command line. Without a command the help is printed; a wrong one ends with exit code 2."""
    parser = build_parser()
    if not words:
        parser.print_help(sys.stderr)
        parser.exit(NOT_FOLLOWED)
    if "" in words:  # an empty path would be the present folder, an empty option its default
        place = words.index("")
        behind = f", behind {words[place - 1]!r}," if place else ""
        problem = f"turnout: argument {place + 1}{behind} is empty. Give it a value, or leave it out"
        parser.exit(NOT_FOLLOWED, f"{problem}; if it is a variable of the shell, that has no value.\n")
    first = words[0]
    if not first.startswith("-") and first not in (commands := [name.replace("_", "-") for name in COMMANDS]):
        close = "".join(f" Did you mean {name!r}?" for name in get_close_matches(first, commands, n=1))
        parser.exit(NOT_FOLLOWED, f"turnout: no command {first!r}.{close} 'turnout --help' lists the commands.\n")
    if first.startswith("-") and not any(option.startswith(first) for option in ("-h", "--help", "--version")):
        text = f"turnout: {first!r} before the command. Write options behind it: turnout COMMAND {first}"
        parser.exit(NOT_FOLLOWED, f"{text}. 'turnout --help' lists the commands.\n")
    args, unknown = parser.parse_known_args(words)
    if unknown:
        # without the dashes, which are alike in all: --out is not similar to --quiet
        shown = [action for action in args.parser._actions if action.help != argparse.SUPPRESS]
        known = [option[2:] for action in shown for option in action.option_strings if len(option) > 2]
        similar = get_close_matches(unknown[0].partition("=")[0][2:], known, n=1) if unknown[0].startswith("--") else []
        hint = f" Did you mean --{similar[0]}?" if similar else ""
        args.parser.error(f"unknown: {' '.join(unknown)}.{hint} '{args.parser.prog} --help' lists the options")
    return args


def _parse_for_json(words: Sequence[str]) -> argparse.Namespace:
    """As ``_parse``; a wrong command line also ends with a JSON object on standard output, which states its error."""
    message = StringIO()
    try:
        with redirect_stderr(message):
            return _parse(words)
    except SystemExit as end:
        print(message.getvalue(), end="", file=sys.stderr)
        if end.code:
            usage, _, error = message.getvalue().strip().partition(": error: ")
            print(_json_text(words[0], int(end.code), error or usage))
        raise


def _run(args: argparse.Namespace) -> tuple[int, str]:
    """Exit code of a command and the message of its error, "" without one."""
    interrupts: list[int] = []
    try:
        with signals_interrupt(interrupts):
            code = args.run(args) or (PROBLEM_FOUND if args.nothing_used else DONE)
            _flush_output()
        return code, ""
    except BrokenPipeError:
        _discard_output()
        return DONE, ""
    except KeyboardInterrupt:
        return _code_of(interrupts), "interrupted"
    except (TurnoutError, OSError) as error:
        if args.verbose:
            traceback.print_exc()
        message = _message(error, args)
        try:
            _flush_output()
        except OSError:  # as at the error itself: what is left cannot be written either
            _discard_output()
        return NOT_FOLLOWED, message
    except Exception as error:
        if interrupts:  # a library that turned the interrupt into an exception of its own
            return _code_of(interrupts), "interrupted"
        if isinstance(error.__context__, OSError) and error.__context__.errno == errno.ELOOP:  # of Path.resolve
            return NOT_FOLLOWED, _message(error.__context__, args)
        if absent := installation_error(error):
            return NOT_FOLLOWED, str(absent)
        if damage := _damage_of_registry(error, args):
            return NOT_FOLLOWED, damage
        traceback.print_exc()
        fault = f"{type(error).__name__}: {error}"
        return PROGRAM_FAULT, f"a fault of the program, {fault}. Please report it with the lines above"


def _code_of(interrupts: Sequence[int]) -> int:
    """Exit code of a command that the first of these signals has ended."""
    return 128 + interrupts[0] if interrupts else INTERRUPTED


def _damage_of_registry(error: Exception, args: argparse.Namespace) -> str:
    """Message for an error of DuckDB about a file of the registry; "" for any other error."""
    if "duckdb" not in sys.modules:
        return ""
    from turnout.registry.damage import damage_message

    return damage_message(error, getattr(args, "registry", None) or DEFAULT_REGISTRY)


def _flush_output() -> None:
    """Write what is buffered; the OSError of a full disk names standard output."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, "standard output") from error


def _discard_output() -> None:
    """Let what is still buffered go nowhere, so that the end of the process reports no second fault."""
    with suppress(OSError, ValueError, AttributeError), open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


def _message(error: TurnoutError | OSError, args: argparse.Namespace) -> str:
    """What went wrong. The name of the command stands before it already, and is left out where an error begins so.

    The folder of the configuration has the name of a command, and stays.
    """
    if isinstance(error, TurnoutError):
        if args.command == getattr(args, "configuration", ""):
            return str(error)
        pattern = rf"^(turnout )?{re.escape(args.command)}, "
        return re.sub(pattern, "", str(error), flags=re.MULTILINE)
    paths = getattr(args, "file", None) or ()  # a fault while reading names no file
    name = error.filename or ", ".join(map(str, [paths] if isinstance(paths, str) else paths))
    name = name or "standard output, or a file without a name"
    where = f"{name}: {error.strerror}" if error.strerror else str(error)
    return f"{where}. {remedy_of_access(error, 'Correct this')}, or name another file or folder, then run again."


def _run_for_json(args: argparse.Namespace) -> tuple[int, str]:
    """Run a command and print one JSON object. Output of its subprocesses goes to standard error.

    The message of the command is part of the object; one is returned only if the object cannot be written.
    """
    text = StringIO()
    with _standard_output_to_error(), redirect_stdout(text):
        code, message = _run(args)
    printed = _json_text(args.command, code, message, text.getvalue().splitlines(), args.result, args.warnings or [])

    def print_document(_: argparse.Namespace) -> int:
        print(printed)
        return code

    return _run(argparse.Namespace(**{**vars(args), "run": print_document}))


def _json_text(
    command: str, code: int, error: str, text: Sequence[str] = (), result: object = None, warnings: Sequence[str] = ()
) -> str:
    """The JSON object of a command, as text that standard output can show."""
    document = {
        "command": command,
        "exit_code": code,
        "text": text,
        "result": _as_json(result),
        "warnings": warnings,
        "error": error or None,
    }
    is_utf8 = (sys.stdout.encoding or "").lower().replace("-", "") == "utf8"
    return json.dumps(document, default=str, ensure_ascii=not is_utf8, indent=1)


def _as_json(value: Any) -> Any:
    """A result without what JSON lacks: NaN and infinity become null; decimal numbers of DuckDB, and numbers and arrays
    of NumPy, those of Python.
    """
    if isinstance(value, dict):
        return {key: _as_json(x) for key, x in value.items()}
    if isinstance(value, (list, tuple)):
        return [_as_json(x) for x in value]
    if hasattr(value, "tolist"):
        return _as_json(value.tolist())
    if isinstance(value, Decimal):  # of SQL such as 100.0 * count(*)
        return float(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


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
