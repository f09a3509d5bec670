"""Report why a run failed, from the logs of Snakemake and its jobs, and which units could not be used."""

import re
from collections.abc import Collection
from pathlib import Path

import duckdb

from turnout.errors import RegistryError
from turnout.files import changed_at
from turnout.registry.database import open_registry
from turnout.registry.generation import GENERATION_FILE
from turnout.workflow.job_log import END

LOGS = Path(".snakemake/log")
VERDICT = Path("logs/verdict.log")
FAILED_RULE = re.compile(
    r"^Error in rule (\w+):\n(?:    (?!jobid).*\n)*    jobid: (\d+)\n(?:    (?!log:).*\n)*(?:    log: (\S+))?", re.M
)
FINISHED_JOB = re.compile(r"^Finished jobid: (\d+) ", re.M)
# Of a line that ends with a colon the next one is a part: it names the files.
# The class of an exception may have any name; Snakemake writes "Error in rule" of a failed job.
STOP_MESSAGE = re.compile(
    r"^(?:(?!Error )\w+ in (?:file|rule) .*|\w+(?:Errors?|Exception)):\n(.+(?:(?<=:)\n.+)?)$", re.M
)
# Behind the indented lines of a traceback stands its exception
EXCEPTION = re.compile(r"^Traceback \(most recent call last\):\n(?:[ \t].*\n|\n)*([\w.]+(?:: .+)?)$", re.M)
MAX_REASON_LENGTH = 300  # characters of a message in the report


def failure_reason(since: int = 0) -> str:
    """Reason of a failed run in a few words.

    It is the first failed rule with its log, and the error that ended its job. If only the rule verdict failed, it is
    the first complaint of the quality gate. If no rule failed, it is the message that stopped the run before any job,
    or the exception of a traceback. Without either it is the name of the log.

    Parameters
    ----------
    since : int
        Start of the run; older logs do not count. [ns since 1970]

    Returns
    -------
    str
        The reason, "" without a log of the run.
    """
    written = sorted((path.stat().st_mtime_ns, path) for path in LOGS.glob("*.snakemake.log"))
    texts = [path.read_text(encoding="utf-8", errors="replace") for time, path in written if time >= since]
    failed = [match for text in texts for match in _failed_jobs(text)]
    jobs = [(rule, log) for rule, log in failed if rule != "verdict"]
    if jobs:
        rule, log = jobs[0]
        further_jobs = f" (and {len(failed) - 1} more)" if len(failed) > 1 else ""
        place, error = (f", see {log}", _error_in(Path(log), since)) if log else ("", "")
        return f"rule {rule} failed{place}{further_jobs}{error}"
    if failed:
        return _first_complaint()
    stopped = [match for text in texts if (match := STOP_MESSAGE.search(text))]
    if stopped:
        return " ".join(stopped[0][1].split())[:MAX_REASON_LENGTH]
    exceptions = [line for text in texts for line in EXCEPTION.findall(text)]
    return exceptions[-1][:MAX_REASON_LENGTH] if exceptions else f"see {written[-1][1]}" if texts else ""


def _error_in(log: Path, since: int) -> str:
    """Exception that ended a job, with a colon before it.

    "" if its log has none: it is of an earlier run, or the job was killed. Errors of units do not end a job.
    """
    if not log.exists() or changed_at(log) < since:
        return ""
    _, marker, end = log.read_text(encoding="utf-8", errors="replace").rpartition(f"ERROR {END}\n")
    exceptions = EXCEPTION.findall(end) if marker else []
    return f": {exceptions[-1][:MAX_REASON_LENGTH]}" if exceptions else ""


def _failed_jobs(text: str) -> list[tuple[str, str]]:
    """(rule, log) of each job that failed and did not succeed in a later attempt, each job once."""
    ended = set(FINISHED_JOB.findall(text))
    return list({job: (rule, log) for rule, job, log in FAILED_RULE.findall(text) if job not in ended}.values())


