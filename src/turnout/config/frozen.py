"""A mapping that cannot be changed and travels between processes."""

from collections.abc import Mapping


class Frozen(Mapping):
    """Read-only view of a dictionary; unlike MappingProxyType it can be pickled.

    >>> Frozen({"a": 1})["a"]
    1
    """

    __slots__ = ("_values",)

    def __init__(self, values=()):
        self._values = dict(values)

    def __getitem__(self, name):
        return self._values[name]

    def __iter__(self):
        return iter(self._values)

    def __len__(self):
        return len(self._values)

    def __repr__(self):
        return f"{type(self).__name__}({self._values!r})"

    def __reduce__(self):
        return type(self), (self._values,)
