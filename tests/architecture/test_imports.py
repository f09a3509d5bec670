"""The allowed imports between packages, checked with the syntax trees of all files."""

import ast
from functools import cache

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from syntax_trees import tree_of

BASE = {
    "arrow_memory",
    "child_processes",
    "constants",
    "content",
    "counts",
    "errors",
    "files",
    "installation",
    "locks",
    "number_text",
    "plots",
    "reasons",
    "records",
    "threads",
    "unit_spellings",
    "units",
}
FOUNDATION = {"config", "readers", "signal", "registry", "fingerprint"}
COMPILED = {"kernel_cache"}
PARTS = {"hammer_test", "modal", "passage", "simulate"}
ALLOWED = {
    "arrow_memory": set(),
    "child_processes": set(),
    "constants": set(),
    "content": set(),
    "counts": set(),
    "errors": {"reasons"},
    "files": {"errors"},
    "former_names": set(),
    "installation": set(),
    "locks": {"errors"},
    "number_text": set(),
    "plots": {"units"},
    "reasons": set(),
    "records": {"errors", "plots"},
    "threads": set(),
    "unit_spellings": set(),
    "units": {"constants", "errors", "records", "unit_spellings"},
    **{package: BASE for package in FOUNDATION},
    "kernel_cache": {"fingerprint"},
    **{package: BASE | FOUNDATION | COMPILED for package in PARTS},
    "physics": BASE | FOUNDATION | PARTS,
    "workflow": BASE | FOUNDATION,
    "trend": BASE | FOUNDATION | PARTS | {"physics"},
    "mismatch": BASE | FOUNDATION | COMPILED | PARTS | {"physics"},
    "stages": BASE | FOUNDATION | PARTS | {"physics", "workflow", "trend", "mismatch"},
}
ALLOWED["report"] = set(ALLOWED) | {"report"}
ALLOWED["demo"] = set(ALLOWED) | {"demo"}
ALLOWED["cli"] = set(ALLOWED) | {"cli"}
ALLOWED["__main__"] = {"cli"}
ALLOWED["api"] = set(ALLOWED) | {"api"}
OPENS_FILES = BASE | {
    "former_names",
    "api",
    "config",
    "readers",
    "registry",
    "workflow",
    "stages",
    "report",
    "cli",
    "demo",
    "fingerprint",
    "kernel_cache",
}


def running_nodes(tree):
    """Every node below ``tree`` except the body of ``if TYPE_CHECKING:``, which never runs."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in (
            getattr(node.test, "id", None),
            getattr(node.test, "attr", None),
        ):
            yield from running_nodes(ast.Module(node.orelse, []))
        else:
            yield node
            yield from running_nodes(node)


@cache
def imports_of(path):
    """Every module imported anywhere in the file, at the top or inside a function."""
    imported = []
    for node in running_nodes(tree_of(path)):
        if isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            imported += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return imported


def package_of(module):
    """The package of ``turnout.x.y``."""
    return module.split(".")[1] if module.startswith("turnout.") else None


def sources(repository):
    package = repository / "src" / "turnout"
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        if parts != ("__init__",):
            yield parts[0], path


def test_each_package_imports_only_allowed_packages(repository):
    wrong = []
    for package, path in sources(repository):
        assert package in ALLOWED, f"{path}: no rule for {package!r}; give it a line in ALLOWED"
        for module in imports_of(path):
            other = package_of(module)
            if other in ALLOWED and other != package and other not in ALLOWED[package]:
                wrong.append(f"{path.relative_to(repository)} imports {module}")
    assert not wrong, "\n".join(wrong)


def test_imports_for_the_type_checker_are_not_counted(tmp_path):
    path = tmp_path / "module.py"
    path.write_text("import a\nif TYPE_CHECKING:\n    import b\nelse:\n    import c\n")
    assert imports_of(path) == ["a", "c"]


def import_cycles(imports):
    """Modules that import each other, as one sorted list per cycle.

    ``imports``: module -> the modules that it imports."""
    modules = sorted(imports)
    number = {module: k for k, module in enumerate(modules)}
    arrows = [(number[a], number[b]) for a in modules for b in imports[a] if b in number and b != a]
    rows, columns = zip(*arrows, strict=True)
    graph = coo_matrix((np.ones(len(arrows)), (rows, columns)), shape=(len(modules), len(modules)))
    _, label = connected_components(graph, directed=True, connection="strong")
    return [
        [m for m, same in zip(modules, label == k, strict=True) if same] for k in np.flatnonzero(np.bincount(label) > 1)
    ]


def test_no_modules_import_each_other(repository):
    root = repository / "src"
    names = {
        ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): path
        for path in root.rglob("*.py")
    }
    # "from package import module" is also listed as an import of the package
    imports = {
        name: [m for m in imports_of(path) if not any(n.startswith(f"{m}.") and n in names for n in imports_of(path))]
        for name, path in names.items()
    }
    assert import_cycles(imports) == []


def test_cycles_of_imports_are_found():
    assert import_cycles({"a": ["b"], "b": ["c"], "c": ["a", "d"], "d": ["e"], "e": []}) == [["a", "b", "c"]]


def test_nothing_in_the_library_imports_snakemake(repository):
    wrong = [str(p) for _, p in sources(repository) if any(m.split(".")[0] == "snakemake" for m in imports_of(p))]
    assert not wrong, "\n".join(wrong)


def test_only_the_report_and_the_plots_import_a_plotting_library(repository):
    plotting = {"matplotlib", "plotly", "altair", "seaborn"}
    wrong = [
        str(p)
        for package, p in sources(repository)
        if package not in ("report", "plots") and any(m.split(".")[0] in plotting for m in imports_of(p))
    ]
    assert not wrong, "\n".join(wrong)


OPENING_CALLS = {"open", "read_text", "write_text", "read_bytes", "write_bytes"}


def test_only_the_listed_packages_open_files(repository):
    wrong = []
    for package, path in sources(repository):
        if package in OPENS_FILES:
            continue
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.Call):
                name = getattr(node.func, "id", getattr(node.func, "attr", ""))
                if name in OPENING_CALLS:
                    wrong.append(f"{path.relative_to(repository)}:{node.lineno} calls {name}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("folder", ["scripts"])
def test_scripts_are_short(repository, folder):
    for path in sorted((repository / folder).glob("*.py")):
        lines = [line for line in path.read_text().splitlines() if line.strip()]
        assert len(lines) <= 25, f"{path} has {len(lines)} lines; a script loads, calls one function, saves"


def test_rules_have_no_run_blocks_and_compute_nothing(repository):
    for path in [repository / "Snakefile", *sorted((repository / "rules").glob("*.smk"))]:
        text = path.read_text()
        assert "\n    run:" not in text, f"{path} has a run: block"
        for line in text.splitlines():
            words = line.split()
            if words[:1] in (["import"], ["from"]) and words[1].startswith("turnout"):
                allowed = {"config", "content", "fingerprint", "readers", "units", "workflow"}
                assert words[1].split(".")[1] in allowed, f"{path}: {line}"


def test_ruff_is_clean(repository):
    import subprocess
    import sys

    for arguments in (["check"], ["format", "--check"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *arguments, "."], cwd=repository, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr


def test_snakefmt_is_clean(repository):
    import subprocess
    import sys

    files = [str(p) for p in [repository / "Snakefile", *sorted((repository / "rules").glob("*.smk"))]]
    done = subprocess.run([sys.executable, "-m", "snakefmt", "--check", *files], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
