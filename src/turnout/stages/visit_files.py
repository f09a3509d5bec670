"""Files of the stored visits of a turnout: one for each visit and group of sections."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from turnout.stages.checkpoint import SUFFIX


def remove_other_visits(folder: Path, turnout_id: str, visits: Collection[str]) -> None:
    """Remove the files of all visits of a turnout but these, so that a folder does not grow with each night.

    Parameters
    ----------
    folder : Path
        As ``stored_visits.folder_of``.
    turnout_id : str
    visits : collection of str
        Visits whose files stay.
    """
    for path in stored_files(folder, turnout_id):
        if visit_of_file(path) not in visits:
            path.unlink(missing_ok=True)


def stored_files(folder: Path, turnout_id: str) -> list[Path]:
    """Files of the stored visits of a turnout, of any version.

    Parameters
    ----------
    folder : Path
        As ``stored_visits.folder_of``.
    turnout_id : str

    Returns
    -------
    list of Path
    """
    return sorted((folder / turnout_id).glob(f"*{SUFFIX}"))


def visit_of_file(path: Path) -> str:
    """Visit in the name of a file of ``stored_files``.

    Parameters
    ----------
    path : Path

    Returns
    -------
    str

    Examples
    --------
    >>> visit_of_file(Path("t1/2026-05-01-ca5b7e1c5b0d.npz"))
    '2026-05-01'
    """
    return path.stem.rpartition("-")[0]
