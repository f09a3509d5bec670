"""Lock a folder so that only one process changes it at a time, such as a nightly run and a command."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from filelock import FileLock, Timeout

from turnout.errors import TurnoutError, remedy_of_access

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def folder_lock(
    folder: Path, content: str = "this folder", max_wait: float = 60.0, error_type: type[TurnoutError] = TurnoutError
) -> Iterator[None]:
    """Hold a folder for writing.

    The system releases the lock when the process ends, however it ends. The file ``.lock`` stays in the folder.

    Parameters
    ----------
    folder : Path
        The folder, created where it does not exist.
    content : str
        What the message calls it.
    max_wait : float
        How long to wait for another process that holds the lock. [s]
    error_type : type
        Exception to raise.

    Raises
    ------
    TurnoutError
        If another process still holds it after ``max_wait``, or without permission to write; of type ``error_type``.
    """
    path = Path(folder) / ".lock"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path, timeout=max_wait)
        lock.acquire()
    except Timeout:
        raise error_type(
            f"{folder}: another run has locked {content} for more than {max_wait:g} s. "
            f"Nothing was changed: wait for it to end, then run again."
        ) from None
    except OSError as error:
        raise error_type(
            f"{folder}: cannot write there: {error.strerror or error}. "
            f"{remedy_of_access(error, 'Make a folder of it')}, or use a copy of it."
        ) from error
    try:
        yield
    finally:
        lock.release()
