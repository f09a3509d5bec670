"""The examples of docs/registry.md print what the page says."""

import re

import pytest

from turnout.cli.query import format_table
from turnout.registry.database import open_registry

EXAMPLE = re.compile(r"```sql\n(.*?)```\n(?:<!-- output -->|```text\n(.*?)```)", re.DOTALL)


@pytest.mark.parametrize("number", range(8))
def test_an_example_prints_what_the_page_says(fleet, repository, number):
    page = (repository / "docs" / "registry.md").read_text(encoding="utf-8")
    sql, said = EXAMPLE.findall(page)[number]
    with open_registry(fleet.registry) as connection:
        assert format_table(connection.sql(sql)) == said.rstrip("\n")


def test_all_examples_are_checked(repository):
    page = (repository / "docs" / "registry.md").read_text(encoding="utf-8")
    assert len(EXAMPLE.findall(page)) == page.count("```sql") == 8
