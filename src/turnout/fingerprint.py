"""Hash of the code that computed a result; comments, docstrings and formatting do not change it."""

import ast
import hashlib
import json
import os
import sys
from functools import cache
from pathlib import Path

from turnout.files import write_text

PACKAGE = "turnout"
ROOT = Path(__file__).parent
# drawings and words for people, and where the program lies: no result of a stage depends on them
WITHOUT_RESULTS = frozenset({"turnout.plots", "turnout.installation", "turnout.reasons"})


def fingerprint(*modules: str) -> str:
    """Hash of the syntax trees of modules and of all that they import from this package.

    Imports inside functions count. A package counts if it is itself imported from, and
    ``import_module(f"turnout.readers.{name}")`` counts as every module of ``turnout.readers``. Data files (CSV, SQL) in
    the folder of an imported module count by their bytes. A folder without modules (templates, SQL) counts for the
    modules that name it in a string. Modules ``WITHOUT_RESULTS`` count only if they are named here.

    Parameters
    ----------
    *modules : str
        Names such as "turnout.modal".

    Returns
    -------
    str
        16 hexadecimal digits.

    Raises
    ------
    ValueError
        For a module that does not exist.

    Examples
    --------
    >>> fingerprint("turnout.errors") == fingerprint("turnout.errors")
    True
    >>> fingerprint("turnout.errors") == fingerprint("turnout.records")
    False
    """
    names = closure(*modules)
    text = "\n".join(f"{name} {_digest_and_imports(name)[0]}" for name in sorted(names))
    _remember()
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def closure(*modules: str) -> frozenset[str]:
    """Names of ``modules`` and of every module of this package that they import, directly or not.

    Parameters
    ----------
    *modules : str
        Names such as "turnout.modal".

    Returns
    -------
    frozenset of str
        Names, those of ``modules`` included.

    Raises
    ------
    ValueError
        For a module that does not exist.
    """
    names, queue = set(), list(modules)
    for name in modules:
        if _module_path(name) is None:
            raise ValueError(f"no module {name} in the package {PACKAGE}")
    while queue:
        name = queue.pop()
        if name not in names and (name in modules or name not in WITHOUT_RESULTS) and _module_path(name):
            names.add(name)
            queue += _digest_and_imports(name)[1]
    return frozenset(names)


def clear_caches() -> None:
    """Forget the cached hashes: source files changed while this process was running."""
    _module_path.cache_clear()
    _digest_and_imports.cache_clear()
    _data_in_folder.cache_clear()
    _data_digest.cache_clear()
    _module_names.cache_clear()
    _module_memory.cache_clear()


@cache
def _module_path(name: str) -> Path | None:
    if name.partition(".")[0] != PACKAGE:
        return None
    path = ROOT.joinpath(*name.split(".")[1:])
    if path.is_dir():
        return path / "__init__.py" if (path / "__init__.py").exists() else None
    return path.with_suffix(".py") if path.with_suffix(".py").exists() else None


@cache
def _digest_and_imports(name: str) -> tuple[str, tuple[str, ...]]:
    """Hash of one module without its docstrings, and the names of the modules that it may import."""
    path = _module_path(name)
    if path is None:
        raise ValueError(f"no module {name} in the package {PACKAGE}")
    source = path.read_bytes()
    key = _key(name, path, source)
    if name in _module_memory() and _module_memory()[name][0] == key:
        return _module_memory()[name][1], tuple(_module_memory()[name][2])
    digest, imported = _parse(name, path, source)
    _module_memory()[name] = [key, digest, imported]
    _module_memory()[NEW] = []
    return digest, tuple(imported)


def _parse(name: str, path: Path, source: bytes) -> tuple[str, list[str]]:
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and _is_type_checking(node.test):
            node.body = [ast.Pass()]
    nodes = list(ast.walk(tree))
    imported = _imports(nodes, name, path.name == "__init__.py")
    for node in nodes:
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)) and _has_docstring(node):
            node.body = node.body[1:] or [ast.Pass()]
    digest = hashlib.sha256(ast.dump(tree).encode())
    for data in _data_files(path.parent, nodes):
        digest.update(data.name.encode() + data.read_bytes())
    return digest.hexdigest(), sorted(set(imported))


