"""README, documents, pages and messages use the terms of the glossary and none of the words that it replaces."""

import ast
import re

import pytest
from syntax_trees import tree_of

from turnout.config.settings.identify import IdentifySettings
from turnout.config.settings.trend import TrendSettings

# Words of the last column of docs/glossary.md that may be used with another meaning.
OTHER_MEANINGS = {
    "chain": "the Markov chain of a chart",
    "family": "a family of processors",
    "floor": "the noise floor of a channel",
    "FRF": "frequency responses of other kinds",
    "gain": "the gain of a sensor or of stiffness",
    "hit": "a name of variables in files of others",
    "law": "a force law",
    "location": "a parameter of the public function simulate_hammer",
    "place": "to take place; a column of the quarantine table",
    "points": "points of fit, percent",
    "sound": "the sound level of a passage",
    "twin": "the same case without its effect",
    "what is left": "the remainder of a division",
    "where receptance is meant": "a remark",
}


def replaced_words(repository):
    """Words that the glossary replaces by its terms."""
    for line in (repository / "docs" / "glossary.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("|") and not line.startswith(("| term", "|---")):
            cell = re.sub(r"\([^)]*\)", "", line.strip().strip("|").split("|")[-1])
            yield from (word.strip() for word in cell.split(",") if word.strip())


def messages(path):
    """Text constants of a module with a space in them, docstrings excluded, and the labels of printed lines."""
    tree = tree_of(path)
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "_line" and node.args:
            yield from (str(x.value) for x in ast.walk(node.args[0]) if isinstance(x, ast.Constant))
    docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and " " in node.value
            and id(node) not in docs
        ):
            yield node.value


def texts(repository):
    """(place, text) of README, documents, pages, views, settings and messages. Decision pages may use former words."""
    package, docs = repository / "src" / "turnout", repository / "docs"
    pages = (package / "report" / "templates").glob("*.html")
    registry = [package / "registry" / "columns.csv", *(package / "registry" / "views").glob("*.sql")]
    settings = (repository / "config").rglob("*.yaml")
    for path in [repository / "README.md", *docs.glob("*.md"), *pages, *registry, *settings]:
        if path.name != "glossary.md":
            yield path.name, path.read_text(encoding="utf-8")
    for path in sorted((repository / "src" / "turnout").rglob("*.py")):
        yield str(path.relative_to(repository)), "\n".join(messages(path))


def uses(words, places):
    """Every use of one of the words: (place, word, text around it)."""
    pattern = re.compile(r"\b(" + "|".join(map(re.escape, words)) + r")(?:s|ed)?\b", re.IGNORECASE)
    return [
        (place, match[0], text[max(0, match.start() - 40) : match.end() + 40])
        for place, text in places
        for match in pattern.finditer(text)
    ]


def test_replaced_words_are_not_used(repository):
    words = set(replaced_words(repository)) - set(OTHER_MEANINGS)
    assert {"blow", "foretell", "whereabouts", "refused"} <= words
    # Options and names of former versions work for one release; they are in code marks or are options.
    places = [(p, re.sub(r"`[^`]*`|--\w+", "", text)) for p, text in texts(repository)]
    assert not (wrong := uses(words, places)), "\n".join(map(str, wrong))


@pytest.mark.parametrize("text", ["A blow of 3 kN", "it Foretells more", "three blows"])
def test_the_use_of_a_replaced_word_is_found(text):
    assert uses(["blow", "foretell"], [("page", text)])


def test_the_glossary_and_the_readme_state_the_ranges_in_which_resonances_are_sought(repository):
    settings = IdentifySettings()
    ranges = {
        "ballast": f"sought in {settings.ballast_low:g} to {settings.ballast_high:g} Hz",
        "railpad": f"sought in {settings.railpad_low:g} to {settings.railpad_high:g} Hz",
    }
    glossary = (repository / "docs" / "glossary.md").read_text(encoding="utf-8")
    readme = (repository / "README.md").read_text(encoding="utf-8")
    for name, text in ranges.items():
        (row,) = [line for line in glossary.splitlines() if line.startswith(f"| {name} resonance |")]
        assert (
            text in row and f"{name} (usually" in readme and text in readme.split(f"{name} (usually")[1].split(")")[0]
        )


def test_the_limit_of_a_clear_effect_is_that_of_its_share_of_the_response(repository):
    glossary = (repository / "docs" / "glossary.md").read_text(encoding="utf-8")
    assert "sqrt(46² + v²) - 46" in glossary
    points, share = re.search(r"visibility is above (\d+) points, that is v above (\d+) %", glossary).groups()
    assert round((46.0**2 + float(share) ** 2) ** 0.5 - 46.0) == int(points)
    assert f"more than {share} % of the response" in (repository / "README.md").read_text(encoding="utf-8")


def test_a_campaign_lasts_as_long_as_the_setting_says(repository):
    hours = f"within {TrendSettings().campaign_gap_hours:g} hours of the first"
    for page in ("glossary.md", "tutorial.md"):
        assert hours in (repository / "docs" / page).read_text(encoding="utf-8")
