"""A small blind set from end to end: it is written, sealed, hidden, opened and scored."""

import json
import re
import shutil
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.cli.main import main
from turnout.config.campaign_notes import with_raw
from turnout.config.load import load_configuration
from turnout.readers import read
from turnout_blind.archive import read_archive, verify_archive, verify_recordings, write_archive
from turnout_blind.campaign import stage
from turnout_blind.diagnose import diagnose_set
from turnout_blind.effect import load_effects
from turnout_blind.isolation import HiddenFolders, isolation_method
from turnout_blind.make import make_set
from turnout_blind.record import hammer_test
from turnout_blind.reveal import reveal
from turnout_blind.score import case_reports
from turnout_blind.score.case_reports import _plot_track
from turnout_blind.score.page import BEGIN, END, write_page
from turnout_blind.score.plots import pyplot
from turnout_blind.score.report import report_text
from turnout_blind.seal import BlindError, digest, verify
from turnout_blind.site import draw_site

pytestmark = pytest.mark.slow


def with_two_passages(plan, effects):
    """As ``stage``, with two of the eight passages, since a passage and the visibility in it take a second each."""
    rng, site, world, concealed = stage(plan, effects)
    return rng, replace(site, passages=site.passages[:2]), world, concealed


@pytest.fixture(scope="module")
def small_set(tmp_path_factory):
    """(out, truth) of a control and a single, generated once. test_blind_fast_tier has a whole case."""
    folder = tmp_path_factory.mktemp("blind")
    out, truth = folder / "set", folder / "truth"
    seed = 57  # whose first two cases in shuffled order are a control and a single
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("turnout_blind.campaign.stage", with_two_passages)
        patch.setattr("turnout_blind.make.ProcessPoolExecutor", ThreadPoolExecutor)  # which has what is patched
        make_set(out, truth, seed, only={"pad"}, limit=2)
    return out, truth


@pytest.fixture
def copy(small_set, tmp_path, monkeypatch):
    """A copy of the set that a test may change; the tool counts as unchanged while its files are edited."""
    monkeypatch.setattr("turnout_blind.diagnose.digest_of_folder", lambda folder: "frozen")
    out, truth = tmp_path / "set", tmp_path / "truth"
    shutil.copytree(small_set[0], out)
    shutil.copytree(small_set[1], truth)
    return out, truth


def cases(out):
    return sorted((out / "cases").iterdir())


def test_a_user_of_the_project_can_read_the_case(small_set):
    for case in cases(small_set[0]):
        turnout = with_raw(load_configuration(case / "config").turnout(case.name), case / "raw")
        assert len(turnout.campaigns) == 2
        assert len(turnout.trains) == 2
        raw = case / "raw" / case.name
        passages = sorted(raw.glob("passages/*.npz"))
        assert len(passages) == 2
        for path in passages:
            result = read(path, case / "raw", turnout.passages.description)
            assert not result.errors
            recording = result.recordings[0]
            assert (recording.rate, recording.n_sample, len(recording.channels)) == (5000.0, 17500, 4)
            assert 1.0 < np.abs(recording.samples).max() < 1000.0
            assert "rail_temperature" in recording.conditions
        tests = sorted(raw.glob("hammer/*/*.npz"))
        assert len(tests) == 6
        for path in tests[:2]:
            result = read(path, case / "raw", turnout.hammer.descriptions[path.stem.split("_")[0]])
            assert not result.errors
            assert len(result.recordings) == 6
            assert all(3e3 < r.signal("force").max() < 22.3e3 for r in result.recordings)


def test_names_sizes_and_times_of_files_do_not_reveal_the_stratum(small_set):
    """Listings of two cases differ only in the id and in the middle section that has no impacts."""
    listings = []
    for case in cases(small_set[0]):
        files = [p for p in sorted(case.rglob("*.npz"))]
        listings.append(sorted((p.parent.name, p.stat().st_size, p.stat().st_mtime) for p in files))
    # the size of a passage depends on the length of the train's name, which trains.csv states
    assert listings[0] == listings[1]
    words = {k for k in load_effects() if k not in ("pad", "ballast", "position", "gain")}
    for path in (p for case in cases(small_set[0]) for p in case.rglob("*") if p.is_file() and p.suffix != ".npz"):
        text = f"{path.name}\n{path.read_text()}"
        assert not [w for w in words if re.search(rf"(?<![a-z]){w}(?![a-z])", text)], path  # "heel" is part of "wheel"


