"""Aliases of YAML: a small file can stand for billions of values or contain itself. Both are errors with a line."""

import pytest

from turnout.config.document import load
from turnout.errors import ConfigError


def test_aliases_that_stand_for_too_many_values_are_an_error(tmp_path):
    """A mapping has three nodes; line k + 1 stands for 3 * 10^k nodes and their lists: 3.1 million in line 7."""
    lines = ["a0: &a0 {x: 1}", *(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 10))]
    (tmp_path / "config.yaml").write_text("\n".join(lines) + "\n")
    with pytest.raises(ConfigError, match=r"line 7, column 5.*: its aliases stand for more than 1000000 values"):
        load(tmp_path / "config.yaml")


def test_a_mapping_that_contains_itself_is_an_error(tmp_path):
    (tmp_path / "config.yaml").write_text("a: &a\n  b: *a\n")
    with pytest.raises(ConfigError, match="it contains itself"):
        load(tmp_path / "config.yaml")


def test_an_alias_that_repeats_a_few_values_is_read(tmp_path):
    (tmp_path / "config.yaml").write_text("a: &a {x: 1}\nb: *a\n")
    assert load(tmp_path / "config.yaml")
