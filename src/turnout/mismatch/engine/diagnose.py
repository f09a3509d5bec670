"""Diagnosis of a case: fit, localize, name, model and verify, with everything that the verdict rests on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.counts import count_of
from turnout.errors import SimulationError
from turnout.mismatch.engine.case_check import check_case
from turnout.mismatch.engine.component_evidence import evidence_of_any_component, local_changes
from turnout.mismatch.engine.decision import (
    COMPONENT_DIFFERS,
    COMPONENT_UNUSUAL,
    LEAVES_FORCE,
    NUMERICS_RULES,
    confirm,
    first_applicable,
    grade_name,
    keep_first,
    unfinished_verdict,
)
from turnout.mismatch.engine.decision_facts import NumericalError
from turnout.mismatch.engine.evidence import assess, excess_ratio, latent_force_of, worst_excess
from turnout.mismatch.engine.findings import Findings
from turnout.mismatch.engine.free_laws import free_law_share
from turnout.mismatch.engine.localization import (
    Location,
    locate,
    locate_component,
    location_of_ambiguity,
    location_of_left_force,
)
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.refit import score_candidates
from turnout.mismatch.engine.reserved_error import error_of_fitted
from turnout.mismatch.engine.residual_attribution import Attribution, attribute, cell_energies
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.search_limit import SearchLimit, SearchLimitError
from turnout.mismatch.engine.second_effect import add_second
from turnout.mismatch.engine.strained_values import conflict_of_files, strained_value
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.mismatch.engine.tolerated_effects import name_tolerated
from turnout.mismatch.engine.two_effects import settle_pair
from turnout.mismatch.engine.unproven_cases import withhold_names
from turnout.mismatch.engine.verdict import AMBIGUOUS, Verdict
from turnout.mismatch.engine.verification import Verification, verify

if TYPE_CHECKING:
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.latent_force import LatentForce
    from turnout.mismatch.engine.rule import Rule
    from turnout.mismatch.engine.score import Score


@dataclass(frozen=True)
class Diagnosis:
    """Outcome of ``diagnose``: one verdict per effect, the fits, the attributions, the verification and the latent
    force.

    ``where`` is the location of a residual that got no name.
    """

    verdicts: tuple[Verdict, ...]
    base: Fit
    fit: Fit
    frames: tuple[Attribution, ...]
    verification: Verification
    latent: LatentForce | None = None
    scores: tuple[Score, ...] = ()
    where: Location | None = None

    def __repr__(self) -> str:
        words = []
        for v in self.verdicts:
            names = " or ".join(v.names_in_words) or v.reason
            words.append(
                v.answer.replace("_", " ") + (f": {names}" if names else "") + f", grade {v.grade}" * bool(v.grade)
            )
        candidates = count_of(len(self.scores), "candidate")
        return f"Diagnosis({'; '.join(words)}; probability {self.probability:.2f}, {candidates})"

    @property
    def verdict(self) -> Verdict:
        """The verdict on the first effect."""
        return self.verdicts[0]

    @property
    def probability(self) -> float:
        """Probability of all that is stated: that of the least certain verdict."""
        return min(v.probability for v in self.verdicts)

    @property
    def possible_positions(self) -> tuple[tuple[float, float] | None, ...]:
        """First and last position of each effect of the fit [m]; None where only its own is possible, or none known."""
        possible = {s.candidate.key: s.possible_positions for v in self.verdicts for s in reversed(v.scores)}
        return tuple(possible.get(c.key) for c in self.fit.candidates)

    @property
    def names(self) -> tuple[str, ...]:
        """Families named, in the order in which they were found."""
        return tuple(v.names[0] for v in self.verdicts if v.answer == "named")


def diagnose(
    case: Case,
    settings: MismatchSettings | None = None,
    progress: Callable[[int, int, str], Any] | None = None,
    store: MutableMapping[str, Any] | None = None,
) -> Diagnosis:
    """Localize, name, model and verify what the simulator of ``case`` lacks.

    Parameters
    ----------
    case : Case
        Observations, nuisances, simulator and candidates.
    settings : MismatchSettings or None
        Thresholds; their reasons are in the configuration.
    progress : callable or None
        Called with (number done, total, key of the candidate) after every joint fit.
    store : mapping or None
        Fits by key, kept from an interrupted run and filled by this one.

    Returns
    -------
    Diagnosis

    Raises
    ------
    SimulationError
        If the base model cannot be simulated.
    CaseError
        If the parts of the case contradict each other, or a prediction has not the shape of its recording.
    """
    check_case(case)
    search, base = fit_base(Search.of(case, settings, progress, store))
    frames = tuple(attribute(*cell_energies(search.case.observations, base.residuals)))
    numerics = _assess_numerics(search, base)
    if numerics is not None:
        verification, latent = verify(search, base, base, None), latent_force_of(search.case, base)
        return Diagnosis((numerics,), base, base, frames, verification, latent)
    try:
        limited = replace(search, n_before=case.n_simulations)
        findings = withhold_names(name_tolerated(grade_names(_seek_effects(limited, base))))
    except SearchLimitError as error:
        findings = Findings(search, base, base, (unfinished_verdict(error.limit, search.settings),))
    search, base, fit, verdicts = findings.search, findings.base, findings.fit, findings.verdicts
    verification = verify(search, base, fit, _best_rival(verdicts[0]))
    if verification.error is not None:
        verification = replace(verification, error_of_fitted=error_of_fitted(search.case, base, fit))
    verdicts = confirm(verdicts, verification, search.settings)
    location, latent = _locate_unknown(findings, verdicts[0]), latent_force_of(search.case, base)
    return Diagnosis(verdicts, base, fit, frames, verification, latent, findings.scores, location)


def fit_base(search: Search, values: Mapping[str, float] | None = None) -> tuple[Search, Fit]:
    """Fit without any effect, with the errors of the observations as that fit gives them.

    Parameters
    ----------
    search : Search
        Its store may have the fit already.
    values : mapping or None
        Nuisance parameters where the fit starts; others start where the case says, or at their prior mean.

    Returns
    -------
    search : Search
        With these errors.
    fit : Fit

    Raises
    ------
    SimulationError
        If the base model cannot be simulated.
    """
    iterations = search.settings.base_iterations
    base = search.stored_fit("base", lambda: fit_jointly(search.case, values=values, iterations=iterations))
    assert base is not None
    return search.with_updated_errors(base)


def _assess_numerics(search: Search, base: Fit) -> Verdict | None:
    """Verdict "numerics" if the numerical error is too large a share of the mismatch, else None."""
    rule, error = _numerics_rule(search, base)
    if rule is None or rule.answer != "numerics":
        return None
    return Verdict("numerics", reason=rule.reason_for(error), probability=1.0, trail=(rule.name,))


def _numerics_rule(search: Search, base: Fit) -> tuple[Rule | None, NumericalError | None]:
    observations, errors = search.case.observations, search.case.numerical_error(base)
    if errors is None:
        return None, None
    own = mismatch = 0.0
    for o, e, r in zip(observations, errors, base.residuals):
        own += o.effective * float(np.sum(o.whiten(e) ** 2))
        mismatch += o.effective * float(np.sum(o.whiten(r) ** 2))
    n = sum(o.n_effective for o in observations)
    error = NumericalError(own, mismatch, n, search.settings.numerics_share)
    return first_applicable(NUMERICS_RULES, error), error


def _seek_effects(search: Search, base: Fit) -> Findings:
    """Verdicts on effects that are sought one after the other, each on top of those before.

    The first one stands if the search for further effects, or the comparison with them, is not finished or fails.
    """
    first, goes_on = _seek_effect(Findings(search, base, base), 0)
    try:
        return settle_pair(_seek_further(first) if goes_on else first)
    except SearchLimitError as error:
        limit = error.limit
    except SimulationError as error:
        limit = SearchLimit(0, 0, failure=str(error).removesuffix("."))
    return settle_pair(replace(first, verdicts=(keep_first(first.verdicts[0], limit),)))


def _seek_further(first: Findings) -> Findings:
    """The findings after further effects were sought on top of the first."""
    prepared = replace(first, fit=first.search.with_jacobian(first.fit))
    findings, goes_on = _prepare_next(prepared, first.verdicts[0])
    for effect in range(1, first.search.settings.effects):
        if not goes_on:
            break
        findings, goes_on = _seek_effect(findings, effect)
    return findings


def _seek_effect(findings: Findings, effect: int) -> tuple[Findings, bool]:
    """The findings after one more effect was sought, and whether a further one may be."""
    search, settings = findings.search.with_label(str(effect)), findings.search.settings
    promising = None if findings.is_unknown else {s.family for s in findings.scores if s.gain > settings.threshold}
    scores, fit = score_candidates(search, findings.fit, promising)
    findings = replace(findings, search=search, scores=scores, fit=fit, base=findings.base if effect else fit)
    verdict, score = assess(search, fit, scores)
    if effect:
        findings, stands = add_second(findings, verdict, score)
        return _prepare_next(findings, verdict) if stands else (findings, False)
    findings = replace(findings, verdicts=(verdict,))
    if verdict.answer == "none" or score is None or score.gain <= settings.threshold:
        return findings, False
    return replace(findings, fit=score.fit), True


def _prepare_next(findings: Findings, verdict: Verdict) -> tuple[Findings, bool]:
    """The findings as a further effect needs them after the last ``verdict``, and whether one may be sought."""
    if not findings.fit.jacobian:
        return findings, False
    if verdict.is_single_effect and not findings.is_unknown:  # candidates were compared with the errors of the base
        search, fit = findings.search.with_updated_errors(findings.fit)
        findings = replace(findings, search=search, fit=fit)
    if verdict.answer == "a_or_b" and not verdict.is_single_effect:  # both may be present
        return replace(findings, choice=findings), True
    search = findings.search
    return findings, search.case.is_large or excess_ratio(search, findings.fit) > 1.0


def grade_names(findings: Findings) -> Findings:
    """The findings with each name graded by the last fit, by ``decision.grade_name``.

    Parameters
    ----------
    findings : Findings

    Returns
    -------
    Findings
        With one verdict, "unknown", and the base fit if the last fit rejects a name.
    """
    search, fit = findings.search, findings.fit
    verdicts, failing = [], None
    free_share = free_law_share(search, findings.base, fit)
    value = strained_value(search.case, fit, search.settings.threshold)
    strained = str(value) if value is not None and value.nuisance.at is not None else ""
    strained = strained or conflict_of_files(search.case.nuisances, fit, search.settings.threshold)
    leaders = [v.scores[0] for v in findings.verdicts if v.scores]
    local_gain = sum(s.gain for s in leaders if s.has_position or "sensor" in s.candidate.where)
    shape_errors = THRESHOLDS.shape_error_share * local_gain
    local_change = evidence_of_any_component(local_changes(search.case, fit)) - shape_errors
    for verdict in findings.verdicts:
        is_refuted = verdict.answer == "a_or_b" and (strained or free_share > THRESHOLDS.max_free_law_share)
        if verdict.answer == "named" or is_refuted:
            excess = worst_excess(search, fit)
            verdict, rule, reason = grade_name(
                verdict, fit, excess, search.settings, free_share, strained, local_change
            )
            failing = failing or ((rule, reason) if rule.answer == "unknown" else None)
        verdicts.append(verdict)
    if failing is None:
        return replace(findings, verdicts=tuple(verdicts))
    rule, reason = failing
    unknown = verdicts[0].as_unknown(reason, search.settings)
    unknown = unknown if rule.name in unknown.trail else unknown.after(rule)
    return replace(findings, verdicts=(unknown,), fit=findings.base)


def _best_rival(verdict: Verdict) -> Score | None:
    """Best score of another family than the named one."""
    return next((s for s in verdict.scores if s.family not in verdict.names[:1]), None)


def _locate_unknown(findings: Findings, verdict: Verdict) -> Location | None:
    """Location of the residual if the answer is "unknown". None if only reserved recordings contradict "none"."""
    if verdict.answer != "unknown" or verdict.trail[-1] == "reserved_not_explained":
        return None
    search = findings.search
    if AMBIGUOUS in verdict.trail:
        return location_of_ambiguity(search.case)
    threshold = search.settings.threshold
    if {COMPONENT_DIFFERS, COMPONENT_UNUSUAL} & set(verdict.trail):
        return locate_component(search.case, findings.base, threshold)
    leader = next((s for s in verdict.scores[:1] if s.gain > threshold), None)
    if LEAVES_FORCE in verdict.trail and leader is not None:
        return location_of_left_force(search.case, leader)
    leader = None if {"strained_value_remains", "local_change_remains"} & set(verdict.trail) else leader
    absorbed = strained_value(search.case, findings.base, threshold)
    return locate(search.case, findings.base, leader, verdict.cause, absorbed, threshold)
