"""Stage change: what an open alarm rests on, from all hammer tests of its sections and the newest trains.

The hammer tests of all visits say what has changed, where and since when: each visit is fitted once and kept on disk.
Trains of the first and the newest visits then tell a gap from soft ballast, and held-out trains show what the effect is
worth.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from datetime import datetime, time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.calibrated import (
    ModelAnswer,
    StateParameter,
    VisitInformation,
    change_answer,
    change_candidates,
    stretch_candidates,
)
from turnout.mismatch.calibrated.answers_of_change import DAMPER_SHARES
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.model_answer import position_of
from turnout.mismatch.calibrated.soft_ballast_or_gap import NAMES as SOFT_BALLAST_OR_GAP
from turnout.mismatch.engine.diagnose import diagnose, fit_base
from turnout.mismatch.engine.reserved_data import gain_error, reserved_fit
from turnout.mismatch.engine.search import Search
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.calibration import calibrated_parameters, dip_directions
from turnout.mismatch.turnout.further_passages import names_beyond
from turnout.mismatch.turnout.unproven_panels import reservation
from turnout.stages.accepted_changes import changes_of, further_candidates
from turnout.stages.change_text import sentence_of
from turnout.stages.mismatch_groups import (
    Group,
    groups,
    members_of,
    neighbours_of,
    select_passages,
    split_by_length,
    unit_of,
    visits,
)
from turnout.stages.mismatch_inputs import gather_inputs, track_of
from turnout.stages.mismatch_rows import finding_row
from turnout.stages.recorded_work import events_of
from turnout.stages.renewals import renewal_note, since_renewal
from turnout.stages.stored_visits import (
    MAX_FITTED_AXLES,
    StoredVisit,
    parameters_of,
    read_visits,
    store_visit,
    version_of,
    visits_of,
)
from turnout.stages.visit_time import day_of, years_of
from turnout.workflow.scan import scan

if TYPE_CHECKING:
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.config.turnout import TurnoutConfig
    from turnout.mismatch.turnout import CampaignInput
    from turnout.records import Unit
    from turnout.simulate import TurnoutTrack
    from turnout.stages.accepted_changes import AcceptedChange
    from turnout.stages.accepted_effects import AcceptedEffect

FOLDER = Path("work/impact-models")
TRAINS_FOLDER = Path("work/train-models")  # of the first and the newest visits, with their trains
VISITS_AT_ENDS = 2  # of the history, of which trains are fitted: the first and the newest ones
MIN_FIT_ERROR = 0.1  # points of fit: standard errors below it are not believed
SUSPICION = 0.5  # share of the evidence of a name from which trains are asked for the rest
SUPPORTS = ("ballast", "pad")  # groups of parameters of one support, which trains can test
# Effects at one support that are fitted to trains beside the named one, so that it has rivals
SUPPORT_EFFECTS = ("local_ballast", "hanging_sleeper", "local_pad")
MAX_DISTANCE = 0.35  # m from the position of the change to that of a candidate: the same support
MAX_FITTED_TRAINS = 2
MAX_AXLES_OF_TEST = 24  # of all fitted trains of a test: the time of a fit is proportional to them
MAX_HELD_OUT_TRAINS = 4
MAX_HELD_OUT_AXLES = 96
MIN_GAIN_ERRORS = 2.0  # standard errors by which held-out trains must fit better, to confirm a change of a stretch
NO_HAMMER_TESTS = "no hammer test of these sections{since}: turnout twin compares what trains alone show"


@dataclass(frozen=True)
class TrainTest:
    """What the newest trains say of a change: row as of ``mismatch_findings``, of its own visit."""

    visit: str
    finding: Mapping[str, Any]

    @property
    def name(self) -> str | None:
        """The effect that the trains name, None if they do not decide."""
        return self.finding["term"] if self.finding["verdict"] == "named" else None


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
    except (SimulationError, np.linalg.LinAlgError) as error:
        row |= {"verdict": "no_decision", "sentence": f"no diagnosis: {error}"[:1000]}
    return {"change_findings": [row]}


def _newest_day(unit: Unit, turnout: TurnoutConfig, raw_root: str | Path) -> datetime:
    """End of the day of the newest visit of the unit."""
    newest = max(visits(members_of(unit, scan(turnout, Path(raw_root)).units)), default="1970-01")
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
    members = members_of(unit, scan(turnout, Path(raw_root)).units)
    about = turnout, raw_root, track, accepted, code
    recorded_here = [u for u in members if u.kind == "passage" or u.section in labels]
    tests = since_renewal(turnout, visits(u for u in recorded_here if u.kind == "hammer"))
    stored, notes = _fitted_visits(FOLDER / unit.label, labels, tests, *about)
    if not stored:
        raise SimulationError("; ".join(notes) or NO_HAMMER_TESTS.format(since=renewal_note(turnout)))
    threshold = turnout.settings["mismatch"].threshold
    changes = changes_of(track.terms)
    answer, informed = change_of(stored, turnout, changes=changes)
    if answer.verdict == "none":  # trains may have the evidence that impacts lack
        answer, _ = change_of(stored, turnout, SUSPICION * threshold, changes)
    with_trains: Sequence[StoredVisit] = ()
    if set(answer.names) == set(SOFT_BALLAST_OR_GAP):
        ends = _first_and_newest_with_trains(since_renewal(turnout, visits(recorded_here)))
        with_trains, more_notes = _fitted_visits(TRAINS_FOLDER / unit.label, labels, ends, *about, passage_tables)
        notes += more_notes
        answer, _ = change_of(stored, turnout, SUSPICION * threshold, changes, with_trains)
    test = None
    if answer.verdict in ("named", "a_or_b") and answer.group in SUPPORTS:
        test = _test_on_trains(answer, members, turnout, raw_root, track, accepted, passage_tables, labels)
    n_recordings = sum(v.n_recordings for v in informed)
    row = finding_of_change(answer, test, len(informed), n_recordings, threshold, len(with_trains))
    if changes:
        row["sentence"] += f"; accepted before: {', '.join(c.words for c in changes)}"
    if unproven := reservation(track):
        row["sentence"] += f". {unproven}"
    return row | {"notes": "\n".join(notes) or None}


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
    units = {v: unit_of(turnout.id, v, of, turnout.hashes["mismatch"]) for v, of in by_visit.items()}
    versions = {v: version_of(u, turnout, raw_root, None, code) for v, u in units.items()}
    complete = {s.visit for s in read_visits(folder, turnout.id, versions)}
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
                store_visit(folder, group, _case_of(group, campaign, turnout, accepted), "", about)
            except (SimulationError, np.linalg.LinAlgError) as error:
                notes.append(f"visit {label}: {error}")
    return read_visits(folder, turnout.id, versions), notes


def _first_and_newest_with_trains(by_visit: Mapping[str, Sequence[Unit]]) -> dict[str, Sequence[Unit]]:
    """Visits whose trains tell most of a change, ``VISITS_AT_ENDS`` at each end. One alone tells nothing of it: {}."""
    with_both = [v for v in sorted(by_visit) if {u.kind for u in by_visit[v]} >= {"hammer", "passage"}]
    ends = dict.fromkeys([*with_both[:VISITS_AT_ENDS], *with_both[-VISITS_AT_ENDS:]])
    return {v: by_visit[v] for v in ends} if len(ends) > 1 else {}


def _case_of(
    group: Group,
    campaign: CampaignInput,
    turnout: TurnoutConfig,
    accepted: Iterable[AcceptedEffect],
    families: Collection[str] | None = None,
) -> TrackCase:
    on_route = tuple(a for a in accepted if a.is_on(group.route))
    return TrackCase(campaign, turnout.settings["mismatch"], families, accepted=on_route)


def change_of(
    stored: Sequence[StoredVisit],
    turnout: TurnoutConfig,
    threshold: float | None = None,
    changes: Sequence[AcceptedChange] = (),
    with_trains: Sequence[StoredVisit] = (),
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
    events = events_of(turnout, parameters, changes, informed)
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


def _test_on_trains(
    answer: ModelAnswer,
    members: Sequence[Unit],
    turnout: TurnoutConfig,
    raw_root: str | Path,
    track: TurnoutTrack,
    accepted: Iterable[AcceptedEffect],
    passage_tables: Mapping[str, dict],
    labels: Sequence[str],
) -> TrainTest | None:
    """Diagnosis of the newest visit with trains after the change, of the effects at the changed support alone."""
    assert answer.onset is not None and answer.position is not None
    chosen = [u for u in members if u.kind == "passage" or u.section in labels]
    after = {v: of for v, of in visits(chosen).items() if years_of(v) >= answer.onset[1]}
    for visit in sorted(after, reverse=True):
        if {u.kind for u in after[visit]} < {"hammer", "passage"}:
            continue
        inputs = gather_inputs(after[visit], turnout, raw_root, track, passage_tables)
        group = next((g for g in groups(turnout, track, inputs) if set(g.labels) <= set(labels)), None)
        if group is None or not group.campaign.passages:
            continue
        campaign = with_held_out(group.campaign, [p for p in inputs.passages if p.route == group.route])
        case = _case_of(group, campaign, turnout, accepted, SUPPORT_EFFECTS)
        settings = turnout.settings["mismatch"]
        assert answer.gain is not None
        if len(supports_of(answer)) > 1 or answer.gain < settings.threshold:
            return TrainTest(visit, stretch_finding(case, settings, answer, group.route))
        return TrainTest(
            visit, finding_row(diagnose(at_support(case, answer.position), replace(settings, effects=1)), {})
        )
    return None


def at_support(case: TrackCase, position: float) -> TrackCase:
    """The case with the candidates at one support alone.

    Parameters
    ----------
    case : TrackCase
    position : float
        [m]

    Returns
    -------
    TrackCase
    """
    near = copy(case)
    chosen = (c for c in case.candidates if abs(c.where.get("place", np.inf) - position) <= MAX_DISTANCE)
    near.all_candidates = near.candidates = tuple(chosen)
    return near


def supports_of(answer: ModelAnswer) -> list[float]:
    """Positions of the parameters that change, each once.

    Parameters
    ----------
    answer : ModelAnswer

    Returns
    -------
    list of float
        Sorted. [m]
    """
    positions = (position_of(name, None) for name in answer.changed)
    return sorted({position for position in positions if position is not None})


def stretch_finding(case: TrackCase, settings: MismatchSettings, answer: ModelAnswer, route: str) -> dict[str, Any]:
    """Columns of ``mismatch_findings`` of a change of several supports: fit of held-out trains without and with it.

    The fit of the visit has absorbed the change. Without it is the fit with the change taken back and all else fitted
    again to first order, so that what other parameters explain as well is no evidence. No effect of the library acts
    on several supports; that trains feel the change names it if the fit of those held out rises by
    ``MIN_GAIN_ERRORS`` standard errors. "gain_nats" is the logarithm of the ratio of their likelihoods. Trains share
    errors of the model, so that n of them count as few.

    Parameters
    ----------
    case : TrackCase
    settings : MismatchSettings
    answer : ModelAnswer
        The change.
    route : str
        Route of the sections.

    Returns
    -------
    dict
    """
    search, fit = fit_base(Search.of(case, settings))
    assert answer.total is not None
    changed = {n: p for n, p in calibrated_parameters(case, route).items() if p.name in answer.changed}
    taken_back = {n: answer.total * (DAMPER_SHARES[0] if "damper" in p.group else 1.0) for n, p in changed.items()}
    before = replace(fit, values=fit.values_beside({n: fit.values[n] - size for n, size in taken_back.items()}))
    row: dict[str, Any] = {"verdict": "none", "term": None, "parameters_json": None}
    row |= dict.fromkeys(("fit_before_pct", "fit_after_pct", "fit_gain_se_pct")) | {"n_held_out": 0, "gain_nats": 0.0}
    observations = search.case.reserved
    predictions, percents = zip(*(reserved_fit(search.case, f) for f in (before, fit)))
    if not observations or None in percents:
        return row
    error = gain_error(observations, *predictions)
    row |= {"fit_before_pct": percents[0], "fit_after_pct": percents[1], "fit_gain_se_pct": error}
    row["n_held_out"] = n = len(observations)
    costs = [
        [o.effective * float(np.sum(o.whiten(o.data - p) ** 2)) for o, p in zip(observations, of)] for of in predictions
    ]
    level = max(1.0, sum(costs[1]) / sum(o.n_effective for o in observations))
    count = n / (1.0 + CALIBRATION.repeated_error_share * (n - 1))  # as ``repeated_error_weights``, all of one group
    nats = 0.5 * count * (sum(costs[0]) - sum(costs[1])) / n / level
    # no more than the error of the difference of the fits allows, which is estimated from the residuals
    row["gain_nats"] = min(nats, 0.5 * ((percents[1] - percents[0]) / max(error, MIN_FIT_ERROR)) ** 2)
    if percents[1] - percents[0] > MIN_GAIN_ERRORS * error:
        row |= {"verdict": "named", "term": answer.names[0]}
    return row


def with_held_out(campaign: CampaignInput, passages: Sequence[Any]) -> CampaignInput:
    """The campaign with few fitted trains and others held out, which cost no fit.

    Parameters
    ----------
    campaign : CampaignInput
        Its passages are replaced; those of a diverging route are left as they are.
    passages : sequence of PassageInput
        All usable ones of its route at this visit.

    Returns
    -------
    CampaignInput
    """
    names = {p.name for p in campaign.passages}
    if names - {p.name for p in passages} or any(p.route != "main" for p in passages):
        return campaign
    trains = split_by_length(passages)
    fitted = select_passages(trains, MAX_FITTED_TRAINS, MAX_AXLES_OF_TEST)
    others = [p for p in trains if all(p is not f for f in fitted)]
    held_out = select_passages(others, MAX_HELD_OUT_TRAINS, MAX_HELD_OUT_AXLES) if others else []
    chosen = [p for p in trains if any(p is c for c in (*fitted, *held_out))]
    return replace(campaign, passages=tuple(chosen), reserved=tuple(p.name for p in held_out))


def finding_of_change(
    answer: ModelAnswer,
    test: TrainTest | None,
    n_visits: int,
    n_recordings: int,
    threshold: float = 0.0,
    n_with_trains: int = 0,
) -> dict[str, Any]:
    """Columns of ``change_findings``: hammer tests and trains together.

    Trains that name one of the names of the hammer tests decide between them. Trains that name another effect make the
    answer "a or b". Trains that decide nothing change nothing. A suspicion of the hammer tests is a name if the
    held-out trains add the evidence that it lacks.

    Parameters
    ----------
    answer : ModelAnswer
        Of the hammer tests of all visits.
    test : TrainTest or None
        Of trains.
    n_visits, n_recordings : int
        Visits with hammer tests, and their recordings.
    threshold : float
        Evidence that a name needs. [nats]
    n_with_trains : int
        Visits whose trains are part of ``answer``.

    Returns
    -------
    dict
    """
    names = answer.names
    if test is not None and test.name is not None:
        names = (test.name,) if test.name in names else (names[0], test.name)
    elif test is not None and test.finding["term"] in names:  # the trains' best name first
        names = tuple(sorted(names, key=lambda name: name != test.finding["term"]))
    verdict = answer.verdict if not names else "named" if len(names) == 1 else "a_or_b"
    row: dict[str, Any] = {
        "visit": answer.visit, "verdict": verdict, "term": names[0] if names else None,
        "rival_term": names[1] if len(names) > 1 else None,
        "component": {"ballast": "ballast", "pad": "railpad"}.get(answer.group), "position_m": answer.position,
        "change": answer.size, "change_se": answer.sd, "change_unit": answer.unit or None, "grows": answer.grows,
        "gain_nats": answer.gain, "n_visits": n_visits, "n_recordings": n_recordings,
    }  # fmt: skip
    if supports := supports_of(answer):
        row |= {"first_m": supports[0], "last_m": supports[-1]}
    nats = (answer.gain or 0.0) + (test.finding.get("gain_nats", 0.0) if test is not None else 0.0)
    if answer.gain is not None:
        row["gain_nats"] = nats
    if answer.onset is not None:
        after, by = (datetime.fromisoformat(day_of(t)) for t in answer.onset)
        row |= {"onset_after_utc": after, "onset_by_utc": by}
    if test is not None:
        fits = ("fit_before_pct", "fit_after_pct", "fit_gain_se_pct", "n_held_out")
        row |= {name: test.finding[name] for name in fits} | {"trains_visit": test.visit}
        row |= {"trains_verdict": test.finding["verdict"], "trains_term": test.finding["term"]}
        if test.finding["term"] == names[0]:
            row["parameters_json"] = test.finding["parameters_json"]
    if names and answer.gain is not None and nats < threshold:
        evidence = f"the likeliest has {nats:.1f} of {threshold:g} nats of evidence"
        words = f"no effect is named; {evidence}: {sentence_of(row, n_with_trains)}"
        return row | {"verdict": "none", "term": None, "rival_term": None, "component": None, "sentence": words}
    return row | {"sentence": sentence_of(row, n_with_trains)}


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
