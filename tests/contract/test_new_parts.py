"""A new reader needs one file and one line, a new view one file (a panel: tests/unit/report/test_turnout_page.py)."""

import shutil
from importlib.resources import files

import duckdb
import numpy as np
import pytest

import turnout.readers
from turnout.readers import formats, read
from turnout.records import RawChannel, RawDescription
from turnout.registry import view_texts
from turnout.registry.job import register

READER = '''"""Reader of a format with one channel: the rate in the first line, then one sample in each line."""

import numpy as np

from turnout.readers.source import RawFile, RawRecord, Source
from turnout.readers.rate_statements import Entry


def read_raw(source: Source) -> RawFile:
    """The only record of the file."""
    first, *lines = source.path.read_text().split()
    rate = Entry("line 1", "sampling rate [Hz]", float(first))
    return RawFile((RawRecord(("force",), (np.array(lines, dtype=float),), units=("kN",), entries=(rate,)),))
'''

VIEW = """-- A row per section: how many models it has.
-- needs: models_current
create or replace view models_of_sections as
    select section_id, count(*) as n from models_current group by section_id;

-- columns of models_of_sections
-- section_id | varchar | | section
-- n | bigint | models | how many models the section has
"""


def test_a_new_reader_needs_one_file_and_one_line(tmp_path, monkeypatch):
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "one_channel.py").write_text(READER)
    monkeypatch.setattr(turnout.readers, "__path__", [*turnout.readers.__path__, str(tmp_path / "package")])
    line = formats.Format("one_channel", (".one",), meaning="one channel")
    monkeypatch.setitem(formats.FORMATS, "one_channel", line)
    samples = np.array([0.0, 2.5, -1.0, 0.5])
    (tmp_path / "A7_1.one").write_text("\n".join(map(str, [20_000, *samples])))
    channel = RawChannel("force", "force", "force", unit="kN")
    recording = read("A7_1.one", tmp_path, RawDescription((channel,), rate=20_000.0)).recordings[0]
    np.testing.assert_allclose(recording.signal("force"), 1e3 * samples)  # kN in the file, N in a recording


@pytest.fixture
def views_folder(tmp_path, monkeypatch):
    """A folder of views to which a file can be added."""
    folder = tmp_path / "registry_package"
    shutil.copytree(str(files("turnout.registry")), folder, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    monkeypatch.setattr(
        view_texts, "files", lambda package: folder if package == "turnout.registry" else files(package)
    )
    for name, function in list(vars(view_texts).items()):
        if hasattr(function, "cache_clear"):  # a value that is cached now would contain the added view
            monkeypatch.setattr(view_texts, name, function.__wrapped__)
    return folder / "views"


def test_a_new_view_needs_one_file(views_folder, tmp_path):
    (views_folder / "models_of_sections.sql").write_text(VIEW)
    register([], tmp_path / "registry", read=iter)
    with duckdb.connect(str(tmp_path / "registry" / "registry.duckdb"), read_only=True) as connection:
        assert connection.sql("select * from models_of_sections").columns == ["section_id", "n"]
        comments = "select comment from duckdb_columns() where table_name = 'models_of_sections' and column_name = 'n'"
        assert connection.sql(comments).fetchall() == [("how many models the section has [models]",)]
