"""The mismatch stage over a small fleet: on request, only new visits, faults in quarantine. Test order matters."""

import re
import shutil
import sys
from pathlib import Path

import pytest
import toy_fleet as toy

sys.path.insert(0, str(Path(__file__).parents[1] / "unit" / "stages"))
import small_turnout as small

pytestmark = pytest.mark.slow
LIGHT = '''"""The program's function with two effects, so that a turnout takes a second; one turnout has a fault."""
from functools import partial
from turnout.stages import mismatch
from turnout.mismatch.turnout import TrackCase
mismatch.TrackCase = partial(TrackCase, families=("local_ballast", "local_pad"))
def unit(unit, turnout, raw_root, context=None, algo=""):
    if unit.turnout == "t3":
        raise ZeroDivisionError("toy fault")
    return mismatch.mismatch_unit(unit, turnout, raw_root, context, algo)
'''
FUNCTION = "functions={mismatch: 'light:unit'}"
TERMS = """terms:
  - term: local_pad
    sleeper: {value: 18, unit: m, source: test}
    factor: {value: 0.3, unit: "-", source: test}
"""
REGISTRY = "results/registry/_generation.json"


def run(folder, *options):
    return toy.run(folder, FUNCTION, *options, function="", target=REGISTRY, cores=1)


def counts(done):
    """(known, processed, quarantined) of the stage; None if it did not run."""
    found = re.search(r"^mismatch \S+: (\d+) known, (\d+) processed, (\d+) quarantined", done.stdout, re.M)
    return tuple(map(int, found.groups())) if found else None


@pytest.fixture(scope="module")
def fleet(tmp_path_factory, repository):
    folder = tmp_path_factory.mktemp("diagnosed")
    config = small.write_configuration(folder, repository)
    small.write_hammer_tests(folder, small.soft_pad)
    (config / "turnouts.tsv").write_text("turnout\tlayout\nt1\tsmall\nt2\tsmall\nt3\tsmall\n")
    for name in ("t2", "t3"):
        shutil.copytree(folder / "raw/t1", folder / "raw" / name)
    (folder / "light.py").write_text(LIGHT)
    return folder


def test_no_turnout_is_diagnosed_without_a_request(fleet):
    assert counts(run(fleet)) is None
    assert not (fleet / "work/mismatch").exists()


def test_all_turnouts_are_diagnosed_on_request_and_a_fault_affects_only_its_turnout(fleet):
    done = run(fleet, "diagnose=true")
    assert counts(done) == (3, 3, 1)
    rows = toy.rows(fleet)
    assert {r[1] for r in rows["mismatch_findings"]} == {"t1", "t2"}
    assert any("toy fault" in str(r) and "internal_error" in r for r in rows["quarantine"])
    assert all(any(t in r for r in rows["mismatch_curves"]) for t in ("t1", "t2"))


def test_a_second_run_diagnoses_nothing(fleet):
    assert (counts(run(fleet, "diagnose=true")) or (3, 0, 0))[1] == 0


def test_an_accepted_effect_causes_a_new_diagnosis_of_its_turnout_only(fleet):
    text = (fleet / "config/tracks/small.yaml").read_text()
    (fleet / "config/tracks/t2.yaml").write_text(text + TERMS)
    assert counts(run(fleet, "diagnose=true"))[1] == 1
    rows = toy.rows(fleet)["mismatch_parameters"]
    assert any("t2" in r and True in r for r in rows)


def test_a_setting_requests_the_diagnosis_of_one_turnout_only(fleet):
    (fleet / "config/overrides").mkdir()
    (fleet / "config/overrides/t2.yaml").write_text("settings: {mismatch: {enabled: true}}\n")
    done = run(fleet)
    assert counts(done)[:2] == (1, 1)


def test_a_new_campaign_is_a_new_visit_and_the_old_visit_is_kept(fleet):
    small.write_hammer_tests(fleet, small.soft_pad, day=small.DAY.replace(month=9), seed=9, turnout="t2")
    assert counts(run(fleet))[1] == 1
    found = {r for r in toy.rows(fleet)["mismatch_findings"] if "t2" in r}
    assert {v for r in found for v in r} >= {"2026-07-25", "2026-09-25"}
