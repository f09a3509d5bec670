"""Lock the registry so that only one process writes at a time, such as a nightly run and a manual one."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from turnout.errors import RegistryError
from turnout.locks import folder_lock

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@contextmanager
def registry_lock(registry_dir: Path, max_wait: float = 600.0) -> Iterator[None]:
    """Hold the registry for writing.

    Parameters
    ----------
    registry_dir : Path
        Folder of the registry, created where it does not exist.
    max_wait : float
        How long to wait for another run that holds the lock. [s]

    Raises
    ------
    RegistryError
        If another run still holds it after ``max_wait``, or without permission to write.
    """
    with folder_lock(registry_dir, "the registry", max_wait, RegistryError):
        yield