def _first_complaint() -> str:
    """First complaint of the quality gate; in its log it follows the line of counts."""
    lines = VERDICT.read_text(encoding="utf-8").splitlines() if VERDICT.exists() else []
    if len(lines) < 2:
        return f"rule verdict failed, see {VERDICT}"
    more = f" (and {len(lines) - 2} more, see {VERDICT})" if len(lines) > 2 else ""
    return lines[1][:MAX_REASON_LENGTH] + more


REJECTED_SQL = """
select turnout_id || '/hammer/' || split_part(section_id, '/', -1) || '/' || split_part(campaign_id, '/', -1) as unit
from models_current where status = 'rejected' and unit in (select unnest(?))"""
UNUSED_SQL = """
with used as (
    select turnout_id from models_current where status <> 'rejected'
    union all select turnout_id from passages_current where status <> 'rejected'
)
select turnout_id, not exists (select 1 from used u where in_service(u.turnout_id))
from unusable() where used_at_utc is null and turnout_id not in (select turnout_id from used)
group by turnout_id order by turnout_id"""

LEFT_OUT_SQL = """
select path || ', ' || place || ': ' || found from quarantine_open where reason_code = 'configuration_error'
group by path, place, found order by path, place, found"""

UNREAD_SQL = """
select path || ': ' || found from quarantine_open where reason_code in ('no_access', 'read_fault') order by path"""

# Entries of the raw root that belong to no unit: tables beside the recordings, which many recordings need, come first.
EXCLUDED_SQL = """
select path || coalesce(', ' || place, '') || ': ' || found from quarantine_open
where kind = 'configuration' and reason_code not in ('no_access', 'configuration_error') and not is_remark
    and not coalesce(list_contains(?, turnout_id), false)
order by path not like '%.csv' or reason_code = 'name_unknown', path, place"""


def configuration_errors(registry: Path) -> list[str]:
    """Errors of the configuration for which turnouts were left out.

    Parameters
    ----------
    registry : Path
        Folder of the registry.

    Returns
    -------
    list of str
        File, place and what was found; none without a registry.
    """
    return [text for (text,) in _query(registry, LEFT_OUT_SQL, [])]


def unread_files(registry: Path) -> list[str]:
    """Files and folders that are there and could not be read, whether or not they belong to a unit.

    Parameters
    ----------
    registry : Path
        Folder of the registry.

    Returns
    -------
    list of str
        Path and what was found; none without a registry.
    """
    return [text for (text,) in _query(registry, UNREAD_SQL, [])]


def excluded_entries(registry: Path, unused: Collection[str] = ()) -> list[str]:
    """Files and rows of the raw root in quarantine that belong to no unit, such as a line of campaigns.csv.

    Parameters
    ----------
    registry : Path
        Folder of the registry.
    unused : collection of str
        Turnouts whose entries are left out, because the report names them as a whole.

    Returns
    -------
    list of str
        Path, place and what was found, tables beside the recordings first; none without a registry. Those of
        ``unread_files`` are left out.
    """
    return [text for (text,) in _query(registry, EXCLUDED_SQL, [list(unused)])]


def rejected_units(units: Collection[str], registry: Path) -> list[str]:
    """Those of the ``units`` whose hammer test was rejected.

    Parameters
    ----------
    units : collection of str
        Names of units; those of passages are never rejected.
    registry : Path
        Folder of the registry.

    Returns
    -------
    list of str
        Names of the rejected units; none without a registry.
    """
    return [unit for (unit,) in _query(registry, REJECTED_SQL, [list(units)])] if units else []


def unused_turnouts(registry: Path) -> tuple[list[str], bool]:
    """Turnouts with files but without any accepted test or passage; and whether that holds for all.

    Parameters
    ----------
    registry : Path
        Folder of the registry.

    Returns
    -------
    tuple of (list of str, bool)
        Ids of the turnouts, sorted; False without a registry.
    """
    rows = _query(registry, UNUSED_SQL, [])
    return [turnout for turnout, _ in rows], any(nothing for _, nothing in rows)


def _query(registry: Path, sql: str, values: list) -> list[tuple]:
    if not (registry / GENERATION_FILE).exists():
        return []
    try:
        with open_registry(registry) as connection:
            return connection.execute(sql, values).fetchall()
    except (RegistryError, duckdb.Error):  # the report of a failed night must be printed all the same
        return []