def test_the_same_seed_gives_the_same_samples():
    tests = []
    for _ in range(2):
        rng = np.random.default_rng([3, 1])
        site = draw_site(rng)
        tests.append(hammer_test(site, site.world, 0, site.hammer_positions[0], rng, {}))
    assert len(tests[0]) > 1 and all(np.array_equal(a.samples, b.samples) for a, b in zip(*tests, strict=True))


def test_verification_accepts_intact_cases_and_rejects_added_and_changed_files(copy):
    out, truth = copy
    assert {t["stratum"] for t in verify(out, truth).values()} == {"control", "single"}
    case = cases(out)[0]
    (case / "raw" / "more.txt").write_text("x")
    with pytest.raises(BlindError, match=r"more\.txt: a file that was added"):
        verify(out, truth)
    (case / "raw" / "more.txt").unlink()
    notes = next(case.rglob("trains.csv"))
    notes.write_text(notes.read_text().replace("main", "Main", 1))
    with pytest.raises(BlindError, match=r"trains\.csv: not the sealed content"):
        verify(out, truth)


def test_verification_rejects_a_truth_that_was_changed_after_sealing(copy):
    out, truth = copy
    path = truth / f"{cases(out)[0].name}.json"
    held = json.loads(path.read_text())
    path.write_text(json.dumps({**held, "stratum": held["stratum"] + " "}, indent=1, sort_keys=True) + "\n")
    with pytest.raises(BlindError, match="not the truth that was sealed"):
        verify(out, truth)


def test_a_nonce_prevents_a_guess_of_the_truth_from_its_hash(small_set):
    """The hash of a control differs from that of the same text without its nonce, and each truth has its own nonce."""
    truths = verify(*small_set)
    control = next(t for t in truths.values() if t["stratum"] == "control")
    nonces = {t["nonce"] for t in truths.values()}
    assert len(nonces) == len(truths)
    assert all(len(bytes.fromhex(n)) == 16 for n in nonces)
    bare = {k: v for k, v in control.items() if k != "nonce"}
    sealed = json.loads((small_set[0] / "commit.json").read_text())["cases"][control["case"]]["truth_sha256"]
    assert digest(json.dumps(bare, indent=1, sort_keys=True).encode() + b"\n") != sealed


