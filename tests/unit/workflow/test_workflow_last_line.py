"""The last line of a nightly run: what can be used, what vanished since the last run, and the reason of a failure."""

import errno
import json
import logging
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from turnout.errors import ConfigError, ConfigErrors, RegistryError
from turnout.registry.job import register
from turnout.workflow.batches import UnitResult, read_results, write_batch
from turnout.workflow.current_results import DamagedBatch
from turnout.workflow.job_log import job_log
from turnout.workflow.nightly import NightReport, nightly
from turnout.workflow.run_report import failure_reason

STATE = """
from pathlib import Path
from turnout.workflow.state import UnitState, State
known = {{u: UnitState('', '', '1', s, 'b') for u, s in {known!r}.items()}}
State(known, ['b']).save(Path('work/hammer/00of01.json'))
Path('work/plan').mkdir(parents=True, exist_ok=True)
Path('work/plan/00of01.json').write_text({plan!r})
{more}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "profiles/default").mkdir(parents=True)
    (tmp_path / "profiles/default/config.yaml").write_text("cores: 1\n")
    return tmp_path


def plan(*units):
    """Text of a plan of hammer tests."""
    found: dict[str, list] = {}
    for turnout, kind, label in (u.split("/", 2) for u in units):
        found.setdefault(turnout, []).append([kind, label, "A", "2026-01-05", "", [["a", 1, 1]]])
    hashes = {"hammer": "h"}
    entries = [{"turnout": t, "raw": t, "hashes": hashes, "problems": [], "units": found[t]} for t in sorted(found)]
    lines = ",\n".join(json.dumps(e) for e in entries)
    return f'{{"shard":"00of01","turnouts":[\n{lines}\n]}}\n'


def run_night(folder, known, planned, more=""):
    """The last line of a nightly run in which Snakemake leaves these units and this plan."""
    (folder / "snakemake.py").write_text(STATE.format(known=known, plan=plan(*planned), more=more))
    return str(nightly([], "profiles/default"))


def units(*turnouts):
    return [f"{t}/hammer/A/2026-01-05" for t in turnouts]


def test_a_vanished_unit_is_reported_once(folder):
    known = dict.fromkeys([*units("t1", "t2"), "t1/mismatch/2026-01-05"], "ok")
    assert "0 vanished" in run_night(folder, known, units("t1", "t2"))
    assert "1 vanished" in run_night(folder, known, units("t1"))
    assert "0 vanished" in run_night(folder, known, units("t1"))


def model(turnout, status):
    row = {
        "model_id": turnout.encode().hex().zfill(32), "turnout_id": turnout, "section_id": f"{turnout}/A",
        "campaign_id": f"{turnout}/2026-01-05", "measured_at_utc": "2026-01-05T10:00:00", "method": "joint",
        "status": status, "code_version": "1", "config_hash": "c",
    }  # fmt: skip
    row |= {"reason": "too_few_impacts"} if status == "rejected" else {}
    return UnitResult(f"{turnout}/hammer/A/2026-01-05", turnout, "hammer", "k", "1", "ok", {"models": [row]})


def registry(folder, quarantine=(), removed="", **status):
    listed = [t for t in [*status, "never"] if t != removed]
    tables = {"turnouts": [{"turnout_id": t, "layout": "l", "config_hash": "h"} for t in listed]}
    tables |= {"quarantine": list(quarantine)} if quarantine else {}
    batch = write_batch(folder / "batches", [model(t, s) for t, s in status.items()])
    register([batch], folder / "results/registry", read=read_results, tables=tables)


def test_turnouts_without_any_usable_result_are_reported_every_night(folder):
    registry(folder, t1="accepted", t2="rejected", t3="rejected")
    known = dict.fromkeys(units("t1", "t2", "t3"), "ok")
    for last_line in (run_night(folder, known, known), run_night(folder, known, known)):
        assert last_line.startswith("ok: ") and "nothing could be used yet of t2, t3" in last_line


def test_a_run_without_any_usable_result_is_not_reported_as_sound(folder):
    registry(folder, **dict.fromkeys(("t1", "t2", "t3", "t4", "t5"), "rejected"))
    known = dict.fromkeys(units("t1", "t2", "t3", "t4", "t5"), "ok")
    last_line = run_night(folder, known, known)
    assert last_line.startswith("every job ran, but nothing could be used: 5 units known")
    assert "nothing could be used yet of t1, t2, t3 and 2 more" in last_line


def excluded(turnout, name, reason, place, found):
    row = {"turnout_id": turnout, "kind": "configuration", "path": f"{turnout}/{name}", "stage": "plan"}
    key = f"{turnout}{name}".encode().hex().zfill(32)[-32:]
    return row | {"quarantine_id": key, "reason_code": reason, "place": place, "found": found, "remedy": "Correct it"}


def test_an_unreadable_table_is_reported_before_a_file_with_an_unknown_name(folder):
    """It belongs to no unit, so no number includes it, and no chart is evaluated without its temperatures."""
    column = excluded("t1", "campaigns.csv", "unreadable", "line 1, column 25", "unknown column 'temperature'")
    name = excluded("t1", "a.csv", "name_unknown", "file name", "its name follows no pattern of the layout")
    unused = excluded("t2", "campaigns.csv", "unreadable", "line 2, column 1", "a cell too many")
    registry(folder, (name, column, unused), t1="accepted", t2="rejected")
    known = dict.fromkeys(units("t1", "t2"), "ok")
    line = run_night(folder, known, known)
    assert "; in no unit: t1/campaigns.csv, line 1, column 25: unknown column 'temperature' and 1 more, see" in line
    assert "nothing could be used yet of t2;" in line and "t2/campaigns.csv" not in line


def test_a_night_that_left_turnouts_out_is_not_ok_and_its_exit_code_is_1(folder):
    """Somebody has to correct the configuration; the results of the other turnouts may be trusted."""
    error = excluded("t2", "x", "configuration_error", "line 3, column 5", "unknown key 'rat'")
    error["path"] = "config/overrides/t2.yaml"
    name = excluded("t1", "a.csv", "name_unknown", "file name", "its name follows no pattern of the layout")
    registry(folder, (error, name), t1="accepted", t2="accepted")
    known = dict.fromkeys(units("t1", "t2"), "ok")
    (folder / "snakemake.py").write_text(STATE.format(known=known, plan=plan(*known), more=""))
    night = nightly([], "profiles/default")
    assert (night.code, night.reason, night.published) == (1, "", True)
    assert str(night).startswith("every job ran, but 1 error in the configuration left turnouts out: 2 units known")
    assert "; left out: config/overrides/t2.yaml, line 3, column 5: unknown key 'rat'; in no unit: t1/a.csv" in str(
        night
    )


@pytest.mark.parametrize(("code", "why", "well"), [(1, "", True), (124, "", False), (1, "a job died", False)])
def test_a_night_that_left_turnouts_out_and_did_not_end_has_no_alerts(code, why, well):
    """As one without an error in its configuration: at the time limit the list may be that of the day before."""
    night = NightReport(code, 2, 2, 0, 0, published=True, reason=why, left_out=("config/overrides/t2.yaml: an error",))
    assert night.has_ended_well == well and str(night).startswith("every job ran") == well
    assert NightReport(0, 2, 2, 0, 0).has_ended_well and not NightReport(124, 2, 2, 0, 0).has_ended_well


def damaged_disk(turnout, label, name):
    """A quarantine row of a file of a unit that the disk did not give in two runs."""
    row = excluded(turnout, name, "read_fault", "the file", "OSError: [Errno 5] Input/output error")
    return row | {"kind": "hammer", "section_id": f"{turnout}/{label}", "stage": "hammer"}


@pytest.mark.parametrize(
    ("row", "quoted"),
    [
        (excluded("t1", "hammer/A_1.uff", "no_access", "file", "may not be read"), "t1/hammer/A_1.uff: may not be"),
        (excluded("t1", "hammer", "no_access", "folder", "Permission denied"), "t1/hammer: Permission denied"),
        (excluded("t1", "campaigns.csv", "no_access", "line 1", "Permission denied"), "t1/campaigns.csv: Permission"),
        (damaged_disk("t1", "A", "hammer/A_1.uff"), "t1/hammer/A_1.uff: OSError: [Errno 5]"),
    ],
    ids=["file", "folder", "table", "disk"],
)
def test_a_night_that_could_not_read_a_file_is_not_ok_and_its_exit_code_is_0(folder, row, quoted):
    registry(folder, (row,), t1="accepted")
    known = dict.fromkeys(units("t1"), "ok")
    (folder / "snakemake.py").write_text(STATE.format(known=known, plan=plan(*known), more=""))
    night = nightly([], "profiles/default")
    assert night.code == 0
    assert str(night).startswith("every job ran, but 1 file could not be read: 1 units known")
    assert f"; not read: {quoted}" in str(night) and "in no unit" not in str(night)


def test_several_unread_files_are_counted_and_the_first_is_quoted(folder):
    files = [excluded("t1", name, "no_access", "file", "may not be read") for name in ("a.uff", "b.uff", "c.uff")]
    registry(folder, files, t1="accepted")
    line = run_night(folder, dict.fromkeys(units("t1"), "ok"), units("t1"))
    assert line.startswith("every job ran, but 3 files could not be read: ")
    assert "; not read: t1/a.uff: may not be read and 2 more, see" in line


@pytest.mark.parametrize("turnout", [None, "t9"])
def test_an_unused_row_of_the_configuration_is_reported(folder, turnout):
    found = f"turnout {turnout!r} has no row in turnouts.tsv"
    row = excluded("t1", "x", "not_counted", "line 2, column 1", found)
    registry(folder, ({**row, "turnout_id": turnout, "path": "config/events.csv"},), t1="accepted")
    line = run_night(folder, dict.fromkeys(units("t1"), "ok"), units("t1"))
    assert f"; in no unit: config/events.csv, line 2, column 1: {found}, see" in line


def test_an_event_of_a_removed_turnout_is_no_fault(folder):
    row = excluded("t2", "x", "not_counted", "line 2, column 1", "turnout 't2' has no row in turnouts.tsv")
    registry(folder, (row,), "t2", t1="accepted", t2="accepted")
    assert "in no unit" not in run_night(folder, dict.fromkeys(units("t1"), "ok"), units("t1"))


@pytest.mark.parametrize("quiet", [False, True])
def test_a_quiet_run_prints_only_its_last_line(folder, quiet, capfd):
    """Neither the messages of Snakemake nor the output of its jobs are printed."""
    more = "import sys; print('trend: 12 rows'); print('rule trend', file=sys.stderr)"
    (folder / "snakemake.py").write_text(STATE.format(known={}, plan=plan("t1/hammer/A/2026-01-05"), more=more))
    nightly([], "profiles/default", quiet=quiet)
    out, error = capfd.readouterr()
    assert ("trend: 12 rows" not in out and "rule trend" not in error) == quiet


WRONG_VALUE = ConfigError("a.yaml", "line 1", "7", "Write 8")
ERROR = """Error in rule {rule}:
    message: None
    jobid: {job}
    output: work/{rule}
    log: logs/{rule}.log (check log file(s) for error details)
