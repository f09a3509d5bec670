"""Run the unchanged tool on every case of a set, in processes that cannot read the truth."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

import turnout
from turnout_blind.isolation import HiddenFolders
from turnout_blind.limited_process import run, with_cpu_limit
from turnout_blind.seal import BlindError, check_seals, digest, digest_of_folder, read_commit
from turnout_blind.whole_file import write_whole

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping
    from typing import Any

# Runs in a copy of the case, which holds config/ and raw/. Filled in are {python}, {case}, {folder} (the copy), {work}
# (a folder for this case) and {out} (a JSON file of rows). Without {out} the rows are the JSON that the tool prints.
COMMAND = "{python} -m turnout.cli.main diagnose --turnout {case} --visit all --work {work} --json"
HISTORY_COMMAND = "{python} -m turnout.cli.main twin --turnout {case} --each-visit --work {work} --json"
MAX_WALL_TIME, MAX_CPU_TIME = 1800.0, 900.0  # budget of a case: wall clock and CPU time [s]


def diagnose_set(
    out: str | Path,
    truth: str | Path,
    command: str = COMMAND,
    only: Collection[str] | None = None,
    timeout: float = MAX_WALL_TIME,
    workers: int = 1,
    report: Callable[[str], Any] = print,
    cpu: float = MAX_CPU_TIME,
    again: bool = False,
    progress: Callable[..., Iterable] | None = None,
    label: str | None = None,
) -> dict[str, Any]:
    """Write ``out``/findings/<case>.json and ``out``/diagnosis.json.

    A case that has run is not run again; with ``again`` failed ones are. A case fails if the tool fails, or exceeds its
    budget. It then has no rows, only the last line of output. A failure never stops the other cases, and the scorer
    counts it as no answer. A case that runs when the diagnosis is interrupted is ended and has not run.

    Parameters
    ----------
    out : str or Path
        Folder of the set.
    truth : str or Path
        Folder of the truths.
    command : str
        Command of a case, see ``COMMAND``.
    only : collection of str or None
        Cases to run; None: all.
    timeout : float
        Limit of wall clock per case. [s]
    workers : int
        Number of cases at a time.
    report : callable
        Called with a line for each case.
    cpu : float
        Limit of CPU time per case. [s]
    again : bool
        Whether failed cases are run again.
    progress : callable or None
        (iterable of finished cases, their number) -> iterable.
    label : str or None
        Name of an ablation: another command on the same cases, stored below ``out``/ablations/<label>.

    Returns
    -------
    dict
        Content of diagnosis.json.

    Raises
    ------
    BlindError
        If the tool or the command has changed, if the set was made for another tool, if it is revealed already, if a
        truth or recording does not match its seal, or if there is no such case.
    """
    out, commit = Path(out).resolve(), read_commit(out)
    tool, folder = Path(turnout.__file__).parent, diagnosis_folder(out, label)
    tool_sha256, record_path = digest_of_folder(tool), folder / "diagnosis.json"
    diagnosis: dict[str, Any] = (
        json.loads(record_path.read_text()) if record_path.exists() else {"tool_sha256": tool_sha256, "cases": {}}
    )
    if diagnosis["tool_sha256"] != tool_sha256:
        raise BlindError(
            record_path, "tool_sha256", "the tool has changed since the first case", "Diagnose a set made again"
        )
    if diagnosis.get("command", command) != command:
        raise BlindError(
            record_path, "command", "another command than that of the first case", "Judge all by one command"
        )
    if label is None and (commit.get("examines") or tool_sha256) != tool_sha256:
        raise BlindError(out / "commit.json", "examines", "made for another tool than this", "Make a set for this one")
    revealed_folder = out / "revealed"
    if label is None and revealed_folder.exists():
        raise BlindError(revealed_folder, "truth", "this set is open", "Judge a set made again, or an ablation")
    if missing := sorted(set(only or ()) - set(commit["cases"])):
        some = ", ".join([*sorted(commit["cases"])[:5], *(["..."] if len(commit["cases"]) > 5 else [])])
        raise BlindError(out, "--cases", f"there is no case {missing[0]!r}", f"There are {some}")
    check_seals(out, truth)  # before hours of work, and because the folder that is hidden must be that of this set
    diagnosis |= {"commit_sha256": digest((out / "commit.json").read_bytes()), "command": command}
    diagnosis |= {"budget": {"wall_s": timeout, "cpu_s": cpu}}
    (folder / "findings").mkdir(parents=True, exist_ok=True)
    with HiddenFolders(
        truth, [*_generator_folders(), *([revealed_folder] if revealed_folder.exists() else [])]
    ) as hidden:
        diagnosis |= {"isolation": hidden.method, "canary": hidden.canary}
        pending = [case for case in sorted(only or commit["cases"]) if _is_pending(diagnosis["cases"].get(case), again)]
        stop = Event()
        with ThreadPoolExecutor(workers) as pool:  # threads suffice: each waits for a process of its own
            jobs = {
                pool.submit(_diagnose_safely, hidden, (out, folder), case, command, timeout, cpu, stop): case
                for case in pending
            }
            try:
                for job in (progress or (lambda finished, total: finished))(as_completed(jobs), len(jobs)):
                    diagnosis["cases"][jobs[job]] = job.result()
                    report(f"{jobs[job]}: {diagnosis['cases'][jobs[job]]['said']}")
                    _write_record(record_path, diagnosis)
            except BaseException:
                stop.set()
                pool.shutdown(cancel_futures=True)
                raise
    _write_record(record_path, diagnosis)
    if digest_of_folder(tool) != tool_sha256:
        raise BlindError(tool, "source", "changed while it diagnosed", "Diagnose a set made again, tool left alone")
    return diagnosis


def _is_pending(run: Mapping[str, Any] | None, again: bool) -> bool:
    return run is None or (again and run["status"] != "answered")


def _write_record(path: Path, diagnosis: Mapping[str, Any]) -> None:
    write_whole(path, (json.dumps(diagnosis, indent=1, sort_keys=True) + "\n").encode())


def _generator_folders() -> list[Path]:
    """Folders of every copy of this package that an import could find."""
    folders = {Path(__file__).parent, *(Path(p or ".").resolve() / "turnout_blind" for p in sys.path)}
    return sorted(folder for folder in folders if folder.is_dir())


def diagnosis_folder(out: str | Path, label: str | None = None) -> Path:
    """Folder of the findings: of the tool, or of an ablation of it.

    Parameters
    ----------
    out : str or Path
        Folder of the set.
    label : str or None
        Name of an ablation; None: the tool itself.

    Returns
    -------
    Path
        The folder.
    """
    return Path(out) if label is None else Path(out) / "ablations" / label


def _diagnose_safely(
    hidden: HiddenFolders, folders: tuple[Path, Path], case: str, command: str, timeout: float, cpu: float, stop: Event
) -> dict[str, Any]:
    """``_diagnose_case``, with any error turned into the result of that case."""
    try:
        return _diagnose_case(hidden, *folders, case, command, timeout, cpu, stop)
    except Exception as error:
        return _run_record("failed", -1, 0.0, 0.0, f"{type(error).__name__}: {error}", None)


def _diagnose_case(
    hidden: HiddenFolders, out: Path, folder: Path, case: str, command: str, timeout: float, cpu: float, stop: Event
) -> dict[str, Any]:
    rows_path, work, copy = folder / "findings" / f"{case}.json", folder / "work" / case, folder / "copies" / case
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(out / "cases" / case, copy)  # files that the tool writes break no seal
    rows_path.unlink(missing_ok=True)
    fields = {"python": sys.executable, "case": case, "folder": copy, "out": rows_path, "work": work / "tool"}
    try:
        arguments = [w.format(**fields) for w in shlex.split(command)]
        process = run(with_cpu_limit(hidden.isolated_command(arguments), cpu), copy, work, timeout, cpu, stop)
    finally:
        shutil.rmtree(copy, ignore_errors=True)
    message, ok = process.last_line, process.code == 0
    if ok and "{out}" not in command:
        printed = printed_rows(process.out)
        ok = printed is not None
        if printed is None:
            message = f"printed no rows; {message}"
        else:
            message = f"{len(printed)} row{'s' if len(printed) > 1 else ''} printed" if printed else message
            write_whole(rows_path, (json.dumps(printed, indent=1) + "\n").encode())
    ok = ok and _holds_rows(rows_path)
    status = "answered" if ok else "over budget" if process.stop_reason else "failed"
    return _run_record(status, process.code, process.cpu, process.wall, message, rows_path if ok else None)


def _run_record(
    status: str, code: int, cpu: float, wall: float, message: str, rows_path: Path | None
) -> dict[str, Any]:
    return {
        "status": status, "exit_code": code, "cpu_s": round(cpu, 2), "wall_s": round(wall, 2), "said": message[:300],
        "rows_sha256": digest(rows_path.read_bytes()) if rows_path else None,
    }  # fmt: skip


def _holds_rows(path: Path) -> bool:
    """Whether the file holds a list of objects with a verdict, at least one."""
    try:
        rows = json.loads(path.read_text())
    except (OSError, ValueError):
        return False
    return isinstance(rows, list) and bool(rows) and all(isinstance(r, dict) and r.get("verdict") for r in rows)


def printed_rows(text: str) -> list | None:
    r"""Rows of the last JSON object or array that begins a line, or None.

    Parameters
    ----------
    text : str
        Output of the tool.

    Returns
    -------
    list or None
        Rows; a single object is one row, or has the rows in ``result``.

    Examples
    --------
    >>> printed_rows('reading\n[{"verdict": "none"}]\npage: results/pages/T1.html')
    [{'verdict': 'none'}]
    >>> printed_rows('{"command": "diagnose", "result": [{"verdict": "none"}]}')
    [{'verdict': 'none'}]
    >>> printed_rows("nothing") is None
    True
    """
    decoder, last_value, after = json.JSONDecoder(), None, 0
    starts = [0, *(i + 1 for i, letter in enumerate(text) if letter == "\n")]
    for start in starts:
        if start < after or text[start : start + 1] not in ("[", "{"):
            continue
        try:
            value, after = decoder.raw_decode(text, start)
        except ValueError:
            continue
        last_value = value
    if isinstance(last_value, dict) and isinstance(last_value.get("result"), list):
        return last_value["result"]
    return last_value if isinstance(last_value, list) or last_value is None else [last_value]
