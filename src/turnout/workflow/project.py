"""A project: the folder of a user with configuration, raw files and results, outside the program's own files.

Without a Snakefile or profile of its own, a project is run with those that come with the program.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.config.events import COLUMNS as EVENT_COLUMNS
from turnout.config.generate import config_yaml
from turnout.config.turnouts_table import ROW
from turnout.errors import ConfigError
from turnout.files import write_text
from turnout.installation import shipped_path

if TYPE_CHECKING:
    from collections.abc import Iterator

# Copied as they are. The layout is that of the demonstration: complete, with a comment on every value.
COPIED = ("config/layouts/tommerup.yaml", "config/schema", "config/tracks", "config/vehicles", "profiles")
SNAKEFILE = '''\
"""The workflow of Turnout in this project: `snakemake` computes what is new, `snakemake --config turnouts=ID` one."""

from turnout.installation import shipped_path


include: str(shipped_path("Snakefile"))


workflow.default_target = "all"  # an included file does not set it
'''
README = """\
# Turnouts

1. Put the recordings of a turnout below `raw/ID/`, such as `raw/ID/hammer/2026-05-13/A7_1.uff`, and note the rail
   temperature of each campaign in `raw/ID/campaigns.csv` (columns campaign, started_at_utc, rail_temperature_c).
2. `turnout inspect FILE` shows what a file contains. `turnout layout new --from FILE...` drafts its description.
3. Enter the turnout: `turnout add ID LAYOUT`. The layout `tommerup` is an example with comments.
4. `turnout check --read` says what does not fit together, with file, line and remedy.
5. `turnout nightly` computes what is new. The pages are in `results/pages/index.html`.
6. `turnout worklist` says which turnouts need attention; `turnout --help` lists all commands.
7. Settings of the method are in `config/config.yaml`, each with its unit, limits and reason.
"""


def snakemake_environment() -> dict[str, str]:
    """Environment of a run of Snakemake: where it cannot write into the cache of the user, its cache is in the project.

    A service often has a home folder that is absent or read-only; Snakemake would stop there without a reason.

    Returns
    -------
    dict of str to str
        Variables and values.
    """
    try:
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "snakemake"
        cache.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=cache):
            return dict(os.environ)
    except (OSError, RuntimeError):
        return os.environ | {"XDG_CACHE_HOME": str(Path(".snakemake/cache").resolve())}


def create_project(folder: Path) -> list[Path]:
    """Make a project: commented configuration, one layout, raw/, profiles, Snakefile and README.

    Files that are there stay as they are. A project that was interrupted is completed by the next call.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.

    Returns
    -------
    list of Path
        The new files.

    Raises
    ------
    ConfigError
        If the folder has a configuration already, or is a file.
    """
    if folder.exists() and not folder.is_dir():
        raise ConfigError(folder, "folder", "it is a file", "Name a folder, new or empty")
    if (folder / "config" / "turnouts.tsv").exists():
        raise ConfigError(folder / "config", "folder", "a configuration is here already", "Name another folder")
    (folder / "raw").mkdir(parents=True, exist_ok=True)
    written = []
    for path, text in _project_files():
        target = folder / path
        if not target.exists():
            write_text(target, text)
            written.append(target)
    return written


def _project_files() -> Iterator[tuple[Path, str]]:
    """Path in the project and text of each file; turnouts.tsv is the last, because it marks a complete project."""
    yield Path("README.md"), README
    yield Path("Snakefile"), SNAKEFILE
    yield Path("config/config.yaml"), config_yaml({})
    yield Path("config/events.csv"), ",".join(EVENT_COLUMNS) + "\n"
    for name in COPIED:
        source = shipped_path(name)
        for path in sorted(source.rglob("*")) if source.is_dir() else [source]:
            if path.is_file():
                yield Path(name) / path.relative_to(source), path.read_text(encoding="utf-8")
    yield Path("config/turnouts.tsv"), "\t".join(ROW) + "\n"


def use_demonstration(folder: Path) -> None:
    """Copy the configuration of the demonstration fleet into a folder that has none.

    Parameters
    ----------
    folder : Path
        Folder of the run.
    """
    if not (folder / "config" / "turnouts.tsv").exists():
        shutil.copytree(shipped_path("config"), folder / "config", dirs_exist_ok=True)


def snakefile_options(folder: Path) -> list[str]:
    """Options of Snakemake that name the Snakefile of the program where the folder has none.

    Parameters
    ----------
    folder : Path
        Folder in which Snakemake is started.

    Returns
    -------
    list of str
        Empty if Snakemake finds a Snakefile itself.
    """
    names = ("Snakefile", "snakefile", "workflow/Snakefile", "workflow/snakefile")
    if any((folder / name).is_file() for name in names):
        return []
    return ["--snakefile", str(shipped_path("Snakefile"))]


def profile_folder(profile: str) -> str:
    """The folder of a profile: below the working folder, else the one of that name that comes with the program.

    Parameters
    ----------
    profile : str
        Such as "profiles/slurm".

    Returns
    -------
    str
        The folder; ``profile`` itself if neither exists.
    """
    shipped = shipped_path(profile)
    return profile if Path(profile).is_dir() or not shipped.is_dir() else str(shipped)
