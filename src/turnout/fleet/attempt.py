"""A job that was begun and did not come to its end is asked for again.

Snakemake gives the old output of a failed job the time of now and notes its parameters as if it had been made: nothing
would run it again. The number of this file is one of those parameters; it is another one until the job has ended.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from turnout.files import write_text

FOLDER = Path("work/attempts")


def attempts(job: str) -> int:
    """How often ``job`` was begun without coming to its end; a number it never was where the file is cut."""
    try:
        return int((FOLDER / job).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return 0
    except ValueError:
        return -1


@contextmanager
def attempt(job: str, before: int) -> Iterator[None]:
    """One more attempt until the block has come to its end without an exception; ``before`` it was begun so often."""
    write_text(FOLDER / job, str(before + 1))
    yield
    write_text(FOLDER / job, str(before))
