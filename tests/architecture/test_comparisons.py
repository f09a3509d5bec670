"""Comparisons of numbers state their tolerances, as receptances are of the order of 1e-9 m/N."""

import ast
from pathlib import Path

COMPARING = {"allclose", "isclose"}


def calls(path):
    """(line, names of its arguments) of every ``numpy.allclose`` and ``numpy.isclose`` of a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in COMPARING:
            if isinstance(node.func.value, ast.Name) and node.func.value.id == "np":
                yield node.lineno, {k.arg for k in node.keywords}


def test_every_comparison_by_numpy_states_its_absolute_tolerance():
    """With the default of 1e-8 any two receptances of a track are equal."""
    tests = Path(__file__).parents[1]
    without_tolerance = [
        f"{path.relative_to(tests)}:{line}"
        for path in sorted(tests.rglob("*.py"))
        for line, keywords in calls(path)
        if "atol" not in keywords
    ]
    assert not without_tolerance
