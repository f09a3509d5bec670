"""Modules that were renamed in version 0.2: importing one by its former name says the new one."""

from __future__ import annotations

import sys
from types import ModuleType


def former_names() -> dict[str, str]:
    """Return the present dotted name of every renamed module, by its former one."""
    import csv
    from pathlib import Path

    with Path(__file__).with_name("former_names.csv").open(encoding="utf-8") as stream:
        return {row["former"]: row["now"] for row in csv.DictReader(stream)}


def find_former_name(fullname: str) -> object | None:
    """Find no module but an empty package in place of a former one, so that its modules are asked for by name.

    Parameters
    ----------
    fullname : str
        Dotted name of the module that is imported.

    Returns
    -------
    any or None
        Specification of an empty package, None for every other name.

    Raises
    ------
    ModuleNotFoundError
        With the present name, where ``fullname`` is a former one.
    """
    names = former_names()
    now = names.get(fullname)
    if now is None:
        return None
    if any(name.startswith(f"{fullname}.") for name in names):
        from importlib.machinery import ModuleSpec

        return ModuleSpec(fullname, _EmptyPackage(now), is_package=True)  # type: ignore[arg-type]
    _forget_empty_packages(fullname)
    message = f"{fullname} was renamed in Turnout 0.2. Import {now} instead"
    raise ModuleNotFoundError(message, name=fullname)


class _EmptyPackage:
    """Loader of a package that holds nothing and says where its names are now."""

    def __init__(self, now: str) -> None:
        self.now = now

    def create_module(self, spec: object) -> None:
        """Leave the creation to the import system."""

    def exec_module(self, module: ModuleType) -> None:
        """Give the package an error for each name that is asked of it."""

        def missing(name: str) -> None:
            if name.startswith("__"):
                raise AttributeError(name)
            _forget_empty_packages(f"{module.__name__}.{name}")
            raise ImportError(f"{module.__name__} was renamed in Turnout 0.2. Import {name} from {self.now} instead")

        module.__dict__["__getattr__"] = missing


def _forget_empty_packages(fullname: str) -> None:
    """Take the empty packages above ``fullname`` away again: ``turnout.receptance`` is a function as well."""
    parts = fullname.split(".")[:-1]
    for n in range(len(parts), 1, -1):
        module = sys.modules.get(".".join(parts[:n]))
        if isinstance(getattr(getattr(module, "__spec__", None), "loader", None), _EmptyPackage):
            del sys.modules[".".join(parts[:n])]
            vars(sys.modules[".".join(parts[: n - 1])]).pop(parts[n - 1], None)
