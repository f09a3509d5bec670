"""Stored visits whose recordings, notes, track file or code have changed, or whose file is damaged: fitted again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.stages.checkpoint import read_value
from turnout.stages.stored_visits import present_versions
from turnout.stages.visit_files import stored_files, visit_of_file
from turnout.stages.visit_fits import VisitFits
from turnout.stages.visit_versions import version_of

if TYPE_CHECKING:
    from turnout.config.turnout import TurnoutConfig
    from turnout.records import Unit


def fit_changed_visits(
    turnout: TurnoutConfig,
    folder: Path,
    by_visit: Mapping[str, Sequence[Unit]],
    raw_root: str | Path,
    track: str | None,
    code: str,
) -> dict[str, dict[str, str]]:
    """Fit the stored visits again that have changed, so that the state never lacks a visit that it had.

    What was stored of them is removed then. A visit that was diagnosed is fitted with the recordings of its diagnosis.
    An open finding stays as long as its recordings, the notes on them and the track file do.

    Parameters
    ----------
    turnout : TurnoutConfig
    folder : Path
        As ``folder_of``.
    by_visit : mapping
        Visit -> its recordings now.
    raw_root : path
    track : str or None
        Track file, None: the turnout's own.
    code : str
        Fingerprint of the code.

    Returns
    -------
    dict
        Versions of all stored visits, as ``present_versions``.
    """
    about = turnout, raw_root, track, code
    present = present_versions(folder, by_visit, *about)
    changed = [path for path in stored_files(folder, turnout.id) if _is_changed(path, present)]
    labels = [visit for visit in present if visit in set(map(visit_of_file, changed))]
    versions = {visit: version_of(by_visit[visit], *about) for visit in labels}
    answers = dict(answer for path in changed for answer in _answers(path, versions))
    fits = VisitFits(turnout, folder, by_visit, versions, answers, raw_root, folder.parent, track, (), [])
    fits.fit_all(labels)
    for path in changed:
        if _is_changed(path, present):  # of sections that are no group any more
            path.unlink(missing_ok=True)
    return present


def _is_changed(path: Path, present: Mapping[str, Mapping[str, str]]) -> bool:
    """Whether a file is of a visit in ``present``, and damaged or of another version."""
    wanted = present.get(visit_of_file(path))
    if wanted is None:
        return False
    try:
        version = read_value(path)["version"]
    except KeyError:
        return True
    return any(version.get(k) != v for k, v in wanted.items())


def _answers(path: Path, versions: Mapping[str, Mapping[str, str]]) -> list[tuple[tuple[str, str], str]]:
    """The answer of a diagnosis, by visit and neighbours: "" if it was of other recordings, notes or track file."""
    try:
        value = read_value(path)
    except KeyError:
        return []
    visit, version = value["visit"], value["version"]
    holds = all(version.get(k) == versions[visit][k] for k in ("model", "recordings", "notes"))
    return [((visit, value.get("neighbours", "")), value["answer"] if holds else "")] if value["answer"] else []
