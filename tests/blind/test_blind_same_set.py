"""A seed gives the same hashes again, and a set for one tool rejects other tools. The cases here are stand-ins."""

import json
import shutil
from concurrent.futures import ThreadPoolExecutor

import pytest

from turnout_blind.diagnose import diagnose_set
from turnout_blind.make import make_set
from turnout_blind.seal import BlindError, digest, verify


@pytest.fixture
def small_cases(monkeypatch):
    """Cases of one file without a simulation."""

    def make_small_case(folder, case, plan, effects):
        (folder / case).mkdir(parents=True)
        (folder / case / "raw.txt").write_text(f"{plan.seed}")
        return {"case": case, "stratum": plan.stratum, "effects": []}

    monkeypatch.setattr("turnout_blind.make.make_case", make_small_case)
    monkeypatch.setattr("turnout_blind.make.ProcessPoolExecutor", ThreadPoolExecutor)


def tool_is(monkeypatch, sha):
    for module in ("make", "diagnose"):
        monkeypatch.setattr(f"turnout_blind.{module}.digest_of_folder", lambda folder, pattern="*": sha)


def test_a_lost_set_is_generated_again_from_its_seed_with_the_same_hashes(small_cases, tmp_path):
    shas = [make_set(tmp_path / str(k), tmp_path / f"truth{k}", seed, limit=5) for k, seed in enumerate((7, 7, 8))]
    assert shas[0] == shas[1] != shas[2]
    shutil.copytree(tmp_path / "truth1", tmp_path / "instead")
    assert verify(tmp_path / "0", tmp_path / "instead").keys() == verify(tmp_path / "0", tmp_path / "truth0").keys()


def test_the_seed_of_a_set_for_a_tool_follows_from_the_sources_of_the_tool(small_cases, tmp_path, monkeypatch):
    seeds = []
    for k, sha in enumerate(("a" * 64, "a" * 64, "b" * 64)):
        tool_is(monkeypatch, sha)
        make_set(tmp_path / str(k), tmp_path / f"truth{k}", "tool", limit=2)
        seeds.append(json.loads((tmp_path / f"truth{k}" / "set.json").read_text())["seed"])
        assert json.loads((tmp_path / str(k) / "commit.json").read_text())["examines"] == sha
    assert seeds[0] == seeds[1] == int(digest(b"turnout blind " + b"a" * 64)[:15], 16) != seeds[2]


@pytest.mark.parametrize(("tool", "is_rejected"), [("a" * 64, False), ("b" * 64, True)])
def test_a_set_for_one_tool_rejects_another_tool(small_cases, tmp_path, monkeypatch, tool, is_rejected):
    tool_is(monkeypatch, "a" * 64)
    make_set(tmp_path / "set", tmp_path / "truth", "tool", limit=1)
    tool_is(monkeypatch, tool)
    command = '{python} -c "print(\'[{{\\"verdict\\": \\"none\\"}}]\')"'
    if is_rejected:
        with pytest.raises(BlindError, match="examines: made for another tool"):
            diagnose_set(tmp_path / "set", tmp_path / "truth", command, report=lambda text: None)
        assert not (tmp_path / "set" / "findings").exists()
    else:
        held = diagnose_set(tmp_path / "set", tmp_path / "truth", command, report=lambda text: None)
        assert [run["status"] for run in held["cases"].values()] == ["answered"]
