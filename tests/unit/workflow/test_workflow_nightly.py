"""The nightly run: one at a time, and the remains of a killed run are removed."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from filelock import FileLock

from turnout.errors import TurnoutError
from turnout.workflow import nightly as module
from turnout.workflow.nightly import EXIT_TIME_LIMIT, NightReport, nightly


@pytest.fixture(autouse=True)
def profiles(tmp_path):
    for name in ("profiles/default", "profiles/slurm", "p"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "config.yaml").write_text("cores: 1\n")


def test_a_second_nightly_run_at_the_same_time_is_an_error(tmp_path):
    with FileLock(tmp_path / ".nightly.lock"), pytest.raises(TurnoutError, match="another nightly run is going on"):
        nightly([], "profiles/default", work=tmp_path)


def test_a_run_that_exceeds_the_time_limit_is_stopped_and_reported(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # nightly starts "-m snakemake"; this module only sleeps
    (tmp_path / "snakemake.py").write_text("import time\ntime.sleep(60)\n")
    monkeypatch.setattr(module.sys, "executable", sys.executable)
    report = nightly([], "profiles/default", limit=1.0, work=tmp_path / "work")
    assert report.code == EXIT_TIME_LIMIT and "stopped at the time limit" in str(report)


def test_results_before_the_time_limit_are_published(tmp_path, monkeypatch):
    """A first run of a large fleet may take a week. The killed run has left its lock."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "snakemake.py").write_text(
        "import sys, time\nfrom pathlib import Path\nlock = Path('.snakemake/locks')\n"
        "if '--allowed-rules' in sys.argv:\n    assert not lock.exists()\n"
        "    Path('results/registry').mkdir(parents=True)\n"
        "    Path('results/registry/_generation.json').write_text('{}')\n"
        "else:\n    lock.mkdir(parents=True)\n    Path('work/launched').write_text('')\n    time.sleep(60)\n"
    )
    (tmp_path / "work").mkdir()
    assert module._run([], 6.0, tmp_path / "work") == EXIT_TIME_LIMIT  # the code is 0 if the function waits for the run
    assert module.GENERATION.exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_run_and_its_jobs(tmp_path, number):
    """Snakemake and its job write their process numbers and wait; the job ignores SIGTERM."""
    (tmp_path / "snakemake.py").write_text(
        "import os, signal, subprocess, sys, time\nfrom pathlib import Path\n"
        "if sys.argv[1:] == ['job']:\n    signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
        "else:\n    subprocess.Popen([sys.executable, __file__, 'job'])\n"
        "with open('pids', 'a') as stream:\n    stream.write(f'{os.getpid()}\\n')\n"
        "time.sleep(600)\n"
    )
    (tmp_path / "config").mkdir()
    (tmp_path / "config/turnouts.tsv").write_text("turnout\tlayout\n")
    command = [sys.executable, "-m", "turnout.cli.main", "nightly"]
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    run = subprocess.Popen(
        command,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": path},
        stderr=subprocess.PIPE,
        preexec_fn=_restore_signals,
    )
    pids = tmp_path / "pids"
    while not pids.exists() or len(pids.read_text().splitlines()) < 2:
        assert run.poll() is None, run.stderr.read()
        time.sleep(0.1)
    run.send_signal(number)
    assert run.wait(60) == 128 + number and run.stderr.read() == b""
    for pid in map(int, pids.read_text().split()):
        assert not _is_alive(pid)


