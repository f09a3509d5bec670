"""Let the frozen tool diagnose every case of a set, in processes that cannot read the truth."""

import json
import resource
import shlex
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import turnout
from turnout_blind.isolation import Hidden
from turnout_blind.seal import BlindError, digest, digest_of_folder, read_commit

# Run in the folder of the case, which holds config/ and raw/. {python}, {case}, {folder}, {work} (a folder of the
# case's own) and {out} (a JSON file of rows) are filled in; without {out} the rows are the JSON that it prints last.
COMMAND = "{python} -m turnout.cli diagnose --turnout {case} --work {work} --json"


def diagnose_set(out, truth, command=COMMAND, only=None, timeout=1800, workers=1, say=print):
    """Write ``out``/findings/<case>.json and ``out``/diagnosis.json; returns the latter's content.

    A case that has its findings is not run again, unless the tool has changed: then BlindError. A case on which the
    tool fails gets rows None and the end of what it said. ``only``: these cases; ``workers`` of them at a time.
    """
    out, sealed = Path(out).resolve(), read_commit(out)
    tool = Path(turnout.__file__).parent
    frozen, record = digest_of_folder(tool), out / "diagnosis.json"
    held = json.loads(record.read_text()) if record.exists() else {"tool_sha256": frozen, "cases": {}}
    if held["tool_sha256"] != frozen:
        raise BlindError(record, "tool_sha256", "the tool has changed since the first case", "Diagnose a set made anew")
    held |= {"commit_sha256": digest((out / "commit.json").read_bytes()), "command": command}
    (out / "findings").mkdir(exist_ok=True)
    with Hidden(truth, _generators()) as hidden:
        held |= {"isolation": hidden.how, "canary": hidden.canary}
        waiting = [case for case in sorted(only or sealed["cases"]) if case not in held["cases"]]
        jobs = [(hidden, out, case, command, timeout) for case in waiting]
        with ProcessPoolExecutor(workers) as pool:  # processes: each knows the CPU time of its own children
            for case, run in zip(waiting, pool.map(_diagnose, jobs)):
                held["cases"][case] = run
                say(f"{case}: {run['said']}")
                record.write_text(json.dumps(held, indent=1, sort_keys=True) + "\n")
    if digest_of_folder(tool) != frozen:
        raise BlindError(tool, "source", "changed while it diagnosed", "Diagnose a set made anew, tool left alone")
    return held


def _generators():
    """Every copy of this package that an import could find."""
    here = {Path(__file__).parent, *(Path(p or ".").resolve() / "turnout_blind" for p in sys.path)}
    return sorted(folder for folder in here if folder.is_dir())


def _diagnose(job):
    hidden, out, case, command, timeout = job
    rows, work, folder = out / "findings" / f"{case}.json", out / "work" / case, out / "cases" / case
    named = {"python": sys.executable, "case": case, "folder": folder, "out": rows, "work": work}
    words = [w.format(**named) for w in shlex.split(command)]
    before, began, code, said = _cpu(), time.perf_counter(), -1, ""
    try:
        done = hidden.run(words, capture_output=True, text=True, timeout=timeout, cwd=folder)
        code, said = done.returncode, done.stdout + done.stderr
        if code == 0 and "{out}" not in command:
            rows.write_text(json.dumps(_printed(done.stdout), indent=1) + "\n")
    except subprocess.TimeoutExpired:
        said = f"no answer within {timeout:.0f} s of the clock"
    except (OSError, json.JSONDecodeError) as error:  # it cannot start, or prints no rows: a result too
        code, said = code or -1, f"{type(error).__name__}: {error}"
    ok = code == 0 and rows.exists()
    return {
        "status": "answered" if ok else "failed",
        "exit_code": code,
        "cpu_s": round(_cpu() - before, 2),
        "wall_s": round(time.perf_counter() - began, 2),
        "said": next(reversed(said.strip().splitlines()), "")[:300],
        "rows_sha256": digest(rows.read_bytes()) if ok else None,
    }


def _printed(text):
    """Rows of the JSON object or array that ends ``text``."""
    lines = text.splitlines()
    first = next((i for i, line in enumerate(lines) if line[:1] in "[{" and line.strip()), len(lines))
    found = json.loads("\n".join(lines[first:]))
    return found if isinstance(found, list) else [found]


def _cpu():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
