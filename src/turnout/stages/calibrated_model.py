"""The calibrated model of a turnout: the information of each visit on disk, and the belief from all of them.

Each visit is one file below the folder ``calibrated-model`` of the work folder, with the versions of its code, track
file and recordings. A file of another version is ignored and computed again, never read as if it were of this one.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Collection, Iterable, Mapping, MutableMapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.config import load_configuration, with_raw
from turnout.config.events import RENEWAL, read_events
from turnout.constants import DAYS_PER_YEAR
from turnout.content import sha256_of
from turnout.errors import SimulationError
from turnout.fingerprint import fingerprint
from turnout.mismatch.calibrated import (
    Deviation,
    Event,
    GroupInformation,
    History,
    ModelAnswer,
    OnsetEvidence,
    StateParameter,
    VisitInformation,
    answers_after_visits,
    change_candidates,
    compare_onsets,
    deviations_from_file,
    estimate_history,
    track_sds,
)
from turnout.mismatch.calibrated.answers_against_file import INTOLERABLE
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.model_answer import NAMES
from turnout.mismatch.calibrated.stiffness_under_load import candidates_under_load, with_evidence_under_load
from turnout.mismatch.engine.diagnose import fit_base
from turnout.mismatch.engine.large_values import fit_large_values
from turnout.mismatch.engine.search import Search
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.calibration import (
    calibrated_parameters,
    dip_directions,
    file_errors,
    visit_groups,
)
from turnout.mismatch.turnout.further_passages import names_beyond, with_reserved_passages
from turnout.mismatch.turnout.nose_starts import fit_from_nose_positions
from turnout.mismatch.turnout.unproven_panels import reservation
from turnout.stages.accepted_changes import change_events, changes_of, further_candidates, without_accepted
from turnout.stages.agreeing_visits import (
    AgreeingInformation,
    FittedGroup,
    agreeing_visits,
    packed_groups,
    unpacked_groups,
)
from turnout.stages.checkpoint import SUFFIX, read_value, write_value
from turnout.stages.mismatch_groups import groups, unit_of, visits
from turnout.stages.mismatch_inputs import digest_of_model, gather_inputs, mismatch_context, track_of
from turnout.stages.renewals import renewal_note, since_renewal
from turnout.stages.visit_notes import notes_in_words, summary_of_notes
from turnout.stages.visit_time import day_of, years_of
from turnout.workflow.scan import scan

if TYPE_CHECKING:
    from turnout.config.turnout import TurnoutConfig
    from turnout.records import Unit
    from turnout.stages.accepted_changes import AcceptedChange
    from turnout.stages.mismatch_groups import Group

FOLDER = "calibrated-model"
AGREEING = "linearized-again"  # folder of visits that agree with the earlier ones, see ``agreeing_visits``
USED_ANSWERS = ("none", "")  # "": not diagnosed; a visit with an open finding changes nothing until it is accepted
# Groups of parameters that a kind of work makes uncertain again
OPENED = {
    "tamping": ("ballast", "ballast_damper", "wave", "surface"),
    "ballast_cleaning": ("ballast", "ballast_damper", "wave", "surface"),
    "pad_exchange": ("pad", "pad_damper"),
    "rail_change": ("rail", "wave", "surface", "depth", "top_shape", "gain", "seat"),
    "grinding": ("wave", "surface", "depth", "top_shape"),
    "sleeper_change": ("sleeper", "pad", "pad_damper", "ballast", "ballast_damper", "wave"),
    "sensor_change": ("gain", "seat"),
}
OPENED[RENEWAL] = tuple(sorted({group for opened in OPENED.values() for group in opened}))  # of one section
# Parameters that all supports share, which work on the whole turnout makes uncertain, too
BALLAST, PADS = ("ballast_stiffness", "ballast_damping"), ("pad_stiffness", "pad_damping")
OPENED_COMMON = {
    "tamping": BALLAST,
    "ballast_cleaning": BALLAST,
    "pad_exchange": PADS,
    "sleeper_change": ("sleeper_mass", *BALLAST, *PADS),
}
MAX_FITTED_AXLES = 8  # of all fitted passages of a visit: the others are linear about the fit, and cost little
MAX_FITS_IN_MEMORY = 12  # of the newest visits; others are fitted again where a visit seems to differ
MAX_PASSAGES_AND_AXLES = (60, 1000)  # of a group of sections at one visit
NOSE_POSITION = "place of the kink"  # begin of the name of a parameter
EVENT_REACH = 6.0  # m from a section that work there may touch


@dataclass(frozen=True)
class StoredVisit:
    """Information of one group of sections at one visit: ``answer`` of its diagnosis, "" without one.

    ``notes`` are those of ``notes_in_words`` on the recordings of the visit.
    """

    visit: str
    sections: str
    answer: str
    groups: tuple[GroupInformation, ...]
    parameters: tuple[StateParameter, ...]
    notes: tuple[tuple[str, str, bool], ...] = ()


@dataclass(frozen=True)
class CalibratedModel:
    """The calibrated model of a turnout: belief from all visits, deviations from the file, and changes.

    ``answers`` are those after the visits, the last two after the newest visit. ``held`` are visits with an open
    finding, which are not used, with their answers. ``computed`` are the visits that were fitted for this call,
    ``notes`` what could not be, and why recordings were not used or are doubted. ``reservation`` says that answers on
    this track are not proven, "" where they are.
    """

    history: History
    changes: tuple[OnsetEvidence, ...]
    deviations: tuple[Deviation, ...]
    held: Mapping[str, str]
    computed: tuple[str, ...]
    notes: tuple[str, ...]
    answers: tuple[ModelAnswer, ...] = ()
    reservation: str = ""


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


def store_visit(
    folder: Path,
    group: Group,
    case: TrackCase,
    answer: str,
    about: Mapping[str, Any],
    store: MutableMapping[str, Any] | None = None,
) -> FittedGroup:
    """Write the information of a group of sections at one visit.

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
        The fit that the information is of.

    Raises
    ------
    SimulationError
        The base model cannot be simulated.
    """
    search, fit = fit_base(Search.of(case, about["turnout"].settings["mismatch"], None, store))
    assert isinstance(search.case, TrackCase)
    parameters = calibrated_parameters(search.case, group.route)
    positions = [nuisance for nuisance, p in parameters.items() if p.name.startswith(NOSE_POSITION)]
    fit = fit_from_nose_positions(search, fit, positions)
    may_be_large = [
        nuisance
        for nuisance, p in parameters.items()
        if p.may_change and p.group in dict(CALIBRATION.least_sizes) and NAMES[p.group] not in about.get("without", ())
    ]
    dampers = {f"{p.group}_{p.index}": n for n, p in parameters.items() if p.group.endswith("_damper")}
    partners = {n: dampers[key] for n in may_be_large if (key := _damper_key(parameters[n])) in dampers}
    fit = fit_large_values(search, fit, may_be_large, CALIBRATION.change_sds, partners)
    sections = ", ".join(group.labels)
    fitted = FittedGroup(*with_reserved_passages(search.case, fit), parameters, sections, group.route)
    information = visit_groups(fitted.case, fitted.fit, sections, group.route)
    value = {
        "version": dict(about["version"]), "visit": about["visit"], "sections": sections, "answer": answer,
        "notes": [list(note) for note in about.get("notes", ())],
        "parameters": [asdict(p) for p in parameters.values()],
        "groups": packed_groups(information),
    }  # fmt: skip
    path = _path(folder, about["turnout"].id, about["visit"], group.labels)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_value(path, value)
    return replace(fitted, fit=fitted.fit.without_jacobian())


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
        stored.append(StoredVisit(value["visit"], value["sections"], value["answer"], information, parameters, notes))
    return sorted(stored, key=lambda s: (s.visit, s.sections))


def visits_of(stored: Iterable[StoredVisit]) -> list[VisitInformation]:
    """One ``VisitInformation`` per visit, of all of its groups of sections."""
    members: dict[str, list[StoredVisit]] = {}
    for s in stored:
        members.setdefault(s.visit, []).append(s)
    visits_used = []
    for visit, parts in members.items():
        information = tuple(g for s in parts for g in s.groups)
        visits_used.append(VisitInformation(visit, years_of(visit), information))
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


def within_library(answer: ModelAnswer, without: Collection[str]) -> ModelAnswer:
    """The answer in a library ``without`` some effects: one that could only name these is "unknown".

    Parameters
    ----------
    answer : ModelAnswer
    without : collection of str
        Names of effects that are left out.

    Returns
    -------
    ModelAnswer
    """
    names = tuple(name for name in answer.names if name not in without)
    if names == answer.names:
        return answer
    return replace(answer, names=names, verdict={0: "unknown", 1: "named"}.get(len(names), answer.verdict))


def _without_findings(stored: Iterable[StoredVisit]) -> list[StoredVisit]:
    """Stored visits without an open finding: only these change the belief."""
    return [s for s in stored if s.answer in USED_ANSWERS]


def parameters_of(stored: Iterable[StoredVisit]) -> tuple[StateParameter, ...]:
    by_name: dict[str, StateParameter] = {}
    for s in stored:
        for p in s.parameters:
            by_name.setdefault(p.name, p)
    return tuple(by_name.values())


def events_of(
    turnout: TurnoutConfig,
    parameters: Sequence[StateParameter],
    changes: Sequence[AcceptedChange] = (),
    visits_used: Sequence[VisitInformation] = (),
) -> list[Event]:
    """Recorded work on the turnout, as parameters that it makes as uncertain as the file, and accepted changes.

    Parameters
    ----------
    turnout : TurnoutConfig
    parameters : sequence of StateParameter
    changes : sequence of AcceptedChange
        Of its track file.
    visits_used : sequence of VisitInformation
        Visits between which accepted changes lie.

    Returns
    -------
    list of Event
    """
    recorded, _, _ = read_events(Path(turnout.folder) / "events.csv", "events.csv", None, {})
    positions = {s.label: s.position for s in turnout.sections}
    events = []
    for event in recorded:
        if event.turnout != turnout.id or event.kind not in OPENED:
            continue
        at = None if event.section is None else positions.get(event.section.rpartition("/")[2])
        opened = {
            p.name: p.sd
            for p in parameters
            if p.group in OPENED[event.kind]
            and (at is None or p.position is None or abs(p.position - at) <= EVENT_REACH)
        }
        common = OPENED_COMMON.get(event.kind, ()) if at is None else ()
        opened |= {p.name: p.sd for p in parameters if p.name.split(" ")[-1] in common}
        events.append(Event(event.at.date().toordinal() / DAYS_PER_YEAR, opened))
    candidates = change_candidates(parameters, dip_directions(parameters)) if changes else []
    return events + change_events(changes, parameters, candidates, visits_used)


def state_rows(
    folder: Path,
    turnout: TurnoutConfig,
    group: Group,
    case: TrackCase,
    finding: Mapping[str, Any],
    about: Mapping[str, Any],
) -> list[dict[str, Any]]:
    """Rows of ``twin_states`` after a visit, of the parameters of one group of sections.

    The belief rests on this visit and the stored ones before it.

    Parameters
    ----------
    folder : Path
        As ``folder_of``.
    turnout : TurnoutConfig
    group : Group
        Its sections.
    case : TrackCase
        Their case.
    finding : mapping
        Row of ``mismatch_findings``.
    about : mapping
        visit and version (as ``version_of``).

    Returns
    -------
    list of dict
    """
    version = {k: v for k, v in about["version"].items() if k != "recordings"}  # of other visits they may be any
    names = {path.stem.rpartition("-")[0] for path in (folder / turnout.id).glob(f"*{SUFFIX}")}
    earlier = {visit: version for visit in names if years_of(visit) <= years_of(about["visit"])}
    earlier = since_renewal(turnout, earlier)
    stored = read_visits(folder, turnout.id, earlier | {about["visit"]: about["version"]})
    parameters = parameters_of(stored)
    visits_used = visits_of(_without_findings(stored))
    changes = changes_of(case.campaign.turnout.terms)
    events = [*events_of(turnout, parameters, changes, visits_used)]
    events += file_errors(parameters, dip_directions(parameters))
    history = estimate_history(parameters, visits_used, events)
    belief, n = history.belief, sum(s.n_recordings for s in history.used_steps)
    sds = track_sds(belief, parameters)
    number = {p.name: k for k, p in enumerate(parameters)}
    key = {k: finding[k] for k in ("finding_id", "turnout_id", "found_at_utc")}
    return [
        {
            **key, "parameter_no": k, "visit": about["visit"], "parameter": p.name, "position_m": p.position,
            "value": float(belief.mean[number[p.name]]), "sd": float(sds[number[p.name]]),
            "prior_sd": p.sd, "unit": p.unit, "n_visits": len(history.used_steps), "n_recordings": n,
            "code_version": version["code"],
        }
        for k, p in enumerate(calibrated_parameters(case, group.route).values())
    ]  # fmt: skip


def calibrate_turnout(
    turnout_id: str,
    config: str | Path = "config",
    raw_root: str | Path = "raw",
    work: str | Path = "work",
    track: str | None = None,
    each_visit: bool = False,
    without: Collection[str] = (),
) -> CalibratedModel:
    """Calibrated model of a turnout from all visits below the raw root.

    Visits without stored information of the present code, track file and recordings are fitted, and their information
    is stored. They are not diagnosed: the test of their innovation decides whether they are used.

    Parameters
    ----------
    turnout_id : str
        Id of the turnout.
    config : path
        Folder of the configuration.
    raw_root : path
        Folder of all recordings.
    work : path
        Folder of intermediate results.
    track : str or None
        Name or file of a track; None: the turnout's own.
    each_visit : bool
        Whether ``answers`` are those after each visit, or after the newest one alone.
    without : collection of str
        Names of effects that are left out of the library, to see what is said of them then.

    Returns
    -------
    CalibratedModel

    Raises
    ------
    SimulationError
        The turnout has no recordings since its renewal, no track file, or no visit that can be fitted.
    """
    turnout = with_raw(load_configuration(config).turnout(turnout_id), Path(raw_root))
    by_visit = since_renewal(turnout, visits(scan(turnout, Path(raw_root)).units))
    if not by_visit:
        raise SimulationError(
            f"{turnout_id}: no hammer test and no passage below {raw_root}{renewal_note(turnout)}; "
            "nothing can be calibrated."
        )
    folder, code = Path(work) / FOLDER, fingerprint("turnout.stages.mismatch")
    code = "-".join([code, *sorted(without)])
    units_of_visits = {v: unit_of(turnout_id, v, units, turnout.hashes["mismatch"]) for v, units in by_visit.items()}
    versions = {v: version_of(unit, turnout, raw_root, track, code) for v, unit in units_of_visits.items()}
    complete = {s.visit for s in read_visits(folder, turnout_id, versions)}
    missing, notes = [label for label in by_visit if label not in complete], list[str]()

    def fit_visit(label: str) -> list[FittedGroup]:
        about = {"turnout": turnout, "visit": label, "version": versions[label], "without": without}
        print(f"{turnout_id}: fit of visit {label}", file=sys.stderr, flush=True)
        fitted, reasons = _fit_visit(folder, by_visit[label], raw_root, work, track, about)
        notes.extend(reasons)
        return fitted

    fits = dict[str, list[FittedGroup]]()
    for label in missing:
        fits[label] = fit_visit(label)
        if len(fits) > MAX_FITS_IN_MEMORY:
            del fits[next(iter(fits))]
    stored = read_visits(folder, turnout_id, versions)
    if not stored:
        raise SimulationError(
            f"{turnout_id}: no visit can be fitted; {'; '.join(notes) or 'no section has recordings'}"
        )
    parameters = parameters_of(stored)
    directions = dip_directions(parameters)
    informed = visits_of(stored)
    turnout_track, _ = track_of(turnout, track)
    accepted = changes_of(turnout_track.terms)
    events = [*events_of(turnout, parameters, accepted, informed), *file_errors(parameters, directions)]
    again = AgreeingInformation(folder / AGREEING / turnout_id, versions)
    settings = turnout.settings["mismatch"]
    informed = agreeing_visits(
        parameters, informed, events, lambda v: fits.get(v) or fit_visit(v), again, settings.threshold
    )
    stored = with_information(stored, informed)
    history = estimate_history(parameters, visits_of(_without_findings(stored)), events)
    changes = estimate_history(parameters, informed, events, repeats_between_visits=False, accepted=None)
    local = further_candidates(accepted, parameters, change_candidates(parameters, directions, without))
    candidates = [*local, *further_candidates(accepted, parameters, candidates_under_load(parameters, without))]
    against_file = without_accepted(accepted, parameters, events, local)
    deviations = deviations_from_file(history, against_file[0], dict(CALIBRATION.least_sizes), intolerable=INTOLERABLE)
    answers = answers_after_visits(
        parameters,
        informed,
        events,
        candidates,
        settings.threshold,
        settings.margin,
        1 if each_visit else len(informed),
        against_file,
    )
    return CalibratedModel(
        history,
        tuple(with_evidence_under_load(compare_onsets(changes, local), parameters, informed, events, candidates)),
        tuple(deviations),
        {f"{s.visit} {s.sections}": s.answer for s in stored if s.answer not in USED_ANSWERS},
        tuple(missing),
        (*notes, *summary_of_notes(note for of in {s.visit: s.notes for s in stored}.values() for note in of)),
        tuple(within_library(answer, without) for answer in answers),
        reservation(turnout_track),
    )


def _fit_visit(
    folder: Path,
    units: Sequence[Unit],
    raw_root: str | Path,
    work: str | Path,
    track: str | None,
    about: Mapping[str, Any],
) -> tuple[list[FittedGroup], list[str]]:
    """Fit the groups of a visit and store their information: fits, and reasons why a group could not be fitted."""
    turnout, fitted, notes = about["turnout"], list[FittedGroup](), list[str]()
    turnout_track, accepted = track_of(turnout, track)
    _, passage_tables = mismatch_context(turnout.id, work=work)
    inputs = gather_inputs(units, turnout, raw_root, turnout_track, passage_tables)
    usable = list(groups(turnout, turnout_track, inputs, limits=MAX_PASSAGES_AND_AXLES))
    about = {**about, "notes": notes_in_words(about["visit"], inputs.notes)}  # ``groups`` adds some
    if not usable:
        return [], summary_of_notes(about["notes"])
    for group in usable:
        try:
            on_route = tuple(a for a in accepted if a.is_on(group.route))
            campaign = replace(group.campaign, reserved=names_beyond(group.campaign, MAX_FITTED_AXLES))
            case = TrackCase(campaign, turnout.settings["mismatch"], accepted=on_route)
            fitted.append(store_visit(folder, group, case, "", about))
        except (SimulationError, np.linalg.LinAlgError) as error:
            notes.append(f"visit {about['visit']}, sections {', '.join(group.labels)}: {error}")
    return fitted, notes


def answer_rows(model: CalibratedModel) -> list[dict[str, Any]]:
    """Answers of the model as rows: verdict, effect, position and onset after each visit and question.

    Parameters
    ----------
    model : CalibratedModel

    Returns
    -------
    list of dict
    """
    rows = []
    for a in model.answers:
        after, by = (None, None) if a.onset is None else map(day_of, a.onset)
        names: list[str | None] = [*a.names, None, None]
        channel = a.parameter.rpartition("_")[2] if a.group in ("gain", "seat") else None
        rows.append(
            {
                "visit": a.visit, "question": a.question, "verdict": a.verdict, "term": names[0],
                "rival_term": names[1], "parameter": a.parameter or None, "position_m": a.position, "channel": channel,
                "size": a.size, "size_se": a.sd, "unit": a.unit or None, "grows": a.grows, "onset_after": after,
                "onset_by": by, "gain_nats": a.gain, "reservation": model.reservation or None,
            }
        )  # fmt: skip
    return rows
