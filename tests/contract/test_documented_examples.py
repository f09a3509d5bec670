"""The examples in pages and help texts work: every block of code, every command, every query.

A block that cannot run has the reason in a comment before it: ``<!-- not run: reason -->``. A YAML block states its
file: ``<!-- file: config/config.yaml -->``. A block that another test runs states this test:
``<!-- run by: tests/... -->``.
"""

import argparse
import ast
import doctest
import importlib.util
import inspect
import json
import re
import shlex
import shutil
import tomllib

import jsonschema
import pytest
from benchmarks.trend_fleet import Fleet, modes
from benchmarks.trend_registry import small_registry
from ruamel.yaml import YAML
from snakemake.cli import get_argument_parser
from tests.contract.documented_blocks import PAGES, ROOT, blocks, commands, loose_commands
from tests.unit.stages.small_turnout import TRACK

import turnout
from turnout.api import reference_page
from turnout.cli.main import build_parser
from turnout.config.settings.trend import TrendSettings
from turnout.registry.database import open_registry
from turnout.simulate import load_track
from turnout.trend.update import update

HELP = sorted((ROOT / "src" / "turnout" / "cli").glob("*.py"))
QUERY = re.compile(r'(?:turnout query|-c) "((?:from|select) [^"]*)"')
INLINE_QUERY = re.compile(r"`((?:from|select) (?!turnout\.)[^`]*)`")
VIEWS = re.compile(r"\bviews? (`\w+`(?:(?:,| and) `\w+`)*)")
NUMBER = re.compile(r"\d+(?:\.\d+)?")
NO_CODE = ("text", "mermaid")  # outputs, tables, drawings
NOT_RUN = 2  # blocks that cannot run; a new one needs an equally good reason
BLOCKS = blocks()
RUN = [block for block in BLOCKS if block.key not in ("not run", "run by")]


def of(*languages):
    return pytest.mark.parametrize("block", [b for b in RUN if b.language in languages], ids=str)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A project with the configuration, the recording of the example and a registry of two turnouts."""
    root = tmp_path_factory.mktemp("documented")
    shutil.copytree(ROOT / "config", root / "config")
    (root / "config" / "tracks" / "small.yaml").write_text(TRACK)
    reference_page.write_example_file(root / "OT_1.uff")
    small_registry(root / "results" / "registry", modes(Fleet(turnouts=2, weeks=70), 1))
    update(root / "results" / "registry", TrendSettings())
    return root


@pytest.fixture(scope="module")
def registry(folder):
    with open_registry(folder / "results" / "registry") as connection:
        yield connection


def test_every_block_has_a_known_language():
    known = {"python", "sql", "yaml", "csv", "sh", "console", *NO_CODE}
    assert not [str(block) for block in BLOCKS if block.language not in known]
    n_fences = sum(len(re.findall(r"^```", page.read_text(encoding="utf-8"), re.M)) for page in PAGES)
    assert n_fences == 2 * len(BLOCKS), "the collector misses a fence"
    assert not [str(b) for b in RUN if (b.language == "yaml") != (b.key == "file")], "a YAML block names its file"
    for block in (b for b in BLOCKS if b.key == "run by"):
        assert f"docs/{block.page.name}" in (ROOT / block.value).read_text(encoding="utf-8"), block
    assert not [str(b) for b in RUN if b.language == "csv"], "no test reads it"


def test_blocks_that_are_not_run_are_few():
    assert [str(block) for block in BLOCKS if block.key == "not run"][NOT_RUN:] == []
    assert len([block for block in RUN if block.language not in NO_CODE]) > 60


@of("python")
def test_generated_python_is_up_to_date(block):
    """docs/api.md is generated from the docstrings: its examples are doctests, its headings are signatures."""
    if block.body.startswith(">>> "):
        documented = [inspect.getdoc(getattr(turnout, name)) for name in turnout.__all__]
        assert any(block.body.rstrip() in text for text in documented), "no doctest of the package"
    elif block.body.startswith("turnout."):
        (function,) = ast.parse(f"def {block.body.strip().removeprefix('turnout.')}: pass").body
        named = function.args.args + function.args.kwonlyargs
        assert [a.arg for a in named] == list(inspect.signature(getattr(turnout, function.name)).parameters)


@pytest.mark.parametrize("page", sorted({b.page for b in RUN if b.language == "python"}), ids=lambda p: p.name)
def test_python_blocks_print_the_shown_text(page, folder, monkeypatch, capsys):
    """The blocks of a page run in order with common names, and print the text that follows them."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names: dict = {}
    of_page = [block for block in BLOCKS if block.page == page]
    for block, after in zip(of_page, [*of_page[1:], None]):
        if block in RUN and block.language == "python" and not block.body.startswith((">>> ", "turnout.")):
            capsys.readouterr()
            exec(compile(block.body, str(block), "exec"), names)
            if printed := capsys.readouterr().out:
                assert after is not None and after.language == "text" and after.body == printed, block
            if after is not None and after.language == "text" and after.body.startswith(">>> "):
                for example in doctest.DocTestParser().get_examples(after.body):
                    shown = repr(eval(example.source, names)) + "\n"  # digits may differ on another processor
                    assert NUMBER.sub("#", shown) == NUMBER.sub("#", example.want), block


