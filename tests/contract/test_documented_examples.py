"""What the pages and the help tell people to type: queries that the registry understands, commands that exist."""

import re
import shlex
from pathlib import Path

import pytest

from turnout.cli.main import build_parser
from turnout.registry.database import open_registry
from turnout.registry.job import register

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
HELP = sorted((ROOT / "src" / "turnout" / "cli").glob("*.py"))
FENCED = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
QUERY = re.compile(r'(?:turnout query|-c) "((?:from|select) [^"]*)"')
INLINE = re.compile(r"`((?:from|select) (?!turnout\.)[^`]*)`")
TYPED = re.compile(r"^ *(?:\$ )?turnout (\S.*)$", re.MULTILINE)


def queries(text):
    """SQL of fenced blocks, of `turnout query "..."` and of code within a line."""
    blocks = [re.sub(r"--.*", "", body) for kind, body in FENCED.findall(text) if kind == "sql"]
    return [q for block in blocks for q in block.split(";") if q.strip()] + QUERY.findall(text) + INLINE.findall(text)


def commands(text):
    """Words behind ``turnout`` of every whole command: no comment or explanation behind it."""
    lines = (re.split(r"\s{3,}(?![-\s])|\s+[#>]", line)[0] for line in TYPED.findall(text.replace("\\\n", " ")))
    return [shlex.split(line) for line in lines]


@pytest.fixture(scope="module")
def empty(tmp_path_factory):
    root = tmp_path_factory.mktemp("documented") / "registry"
    register([], root, read=iter)
    with open_registry(root) as connection:
        yield connection


@pytest.mark.parametrize("page", [*PAGES, *HELP], ids=lambda p: p.name)
def test_every_query_that_is_shown_is_one_the_registry_understands(page, empty):
    for query in queries(page.read_text(encoding="utf-8")):
        empty.execute(f"explain {query}")  # binds every table, column and macro


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_command_that_is_shown_is_one_the_program_takes(page):
    for _, body in FENCED.findall(page.read_text(encoding="utf-8")):
        for words in commands(body):
            build_parser().parse_args(words)


@pytest.mark.parametrize("module", HELP, ids=lambda p: p.stem)
def test_every_command_of_the_help_is_one_the_program_takes(module):
    text = module.read_text(encoding="utf-8").split('"""')[1]
    for words in commands(text):
        build_parser().parse_args(words)


def test_the_pages_show_queries_and_commands_at_all():
    shown = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    bodies = [body for _, body in FENCED.findall(shown)]
    assert len(queries(shown)) > 40 and sum(len(commands(body)) for body in bodies) > 30
