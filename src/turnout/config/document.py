"""YAML files as trees in which every value knows its line and column, so that an error can name them.

``load`` reads a file of the configuration; ``turnout.config.parameters`` builds on the same tree. Files that cannot be
read as text or YAML raise ``ConfigError``.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from turnout.errors import ConfigError, remedy_of_access

if TYPE_CHECKING:  # imported late: a command that reads no YAML does not pay for it
    from ruamel.yaml.constructor import BaseConstructor
    from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode

    AnyNode = ScalarNode | SequenceNode | MappingNode

Scalar = str | int | float | bool | None

# Part of a problem that the YAML parser states -> the problem and the remedy for people who do not know its terms.
YAML_PROBLEMS = {
    "'\\t'": ("a tab", "Write blanks: YAML does not allow tabs before a value"),
    "could not find expected ':'": (
        "a name without ':' behind it",
        "Write 'name: value', with a blank behind it",
    ),
    "found '<block mapping start>'": (
        "its indentation is not that of the lines above",
        "Begin all lines of a block with the same number of blanks",
    ),
    "mapping values are not allowed": (
        "a second ':' in one value, or more blanks in front of it than the line above has",
        "Put a text with ': ' in quotes, and begin all lines of a block with the same number of blanks",
    ),
    "duplicate key": ("a name for the second time", "Keep one of them"),
    "found unexpected end of stream": ("a quote that is not closed", "Close it, or leave it out"),
    "another document": ("a second document begins", "Remove the line '---', or keep one of the two"),
}


@contextmanager
def as_config_errors(path: Path | str, where: str, syntax_remedy: str = "") -> Iterator[None]:
    """Context in which a file is read and parsed; errors become a ConfigError for this file.

    Parameters
    ----------
    path : Path or str
        What errors call the file.
    where : str
        Place in an error of the file as a whole.
    syntax_remedy : str
        Remedy of wrong YAML syntax; "": such an error is not converted.

    Raises
    ------
    ConfigError
        If the file cannot be opened or is not UTF-8, has a character that YAML does not allow, an anchor inside its own
        content, or wrong syntax.
    """
    from ruamel.yaml.error import MarkedYAMLError
    from ruamel.yaml.reader import ReaderError

    try:
        yield
    except OSError as error:
        problem = f"cannot be read: {error.strerror}"
        remedy = remedy_of_access(error, "Put a file of that name there, or remove it")
        raise ConfigError(path, where, problem, remedy) from None
    except UnicodeDecodeError as error:
        before = error.object[: error.start]
        byte = Place(str(path), before.count(b"\n") + 1, error.start - before.rfind(b"\n"))
        raise byte.error("a byte that is not UTF-8", "Save the file as UTF-8") from None
    except ReaderError as error:
        problem = f"the character {chr(error.character)!r}, which no YAML file may hold"
        raise ConfigError(path, f"character {error.position + 1}", problem, "Remove it") from None
    except MarkedYAMLError as error:
        if not syntax_remedy:
            raise
        mark = error.problem_mark or error.context_mark
        stated = str(error.problem)
        # the problem is the key, or what was opened there, not what follows it
        if error.context == "while scanning a simple key" or "end of stream" in stated or "<stream end>" in stated:
            mark = error.context_mark or mark
        place = str(Place(str(path), mark.line + 1, mark.column + 1)) if mark else where
        problem, remedy = next(
            (texts for part, texts in YAML_PROBLEMS.items() if part in stated),
            (stated.replace("'<stream end>'", "the end of the file"), syntax_remedy),
        )
        raise ConfigError(path, place, problem, remedy) from None
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
        """Place of an entry below this one, in a parameter file.

        Parameters
        ----------
        key : str or int
            Name of the entry, or its number in a list, from 0.
        written : Place or None
            Where the entry stands; it gives the line if it is in the same file.

        Returns
        -------
        Place
            The place, with the path of the entry.
        """
        entry = f"{self.entry}[{key}]" if isinstance(key, int) else f"{self.entry}.{key}".lstrip(".")
        line = written if written and written.path == self.path else self
        return Place(self.path, line.line, line.column, entry)

    def error(self, problem: str, remedy: str) -> ConfigError:
        """A ``ConfigError`` that points here.

        Parameters
        ----------
        problem : str
            What is wrong there.
        remedy : str
            What to write instead.

        Returns
        -------
        ConfigError
            The error; it is returned, not raised.
        """
        return ConfigError(self.path, str(self), problem, remedy)


@dataclass(frozen=True)
class Leaf:
    """One value: text, number, flag, None, or a tuple of these."""

    value: Any  # Scalar or tuple of Scalar: its key in the schema says which
    place: Place
    text: str = ""  # as it is written, without quotes; "" of a list


class Branch(dict):
    """A mapping from names to ``Leaf`` or ``Branch``; ``place`` is its start, ``key_places`` those of its names.

    Parameters
    ----------
    place : Place
        Where the mapping starts.
    """

    def __init__(self, place: Place) -> None:
        super().__init__()
        self.place = place
        self.key_places: dict[str | int | None, Place] = {}

    def put(self, name: str, value: Any, place: Place) -> None:
        """Add a key.

        Parameters
        ----------
        name : str
            Name of the key.
        value : Leaf, Branch or any
            Its value.
        place : Place
            Where its name stands.
        """
        self[name] = value
        self.key_places[name] = place

    def place_of(self, name: str | int | None) -> Place:
        """Where the name of a key stands.

        Parameters
        ----------
        name : str, int or None
            Name of a key.

        Returns
        -------
        Place
            Where the name stands; the start of the branch if it has no such key.
        """
        return self.key_places.get(name, self.place)


def compose(path: Path, text: str | None = None) -> tuple[AnyNode | None, BaseConstructor]:
    """Parse a YAML file without conversion of its values.

    Parameters
    ----------
    path : Path
        The file.
    text : str or None
        Its content; None: it is read.

    Returns
    -------
    tuple of (Node or None, BaseConstructor)
        Root node, None for an empty file; constructor of values from nodes.

    Raises
    ------
    MarkedYAMLError
        For wrong syntax. OSError and UnicodeDecodeError are not converted either.
    ConfigError
        If aliases make the file contain itself, or multiply its values beyond ``MAX_VALUES``.
    """
    from ruamel.yaml import YAML

    yaml = YAML(typ="safe", pure=True)
    root = yaml.compose(Path(path).read_text(encoding="utf-8") if text is None else text)
    if root is not None:
        _require_few_values(root, str(path))
    return root, yaml.constructor


MAX_VALUES = 1_000_000  # names and values of a file, each alias counted as what it stands for


def _require_few_values(root: AnyNode, path: str) -> None:
    """ConfigError if the values that the aliases of a file stand for are endless or too many."""
    counts: dict[int, int | None] = {}  # None while the members of a node are counted

    def count(node: AnyNode) -> int:
        if id(node) not in counts:
            counts[id(node)] = None
            members = node.value if isinstance(node.value, list) else ()
            pairs = (part for member in members for part in (member if isinstance(member, tuple) else (member,)))
            counts[id(node)] = 1 + sum(count(part) for part in pairs)
        n_value = counts[id(node)]
        if n_value is None or n_value > MAX_VALUES:
            problem = (
                "it contains itself" if n_value is None else f"its aliases stand for more than {MAX_VALUES} values"
            )
            raise place_of_node(node, path).error(problem, "Write out what the alias stands for")
        return n_value

    count(root)


def load(path: Path, name: str | None = None) -> Branch:
    """The mapping in a YAML file.

    Parameters
    ----------
    path : Path
        The file.
    name : str or None
        What errors call the file; None: its path.

    Returns
    -------
    Branch
        Names and values with their places; empty for an empty file.

    Raises
    ------
    ConfigError
        If the file cannot be read, is no YAML, or is no mapping.
    """
    name = name or str(path)
    with as_config_errors(name, "line 1", "Correct the YAML syntax there"):
        node, constructor = compose(path)
    if node is None:
        return Branch(Place(name, 1, 1))
    tree = _tree(node, name, constructor)
    if isinstance(tree, Leaf) and tree.value is None and not tree.text:
        return Branch(Place(name, 1, 1))
    if not isinstance(tree, Branch):
        what = "a list" if isinstance(tree.value, tuple) else repr(tree.value)
        raise tree.place.error(f"{what} where names with values are expected", "Write 'name: value' lines")
    return tree


def place_of_node(node: AnyNode, path: str) -> Place:
    """Where a node starts in the file ``path``.

    Parameters
    ----------
    node : Node
        Node of the file.
    path : str
        What errors call the file.

    Returns
    -------
    Place
        Its line and column.
    """
    return Place(path, node.start_mark.line + 1, node.start_mark.column + 1)


def merge_branches(*branches: Branch) -> Branch:
    """Merge branches leaf by leaf; later branches win. A list is one leaf and is replaced as a whole.

    Parameters
    ----------
    *branches : Branch
        At least one; the place of the first one is kept.

    Returns
    -------
    Branch
        A new branch; the values are shared.
    """
    merged = Branch(branches[0].place)
    for branch in branches:
        for name, value in branch.items():
            old = merged.get(name)
            if isinstance(value, Branch):
                value = merge_branches(old, value) if isinstance(old, Branch) else merge_branches(value)
            merged.put(name, value, branch.key_places[name])
    return merged


def plain_values(tree: Branch | Leaf) -> Any:
    """The values without their places.

    Parameters
    ----------
    tree : Branch or Leaf
        Tree of a file.

    Returns
    -------
    dict, tuple, str, number, bool or None
        Dictionaries for branches, values for leaves.
    """
    return {k: plain_values(v) for k, v in tree.items()} if isinstance(tree, Branch) else tree.value


def leaves(tree: Branch, prefix: str = "") -> Iterator[tuple[str, Leaf]]:
    """Every value with the path of its key, in order.

    Parameters
    ----------
    tree : Branch
        Tree of a file.
    prefix : str
        Put before each path.

    Yields
    ------
    tuple of (str, Leaf)
        Path such as "hammer.rate", and the value with its place.
    """
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
            if key.id != "scalar":
                raise key_place.error(
                    f"a {'list' if key.id == 'sequence' else key.id} in place of a name",
                    "Write 'name: value', without '?' and brackets",
                )
            if key.value == "<<":
                raise key_place.error(
                    "the merge key '<<', which is not read", "Write out the values that it stands for"
                )
            name = _compose_letters(key.value)
            if name in branch:
                first = branch.key_places[name].line
                raise key_place.error(f"{name!r} for the second time, first in line {first}", "Keep one of them")
            branch.put(name, _tree(value, path, constructor, (*ancestors, node)), key_place)
        return branch
    if node.id == "sequence":
        return Leaf(tuple(_scalar(item, path, constructor) for item in node.value), place)
    return Leaf(_scalar(node, path, constructor), place, _compose_letters(node.value))


def _compose_letters(text: Any) -> str:
    """A text with composed letters: two spellings of an umlaut that look the same are the same name."""
    return unicodedata.normalize("NFC", str(text))


def _scalar(node: AnyNode, path: str, constructor: BaseConstructor) -> Scalar:
    from ruamel.yaml.error import MarkedYAMLError

    place = place_of_node(node, path)
    if node.id != "scalar":
        raise place.error(f"a {node.id} inside a list", "Write plain values in lists")
    if str(node.tag).endswith((":timestamp", ":str")):
        return _compose_letters(node.value)
    try:
        return constructor.construct_object(node)
    except (MarkedYAMLError, ValueError):
        problem = f"{node.value!r} with the tag {node.tag!r}, which is none of a configuration"
        raise place.error(problem, "Write a plain value without a tag") from None
