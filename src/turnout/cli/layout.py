"""Make a layout: the description of sections, file names and channels that turnouts share.

  turnout layout new --from A7_1.uff A8_1.uff --name my_layout
  turnout layout new --from /media/stick/20260513T100000Z.h5

Writes config/layouts/<name>.yaml with everything that the files state, and a comment with DECIDE at everything that
they do not. `turnout check` accepts the draft. A unit or rate that no file states stays null, so nothing is guessed.
`turnout check --read` then compares the finished layout with the files.
"""

from __future__ import annotations

import argparse

from turnout.cli.options import add_configuration

GROUP = "Set up"
HELP = "draft a layout from raw files"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to do, the files, and the name of the layout.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("action", choices=("new",), help="new: write a draft")
    parser.add_argument(
        "--from", dest="files", nargs="+", required=True, metavar="FILE", help="raw files of one logger and wiring"
    )
    parser.add_argument("--name", default="draft", help="name of the layout (%(default)s)")
    add_configuration(parser)


def run(args: argparse.Namespace) -> int:
    """Write the draft, check it, and list what is to be decided.

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
        The name is not valid, or there is such a layout already.
    """
    import os
    import re
    from pathlib import Path

    from turnout.config.load import load_layout
    from turnout.config.turnouts_table import ID
    from turnout.errors import ConfigError
    from turnout.files import write_atomic
    from turnout.readers.formats import FORMATS
    from turnout.stages.file_contents import file_contents
    from turnout.stages.layout_draft import decisions, layout_draft
    from turnout.stages.raw_files import require_file
    from turnout.units import to_si

    if not re.fullmatch(ID, args.name):
        raise ConfigError("turnout layout", "--name", repr(args.name), "Write letters, digits, _ and -")
    path = Path(args.configuration) / "layouts" / f"{args.name}.yaml"
    if os.path.lexists(path):
        raise ConfigError(path, "--name", "there is such a layout already", "Write another name, or remove the file")
    contents = [file_contents(require_file(file)) for file in args.files]
    draft = layout_draft(contents)
    write_atomic(path, lambda file: file.write(draft.encode()))
    try:
        load_layout(path, FORMATS, to_si)
    except BaseException:
        path.unlink()
        raise
    print(f"{path}: written.")
    for decision in decisions(draft):
        print(f"  {decision}")
    return 0
