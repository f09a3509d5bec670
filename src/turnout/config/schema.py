"""Types of configuration keys, and the check of a tree of YAML against them."""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

from turnout.config.document import Branch, Leaf
from turnout.config.settings.setting import MAIL_ADDRESSES, MAIL_SENDER, WEB_ADDRESS
from turnout.config.value_hints import (
    DECIMAL_POINT,
    decimal_point_hint,
    hint_at_other_unit,
    hint_without_unit,
    is_in_range,
)
from turnout.errors import ConfigError
from turnout.number_text import decimal_number, number_text

ID = r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}"
LETTERS = "A-Za-zÀ-ÖØ-öø-ɏΑ-ωА-я"  # Latin with its accents, Greek, Cyrillic: no \\w, which is ASCII in a JSON schema
LABEL = rf"[{LETTERS}0-9][{LETTERS}0-9_-]*"
PATTERN_TEXTS = {
    ID: "1 to 64 letters, digits, _ and -, the first a letter or digit",
    LABEL: "letters, digits, _ and -, the first a letter or digit",
    WEB_ADDRESS: "an address that begins with https:// (or http://), or '' for none",
    MAIL_SENDER: "name@host or Name <name@host>, or '' for the first recipient",
    MAIL_ADDRESSES: "name@host, several with commas between, or '' for none",
}
NO_TURNOUT = "There are no turnouts yet: add one with 'turnout add ID LAYOUT'"
VALUE_TYPES = {
    "text": (str,),
    "number": (int, float),
    "integer": (int,),
    "flag": (bool,),
    "name_or_index": (str, int),
}
FLAG_WORDS = {
    word: is_set
    for is_set, words in ((True, "true yes ja oui sí si sì on y j 1"), (False, "false no nein nee nej non off n 0"))
    for word in words.split()
}
TYPE_TEXTS = {"text": "text", "number": "a number", "integer": "a whole number", "flag": "true or false"}


@dataclass(frozen=True)
class Key:
    """One value: its ``value_type`` (``many``: a list of these), unit, limits and meaning."""

    value_type: str
    meaning: str
    unit: str = ""
    required: bool = False
    minimum: float | None = None
    maximum: float | None = None
    above: float | None = None
    choices: tuple = ()
    pattern: str = ""
    many: bool = False
    nullable: bool = False
    default: Any = None  # of any of the types in TYPE_NAMES, or a tuple of them


@dataclass(frozen=True)
class NamedEntries:
    """A mapping with free names that match ``pattern`` and with values that all follow ``spec``."""

    spec: dict
    pattern: str
    meaning: str
    required: bool = False


@dataclass(frozen=True)
class Group:
    """A mapping with fixed names; in a ``fragment`` no name is required."""

    spec: dict
    meaning: str
    required: bool = False
    fragment: bool = False


@dataclass(frozen=True)
class FleetWideKey:
    """A name that is allowed only in ``file``, because it holds for the whole fleet."""

    file: str
    required: bool = False


Rule = Key | NamedEntries | Group | FleetWideKey


MAX_PLACES = 3  # of a misplaced key that a message names
MISSPELT = 0.8  # likeness from which an unknown key is taken for a misspelt one, not for one of another place
# Keys that were renamed, with their present name.
FORMER_KEYS = {"softest_blow": "minimum_peak_force", "weakest_blow": "minimum_peak_share"}


def _remedy_of_unknown_key(name: str, allowed: Collection[str], root: Mapping[str, Rule]) -> str:
    """The present name of a renamed key, the place of one that belongs elsewhere, else the most similar name."""
    present = FORMER_KEYS.get(name, "")
    if present in allowed:
        return f"It is called {present!r} now"
    places = list(_places_of(name, root))
    if places and not get_close_matches(_letters(name), map(_letters, allowed), cutoff=MISSPELT):
        return f"It belongs below {' or '.join(map(repr, places[:MAX_PLACES]))}: move it there"
    return suggestion(name, allowed)


