"""Copy of the list of the files of the registry, for the time of a run.

Snakemake removes the output of a job that could not be submitted to a cluster, or that failed there. Of the job that
registers rows this is the list itself: without it readers see no registry.
"""

from pathlib import Path

from turnout.files import write_text
from turnout.registry.generation import GENERATION_FILE

LIST = Path("results/registry") / GENERATION_FILE
COPY = Path("work/registry_before_the_run.json")


def copy_list() -> None:
    """Copy the list at the start of a run; without one, as after the registry was deleted, there is no copy either."""
    if LIST.exists():
        write_text(COPY, LIST.read_text(encoding="utf-8"))
    else:
        COPY.unlink(missing_ok=True)


def restore_list() -> None:
    """Put the copy back if the list is gone after a run that failed."""
    if not LIST.exists() and COPY.exists():
        write_text(LIST, COPY.read_text(encoding="utf-8"))
