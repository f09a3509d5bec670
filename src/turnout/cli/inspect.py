"""Show what raw files contain, before any layout exists.

  turnout inspect log_17.uff
  turnout inspect /media/stick --json
  turnout inspect A7_1.tdms --plot

For each file it shows the format, records, times, the sampling rate with every line that states it, the channels with
units and extremes, which channel may be force or response, and impacts or trains. A folder gives one line per file.
--plot draws every channel into <name of the file>.svg in the present folder, for files of the same name with that of
their folders before it. Nothing else is written. campaigns.csv and trains.csv of a turnout are checked row by row.

Exit code 1 if a file cannot be read or has a problem.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.options import add_result

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

GROUP = "Look at recordings"
HELP = "show what raw files contain, without a layout"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Files or folders, and the form of the answer.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("file", nargs="+", help="raw files in any format that is read, or folders of them")
    parser.add_argument("--plot", action="store_true", help="draw every channel into <name>.svg in the present folder")


def run(args: argparse.Namespace) -> int:
    """Print the contents of every file; exit code 1 if one cannot be read or has a problem.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """

    from turnout.config.campaign_notes import NOTE_FILES
    from turnout.errors import ReadError
    from turnout.report.contents_figure import contents_figure
    from turnout.report.contents_text import contents_lines, contents_summary, contents_values
    from turnout.report.site import replace_page
    from turnout.stages.file_contents import file_contents

    is_sound, values = True, []
    drawings: set[Path] = set()
    for path, is_in_folder in _files(args.file):
        if path.name in NOTE_FILES and path.is_file():
            rows, problems = _notes(path)
            is_sound = is_sound and not problems
            values.append({"path": str(path), "rows": rows, "problems": problems})
            usable = f"{rows} row{'s' if rows != 1 else ''} that can be used"
            print("\n".join([f"{path}: a table beside the recordings, {usable}", *problems]))
            continue
        try:
            contents = file_contents(path)
        except ReadError as error:
            is_sound = False
            values.append({"path": str(path), "problems": [f"{error.where}: {error.problem}. {error.remedy}."]})
            print(f"{error}" if not is_in_folder else f"{path}: not read, {error.where}: {error.problem}")
            continue
        is_sound = is_sound and not contents.problems
        values.append(contents_values(contents))
        print(contents_summary(contents) if is_in_folder else "\n".join(contents_lines(contents)))
        if args.plot:
            drawing = _drawing_name(path, drawings)
            drawings.add(drawing)
            replace_page(drawing, contents_figure(contents))
            print(f"  figure     {drawing}")
    add_result(args, values)
    return 0 if is_sound else 1


def _notes(path: Path) -> tuple[int, list[str]]:
    """Number of usable rows of a table of campaigns or trains, and what is wrong with the others."""
    from turnout.config.campaign_notes import read_campaigns, read_trains

    rows, errors = (read_campaigns if path.name == "campaigns.csv" else read_trains)(path, str(path))
    return len(rows), [str(error) for error in errors]


def _drawing_name(path: Path, taken: Collection[Path]) -> Path:
    """Name of the drawing of a file, with as many of its folders before it as tell it from those ``taken``."""
    from pathlib import Path

    parts = [part for part in path.absolute().parts if part != path.anchor]
    names = (Path("_".join(parts[-n:]) + ".svg") for n in range(1, len(parts) + 1))
    return next((name for name in names if name not in taken), Path(f"{path.name}.svg"))


def _files(names: list[str]) -> Iterator[tuple[Path, bool]]:
    """(file, whether it was found in a folder), those of a folder in the order of their names.

    Links that lead to nothing and folders that cannot be listed are among them: reading them gives the reason. Hidden
    files and folders are left out.
    """
    import os
    from pathlib import Path

    from turnout.errors import ReadError

    for name in names:
        path = Path(name)
        if not path.is_dir():
            yield path, False
            continue
        closed: list[OSError] = []
        inside = []
        for folder, folders, files in os.walk(path, onerror=closed.append):
            folders[:] = [name for name in folders if not name.startswith(".")]
            inside += [Path(folder, file) for file in files if not file.startswith(".")]
        inside.sort()
        if not inside and not closed:
            raise ReadError(path, "the path", "the folder holds no file", "Name another one", "empty")
        yield from ((file, True) for file in inside)
        for error in closed:
            raise error
