"""The information of each visit on disk, in one file per group of sections below the work folder.

Each has the versions of its code, track file and recordings. A file of another version is ignored and computed again,
never read as if it were of this one.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Mapping, MutableMapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from turnout.content import sha256_of
from turnout.errors import SimulationError
from turnout.mismatch.calibrated import GroupInformation, StateParameter, VisitInformation
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
from turnout.stages.track_files import digest_of_model
from turnout.stages.visit_time import years_of

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
    Of a visit that is not ``fitted`` yet only the answer is known.
    """

    visit: str
    sections: str
    answer: str
    groups: tuple[GroupInformation, ...]
    parameters: tuple[StateParameter, ...]
    notes: tuple[tuple[str, str, bool], ...] = ()
    fitted: bool = True
    levels: Mapping[str, float] = field(default_factory=dict)


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


def version_of(
    unit: Unit, turnout: TurnoutConfig, raw_root: str | Path, track: str | None, code: str
) -> dict[str, str]:
    """Versions that the information of a visit depends on.

    Parameters
    ----------
    unit : Unit
        The files of the visit.
    turnout : TurnoutConfig
    raw_root : path
    track : str or None
        Track file, None: the turnout's own.
    code : str
        Fingerprint of the code.

    Returns
    -------
    dict
        "code", "model" (track, vehicles and settings) and "recordings" -> digest.
    """
    contents = [[path, sha256_of(file) if (file := Path(raw_root) / path).is_file() else ""] for path, *_ in unit.files]
    recordings = hashlib.sha256(json.dumps(contents).encode()).hexdigest()[:16]
    model = f"{turnout.hashes['mismatch']}/{digest_of_model(turnout, track)}"
    return {"code": code, "model": model, "recordings": recordings}


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
        turnout, visit, version (as ``version_of``), and notes (as ``notes_in_words``) if there are any.
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
    }  # fmt: skip
    path = _path(folder, about["turnout"].id, about["visit"], group.labels)
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
        return fit_again(case, fit, {*springs, *(partners[n] for n in springs if n in partners)})
    except SimulationError:
        return fit


def _damper_key(spring: StateParameter) -> str:
    return f"{spring.group}_damper_{spring.index}"


def _path(folder: Path, turnout_id: str, visit: str, labels: Sequence[str]) -> Path:
    digest = hashlib.sha256("+".join(labels).encode()).hexdigest()[:12]
    return folder / turnout_id / f"{visit}-{digest}{SUFFIX}"


def remove_other_visits(folder: Path, turnout_id: str, visits: Collection[str]) -> None:
    """Remove the files of all visits of a turnout but these, so that a folder does not grow with each night.

    Parameters
    ----------
    folder : Path
        As ``folder_of``.
    turnout_id : str
    visits : collection of str
        Visits whose files stay.
    """
    for path in (folder / turnout_id).glob(f"*{SUFFIX}"):
        visit, _, _ = path.name.rpartition("-")
        if visit not in visits:
            path.unlink(missing_ok=True)


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
    for path in sorted((folder / turnout_id).glob(f"*{SUFFIX}")):
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
        fitted, levels = value.get("fitted", True), value.get("levels", {})
        stored.append(StoredVisit(*about, information, parameters, notes, fitted, levels))
    return sorted(stored, key=lambda s: (s.visit, s.sections))


def visits_of(stored: Iterable[StoredVisit]) -> list[VisitInformation]:
    """One ``VisitInformation`` per visit, of all of its groups of sections.

    Parameters
    ----------
    stored : iterable of StoredVisit
        Groups of sections of all visits.

    Returns
    -------
    list of VisitInformation
        In the order in which the visits first appear.
    """
    members: dict[str, list[StoredVisit]] = {}
    for s in stored:
        members.setdefault(s.visit, []).append(s)
    visits_used = []
    for visit, parts in members.items():
        information = tuple(g for s in parts for g in s.groups)
        own_sds = {p.name: p.visit_sd for s in parts for p in s.parameters}
        visits_used.append(VisitInformation(visit, years_of(visit), information, own_sds))
    return visits_used


def with_information(stored: Iterable[StoredVisit], visits_used: Iterable[VisitInformation]) -> list[StoredVisit]:
    """Stored visits with the information of ``visits_used`` in place of their own.

    Parameters
    ----------
    stored : iterable of StoredVisit
    visits_used : iterable of VisitInformation
        Of all of these visits.

    Returns
    -------
    list of StoredVisit
    """
    by_group = {(v.visit, g.group): g for v in visits_used for g in v.groups}
    return [replace(s, groups=tuple(by_group.get((s.visit, g.group), g) for g in s.groups)) for s in stored]


def without_findings(stored: Iterable[StoredVisit]) -> list[StoredVisit]:
    """Stored visits without an open finding: only these change the belief.

    Parameters
    ----------
    stored : iterable of StoredVisit

    Returns
    -------
    list of StoredVisit
    """
    return [s for s in stored if s.answer in USED_ANSWERS]


def parameters_of(stored: Iterable[StoredVisit]) -> tuple[StateParameter, ...]:
    """All parameters of these visits, each once.

    A support that is an outer one at a visit with fewer sensors may change if it is none at another visit. What it
    absorbs at the first one is among the ``own_sds`` of that visit.

    Parameters
    ----------
    stored : iterable of StoredVisit

    Returns
    -------
    tuple of StateParameter
    """
    by_name: dict[str, StateParameter] = {}
    for s in stored:
        for p in s.parameters:
            known = by_name.setdefault(p.name, p)
            if (p.may_change, not p.is_beyond_sensors) > (known.may_change, not known.is_beyond_sensors):
                by_name[p.name] = p
    return tuple(by_name.values())
