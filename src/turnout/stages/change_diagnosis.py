"""Stage change: what an open alarm rests on, from all hammer tests of its sections and the newest trains.

The hammer tests of all visits say what has changed, where and since when: each visit is fitted once and kept on disk.
Trains of the first and the newest visits then tell a gap from soft ballast, and held-out trains show what the effect is
worth.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime, time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.errors import CaseError, SimulationError
from turnout.mismatch.calibrated import (
    ModelAnswer,
    StateParameter,
    VisitInformation,
    change_answer,
    change_candidates,
    stretch_candidates,
)
from turnout.mismatch.calibrated.levels import TRAINS, kind_of
from turnout.mismatch.calibrated.soft_ballast_or_gap import NAMES as SOFT_BALLAST_OR_GAP
from turnout.mismatch.turnout.calibration import dip_directions
from turnout.mismatch.turnout.further_passages import names_beyond
from turnout.mismatch.turnout.unproven_panels import reservation
from turnout.stages.accepted_changes import changes_of, further_candidates
from turnout.stages.change_finding import finding_of_change
from turnout.stages.change_trains import case_of, trains_of_change
from turnout.stages.combined_visits import parameters_of, visits_of
from turnout.stages.copied_files import without_copies
from turnout.stages.mismatch_groups import groups, members_of, neighbours_of, visits
from turnout.stages.mismatch_inputs import gather_inputs
from turnout.stages.recorded_work import events_of
from turnout.stages.renewals import renewal_note, since_renewal
from turnout.stages.stored_visits import (
    MAX_FITTED_AXLES,
    StoredVisit,
    read_visits,
    store_visit,
)
from turnout.stages.track_files import track_of
from turnout.stages.visit_files import remove_other_visits
from turnout.stages.visit_time import day_of, years_of
from turnout.stages.visit_versions import by_content, version_of
from turnout.stages.work_days import work_days_of
from turnout.workflow.scan import scan

if TYPE_CHECKING:
    from turnout.config.turnout import TurnoutConfig
    from turnout.records import Unit
    from turnout.simulate import TurnoutTrack
    from turnout.stages.accepted_changes import AcceptedChange
    from turnout.stages.accepted_effects import AcceptedEffect

FOLDER = Path("work/impact-models")
TRAINS_FOLDER = Path("work/train-models")  # of the first and the newest visits, with their trains
VISITS_AT_ENDS = 2  # of which trains are fitted at either end of a history: some 10 CPU s each
SUSPICION = 0.5  # share of the evidence of a name from which trains are asked for the rest
SUPPORTS = ("ballast", "pad")  # groups of parameters of one support, which trains can test
NO_HAMMER_TESTS = "no hammer test of these sections{since}: turnout twin compares what trains alone show"


def change_unit(
    unit: Unit,
    turnout: TurnoutConfig,
    raw_root: str | Path,
    context: Mapping[str, dict[str, Any]] | None = None,
    algo: str = "",
) -> dict[str, list[dict]]:
    """The row of ``change_findings`` of one group of sections with an open alarm.

    A diagnosis that is not possible is a row with its reason.

    Parameters
    ----------
    unit : Unit
        All files of the group; its label names the sections, with "+" between them.
    turnout : TurnoutConfig
    raw_root : path
        Folder of all recordings.
    context : mapping or None
        Tables of the passage stage by unit.
    algo : str
        Version of the code.

    Returns
    -------
    dict
        "change_findings" -> one row.
    """
    labels = tuple(unit.label.split("+"))
    row: dict[str, Any] = {
        "turnout_id": turnout.id, "sections": ", ".join(labels), "found_at_utc": _newest_day(unit, turnout, raw_root),
        "code_version": algo,
    }  # fmt: skip
    try:
        row |= _diagnose(unit, turnout, raw_root, context or {}, algo, labels)
    except (CaseError, SimulationError, np.linalg.LinAlgError) as error:
        row |= {"verdict": "no_decision", "sentence": f"no diagnosis: {error}"[:1000]}
    return {"change_findings": [row]}


def _newest_day(unit: Unit, turnout: TurnoutConfig, raw_root: str | Path) -> datetime:
    """End of the day of the newest visit of the unit."""
    members = members_of(unit, scan(turnout, Path(raw_root)).units)
    newest = next(reversed(visits(members, work_days_of(turnout))), "1970-01")
    return datetime.combine(datetime.fromisoformat(day_of(years_of(newest))), time(23, 59))


def _diagnose(
    unit: Unit,
    turnout: TurnoutConfig,
    raw_root: str | Path,
    passage_tables: Mapping[str, dict],
    code: str,
    labels: Sequence[str],
) -> dict[str, Any]:
    try:
        track, accepted = track_of(turnout)
    except SimulationError as error:
        raise SimulationError(f"no track file ({error})") from None
    members, copies = without_copies(members_of(unit, scan(turnout, Path(raw_root)).units), raw_root)
    about = turnout, raw_root, track, accepted, code
    recorded_here = [u for u in members if u.kind == "passage" or u.section in labels]
    tests = since_renewal(turnout, visits((u for u in recorded_here if u.kind == "hammer"), work_days_of(turnout)))
    stored, notes = _fitted_visits(FOLDER / unit.label, labels, tests, *about)
    if not stored:
        raise SimulationError("; ".join(notes) or NO_HAMMER_TESTS.format(since=renewal_note(turnout)))
    threshold = turnout.settings["mismatch"].threshold
    changes = changes_of(track.terms)
    least = threshold
    answer, informed = change_of(stored, turnout, least, changes, (), accepted)
    if answer.verdict == "none":  # trains may have the evidence that impacts lack
        least = SUSPICION * threshold
        answer, _ = change_of(stored, turnout, least, changes, (), accepted)
    with_trains: Sequence[StoredVisit] = ()
    if set(answer.names) == set(SOFT_BALLAST_OR_GAP):
        ends = _first_and_newest_with_trains(since_renewal(turnout, visits(recorded_here, work_days_of(turnout))))
        folder = TRAINS_FOLDER / unit.label
        with_trains, more_notes = _fitted_visits(folder, labels, ends, *about, passage_tables)
        remove_other_visits(folder, turnout.id, ends)
        notes += more_notes
        answer, _ = change_of(stored, turnout, least, changes, with_trains, accepted)
    test = None
    if answer.verdict in ("named", "a_or_b") and answer.group in SUPPORTS:
        test = trains_of_change(answer, recorded_here, turnout, raw_root, track, accepted, passage_tables, labels)
    n_recordings = sum(v.n_recordings for v in informed)
    row = finding_of_change(answer, test, len(informed), n_recordings, threshold, _count_with_trains(with_trains))
    if changes:
        row["sentence"] += f"; accepted before: {', '.join(c.words for c in changes)}"
    if unproven := reservation(track):
        row["sentence"] += f". {unproven}"
    return row | {"notes": "\n".join([*copies, *notes]) or None}


def _fitted_visits(
    folder: Path,
    sections: Collection[str],
    by_visit: Mapping[str, Sequence[Unit]],
    turnout: TurnoutConfig,
    raw_root: str | Path,
    track: TurnoutTrack,
    accepted: Iterable[AcceptedEffect],
    code: str,
    passage_tables: Mapping[str, dict] | None = None,
) -> tuple[list[StoredVisit], list[str]]:
    """Information of the recordings of each visit at these sections, fitted once; and why one could not be fitted."""
    versions = {v: version_of(of, turnout, raw_root, None, code) for v, of in by_visit.items()}
    complete = {s.visit for s in read_visits(folder, turnout.id, by_content(versions))}
    notes = []
    for label, of in by_visit.items():
        if label in complete:
            continue
        about = {"turnout": turnout, "visit": label, "version": versions[label]}
        inputs = gather_inputs(of, turnout, raw_root, track, passage_tables or {})
        for group in groups(turnout, track, inputs):
            if not set(group.labels) <= set(sections):  # trains are recorded all along the turnout
                continue
            campaign = replace(group.campaign, reserved=names_beyond(group.campaign, MAX_FITTED_AXLES))
            try:
                store_visit(folder, group, case_of(group, campaign, turnout, accepted), "", about)
            except (CaseError, SimulationError, np.linalg.LinAlgError) as error:
                notes.append(f"visit {label}: {error}")
    return read_visits(folder, turnout.id, by_content(versions)), notes


def _first_and_newest_with_trains(by_visit: Mapping[str, Sequence[Unit]]) -> dict[str, Sequence[Unit]]:
    """Visits whose trains tell most of a change, ``VISITS_AT_ENDS`` at each end. One alone tells nothing of it: {}."""
    with_both = [v for v in by_visit if {u.kind for u in by_visit[v]} >= {"hammer", "passage"}]
    return {v: by_visit[v] for v in ends_of(with_both)} if len(with_both) > 1 else {}


def _count_with_trains(stored: Iterable[StoredVisit]) -> int:
    """Visits of which a train could be used."""
    return len({s.visit for s in stored if any(kind_of(g.group) == TRAINS for g in s.groups)})


def ends_of(history: Sequence[str]) -> list[str]:
    """The ``VISITS_AT_ENDS`` first and the ``VISITS_AT_ENDS`` newest visits, each once.

    Parameters
    ----------
    history : sequence of str
        Visits in the order of time.

    Returns
    -------
    list of str
    """
    return list(dict.fromkeys([*history[:VISITS_AT_ENDS], *history[-VISITS_AT_ENDS:]]))


def change_of(
    stored: Sequence[StoredVisit],
    turnout: TurnoutConfig,
    threshold: float | None = None,
    changes: Sequence[AcceptedChange] = (),
    with_trains: Sequence[StoredVisit] = (),
    effects: Sequence[AcceptedEffect] = (),
) -> tuple[ModelAnswer, list[VisitInformation]]:
    """What has changed up to the newest of the visits.

    Parameters
    ----------
    stored : sequence of StoredVisit
        At least one.
    turnout : TurnoutConfig
        Its settings and recorded work.
    threshold : float or None
        Evidence that a name needs, None: that of the settings. [nats]
    changes : sequence of AcceptedChange
        Those that are part of the model.
    with_trains : sequence of StoredVisit
        Some of the visits, with their trains: these tell soft ballast from a gap.
    effects : sequence of AcceptedEffect
        Those that are part of the track.

    Returns
    -------
    answer : ModelAnswer
    informed : list of VisitInformation
        The visits, in the order of time.
    """
    parameters = parameters_of(stored)
    informed = sorted(visits_of(stored), key=lambda v: (v.time, v.visit))
    settings = turnout.settings["mismatch"]
    candidates = [*change_candidates(parameters, dip_directions(parameters)), *stretch_candidates(parameters)]
    events = events_of(turnout, parameters, changes, informed, effects)
    candidates = further_candidates(changes, parameters, candidates)
    least = settings.threshold if threshold is None else threshold
    mixed = _with_trains(stored, with_trains) if with_trains else None
    return change_answer(parameters, informed, events, candidates, least, settings.margin, True, mixed), informed


def _with_trains(
    stored: Sequence[StoredVisit], with_trains: Sequence[StoredVisit]
) -> tuple[Sequence[StateParameter], Sequence[VisitInformation]]:
    """Parameters and visits, some of them with their trains."""
    replaced = {s.visit for s in with_trains}
    mixed = [*with_trains, *(s for s in stored if s.visit not in replaced)]
    return parameters_of([*stored, *with_trains]), sorted(visits_of(mixed), key=lambda v: (v.time, v.visit))


def group_labels(turnout: TurnoutConfig, sections: Iterable[str]) -> list[tuple[str, ...]]:
    """Groups of neighbouring sections that contain any of these.

    Parameters
    ----------
    turnout : TurnoutConfig
    sections : iterable of str
        Labels.

    Returns
    -------
    list of tuple of str
    """
    wanted = set(sections)
    return [labels for _, labels in neighbours_of(turnout) if wanted & set(labels)]
