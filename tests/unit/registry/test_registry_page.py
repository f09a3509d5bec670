"""The examples of docs/registry.md give the output that the page shows."""

import re

import duckdb
import pytest

from turnout.cli.query import format_table
from turnout.registry.database import open_registry

EXAMPLE = re.compile(r"```sql\n(.*?)```\n(?:<!-- output -->|```text\n(.*?)```)", re.DOTALL)


@pytest.mark.parametrize("number", range(8))
def test_an_example_gives_the_output_that_the_page_shows(fleet, repository, number):
    page = (repository / "docs" / "registry.md").read_text(encoding="utf-8")
    sql, expected = EXAMPLE.findall(page)[number]
    with open_registry(fleet.registry) as connection:
        assert format_table(connection.sql(sql)) == expected.rstrip("\n")


def test_all_examples_are_checked(repository):
    page = (repository / "docs" / "registry.md").read_text(encoding="utf-8")
    assert len(EXAMPLE.findall(page)) == page.count("```sql") == 8


@pytest.mark.parametrize(("width", "is_table"), [(None, True), (13, True), (12, False)])
def test_a_table_that_is_wider_than_the_terminal_is_printed_with_one_line_per_value(width, is_table):
    result = duckdb.sql("select * from (values (1, 'ballast', null), (2, 'railpad', 'x')) t(n, band, c) order by n")
    table = "n  band     c\n-  -------  -\n1  ballast\n2  railpad  x\n(2 rows)"
    blocks = "n     1\nband  ballast\n\nn     2\nband  railpad\nc     x\n\n(2 rows)"
    assert format_table(result, width=width) == (table if is_table else blocks)
