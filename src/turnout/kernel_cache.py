"""Compile kernels with numba and cache their machine code in a writable folder, as long as it is up to date."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from numba import config, njit

from turnout.fingerprint import fingerprint

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

Function = TypeVar("Function", bound="Callable")
FASTMATH_FLAGS = {"contract", "reassoc", "nsz", "arcp"}
# numba only checks whether the file of the function itself has changed. But a kernel contains the code of the kernels
# it calls and the constants they import. So the cache folder has the fingerprint of all modules with kernels.
FINGERPRINTED_MODULES = ("turnout.simulate.march", "turnout.modal.fit_kernels")


def kernel(function: Function) -> Function:
    """Decorator: ``function`` compiled on first use, or read from the cached machine code.

    If no folder can be written, or its disk is full, every process compiles it again: some 20 s for all kernels.

    Parameters
    ----------
    function : function
        Python function in the subset that numba compiles.

    Returns
    -------
    Function
        A numba dispatcher, called like ``function``.
    """
    return _compile(function)


def inline_kernel(function: Function) -> Function:
    """Decorator: a ``borrowing_kernel`` inlined into its callers. No tuple of arrays is copied for a call.

    Parameters
    ----------
    function : function
        Python function in the subset that numba compiles. It creates no arrays and returns none.

    Returns
    -------
    Function
        A numba dispatcher, called like ``function`` and inlined into compiled callers.
    """
    return _compile(function, forceinline=True, _nrt=False)


def inner_kernel(function: Function) -> Function:
    """Decorator: an ``inline_kernel`` that only other kernels call.

    It has no entry for Python, which would take every array of its arguments apart. With tuples of tens of arrays the
    entry takes longer to compile than the kernel.

    Parameters
    ----------
    function : function
        Python function in the subset that numba compiles. It creates no arrays and returns none.

    Returns
    -------
    Function
        A numba dispatcher, inlined into compiled callers.
    """
    return _compile(function, forceinline=True, _nrt=False, no_cpython_wrapper=True)


def borrowing_kernel(function: Function) -> Function:
    """Decorator: a kernel that does not count references to its arrays, since its caller holds them all.

    Each array that is taken from a tuple, sliced or passed on otherwise costs two atomic operations, in inner loops
    more than the arithmetic. numba rejects a function that creates an array under this decorator.

    Parameters
    ----------
    function : function
        Python function in the subset that numba compiles. It creates no arrays and returns none.

    Returns
    -------
    Function
        A numba dispatcher, called like ``function``.
    """
    return _compile(function, _nrt=False)


def _compile(function: Function, **options: Any) -> Function:
    options |= {"fastmath": FASTMATH_FLAGS, "no_cfunc_wrapper": True}  # no kernel is called by code in C
    folder = cache_folder()
    if folder is not None:
        try:
            with _numba_cache(folder):
                return _without_write_faults(njit(cache=True, **options)(function))
        except RuntimeError:  # "no locator available": the folder was removed after it was tested
            pass
    return njit(**options)(function)


def _without_write_faults(dispatcher: Any) -> Any:
    """The dispatcher, for which a full disk of the cache folder is no error: the next process compiles again."""
    machine_code = getattr(dispatcher, "_cache", None)
    if machine_code is not None:  # none where numba is switched off
        save = machine_code.save_overload

        def save_overload(signature: Any, data: Any) -> None:
            with suppress(OSError):
                save(signature, data)

        machine_code.save_overload = save_overload
    return dispatcher


@cache
def cache_folder() -> Path | None:
    """First writable cache folder, or None: that of numba's setting, beside the source, in the user's cache."""
    name = f"kernels-{fingerprint(*FINGERPRINTED_MODULES)}"
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    source_cache = Path(__file__).resolve().parent / "__pycache__"
    for base in (config.CACHE_DIR, source_cache, Path(home) / "turnout"):  # type: ignore[attr-defined]
        if not base or str(base).startswith("~"):  # a user without a home
            continue
        folder = Path(base) / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        if base == source_cache:
            _remove_older_caches(folder)
        return folder
    return None


def _remove_older_caches(folder: Path) -> None:
    for older in folder.parent.glob("kernels-*"):
        if older != folder:
            shutil.rmtree(older, ignore_errors=True)


class CodeLocator:
    """Where numba keeps the machine code of a function: by its source, not by the folder in which that lies.

    So equal code is compiled once for all installations that share a cache folder. It has the methods of numba's own
    locators, of which each names the folder of the source.

    Parameters
    ----------
    folder : str
        The cache folder.
    source : bytes
        Content of the file of the function.
    line : int
        First line of the function.
    """

    def __init__(self, folder: str, source: bytes, line: int) -> None:
        self._stamp, self._line = hashlib.sha256(source).hexdigest(), line
        self._folder = os.path.join(folder, self._stamp[:16])

    @classmethod
    def from_function(cls, function: Callable, path: str) -> CodeLocator | None:
        """Locator of a function in a file; None if the file cannot be read or the cache folder not be written."""
        try:
            locator = cls(config.CACHE_DIR, Path(path).read_bytes(), function.__code__.co_firstlineno)  # type: ignore[attr-defined]
            locator.ensure_cache_path()
        except OSError:
            return None
        return locator

    def ensure_cache_path(self) -> None:
        """Make the folder, and raise an OSError if nothing can be written there."""
        os.makedirs(self._folder, exist_ok=True)
        tempfile.TemporaryFile(dir=self._folder).close()

    def get_cache_path(self) -> str:
        """Folder of the machine code."""
        return self._folder

    def get_source_stamp(self) -> str:
        """Hash of the source; machine code with another one is compiled again."""
        return self._stamp

    def get_disambiguator(self) -> str:
        """Difference between functions of the same name in one file."""
        return str(self._line)


@contextmanager
def _numba_cache(folder: Path) -> Iterator[None]:
    settings = {"CACHE_DIR": str(folder), "CACHE_LOCATOR_CLASSES": f"{__name__}.{CodeLocator.__name__}"}
    before = {name: getattr(config, name, "") for name in settings}
    vars(config).update(settings)
    try:
        yield
    finally:
        vars(config).update(before)