SPY = """
import json, os, sys
case, folder, out, truth = sys.argv[1:]
seen = [f for _, _, files in os.walk(truth) for f in files]
try:
    open(os.path.join(truth, case + ".json")).read()
    seen.append("opened")
except OSError:
    pass
try:
    import turnout_blind.campaign
    seen.append("generator")
except ImportError:
    pass
assert os.path.exists(os.path.join(folder, "config", "turnouts.tsv"))
json.dump([{"verdict": "none", "probability": 0.5, "sentence": " ".join(seen)}], open(out, "w"))
"""


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_the_tool_sees_neither_truth_nor_generator(copy, tmp_path):
    out, truth = copy
    spy = tmp_path / "spy.py"
    spy.write_text(SPY)
    command = f"{{python}} {spy} {{case}} {{folder}} {{out}} {truth}"
    held = diagnose_set(out, truth, command, report=lambda line: None)
    assert not any(held["canary"].values())
    for path in (out / "findings").glob("*.json"):
        sentence = json.loads(path.read_text())[0]["sentence"]
        assert sentence == "" if held["isolation"] == "unshare" else "opened" not in sentence
    assert (truth / "set.json").exists()  # outside the isolation the folder is still there
    assert len(reveal(out, truth)) == 2
    report = report_text([out])
    assert "| controls: false alarms | 0.0 % (0) | 0.0 to 97.5 % | 1 | <= 3.33 % | met |" in report
    spoilt = next((out / "findings").glob("*.json"))
    spoilt.write_text('[{"verdict": "named"}]')
    with pytest.raises(BlindError, match="not the rows that the tool wrote"):
        report_text([out])


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_a_tool_that_fails_is_counted_and_not_hidden(copy):
    out, truth = copy
    held = diagnose_set(out, truth, "{python} -c 'raise SystemExit(3)'", report=lambda line: None)
    assert {run["status"] for run in held["cases"].values()} == {"failed"}
    reveal(out, truth)
    assert "| cases without an answer | 100.0 % (2)" in report_text([out])


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_rows_are_read_from_the_output_of_the_tool(copy, tmp_path):
    """It prints notes and then its row in the folder of the case. Other output is a failure and is stored."""
    out, truth = copy
    one, other = (c.name for c in cases(out))
    tool, row = tmp_path / "tool.py", 'print(5)\nprint("{\\n\\"verdict\\": \\"none\\"}")\nprint("page: x.html")'
    tool.write_text("import os; print(os.listdir())")
    held = diagnose_set(out, truth, f"{{python}} {tool}", [one], report=lambda line: None)
    assert held["cases"][one]["status"] == "failed"  # a list in Python syntax is no JSON
    assert held["cases"][one]["said"].startswith("printed no rows; [")
    tool.write_text(row)
    held = diagnose_set(out, truth, f"{{python}} {tool}", [other], report=lambda line: None)
    assert held["cases"][other]["status"] == "answered"
    assert json.loads((out / "findings" / f"{other}.json").read_text()) == [{"verdict": "none"}]
    held = diagnose_set(out, truth, f"{{python}} {tool}", report=lambda line: None, again=True)
    assert {run["status"] for run in held["cases"].values()} == {"answered"}


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_one_command_diagnoses_all_cases_of_a_set_before_it_is_opened(copy):
    """An empty list is no answer. Another command, and a diagnosis of an opened set, are rejected."""
    out, truth = copy
    one, other = (c.name for c in cases(out))
    held = diagnose_set(out, truth, "{python} -c 'print([])'", [one], report=lambda line: None)
    assert held["cases"][one]["status"] == "failed"
    with pytest.raises(BlindError, match="another command"):
        diagnose_set(out, truth, "{python} -c 'print(1)'", [other], report=lambda line: None)
    reveal(out, truth)
    with pytest.raises(BlindError, match="this set is open"):
        diagnose_set(out, truth, "{python} -c 'print([])'", [other], report=lambda line: None)
    spy = f"{{python}} -c 'import os; print(os.listdir(\"{out}/revealed\"))'"
    held = diagnose_set(out, truth, spy, [one], report=lambda line: None, label="spy")
    if held["isolation"] == "unshare":
        assert held["cases"][one]["said"] == "[]"


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
@pytest.mark.parametrize(
    ("code", "budget", "output"),
    [
        ("import time; time.sleep(60)", {"timeout": 2.0}, "no answer within 2 s of the clock"),
        ("while True: pass", {"cpu": 1.0}, "no answer within 1 s of the processor"),
    ],
)
def test_a_case_that_exceeds_its_budget_has_no_answer(copy, code, budget, output):
    out, truth = copy
    held = diagnose_set(out, truth, f"{{python}} -c '{code}'", report=lambda line: None, workers=2, **budget)
    assert {(run["status"], run["said"]) for run in held["cases"].values()} == {("over budget", output)}
    reveal(out, truth)
    assert "| controls: false alarms | 0.0 % (0)" in report_text([out])


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_files_that_the_tool_writes_beside_the_case_do_not_change_its_hash(copy):
    out, truth = copy
    code = (
        'import os, json; os.makedirs("results/pages"); open("raw/x", "w"); print(json.dumps([dict(verdict="none")]))'
    )
    held = diagnose_set(out, truth, f"{{python}} -c '{code}'", report=lambda line: None)
    assert {run["status"] for run in held["cases"].values()} == {"answered"}
    assert len(verify(out, truth)) == 2
    assert not list((out / "copies").iterdir())


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_an_interrupted_diagnosis_ends_at_once_and_continues(copy, tmp_path):
    """Formerly it waited for the case that ran, for half an hour at most, and its answer was thrown away."""
    out, truth = copy
    first, second = (c.name for c in cases(out))
    tool = tmp_path / "tool.py"
    tool.write_text(
        f"import sys, time\nif sys.argv[1] == {second!r}:\n    time.sleep(60)\n"
        'print("[{\\"verdict\\": \\"none\\"}]")\n'
    )
    lines = []

    def press(finished, total):
        yield next(finished)
        start.append(time.monotonic())
        raise KeyboardInterrupt

    start, command = [], f"{{python}} {tool} {{case}}"
    with pytest.raises(KeyboardInterrupt):
        diagnose_set(out, truth, command, report=lines.append, progress=press)
    assert time.monotonic() - start[0] < 20.0
    assert lines == [f"{first}: 1 row printed"]
    record = json.loads((out / "diagnosis.json").read_text())
    assert set(record["cases"]) == {first}
    assert not list((out / "copies").iterdir())
    tool.write_text('print("[{\\"verdict\\": \\"none\\"}]")')
    lines.clear()
    held = diagnose_set(out, truth, command, report=lines.append)
    assert lines == [f"{second}: 1 row printed"]
    assert {run["status"] for run in held["cases"].values()} == {"answered"}


