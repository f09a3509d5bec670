"""Describe a key of the configuration, and write its value, in one line."""

import json
from typing import Any

from turnout.config.schema import Key
from turnout.number_text import number_text


def describe_key(key: Key) -> str:
    """Unit, limits and reason of a key as text.

    Parameters
    ----------
    key : Key
        Key of the schema.

    Returns
    -------
    str
        One line, without a full stop.

    Examples
    --------
    >>> describe_key(Key("number", "the paper's gate", minimum=0.0, maximum=1.0))
    "0 to 1: the paper's gate"
    >>> describe_key(Key("number", "samples per second", "Hz", minimum=250.0, maximum=1e7))
    '250 to 10,000,000 [Hz]: samples per second'
    """
    unit = "" if key.unit in ("", "-", "1") else f"[{key.unit}]"
    limits = ""
    if key.choices:
        limits = " or ".join(map(str, key.choices))
    elif key.above is not None:
        limits = f"above {number_text(key.above)}"
    elif key.minimum is not None and key.maximum is not None:
        limits = f"{number_text(key.minimum)} to {number_text(key.maximum)}"
    elif key.minimum is not None:
        limits = f"at least {number_text(key.minimum)}"
    elif key.maximum is not None:
        limits = f"at most {number_text(key.maximum)}"
    head = " ".join(text for text in (limits, unit) if text)
    return f"{head}: {key.meaning}" if head else key.meaning


def yaml_text(value: Any) -> str:
    """A value in YAML notation.

    Parameters
    ----------
    value : any
        Text, number, flag, None or a tuple of these.

    Returns
    -------
    str
        As it is written in a file.

    Examples
    --------
    >>> yaml_text("auto"), yaml_text(("a b", 1.0)), yaml_text(None)
    ('auto', '["a b", 1.0]', 'null')
    """
    if isinstance(value, tuple):
        return "[" + ", ".join(yaml_text(v) for v in value) + "]"
    if isinstance(value, str):
        plain_word = value.replace("_", "").replace("-", "").isalpha() and value not in ("true", "false", "null")
        return value if plain_word else json.dumps(value, ensure_ascii=False)
    return json.dumps(value)
