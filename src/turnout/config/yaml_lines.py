"""The line of an entry in a YAML file, found again when an error is about to name it."""

import re
from pathlib import Path

KEYS = re.compile(r"[^.\[\]]+")


def line_of(path, place: str) -> int | None:
    """Line, from 1, of an entry such as "routes.main[1].share", or of the last one on the way that is there.

    None where the file cannot be read, or its first entry is not in it.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        node = YAML(typ="safe", pure=True).compose(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, YAMLError):
        return None
    line = None
    for key in KEYS.findall(place):
        if (found := _below(node, key)) is None:
            break
        line, node = found
    return line


def where(path, place: str, at: str = "") -> str:
    """``place`` as errors name it, with the line of ``at``, an entry below it, where it is found.

    >>> where("nowhere.yaml", "rail.mass"), where("nowhere.yaml", "")
    ('rail.mass', 'the file')
    """
    line = line_of(path, f"{place}.{at}")
    said = [f"line {line}"] if line else []
    return ", ".join([*said, place] if place else said or ["the file"])


def _below(node, key):
    """(line, node) of the entry ``key`` of a node, also one that it takes over with <<; None where there is none."""
    kind = getattr(node, "id", "")
    if kind == "sequence":
        item = node.value[int(key)] if key.isdigit() and int(key) < len(node.value) else None
        return item and (item.start_mark.line + 1, item)
    if kind != "mapping":
        return None
    for name, value in node.value:
        if name.value == key:
            return name.start_mark.line + 1, value
    taken = [value for name, value in node.value if name.value == "<<"]
    return next((found for value in taken if (found := _below(value, key))), None)