def test_an_interrupted_generation_of_a_set_continues(small_set, tmp_path, monkeypatch):
    """The complete case stays, the incomplete one is generated again. Another seed or other sources are rejected."""
    out, truth = tmp_path / "set", tmp_path / "truth"
    shutil.copytree(small_set[0], out)
    shutil.copytree(small_set[1], truth)
    sealed = (out / "commit.json").read_bytes()
    (out / "commit.json").unlink()
    kept, lost = cases(out)
    (truth / f"{lost.name}.json").unlink()  # stopped between recording and truth
    with pytest.raises(BlindError, match=r"seed: begun otherwise"):
        make_set(out, truth, 20, only={"pad"}, limit=2)
    made_again = []
    monkeypatch.setattr("turnout_blind.make._make", lambda job: made_again.append(job[2]))
    monkeypatch.setattr("turnout_blind.make.ProcessPoolExecutor", ThreadPoolExecutor)
    (truth / f"{lost.name}.json").write_text("{}")
    shutil.rmtree(lost)
    with pytest.raises(BlindError, match="a set is there already"):
        (out / "commit.json").write_bytes(sealed)
        make_set(out, truth, only={"pad"}, limit=2)
    (out / "commit.json").unlink()
    make_set(out, truth, only={"pad"}, limit=2)
    assert made_again == [lost.name]
    assert kept.is_dir()


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_a_tool_that_changes_during_the_diagnosis_is_rejected(copy, monkeypatch):
    states = iter(["one", "another"])
    monkeypatch.setattr("turnout_blind.diagnose.digest_of_folder", lambda folder: next(states))
    with pytest.raises(BlindError, match="changed while it diagnosed"):
        diagnose_set(*copy, "{python} -c 'raise SystemExit(3)'", report=lambda line: None)
    monkeypatch.setattr("turnout_blind.diagnose.digest_of_folder", lambda folder: "a third")
    with pytest.raises(BlindError, match="changed since the first case"):
        diagnose_set(*copy, "{python} -c 'raise SystemExit(3)'", report=lambda line: None)


def test_a_set_is_not_opened_before_the_tool_has_answered(copy):
    with pytest.raises(BlindError, match="nothing has been diagnosed yet"):
        reveal(*copy)


STUB = "{python} -c 'print([])'"


def test_nothing_is_diagnosed_under_the_truth_of_another_set(copy, tmp_path):
    """Formerly the folder of the other truth was hidden from the tool, and the true one was not."""
    out, truth = copy
    foreign = tmp_path / "foreign"
    shutil.copytree(truth, foreign)
    (foreign / "set.json").write_text('{"seed": 1}')
    with pytest.raises(BlindError, match=r"the truth of another set.*--truth"):
        diagnose_set(out, foreign, STUB, report=lambda line: None)
    with pytest.raises(BlindError, match="there is no such truth"):
        diagnose_set(out, tmp_path / "missing", STUB, report=lambda line: None)
    with pytest.raises(BlindError, match=r"the truth of another set.*--truth"):
        reveal(out, foreign)
    assert not (out / "findings").exists() and not (out / "diagnosis.json").exists()


def test_a_changed_recording_is_found_before_the_diagnosis(copy):
    """Formerly it was found when the set was revealed, after hours of work."""
    out, truth = copy
    recording = next(p for p in cases(out)[0].rglob("*") if p.is_file())
    recording.write_bytes(recording.read_bytes() + b" ")
    with pytest.raises(BlindError, match="not the sealed content"):
        diagnose_set(out, truth, STUB, report=lambda line: None)
    assert not (out / "diagnosis.json").exists()


