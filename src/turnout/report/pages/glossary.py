"""Render the glossary: the terms of docs/glossary.md as a page that every other page links to."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout.installation import shipped_path

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from jinja2 import Template

HEADING, DIVIDER = "| term |", "|---"


def glossary_page(template: Template, shared: Mapping[str, Any]) -> str:
    """HTML of the glossary.

    Parameters
    ----------
    template : Template
        Compiled page.
    shared : mapping
        Variables that every page shows.

    Returns
    -------
    str
        HTML.

    Raises
    ------
    OSError
        If docs/glossary.md did not come with the program.
    """
    return template.render(groups=glossary(shipped_path("docs/glossary.md").read_text(encoding="utf-8")), **shared)


def glossary(text: str) -> list[tuple[str, list[tuple[str, str]]]]:
    """Terms and their meanings, by heading.

    Parameters
    ----------
    text : str
        Markdown with a table ``| term | meaning | not |`` below each heading of the second level.

    Returns
    -------
    list of (str, list of (str, str))
        Heading, and pairs of term and meaning.

    Examples
    --------
    >>> glossary("## Track\\n| term | meaning | not |\\n|---|---|---|\\n| nose | Point of the crossing. | frog |")
    [('Track', [('nose', 'Point of the crossing.')])]
    """
    groups: list[tuple[str, list[tuple[str, str]]]] = []
    for line in text.splitlines():
        if line.startswith("## "):
            groups.append((line[3:].strip(), []))
        elif line.startswith("|") and not line.startswith((HEADING, DIVIDER)):
            term, meaning = (cell.strip().replace("`", "") for cell in line.split("|")[1:3])
            groups[-1][1].append((term, meaning))
    return groups
