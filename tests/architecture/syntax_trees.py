"""Syntax trees of source files. Many tests use all of them, so each file is parsed once per process."""

import ast
from functools import cache


@cache
def tree_of(path):
    """Syntax tree of a file; no test changes it."""
    return ast.parse(path.read_text(encoding="utf-8"))
