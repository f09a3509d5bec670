"""Machine code of the kernels is stored in a writable folder, and never older than any of its sources."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.errors import TypingError

from turnout import kernel_cache
from turnout.fingerprint import closure

PACKAGE = Path(kernel_cache.__file__).parent
RUN = "from turnout.simulate.wheel_path import uniform_pieces; print(uniform_pieces([0.0, 1.0, 4.0]).sum())"


def imported_by(path):
    return {n.module for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.ImportFrom) and n.module}


def name_of(path):
    return ".".join(("turnout", *path.relative_to(PACKAGE).with_suffix("").parts))


def test_the_name_of_the_folder_depends_on_every_kernel_that_another_one_calls():
    with_kernels = {name_of(p): p for p in PACKAGE.rglob("*.py") if "kernel_cache import" in p.read_text()}
    assert len(with_kernels) >= 8
    behind = closure(*kernel_cache.FINGERPRINTED_MODULES)
    for name, path in with_kernels.items():
        called = with_kernels.keys() & imported_by(path)
        assert called <= behind, f"{name} calls kernels that the folder does not depend on"
    assert {"turnout.simulate.force_laws", "turnout.modal.wave_kernels", "turnout.kernel_cache"} <= behind


def test_only_the_kernel_cache_imports_numba():
    assert {p.stem for p in PACKAGE.rglob("*.py") if "numba" in imported_by(p)} == {"kernel_cache"}


CREATORS = {"zeros", "empty", "full", "ones", "arange", "eye", "array", "zeros_like", "empty_like", "copy"}


def kernels_of(path):
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef):
            for decorator in node.decorator_list:
                if isinstance(decorator, ast.Name) and decorator.id.endswith("kernel"):
                    yield node, decorator.id


def test_only_kernels_that_create_arrays_count_references():
    found = [k for p in (PACKAGE / "simulate").rglob("*.py") for k in kernels_of(p)]
    called = {
        node.name: {
            getattr(c.func, "attr", getattr(c.func, "id", "")) for c in ast.walk(node) if isinstance(c, ast.Call)
        }
        for node, _ in found
    }
    counting = {node.name for node, decorator in found if decorator == "kernel"}
    assert {"factorise", "inverse_windows"} <= counting < called.keys()
    idle = [name for name in counting if not called[name] & (CREATORS | counting)]
    assert not idle, f"create no arrays, and should borrow them: {idle}"


def called_by_python(path):
    """Names of functions that the Python code of a file calls outside of kernels."""
    kernels = {node.name for node, _ in kernels_of(path)}
    for node in ast.parse(path.read_text()).body:
        if getattr(node, "name", "") not in kernels:
            yield from (c.func.id for c in ast.walk(node) if isinstance(c, ast.Call) and isinstance(c.func, ast.Name))


def test_inlined_kernels_have_an_entry_for_python_only_if_python_calls_them():
    """An entry that unpacks tens of arrays from tuples takes longer to compile than its kernel."""
    found = [k for p in (PACKAGE / "simulate").rglob("*.py") for k in kernels_of(p)]
    inlined = {node.name for node, decorator in found if decorator in ("inline_kernel", "inner_kernel")}
    with_entry = {node.name for node, decorator in found if decorator == "inline_kernel"}
    called = {name for p in (PACKAGE / "simulate").rglob("*.py") for name in called_by_python(p)}
    assert with_entry == inlined & called and len(inlined) > 12


def fresh_row(rows):
    return np.zeros(rows.shape[1])


def test_a_borrowing_kernel_cannot_create_an_array():
    with pytest.raises(TypingError, match="zeros"):
        kernel_cache.borrowing_kernel(fresh_row)(np.ones((2, 3)))


def run(environment, code=RUN):
    done = subprocess.run([sys.executable, "-c", code], env=os.environ | environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_setting_of_the_user_has_priority_and_its_folder_is_used_again(tmp_path):
    first = run({"NUMBA_CACHE_DIR": str(tmp_path)})
    kept = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*.nbc")}
    assert len(kept) == 1 and next(p.name for p in tmp_path.iterdir()).startswith("kernels-")
    assert run({"NUMBA_CACHE_DIR": str(tmp_path)}) == first
    assert {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*.nbc")} == kept


def test_equal_code_in_another_folder_is_not_compiled_again(tmp_path):
    """Two installations of one version, and a changed one, with a common cache folder."""
    text = "from turnout.kernel_cache import kernel\n\n\n@kernel\ndef twice(x):\n    return 2 * x\n"
    n_compiled = []
    for name, source in (("a", text), ("b ü", text), ("c", text.replace("2 *", "3 *"))):
        (tmp_path / name).mkdir()
        (tmp_path / name / "some_kernel.py").write_text(source)
        code = f"import sys; sys.path.append({str(tmp_path / name)!r}); import some_kernel as k; print(k.twice(4))"
        assert run({"NUMBA_CACHE_DIR": str(tmp_path / "cache")}, code) == f"{12 if name == 'c' else 8}\n"
        n_compiled.append(len(list((tmp_path / "cache").rglob("*.nbc"))))
    assert n_compiled == [1, 1, 2]


@pytest.fixture
def nowhere(monkeypatch, tmp_path):
    """Neither the folder of the source nor the cache of the user is writable: both would lie below a file."""
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(kernel_cache, "__file__", str(tmp_path / "file" / "kernel_cache.py"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr(kernel_cache.config, "CACHE_DIR", "")
    kernel_cache.cache_folder.cache_clear()
    yield tmp_path
    kernel_cache.cache_folder.cache_clear()


def test_without_any_folder_to_write_kernels_still_compile(nowhere):
    assert kernel_cache.cache_folder() is None

    @kernel_cache.kernel
    def twice(x):
        return 2 * x

    assert twice(21) == 42


def test_a_read_only_installation_uses_the_cache_of_the_user(nowhere, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(nowhere / "home"))
    folder = kernel_cache.cache_folder()
    assert folder.parent == nowhere / "home" / "turnout" and folder.is_dir()


def test_other_code_has_another_folder_and_the_old_folder_is_deleted(nowhere, monkeypatch):
    package = nowhere / "package"
    (package / "__pycache__" / "kernels-0123456789abcdef").mkdir(parents=True)
    monkeypatch.setattr(kernel_cache, "__file__", str(package / "kernel_cache.py"))
    monkeypatch.setattr(kernel_cache, "fingerprint", lambda *_: "feedfeedfeedfeed")
    assert kernel_cache.cache_folder().name == "kernels-feedfeedfeedfeed"
    assert [p.name for p in (package / "__pycache__").iterdir()] == ["kernels-feedfeedfeedfeed"]
