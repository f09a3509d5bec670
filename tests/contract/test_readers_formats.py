"""Every format has what readers need: a module with ``read_raw``, a writer, a meaning, its own extensions."""

from collections import Counter
from importlib import import_module
from pathlib import Path

import pytest

from turnout.readers import FORMATS
from turnout.readers.writing import WRITERS


@pytest.mark.parametrize("name", FORMATS)
def test_a_format_has_a_module_with_a_documented_reader(name):
    module = import_module(f"turnout.readers.{FORMATS[name].module}")
    assert module.__doc__ and module.read_raw.__doc__
    assert FORMATS[name].meaning


def test_every_format_can_be_written_for_the_tests():
    assert set(FORMATS) == set(WRITERS)


def test_an_extension_belongs_to_one_format():
    counts = Counter(e for entry in FORMATS.values() for e in entry.extensions)
    assert max(counts.values()) == 1
    assert all(e == e.lower() and e.startswith(".") for e in counts)


def test_a_reader_imports_no_other_reader(repository):
    """A new format is one file and one line: formats share raw.py, variables.py, stamps.py and clock.py."""
    readers = {entry.module for entry in FORMATS.values()}
    folder = Path(repository) / "src" / "turnout" / "readers"
    for module in readers:
        text = (folder / f"{module}.py").read_text(encoding="utf-8")
        others = [other for other in readers - {module} if f"turnout.readers.{other} import" in text]
        assert not others, f"{module} imports {others}"
