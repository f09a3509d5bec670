"""Settings and fixtures of all tests: one BLAS thread, stored byte code, folders of external recordings if present."""

import gc
import os
import sys
from collections.abc import Callable
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
# numba colours the message of every rejected overload, also of those that are never printed.
os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")
# As in an installation: otherwise every process that a test starts compiles the package again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

import pytest

# A forked process that destroys a connection of DuckDB which it inherited ends with a segmentation fault.
os.register_at_fork(after_in_child=gc.freeze)

KERNELS = pytest.StashKey[list[str]]()


def used_kernels() -> list[str]:
    """Compiled functions of the two packages that were called in this process, as module.name."""
    modules = [m for name, m in list(sys.modules.items()) if name.partition(".")[0] in ("turnout", "turnout_blind")]
    functions = {f"{f.__module__}.{f.__name__}" for m in modules for f in vars(m).values() if is_compiled(f)}
    return sorted(functions)


def is_compiled(function: object) -> bool:
    """Whether this is a function of numba that has machine code, compiled here or read from its cache."""
    return type(function).__module__.startswith("numba.") and bool(getattr(function, "signatures", ()))


def pytest_collection(session: pytest.Session) -> None:
    """Switch garbage collection off while modules are imported: nearly all objects stay, and a search costs time."""
    gc.disable()


def pytest_collection_finish(session: pytest.Session) -> None:
    """Exclude the imported objects from later searches; no test may simulate on import (``kernels_of_collection``)."""
    gc.freeze()
    gc.enable()
    session.config.stash[KERNELS] = used_kernels()


REPOSITORY = Path(__file__).resolve().parents[1]
# In this order two processes compile each kernel only once. One process runs the two files that need no kernel. The
# other compiles the kernels of the simulation and of the fit of modes (22 CPU s each), then those of the blind proof.
FIRST_FILES = (
    "workflow/test_workflow_seeded_faults.py",
    "convergence/test_simulate_march.py",
    "workflow/test_workflow_damage.py",
    "unit/stages/test_hammer_command.py",
    "blind/test_blind_switch.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run files with slow tests first, so that no process runs one alone at the end (``make test``)."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    rank = {REPOSITORY / "tests" / name: k for k, name in enumerate(FIRST_FILES)}
    items.sort(key=lambda item: (rank.get(item.path, len(rank)), item.path not in slow))


@pytest.fixture(scope="session")
def repository() -> Path:
    """Root of the checkout."""
    return REPOSITORY


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Recordings and curves made by others, beside the checkout; the test is skipped if they are absent."""
    folder = REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no external recordings: {folder} does not exist")
    return folder


@pytest.fixture(scope="session")
def shared_recordings() -> Path:
    """Programs that write recordings as data loggers do, beside the checkout; the test is skipped without them."""
    folder = REPOSITORY.parent / "shared" / "inputs" / "recordings"
    if not folder.is_dir():
        pytest.skip(f"no recordings of loggers: {folder} does not exist")
    return folder


@pytest.fixture(scope="session")
def kernels_of_collection(request: pytest.FixtureRequest) -> list[str]:
    """Compiled functions that were called while tests were collected."""
    return request.config.stash[KERNELS]


@pytest.fixture(scope="session", name="used_kernels")
def used_kernels_now() -> Callable[[], list[str]]:
    """Function that lists the compiled functions that have been called so far."""
    return used_kernels
