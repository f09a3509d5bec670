"""The documentation site builds without a warning, loads nothing from other servers, and lists every command."""

import os
import re
import subprocess
import sys
from importlib import import_module

import pytest

from turnout.cli import COMMANDS
from turnout.cli.main import EXIT_CODES


def test_the_page_of_commands_lists_every_command_and_exit_code(repository):
    text = (repository / "docs" / "commands.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| ([^|]+) \| `(\w+)` \| (.+) \|$", text, re.M)
    modules = {name: import_module(f"turnout.cli.{name}") for name in COMMANDS}
    expected = [(module.GROUP, name, module.HELP) for name, module in modules.items()]
    assert listed == expected, "one row per command in docs/commands.md, with its group and HELP"
    codes = re.findall(r"^  (\d+) ", EXIT_CODES, re.M)
    assert re.findall(r"^\| (\d+) \|", text, re.M) == codes


@pytest.fixture(scope="module")
def site(repository, tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=repository, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_the_search_of_the_site_needs_no_server(site):
    assert (site / "search" / "search_index.json").stat().st_size > 100_000
    # a page that is opened from a folder can only load scripts; this script replaces the worker of the search
    assert (site / "search" / "search_index.js").read_text("utf-8").startswith("var __index")
    assert "javascripts/iframe-worker.js" in (site / "index.html").read_text("utf-8")
    assert "identify_modes" in (site / "modules.html").read_text(encoding="utf-8")


def test_notebooks_are_pages_of_the_site(site):
    text = (site / "notebooks" / "passages_to_mismatch.html").read_text("utf-8")
    assert "From passages to a named mismatch" in text and "Candidate" in text


def test_no_page_loads_anything_from_another_server(site):
    loaded = re.compile(r"<(?:script|img|link[^>]*rel=.?stylesheet)[^>]*(?:src|href)=.?(https?://[^\s>\"']+)")
    wrong = {(page.name, url) for page in site.rglob("*.html") for url in loaded.findall(page.read_text("utf-8"))}
    assert not wrong
