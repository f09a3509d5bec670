"""Field of a settings dataclass with unit, limits and the reason of its default."""

from dataclasses import field


def setting(default, unit="", why="", minimum=None, maximum=None, choices=None):
    """Dataclass field with metadata ``unit``, ``why``, ``minimum``, ``maximum``, ``choices``.

    The JSON schema, the default configuration file and the table in the documentation are generated from it.

    >>> from dataclasses import dataclass, fields
    >>> @dataclass(frozen=True)
    ... class Gate:
    ...     level: float = setting(0.8, why="the paper's gate", minimum=0.0, maximum=1.0)
    >>> Gate().level, fields(Gate)[0].metadata["why"]
    (0.8, "the paper's gate")
    """
    metadata = {"unit": unit, "why": why, "minimum": minimum, "maximum": maximum, "choices": choices}
    if isinstance(default, (list, dict, set)):
        raise TypeError("use a tuple, settings are immutable")
    return field(default=default, metadata=metadata)