@of("sql")
def test_sql_blocks_run(block, registry):
    for query in re.sub(r"--.*", "", block.body).split(";"):
        if query.strip():
            registry.execute(query).fetchall()


@of("yaml")
def test_yaml_blocks_are_valid(block, folder):
    file = folder / block.value
    kind = file.parent.name
    if kind == "tracks":
        file.write_text(block.body, encoding="utf-8")
        assert load_track(file.stem, folder=file.parent).name in (file.stem, "small")  # or the file that it extends
        return
    schema = {"config": "config", "layouts": "layout", "overrides": "override"}[kind]
    text = json.loads((ROOT / "config" / "schema" / f"{schema}.json").read_text(encoding="utf-8"))
    text.pop("required", None)  # the block is a part of the file
    jsonschema.Draft202012Validator(text).validate(YAML(typ="safe").load(block.body))


def check_command(words):
    """Check that the command exists and accepts its options, without running it."""
    program, *rest = words
    if program.split("/")[-1] == "turnout":
        build_parser().parse_args(rest)
    elif program in ("python", "python3"):
        assert rest[0] == "-m" and importlib.util.find_spec(rest[1]), words
        if rest[1] == "benchmarks":
            assert all(importlib.util.find_spec(f"benchmarks.bench_{part}") for part in rest[2:] if part[0] != "-")
    elif program == "make":
        targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
        assert rest[0] in targets, words
    elif program == "pip":
        project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        named = set(re.findall(r"\[(\w+)\]", " ".join(rest)))
        assert rest[0] == "install" and named <= set(project["optional-dependencies"]), words
    elif program == "snakemake":
        get_argument_parser().parse_args(rest)
    else:
        assert program in ("cd", "mkdir", "source", "duckdb"), words  # the query of duckdb runs with all other queries


@of("sh", "console")
def test_the_commands_of_blocks_exist(block):
    assert commands(block), "a block without a command"
    for words in commands(block):
        check_command(words)


def unknown_words(words):
    """Command or options in a text that the program does not have; required arguments may be left out."""
    parser, wrong = build_parser(), []
    for n, word in enumerate(words):
        groups = [a.choices for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
        if word == "--":
            break
        if word.startswith("-"):
            wrong += [] if word.split("=")[0] in parser._option_string_actions else [word]
        elif groups and word in groups[0]:
            parser = groups[0][word]
        elif n == 0 and not word.isupper():  # a word in capitals stands for any command
            wrong.append(word)
    return wrong


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_the_commands_in_texts_exist(page):
    assert not [(words, wrong) for words in loose_commands(page) if (wrong := unknown_words(words))]


@pytest.mark.parametrize("page", [*PAGES, *HELP], ids=lambda p: p.name)
def test_the_queries_in_texts_can_be_bound(page, registry):
    text = page.read_text(encoding="utf-8")
    for query in QUERY.findall(text) + INLINE_QUERY.findall(text):
        registry.execute(f"explain {query}")  # explain binds every table, column and macro


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_the_views_in_texts_need_no_arguments(page, registry):
    """A macro with arguments is called a macro and written with its parentheses."""
    for views in VIEWS.findall(page.read_text(encoding="utf-8")):
        for name in re.findall(r"`(\w+)`", views):
            registry.execute(f"explain from {name}")


@pytest.mark.parametrize("module", HELP, ids=lambda p: p.stem)
def test_the_commands_of_the_help_exist(module):
    text = module.read_text(encoding="utf-8").split('"""')[1]
    typed = re.findall(r"^ *(?:\$ )?turnout (\S.*)$", text.replace("\\\n", " "), re.MULTILINE)
    for line in typed:
        check_command(["turnout", *shlex.split(re.split(r"\s{3,}(?![-\s])|\s+[#>]", line)[0])])


def test_the_texts_contain_queries_and_commands():
    text_of_pages = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert len(QUERY.findall(text_of_pages) + INLINE_QUERY.findall(text_of_pages)) > 30
    assert sum(len(loose_commands(page)) for page in PAGES) > 30
