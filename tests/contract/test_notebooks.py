"""The notebooks of the documentation run from the first cell to the last and give the stated results."""

import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"


@pytest.fixture
def run_notebook(tmp_path, monkeypatch):
    """Function that runs all cells of a notebook in an empty folder and returns the names that they define."""
    import matplotlib

    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)

    def run(name):
        names = {}
        for cell in json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]:
            if cell["cell_type"] == "code":
                exec(compile("".join(cell["source"]), f"{name}.ipynb, {cell['id']}", "exec"), names)
        return names

    return run


def test_the_notebook_on_files_finds_two_modes(run_notebook):
    modes = {mode.band: mode for mode in run_notebook("file_to_modes")["model"].modes}
    assert set(modes) == {"ballast", "railpad"}
    assert modes["ballast"].frequency == pytest.approx(155.5, abs=3.0)  # the value of docs/api.md for this file
    assert modes["railpad"].frequency == pytest.approx(611.8, abs=3.0)


def test_the_notebook_on_passages_finds_the_gap_of_the_sleeper(run_notebook):
    names = run_notebook("passages_to_mismatch")
    assert names["diagnosis"].verdicts[0].names == ("hanging_sleeper",)
    assert names["gap"] == pytest.approx(0.8e-3, rel=0.01)  # the gap in the simulation of the passages


def test_notebooks_contain_no_outputs():
    """Notebooks contain only their text and code; the site and the tests run the same code."""
    notebooks = sorted(FOLDER.glob("*.ipynb"))
    assert notebooks
    for path in notebooks:
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            assert not cell.get("outputs") and cell.get("execution_count") is None
