"""The log of a job: its messages, and the error that ends it."""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

END = "the job ended by an error"  # the first line of that error in a log


@contextmanager
def job_log(log: PathLike | str) -> Iterator[None]:
    """Write the messages of the program to the log of a job while the block runs, and warnings to the screen, too.

    An error that ends the block is logged with its traceback: the report of the night states its last line.

    Parameters
    ----------
    log : path-like
        Log file of the job. An earlier one is replaced.
    """
    path = Path(log)
    path.parent.mkdir(parents=True, exist_ok=True)
    to_file, to_screen = logging.FileHandler(path, mode="w", encoding="utf-8"), logging.StreamHandler(sys.stderr)
    to_screen.setLevel(logging.WARNING)
    program = logging.getLogger("turnout")
    program.setLevel(logging.INFO)
    for handler in (to_file, to_screen):
        handler.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
        program.addHandler(handler)
    try:
        yield
    except Exception:
        program.removeHandler(to_screen)  # the interpreter prints the traceback
        program.exception(END)
        raise
    finally:
        for handler in (to_file, to_screen):
            program.removeHandler(handler)
            handler.close()
