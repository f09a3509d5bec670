"""Field of a settings dataclass with unit, limits and the reason of its default."""

from dataclasses import field
from typing import Any

WEB_ADDRESS = r"(?:https?://[^\s/]\S*)?"
MAIL_ADDRESS = r"[^<>;,]*<[^\s<>;,]+>|[^\s<>;,]+"  # address, or Name <address>; "root" is one of a local server
MAIL_SENDER = rf"\s*(?:{MAIL_ADDRESS})?\s*"
MAIL_ADDRESSES = rf"{MAIL_SENDER}(?:,{MAIL_SENDER})*"


def setting(
    default: Any,
    unit: str = "",
    why: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple | None = None,
    pattern: str = "",
) -> Any:
    """Dataclass field with metadata.

    The JSON schema, the default configuration file and the table in the documentation are generated from it.

    Parameters
    ----------
    default : any
        Value of the setting; a list as a tuple, because settings are immutable.
    unit : str
        Unit of the value, "" without one.
    why : str
        Meaning, and reason of the default.
    minimum : float or None
        Smallest value that is allowed; None: no limit.
    maximum : float or None
        Largest value that is allowed; None: no limit.
    choices : tuple or None
        The only values that are allowed; None: any.
    pattern : str
        Regular expression of the texts that are allowed, one of this module; "": any.

    Returns
    -------
    Field
        The field; typed as any, so that it fits the annotation of the setting.

    Raises
    ------
    TypeError
        If the default is mutable.

    Examples
    --------
    >>> from dataclasses import dataclass, fields
    >>> @dataclass(frozen=True)
    ... class Gate:
    ...     level: float = setting(0.8, why="the paper's gate", minimum=0.0, maximum=1.0)
    >>> Gate().level, fields(Gate)[0].metadata["why"]
    (0.8, "the paper's gate")
    """
    metadata = {
        "unit": unit,
        "why": why,
        "minimum": minimum,
        "maximum": maximum,
        "choices": choices,
        "pattern": pattern,
    }
    if isinstance(default, (list, dict, set)):
        raise TypeError("use a tuple, settings are immutable")
    return field(default=default, metadata=metadata)
