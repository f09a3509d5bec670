"""Read parameter files: YAML or JSON, with the place of each entry for messages."""

from __future__ import annotations

from functools import lru_cache
from itertools import repeat
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from turnout.config.document import Place, as_config_errors, compose, place_of_node
from turnout.config.parameters import KEYS, Entries, Entry, Number, ParameterSet
from turnout.config.schema import suggestion
from turnout.config.value_hints import DECIMAL_POINT, decimal_point_hint
from turnout.number_text import decimal_number
from turnout.units import PARAMETER_UNITS, parameter_unit

if TYPE_CHECKING:
    from turnout.config.document import AnyNode


def read_parameters(path: Path | str) -> ParameterSet:
    """The parameter set in a YAML file.

    A number is ``{value: 120, unit: MN/m, source: ...}``. ``source`` is text or a key of the file's ``sources``
    table. A source that begins with "estimate" requires a ``prior``: the relative standard deviation of the value.

    Parameters
    ----------
    path : Path or str
        The file.

    Returns
    -------
    ParameterSet
        Its content without the table of sources.

    Raises
    ------
    ConfigError
        If the file cannot be read, is no YAML, or a number lacks unit, source or prior.
    """
    place = Place(str(path), entry="")
    with as_config_errors(path, "the file", "Correct the YAML"):
        content, node = read_content(Path(path))
    if not isinstance(content, dict):
        raise place.error("is not a mapping", "Write 'key: value' lines")
    if not isinstance(sources := content.get("sources") or {}, dict):
        written, _ = _members(node, place.path).get("sources", (None, None))
        raise place.below("sources", written).error("is not a mapping", "Write 'key: source' lines below it")
    with as_config_errors(path, "the file"):
        return _parameter_set({k: v for k, v in content.items() if k != "sources"}, node, place, sources)


def read_unchanged_parameters(path: Path) -> ParameterSet:
    """The parameter set in a YAML file, which is parsed only once for each content.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    ParameterSet
        As of ``read_parameters``. Nobody may change it.

    Raises
    ------
    ConfigError
        As ``read_parameters``.
    """
    return _parse_content(path, path.read_bytes()) if path.is_file() else read_parameters(path)


@lru_cache(maxsize=32)
def _parse_content(path: Path, content: bytes) -> ParameterSet:
    return read_parameters(path)


def read_content(path: Path) -> tuple[Any, AnyNode | None]:
    """Content of a YAML file, with its nodes. Each text is parsed once: nobody may change what is returned.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    tuple of (any, Node or None)
        Dictionaries, lists and values; root node. Merge keys are resolved in both.

    Raises
    ------
    MarkedYAMLError
        For wrong syntax or a key that comes twice.
    """
    return _content_of(path, path.read_text(encoding="utf-8"))


@lru_cache(maxsize=32)
def _content_of(path: Path, text: str) -> tuple[Any, AnyNode | None]:
    node, constructor = compose(path, text)
    return None if node is None else constructor.construct_document(node), node


def _parse(value: Any, node: AnyNode | None, place: Place, sources: dict) -> Entry:
    """The entry at ``place``, with ParameterSet, Entries and Number in place of dictionaries, lists and numbers."""
    if isinstance(value, list):
        nodes = node.value if node is not None and node.id == "sequence" else [None] * len(value)
        places = [place.below(k, item and place_of_node(item, place.path)) for k, item in enumerate(nodes)]
        return Entries(map(_parse, value, nodes, places, repeat(sources)), places)
    if not isinstance(value, dict):
        return value
    return _number(value, node, place, sources) if "value" in value else _parameter_set(value, node, place, sources)


def _parameter_set(content: dict, node: AnyNode | None, place: Place, sources: dict) -> ParameterSet:
    result, written = ParameterSet(place), _members(node, place.path)
    for key, value in content.items():
        key_place, member = written.get(str(key), (None, None))
        below = place.below(str(key), key_place)
        result.put(key, _parse(value, member, below, sources), below)
    return result


def _members(node: AnyNode | None, path: str) -> dict[str, tuple[Place, AnyNode]]:
    """Key -> (where it stands, node of its value); of a key that a merge key repeats those in the mapping itself."""
    pairs = node.value if node is not None and node.id == "mapping" else ()
    return {str(key.value): (place_of_node(key, path), value) for key, value in pairs}


def _number(entry: dict, node: AnyNode | None, place: Place, sources: dict) -> Number:
    texts = {key: member.value for key, (_, member) in _members(node, place.path).items() if member.id == "scalar"}
    for key in ("unit", "source"):
        if isinstance(entry.get(key), (list, dict, type(None))):
            raise place.error(f"a number without {key}", f"Give its {key}")
    if unknown := sorted(map(str, set(entry) - KEYS)):
        remedy = DECIMAL_POINT if unknown[0].isdecimal() else suggestion(unknown[0], KEYS)
        raise place.error(f"unknown key {unknown[0]!r}", remedy)
    known_unit = parameter_unit(str(entry["unit"]))
    if known_unit is None:
        alike = [unit for unit in PARAMETER_UNITS if unit.lower() == str(entry["unit"]).lower()]
        hint = f"Did you mean {' or '.join(map(repr, alike))}? " if alike else ""
        raise place.error(f"unknown unit {entry['unit']!r}", f"{hint}Use one of {', '.join(PARAMETER_UNITS)}")
    source = sources.get(entry["source"], entry["source"])
    prior = entry.get("prior")
    spread = None if prior is None else _finite(prior, texts.get("prior"), place)
    if (spread is None and str(source).startswith("estimate")) or (spread is not None and spread <= 0.0):
        problem = "an estimate without a prior" if spread is None else f"a prior of {prior}"
        raise place.error(problem, "Give its relative standard deviation, above 0, as prior")
    unit, factor = known_unit
    return Number(factor * _finite(entry["value"], texts.get("value"), place), unit, str(source), spread)


def _finite(value: Any, text: str | None, place: Place) -> float:
    """The number that is written as ``text``; YAML itself also reads "true" as 1 and "24_6" as 246."""
    try:
        is_special = isinstance(value, float) and not isfinite(value)
        number = value if is_special else decimal_number(str(value) if text is None else text)
    except ValueError:
        written = repr(value if text is None or isinstance(value, str) else text)
        raise place.error(f"{written} is not a number", f"Write a number{decimal_point_hint(str(value))}") from None
    if not isfinite(number):
        raise place.error(f"{value!r} is not finite", "Write a number")
    return number
