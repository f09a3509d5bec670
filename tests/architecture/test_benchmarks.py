"""The output of ``python -m benchmarks`` states its results and can be understood without other documents."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest
from benchmarks.bar import Bar, heading

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"
CODE = re.compile(
    r"^\s*[A-Z]\d{1,2}\b|\b(bars?|and) [A-Z]\d{1,2}\b"
)  # a code of a bar, which refers to a list elsewhere


@pytest.mark.parametrize(("figure", "is_met"), [(0.9, True), (1.1, False), (float("nan"), None)])
@pytest.mark.parametrize("type_", [float, np.float64, np.float32])
def test_a_bar_is_met_missed_or_open_for_every_type_of_number(figure, is_met, type_):
    bar = Bar("figure", type_(figure), 1.0)
    assert bar.is_met is is_met and bar.is_unmeasured is (is_met is None)
    assert {True: " met", False: " MISSED", None: " open"}[is_met] in str(bar)


def test_values_are_aligned_with_the_headings_of_their_columns():
    line = str(Bar("figure", 0.9, 1.0, "Hz", n="n=5"))
    for name, value in (("measured", "0.9"), ("bar", "<= 1")):
        end = re.search(rf"(?<= ){name} ", heading()).end()
        assert line[:end].rstrip().endswith(value)
    assert line.index("Hz") == heading().index("unit") and line.index("met") == heading().index("bar is")


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.name)
def test_names_of_bars_and_docstrings_contain_no_codes(path):
    tree = ast.parse(path.read_text())
    calls = (n for n in ast.walk(tree) if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "Bar" and n.args)
    names = [ast.unparse(call.args[0]).removeprefix("f").strip("'\"") for call in calls]
    documented = (ast.Module, ast.FunctionDef, ast.ClassDef)
    names += [ast.get_docstring(node) or "" for node in ast.walk(tree) if isinstance(node, documented)]
    assert [name for name in names if CODE.search(name)] == []


@pytest.mark.parametrize("path", sorted(FOLDER.glob("bench_*.py")), ids=lambda path: path.name)
def test_every_benchmark_has_a_docstring_about_what_it_measures(path):
    assert len(ast.get_docstring(ast.parse(path.read_text())) or "") > 40
