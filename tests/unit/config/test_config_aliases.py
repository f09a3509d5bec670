"""Aliases of YAML: a small file may stand for billions of values, or for itself; both are errors by place."""

import pytest

from turnout.config.document import load
from turnout.errors import ConfigError


def test_mappings_that_multiply_are_an_error_at_once(tmp_path):
    """A mapping is three nodes and line k + 1 stands for 3 * 10^k of them and its lists: 3.1 million in line 7."""
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