def _restore_signals():
    """Restore the default signals, as a process in the background ignores those of its terminal."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def _is_alive(pid):
    try:
        return open(f"/proc/{pid}/stat").read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_only_jobs_of_this_folder_are_cancelled(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "snakemake.py").write_text("")
    queue = f"11 turnouts-aa {tmp_path}\n12 turnouts-bb /another place\n13 other {tmp_path}\n14 turnouts-cc\n"
    (tmp_path / "queue").write_text(queue)
    for name, does in (("squeue", "cat queue"), ("scancel", 'echo "$@" > cancelled')):
        (tmp_path / name).write_text(f"#!/bin/sh\n{does}\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    nightly([], "profiles/slurm")
    assert (tmp_path / "cancelled").read_text() == "11\n"


def test_the_remains_of_a_killed_run_are_removed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "snakemake.py").write_text("")
    for name in ("backups", "locks"):
        (tmp_path / ".snakemake" / name).mkdir(parents=True)
    assert nightly([], "profiles/default", work=tmp_path / "work").code == 0
    assert list((tmp_path / ".snakemake").iterdir()) == []


@pytest.mark.parametrize("profile", ["nosuch", "profiles/nosuch"])
def test_a_missing_profile_is_an_error_before_the_run_starts(tmp_path, monkeypatch, profile):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "profiles/own").mkdir(parents=True)
    (tmp_path / "profiles/own/config.yaml").touch()
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").touch()  # the configuration is no profile
    present = "profiles/default, profiles/own, profiles/slurm"
    with pytest.raises(TurnoutError, match=f"{profile}, the profile: there is no such folder. Write one of {present}"):
        nightly([], profile)
    assert not (tmp_path / "work").exists()


PLACES = ["work", "results", "results/registry", "results/pages", "logs", ".snakemake"]
FAULTS = [
    (errno.EACCES, "Correct its permissions"), (errno.EROFS, "Mount its disk for writing"),
    (errno.ENOSPC, "Free space on its disk"),
]  # fmt: skip


@pytest.mark.parametrize("code, remedy", FAULTS)
@pytest.mark.parametrize("folder", [*PLACES, "."])
def test_a_folder_that_cannot_be_written_is_an_error_before_the_run_starts(tmp_path, monkeypatch, folder, code, remedy):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "snakemake.py").write_text("open('begun', 'w')\n")
    (tmp_path / folder).mkdir(parents=True, exist_ok=True)
    locked = (tmp_path / folder).resolve()

    def sync(descriptor):  # root can write into every folder, so this simulates the disk
        if Path(os.readlink(f"/proc/self/fd/{descriptor}")).parent == locked:
            raise OSError(code, os.strerror(code))

    monkeypatch.setattr("turnout.workflow.output_places.os.fsync", sync)
    with pytest.raises(
        TurnoutError, match=f"^{locked}, the folder: it cannot be written.*nothing was computed. {remedy}"
    ):
        nightly([], "profiles/default")
    assert not (tmp_path / "begun").exists() and not list(locked.glob(".probe*"))


@pytest.mark.parametrize("name", PLACES)
def test_a_file_where_a_folder_is_expected_is_an_error_before_the_run_starts(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "snakemake.py").write_text("open('begun', 'w')\n")
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).touch()
    with pytest.raises(TurnoutError, match=f"^{tmp_path / name}, the folder: .*it is a file.* Rename or remove it"):
        nightly([], "profiles/default")
    assert not (tmp_path / "begun").exists()


def test_a_link_to_a_disk_that_is_not_mounted_is_an_error_before_the_run_starts(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "work").symlink_to(tmp_path / "disk/work")
    with pytest.raises(TurnoutError, match=f"^{tmp_path}/work, the folder: its link leads to nothing.* Mount the disk"):
        nightly([], "profiles/default")


@pytest.mark.parametrize("name", ["work/.nightly.lock", "results/registry/.lock", "results/registry/_generation.json"])
def test_a_folder_where_a_file_is_expected_is_an_error_before_the_run_starts(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "snakemake.py").write_text("open('begun', 'w')\n")
    (tmp_path / name).mkdir(parents=True)
    with pytest.raises(TurnoutError, match=f"^{tmp_path / name}, the file: .*it is a folder.* Rename or remove it"):
        nightly([], "profiles/default")
    assert not (tmp_path / "begun").exists()


@pytest.mark.parametrize(
    "program, quiet, code, reason",
    [
        ("raise SystemExit(2)", False, 2, "Snakemake stopped before any job: its message stands above"),
        ("raise SystemExit(2)", True, 2, "run again without --quiet to see its message"),
        ("import os\nos.kill(os.getpid(), 9)", False, 137, "Snakemake was ended by SIGKILL, as by a lack of memory"),
        ("import os\nos.kill(os.getpid(), 15)", True, 143, "Snakemake was ended by SIGTERM"),
    ],
)
def test_every_failed_run_has_a_reason(tmp_path, monkeypatch, program, quiet, code, reason):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "snakemake.py").write_text(program)
    report = nightly([], "profiles/default", quiet=quiet)
    assert report.code == code and f"failed with exit code {code}: " in str(report) and reason in report.reason


def test_the_three_turnouts_with_most_unused_recordings_are_listed(tmp_path, monkeypatch):
    """Quarantine is from the states, rejected tests are from the registry; units of one turnout are from both."""
    from turnout.registry.job import register
    from turnout.workflow.batches import UnitResult, read_results, write_batch

    monkeypatch.chdir(tmp_path)
    rejected = {
        "model_id": "0" * 32, "turnout_id": "t4", "section_id": "t4/A", "campaign_id": "t4/2026-01-05",
        "measured_at_utc": "2026-01-05T10:00:00", "method": "joint", "status": "rejected", "code_version": "1",
        "config_hash": "c",
    }  # fmt: skip
    (tmp_path / "batches").mkdir()
    result = UnitResult("t4/hammer/A/2026-01-05", "t4", "hammer", "k", "1", "ok", {"models": [rejected]})
    register([write_batch(tmp_path / "batches", [result])], tmp_path / "results/registry", read=read_results)
    bad = {"t1": 1, "t2": 3, "t3": 0, "t4": 1, "t5": 2}
    known = {f"{t}/hammer/B/{k}": "quarantined" for t, n in bad.items() for k in range(n)}
    known |= {"t4/hammer/A/2026-01-05": "ok", "t3/hammer/A/1": "ok"}
    (tmp_path / "snakemake.py").write_text(
        "from pathlib import Path\nfrom turnout.workflow.state import UnitState, State\n"
        f"known = {{u: UnitState('', '', '1', s, 'b') for u, s in {known!r}.items()}}\n"
        "State(known, ['b']).save(Path('work/hammer/00of01.json'))\n"
    )
    line = str(nightly([], "p"))
    assert "9 processed, 7 of these with rows in quarantine, 1 hammer test rejected" in line and "\n" not in line
    assert 'worst: t2 (3), t4 (2), t5 (2), see turnout query "from quarantine_open" and "from rejected"' in line


def test_after_a_change_of_the_number_of_shards_units_are_counted_once_and_vanished_files_are_reported(
    fleet, tmp_path, monkeypatch
):
    """Three units in one shard, then in two: the state of the one shard is not used any more."""
    monkeypatch.chdir(tmp_path)
    fleet.run()
    (tmp_path / "snakemake.py").write_text(
        f"import sys\nfrom pathlib import Path\nsys.path.append({str(Path(__file__).parent)!r})\n"
        "from length_fleet import length\nfrom turnout.config import load_configuration\n"
        "from turnout.workflow.plan import write_plans\nfrom turnout.workflow.shard import run_shard\n"
        "from turnout.workflow.tasks import Stage\n"
        "read, raw, work = load_configuration('config'), Path('raw'), Path('work')\n"
        "for shard in write_plans(read, raw, work / 'plan', 2):\n"
        "    plan, state = (work / kind / f'{shard}.json' for kind in ('plan', 'hammer'))\n"
        "    run_shard(plan, state, Stage('hammer', length, '1'), read, raw)\n"
    )
    assert "3 units known, 3 processed" in str(nightly([], "p"))
    (tmp_path / "raw/t1/2024-05-13/A_1.txt").unlink()
    assert "3 units known, 0 processed, 0 of these with rows in quarantine, 1 vanished" in str(nightly([], "p"))


def test_the_report_is_one_line():
    line = str(NightReport(1, 100, 7, 2, 3))
    assert (
        line == "failed with exit code 1: 100 units known, 7 processed, 2 of these with rows in quarantine, 3 vanished"
    )


def test_units_that_an_unfinished_job_stored_are_counted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "snakemake.py").write_text(
        "from pathlib import Path\nfrom turnout.workflow.state import UnitState, State\n"
        "known = {'t1/hammer/A/1': UnitState('', '', '1', 'ok', 'b')}\n"
        "State(known, ['b']).save(Path('work/hammer/00of01.json'))\nraise SystemExit(1)\n"
    )
    report = nightly([], "profiles/default", work=tmp_path / "work")
    assert (report.code, report.units, report.processed) == (1, 1, 1)


def test_the_results_of_other_jobs_are_published_if_jobs_fail(tmp_path, monkeypatch):
    """The first run fails before the registry; the second run may only publish."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "snakemake.py").write_text(
        "import sys\nfrom pathlib import Path\n"
        "from turnout.workflow.state import State\n"
        "Path('said').open('a').write(' '.join(sys.argv[1:]) + '\\n')\n"
        "if '--allowed-rules' in sys.argv and Path('publish').exists():\n"
        "    Path('results/registry').mkdir(parents=True)\n"
        "    Path('results/registry/_generation.json').write_text('')\n"
        "elif Path('begins').exists():\n"
        "    Path('work/launched').write_text('now')\n"
        "    State().save(Path('work/hammer/00of01.json'))\n"
        "raise SystemExit(1)\n"
    )
    assert "the registry was not published" in str(nightly([], "p"))
    assert len((tmp_path / "said").read_text().splitlines()) == 1  # no job was started: nothing to publish
    (tmp_path / "begins").touch()
    assert "the registry was not published" in str(nightly([], "p"))
    (tmp_path / "publish").touch()
    report = nightly([], "p")
    assert (report.code, report.published) == (1, True)
    assert "--rerun-incomplete --allowed-rules all register" in (tmp_path / "said").read_text().splitlines()[-1]


def test_the_lock_of_a_run_that_a_user_started_is_not_removed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "snakemake").write_text("import time\nprint('up', flush=True)\ntime.sleep(60)\n")
    with subprocess.Popen([sys.executable, str(tmp_path / "snakemake")], stdout=subprocess.PIPE) as by_hand:
        try:
            by_hand.stdout.readline()
            with pytest.raises(TurnoutError, match=f"process {by_hand.pid} is a Snakemake run in this folder"):
                nightly([], "profiles/default")
        finally:
            by_hand.kill()
