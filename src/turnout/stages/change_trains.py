"""What the newest trains say of a change that hammer tests show: its name, and the fit of held-out trains."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.calibrated import ModelAnswer
from turnout.mismatch.calibrated.answers_of_change import DAMPER_SHARES
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.model_answer import position_of
from turnout.mismatch.engine.diagnose import diagnose, fit_base
from turnout.mismatch.engine.fit_quality import gain_error
from turnout.mismatch.engine.reserved_data import reserved_fit
from turnout.mismatch.engine.search import Search
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.calibration import calibrated_parameters
from turnout.stages.finding_row import finding_row
from turnout.stages.mismatch_groups import Group, groups, visits
from turnout.stages.mismatch_inputs import gather_inputs
from turnout.stages.recording_choice import select_passages, split_by_length
from turnout.stages.visit_time import years_of
from turnout.stages.work_days import work_days_of

if TYPE_CHECKING:
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.config.turnout import TurnoutConfig
    from turnout.mismatch.turnout import CampaignInput
    from turnout.records import Unit
    from turnout.simulate import TurnoutTrack
    from turnout.stages.accepted_effects import AcceptedEffect

MIN_FIT_ERROR = 0.1  # points of fit: standard errors below it are not believed
# Effects at one support that are fitted to trains beside the named one, so that it has rivals
SUPPORT_EFFECTS = ("local_ballast", "hanging_sleeper", "local_pad")
MAX_DISTANCE = 0.35  # m from the position of the change to that of a candidate: the same support
MAX_FITTED_TRAINS = 2
MAX_AXLES_OF_TEST = 24  # of all fitted trains of a test: the time of a fit is proportional to them
MAX_HELD_OUT_TRAINS = 4
MAX_HELD_OUT_AXLES = 96
MIN_GAIN_ERRORS = 2.0  # standard errors by which held-out trains must fit better, to confirm a change of a stretch


@dataclass(frozen=True)
class TrainTest:
    """What the newest trains say of a change: row as of ``mismatch_findings``, of its own visit."""

    visit: str
    finding: Mapping[str, Any]

    @property
    def name(self) -> str | None:
        """The effect that the trains name, None if they do not decide."""
        return self.finding["term"] if self.finding["verdict"] == "named" else None


def trains_of_change(
    answer: ModelAnswer,
    recordings: Sequence[Unit],
    turnout: TurnoutConfig,
    raw_root: str | Path,
    track: TurnoutTrack,
    accepted: Iterable[AcceptedEffect],
    passage_tables: Mapping[str, dict],
    labels: Sequence[str],
) -> TrainTest | None:
    """Diagnosis of the newest visit with trains after the change, of the effects at the changed support alone.

    Parameters
    ----------
    answer : ModelAnswer
        The change, with position and onset.
    recordings : sequence of Unit
        Hammer tests of the sections that have changed, and passages.
    turnout : TurnoutConfig
    raw_root : path
        Folder of all recordings.
    track : TurnoutTrack
    accepted : iterable of AcceptedEffect
        Effects that are part of the track.
    passage_tables : mapping
        Tables of the passage stage by unit.
    labels : sequence of str
        Sections that have changed.

    Returns
    -------
    TrainTest or None
        None without trains after the change.

    Raises
    ------
    SimulationError
        If the track cannot be simulated.
    """
    assert answer.onset is not None and answer.position is not None
    after = {v: of for v, of in visits(recordings, work_days_of(turnout)).items() if years_of(v) >= answer.onset[1]}
    for visit in reversed(after):
        if {u.kind for u in after[visit]} < {"hammer", "passage"}:
            continue
        inputs = gather_inputs(after[visit], turnout, raw_root, track, passage_tables)
        group = next((g for g in groups(turnout, track, inputs) if set(g.labels) <= set(labels)), None)
        if group is None or not group.campaign.passages:
            continue
        campaign = with_held_out(group.campaign, [p for p in inputs.passages if p.route == group.route])
        case = case_of(group, campaign, turnout, accepted, SUPPORT_EFFECTS)
        settings = turnout.settings["mismatch"]
        assert answer.gain is not None
        if len(supports_of(answer)) > 1 or answer.gain < settings.threshold:
            return TrainTest(visit, stretch_finding(case, settings, answer, group.route))
        return TrainTest(
            visit, finding_row(diagnose(at_support(case, answer.position), replace(settings, effects=1)), {})
        )
    return None


def case_of(
    group: Group,
    campaign: CampaignInput,
    turnout: TurnoutConfig,
    accepted: Iterable[AcceptedEffect],
    families: Collection[str] | None = None,
) -> TrackCase:
    """Case of a group of sections, with the accepted effects of its route.

    Parameters
    ----------
    group : Group
    campaign : CampaignInput
        Recordings of the group that are used.
    turnout : TurnoutConfig
    accepted : iterable of AcceptedEffect
    families : collection of str or None
        Names of the effects that are candidates, None: all.

    Returns
    -------
    TrackCase
    """
    on_route = tuple(a for a in accepted if a.is_on(group.route))
    return TrackCase(campaign, turnout.settings["mismatch"], families, accepted=on_route)


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
    on several supports. The change has a name if the fit of held-out trains rises by ``MIN_GAIN_ERRORS`` standard
    errors. "gain_nats" is the logarithm of the ratio of their likelihoods. Trains share errors of the model, so n of
    them count as few.

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
    row["gain_nats"] = evidence_of_rise(nats, percents[1] - percents[0], error)
    if percents[1] - percents[0] > MIN_GAIN_ERRORS * error:
        row |= {"verdict": "named", "term": answer.names[0]}
    return row


def evidence_of_rise(nats: float, rise: float, error: float) -> float:
    """Evidence of held-out trains, no more than the rise of their fit allows: none where it falls.

    Parameters
    ----------
    nats : float
        Logarithm of the ratio of their likelihoods.
    rise : float
        Of their fit. [points]
    error : float
        Standard error of the rise, estimated from the residuals. [points]

    Returns
    -------
    float
        [nats]
    """
    return min(nats, 0.5 * (max(rise, 0.0) / max(error, MIN_FIT_ERROR)) ** 2)


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
    not_fitted = [p for p in trains if all(p is not f for f in fitted)]
    held_out = select_passages(not_fitted, MAX_HELD_OUT_TRAINS, MAX_HELD_OUT_AXLES) if not_fitted else []
    chosen = [p for p in trains if any(p is c for c in (*fitted, *held_out))]
    return replace(campaign, passages=tuple(chosen), reserved=tuple(p.name for p in held_out))
