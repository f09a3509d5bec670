"""Options that several commands share, each declared once, and types of option values."""

from __future__ import annotations

import argparse

RAW_HELP = "raw root, the folder of all recordings"
TRACK_HELP = "file in config/tracks, or its path (default: the turnout's own, else tommerup)"


def at_least_one(text: str) -> int:
    """The number of ``text``, 1 or more; argparse.ArgumentTypeError otherwise.

    Parameters
    ----------
    text : str
        Value of an option.

    Returns
    -------
    int
        The number.

    Examples
    --------
    >>> at_least_one("4")
    4
    """
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of 1 or more")
    return number


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
    parser.add_argument("--registry", default="results/registry", help=help)


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
