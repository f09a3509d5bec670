"""Make a project: a folder with a commented configuration, one layout, a place for recordings and a short README.

turnout init my_turnouts

All other commands run in this folder. Existing files are not changed.
"""

import argparse
import shlex

GROUP = "Set up"
HELP = "make a project folder with configuration"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The folder.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("folder", help="folder of the project, made if it does not exist")


def run(args: argparse.Namespace) -> int:
    """Make the project and say what comes next.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    from pathlib import Path

    from turnout.workflow.project import create_project

    folder = Path(args.folder)
    written = create_project(folder)
    path = f"./{folder}" if str(folder).startswith("-") else str(folder)  # "cd -x" would be an option of cd
    command = f"cd {shlex.quote(path)}"
    print(f"{folder}: {len(written)} files. Its README.md says in seven steps how to go on; first: {command}")
    return 0