def test_a_case_that_the_set_does_not_have_is_an_error(copy):
    """Formerly it was stored as a case without an answer."""
    out, truth = copy
    with pytest.raises(BlindError, match=rf"there is no case 'T1'.*{cases(out)[0].name}"):
        diagnose_set(out, truth, STUB, [cases(out)[0].name, "T1"], report=lambda line: None)


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_a_set_is_revealed_with_open_cases_on_request_alone(copy, capsys):
    """A revealed set cannot be diagnosed. Formerly the open cases counted as those without an answer, unsaid."""
    out, truth = copy
    where = ["--out", str(out), "--truth", str(truth)]
    diagnose_set(out, truth, STUB, [cases(out)[0].name], report=lambda line: None)
    assert main(["blind", "reveal", *where]) == 2
    assert "1 case not diagnosed yet. Go on with turnout blind diagnose" in capsys.readouterr().err
    assert not (out / "revealed").exists()
    assert main(["blind", "reveal", *where, "--incomplete"]) == 0
    assert "1 case without a diagnosis" in capsys.readouterr().out
    assert main(["blind", "reveal", *where]) == 0  # again: the same


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_the_kind_of_a_set_that_was_not_stated_is_an_error(copy, capsys):
    """Formerly a fault of the program, and a diagnosis of single visits by the command of histories."""
    out, truth = copy
    where = ["--out", str(out)]
    assert main(["blind", "diagnose", *where, "--truth", str(truth), "--histories"]) == 2
    assert "this set has single campaigns, no histories" in capsys.readouterr().err
    diagnose_set(out, truth, STUB, report=lambda line: None)
    reveal(out, truth)
    assert main(["blind", "score", *where, "--histories"]) == 2
    assert "Leave --histories out" in capsys.readouterr().err


def test_the_truth_must_not_be_inside_the_folder_of_the_tool(tmp_path):
    with pytest.raises(BlindError, match="inside the folder that the tool is given"):
        make_set(tmp_path / "a", tmp_path / "a" / "truth", 1)


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_the_check_of_the_isolation_fails_if_the_truth_is_readable(tmp_path, monkeypatch):
    """The isolation is switched off here, and the check has to raise an error."""
    monkeypatch.setattr("turnout_blind.isolation.hidden_command", lambda command, folders: command)
    (tmp_path / "truth").mkdir()
    hidden = HiddenFolders(tmp_path / "truth")
    hidden.method = "unshare"
    with pytest.raises(BlindError, match="can be read from inside"):
        hidden.__enter__()
    assert not (tmp_path / "truth" / "canary.txt").exists()


def answer(**more):
    """A row as a tool writes it."""
    row = {"verdict": "named", "term": "local_pad", "locked_to": "place", "position_m": 5.0, "probability": 0.8}
    fits = {"fit_before_pct": 40.0, "fit_after_pct": 50.0, "fit_rival_pct": 45.0, "fit_decoy_pct": 41.0}
    return {**row, **fits, "sentence": "a pad of 0.4 times the stiffness", **more}


