"""Files that come with the program beside its modules: workflow, profiles and the configuration of the demonstration.

A checkout has them at its top level, an installed package in its folder ``shipped`` (see setup.py).
"""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
SHIPPED = PACKAGE / "shipped"


def shipped_path(name: str) -> Path:
    """Path of a file or folder that comes with the program.

    Parameters
    ----------
    name : str
        Such as "Snakefile" or "config/tracks", as in the checkout.

    Returns
    -------
    Path
        Absolute path; the file need not exist.

    Examples
    --------
    >>> shipped_path("Snakefile").is_file()
    True
    """
    return (SHIPPED if SHIPPED.is_dir() else PACKAGE.parents[1]) / name
