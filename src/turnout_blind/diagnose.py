"""Run the unchanged tool on every case of a set, in processes that cannot read the truth."""

import json
import os
import shlex
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import turnout
from turnout_blind.isolation import Hidden
from turnout_blind.limited_process import limited, run
from turnout_blind.seal import BlindError, digest, digest_of_folder, read_commit

# Runs in a copy of the case, which holds config/ and raw/. Filled in are {python}, {case}, {folder} (the copy), {work}
# (a folder for this case) and {out} (a JSON file of rows). Without {out} the rows are the JSON that the tool prints.
COMMAND = "{python} -m turnout.cli.main diagnose --turnout {case} --visit all --work {work} --json"
WALL, CPU = 1800.0, 900.0  # budget of a case: wall clock and CPU time [s]


def diagnose_set(
    out, truth, command=COMMAND, only=None, timeout=WALL, workers=1, say=print, cpu=CPU,
    again=False, progress=None, label=None,
):  # fmt: skip
    """Write ``out``/findings/<case>.json and ``out``/diagnosis.json; returns the content of diagnosis.json.

    A case that has run is not run again; with ``again`` failed ones are. BlindError if the tool or the command has
    changed, or if the set is revealed already. A case fails if the tool fails, or exceeds ``timeout`` [s] of wall clock
    or ``cpu`` [s]. It then has no rows, only the last line of output. A failure never stops the other cases, and the
    scorer counts it as no answer. ``only`` lists the cases to run, ``workers`` is the number at a time, and
    ``progress`` wraps the finished cases. With a ``label`` it is an ablation: another command on the same cases, stored
    below ``out``/ablations/<label>.
    """
    out, sealed = Path(out).resolve(), read_commit(out)
    tool, home = Path(turnout.__file__).parent, home_of(out, label)
    frozen, record = digest_of_folder(tool), home / "diagnosis.json"
    held = json.loads(record.read_text()) if record.exists() else {"tool_sha256": frozen, "cases": {}}
    if held["tool_sha256"] != frozen:
        raise BlindError(record, "tool_sha256", "the tool has changed since the first case", "Diagnose a set made anew")
    if held.get("command", command) != command:
        raise BlindError(record, "command", "another command than that of the first case", "Judge all by one command")
    if label is None and (sealed.get("examines") or frozen) != frozen:
        raise BlindError(out / "commit.json", "examines", "made for another tool than this", "Make a set for this one")
    open_truth = out / "revealed"
    if label is None and open_truth.exists():
        raise BlindError(open_truth, "truth", "this set is open", "Judge a set made anew, or an ablation")
    held |= {"commit_sha256": digest((out / "commit.json").read_bytes()), "command": command}
    held |= {"budget": {"wall_s": timeout, "cpu_s": cpu}}
    (home / "findings").mkdir(parents=True, exist_ok=True)
    with Hidden(truth, [*_generators(), *([open_truth] if open_truth.exists() else [])]) as hidden:
        held |= {"isolation": hidden.how, "canary": hidden.canary}
        waiting = [case for case in sorted(only or sealed["cases"]) if _waits(held["cases"].get(case), again)]
        with ThreadPoolExecutor(workers) as pool:  # threads suffice: each waits for a process of its own
            jobs = {pool.submit(_guarded, hidden, (out, home), case, command, timeout, cpu): case for case in waiting}
            try:
                for job in (progress or (lambda done, total: done))(as_completed(jobs), len(jobs)):
                    held["cases"][jobs[job]] = job.result()
                    say(f"{jobs[job]}: {held['cases'][jobs[job]]['said']}")
                    _write(record, held)
            except KeyboardInterrupt:
                pool.shutdown(cancel_futures=True)
                raise
    _write(record, held)
    if digest_of_folder(tool) != frozen:
        raise BlindError(tool, "source", "changed while it diagnosed", "Diagnose a set made anew, tool left alone")
    return held


def _waits(run, again):
    return run is None or (again and run["status"] != "answered")


def _write(record, held):
    """Replace the file at once: an interrupted write leaves the former file."""
    part = record.with_suffix(".part")
    part.write_text(json.dumps(held, indent=1, sort_keys=True) + "\n")
    os.replace(part, record)


def _generators():
    """Folders of every copy of this package that an import could find."""
    here = {Path(__file__).parent, *(Path(p or ".").resolve() / "turnout_blind" for p in sys.path)}
    return sorted(folder for folder in here if folder.is_dir())


def home_of(out, label=None):
    """Folder of the findings: of the tool, or of an ablation of it."""
    return Path(out) if label is None else Path(out) / "ablations" / label


def _guarded(hidden, folders, case, command, timeout, cpu):
    """``_diagnose_case``, with any error turned into the result of that case."""
    try:
        return _diagnose(hidden, *folders, case, command, timeout, cpu)
    except Exception as error:
        return _result("failed", -1, 0.0, 0.0, f"{type(error).__name__}: {error}", None)


def _diagnose(hidden, out, home, case, command, timeout, cpu):
    rows, work, folder = home / "findings" / f"{case}.json", home / "work" / case, home / "copies" / case
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(out / "cases" / case, folder)  # files that the tool writes break no seal
    rows.unlink(missing_ok=True)
    named = {"python": sys.executable, "case": case, "folder": folder, "out": rows, "work": work / "tool"}
    try:
        words = [w.format(**named) for w in shlex.split(command)]
        done = run(limited(hidden.inside(words), cpu), folder, work, timeout, cpu)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    said, ok = done.last_words, done.code == 0
    if ok and "{out}" not in command:
        found = printed(done.out)
        ok = found is not None
        said = said if ok else f"printed no rows; {said}"
        if ok:
            rows.write_text(json.dumps(found, indent=1) + "\n")
    ok = ok and _are_rows(rows)
    status = "answered" if ok else "over budget" if done.spent else "failed"
    return _result(status, done.code, done.cpu, done.wall, said, rows if ok else None)


def _result(status, code, cpu, wall, said, rows):
    return {
        "status": status, "exit_code": code, "cpu_s": round(cpu, 2), "wall_s": round(wall, 2), "said": said[:300],
        "rows_sha256": digest(rows.read_bytes()) if rows else None,
    }  # fmt: skip


def _are_rows(path):
    """Whether the file holds a list of objects with a verdict, at least one."""
    try:
        found = json.loads(path.read_text())
    except (OSError, ValueError):
        return False
    return isinstance(found, list) and bool(found) and all(isinstance(r, dict) and r.get("verdict") for r in found)


def printed(text):
    """Rows of the last JSON object or array that begins a line of ``text``, or None.

    >>> printed('reading\\n[{"verdict": "none"}]\\npage: results/pages/T1.html')
    [{'verdict': 'none'}]
    >>> printed("nothing") is None
    True
    """
    decoder, found, after = json.JSONDecoder(), None, 0
    starts = [0, *(i + 1 for i, letter in enumerate(text) if letter == "\n")]
    for start in starts:
        if start < after or text[start : start + 1] not in ("[", "{"):
            continue
        try:
            value, after = decoder.raw_decode(text, start)
        except ValueError:
            continue
        found = value
    return found if isinstance(found, list) or found is None else [found]