def _places_of(name: str, spec: Mapping[str, Rule], path: str = "") -> Iterator[str]:
    """Where a schema has a name: the names above it, with points between them."""
    for above, rule in spec.items():
        below = f"{path}{above}"
        if isinstance(rule, Group | NamedEntries):
            inner = below if isinstance(rule, Group) else f"{below}.NAME"
            if name in rule.spec and not isinstance(rule.spec[name], FleetWideKey):
                yield inner
            yield from _places_of(name, rule.spec, f"{inner}.")


def suggestion(name: str, allowed: Iterable[Any], none: str = "There is none to choose from") -> str:
    """Remedy for an unknown name.

    Parameters
    ----------
    name : str
        The name as it was written.
    allowed : iterable of any
        The names that may be written.
    none : str
        Remedy if nothing is allowed.

    Returns
    -------
    str
        The most similar name if there is one, and the allowed names.

    Examples
    --------
    >>> suggestion("posiiton", ["position", "panel"])
    "Did you mean 'position'? Allowed: panel, position"
    >>> suggestion("cp", ["CLP", "CP"])
    "Did you mean 'CP'? Allowed: CLP, CP"
    """
    allowed = sorted(map(str, allowed))
    if not allowed:
        return none
    by_letters = {_letters(allowed_name): allowed_name for allowed_name in allowed}
    close = [by_letters[letters] for letters in get_close_matches(_letters(name), by_letters, n=1, cutoff=0.6)]
    listed = ", ".join(allowed) if len(allowed) <= 24 else f"{len(allowed)} names, as in docs/settings.md"
    return (f"Did you mean {close[0]!r}? " if close else "") + f"Allowed: {listed}"


def _letters(name: str) -> str:
    """A name without what is easily written otherwise: capitals, and a dash or a blank for an underscore."""
    return name.casefold().replace("-", "_").replace(" ", "_")


def quotation(value: Any) -> str:
    """A wrong value as a message quotes it, cut where it is long.

    Parameters
    ----------
    value : any
        The value as it was written.

    Returns
    -------
    str
        Its text.

    Examples
    --------
    >>> quotation("20 kHz"), quotation(10**400)[-5:]
    ("'20 kHz'", '0 ...')
    """
    text = repr(value)
    if value is None:
        text = "empty"
    elif isinstance(value, tuple):
        text = f"[{', '.join(map(repr, value))}]"
    elif isinstance(value, bool):
        text = str(value).lower()
    return text if len(text) <= MAX_QUOTED else text[:MAX_QUOTED] + " ..."


def value_problem(key: Key, value: Any) -> tuple[str, str] | None:
    """Compare a value with its key.

    Parameters
    ----------
    key : Key
        Type, limits and choices.
    value : any
        The value as it was written; a list as a tuple.

    Returns
    -------
    tuple of (str, str) or None
        Problem and remedy; None if the value fits.

    Examples
    --------
    >>> value_problem(Key("number", "rate", unit="Hz", above=0), -1)
    ('-1', 'Write a number above 0 Hz')
    >>> value_problem(Key("number", "position", unit="m", minimum=-10000, maximum=10000), 24600)
    ('24600', 'Write a number from -10000 to 10000 m (24600 mm are 24.6 m)')
    >>> value_problem(Key("number", "position", unit="m"), "24,6")
    ("'24,6'", 'Write a number in m, with a decimal point: 24.6')
    """
    if value is None and key.nullable:
        return None
    if key.many:
        if not isinstance(value, tuple):
            return quotation(value), "Write a list, [a, b]"
        single = Key(**{**key.__dict__, "many": False})
        return next((p for v in value if (p := value_problem(single, v))), None)
    if not isinstance(value, VALUE_TYPES[key.value_type]) or (isinstance(value, bool) and key.value_type != "flag"):
        hint = ""
        if key.value_type in ("number", "integer") and isinstance(value, str):
            hint = decimal_point_hint(value) or hint_without_unit(key, value)
        return quotation(value), f"Write {_expected_text(key)}{hint}"
    if isinstance(value, (int, float)) and not abs(value) < LARGEST_NUMBER:  # nan and inf, too
        return quotation(value), f"Write {_expected_text(key)}"
    if isinstance(value, str) and CONTROL_CHARACTER.search(value):
        return quotation(value), "Write it without control characters"
    if key.choices and value not in key.choices:
        return quotation(value), suggestion(str(value), key.choices)
    if key.pattern and isinstance(value, str) and not re.fullmatch(key.pattern, value):
        return quotation(value), f"Write {_expected_text(key)}"
    if not isinstance(value, (int, float)):
        return None
    if is_in_range(key, value):
        return None
    return quotation(value), f"Write {_expected_text(key)}{hint_at_other_unit(key, value)}"


