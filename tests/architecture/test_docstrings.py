"""Public functions document their parameters, the shapes of arrays and the exceptions that they raise."""

import ast
import builtins
import re

from syntax_trees import tree_of

MIN_SHARE = 0.95  # of the public functions with parameters
HEADINGS = ("Parameters\n", "Attributes\n")


def classes(repository):
    """Name -> (names of its bases, its methods) of every class of the two packages; most names are unique."""
    table = {}
    for path in sorted((repository / "src").rglob("*.py")):
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ClassDef):
                bases = {ast.unparse(base).split("[")[0].split(".")[-1] for base in node.bases}
                methods = {item.name: item for item in node.body if isinstance(item, ast.FunctionDef)}
                table.setdefault(node.name, (bases, methods))
    return table


def has_sections(function):
    """Whether the docstring of a function has a section of parameters."""
    return any(heading in (ast.get_docstring(function) or "") for heading in HEADINGS)


def inherits_sections(name, class_name, table):
    """Whether a method overrides one of a base class that documents its parameters."""
    bases, _ = table.get(class_name, ((), {}))
    return any(
        (name in table.get(base, ((), {}))[1] and has_sections(table[base][1][name]))
        or inherits_sections(name, base, table)
        for base in bases
        if base != class_name
    )


def public_functions(repository):
    """(place, function, name of its class or "") of every public function and method with parameters."""
    for path in sorted((repository / "src").rglob("*.py")):
        tree = tree_of(path)
        for node in tree.body:
            in_class = isinstance(node, ast.ClassDef)
            if node.__class__ not in (ast.ClassDef, ast.FunctionDef) or node.name.startswith("_"):
                continue
            for function in node.body if in_class else [node]:
                if not isinstance(function, ast.FunctionDef) or function.name.startswith("_"):
                    continue
                arguments = [a.arg for a in (*function.args.args, *function.args.kwonlyargs)]
                if set(arguments) - {"self", "cls"}:
                    place = f"{path.relative_to(repository)}:{function.lineno} {function.name}"
                    yield place, function, node.name if in_class else ""


def test_public_functions_document_their_parameters(repository):
    table = classes(repository)
    functions = list(public_functions(repository))
    assert len(functions) > 1000
    missing = [
        place
        for place, function, owner in functions
        if not has_sections(function) and not inherits_sections(function.name, owner, table)
    ]
    share = 1 - len(missing) / len(functions)
    assert share >= MIN_SHARE, f"{share:.1%} of {len(functions)}; without:\n" + "\n".join(missing)


def test_the_returned_value_is_not_described_twice(repository):
    """If the summary describes the returned value, the section "Returns" need not repeat it."""
    repeated = []
    for path in sorted((repository / "src").rglob("*.py")):
        for node in ast.walk(tree_of(path)):
            text = (ast.get_docstring(node) or "") if isinstance(node, ast.FunctionDef) else ""
            if "Returns\n-------\n" not in text:
                continue
            summary, returned = text.split("\n\n")[0], text.split("Returns\n-------\n")[1].split("\n\n")[0]
            summary = re.sub(r"^\([\w*+/,. ]+\) ", "", summary)  # a shape
            if words(summary) == words(" ".join(returned.splitlines()[1:])):
                repeated.append(f"{path.relative_to(repository)}:{node.lineno} {node.name}")
    assert not repeated, "\n".join(repeated)


def words(text):
    """The words of a text in lower case, without punctuation."""
    return re.findall(r"\w+", text.lower())


def test_arrays_have_shapes(repository):
    """Without its shape it is unknown what the axes of an array are. ``(...)`` stands for any shape."""
    shapeless = []
    for place, function, _ in public_functions(repository):
        text = ast.get_docstring(function) or ""
        for heading in ("Parameters\n----------\n", "Returns\n-------\n"):
            for line in text.partition(heading)[2].partition("\n\n")[0].splitlines():
                if not line.startswith(" ") and re.search(r"\barrays?\b", line.split(" : ")[-1]) and "(" not in line:
                    shapeless.append(f"{place}: {line}")
    shapeless = [line for line in shapeless if line.startswith("src/turnout/")]
    assert not shapeless, "\n".join(shapeless)


def raised_names(function):
    """Names of the exceptions that a function raises itself, outside a ``try`` that may handle them."""
    handled = {
        node
        for block in ast.walk(function)
        if isinstance(block, ast.Try) and block.handlers
        for statement in block.body
        for node in ast.walk(statement)
    }
    for node in ast.walk(function):
        if isinstance(node, ast.Raise) and node not in handled:
            name = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            if isinstance(name, ast.Name) and name.id[0].isupper():
                yield name.id


def exception_bases(name):
    """A built-in exception with its base classes; any other name alone."""
    bases = getattr(builtins, name).__mro__ if hasattr(builtins, name) else ()
    return {name} | {base.__name__ for base in bases} - {"Exception", "BaseException", "object"}


def test_public_functions_document_the_exceptions_that_they_raise(repository):
    unnamed = [
        f"{place}: {name}"
        for place, function, _ in public_functions(repository)
        for name in raised_names(function)
        if place.startswith("src/turnout/")
        and name != "NotImplementedError"
        and not exception_bases(name) & set(re.findall(r"\w+", ast.get_docstring(function) or ""))
    ]
    assert not unnamed, "\n".join(unnamed)
