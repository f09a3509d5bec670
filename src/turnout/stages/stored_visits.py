"""The information of each visit on disk, in one file per group of sections below the work folder.

Each has the versions of its code, track file, recordings and notes beside these. A file of another version is ignored
and computed again, never read as if it were of this one.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Mapping, MutableMapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from turnout.errors import SimulationError
from turnout.mismatch.calibrated import GroupInformation, StateParameter
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.model_answer import NAMES
from turnout.mismatch.engine.diagnose import fit_base
from turnout.mismatch.engine.large_values import fit_large_values
from turnout.mismatch.engine.search import Search
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.calibration import (
    calibrated_parameters,
    channel_levels,
    one_of_each_group,
    visit_groups,
)
from turnout.mismatch.turnout.further_passages import with_reserved_passages
from turnout.mismatch.turnout.nose_starts import fit_from_nose_positions
from turnout.mismatch.turnout.relinearization import fit_again
from turnout.stages.agreeing_visits import FittedGroup, packed_groups, unpacked_groups
from turnout.stages.checkpoint import SUFFIX, read_value, write_value
from turnout.stages.visit_files import stored_files, visit_of_file
from turnout.stages.visit_time import years_of
from turnout.stages.visit_versions import by_content, version_by_files, version_of

if TYPE_CHECKING:
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.config.turnout import TurnoutConfig
    from turnout.mismatch.calibrated.belief import Belief
    from turnout.mismatch.engine.fit import Fit
    from turnout.records import Unit
    from turnout.stages.mismatch_groups import Group

FOLDER = "calibrated-model"
MAX_FITTED_AXLES = 8  # of all fitted passages of a visit: the others are linear about the fit, and cost little
USED_ANSWERS = ("none", "")  # "": not diagnosed; a visit with an open finding changes nothing until it is accepted
NOSE_POSITION = "place of the kink"  # begin of the name of a parameter


@dataclass(frozen=True)
class StoredVisit:
    """Information of one group of sections at one visit: ``answer`` of its diagnosis, "" without one.

    ``notes`` are those of ``notes_in_words`` on the recordings of the visit, ``levels`` those of ``channel_levels``.
    Of a visit that is not ``fitted`` yet only the answer is known. ``neighbours`` are its sections and those beside
    them without a recording, ``every_group`` those of all groups of the visit.
    """

    visit: str
    sections: str
    answer: str
    groups: tuple[GroupInformation, ...]
    parameters: tuple[StateParameter, ...]
    notes: tuple[tuple[str, str, bool], ...] = ()
    fitted: bool = True
    levels: Mapping[str, float] = field(default_factory=dict)
    neighbours: str = ""
    every_group: tuple[str, ...] = ()


def folder_of(fits: str | Path) -> Path:
    """Folder of the stored visits beside that of the fits.

    Parameters
    ----------
    fits : path

    Returns
    -------
    Path
    """
    return Path(fits).parent / FOLDER


def present_versions(
    folder: Path,
    by_visit: Mapping[str, Sequence[Unit]],
    turnout: TurnoutConfig,
    raw_root: str | Path,
    track: str | None,
    code: str,
) -> dict[str, dict[str, str]]:
    """Versions that the stored visits have with their present recordings.

    Only files that were changed or copied since are read.

    Parameters
    ----------
    folder : Path
        As ``folder_of``.
    by_visit : mapping
        Visit -> its recordings now.
    turnout, raw_root, track, code
        As ``version_of``.

    Returns
    -------
    dict
        Visit -> its versions, for ``read_visits``.
    """
    by_files = {visit: version_by_files(units, turnout, track, code) for visit, units in by_visit.items()}
    unchanged = {s.visit for s in read_visits(folder, turnout.id, by_files)}
    stored = set(map(visit_of_file, stored_files(folder, turnout.id)))
    changed = {
        visit: version_of(units, turnout, raw_root, track, code)
        for visit, units in by_visit.items()
        if visit in stored - unchanged
    }
    return {v: by_files[v] for v in by_visit if v in unchanged} | by_content(changed)


def fit_group(
    group: Group,
    case: TrackCase,
    settings: MismatchSettings,
    without: Collection[str] = (),
    store: MutableMapping[str, Any] | None = None,
    start: Belief | None = None,
) -> FittedGroup:
    """Fit of a group of sections at one visit, with values far beyond their priors where the evidence asks for them.

    Parameters
    ----------
    group : Group
        The sections.
    case : TrackCase
        Their case.
    settings : MismatchSettings
    without : collection of str
        Names of effects that are left out of the library.
    store : mapping or None
        Fits of the diagnosis, which has the base fit.
    start : Belief or None
        Begins at its means. None: at the values of the file.

    Returns
    -------
    FittedGroup

    Raises
    ------
    SimulationError
        The base model cannot be simulated.
    """
    means = {} if start is None else dict(zip(start.names, start.mean.tolist()))
    at_start = {n: means[p.name] for n, p in calibrated_parameters(case, group.route).items() if p.name in means}
    search, fit = fit_base(Search.of(case, settings, None, store), at_start)
    assert isinstance(search.case, TrackCase)
    parameters = calibrated_parameters(search.case, group.route)
    positions = [nuisance for nuisance, p in parameters.items() if p.name.startswith(NOSE_POSITION)]
    if start is None:
        fit = fit_from_nose_positions(search, fit, positions)
    may_be_large = [
        nuisance
        for nuisance, p in parameters.items()
        if p.may_change and p.group in dict(CALIBRATION.least_sizes) and NAMES[p.group] not in without
    ]
    dampers = {f"{p.group}_{p.index}": n for n, p in parameters.items() if p.group.endswith("_damper")}
    partners = {n: dampers[key] for n in may_be_large if (key := _damper_key(parameters[n])) in dampers}
    fit = fit_large_values(search, fit, may_be_large, CALIBRATION.change_sds, partners)
    case, fit = with_reserved_passages(search.case, fit, one_of_each_group(search.case))
    if positions:
        fit = _fit_again(case, fit, may_be_large, partners)
    return FittedGroup(*with_reserved_passages(case, fit), parameters, ", ".join(group.labels), group.route)


def store_visit(
    folder: Path,
    group: Group,
    case: TrackCase,
    answer: str,
    about: Mapping[str, Any],
    store: MutableMapping[str, Any] | None = None,
) -> FittedGroup:
    """Fit a group of sections at one visit and write its information.

    Parameters
    ----------
    folder : Path
        As ``folder_of``.
    group : Group
        The sections.
    case : TrackCase
        Their case.
    answer : str
        Of the diagnosis, "" without one.
    about : mapping
        turnout, visit, version (as ``version_of``), notes (as ``notes_in_words``) if there are any, and ``every_group``
        (as ``StoredVisit``) if the visit has several.
    store : mapping or None
        Fits of the diagnosis, which has the base fit.

    Returns
    -------
    FittedGroup
        The fit that the information is of, without its Jacobian.

    Raises
    ------
    SimulationError
        The base model cannot be simulated.
    """
    settings = about["turnout"].settings["mismatch"]
    fitted = fit_group(group, case, settings, about.get("without", ()), store)
    information = visit_groups(fitted.case, fitted.fit, fitted.sections, group.route)
    levels = channel_levels(fitted.case, fitted.fit)
    _write_visit(folder, group, fitted.parameters, answer, about, information, levels)
    return fitted.without_jacobian()


def store_answer(folder: Path, group: Group, case: TrackCase, answer: str, about: Mapping[str, Any]) -> None:
    """Write the answer of a group of sections at one visit, which is fitted where its information is asked for.

    Of a visit with an open finding this is only where a change is sought.

    Parameters
    ----------
    folder, group, case, answer, about
        As ``store_visit``.
    """
    _write_visit(folder, group, calibrated_parameters(case, group.route), answer, about, None)


def store_failure(folder: Path, group: Group, words: str, answer: str, about: Mapping[str, Any]) -> None:
    """Write why a group of sections cannot be fitted at one visit: it counts as fitted, without information.

    Parameters
    ----------
    folder, group
        As ``store_visit``.
    words : str
        The reason, one more of the notes.
    answer : str
        Of the diagnosis, "" without one.
    about : mapping
        As ``store_visit``.
    """
    notes = [*about.get("notes", ()), (about["visit"], f"sections {', '.join(group.labels)}: {words}", False)]
    _write_visit(folder, group, {}, answer, {**about, "notes": notes}, ())


def _write_visit(
    folder: Path,
    group: Group,
    parameters: Mapping[str, StateParameter],
    answer: str,
    about: Mapping[str, Any],
    information: Iterable[GroupInformation] | None,
    levels: Mapping[str, float] | None = None,
) -> None:
    value = {
        "version": dict(about["version"]), "visit": about["visit"], "sections": ", ".join(group.labels),
        "answer": answer, "notes": [list(note) for note in about.get("notes", ())],
        "parameters": [asdict(p) for p in parameters.values()], "fitted": information is not None,
        "groups": packed_groups(information or ()), "levels": dict(levels or {}),
        "neighbours": ", ".join(group.neighbours),
        "every_group": list(about.get("every_group", [", ".join(group.neighbours)])),
    }  # fmt: skip
    path = _path(folder, about["turnout"].id, about["visit"], group.neighbours)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_value(path, value)


def _fit_again(case: TrackCase, fit: Fit, may_be_large: Collection[str], partners: Mapping[str, str]) -> Fit:
    """The fit at the maximum of all recordings of the case; as it is where the model cannot be simulated there."""
    springs = [
        n.name
        for n in case.nuisances
        if n.name in may_be_large and abs(fit.values[n.name] - n.mean) > CALIBRATION.finding_sds * n.sd
    ]
    try:
        return fit_again(case, fit, springs, partners)
    except SimulationError:
        return fit


def _damper_key(spring: StateParameter) -> str:
    return f"{spring.group}_damper_{spring.index}"


def _path(folder: Path, turnout_id: str, visit: str, labels: Sequence[str]) -> Path:
    digest = hashlib.sha256("+".join(labels).encode()).hexdigest()[:12]
    return folder / turnout_id / f"{visit}-{digest}{SUFFIX}"


def read_visits(folder: Path, turnout_id: str, versions: Mapping[str, Mapping[str, str]]) -> list[StoredVisit]:
    """Stored visits of a turnout. Those of another code, track file or recordings are left out.

    Parameters
    ----------
    folder : Path
        As ``folder_of``.
    turnout_id : str
    versions : mapping
        Visit -> its versions as they are now; those that are missing from it are not compared.

    Returns
    -------
    list of StoredVisit
        In the order of visit and sections.
    """
    stored = []
    for path in stored_files(folder, turnout_id):
        try:
            value = read_value(path)
        except KeyError:  # damaged, or of another format
            continue
        wanted = versions.get(value["visit"])
        if wanted is None or any(value["version"].get(k) != v for k, v in wanted.items()):
            continue
        information = unpacked_groups(value["groups"])
        parameters = tuple(StateParameter(**p) for p in value["parameters"])
        notes = tuple((visit, words, of_passage) for visit, words, of_passage in value.get("notes", ()))
        about = value["visit"], value["sections"], value["answer"]
        neighbours, every_group = value.get("neighbours", ""), tuple(value.get("every_group", ()))
        fitted, levels = value.get("fitted", True), value.get("levels", {})
        stored.append(StoredVisit(*about, information, parameters, notes, fitted, levels, neighbours, every_group))
    return sorted(stored, key=lambda s: (years_of(s.visit), s.visit, s.sections))