CONTROL_CHARACTER = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")  # of no text; pages and tables cannot show it
LARGEST_NUMBER = 1e300  # beyond it a whole number is no floating-point number
MAX_QUOTED = 60  # characters of a wrong value that a message quotes


def typed_value(key: Key, leaf: Leaf) -> Any:
    """The value of a leaf in the type of its key, where the text that is written has one meaning there.

    Parameters
    ----------
    key : Key
        Type of the value.
    leaf : Leaf
        The value as YAML reads it, with its text.

    Returns
    -------
    any
        True or False for a word that means it, a number for a number in quotes, a whole number for 10.0, the text for a
        number where text is wanted; the text
        also of a number in another notation than the decimal one, which ``value_problem`` then reports; else the value
        unchanged.

    Examples
    --------
    >>> from turnout.config.document import Place
    >>> typed_value(Key("number", "rate"), Leaf("2e4", Place("a.yaml"), "2e4"))
    20000.0
    >>> typed_value(Key("text", "serial number"), Leaf(7, Place("a.yaml"), "007"))
    '007'
    >>> typed_value(Key("flag", "use it"), Leaf("Ja", Place("a.yaml"), "Ja"))
    True
    """
    value = leaf.value
    if key.value_type == "flag":
        return FLAG_WORDS.get(leaf.text.strip().casefold(), value)
    if key.many or isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return value
    if key.value_type == "text":
        return value if isinstance(value, str) else leaf.text
    if key.value_type not in ("number", "integer") or not leaf.text:
        return value
    try:
        number = decimal_number(leaf.text)
    except ValueError:
        return leaf.text if isinstance(value, int) else value
    if key.value_type == "integer" and number.is_integer():
        return value if isinstance(value, int) else int(number)
    return number if isinstance(value, str) else value


def fit_to_schema(spec: dict, tree: Branch) -> None:
    """Give the values of a tree the types of their keys, and each name without anything below it an empty mapping.

    The mapping is given where the schema has names below that name: a section of config.yaml counts as empty when all
    of its lines are comments.

    Parameters
    ----------
    spec : dict
        Name -> Key, Group, NamedEntries or FleetWideKey.
    tree : Branch
        Tree of a file; it is changed.
    """
    for name, rule in spec.items():
        if isinstance(rule, Key) and isinstance(leaf := tree.get(name), Leaf):
            tree[name] = replace(leaf, value=typed_value(rule, leaf))
        if name in tree and isinstance(rule, Group | NamedEntries):
            branch = _mapping_below(tree, name)
            if branch is None:
                continue
            if isinstance(rule, Group):
                fit_to_schema(rule.spec, branch)
                continue
            for label in branch:
                if (entry := _mapping_below(branch, label)) is not None:
                    fit_to_schema(rule.spec, entry)


def _mapping_below(tree: Branch, name: str) -> Branch | None:
    """The mapping below a name, a new one if nothing is there; None if a value is."""
    value = tree[name]
    if isinstance(value, Leaf) and value.value is None:
        tree[name] = Branch(tree.place_of(name))
    return tree[name] if isinstance(tree[name], Branch) else None


