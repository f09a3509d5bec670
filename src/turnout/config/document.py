"""YAML files as trees in which every value knows its line and column, so that an error can name them.

Files that cannot be read as text or YAML raise ``ConfigError``. ``Frozen`` is a read-only mapping that can be pickled.
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from turnout.errors import ConfigError


@contextmanager
def as_config_errors(path: object, where: str) -> Iterator[None]:
    """Context in which a file is read and parsed; errors become a ConfigError for ``path``.

    Covered are files that cannot be opened (error at ``where``) or are not UTF-8, characters that YAML does not allow,
    and an anchor inside its own content.
    """
    from ruamel.yaml.reader import ReaderError

    try:
        yield
    except OSError as error:
        problem = f"cannot be read: {error.strerror}"
        raise ConfigError(path, where, problem, "Put a file of that name there, or take it away") from None
    except UnicodeDecodeError as error:
        raise ConfigError(path, f"byte {error.start}", "a byte that is not UTF-8", "Save the file as UTF-8") from None
    except ReaderError as error:
        problem = f"the character {chr(error.character)!r}, which no YAML file may hold"
        raise ConfigError(path, f"character {error.position + 1}", problem, "Take it away") from None
    except RecursionError:
        problem = "content without an end, as of an anchor that holds itself"
        raise ConfigError(path, where, problem, "Write the values out there") from None


@dataclass(frozen=True)
class Place:
    """File, line and column, counted from 1. Line 0 is a value that is built into the program."""

    path: str
    line: int = 0
    column: int = 0

    def __str__(self):
        return f"line {self.line}, column {self.column}"

    def error(self, problem: str, remedy: str) -> ConfigError:
        """A ``ConfigError`` that points here."""
        return ConfigError(self.path, str(self), problem, remedy)


@dataclass(frozen=True)
class Leaf:
    """One value: text, number, flag, None, or a tuple of these."""

    value: object
    place: Place


class Branch(dict):
    """A mapping from names to ``Leaf`` or ``Branch``; ``place`` is its start, ``key_places`` those of its names."""

    def __init__(self, place: Place):
        super().__init__()
        self.place = place
        self.key_places: dict[str, Place] = {}

    def put(self, name: str, value, place: Place) -> None:
        """Add a key whose name stands at ``place``."""
        self[name] = value
        self.key_places[name] = place


def load(path: Path, name: str | None = None) -> Branch:
    """The mapping in the YAML file ``path``, called ``name`` in errors; ConfigError if it is no YAML."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError

    name = name or str(path)
    yaml = YAML(typ="safe", pure=True)
    try:
        with as_config_errors(name, "line 1"):
            node = yaml.compose(Path(path).read_text(encoding="utf-8"))
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = Place(name, mark.line + 1, mark.column + 1) if mark else Place(name, 1, 1)
        raise place.error(str(error.problem), "Correct the YAML syntax there") from None
    if node is None:
        return Branch(Place(name, 1, 1))
    tree = _tree(node, name, yaml.constructor)
    if not isinstance(tree, Branch):
        raise tree.place.error(f"{tree.value!r} where names with values are expected", "Write 'name: value' lines")
    return tree


def merge_branches(*branches: Branch) -> Branch:
    """Merge branches leaf by leaf; later branches win. A list is one leaf and is replaced as a whole."""
    merged = Branch(branches[0].place)
    for branch in branches:
        for name, value in branch.items():
            old = merged.get(name)
            if isinstance(value, Branch):
                value = merge_branches(old, value) if isinstance(old, Branch) else merge_branches(value)
            merged.put(name, value, branch.key_places[name])
    return merged


def plain_values(tree):
    """The values without their places: dict, tuple, text, numbers."""
    return {k: plain_values(v) for k, v in tree.items()} if isinstance(tree, Branch) else tree.value


def leaves(tree: Branch, prefix: str = "") -> Iterator[tuple[str, Leaf]]:
    """``("hammer.rate", leaf)`` for every value, in order."""
    for name, value in tree.items():
        if isinstance(value, Branch):
            yield from leaves(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


def _tree(node, path, constructor, ancestors=()):
    place = Place(path, node.start_mark.line + 1, node.start_mark.column + 1)
    if node.id == "mapping":
        if any(node is ancestor for ancestor in ancestors):
            raise place.error("an anchor whose content holds the anchor itself", "Write the values out there")
        branch = Branch(place)
        for key, value in node.value:
            key_place = Place(path, key.start_mark.line + 1, key.start_mark.column + 1)
            name = str(key.value)
            if name in branch:
                first = branch.key_places[name].line
                raise key_place.error(f"{name!r} for the second time, first in line {first}", "Keep one of them")
            branch.put(name, _tree(value, path, constructor, (*ancestors, node)), key_place)
        return branch
    if node.id == "sequence":
        return Leaf(tuple(_scalar(item, path, constructor) for item in node.value), place)
    return Leaf(_scalar(node, path, constructor), place)


def _scalar(node, path, constructor):
    from ruamel.yaml.error import MarkedYAMLError

    if node.id != "scalar":
        place = Place(path, node.start_mark.line + 1, node.start_mark.column + 1)
        raise place.error(f"a {node.id} inside a list", "Write plain values in lists")
    if node.tag.endswith((":timestamp", ":str")):
        return node.value
    try:
        return constructor.construct_object(node)
    except (MarkedYAMLError, ValueError):
        place = Place(path, node.start_mark.line + 1, node.start_mark.column + 1)
        problem = f"{node.value!r} with the tag {node.tag!r}, which is none of a configuration"
        raise place.error(problem, "Write a plain value without a tag") from None


ENTRY_KEYS = re.compile(r"[^.\[\]]+")


def line_of(path, place: str) -> int | None:
    """Line, from 1, of an entry such as "routes.main[1].share", or of its last ancestor that exists.

    None if the file cannot be read, or does not contain the first entry of the path.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        node = YAML(typ="safe", pure=True).compose(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, YAMLError):
        return None
    line = None
    for key in ENTRY_KEYS.findall(place):
        if (entry := _find_entry(node, key)) is None:
            break
        line, node = entry
    return line


def describe_place(path, place: str, entry: str = "") -> str:
    """``place`` as errors name it, with the line of ``entry`` below it if that exists.

    >>> describe_place("nowhere.yaml", "rail.mass"), describe_place("nowhere.yaml", "")
    ('rail.mass', 'the file')
    """
    line = line_of(path, f"{place}.{entry}")
    pieces = [f"line {line}"] if line else []
    return ", ".join([*pieces, place] if place else pieces or ["the file"])


def _find_entry(node, key):
    """(line, node) of the entry ``key`` of a node, merge keys (<<) included; None if there is none."""
    node_type = getattr(node, "id", "")
    if node_type == "sequence":
        item = node.value[int(key)] if key.isdigit() and int(key) < len(node.value) else None
        return item and (item.start_mark.line + 1, item)
    if node_type != "mapping":
        return None
    for name, value in node.value:
        if name.value == key:
            return name.start_mark.line + 1, value
    merged = [value for name, value in node.value if name.value == "<<"]
    return next((entry for value in merged if (entry := _find_entry(value, key))), None)


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
