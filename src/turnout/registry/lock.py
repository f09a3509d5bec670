"""Lock the registry so that only one process writes at a time, such as a nightly run and a manual one."""

from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from turnout.errors import RegistryError


@contextmanager
def registry_lock(registry_dir: Path, patience: float = 600.0):
    """Hold the registry for writing; RegistryError after ``patience`` seconds, or without permission to write."""
    path = Path(registry_dir) / ".lock"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path, timeout=patience)
        lock.acquire()
    except Timeout:
        raise RegistryError(
            f"{registry_dir}: another run holds the registry and did not let go within {patience:g} s. "
            f"Nothing was changed: wait for it to end, then run again."
        ) from None
    except OSError as error:
        raise RegistryError(f"{registry_dir}: cannot write there: {error}. Give write permission.") from error
    try:
        yield
    finally:
        lock.release()
