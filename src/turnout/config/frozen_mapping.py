"""A mapping that cannot be changed and can be pickled."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any


class Frozen(Mapping):
    """Read-only view of a dictionary; unlike MappingProxyType it can be pickled.

    Parameters
    ----------
    values : mapping or iterable of tuple of (any, any)
        Content; it is copied.

    Examples
    --------
    >>> Frozen({"a": 1})["a"]
    1
    """

    __slots__ = ("_values",)

    def __init__(self, values: Mapping | Iterable[tuple[Any, Any]] = ()) -> None:
        self._values = dict(values)

    def __getitem__(self, name: Any) -> Any:
        return self._values[name]

    def __iter__(self) -> Iterator[Any]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._values!r})"

    def __reduce__(self) -> tuple[type, tuple[dict]]:
        return type(self), (self._values,)
