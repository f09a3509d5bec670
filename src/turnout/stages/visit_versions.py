"""Versions of the information of a visit: digests of everything that its fit depends on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from turnout.content import sha256_of
from turnout.stages.copied_files import without_copies
from turnout.stages.track_files import digest_of_model
from turnout.workflow.notes import notes_of

if TYPE_CHECKING:
    from turnout.config.turnout import TurnoutConfig
    from turnout.records import Unit


def version_of(
    units: Sequence[Unit], turnout: TurnoutConfig, raw_root: str | Path, track: str | None, code: str
) -> dict[str, str]:
    """Versions that the information of a visit depends on.

    Parameters
    ----------
    units : sequence of Unit
        Hammer tests and passages of the visit.
    turnout : TurnoutConfig
        With the notes of its raw folder.
    raw_root : path
    track : str or None
        Track file, None: the turnout's own.
    code : str
        Fingerprint of the code.

    Returns
    -------
    dict
        "code", "model" (track, vehicles and settings), "recordings" (content, without copies), "notes" (rows of
        campaigns.csv and trains.csv about them) and "files" (names, sizes and times of change) -> digest.
    """
    paths: dict[str, str] = {}  # of each content the first path
    for path, *_ in _files_of(units):
        content = sha256_of(file) if (file := Path(raw_root) / path).is_file() else f"no file {path}"
        paths.setdefault(content, path)
    contents = [[path, content] for content, path in paths.items()]
    distinct, _ = without_copies(units, raw_root)
    notes = version_by_files(distinct, turnout, track, code)["notes"]
    return version_by_files(units, turnout, track, code) | {"recordings": _digest(contents), "notes": notes}


def version_by_files(units: Sequence[Unit], turnout: TurnoutConfig, track: str | None, code: str) -> dict[str, str]:
    """The same without "recordings", so that no recording is read. Where copies are, "notes" may be another one.

    Parameters
    ----------
    units, turnout, track, code
        As ``version_of``.

    Returns
    -------
    dict
        "code", "model", "notes" and "files" -> digest.
    """
    model = f"{turnout.hashes['mismatch']}/{digest_of_model(turnout, track)}"
    notes = _digest(sorted(notes_of(turnout, units)))
    return {"code": code, "model": model, "notes": notes, "files": _digest(_files_of(units))}


def by_content(versions: Mapping[str, Mapping[str, str]]) -> dict[str, dict[str, str]]:
    """Versions without names, sizes and times of files: a copied folder is not fitted again.

    Parameters
    ----------
    versions : mapping
        Visit -> as ``version_of``.

    Returns
    -------
    dict
    """
    return {visit: {k: v for k, v in version.items() if k != "files"} for visit, version in versions.items()}


def _files_of(units: Iterable[Unit]) -> list[tuple[str, int, int]]:
    return sorted(file for unit in units for file in unit.files)


def _digest(value: Sequence[Any]) -> str:
    return hashlib.sha256(json.dumps(value).encode()).hexdigest()[:16]
