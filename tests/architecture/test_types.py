"""Every function of the two packages declares its types, and mypy accepts them."""

import ast
import subprocess
import sys

import pytest
from syntax_trees import tree_of


def modules(repository):
    for path in sorted((repository / "src").rglob("*.py")):
        yield path.relative_to(repository), tree_of(path)


def functions(tree, in_class=False):
    """(definition, whether it is a method) of every function, nested ones included."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield node, in_class
            yield from functions(node)
        else:
            yield from functions(node, in_class or isinstance(node, ast.ClassDef))


def missing_annotations(function, is_method):
    """Names of the parameters without a type, and "return" if its type is missing; ``self`` and ``cls`` need none."""
    a = function.args
    positional = [*a.posonlyargs, *a.args]
    static = any(getattr(d, "id", "") == "staticmethod" for d in function.decorator_list)
    if is_method and not static:
        positional = positional[1:]
    parameters = [*positional, *a.kwonlyargs, *(p for p in (a.vararg, a.kwarg) if p)]
    names = [p.arg for p in parameters if p.annotation is None]
    if function.returns is None and function.name != "__init__":
        names.append("return")
    return names


def is_dataclass(node):
    """Whether a class is decorated with ``@dataclass`` or ``@dataclass(...)``."""
    decorators = (d.func if isinstance(d, ast.Call) else d for d in node.decorator_list)
    return any("dataclass" in (getattr(d, "id", None), getattr(d, "attr", None)) for d in decorators)


def fields_of_any_object(tree):
    """(line, "Class.field") of every dataclass field of type ``object``, alone or in a union."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and is_dataclass(node):
            for item in node.body:
                if isinstance(item, ast.AnnAssign) and "object" in ast.unparse(item.annotation).split(" | "):
                    yield item.lineno, f"{node.name}.{ast.unparse(item.target)}"


def test_every_signature_is_annotated(repository):
    wrong = [
        f"{path}:{function.lineno} {function.name}: {', '.join(names)}"
        for path, tree in modules(repository)
        for function, is_method in functions(tree)
        if (names := missing_annotations(function, is_method))
    ]
    assert not wrong, f"{len(wrong)} signatures:\n" + "\n".join(wrong)


def test_no_field_of_a_dataclass_has_the_type_object(repository):
    wrong = [f"{path}:{line} {name}" for path, tree in modules(repository) for line, name in fields_of_any_object(tree)]
    assert not wrong, "\n".join(wrong)


def test_missing_types_are_found():
    text = "@dataclass\nclass A:\n    x: object\n    y: int\n    def f(self, a: int, *b): ...\ndef g(c) -> int: ..."
    tree = ast.parse(text)
    assert [missing_annotations(*f) for f in functions(tree)] == [["b", "return"], ["c"]]
    assert list(fields_of_any_object(tree)) == [(3, "A.x")]


@pytest.mark.slow
def test_mypy_accepts_the_declared_types(repository):
    process = subprocess.run([sys.executable, "-m", "mypy"], cwd=repository, capture_output=True, text=True)
    assert process.returncode == 0, process.stdout + process.stderr
