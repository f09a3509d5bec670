"""YAML files as trees in which every value knows its line and column, so that an error can name them.

``load`` reads a file of the configuration; ``turnout.config.parameters`` builds on the same tree. Files that cannot be
read as text or YAML raise ``ConfigError``. ``Frozen`` is a read-only mapping that can be pickled.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from turnout.errors import ConfigError

if TYPE_CHECKING:  # imported late: a command that reads no YAML does not pay for it
    from ruamel.yaml.constructor import BaseConstructor
    from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode

    AnyNode = ScalarNode | SequenceNode | MappingNode

Scalar = str | int | float | bool | None


@contextmanager
def as_config_errors(path: object, where: str, syntax_remedy: str = "") -> Iterator[None]:
    """Context in which a file is read and parsed; errors become a ConfigError for ``path``.

    Covered are files that cannot be opened (error at ``where``) or are not UTF-8, characters that YAML does not allow,
    an anchor inside its own content, and with ``syntax_remedy`` wrong syntax.
    """
    from ruamel.yaml.error import MarkedYAMLError
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
    except MarkedYAMLError as error:
        if not syntax_remedy:
            raise
        mark = error.problem_mark or error.context_mark
        place = str(Place(str(path), mark.line + 1, mark.column + 1)) if mark else where
        raise ConfigError(path, place, str(error.problem), syntax_remedy) from None
    except RecursionError:
        problem = "content without an end, as of an anchor that holds itself"
        raise ConfigError(path, where, problem, "Write the values out there") from None


@dataclass(frozen=True)
class Place:
    """File, line and column of a value, counted from 1. Line 0 is a value that no line of the file has.

    ``entry`` is the path of the value within a parameter file, "" for the whole file. Errors then name it instead of
    the column.

    >>> str(Place("config.yaml", 3, 5)), str(Place("track.yaml", 3, 5, "rail.mass")), str(Place("track.yaml", entry=""))
    ('line 3, column 5', 'line 3, rail.mass', 'the file')
    """

    path: str
    line: int = 0
    column: int = 0
    entry: str | None = None

    def __str__(self) -> str:
        if self.entry is None:
            return f"line {self.line}, column {self.column}"
        return ", ".join([f"line {self.line}"] * (self.line > 0) + [self.entry] * bool(self.entry)) or "the file"

    def below(self, key: str | int, written: Place | None = None) -> Place:
        """Place of the entry ``key`` below this one; its line is that of ``written`` if it is in the same file."""
        entry = f"{self.entry}[{key}]" if isinstance(key, int) else f"{self.entry}.{key}".lstrip(".")
        line = written if written and written.path == self.path else self
        return Place(self.path, line.line, line.column, entry)

    def error(self, problem: str, remedy: str) -> ConfigError:
        """A ``ConfigError`` that points here."""
        return ConfigError(self.path, str(self), problem, remedy)


@dataclass(frozen=True)
class Leaf:
    """One value: text, number, flag, None, or a tuple of these."""

    value: Any  # Scalar or tuple of Scalar: its key in the schema says which
    place: Place


class Branch(dict):
    """A mapping from names to ``Leaf`` or ``Branch``; ``place`` is its start, ``key_places`` those of its names."""

    def __init__(self, place: Place):
        super().__init__()
        self.place = place
        self.key_places: dict[str | int | None, Place] = {}

    def put(self, name: str, value: Any, place: Place) -> None:
        """Add a key whose name stands at ``place``."""
        self[name] = value
        self.key_places[name] = place

    def place_of(self, name: str | int | None) -> Place:
        """Where the name of a key stands; the start of the branch if it has no such key."""
        return self.key_places.get(name, self.place)


def compose(path: Path) -> tuple[AnyNode | None, BaseConstructor]:
    """(root node, constructor of values from nodes) of a YAML file; the node is None if the file is empty."""
    from ruamel.yaml import YAML

    yaml = YAML(typ="safe", pure=True)
    return yaml.compose(Path(path).read_text(encoding="utf-8")), yaml.constructor


def load(path: Path, name: str | None = None) -> Branch:
    """The mapping in the YAML file ``path``, called ``name`` in errors; ConfigError if it is no YAML."""
    name = name or str(path)
    with as_config_errors(name, "line 1", "Correct the YAML syntax there"):
        node, constructor = compose(path)
    if node is None:
        return Branch(Place(name, 1, 1))
    tree = _tree(node, name, constructor)
    if not isinstance(tree, Branch):
        raise tree.place.error(f"{tree.value!r} where names with values are expected", "Write 'name: value' lines")
    return tree


def place_of_node(node: AnyNode, path: str) -> Place:
    """Where a node starts in the file ``path``."""
    return Place(path, node.start_mark.line + 1, node.start_mark.column + 1)


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


def _tree(node: AnyNode, path: str, constructor: BaseConstructor, ancestors: tuple[AnyNode, ...] = ()) -> Branch | Leaf:
    place = place_of_node(node, path)
    if node.id == "mapping":
        if any(node is ancestor for ancestor in ancestors):
            raise place.error("an anchor whose content holds the anchor itself", "Write the values out there")
        branch = Branch(place)
        for key, value in node.value:
            key_place = place_of_node(key, path)
            name = str(key.value)
            if name in branch:
                first = branch.key_places[name].line
                raise key_place.error(f"{name!r} for the second time, first in line {first}", "Keep one of them")
            branch.put(name, _tree(value, path, constructor, (*ancestors, node)), key_place)
        return branch
    if node.id == "sequence":
        return Leaf(tuple(_scalar(item, path, constructor) for item in node.value), place)
    return Leaf(_scalar(node, path, constructor), place)


def _scalar(node: AnyNode, path: str, constructor: BaseConstructor) -> Scalar:
    from ruamel.yaml.error import MarkedYAMLError

    place = place_of_node(node, path)
    if node.id != "scalar":
        raise place.error(f"a {node.id} inside a list", "Write plain values in lists")
    if str(node.tag).endswith((":timestamp", ":str")):
        return node.value
    try:
        return constructor.construct_object(node)
    except (MarkedYAMLError, ValueError):
        problem = f"{node.value!r} with the tag {node.tag!r}, which is none of a configuration"
        raise place.error(problem, "Write a plain value without a tag") from None


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
