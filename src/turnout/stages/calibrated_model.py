"""The calibrated model of a turnout: the belief from the information of all visits, and what it answers."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.config import load_configuration, with_raw
from turnout.errors import SimulationError
from turnout.fingerprint import fingerprint
from turnout.mismatch.calibrated import (
    Deviation,
    History,
    ModelAnswer,
    OnsetEvidence,
    answers_after_visits,
    change_candidates,
    compare_onsets,
    deviations_from_file,
    estimate_history,
    track_sds,
)
from turnout.mismatch.calibrated.answers_against_file import INTOLERABLE
from turnout.mismatch.calibrated.answers_of_change import surface_changes
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.stiffness_under_load import candidates_under_load, with_evidence_under_load
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.calibration import (
    calibrated_parameters,
    dip_directions,
    file_errors,
)
from turnout.mismatch.turnout.further_passages import names_beyond
from turnout.mismatch.turnout.unproven_panels import reservation
from turnout.stages.accepted_changes import changes_of, further_candidates, without_accepted
from turnout.stages.agreeing_visits import FittedGroup, KeyedInformation, agreeing_visits
from turnout.stages.checkpoint import SUFFIX
from turnout.stages.copied_files import without_copies
from turnout.stages.mismatch_groups import groups, unit_of, visits
from turnout.stages.mismatch_inputs import gather_inputs, mismatch_context
from turnout.stages.recorded_work import events_of
from turnout.stages.renewals import renewal_note, since_renewal
from turnout.stages.restarted_visits import restarted_visits
from turnout.stages.stored_visits import (
    FOLDER,
    MAX_FITTED_AXLES,
    USED_ANSWERS,
    fit_group,
    parameters_of,
    read_visits,
    store_visit,
    version_of,
    visits_of,
    with_information,
    without_findings,
)
from turnout.stages.track_files import track_of
from turnout.stages.visit_notes import notes_in_words, summary_of_notes
from turnout.stages.visit_time import day_of, years_of
from turnout.stages.visits_unlike_others import notes_on_channels
from turnout.workflow.scan import scan

if TYPE_CHECKING:
    from turnout.config.turnout import TurnoutConfig
    from turnout.mismatch.calibrated.belief import Belief
    from turnout.records import Unit
    from turnout.stages.mismatch_groups import Group
    from turnout.stages.stored_visits import StoredVisit

AGREEING = "linearized-again"  # folder of visits that agree with the earlier ones, see ``agreeing_visits``
RESTARTED = "fitted-again"  # folder of visits that differ from the earlier ones, see ``restarted_visits``
MAX_FITS_IN_MEMORY = 12  # of the newest visits; others are fitted again where a visit seems to differ
MAX_PASSAGES_AND_AXLES = (60, 1000)  # of a group of sections at one visit


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
    visits_used = visits_of(without_findings(stored))
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
    units, copies = without_copies(scan(turnout, Path(raw_root)).units, raw_root)
    by_visit = since_renewal(turnout, visits(units))
    if not by_visit:
        raise SimulationError(
            f"{turnout_id}: no hammer test and no passage below {raw_root}{renewal_note(turnout)}; "
            "nothing can be calibrated."
        )
    code = "-".join([fingerprint("turnout.stages.mismatch"), *sorted(without)])
    units_of_visits = {v: unit_of(turnout_id, v, units, turnout.hashes["mismatch"]) for v, units in by_visit.items()}
    versions = {v: version_of(unit, turnout, raw_root, track, code) for v, unit in units_of_visits.items()}
    folder = Path(work) / FOLDER
    stored = read_visits(folder, turnout_id, versions)
    diagnosed_alone = {s.visit for s in stored if not s.fitted}
    complete = {s.visit for s in stored} - diagnosed_alone
    missing = [label for label in by_visit if label not in complete]
    of_diagnosis = {(s.visit, s.sections): s.answer for s in stored if s.visit in diagnosed_alone}
    fits = _VisitFits(turnout, folder, by_visit, versions, of_diagnosis, raw_root, work, track, without, [*copies])
    fits.fit_all(missing)
    stored = read_visits(folder, turnout_id, versions)
    if not stored:
        raise SimulationError(
            f"{turnout_id}: no visit can be fitted; {'; '.join(fits.notes) or 'no section has recordings'}"
        )
    return _model_of_visits(stored, fits, missing, each_visit)


@dataclass
class _VisitFits:
    """Fits of the visits of a turnout, made when they are asked for; the last ``MAX_FITS_IN_MEMORY`` are kept.

    ``units`` are the recordings of each visit, ``versions`` as ``version_of`` gives them, ``answers`` those of a
    diagnosis by (visit, sections). ``notes`` are reasons why groups of sections could not be fitted.
    """

    turnout: TurnoutConfig
    folder: Path
    units: Mapping[str, Sequence[Unit]]
    versions: Mapping[str, Mapping[str, Any]]
    answers: Mapping[tuple[str, str], str]
    raw_root: str | Path
    work: str | Path
    track: str | None
    without: Collection[str]
    notes: list[str]
    _in_memory: dict[str, list[FittedGroup]] = field(default_factory=dict)

    def fit_all(self, labels: Iterable[str]) -> None:
        """Fit visits and store their information."""
        for label in labels:
            self._in_memory[label] = self._fit(label)
            if len(self._in_memory) > MAX_FITS_IN_MEMORY:
                del self._in_memory[next(iter(self._in_memory))]

    def of_visit(self, label: str) -> list[FittedGroup]:
        """Fits of the groups of a visit, from memory or made again."""
        return self._in_memory.get(label) or self._fit(label)

    def from_belief(self, label: str, belief: Belief) -> list[FittedGroup]:
        """Fits of the groups of a visit that begin at the means of a belief, with their Jacobians. None is stored."""
        return self._fit(label, belief)

    def _fit(self, label: str, start: Belief | None = None) -> list[FittedGroup]:
        about = {"turnout": self.turnout, "visit": label, "version": self.versions[label], "without": self.without}
        about["answers"] = {sections: a for (visit, sections), a in self.answers.items() if visit == label}
        again = " from the values that earlier visits predict" if start else ""
        print(f"{self.turnout.id}: fit of visit {label}{again}", file=sys.stderr, flush=True)
        paths = self.folder, self.raw_root, self.work, self.track
        fitted, reasons = _fit_visit(*paths, self.units[label], about, start)
        if start is None:  # else the visit has been fitted already
            self.notes.extend(reason for reason in reasons if reason not in self.notes)
        return fitted


def _model_of_visits(
    stored: list[StoredVisit], fits: _VisitFits, computed: Sequence[str], each_visit: bool
) -> CalibratedModel:
    """The model from the stored information of all visits, of which ``computed`` were fitted for it."""
    turnout, without = fits.turnout, fits.without
    parameters = parameters_of(stored)
    directions = dip_directions(parameters)
    informed = visits_of(stored)
    turnout_track, _ = track_of(turnout, fits.track)
    accepted = changes_of(turnout_track.terms)
    events = [*events_of(turnout, parameters, accepted, informed), *file_errors(parameters, directions)]
    settings = turnout.settings["mismatch"]
    again, restarted = (KeyedInformation(fits.folder / f / turnout.id, fits.versions) for f in (AGREEING, RESTARTED))
    informed = agreeing_visits(parameters, informed, events, fits.of_visit, again, settings.threshold)
    informed = restarted_visits(parameters, informed, events, fits.of_visit, fits.from_belief, restarted)
    stored = with_information(stored, informed)
    history = estimate_history(parameters, visits_of(without_findings(stored)), events)
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
        surface_changes(directions),
    )
    notes_by_visit = {s.visit: s.notes for s in stored}
    return CalibratedModel(
        history,
        tuple(with_evidence_under_load(compare_onsets(changes, local), parameters, informed, events, candidates)),
        tuple(deviations),
        {f"{s.visit} {s.sections}": s.answer for s in stored if s.answer not in USED_ANSWERS},
        tuple(computed),
        (
            *fits.notes,
            *notes_on_channels(turnout.id, stored),
            *summary_of_notes(note for notes in notes_by_visit.values() for note in notes),
        ),
        tuple(within_library(answer, without) for answer in answers),
        reservation(turnout_track),
    )


def _fit_visit(
    folder: Path,
    raw_root: str | Path,
    work: str | Path,
    track: str | None,
    units: Sequence[Unit],
    about: Mapping[str, Any],
    start: Belief | None,
) -> tuple[list[FittedGroup], list[str]]:
    """Fit the groups of a visit: fits, and reasons why a group could not be fitted.

    ``about["answers"]`` are those of its diagnosis, by sections. A visit with answers is fitted as it was diagnosed.
    Information is stored of fits that begin at the values of the file, where ``start`` is None.
    """
    turnout, fitted, notes, answers = about["turnout"], list[FittedGroup](), list[str](), about["answers"]
    turnout_track, accepted = track_of(turnout, track)
    _, passage_tables = mismatch_context(turnout.id, work=work)
    inputs = gather_inputs(units, turnout, raw_root, turnout_track, passage_tables)
    limits, selections = (None, [of.split(", ") for of in answers]) if answers else (MAX_PASSAGES_AND_AXLES, [()])
    usable = [g for labels in selections for g in groups(turnout, turnout_track, inputs, labels, limits)]
    about = {**about, "notes": notes_in_words(about["visit"], inputs.notes)}  # ``groups`` adds some
    if not usable:
        return [], summary_of_notes(about["notes"])
    for group in usable:
        try:
            on_route = tuple(a for a in accepted if a.is_on(group.route))
            campaign = group.campaign
            if not answers:
                campaign = replace(campaign, reserved=names_beyond(campaign, MAX_FITTED_AXLES))
            case = TrackCase(campaign, turnout.settings["mismatch"], accepted=on_route)
            faults = [sentence for fault in case.data.layout_faults for sentence in fault.sentences()]
            notes += [f"visit {about['visit']}: {sentence}" for sentence in faults]
            if start is None:
                fitted.append(store_visit(folder, group, case, answers.get(", ".join(group.labels), ""), about))
            else:
                settings = turnout.settings["mismatch"]
                fitted.append(fit_group(group, case, settings, about["without"], start=start))
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
        channel = a.parameter.partition("_")[2] if a.group in ("gain", "seat") else None
        rows.append(
            {
                "visit": a.visit, "question": a.question, "verdict": a.verdict, "term": names[0],
                "rival_term": names[1], "parameter": a.parameter or None, "position_m": a.position, "channel": channel,
                "size": a.size, "size_se": a.sd, "unit": a.unit or None, "grows": a.grows, "total": a.total,
                "total_se": a.total_sd, "onset_after": after, "onset_by": by, "gain_nats": a.gain,
                "reservation": model.reservation or None,
            }
        )  # fmt: skip
    return rows
