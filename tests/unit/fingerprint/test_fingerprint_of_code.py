"""The fingerprint changes with code that affects results, and with nothing else."""

import shutil

import pytest

import turnout.fingerprint as fp

CORE = '''"""Words."""
from turnout.low import g


def f(x):
    """More words."""
    return g(x) + 1.0  # why
'''
FORMATS = """
from importlib import import_module


def read(name):
    return import_module(f'turnout.formats.{name}')
"""
FILES = {
    "__init__.py": "",
    "core.py": CORE,
    "low.py": "def g(x):\n    return 2.0 * x\n",
    "other.py": "def h(x):\n    return x\n",
    "typed.py": "if TYPE_CHECKING:\n    from turnout.low import g\nelse:\n    from turnout.other import h\n",
    "plots.py": "A = 1\n",
    "drawn.py": "def plot():\n    from turnout.plots import A\n",
    "late.py": "def f(x):\n    from turnout.low import g\n    return g(x)\n",
    "formats/__init__.py": FORMATS,
    "formats/one.py": "A = 1\n",
    "table/__init__.py": "from pathlib import Path\n",
    "table/columns.csv": "a,b\n",
    "pages/__init__.py": "",
    "pages/write.py": 'FOLDER = "templates"\n',
    "pages/words.py": "W = 1\n",
    "pages/templates/page.html": "<p>\n",
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    root = tmp_path / "turnout"
    for name, text in FILES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    monkeypatch.setattr(fp, "ROOT", root)
    fp.clear_caches()
    yield root
    fp.clear_caches()


def is_changed(package, module, name, old, new):
    before = fp.fingerprint(module)
    text = (package / name).read_text()
    assert old in text
    (package / name).write_text(text.replace(old, new))
    fp.clear_caches()
    return fp.fingerprint(module) != before


@pytest.mark.parametrize(
    "module, name, old, new",
    [
        ("turnout.core", "core.py", "1.0", "1.5"),
        ("turnout.core", "low.py", "2.0", "3.0"),
        ("turnout.late", "low.py", "2.0", "3.0"),
        ("turnout.typed", "other.py", "return x", "return -x"),
        ("turnout.formats", "formats/one.py", "A = 1", "A = 2"),
        ("turnout.table", "table/columns.csv", "a,b", "a,c"),
        ("turnout.core", "core.py", "def f(x)", "def f(x, y=0)"),
        ("turnout.pages.write", "pages/templates/page.html", "<p>", "<b>"),
    ],
)
def test_a_change_of_code_or_data_changes_the_fingerprint(package, module, name, old, new):
    assert is_changed(package, module, name, old, new)


@pytest.mark.parametrize(
    "module, name, old, new",
    [
        ("turnout.core", "core.py", "# why", "# because"),
        ("turnout.core", "core.py", "More words.", "Fewer."),
        ("turnout.core", "core.py", "    return", "\n    return"),
        ("turnout.core", "other.py", "return x", "return -x"),
        ("turnout.low", "core.py", "1.0", "1.5"),
        ("turnout.typed", "low.py", "2.0", "3.0"),
        ("turnout.drawn", "plots.py", "A = 1", "A = 2"),
        ("turnout.typed", "typed.py", "import g", "import g as k"),
        ("turnout.pages.words", "pages/templates/page.html", "<p>", "<b>"),
    ],
)
def test_a_change_of_comments_docstrings_or_unused_modules_does_not_change_the_fingerprint(
    package, module, name, old, new
):
    assert not is_changed(package, module, name, old, new)


def test_the_texts_of_reasons_affect_only_the_fingerprints_of_registry_and_report():
    """Otherwise, a changed word in one text would make the next nightly run compute every turnout again."""
    assert "turnout.reasons" not in fp.closure("turnout.stages.hammer", "turnout.stages.mismatch")
    assert fp.fingerprint("turnout.errors", "turnout.reasons") != fp.fingerprint("turnout.errors")
    for rule in ("registry", "report"):
        text = (fp.ROOT.parents[1] / f"rules/{rule}.smk").read_text(encoding="utf-8")
        assert f'fingerprint("turnout.{rule}.job", "turnout.reasons")' in text


def test_an_unknown_module_is_an_error(package):
    with pytest.raises(ValueError, match=r"no module turnout\.nothing"):
        fp.fingerprint("turnout.nothing")


def test_the_fingerprint_does_not_depend_on_the_folder_of_the_package(package, tmp_path, monkeypatch):
    before = fp.fingerprint("turnout.core")
    shutil.move(package, tmp_path / "elsewhere")
    monkeypatch.setattr(fp, "ROOT", tmp_path / "elsewhere")
    fp.clear_caches()
    assert fp.fingerprint("turnout.core") == before


def test_the_fingerprint_of_the_hammer_stage_covers_the_modules_that_it_uses():
    fp.clear_caches()
    found = fp.closure("turnout.stages.hammer")
    assert {"turnout.hammer_test", "turnout.modal", "turnout.readers.uff", "turnout.signal.spectra"} <= found
    assert not {
        m for m in found if m.startswith(("turnout.report", "turnout.trend", "turnout.workflow", "turnout.cli.main"))
    }


def test_an_unchanged_module_is_parsed_once(package, monkeypatch):
    first = fp.fingerprint("turnout.core", "turnout.pages.write")
    fp.clear_caches()
    monkeypatch.setattr(fp.ast, "parse", lambda source: pytest.fail("parsed again"))
    assert fp.fingerprint("turnout.core", "turnout.pages.write") == first


@pytest.mark.parametrize("damage", [b"", b"{}", b'{"sha256": "", "modules": []}', None])
def test_a_damaged_cache_is_not_used(package, damage):
    first = fp.fingerprint("turnout.core")
    file = package / "__pycache__" / "fingerprints.cache"
    if damage is None:  # a digest that does not belong to the module
        digest = fp.json.loads(file.read_text())["modules"]["turnout.low"][1]
        damage = file.read_bytes().replace(digest.encode(), digest[::-1].encode())
    file.write_bytes(damage)
    fp.clear_caches()
    assert fp.fingerprint("turnout.core") == first


def test_a_package_in_a_read_only_folder_has_a_fingerprint(package, tmp_path, monkeypatch):
    first = fp.fingerprint("turnout.core")
    shutil.rmtree(package / "__pycache__")
    (package / "__pycache__").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "turnout" / "core.py"))
    fp.clear_caches()
    assert fp.fingerprint("turnout.core") == first
