"""Lock the registry so that only one process writes at a time, such as a nightly run and a manual one."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from filelock import FileLock, Timeout

from turnout.errors import RegistryError

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def registry_lock(registry_dir: Path, patience: float = 600.0) -> Iterator[None]:
    """Hold the registry for writing.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry, created where it does not exist.
    patience : float
        How long to wait for another run that holds the lock. [s]

    Raises
    ------
    RegistryError
        If another run still holds it after ``patience``, or without permission to write.
    """
    path = Path(registry_dir) / ".lock"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path, timeout=patience)
        lock.acquire()
    except Timeout:
        raise RegistryError(
            f"{registry_dir}: another run has locked the registry for more than {patience:g} s. "
            f"Nothing was changed: wait for it to end, then run again."
        ) from None
    except OSError as error:
        raise RegistryError(f"{registry_dir}: cannot write there: {error}. Give write permission.") from error
    try:
        yield
    finally:
        lock.release()
