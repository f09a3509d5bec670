"""Value of a candidate: its gain, the share of the excess that it explains, its residual; and the verdict on
candidates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.channel_levels import loud_recording, worst_channel_excess
from turnout.mismatch.engine.component_evidence import evidence_of_any_component, local_changes, local_deviations
from turnout.mismatch.engine.component_spread import spread_of_others
from turnout.mismatch.engine.cross_validation import held_out_score, single_type_estimate, weighted_mean_square
from turnout.mismatch.engine.decision import judge
from turnout.mismatch.engine.decision_facts import is_contradicted, likeliest
from turnout.mismatch.engine.fit_quality import is_significantly_worse, lost_evidence
from turnout.mismatch.engine.latent_force import LatentForce, latent_law
from turnout.mismatch.engine.localization import evidence_left_at
from turnout.mismatch.engine.reserved_data import reserved_fit
from turnout.mismatch.engine.score import Score
from turnout.mismatch.engine.strained_values import strained_value
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.search import Search
    from turnout.mismatch.engine.verdict import Verdict


def explained_share(search: Search, fit: Fit, refit: Fit) -> float:
    """Share of the excess over the control level that ``refit`` removes, 1 if there is none.

    For a first effect without excess in any data type, the excess of the worst channel counts, unless one recording has
    it alone and the evidence of the others suffices. Beside a name that excess may be the residual of the name, which a
    second effect need not explain.

    Parameters
    ----------
    search : Search
    fit, refit : Fit
        Without and with the candidate.

    Returns
    -------
    float
    """
    control = _control_levels(search, fit)
    before, after = _total_excess(fit.level, control), _total_excess(refit.level, control)
    if before == 0.0 and not fit.candidates:
        if _stands_without_loud_recording(search, fit, refit):
            return 1.0
        before, after = (max(0.0, worst_channel_excess(search.case, f) - 1.0) for f in (fit, refit))
    return 1.0 - after / before if before > 0.0 else 1.0


def _stands_without_loud_recording(search: Search, fit: Fit, refit: Fit) -> bool:
    """Whether one recording alone has an excess, and the others have enough evidence for a name.

    An effect of track or sensor shows in others too. What ``refit`` gains in that recording does not count. One of a
    train may be in that recording alone: it has to explain the excess.
    """
    k = loud_recording(search.case, fit)
    if k is None or any("train" in c.where for c in refit.candidates):
        return False
    o = search.case.observations[k]
    gained = 0.5 * o.effective * float(np.sum(fit.white[k] ** 2) - np.sum(refit.white[k] ** 2)) / fit.scale[o.data_type]
    return refit.evidence - fit.evidence - max(0.0, gained) > search.settings.threshold


def _control_levels(search: Search, fit: Fit) -> dict[str, float]:
    """Control level: data type -> weighted mean square of controls."""
    return {data_type: search.control_level(data_type) for data_type in fit.level}


def _total_excess(level: Mapping[str, float], control: Mapping[str, float]) -> float:
    return sum(max(0.0, level[data_type] - control[data_type]) for data_type in level)


def score_of(search: Search, fit: Fit, refit: Fit, candidate: Candidate) -> Score:
    """Score of a candidate: gain less the logarithm of the number of sites.

    The gain is that of held-out conditions. In a large case with many nuisances it is the evidence, in which the
    first condition is predicted from the priors.

    Parameters
    ----------
    search : Search
    fit, refit : Fit
        Without and with the candidate.
    candidate : Candidate

    Returns
    -------
    Score
    """
    case, gain, by_condition = search.case, refit.evidence - fit.evidence, {}
    if not case.is_large:
        with_candidate, without_candidate = held_out_score(case, refit), held_out_score(case, fit)
        by_condition = {c: with_candidate[c] - without_candidate[c] for c in without_candidate}
        gain = sum(by_condition.values()) if by_condition else gain
    explained = explained_share(search, fit, refit)
    worst_gain = min(by_condition.values(), default=0.0)
    gain += candidate.naming.external_evidence
    is_ordinary = is_within_spread(case, refit, candidate) or not _is_supported(search, fit, refit, candidate)
    return Score(
        candidate, gain - np.log(candidate.site.n_scanned), worst_gain, explained, refit, by_condition, is_ordinary
    )


def _is_supported(search: Search, fit: Fit, refit: Fit, candidate: Candidate) -> bool:
    """Whether the required observations, if any, fit better by a margin, and those that must not oppose do not."""
    gained = 0.5 * sum(
        o.effective * float(np.sum(np.square(a)) - np.sum(np.square(b))) / fit.scale[o.data_type]
        for o, a, b in zip(search.case.observations, fit.white, refit.white)
        if o.data_type == candidate.naming.required_data_type
    )
    supported = not candidate.naming.required_data_type or gained > search.settings.margin
    return supported and not _is_opposed(search.case, fit, refit, candidate)


def _is_opposed(case: Case, fit: Fit, refit: Fit, candidate: Candidate) -> bool:
    """Whether observations that must not oppose a candidate contradict it.

    They do so if they put its masking parameter, with a prior as wide as the effect's, nearer to its value without the
    effect than to its value with it.
    """
    data_types = {o.data_type for o in case.observations if o.name in candidate.naming.must_not_oppose}
    if not data_types or not fit.jacobian:
        return False
    size = refit.psi[refit.part(candidate).start] - candidate.neutral[0]
    name, sd = candidate.site.masking_parameter, candidate.site.masking_sd
    mean = next(n.mean for n in case.nuisances if n.name == name)
    return any((single_type_estimate(case, fit, k, name, sd) - mean) / size < 0.5 for k in data_types)


def is_within_spread(case: Case, refit: Fit, candidate: Candidate) -> bool:
    r"""Whether a component differs from similar ones by no more than they do among themselves, the effect included.

    .. math:: |\ln \psi| < 3 s

    with s the ``spread_of_others``.

    Parameters
    ----------
    case : Case
    refit : Fit
        With the candidate.
    candidate : Candidate
        Its masking parameter is that of the component.

    Returns
    -------
    bool
        False if there are too few similar components.
    """
    if not candidate.site.masking_parameter or candidate.site.from_masking:
        return False
    masking = next((n for n in case.nuisances if n.name == candidate.site.masking_parameter), None)
    if masking is None or masking.index is None:  # the common value of all components, or of one without its like
        return False
    first, spread = refit.psi[refit.part(candidate).start], spread_of_others(case, refit, masking)
    if spread is None or first <= 0.0:
        return False
    return abs(float(np.log(first))) < THRESHOLDS.max_ordinary_spreads * spread


def excess_ratio(search: Search, fit: Fit) -> float:
    """Weighted mean square over the control level, the largest of the data types.

    Parameters
    ----------
    search : Search
    fit : Fit

    Returns
    -------
    float
    """
    control = _control_levels(search, fit)
    return max(fit.level[data_type] / control[data_type] for data_type in fit.level)


def worst_excess(search: Search, fit: Fit) -> float:
    """Largest excess ratio of a fit: of a data type, or of one channel of one recording.

    Parameters
    ----------
    search : Search
    fit : Fit

    Returns
    -------
    float
    """
    return max(excess_ratio(search, fit), worst_channel_excess(search.case, fit))


def is_at_control_level(case: Case, fit: Fit, data_type: str) -> bool:
    """Whether a fit leaves no more of the recordings of a data type than it leaves in controls, in each channel.

    Parameters
    ----------
    case : Case
        With control levels of its own.
    fit : Fit
    data_type : str

    Returns
    -------
    bool
        Also True where the case has no such control level or recordings.
    """
    level = fit.level.get(data_type, 0.0)
    return level <= case.control_level.get(data_type, np.inf) and worst_channel_excess(case, fit) <= 1.0


def assess(search: Search, fit: Fit, scores: Sequence[Score]) -> tuple[Verdict, Score | None]:
    """Verdict on candidates on top of ``fit``.

    Parameters
    ----------
    search : Search
    fit : Fit
        Without the candidates.
    scores : sequence of Score
        The candidates, refitted on top of it.

    Returns
    -------
    verdict : Verdict
    score : Score or None
        The one that the verdict names or would name. None if none is reportable.
    """
    case, settings = search.case, search.settings
    excess = worst_excess(search, fit)
    strained = None if fit.candidates else strained_value(case, fit, settings.threshold)
    facts: dict[str, Any] = {"disturbed": bool(case.disturbed_recordings), "strained": str(strained or "")}
    facts |= {"mismatched_trains": case.mismatched_trains, "no_train_matches": case.no_train_matches}
    for fact, gains in (("local_change", local_changes), ("local_deviation", local_deviations)):
        facts[fact] = 0.0 if fit.candidates else evidence_of_any_component(gains(case, fit))
    facts["ambiguity"] = None if fit.candidates else case.ambiguity()
    scores = tuple(s for s in scores if s.is_reportable)
    if not scores:
        return judge([], excess, settings, **facts), None
    leader = likeliest(scores, excess, settings)
    consistent, structure = True, 0.0
    if leader.gain > settings.threshold:
        consistent = predicts_reserved(search, fit, leader)
        structure = residual_structure(case, leader.fit)
        if leader.candidate.position is not None:
            left = evidence_left_at(case, leader.fit, leader.candidate.position)
            facts["left_at_position"] = left.nats if left else 0.0
    verdict = judge(
        scores, excess, settings, consistent=consistent, structure=structure,
        residual_excess=excess_ratio(search, leader.fit), **facts,
    )  # fmt: skip
    return verdict, verdict.scores[0]


def residual_structure(case: Case, fit: Fit) -> float:
    """Share of the residual that a free force law of the state still explains.

    Parameters
    ----------
    case : Case
    fit : Fit

    Returns
    -------
    float
        0 if the case has no such view.
    """
    latent = latent_force_of(case, fit)
    return max(latent.r2.values(), default=0.0) if latent else 0.0


def predicts_reserved(search: Search, base: Fit, score: Score) -> bool:
    """Whether reserved conditions are predicted no worse than without the effect.

    Worse means: twice the mean square, or a lower fit that costs more evidence than one condition may lose
    (``decision_facts.is_contradicted``), or no prediction at all.

    Parameters
    ----------
    search : Search
    base : Fit
        Without the effect.
    score : Score
        The effect with its fit.

    Returns
    -------
    bool
        True if there are no reserved recordings.
    """
    case, settings = search.case, search.settings
    if not case.reserved:
        return True
    before, after = (reserved_fit(case, f)[0] for f in (base, score.fit))
    if after is None or before is None:
        return before is None
    squares = [weighted_mean_square(case.reserved, p) for p in (before, after)]
    has_fallen = is_significantly_worse(case.reserved, before, after, settings.fall) and is_contradicted(
        -lost_evidence(case.reserved, before, after), score.gain, settings
    )
    return squares[1] <= settings.withdrawn_ratio * squares[0] and not has_fallen


def latent_force_of(case: Case, fit: Fit) -> LatentForce | None:
    """Force that a fit lacks, as a free function of covariates.

    Parameters
    ----------
    case : Case
    fit : Fit

    Returns
    -------
    LatentForce or None
        None if the case has no such view.
    """
    latent_data = case.latent_covariates(fit)
    if not latent_data:
        return None
    covariates = {k: v for k, v in latent_data.items() if k not in ("force", "unit")}
    return latent_law(latent_data["force"], covariates, latent_data.get("unit", "N"))
