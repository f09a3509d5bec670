"""Names use terms of the field, checked with the syntax trees of every module of the two packages."""

import ast
import re
from functools import cache

import pytest
from syntax_trees import tree_of

# Words that do not describe the content of a variable. Stored names (assigned names and parameters) are counted.
EMPTY = frozenset(
    """asked begun best both done found given heard held kept kind known left made mine noted other others own part
    parts rest said seen shown stuff taken thing things told way ways""".split()
)
MAX_EMPTY_SHARE = 0.005  # of all stored names

PRIVATE = frozenset({"said", "told", "heard", "asked", "mine"})  # in tests, which are not counted

# Past participles that do not end in "ed"; former versions used them as names of functions and modules.
IRREGULAR = frozenset(
    """begun bent borne bound broken brought built chosen cut drawn driven fallen felt found given gone heard held
    hidden hung kept known laid led left lost made meant met paid put read said seen sent set shown shut sought
    spent split spun struck stuck sunk swept taken taught thought thrown told torn understood won worn
    written""".split()
)
NOT_PARTICIPLES = frozenset({"seed", "speed", "feed", "need", "embed", "exceed", "read", "set", "put", "split", "cut"})
NO_NOUNS = frozenset(
    """above absorbed accept across add afresh again against alone aloud anew apart aside away before behind below
    beside between beyond by calibrate compare compute distinguish far frozen heard identify legible make moved near
    often only prepare quiet register settled stored together unlike unused visible why write""".split()
)
# Words of the private dialect of former versions, and the term of docs/glossary.md that replaces each.
DIALECT = {
    "bang": "impact",
    "banged": "with an impact",
    "banging": "impact",
    "bangs": "impacts",
    "blame": "name",
    "blamed": "named",
    "blames": "names",
    "blow": "impact",
    "blows": "impacts",
    "ceiling": "limit",
    "ceilings": "limits",
    "cheap": "small or hammer",
    "claims": "declared sizes",
    "cheapest": "of least effort",
    "expensive": "large",
    "foretell": "predict",
    "foretells": "predicts",
    "foretold": "predicted",
    "hears": "shows",
    "mended": "fixed",
    "polish": "fit to convergence",
    "polished": "converged",
    "refusal": "rejection",
    "refusals": "rejections",
    "refuse": "reject",
    "refused": "rejected",
    "refuses": "rejects",
    "strike": "impact",
    "strikes": "impacts",
    "struck": "position of an impact",
    "unforetold": "unpredicted",
    "vouch": "confirm",
    "whereabouts": "localization",
    "witness": "source",
    "witnesses": "sources",
}

# At most 20 names may violate a rule, each with its reason.
EXCEPTIONS: dict[str, str] = {
    "identify": "a section of config.yaml, and the module of its settings",
    "n_blows": "the former keyword of simulate_hammer, accepted for one release",
}


def modules(repository):
    for package in ("turnout", "turnout_blind"):
        for path in sorted((repository / "src" / package).rglob("*.py")):
            yield path.relative_to(repository / "src"), tree_of(path)


def stored_names(tree):
    """(line, name) of every assigned name and parameter."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.id
        elif isinstance(node, ast.arg):
            yield node.lineno, node.arg


def test_names_in_tests_and_benchmarks_describe_their_content(repository):
    """Parameters and variables, where the reader of a failing test sees them."""
    paths = [
        p for folder in ("tests", "benchmarks", "examples", "scripts") for p in (repository / folder).rglob("*.py")
    ]
    wrong = [f"{p}:{n} {name}" for p in paths for n, name in stored_names(tree_of(p)) if name in PRIVATE]
    assert not wrong, "\n".join(wrong)


def is_property(node):
    """Whether a method is used like an attribute, as ``impact.accepted``: its name need not be a verb."""
    names = {getattr(d, "id", getattr(d, "attr", "")) for d in node.decorator_list}
    return bool(names & {"property", "cached_property"})


def functions(tree):
    """(line, name) of every function and method, properties excluded."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and not is_property(node):
            yield node.lineno, node.name


def is_bare_participle(name):
    """Whether the name of a function is a single past participle, which hides whether it tests, changes or searches.

    >>> [is_bare_participle(name) for name in ("scored", "_heard", "with_errors", "speed", "score_candidates")]
    [True, True, False, False, False]"""
    word = name.strip("_").lower()
    if "_" in word or word in NOT_PARTICIPLES:
        return False
    return word.endswith("ed") or word in IRREGULAR


def is_no_noun(module):
    """Whether the name of a module is a participle, an adverb, a preposition or a verb.

    >>> [is_no_noun(name) for name in ("anew", "judged", "receptance_model", "wheel_flats")]
    [True, True, False, False]
    """
    return is_bare_participle(module) or module in NO_NOUNS


def test_few_stored_names_do_not_describe_their_content(repository):
    total, empty = 0, []
    for path, tree in modules(repository):
        for line, name in stored_names(tree):
            total += 1
            if name in EMPTY:
                empty.append(f"src/{path}:{line} {name}")
    assert len(empty) < MAX_EMPTY_SHARE * total, f"{len(empty)} of {total} stored names:\n" + "\n".join(empty)


def test_the_name_of_no_function_is_a_single_participle(repository):
    wrong = [
        f"src/{path}:{line} {name}"
        for path, tree in modules(repository)
        for line, name in functions(tree)
        if is_bare_participle(name) and name not in EXCEPTIONS
    ]
    assert not wrong, "\n".join(wrong)


def test_the_name_of_every_module_is_a_noun(repository):
    """Commands and the stages that they start are verbs of the command line, which are not tested."""
    wrong = [
        f"src/{path}"
        for path, _ in modules(repository)
        if path.parts[1:2] not in (("cli",), ("stages",))
        and path.parts[0] != "turnout_blind"
        and is_no_noun(path.stem)
        and path.stem not in EXCEPTIONS
    ]
    assert not wrong, "\n".join(wrong)


def scripts(repository):
    """(path, tree) of every module of the packages, the tests, the benchmarks and the examples."""
    for folder in ("src", "tests", "benchmarks", "examples"):
        for path in sorted((repository / folder).rglob("*.py")):
            yield path.relative_to(repository).as_posix(), tree_of(path)


@cache
def names(repository):
    """Name -> its first place, of all modules, variables, functions, classes and arguments."""
    table = {}
    for path, tree in scripts(repository):
        table.setdefault(path.rsplit("/", 1)[-1].removesuffix(".py"), path)
        for node in ast.walk(tree):
            name = getattr(node, "id", None) or getattr(node, "name", None) or getattr(node, "arg", None)
            if isinstance(name, str):
                table.setdefault(name, f"{path}:{getattr(node, 'lineno', 0)}")
    return table


@pytest.mark.parametrize("word", sorted(DIALECT))
def test_no_name_uses_a_word_of_the_dialect(repository, word):
    pattern = re.compile(rf"(?:^|_){word}(?:_|$)", re.IGNORECASE)
    wrong = [
        f"{place} {name}: say {DIALECT[word]!r}"
        for name, place in names(repository).items()
        if pattern.search(name) and name not in EXCEPTIONS
    ]
    assert not wrong, "\n".join(sorted(wrong))


def test_there_are_at_most_20_exceptions():
    assert len(EXCEPTIONS) <= 20
    assert all(EXCEPTIONS.values())


def test_the_rules_find_forbidden_names():
    tree = ast.parse("def judged(found):\n    made = 1\n    return made")
    assert [name for _, name in stored_names(tree)] == ["found", "made"]
    assert [name for _, name in functions(tree) if is_bare_participle(name)] == ["judged"]
