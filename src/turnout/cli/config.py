"""Show the merged configuration of a turnout with the source of each value, or write the generated files.

turnout config show tommerup_s1
turnout config show tommerup_s1 --only receptance
turnout config generate            renew config.yaml and the JSON schemas for editors (and docs/settings.md, if present)
turnout config generate --check    show what is out of date, change nothing
"""

import argparse
import sys

from turnout.cli.options import add_configuration, add_result

GROUP = "Set up"
HELP = "show or generate the configuration"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The actions ``show`` and ``generate`` with their options.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    actions = parser.add_subparsers(dest="action", metavar="show|generate", required=True)
    show = actions.add_parser("show", help="every value of a turnout and the file it comes from")
    show.add_argument("turnout")
    show.add_argument("--only", metavar="WORD", default="", help="only keys that contain this word")
    generate = actions.add_parser("generate", help="renew config.yaml and the JSON schemas")
    generate.add_argument("--check", action="store_true", help="change nothing; exit code 1 where one is out of date")
    generate.add_argument("--defaults", action="store_true", help="do not keep values changed in config.yaml")
    generate.add_argument("--docs", default="docs", help="folder of the documentation, if it is there (%(default)s)")
    for sub in (show, generate):
        add_configuration(sub)


def run(args: argparse.Namespace) -> int:
    """Show values with their sources, or write (with --check compare) the generated files.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    return _show(args) if args.action == "show" else _generate(args)


def _show(args: argparse.Namespace) -> int:
    from turnout.config import load_configuration
    from turnout.config.configuration import sources

    configuration = load_configuration(args.configuration)
    configuration.turnout(args.turnout)
    entries = [entry for entry in sources(configuration, args.turnout) if args.only in entry[0]]
    add_result(args, [{"key": key, "value": value, "source": str(source)} for key, value, source in entries])
    for key, value, source in entries:
        print(f"{key:<44} {value!s:<28} {source}")
    if not entries:
        print(f"no key of {args.turnout} contains {args.only!r}; without --only all are shown", file=sys.stderr)
    return 0 if entries else 1


def _generate(args: argparse.Namespace) -> int:
    from pathlib import Path

    from turnout.config.generate import generate_files
    from turnout.config.turnouts_table import NO_PROJECT
    from turnout.errors import ConfigError
    from turnout.files import write_if_changed

    if not Path(args.configuration).is_dir():
        raise ConfigError(args.configuration, "the folder", "there is no such folder", NO_PROJECT)
    stale, docs = 0, Path(args.docs)
    for path, text in generate_files(Path(args.configuration), docs, args.defaults).items():
        if path.parent == docs and not docs.is_dir():
            continue  # a project of a user has no documentation
        if args.check:
            differs = not path.exists() or path.read_text(encoding="utf-8") != text
            print(f"{path}: out of date" if differs else f"{path}: up to date")
            stale += differs
        else:
            print(f"{path}: {'written' if write_if_changed(path, text) else 'unchanged'}")
    return 1 if stale else 0
