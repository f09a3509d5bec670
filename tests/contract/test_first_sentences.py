"""The first sentence of each page of the documentation states its purpose, and its sentences are short."""

import re
from pathlib import Path
from statistics import median

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(DOCS.glob("*.md"))
PURPOSE = re.compile(r"This (?:page|notebook) (?:\w+)s\b|This page leads\b")
MAX_MEDIAN_WORDS = 20
BLOCK = re.compile(r"<!--.*?-->|^```.*?^```$", re.M | re.S)
ITEM = re.compile(r"\s*(?:[-*]|\d+\.)\s+")
END = re.compile(r"(?<=[.!?])[)\"*]*\s+(?=[^a-z])")


def sentences(text):
    """Sentences of paragraphs and lists, without headings, tables, pictures and code blocks.

    Code within a line is one word.
    """
    paragraphs = [[]]
    for line in BLOCK.sub("", text).splitlines():
        if not line.strip() or line.startswith(("#", "|", "!", "    ", "---")):
            paragraphs.append([])
        elif ITEM.match(line):
            paragraphs.append([ITEM.sub("", line, count=1)])
        else:
            paragraphs[-1].append(line.strip())
    joined = (re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", re.sub(r"`[^`]*`", "code", " ".join(p))) for p in paragraphs)
    return [sentence for paragraph in joined for sentence in END.split(paragraph) if sentence.strip()]


def test_the_sentences_of_a_text_are_found():
    text = "# No\n\nOne two. Three (four\nfive)! 6 is `a b c`.\n- An [item](x.md) here.\n\n| no |\n```sh\nno.\n```\n"
    assert sentences(text) == ["One two.", "Three (four five)!", "6 is code.", "An item here."]


@pytest.mark.parametrize("page", [p for p in PAGES if p.name != "index.md"], ids=lambda p: p.stem)
def test_a_page_starts_with_its_purpose(page):
    """index.md states the purpose of the program instead."""
    lines = [line for line in page.read_text(encoding="utf-8").splitlines() if line.strip()]
    first = next(line for line in lines if not line.startswith(("#", "<!--")))
    assert PURPOSE.match(first), first


@pytest.mark.parametrize(
    "page", [DOCS.parent / "README.md", *PAGES, *sorted((DOCS / "decisions").glob("*.md"))], ids=lambda p: p.stem
)
def test_half_of_the_sentences_are_short(page):
    n_words = [len(sentence.split()) for sentence in sentences(page.read_text(encoding="utf-8"))]
    assert median(n_words) <= MAX_MEDIAN_WORDS


def test_every_page_is_in_the_navigation():
    navigation = (DOCS.parent / "mkdocs.yml").read_text(encoding="utf-8").partition("nav:")[2]
    assert not [page.name for page in PAGES if page.name not in navigation]
