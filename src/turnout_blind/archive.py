"""Store a revealed set in one small file: seals, truths and findings. Seeds reproduce the recordings."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import TYPE_CHECKING

from turnout_blind.campaign import stage
from turnout_blind.effect import load_effects
from turnout_blind.reveal import read_findings
from turnout_blind.seal import SET_FILE, BlindError, digest, file_digests, verify
from turnout_blind.site import PLAIN
from turnout_blind.strata import CasePlan, case_id, plan_cases
from turnout_blind.whole_file import write_whole

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from turnout_blind.effect import Effect

ARCHIVE_NAME = "set.json.gz"


def write_archive(out: str | Path, folder: str | Path, truth: str | Path | None = None) -> Path:
    """Write ``folder``/set.json.gz: the commit, the sealed truths, and the findings where the set was diagnosed.

    All seals are verified first.

    Parameters
    ----------
    out : str or Path
        Folder of the set.
    folder : str or Path
        Folder of the archive, created where it does not exist.
    truth : str, Path or None
        Folder of the truths; None: those revealed in ``out``.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    BlindError
        If a seal is broken.
    """
    out, folder = Path(out), Path(folder)
    truth = out / "revealed" if truth is None else Path(truth)
    truths = verify(out, truth)
    rows, diagnosis = read_findings(out) if (out / "diagnosis.json").exists() else ({}, None)
    content = {
        "commit": (out / "commit.json").read_text(),
        "set": (truth / SET_FILE).read_text(),
        "truths": {case: (truth / f"{case}.json").read_text() for case in sorted(truths)},
        "rows": rows,
        "diagnosis": diagnosis,
    }
    data = json.dumps(content, sort_keys=True, separators=(",", ":")).encode()
    write_whole(folder / ARCHIVE_NAME, gzip.compress(data, 9, mtime=0))
    return folder / ARCHIVE_NAME


def read_archive(folder: str | Path) -> dict[str, Any]:
    """Content of an archive, as ``write_archive`` wrote it.

    Parameters
    ----------
    folder : str or Path
        Folder of the archive.

    Returns
    -------
    dict
        "commit" and "set" as text, "truths" by case, "rows" by case, "diagnosis".
    """
    return json.loads(gzip.decompress((Path(folder) / ARCHIVE_NAME).read_bytes()))


def verify_archive(archive: Mapping[str, Any], effects: Mapping[str, Effect] | None = None) -> dict[str, Any]:
    """Truths by case, after every check that needs no recording.

    Checked are the seals of set and truths, and the ids, strata, effects and seeds of the plan. Position and size of
    every effect must be those that the seed of the case draws.

    Parameters
    ----------
    archive : mapping
        Content of an archive, from ``read_archive``.
    effects : mapping or None
        Effects by kind; None: those of the package.

    Returns
    -------
    dict
        Truth by case.

    Raises
    ------
    BlindError
        At the first check that fails.
    """
    commit, set_info = json.loads(archive["commit"]), json.loads(archive["set"])
    effects = effects or load_effects()
    _check_same(ARCHIVE_NAME, "set", digest(archive["set"].encode()), commit["set_sha256"])
    plans = plan_cases(set_info["seed"], effects, set_info["full"], set_info.get("only") or None, _panel(set_info))
    plans = plans[: set_info.get("limit")]
    planned = {case_id(set_info["seed"], k): plan for k, plan in enumerate(plans)}
    _check_same(ARCHIVE_NAME, "cases", sorted(commit["cases"]), sorted(planned))
    truths = {}
    for case, plan in planned.items():
        text = archive["truths"][case]
        _check_same(ARCHIVE_NAME, case, digest(text.encode()), commit["cases"][case]["truth_sha256"])
        truths[case] = truth = json.loads(text)
        _check_same(ARCHIVE_NAME, case, (truth["stratum"], truth["seed"]), (plan.stratum, list(plan.seed)))
        concealed = stage(plan, effects)[3]
        sealed_effects = [(e["kind"], e["rung"], e["where"], e["parameters"]) for e in truth["effects"]]
        _check_same(
            ARCHIVE_NAME,
            case,
            sealed_effects,
            [(d.kind, d.rung, _as_json(d.where), _as_json(d.parameters)) for d in concealed],
        )
    return truths


def verify_recordings(archive: Mapping[str, Any], case: str, folder: str | Path) -> None:
    """Compare the files of a regenerated case with the sealed ones.

    Parameters
    ----------
    archive : mapping
        Content of an archive, from ``read_archive``.
    case : str
        Id of the case.
    folder : str or Path
        Folder with a folder for the case.

    Raises
    ------
    BlindError
        If they differ.
    """
    _check_same(
        Path(folder) / case,
        "files",
        file_digests(Path(folder) / case),
        json.loads(archive["commit"])["cases"][case]["files"],
    )


def plan_of(archive: Mapping[str, Any], case: str) -> CasePlan:
    """``CasePlan`` of an archived case.

    Parameters
    ----------
    archive : mapping
        Content of an archive, from ``read_archive``.
    case : str
        Id of the case.

    Returns
    -------
    CasePlan
        The plan.
    """
    truth = json.loads(archive["truths"][case])
    return CasePlan(
        truth["stratum"], tuple((e["kind"], e["rung"]) for e in truth["effects"]), tuple(truth["seed"]), _panel(truth)
    )


def _panel(description: Mapping[str, Any]) -> str:
    """Panel of a set or a case. Older sets had plain track only."""
    return description.get("panel", PLAIN)


def _as_json(mapping: Mapping[str, Any]) -> dict[str, Any]:
    return json.loads(json.dumps(dict(mapping)))


def _check_same(path: str | Path, where: str, actual: Any, expected: Any) -> None:
    if actual != expected:
        raise BlindError(path, where, "not what was sealed", "Take the kept set from its commit again")
