"""Only new units are computed, and the run reports their number. The tests use one fleet in their order."""

import os
import re
import time
from pathlib import Path

import pytest
import toy_fleet as toy

from turnout.registry.database import open_registry
from turnout.workflow.jobs import touch_after_publication
from turnout.workflow.plan import shard_of

pytestmark = pytest.mark.slow
SHARDS = 3


# The tests of this file use one fleet in their order, as a worker runs all tests of a file.


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    folder = toy.make(tmp_path_factory.mktemp("fleet"), n_turnout=5, n_section=2)
    done = toy.run(folder, shards=SHARDS)
    assert counts(done) == {"known": 10, "processed": 10, "quarantined": 0}
    return folder


def counts(done):
    """Sums over the shards of the numbers in their summary lines."""
    lines = re.findall(r"^hammer \d+of\d+: (\d+) known, (\d+) processed, (\d+) quarantined", done.stdout, re.M)
    return dict(zip(("known", "processed", "quarantined"), (sum(map(int, column)) for column in zip(*lines))))


def test_the_registry_records_the_start_of_the_run(fleet):
    with open_registry(fleet / "results/registry") as connection:
        ((began, ended),) = connection.execute("select started_at_utc, ended_at_utc from runs").fetchall()
    assert began.isoformat() == (fleet / "work/launched").read_text() and began <= ended


def test_a_second_run_computes_nothing(fleet):
    assert "Nothing to be done" in toy.run(fleet, shards=SHARDS).stdout


def test_a_later_publication_does_not_repeat_the_verdict(fleet, monkeypatch):
    """The job of the worklist publishes at the end of a nightly run."""
    monkeypatch.chdir(fleet)
    generation = Path("results/registry/_generation.json")
    with touch_after_publication(generation, [], ["work/verdict.json"]):
        generation.write_text(generation.read_text() + "\n")
    assert "Nothing to be done" in toy.run(fleet, shards=SHARDS).stdout


def test_the_worklist_and_the_pages_are_updated_once_a_day(fleet):
    """Suppressions end, planned maintenance takes place and charts become outdated without a new file."""
    whole = {"shards": SHARDS, "target": "results/pages/index.html"}
    toy.run(fleet, "day=2026-03-01", **whole)
    assert "Nothing to be done" in toy.run(fleet, "day=2026-03-01", **whole).stdout
    done = toy.run(fleet, "day=2026-03-02", **whole).stdout
    assert set(re.findall(r"^(?:localrule|rule) (\w+):", done, re.M)) == {"trend", "change", "worklist", "report"}
    assert "Nothing to be done" in toy.run(fleet, "day=2026-03-02", shards=SHARDS).stdout


def test_a_touched_file_is_not_computed_again(fleet):
    os.utime(fleet / "raw/T00001/hammer/2024-01-01/A1_1.npz", (1, 1))
    before = toy.data_files(fleet)
    assert counts(toy.run(fleet, shards=SHARDS))["processed"] == 0
    assert toy.data_files(fleet) == before


def test_one_new_file_causes_the_computation_of_one_unit_of_one_shard(fleet):
    path = fleet / "raw/T00001/hammer/2024-01-01/A1_2.npz"
    path.write_bytes(toy.raw_bytes(4711, fleet))
    before = toy.rows(fleet)["recordings"]
    done = toy.run(fleet, shards=SHARDS)
    assert counts(done)["processed"] == 1
    assert len(re.findall(r"^localrule hammer:|^rule hammer:", done.stdout, re.M)) == 1
    after = toy.rows(fleet)["recordings"]
    assert [r for r in after if any("A1_2.npz" in str(v) for v in r)] and len(after) > len(before)


def test_a_job_reads_a_new_plan_although_its_mark_is_newer(fleet):
    """A file came and was planned while the job ran; or a clock was fast."""
    (fleet / "raw/T00001/hammer/2024-01-01/A1_3.npz").write_bytes(toy.raw_bytes(4712, fleet))
    tomorrow = time.time() + 86400
    os.utime(fleet / f"work/hammer/{shard_of('T00001', SHARDS)}.done", (tomorrow, tomorrow))
    assert counts(toy.run(fleet, shards=SHARDS))["processed"] == 1
    assert "Nothing to be done" in toy.run(fleet, shards=SHARDS).stdout


