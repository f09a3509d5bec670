"""Numbers are compared with tolerances that are said: receptances are a billionth of a metre per newton."""

import ast
from pathlib import Path

COMPARING = {"allclose", "isclose"}


def calls(path):
    """(line, names of its arguments) of every ``numpy.allclose`` and ``numpy.isclose`` of a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in COMPARING:
            if isinstance(node.func.value, ast.Name) and node.func.value.id == "np":
                yield node.lineno, {k.arg for k in node.keywords}


def test_no_test_leaves_the_absolute_tolerance_to_numpy():
    """Its default of 1e-8 lets any two receptances of a track pass for equal."""
    tests = Path(__file__).parents[1]
    silent = [
        f"{path.relative_to(tests)}:{line}"
        for path in sorted(tests.rglob("*.py"))
        for line, said in calls(path)
        if "atol" not in said
    ]
    assert not silent
