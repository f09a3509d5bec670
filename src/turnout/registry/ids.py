"""Make ids from content: the same inputs give the same id, so no row is appended twice."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import Any


def content_id(*values: Any) -> str:
    """First 128 bits of the sha256 of the values, as 32 hexadecimal digits.

    ("ab", "c") and ("a", "bc") differ. Bytes alone give the plain sha256 of the file's content.

    Parameters
    ----------
    *values : object
        Text, bytes, numbers, None, times, or lists and dictionaries of these.

    Returns
    -------
    str
        The id.

    Raises
    ------
    TypeError
        For a value of another type.

    References
    ----------
    FIPS 180-4, appendix B.1: the sha256 of "abc" begins ba7816bf 8f01cfea 414140de 5dae2223.

    Examples
    --------
    >>> content_id(b"abc")
    'ba7816bf8f01cfea414140de5dae2223'
    >>> content_id("ab", "c") == content_id("a", "bc")
    False
    """
    if len(values) == 1 and isinstance(values[0], bytes):
        return hashlib.sha256(values[0]).hexdigest()[:32]
    text = json.dumps(values, sort_keys=True, separators=(",", ":"), ensure_ascii=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _plain(value: Any) -> Any:
    """Convert types unknown to JSON: bytes to their hash, times to ISO text, numpy scalars and arrays to numbers."""
    if isinstance(value, bytes):
        return {"sha256": hashlib.sha256(value).hexdigest()}
    if hasattr(value, "isoformat"):
        return value.isoformat()
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"no content id from {type(value).__name__} {value!r}")
