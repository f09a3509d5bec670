"""Compile a kernel with numba; keep its machine code where it can be written and only as long as it is fresh."""

import os
import shutil
import tempfile
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from numba import config, njit

from turnout.fingerprint import fingerprint

FAST = {"contract", "reassoc", "nsz", "arcp"}
# numba asks only whether the file of the function itself has changed. A kernel holds the code of those it calls and
# the numbers they import: machine code is kept in a folder named after all modules behind the march together.
OUTERMOST = "turnout.simulate.march"


def kernel(function):
    """``function`` compiled on first use, from the kept machine code where there is some.

    Where no folder can be written it is compiled anew in every process, some 20 s for all kernels.
    """
    return _compiled(function)


def inlined(function):
    """A kernel that becomes part of those that call it: no tuple of arrays is copied for a call, a quarter faster."""
    return _compiled(function, forceinline=True)


def _compiled(function, **options):
    folder = cache_folder()
    if folder is not None:
        try:
            with _numba_keeps_in(folder):
                return njit(cache=True, fastmath=FAST, **options)(function)
        except RuntimeError:  # "no locator available": the folder went away since it was tried
            pass
    return njit(fastmath=FAST, **options)(function)


@cache
def cache_folder():
    """First folder of numba's setting, beside the source, of the user's cache that can be written, or None."""
    name = f"kernels-{fingerprint(OUTERMOST)}"
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    beside = Path(__file__).resolve().parent / "__pycache__"
    for base in (config.CACHE_DIR, beside, Path(home) / "turnout"):  # type: ignore[attr-defined]
        if not base or str(base).startswith("~"):  # a user without a home
            continue
        folder = Path(base) / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        if base == beside:
            _forget_older(folder)
        return folder
    return None


def _forget_older(folder):
    for other in folder.parent.glob("kernels-*"):
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)


@contextmanager
def _numba_keeps_in(folder):
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)  # type: ignore[attr-defined]
    try:
        yield
    finally:
        config.CACHE_DIR = before  # type: ignore[attr-defined]
