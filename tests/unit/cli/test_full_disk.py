"""On a full disk the command names the file, and leaves no incomplete file that looks complete."""

import ast
import errno
import os
import resource
import signal
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from numba.core.caching import CompileResultCacheImpl

from turnout import kernel_cache
from turnout.cli.main import main
from turnout.errors import RegistryError
from turnout.files import whole_file, write_text
from turnout.readers.writing import WRITERS
from turnout.registry.database import build_database
from turnout.registry.generation import load
from turnout.registry.job import register
from turnout_blind import march
from turnout_blind.seal import write_commit, write_truth

LIMIT = 4096  # bytes that fit on the simulated disk


@contextmanager
def full_disk():
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, hard))
    writes_bytecode, sys.dont_write_bytecode = (
        not sys.dont_write_bytecode,
        True,
    )  # byte code would be cut off at the limit
    try:
        yield
    finally:
        sys.dont_write_bytecode = not writes_bytecode
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, handler)


def test_the_error_of_a_text_that_does_not_fit_names_the_file(tmp_path):
    with full_disk(), pytest.raises(OSError, match="too large") as caught:
        write_text(tmp_path / "a.html", "x" * 3 * LIMIT)
    assert caught.value.filename == str(tmp_path / "a.html") and not list(tmp_path.iterdir())


@pytest.mark.parametrize("before", [None, "what was there before"])
def test_a_file_that_a_library_writes_is_complete_or_unchanged(tmp_path, before):
    path = tmp_path / "a.csv"
    if before:
        path.write_text(before)
    with full_disk(), pytest.raises(OSError, match="too large") as caught, whole_file(path) as unfinished:
        unfinished.write_text("x" * 3 * LIMIT)
    assert caught.value.filename == str(path)
    assert [p.read_text() for p in tmp_path.iterdir()] == ([before] if before else [])
    with whole_file(path) as unfinished:
        unfinished.write_text("new")
        assert unfinished.suffix == ".csv" and path.exists() == bool(before)
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"] and path.read_text() == "new"


def test_standard_output_and_pipes_are_written_directly(tmp_path, capfd):
    with whole_file("/dev/stdout") as path:
        path.write_text("rows\n")
    assert capfd.readouterr().out == "rows\n"  # here standard output is a file, as with "> file" in a shell
    os.mkfifo(tmp_path / "pipe")
    with whole_file(tmp_path / "pipe") as path:
        assert path == tmp_path / "pipe"


@pytest.mark.parametrize("ending", ["csv", "h5", "npz", "mat", "uff", "tdms", "wav", "lvm", "parquet"])
def test_a_simulated_recording_is_complete_or_absent(tmp_path, repository, capsys, monkeypatch, ending):
    monkeypatch.chdir(repository)
    out = tmp_path / f"A7_1.{ending}"
    formats = {"h5": "hdf5", "uff": "uff58b"}
    command = ["simulate", "hammer", "--section", "A7", "--at", "2026-05-13T09:00:00", "--impacts", "1"]
    with full_disk():
        code = main([*command, "--format", formats.get(ending, ending), "--out", str(out)])
    err = capsys.readouterr().err
    assert code == 2 and str(out) in err, err
    assert not list(tmp_path.iterdir())


def test_a_computation_continues_if_the_disk_of_the_cache_is_full(tmp_path, monkeypatch):
    """Compiled functions are stored beside the program or in the home folder, which can be full while raw/ is not."""
    monkeypatch.setattr(kernel_cache, "cache_folder", lambda: tmp_path)
    with full_disk():
        assert kernel_cache.kernel(twice)(2.0) == 4.0
    assert not list(tmp_path.rglob("*.nbc"))
    assert kernel_cache.kernel(twice)(2.0) == 4.0  # stored now
    assert list(tmp_path.rglob("*.nbc"))


def twice(x):
    return 2.0 * x


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="another system")
def test_a_read_error_of_the_system_names_the_file(capsys):
    """As with a bad sector: the system opens the file, and the read error states no file name."""
    assert main(["inspect", "/proc/self/mem"]) == 2
    assert "/proc/self/mem: Input/output error" in capsys.readouterr().err


def test_every_writer_is_tested():
    tried = {"hdf5", "uff58b", "csv", "npz", "mat", "tdms", "wav", "lvm", "parquet"}
    assert set(WRITERS) - tried == {"uff58", "rcmdx", "mat73"}  # they share the code of uff58b and hdf5


def test_the_error_of_a_read_only_disk_names_the_requested_file(tmp_path, monkeypatch):
    """The removal of the temporary file fails, too, although that file never existed."""

    def fail(path, *args, **kwargs):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr("builtins.open", fail)
    monkeypatch.setattr(Path, "unlink", fail)
    with pytest.raises(OSError, match="Read-only") as caught:
        write_text(tmp_path / "a.html", "x")
    assert caught.value.filename == str(tmp_path / "a.html")


def fail(path, *args, **kwargs):
    raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))


def test_a_registry_on_a_read_only_disk_is_named(tmp_path, monkeypatch):
    register([], tmp_path, read=iter)
    generation = load(tmp_path)
    monkeypatch.setattr(Path, "write_bytes", fail)
    monkeypatch.setattr(Path, "unlink", fail)
    with pytest.raises(RegistryError, match=r"cannot write registry\.duckdb"):
        build_database(tmp_path, generation)


def test_no_error_of_a_removal_takes_the_place_of_that_of_the_writing(repository):
    """The removal of an unfinished file fails on a read-only disk, also where the file never existed."""
    removals = [
        f"{path}:{call.lineno}"
        for package in ("turnout", "turnout_blind")
        for path in (repository / "src" / package).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Try)
        for statement in node.finalbody
        for call in ast.walk(statement)
        if isinstance(call, ast.Attribute) and call.attr == "unlink"
    ]
    assert not removals, f"use turnout.files.remove_unfinished: {removals}"


@pytest.mark.parametrize("name", ["set", "T01"])
def test_a_sealed_truth_is_complete_or_absent(tmp_path, name):
    """A cut set.json stopped every later start of `turnout blind make` as a fault of the program."""
    with full_disk(), pytest.raises(OSError, match="too large") as caught:
        write_truth(tmp_path, name, {"track": "x" * 3 * LIMIT}, 1)
    assert caught.value.filename == str(tmp_path / f"{name}.json") and not list(tmp_path.iterdir())


def test_a_commitment_is_complete_or_absent(tmp_path):
    """A cut commit.json was taken for a finished set."""
    truths = {"set": "0" * 64, **{f"T{k}": "0" * 64 for k in range(200)}}
    with full_disk(), pytest.raises(OSError, match="too large") as caught:
        write_commit(tmp_path, truths)
    assert caught.value.filename == str(tmp_path / "commit.json") and not list(tmp_path.iterdir())


def test_the_blind_generator_compiles_where_no_folder_can_be_written(monkeypatch):
    """As for a user without a home, whose program belongs to another user."""
    monkeypatch.setattr(CompileResultCacheImpl, "_locator_classes", [])
    assert march._compile(twice)(2.0) == 4.0
