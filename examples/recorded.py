"""Folders of recordings made by others, and helpers to write pages about them."""

import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
DOCS = REPOSITORY / "docs"
SHARED = REPOSITORY.parent / "shared" / "data"


def folder_of(name, arguments):
    """Folder of the recordings: the first of ``arguments``, else ``name`` in the shared folder beside the checkout.

    If it does not exist, the program ends with the reason.
    """
    folder = Path(arguments[0]) if arguments else SHARED / name
    if not folder.is_dir():
        sys.exit(f"skipped: {folder} does not exist. Give the folder of the recordings as the first argument.")
    return folder


def plotting():
    """pyplot with SVG output that is the same in every run."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "turnout", "font.size": 9, "axes.grid": True, "grid.alpha": 0.3})
    import matplotlib.pyplot as plt

    return plt


def save(figure, path):
    """Write an SVG file without a date."""
    figure.savefig(path, metadata={"Date": None})
    plotting().close(figure)


def table(head, rows):
    """A Markdown table from ``head`` and ``rows``."""
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    return "\n".join([*lines, *("| " + " | ".join(str(cell) for cell in row) + " |" for row in rows)])
