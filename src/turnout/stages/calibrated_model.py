"""The calibrated model of a turnout: the belief from the information of all visits, and what it answers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
)
from turnout.mismatch.calibrated.answers_against_file import INTOLERABLE
from turnout.mismatch.calibrated.answers_of_change import surface_changes
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.levels import IMPACTS, TRAINS, kind_of
from turnout.mismatch.calibrated.model_answer import stated_unit
from turnout.mismatch.calibrated.stiffness_under_load import candidates_under_load, with_evidence_under_load
from turnout.mismatch.turnout.calibration import dip_directions, file_errors
from turnout.mismatch.turnout.unproven_panels import reservation
from turnout.stages.accepted_changes import changes_of, further_candidates, without_accepted
from turnout.stages.agreeing_visits import KeyedFits, agreeing_visits
from turnout.stages.combined_visits import (
    complete_visits,
    parameters_of,
    visits_of,
    with_information,
    without_findings,
)
from turnout.stages.copied_files import without_copies
from turnout.stages.mismatch_groups import visits
from turnout.stages.recorded_work import events_of
from turnout.stages.renewals import renewal_note, since_renewal
from turnout.stages.restarted_visits import restarted_visits
from turnout.stages.stored_visits import FOLDER, USED_ANSWERS, read_visits
from turnout.stages.track_files import track_of
from turnout.stages.visit_fits import VisitFits
from turnout.stages.visit_notes import summary_of_notes
from turnout.stages.visit_time import day_of
from turnout.stages.visit_versions import by_content, version_of
from turnout.stages.visits_unlike_others import notes_on_channels, unlike_visits
from turnout.stages.work_days import work_days_of
from turnout.workflow.future_dates import future_files
from turnout.workflow.scan import scan

if TYPE_CHECKING:
    from turnout.stages.stored_visits import StoredVisit

AGREEING = "linearized-again"  # folder of visits that agree with the earlier ones, see ``agreeing_visits``
RESTARTED = "fitted-again"  # folder of visits that differ from the earlier ones, see ``restarted_visits``


@dataclass(frozen=True)
class CalibratedModel:
    """The calibrated model of a turnout: belief from all visits, deviations from the file, and changes.

    ``answers`` are those after the visits, the last two after the newest visit. ``held`` are visits with an open
    finding, which are not used, with their answers. ``computed`` are the visits that were fitted for this call,
    ``notes`` what could not be, and why recordings were not used or are doubted. ``reservation`` says that answers on
    this track are not proven, "" where they are. ``n_hammer_tests`` and ``n_passages`` count those of the used visits.
    """

    history: History
    changes: tuple[OnsetEvidence, ...]
    deviations: tuple[Deviation, ...]
    held: Mapping[str, str]
    computed: tuple[str, ...]
    notes: tuple[str, ...]
    answers: tuple[ModelAnswer, ...] = ()
    reservation: str = ""
    n_hammer_tests: int = 0
    n_passages: int = 0


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

    Visits without stored information of the present code, track file, recordings and notes are fitted, and their
    information is stored. They are not diagnosed: the test of their innovation decides whether they are used.

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
    by_visit = since_renewal(turnout, visits(units, work_days_of(turnout)))
    if not by_visit:
        raise SimulationError(
            f"{turnout_id}: no hammer test and no passage below {raw_root}{renewal_note(turnout)}; "
            "nothing can be calibrated."
        )
    code = "-".join([fingerprint("turnout.stages.mismatch"), *sorted(without)])
    versions = {v: version_of(of, turnout, raw_root, track, code) for v, of in by_visit.items()}
    folder = Path(work) / FOLDER
    stored = read_visits(folder, turnout_id, by_content(versions))
    complete = complete_visits(stored)
    missing = [label for label in by_visit if label not in complete]
    notes = [*copies, *map(str, future_files(units))]
    of_diagnosis = {(s.visit, s.neighbours): s.answer for s in stored if s.answer}
    fits = VisitFits(turnout, folder, by_visit, versions, of_diagnosis, raw_root, work, track, without, notes)
    fits.fit_all(missing)
    stored = read_visits(folder, turnout_id, by_content(versions))
    if not any(s.groups for s in stored):
        reasons = [*fits.notes, *summary_of_notes(note for s in stored for note in s.notes)]
        raise SimulationError(
            f"{turnout_id}: no visit can be fitted; {'; '.join(reasons) or 'no section has recordings'}"
        )
    model = _model_of_visits(stored, fits, missing)
    if not each_visit:
        return model
    labels = [v.visit for v in sorted(visits_of(stored), key=lambda v: (v.time, v.visit))]
    earlier = (  # as one had it on the day of each visit
        _model_of_visits([s for s in stored if s.visit in labels[:n]], fits, missing) for n in range(1, len(labels))
    )
    return replace(model, answers=tuple(a for m in (*earlier, model) for a in m.answers))


def _model_of_visits(stored: list[StoredVisit], fits: VisitFits, computed: Sequence[str]) -> CalibratedModel:
    """The model from the stored information of these visits, of which ``computed`` were fitted for it."""
    turnout, without = fits.turnout, fits.without
    parameters = parameters_of(stored)
    directions = dip_directions(parameters)
    informed = visits_of(stored)
    turnout_track, effects = track_of(turnout, fits.track)
    accepted = changes_of(turnout_track.terms)
    events = [*events_of(turnout, parameters, accepted, informed, effects), *file_errors(parameters, directions)]
    settings = turnout.settings["mismatch"]
    versions = by_content(fits.versions)
    again, restarted = (KeyedFits(fits.folder / f / turnout.id, versions) for f in (AGREEING, RESTARTED))
    informed = agreeing_visits(parameters, informed, events, fits.of_visit, again, settings.threshold)
    informed, levels = restarted_visits(
        parameters, informed, events, fits.of_visit, fits.from_belief, restarted, unlike_visits(stored)
    )
    stored = [replace(s, levels=levels.get((s.visit, s.sections), s.levels)) for s in stored]
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
        len(informed),
        against_file,
        surface_changes(directions),
    )
    used = {step.visit for step in history.used_steps}
    n_used: Counter[str] = Counter()
    for group in (g for v in visits_of(without_findings(stored)) if v.visit in used for g in v.groups):
        n_used[kind_of(group.group)] += group.n_recordings
    notes: dict[str, Counter[tuple[str, str, bool]]] = {}  # all groups of a visit have those of the visit
    for s in stored:
        notes[s.visit] = notes.get(s.visit, Counter()) | Counter(s.notes)
    return CalibratedModel(
        history,
        tuple(with_evidence_under_load(compare_onsets(changes, local), parameters, informed, events, candidates)),
        tuple(deviations),
        {f"{s.visit} {s.sections}": s.answer for s in stored if s.answer not in USED_ANSWERS},
        tuple(computed),
        (
            *fits.notes,
            *notes_on_channels(turnout.id, stored),
            *summary_of_notes(note for of_visit in notes.values() for note in of_visit.elements()),
        ),
        tuple(within_library(answer, without) for answer in answers),
        reservation(turnout_track),
        n_used[IMPACTS],
        n_used[TRAINS],
    )


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
                "size": a.size, "size_se": a.sd, "unit": stated_unit(a.unit, a.group) or None, "grows": a.grows,
                "total": a.total, "total_se": a.total_sd, "onset_after": after, "onset_by": by, "gain_nats": a.gain,
                "reservation": model.reservation or None,
            }
        )  # fmt: skip
    return rows
