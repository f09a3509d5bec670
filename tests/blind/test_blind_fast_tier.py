"""Forty opened cases are stored without their recordings: all match their hashes, and seeds generate them again."""

import io
import json
import platform
from zipfile import ZipFile

import numpy as np
import pytest
from benchmarks.blind_bridge import finding_rows

from turnout.config.campaign_notes import with_raw
from turnout.config.load import load_configuration
from turnout_blind.archive import plan_of, read_archive, verify_archive, verify_recordings
from turnout_blind.campaign import make_case
from turnout_blind.effect import load_effects
from turnout_blind.score.answers import answers_of
from turnout_blind.score.matching import judge
from turnout_blind.score.metrics import Share, figures

ZIP64 = 45  # version of the format that reading needs
SMALL = 120e3  # bytes of the kept set


@pytest.fixture(scope="module")
def stored_set(repository):
    folder = repository / "tests" / "blind" / "fast"
    if not folder.is_dir():
        pytest.skip("no kept set: turnout blind make --fast --seed 20261121, then turnout blind keep")
    assert (folder / "set.json.gz").stat().st_size < SMALL
    return read_archive(folder)


@pytest.fixture(scope="module")
def truths(stored_set):
    """Truths by case, each verified against its hash."""
    return verify_archive(stored_set)


def test_all_forty_cases_match_their_hashes_and_all_effects_follow_from_the_seed(truths):
    strata = [t["stratum"] for t in truths.values()]
    assert len(truths) == 40
    assert {s: strata.count(s) for s in set(strata)} == {
        "control": 10, "single": 17, "double": 3, "outside": 5, "unidentifiable": 5,
    }  # fmt: skip
    assert len({t["nonce"] for t in truths.values()}) == 40


def test_the_visibility_of_effects_grows_with_their_severity(truths):
    """The generator states a visibility for each stored single. It correlates with the rung over all kinds together."""
    single = [t for t in truths.values() if t["stratum"] == "single"]
    rungs = [t["effects"][0]["rung"] for t in single]
    seen = [max(t["visible"].values()) for t in single]
    ranks = [np.argsort(np.argsort(v)) for v in (rungs, seen)]
    assert np.corrcoef(*ranks)[0, 1] > 0.3
    assert all(max(t["visible"].values()) == 0.0 for t in truths.values() if not t["effects"])


def archives_as_sealed():
    """Whether numpy writes 64-bit sizes into the header of an archive member, as it does since Python 3.11.4."""
    file = io.BytesIO()
    np.savez(file, a=0.0)
    return ZipFile(file).infolist()[0].extract_version == ZIP64


@pytest.fixture(scope="module")
def control_case(stored_set, tmp_path_factory):
    """(id, folder of cases, truth) of the first control, generated again from its seed."""
    case = min(c for c, text in stored_set["truths"].items() if json.loads(text)["stratum"] == "control")
    folder = tmp_path_factory.mktemp("again")
    return case, folder, make_case(folder, case, plan_of(stored_set, case), load_effects())


@pytest.mark.slow
def test_a_case_that_is_generated_again_equals_the_sealed_case(stored_set, control_case):
    """Bit for bit, on a processor with the same arithmetic; others skip the test."""
    made_on = json.loads(stored_set["set"]).get("made_on")
    if made_on not in (None, platform.machine()):
        pytest.skip(f"sealed on {made_on}: another processor rounds otherwise")
    if not archives_as_sealed():
        pytest.skip(
            "this Python writes the heads of archives otherwise: bytes cannot be compared (sealed: 3.11.4 or later)"
        )
    case, folder, truth = control_case
    verify_recordings(stored_set, case, folder)
    assert truth["visible"] == json.loads(stored_set["truths"][case])["visible"]


def test_a_case_has_the_hammer_tests_and_the_trains_of_a_campaign(control_case):
    case, folder, _ = control_case
    raw = folder / case / "raw" / case
    assert len(list(raw.glob("hammer/*/*.npz"))) == 6 and len(list(raw.glob("passages/*.npz"))) == 8
    turnout = with_raw(load_configuration(folder / case / "config").turnout(case), folder / case / "raw")
    assert len(turnout.campaigns) == 2 and len(turnout.trains) == 8


@pytest.mark.slow
def test_the_diagnosis_names_no_effect_in_the_impacts_of_a_control(control_case):
    """Hammer tests alone, which take seconds. A release tests the whole campaign."""
    case, folder, _ = control_case
    answers = answers_of(finding_rows(folder / case, case, "hammer_only"))
    assert answers and not [a.names for a in answers if a.verdict == "named"]


def test_stored_answers_are_scored_with_their_truths(stored_set, truths):
    """If there are answers, all figures follow from the stored set alone, and no row is lost."""
    if stored_set["diagnosis"] is None:
        pytest.skip("no tool has spoken about the kept set yet: turnout blind diagnose, reveal, keep")
    judged = [
        judge(truths[c], answers_of(stored_set["rows"][c])) for c in truths if c in stored_set["diagnosis"]["cases"]
    ]
    found = {f.name: f for f in figures(judged)}
    assert sum(isinstance(f, Share) for f in found.values()) >= 15
    assert len(judged) == len(stored_set["diagnosis"]["cases"])