NEW = ""  # an entry that says that others are not in the file yet


def _key(name: str, path: Path, source: bytes) -> str:
    """Hash of all that the digest of a module depends on; equal bytes need not be parsed again."""
    facts = (name, path.name, sys.version, _own_digest(), _module_names(ROOT), _data_digest(path.parent))
    return hashlib.sha256("\0".join(facts).encode() + source).hexdigest()


@cache
def _own_digest() -> str:
    """Hash of this module: another rule gives other digests."""
    return hashlib.sha256(Path(__file__).read_bytes()).hexdigest()


@cache
def _module_names(root: Path) -> str:
    return " ".join(sorted(str(path.relative_to(root)) for path in root.rglob("*.py")))


@cache
def _data_digest(folder: Path) -> str:
    """Hash of the tables in a folder and of all files of its data folders."""
    tables, folders = _data_in_folder(folder)
    files = sorted([*tables, *(p for inner in folders for p in inner.iterdir() if p.is_file())])
    return hashlib.sha256(b"".join(str(p.relative_to(folder)).encode() + p.read_bytes() for p in files)).hexdigest()


def _memory_files() -> list[Path]:
    """Where parsed modules are remembered: beside the source, else in the user's cache."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return [folder / "fingerprints.cache" for folder in (ROOT / "__pycache__", Path(home) / PACKAGE)]


@cache
def _module_memory() -> dict[str, list]:
    """Per module [key, digest, imports] of the first readable memory file; empty for a damaged one."""
    for path in _memory_files():
        try:
            content = json.loads(path.read_bytes())
            if content["sha256"] == _checksum(content["modules"]):
                return dict(content["modules"])
        except (OSError, ValueError, KeyError, TypeError):
            continue
    return {}


def _remember() -> None:
    """Write the memory file if a module was parsed; a computer without a writable cache parses again each time."""
    modules = _module_memory()
    if modules.pop(NEW, None) is None:
        return
    for path in _memory_files():
        try:
            write_text(path, json.dumps({"sha256": _checksum(modules), "modules": modules}))
        except OSError:
            continue
        return


def _checksum(modules: dict[str, list]) -> str:
    return hashlib.sha256(json.dumps(modules, sort_keys=True).encode()).hexdigest()


def _data_files(folder: Path, nodes: list[ast.AST]) -> list[Path]:
    """Tables in the folder of a module, and all files of the data folders that it names."""
    tables, folders = _data_in_folder(folder)
    if not folders:
        return list(tables)
    strings = {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    return sorted([*tables, *(p for inner in folders if inner.name in strings for p in inner.iterdir() if p.is_file())])


@cache
def _data_in_folder(folder: Path) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """Tables in a folder, and its subfolders without modules."""
    entries = sorted(folder.iterdir())
    folders = (p for p in entries if p.is_dir() and p.name != "__pycache__" and not any(p.glob("*.py")))
    return tuple(p for p in entries if p.suffix in (".csv", ".sql")), tuple(folders)


def _has_docstring(node: ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    first = node.body[0] if node.body else None
    return isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str)


def _is_type_checking(test: ast.expr) -> bool:
    """Whether a condition is ``TYPE_CHECKING`` or ``typing.TYPE_CHECKING``."""
    return "TYPE_CHECKING" in (getattr(test, "id", None), getattr(test, "attr", None))


def _imports(nodes: list[ast.AST], name: str, is_package: bool) -> list[str]:
    names: list[str] = []
    for node in nodes:
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parents = name.split(".") if is_package else name.split(".")[:-1]
                base = ".".join(parents[: len(parents) - node.level + 1] + ([base] if base else []))
            names += [base, *(f"{base}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.JoinedStr):
            names += _matching_modules(node)
    return names


def _matching_modules(node: ast.JoinedStr) -> list[str]:
    """All modules that match a name like f"turnout.readers.{format}"."""
    start = node.values[0].value if node.values and isinstance(node.values[0], ast.Constant) else ""
    if not (isinstance(start, str) and start.startswith(PACKAGE + ".") and start.endswith(".")):
        return []
    folder = ROOT.joinpath(*start.rstrip(".").split(".")[1:])
    return [start + p.stem for p in sorted(folder.glob("*.py")) if p.stem != "__init__"]
