"""The notebooks of the documentation run from the first cell to the last and find what they promise."""

import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"


@pytest.fixture
def after(tmp_path, monkeypatch):
    """Names after all cells of a notebook ran in an empty folder."""
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


def test_a_file_leads_to_two_modes(after):
    modes = {mode.band: mode for mode in after("file_to_modes")["model"].modes}
    assert set(modes) == {"ballast", "railpad"}
    assert modes["ballast"].frequency == pytest.approx(155.5, abs=3.0)  # as docs/api.md prints for this file
    assert modes["railpad"].frequency == pytest.approx(611.8, abs=3.0)


def test_passages_lead_to_the_gap_of_the_sleeper(after):
    names = after("passages_to_mismatch")
    assert names["diagnosis"].verdicts[0].names == ("hanging_sleeper",)
    assert names["gap"] == pytest.approx(0.8e-3, rel=0.01)  # the gap with which the passages were made


def test_notebooks_hold_no_outputs():
    """They are shown as they are typed; the site and the tests run the same text."""
    notebooks = sorted(FOLDER.glob("*.ipynb"))
    assert notebooks
    for path in notebooks:
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            assert not cell.get("outputs") and cell.get("execution_count") is None
