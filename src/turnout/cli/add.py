"""Add a turnout: one row of turnouts.tsv. The row is written only if the whole configuration is valid with it.

turnout add tommerup_s3 tommerup --raw line_7/T00043 --name "Tommerup, switch 3" --km 13.1
"""

import argparse

from turnout.cli.options import add_configuration

GROUP = "Set up"
HELP = "add a turnout"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """One option per column of turnouts.tsv.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    from turnout.config.turnouts_table import ROW

    parser.add_argument("turnout", help=ROW["turnout"].meaning)
    parser.add_argument("layout", help=ROW["layout"].meaning)
    for column, key in list(ROW.items())[2:]:
        unit = f" [{key.unit}]" if key.unit else ""
        parser.add_argument("--" + column.replace("_", "-"), dest=column, metavar="…", help=key.meaning + unit)
    add_configuration(parser)


def run(args: argparse.Namespace) -> int:
    """Append the row and check the whole configuration; an invalid row is removed again.

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
        There is such a turnout already, or the new row is wrong.
    """
    from pathlib import Path

    from turnout.config import load_configuration
    from turnout.config.table_edits import added_row
    from turnout.config.turnouts_table import ROW, read_table
    from turnout.errors import ConfigError
    from turnout.readers.formats import FORMATS
    from turnout.units import to_si

    path = Path(args.configuration) / "turnouts.tsv"
    with added_row(path, {column: getattr(args, column) for column in ROW}, tuple(ROW)) as tables:
        rows = read_table(path, str(path))[0]
        if row := next((row for row in rows if row.id == args.turnout), None):
            problem, remedy = f"there is a turnout {row.id!r} already", "to change the turnout, edit this line"
            raise ConfigError(path, f"line {row.line}", problem, f"Write another id; {remedy}")
        turnout = load_configuration(args.configuration, FORMATS, to_si, tables).turnout(args.turnout)
    labels = ", ".join(s.label for s in turnout.sections)
    print(f"{path}: added {turnout.id} with the sections {labels}.")
    for recordings, source in (("hammer tests", turnout.hammer), ("passages", turnout.passages)):
        if source:
            print(f"Its {recordings} are looked for as <raw root>/{turnout.raw}/{source.files}")
    return 0