def check(
    spec: dict, tree: Branch, whole: bool = True, root: Mapping[str, Rule] | None = None
) -> Iterator[ConfigError]:
    """Compare a tree with its schema.

    Parameters
    ----------
    spec : dict
        Name -> Key, Group, NamedEntries or FleetWideKey.
    tree : Branch
        Tree of a file, or of merged files.
    whole : bool
        Whether required names must be there.
    root : mapping of str to Rule, optional
        Schema of the whole file, in which a misplaced name is searched; by default ``spec``.

    Yields
    ------
    ConfigError
        Every error, at the name or value to correct.
    """
    misspelt: set[str] = set()
    root = spec if root is None else root
    for name, value in tree.items():
        rule = spec.get(name)
        if rule is None:
            present = FORMER_KEYS.get(name, "")
            misspelt.update([present] if present in spec else get_close_matches(name, spec, n=1))
            allowed = [allowed_name for allowed_name, rule in spec.items() if not isinstance(rule, FleetWideKey)]
            remedy = DECIMAL_POINT if name.isdecimal() else _remedy_of_unknown_key(name, allowed, root)
            yield tree.key_places[name].error(f"unknown key {name!r}", remedy)
        elif isinstance(rule, FleetWideKey):
            message = f"{name!r} holds for the whole fleet and would be ignored here"
            yield tree.key_places[name].error(message, f"It belongs into {rule.file}: move it there")
        elif isinstance(rule, Key):
            if isinstance(value, Branch):
                yield value.place.error(f"names under {name!r}", f"Write {_expected_text(rule)}")
            elif problem := value_problem(rule, value.value):
                yield value.place.error(f"{name} is {problem[0]}", problem[1])
        elif isinstance(value, Leaf):
            yield value.place.error(f"{name} is {quotation(value.value)}", "Write 'name: value' lines below it")
        elif isinstance(rule, Group):
            yield from check(rule.spec, value, whole and not rule.fragment, root)
        else:
            yield from _check_each(rule, name, value, whole, root)
    if whole:
        for name, rule in spec.items():
            if rule.required and name not in tree and name not in misspelt:
                yield tree.place.error(f"{name!r} is missing", f"Add '{name}:', {rule.meaning}")


def _check_each(
    rule: NamedEntries, name: str, tree: Branch, whole: bool, root: Mapping[str, Rule]
) -> Iterator[ConfigError]:
    for label, value in tree.items():
        if not re.fullmatch(rule.pattern, label):
            remedy = f"Write a name of {PATTERN_TEXTS[rule.pattern]}"
            yield tree.key_places[label].error(f"{label!r} under {name!r}", remedy)
        elif isinstance(value, Leaf):
            yield value.place.error(f"{label} is {quotation(value.value)}", "Write 'name: value' lines below it")
        else:
            yield from check(rule.spec, value, whole, root)
    if whole and not tree:
        yield tree.place.error(f"{name!r} is empty", f"Add at least one, {rule.meaning}")


def _expected_text(key: Key) -> str:
    if key.choices:
        return "one of " + ", ".join(map(str, key.choices))
    if key.pattern:
        return PATTERN_TEXTS[key.pattern]
    text = TYPE_TEXTS.get(key.value_type, "a name, or a number counted from 0")
    unit = f" {key.unit}" if key.unit not in ("", None, "-", "1") else ""
    if key.above is not None:
        text += f" above {number_text(key.above)}{unit}"
    elif key.minimum is not None and key.maximum is not None:
        text += f" from {number_text(key.minimum)} to {number_text(key.maximum)}{unit}"
    elif key.minimum is not None:
        text += f" of at least {number_text(key.minimum)}{unit}"
    elif key.maximum is not None:
        text += f" of at most {number_text(key.maximum)}{unit}"
    elif unit:
        text += f" in{unit}"
    return text
