"""A package that is missing or broken is a fault of the installation and of no file."""

import builtins
import errno
import os
import resource
import sys

import pytest

from turnout.errors import InstallationError, ReadError, installation_error, is_infrastructure
from turnout.readers import names_and_units, read
from turnout.readers.writing import write

# Formats with the package that reads them. The modules of the readers import it again.
PACKAGES = {
    "hdf5": "h5py", "mat73": "h5py", "mat": "scipy.io", "tdms": "nptdms", "wav": "soundfile", "parquet": "pyarrow",
}  # fmt: skip
# What the import of a package raises: absent, a library of the system absent, built for another numpy, half installed.
BROKEN = {
    "absent": lambda name: ModuleNotFoundError(f"No module named {name!r}", name=name),
    "no shared library": lambda name: ImportError("libx.so.3: cannot open shared object file"),
    "no library": lambda name: OSError("sndfile library not found"),
    "other numpy": lambda name: ValueError("numpy.dtype size changed, may indicate binary incompatibility"),
    "half installed": lambda name: AttributeError("partially initialized module"),
}


@pytest.fixture
def broken_package(monkeypatch, tmp_path):
    """Function that replaces a package by one whose import raises the given exception."""

    def put(name, error):
        package = name.split(".")[0]
        for module in [m for m in sys.modules if m.split(".")[0] == package or m.startswith("turnout.readers.")]:
            if module.split(".")[0] == package or module.rsplit(".", 1)[-1] in {*PACKAGES, "mat"}:
                monkeypatch.delitem(sys.modules, module)
        (tmp_path / "site" / package).mkdir(parents=True)
        (tmp_path / "site" / package / "__init__.py").write_text("import builtins\nraise builtins.broken_import\n")
        monkeypatch.setattr(builtins, "broken_import", error, raising=False)
        monkeypatch.syspath_prepend(tmp_path / "site")

    return put


@pytest.mark.parametrize("kind", BROKEN)
@pytest.mark.parametrize("format", ["hdf5", "tdms", "wav"])
def test_a_broken_package_is_a_fault_of_the_installation(
    format, kind, hammer_test, in_si, name_of, tmp_path, broken_package
):
    path = write(hammer_test[:1] if format == "wav" else hammer_test, tmp_path / name_of(format), format)
    package = PACKAGES[format]
    broken_package(package, BROKEN[kind](package))
    with pytest.raises(InstallationError, match=f"(?i)pip install --force-reinstall {package}"):
        read(path.name, tmp_path, in_si)
    with pytest.raises(InstallationError):
        names_and_units(path.name, tmp_path)


@pytest.mark.parametrize("error", [OSError(errno.EMFILE, "Too many open files"), MemoryError()], ids=repr)
def test_a_fault_of_the_machine_during_an_import_is_reported_as_such(
    error, hammer_test, in_si, name_of, tmp_path, broken_package
):
    path = write(hammer_test, tmp_path / name_of("tdms"), "tdms")
    broken_package("nptdms", error)
    with pytest.raises(type(error)) as caught:
        read(path.name, tmp_path, in_si)
    assert is_infrastructure(caught.value) and installation_error(caught.value) is None


def failing_with(error):
    def fail(*_, **__):
        raise error

    return fail


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (ModuleNotFoundError("No module named 'lz4'", name="lz4"), InstallationError),
        (ImportError("DLL load failed"), InstallationError),
        (OSError(errno.EMFILE, "Too many open files"), OSError),
        (OSError(errno.ENFILE, "Too many open files in system"), OSError),
        (OSError(errno.ENOSPC, "No space left on device"), OSError),
        (OSError(errno.EACCES, "Permission denied"), PermissionError),
        (OSError(errno.ESTALE, "Stale file handle"), OSError),
        (MemoryError(), MemoryError),
        (KeyboardInterrupt(), KeyboardInterrupt),
        (ValueError("bad header"), ReadError),
        (RecursionError(), ReadError),
        (EOFError(), ReadError),
    ],
    ids=repr,
)
@pytest.mark.parametrize("place", ["turnout.readers.npz.np.load", "turnout.readers.npz.read_raw"])
def test_an_exception_is_assigned_to_the_installation_the_machine_or_the_file(
    error, expected, place, hammer_test, in_si, name_of, tmp_path, monkeypatch
):
    """Only exceptions that damaged bytes can cause are errors of the file."""
    path = write(hammer_test, tmp_path / name_of("npz"), "npz")
    monkeypatch.setattr(place, failing_with(error))
    with pytest.raises(expected):
        read(path.name, tmp_path, in_si)


@pytest.mark.parametrize("place", ["turnout.readers.npz.np.load", "turnout.readers.npz.read_raw"])
def test_an_interrupt_that_a_library_converts_to_an_exception_is_raised_as_interrupt(
    place, hammer_test, in_si, name_of, tmp_path, monkeypatch
):
    path = write(hammer_test, tmp_path / name_of("npz"), "npz")

    def fail(*_, **__):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt:
            raise RuntimeError("callback failed")  # noqa: B904

    monkeypatch.setattr(place, fail)
    with pytest.raises(KeyboardInterrupt):
        read(path.name, tmp_path, in_si)


@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("nptdms.tdms", "npTDMS"),
        ("sklearn", "scikit-learn"),
        ("turnout.readers.tdms", "Install Turnout again"),
        ("_lzma", "Install Python again"),
        (None, "Install Turnout again"),
    ],
)
def test_the_remedy_states_what_to_install(module, words):
    assert words in str(installation_error(ImportError("gone", name=module)))


def test_the_cause_of_an_exception_is_used():
    try:
        try:
            raise ImportError("no h5py", name="h5py")
        except ImportError as error:
            raise RuntimeError("cannot read") from error
    except RuntimeError as error:
        assert "h5py" in str(installation_error(error))


@pytest.mark.parametrize("format", ["uff58", "tdms", "mat", "mat73", "hdf5", "wav", "lvm", "npz", "parquet", "csv"])
def test_too_many_open_files_are_no_fault_of_a_file(format, hammer_test, in_si, name_of, tmp_path):
    path = write(hammer_test[:1] if format == "wav" else hammer_test, tmp_path / name_of(format), format)
    n_whole = len(read(path.name, tmp_path, in_si).recordings)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    os.close(first_free := os.open(os.devnull, os.O_RDONLY))
    outcomes = []
    for n_free in range(6):
        resource.setrlimit(resource.RLIMIT_NOFILE, (first_free + n_free, hard))
        try:
            outcomes.append(len(read(path.name, tmp_path, in_si).recordings))
        except OSError as error:
            assert is_infrastructure(error)
            outcomes.append(None)
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert set(outcomes) == {None, n_whole}
