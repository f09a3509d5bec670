"""Reveal a set: verify every seal, then put the truths beside the findings."""

import json
import shutil
from pathlib import Path

from turnout_blind.diagnose import diagnosis_folder
from turnout_blind.seal import BlindError, digest, read_commit, verify


def reveal(out, truth):
    """Copy the truths to ``out``/revealed, after verifying all seals and that findings exist; returns the truths.

    Errors: BlindError if a seal is broken, or if nothing has been diagnosed yet.
    """
    out, truth = Path(out), Path(truth)
    truths = verify(out, truth)
    record = out / "diagnosis.json"
    if not record.exists():
        raise BlindError(record, "line 1", "nothing has been diagnosed yet", "Run turnout blind diagnose first")
    diagnosis = json.loads(record.read_text())
    if diagnosis["commit_sha256"] != digest((out / "commit.json").read_bytes()):
        raise BlindError(record, "commit_sha256", "diagnosed under another commit", "This set proves nothing")
    (out / "revealed").mkdir(exist_ok=True)
    for path in sorted(truth.glob("*.json")):
        shutil.copyfile(path, out / "revealed" / path.name)
    return truths


def read_revealed(out, label=None):
    """(truths, rows by case, diagnosis) of a revealed set, with its seals verified again.

    Rows are None where the tool failed. ``label`` selects the findings of an ablation.
    """
    out = Path(out)
    if not (out / "revealed").exists():
        raise BlindError(out, "revealed", "the truth has not been revealed", "Run turnout blind reveal first")
    return verify(out, out / "revealed"), *read_findings(out, label)


def read_findings(out, label=None):
    """(rows by case, diagnosis) of a set; BlindError if they are not what the tool wrote under this commit."""
    folder = diagnosis_folder(out, label)
    record = folder / "diagnosis.json"
    diagnosis = json.loads(record.read_text())
    if diagnosis["commit_sha256"] != digest((Path(out) / "commit.json").read_bytes()):
        raise BlindError(record, "commit_sha256", "diagnosed under another commit", "This set proves nothing")
    rows = {}
    for case in read_commit(out)["cases"]:
        run, path = diagnosis["cases"].get(case), folder / "findings" / f"{case}.json"
        rows[case] = None
        if run and run["status"] == "answered":
            data = path.read_bytes()
            if digest(data) != run["rows_sha256"]:
                raise BlindError(path, "line 1", "not the rows that the tool wrote", "Diagnose a set made anew")
            rows[case] = json.loads(data)
    return rows, diagnosis