def test_a_new_turnout_is_computed_and_no_row_of_another_changes(fleet):
    toy.add_raw(fleet, "T00099")
    with open(fleet / "config/turnouts.tsv", "a") as table:
        table.write("T00099\ttoy\tline 1\n")
    before = {t: [r for r in rows if "T00099" not in repr(r)] for t, rows in toy.rows(fleet).items()}
    assert counts(toy.run(fleet, shards=SHARDS))["processed"] == 2
    after = {t: [r for r in rows if "T00099" not in repr(r)] for t, rows in toy.rows(fleet).items()}
    for table in ("recordings", "impacts", "turnouts", "sections", "campaigns"):
        assert after[table] == before[table]


def test_a_new_override_causes_the_computation_of_its_turnout_only(fleet):
    (fleet / "config/overrides").mkdir(exist_ok=True)
    (fleet / "config/overrides/T00002.yaml").write_text("hammer: {channels: {rail: {sign: -1}}}\n")
    assert counts(toy.run(fleet, shards=SHARDS))["processed"] == 2


def test_a_corrected_temperature_causes_the_computation_of_its_campaign(fleet):
    path = fleet / "raw/T00003/campaigns.csv"
    path.write_text(path.read_text().replace("10.5", "11.5"))
    done = toy.run(fleet, shards=SHARDS)
    assert counts(done)["processed"] == 2
    assert any("11.5" in repr(r) for r in toy.rows(fleet)["campaigns"] if "T00003" in repr(r))


def test_a_run_of_one_turnout_leaves_the_others_for_a_later_run(fleet):
    for turnout in ("T00000", "T00004"):
        toy.add_raw(fleet, turnout, n_campaign=1, first=1)
    done = toy.run(fleet, "turnouts=T00004", shards=SHARDS)
    assert counts(done)["processed"] == 2
    assert counts(toy.run(fleet, shards=SHARDS))["processed"] == 2
    assert "Nothing to be done" in toy.run(fleet, shards=SHARDS).stdout


def current(fleet, turnout):
    """Paths of the current recordings of a turnout."""
    with open_registry(fleet / "results/registry") as connection:
        question = "select path from recordings_current where turnout_id = ? order by path"
        return [path for (path,) in connection.execute(question, [turnout]).fetchall()]


def test_a_campaign_that_was_moved_to_a_turnout_of_another_shard_is_used_only_there(fleet):
    assert shard_of("T00000", SHARDS) != shard_of("T00003", SHARDS)
    assert len(current(fleet, "T00003")) == 2
    (fleet / "raw/T00003/hammer/2024-01-01").rename(fleet / "raw/T00000/hammer/2024-03-01")
    assert counts(toy.run(fleet, shards=SHARDS))["processed"] == 2
    assert current(fleet, "T00003") == []
    assert [path for path in current(fleet, "T00000") if "2024-03-01" in path] == [
        f"T00000/hammer/2024-03-01/A{k}_1.npz" for k in (1, 2)
    ]
    assert counts(toy.run(fleet, shards=SHARDS))["processed"] == 0  # stages that use the old place run again
    assert "Nothing to be done" in toy.run(fleet, shards=SHARDS).stdout


def test_truncated_work_files_are_restored_without_a_computation(fleet):
    before, shard = toy.rows(fleet), shard_of("T00000", SHARDS)
    for name in (f"hammer/{shard}.json", f"plan/{shard}.json", "verdict.json", "attempts/register"):
        path = fleet / "work" / name
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    done = toy.run(fleet, shards=SHARDS)
    assert counts(done)["processed"] == 0 and re.search(rf"{shard}\.json is cut", done.stdout)
    assert toy.rows(fleet) == before
    assert "Nothing to be done" in toy.run(fleet, shards=SHARDS).stdout


@pytest.mark.parametrize(
    "option, words",
    [
        ("turnout=T00004", "unknown option 'turnout'. Did you mean 'turnouts'?"),
        ("turnouts=T0004", "no turnout 'T0004'. Did you mean 'T00004'?"),
        ("day=tomorrow", "day: 'tomorrow'. Write YYYY-MM-DD"),
        ("strict=perhaps", "strict: 'perhaps'. Write true or false"),
    ],
)
def test_a_wrong_option_is_an_error_before_any_job(fleet, option, words):
    done = toy.run(fleet, option, check=False)
    assert done.returncode != 0 and words in done.stdout.replace("\n", " ")
    assert "Traceback" not in done.stdout and not re.search(r'File ".*\.py"', done.stdout)
