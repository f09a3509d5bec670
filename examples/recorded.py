"""Where recordings made by others lie, and how a page about them is written."""

import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
DOCS = REPOSITORY / "docs"
SHARED = REPOSITORY.parent / "shared" / "data"


def folder_of(name, arguments):
    """Folder of the recordings: the first of ``arguments``, else ``name`` in the folder shared beside the checkout;
    where it does not exist the program ends with the reason."""
    folder = Path(arguments[0]) if arguments else SHARED / name
    if not folder.is_dir():
        sys.exit(f"skipped: {folder} does not exist. Give the folder of the recordings as the first argument.")
    return folder


def plotting():
    """pyplot that draws SVG, the same bytes every time."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "turnout", "font.size": 9, "axes.grid": True, "grid.alpha": 0.3})
    import matplotlib.pyplot as plt

    return plt


def save(figure, path):
    """Write an SVG without a date."""
    figure.savefig(path, metadata={"Date": None})
    plotting().close(figure)


def table(head, rows):
    """A Markdown table: ``head`` and ``rows`` of words."""
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    return "\n".join([*lines, *("| " + " | ".join(str(cell) for cell in row) + " |" for row in rows)])
