"""Reveal a set: verify every seal, then put the truths beside the findings."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from turnout_blind.diagnose import diagnosis_folder
from turnout_blind.seal import BlindError, digest, read_commit, verify

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any


def reveal(out: str | Path, truth: str | Path) -> dict[str, Any]:
    """Copy the truths to ``out``/revealed, after verifying all seals and that findings exist.

    Parameters
    ----------
    out : str or Path
        Folder of the set.
    truth : str or Path
        Folder of the truths.

    Returns
    -------
    dict
        Truth by case.

    Raises
    ------
    BlindError
        If a seal is broken, or if nothing has been diagnosed yet.
    """
    out, truth = Path(out), Path(truth)
    truths = verify(out, truth)
    record = out / "diagnosis.json"
    if not record.exists():
        raise BlindError(record, "the path", "nothing has been diagnosed yet", "Run turnout blind diagnose first")
    diagnosis = json.loads(record.read_text())
    if diagnosis["commit_sha256"] != digest((out / "commit.json").read_bytes()):
        raise BlindError(record, "commit_sha256", "diagnosed under another commit", "This set proves nothing")
    (out / "revealed").mkdir(exist_ok=True)
    for path in sorted(truth.glob("*.json")):
        shutil.copyfile(path, out / "revealed" / path.name)
    return truths


def undiagnosed_cases(out: str | Path) -> list[str]:
    """Cases that have not been run.

    Parameters
    ----------
    out : str or Path
        Folder of the set.

    Returns
    -------
    list of str
        All cases before a diagnosis.
    """
    record = Path(out) / "diagnosis.json"
    diagnosed = json.loads(record.read_text())["cases"] if record.exists() else {}
    return [case for case in read_commit(out)["cases"] if case not in diagnosed]


def read_revealed(
    out: str | Path, label: str | None = None
) -> tuple[dict[str, Any], dict[str, list | None], dict[str, Any]]:
    """Truths and findings of a revealed set, with its seals verified again.

    Parameters
    ----------
    out : str or Path
        Folder of the set.
    label : str or None
        Name of an ablation; None: the tool itself.

    Returns
    -------
    (dict, dict, dict)
        Truth by case, rows by case (None where the tool failed), diagnosis.

    Raises
    ------
    BlindError
        If the set is not revealed, or a seal is broken.
    """
    out = Path(out)
    if not (out / "revealed").exists():
        raise BlindError(out, "revealed", "the truth has not been revealed", "Run turnout blind reveal first")
    return verify(out, out / "revealed"), *read_findings(out, label)


def set_labels(outs: Sequence[str | Path]) -> list[str]:
    """Prefixes of the case ids of sets that are scored together.

    Parameters
    ----------
    outs : sequence of str or Path
        Folders of the sets.

    Returns
    -------
    list of str
        "" of a single set, "NAME/" of several.

    Raises
    ------
    BlindError
        If a case is in two of the sets: it would count twice.
    """
    seen: dict[str, str | Path] = {}
    for out in outs:
        for case, sealed in read_commit(out)["cases"].items():
            if sealed["truth_sha256"] in seen:
                other = seen[sealed["truth_sha256"]]
                raise BlindError(out, "commit.json", f"case {case} is also in {other}", "Give each set once")
            seen[sealed["truth_sha256"]] = out
    return [f"{Path(out).resolve().name}/" if len(outs) > 1 else "" for out in outs]


def read_findings(out: str | Path, label: str | None = None) -> tuple[dict[str, list | None], dict[str, Any]]:
    """Findings of a set.

    Parameters
    ----------
    out : str or Path
        Folder of the set.
    label : str or None
        Name of an ablation; None: the tool itself.

    Returns
    -------
    (dict, dict)
        Rows by case (None where the tool failed), diagnosis.

    Raises
    ------
    BlindError
        If they are not what the tool wrote under this commit.
    """
    folder = diagnosis_folder(out, label)
    record = folder / "diagnosis.json"
    diagnosis = json.loads(record.read_text())
    if diagnosis["commit_sha256"] != digest((Path(out) / "commit.json").read_bytes()):
        raise BlindError(record, "commit_sha256", "diagnosed under another commit", "This set proves nothing")
    rows: dict[str, list | None] = {}
    for case in read_commit(out)["cases"]:
        run, path = diagnosis["cases"].get(case), folder / "findings" / f"{case}.json"
        rows[case] = None
        if run and run["status"] == "answered":
            data = path.read_bytes()
            if digest(data) != run["rows_sha256"]:
                raise BlindError(path, "line 1", "not the rows that the tool wrote", "Diagnose a set made again")
            rows[case] = json.loads(data)
    return rows, diagnosis
