"""The first sentence of each page of the documentation says what the page is for."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PURPOSE = re.compile(r"This (?:page|notebook) (?:\w+)s\b|This page leads\b")


@pytest.mark.parametrize("page", sorted(p for p in DOCS.glob("*.md") if p.name != "index.md"), ids=lambda p: p.stem)
def test_a_page_begins_with_its_purpose(page):
    """index.md says what the program is for."""
    lines = [line for line in page.read_text(encoding="utf-8").splitlines() if line.strip()]
    first = next(line for line in lines if not line.startswith(("#", "<!--")))
    assert PURPOSE.match(first), first
