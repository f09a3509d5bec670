"""Every public function, method and class of the library says what it does."""

import ast

# Still to be written; nothing may be added here.
MISSING = {
    "turnout/mismatch/engine/decision.py Score.family",
    "turnout/passage/wheel_basis.py WheelBasis.n_column",
    "turnout/passage/wheel_basis.py WheelBasis.n_sample",
    "turnout/passage/train_detection.py Levels.n_bin",
    "turnout/passage/result.py Passage.n_axle",
    "turnout/passage/result.py Passage.times",
    "turnout/passage/result.py Passage.audible_sensors",
}


def undocumented(tree, prefix=""):
    """(line, name) of each public definition without docstring; what stands inside a private class is private."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
            if ast.get_docstring(node) is None and "overload" not in map(ast.unparse, node.decorator_list):
                yield node.lineno, prefix + node.name
            if isinstance(node, ast.ClassDef):
                yield from undocumented(node, f"{prefix}{node.name}.")


def test_every_public_definition_has_a_docstring(repository):
    package = repository / "src"
    wrong = [
        f"src/{path.relative_to(package)}:{line} {name}"
        for path in sorted(package.rglob("*.py"))
        for line, name in undocumented(ast.parse(path.read_text(encoding="utf-8")))
        if f"{path.relative_to(package)} {name}" not in MISSING
    ]
    assert not wrong, "\n".join(wrong)


def test_an_undocumented_method_is_found():
    tree = ast.parse("class A:\n    'Doc.'\n    def b(self): ...\n    def _c(self): ...")
    assert list(undocumented(tree)) == [(3, "A.b")]