@pytest.fixture
def scored_set(copy, tmp_path):
    """An opened set with one tool that gave both cases the same answer and another one without an answer."""
    out, truth = copy
    for label, row in ((None, answer()), ("mute", {"verdict": "none"})):
        tool = tmp_path / f"{label}.py"
        tool.write_text(f"import json, sys\njson.dump([{row!r}], open(sys.argv[1], 'w'))\n")
        diagnose_set(out, truth, f"{{python}} {tool} {{out}}", report=lambda line: None, label=label)
    reveal(out, truth)
    return out


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_a_page_shows_figures_diagrams_cases_failures_and_ablations(scored_set, tmp_path, monkeypatch):
    monkeypatch.setattr(case_reports, "stage", with_two_passages)
    page = tmp_path / "page.md"
    page.write_text(f"# Before\n\n{BEGIN}\nold\n{END}\n\nAfter\n")
    single = next(t["case"] for t in verify(scored_set, scored_set / "revealed").values() if t["effects"])
    write_page(page, scored_set, cases=[single])
    text = page.read_text()
    assert text.startswith("# Before") and text.endswith("After\n") and "\nold\n" not in text
    assert "| controls: false alarms | 100.0 % (1)" in text  # the page lists the failure
    assert "the tool (n = 2) | mute (n = 2)" in text
    assert "| controls: false alarms | 1 of 1 | 0 of 1 |" in text
    assert f"### {single}: pad" in text and "Answer: *named (probability 0.80)" in text
    for name in ("page_severity.svg", "page_reliability.svg", f"page_story_{single}.svg"):
        assert (tmp_path / name).read_text().startswith("<?xml")
    page.write_text("no marks")
    with pytest.raises(BlindError, match="not there once each"):
        write_page(page, scored_set)


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_sets_are_pooled_and_none_counts_twice(scored_set, tmp_path):
    """One false alarm of one control in each of two sets: 2 of 2. The second set differs only in its seals."""
    other = tmp_path / "other"
    shutil.copytree(scored_set, other)
    with pytest.raises(BlindError, match=f"is also in {scored_set}"):
        report_text([scored_set, other])
    for path in (other / "revealed").glob("T*.json"):
        text = path.read_text()
        path.write_text(text + " ")
        commit = (other / "commit.json").read_text()
        (other / "commit.json").write_text(commit.replace(digest(text.encode()), digest((text + " ").encode())))
    for record in other.rglob("diagnosis.json"):
        held = json.loads(record.read_text()) | {"commit_sha256": digest((other / "commit.json").read_bytes())}
        record.write_text(json.dumps(held))
    pooled = report_text([scored_set, other])
    assert "| controls: false alarms | 100.0 % (2)" in pooled
    assert "| controls: false alarms | 2 of 2 | 0 of 2 |" in pooled
    assert "| one name | 4 | 0.80 |" in pooled
    assert sorted(set(re.findall(rf"({scored_set.name}|other)/T", pooled))) == sorted([scored_set.name, "other"])


@pytest.mark.skipif(not isolation_method(), reason="nothing here can hide a folder from this user")
def test_an_archived_set_is_small_and_complete(scored_set, tmp_path):
    path = write_archive(scored_set, tmp_path / "kept")
    assert path.stat().st_size < 20e3
    held = read_archive(tmp_path / "kept")
    assert set(verify_archive(held)) == set(held["rows"]) == {c.name for c in cases(scored_set)}
    for case in held["truths"]:
        verify_recordings(held, case, scored_set / "cases")
        spoilt = json.loads(held["truths"][case])
        spoilt["stratum"] = "double"
        with pytest.raises(BlindError, match="not what was sealed"):
            verify_archive({**held, "truths": {**held["truths"], case: json.dumps(spoilt)}})


def test_an_unknown_kind_is_rejected_before_anything_is_written(tmp_path):
    with pytest.raises(BlindError, match=r"--only, vod: no such kind\. There are ballast"):
        make_set(tmp_path / "set", tmp_path / "truth", 1, only={"vod", "pad"})
    assert not list(tmp_path.iterdir())


def test_the_track_plot_shows_findings_at_wheels_and_all_names_of_a_finding():
    """An effect without a position is labelled with its wheel. All names of a finding are drawn."""
    figure, axis = pyplot().subplots()
    truth = {"effects": [{"kind": "flat", "where": {"train": "railcar", "axle": 2}}], "sensors": {"A1": 2.0}}
    terms = [
        {"term": "time_offset", "fixed": {"channel_name": "A1"}},
        {"term": "surface_dip", "fixed": {"place": 5.0}, "parameters": {"shift": {"value": 0.4}}},
    ]
    row = {"verdict": "named", "term": "time_offset", "channel": "A1", "term_json": json.dumps(terms)}
    site = SimpleNamespace(sensors=(2.0, 8.0), hammer_positions=(2.0,), names=lambda: ("A1", "A2"))
    _plot_track(axis, truth, [row], site)
    words = [text.get_text() for text in axis.texts]
    assert "flat: axle 2 of railcar" in words and "surface dip" in words and "time offset" in words
    assert 5.4 in [float(line.get_xdata()[0]) for line in axis.lines]
    figure.clear()