"""


def test_the_reason_is_the_sentence_of_the_verdict(folder):
    """A job that finished in a second attempt is no reason."""
    text = ERROR.format(rule="hammer", job=2) + "Trying to restart job 2.\nFinished jobid: 2 (Rule: hammer)\n"
    write("run", text + ERROR.format(rule="verdict", job=4))
    complaint = "9 of 12 new units of the fleet have rows in quarantine, 75 %, above the limit of 50 %"
    Path("logs").mkdir()
    found = "INFO the registry is up to date, but 12 units computed, 9 with rows in quarantine"
    Path("logs/verdict.log").write_text(f"{found}\n{complaint}\nanother\n")
    assert failure_reason() == f"{complaint} (and 1 more, see logs/verdict.log)"


def test_the_reason_is_the_first_failed_rule_with_its_log(folder):
    write("run", ERROR.format(rule="passage", job=2) + ERROR.format(rule="register", job=4))
    write("then", ERROR.format(rule="verdict", job=1), later=5)
    assert failure_reason() == "rule passage failed, see logs/passage.log (and 2 more)"


def test_the_reason_of_a_failed_rule_is_the_error_that_ended_its_job(folder):
    """Of the log of an earlier run nothing is stated: a job that dies, or a full disk, leaves no other."""
    with pytest.raises(RegistryError), job_log("logs/register.log"):
        try:
            raise OSError(errno.ENOSPC, "No space left on device")
        except OSError as error:
            raise RegistryError("work/a.json: it cannot be written") from error
    write("run", ERROR.format(rule="register", job=4))
    reason = "rule register failed, see logs/register.log"
    assert failure_reason() == f"{reason}: turnout.errors.RegistryError: work/a.json: it cannot be written"
    os.utime("logs/register.log", (1, 1))
    assert failure_reason(since=2 * 10**9) == reason


def test_the_error_of_a_unit_is_not_stated_as_that_of_a_job_that_was_killed(folder):
    """The log has the traceback of a unit that failed; a job that is killed, as for its memory, adds none."""
    with job_log("logs/hammer.log"):
        logging.getLogger("turnout.workflow").error(
            "t1/A7: internal error\nTraceback (most recent call last):\nKeyError: 3"
        )
    write("run", ERROR.format(rule="hammer", job=4))
    assert failure_reason() == "rule hammer failed, see logs/hammer.log"


def test_a_failed_night_states_which_disk_is_nearly_full(folder, monkeypatch):
    (folder / "snakemake.py").write_text("raise SystemExit(1)")
    values = {"f_frsize": 4096, "f_bavail": 300, "f_files": 10**6, "f_favail": 10**6}
    monkeypatch.setattr(os, "statvfs", lambda path: SimpleNamespace(**values))
    assert str(nightly([], "profiles/default")).endswith(f"; the disk of {folder}/work has room for only 1.2 MB")
    values |= {"f_bavail": 10**7, "f_favail": 3}
    assert str(nightly([], "profiles/default")).endswith(f"; the disk of {folder}/work has room for only 3 files")
    values |= {"f_files": 0, "f_favail": 0}  # this file system does not count its files
    assert "room" not in str(nightly([], "profiles/default"))


def test_the_log_of_a_job_has_its_messages_and_no_later_ones(tmp_path, capsys):
    log, logger = tmp_path / "logs/job.log", logging.getLogger("turnout.workflow")
    with job_log(log):
        logger.info("3 units")
        logger.warning("a remark")
    logger.warning("of another job")
    assert log.read_text() == "INFO 3 units\nWARNING a remark\n"
    assert capsys.readouterr().err.splitlines()[0] == "WARNING a remark"


def test_the_reason_of_a_run_that_stopped_before_any_job_is_its_error(folder):
    sentence = "raw, raw root: 41 known files are gone, first t2/a.uff. Nothing was changed."
    write("run", f'ConfigError in file "/srv/t/Snakefile", line 11:\n{sentence}\n  File "/srv/t/Snakefile", line 11\n')
    assert failure_reason() == sentence
    log = Path(".snakemake/log/run.snakemake.log")
    assert failure_reason(since=log.stat().st_mtime_ns + 1) == ""  # of an earlier run


def test_the_reason_of_a_run_that_ended_with_a_traceback_is_its_exception_or_its_log(folder):
    write("run", "Building DAG of jobs...\n")
    assert failure_reason() == "see .snakemake/log/run.snakemake.log"
    write(
        "then", "Traceback (most recent call last):\n\nNotADirectoryError: [Errno 20] Not a directory: 'results'\n", 5
    )
    assert failure_reason() == "NotADirectoryError: [Errno 20] Not a directory: 'results'"
    write("last", "Traceback (most recent call last):\n\nturnout.errors.StateError: no state\n", 10)
    assert failure_reason() == "turnout.errors.StateError: no state"


@pytest.mark.parametrize(
    "error",
    [DamagedBatch("work/a.json", ValueError("no batch")), ConfigErrors([WRONG_VALUE] * 2)],
    ids=type,
)
def test_the_exception_of_a_failed_job_is_stated_whatever_its_name(folder, error):
    with pytest.raises(type(error)), job_log("logs/register.log"):
        raise error
    write("run", ERROR.format(rule="register", job=4))
    name = f"{type(error).__module__}.{type(error).__name__}"
    assert f"see logs/register.log: {name}: {str(error).splitlines()[0]}" in failure_reason()


def test_the_message_that_stopped_a_run_is_stated_whatever_the_name_of_its_exception(folder):
    write("run", 'DamagedBatch in file "/srv/t/rules/register.smk", line 11:\nwork/a.json: no batch\n')
    assert failure_reason() == "work/a.json: no batch"


def test_a_job_that_succeeded_in_its_second_attempt_is_no_reason(folder):
    write("run", ERROR.format(rule="register", job=4) + "\nFinished jobid: 4 (Rule: register)\n")
    assert failure_reason() == "see .snakemake/log/run.snakemake.log"


def test_a_reason_whose_first_line_ends_with_a_colon_includes_the_second_line(folder):
    write("run", "WorkflowError:\nWrite-protected output files for rule register:\n    results/registry/a\n    b\n")
    assert failure_reason() == "Write-protected output files for rule register: results/registry/a"


def write(name, text, later=0):
    log = Path(".snakemake/log") / f"{name}.snakemake.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    log.write_text(text)
    os.utime(log, (log.stat().st_mtime + later, log.stat().st_mtime + later))


def test_the_last_line_of_a_failed_run_states_the_reason(folder):
    error = 'ConfigError in file "Snakefile", line 11:\\nconfig/config.yaml, line 1: unknown key.\\n'
    more = (
        "log = Path('.snakemake/log/now.snakemake.log')\nlog.parent.mkdir(parents=True)\n"
        f"log.write_text('{error}')\nraise SystemExit(1)"
    )
    last_line = run_night(folder, {}, [], more)
    assert last_line.startswith("failed with exit code 1: ") and "\n" not in last_line
    assert last_line.endswith("; why: config/config.yaml, line 1: unknown key.")
