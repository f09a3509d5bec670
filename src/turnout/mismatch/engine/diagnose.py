"""Diagnosis of a case: fit, localize, name, model and verify, with everything that the verdict rests on."""

from dataclasses import dataclass, replace

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.engine.cross_validation import signature_overlap
from turnout.mismatch.engine.decision import Verdict, with_open_size
from turnout.mismatch.engine.evidence import assess, excess_ratio, latent_force_of, reserved_excess_ratio, worst_excess
from turnout.mismatch.engine.latent_force import LatentForce
from turnout.mismatch.engine.localization import Location, locate
from turnout.mismatch.engine.map_fit import MAX_CHEAP_STEPS, fit_jointly
from turnout.mismatch.engine.refit import cached_fit, continue_fit, score_candidates, with_jacobian
from turnout.mismatch.engine.reserved_data import fit_percent, gain_error, predict_with_decoy, reserved_fit
from turnout.mismatch.engine.residual_attribution import attribute, cell_energies
from turnout.mismatch.engine.two_effects import (
    drop_redundant_first,
    drop_unpredictive_second,
    is_accepted_pair,
    is_single_effect,
    is_unknown,
    reject_if_reserved_unexplained,
    reject_if_residual_left,
    reject_unconfirmed,
    retest_with_second,
    split_rivals,
    with_residual_reason,
)

# Share of the first effect's evidence that an error in its shape may leave to a second one: sizes err by a fifth.
SHAPE_ERROR_SHARE = 0.05
# Multiple of the control level. A larger residual of reserved recordings contradicts the answer "none". Three opened
# controls reach 0.37 to 0.54, as for fitted recordings. Trains of a type that was not fitted may leave more.
MAX_RESERVED_EXCESS = 2.0


@dataclass(frozen=True)
class Verification:
    """Fit [%] of ``n`` reserved recordings: ``before``, ``after`` with the named term, with ``rival`` and with
    ``decoy``.

    ``error`` is the standard error of ``after`` less ``before``. ``reserved_excess`` is the weighted mean square
    without a term over the control level.
    """

    n: int
    before: float
    after: float | None = None
    rival: float | None = None
    decoy: float | None = None
    error: float | None = None
    reserved_excess: float = 0.0

    @property
    def is_worse(self):
        """Whether the named model predicts the reserved recordings worse, by more than the standard error."""
        return self.error is not None and self.after < self.before - self.error


@dataclass(frozen=True)
class Diagnosis:
    """Outcome of ``diagnose``: one verdict per effect, the fits, the attributions, the verification and the latent
    force.

    ``where`` is the location of a residual that got no name.
    """

    verdicts: tuple[Verdict, ...]
    base: object
    fit: object
    frames: tuple
    verification: Verification
    latent: LatentForce | None = None
    scores: tuple = ()
    where: Location | None = None

    @property
    def verdict(self):
        """The verdict on the first effect."""
        return self.verdicts[0]

    @property
    def probability(self):
        """Probability of all that is stated: that of the least certain verdict."""
        return min(v.probability for v in self.verdicts)

    @property
    def names(self):
        """Families named, in the order in which they were found."""
        return tuple(v.names[0] for v in self.verdicts if v.answer == "named")


def diagnose(case, settings=None, progress=None, store=None):
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
    """
    settings, store = settings or MismatchSettings(), {} if store is None else store
    if not case.expensive:
        settings = replace(settings, base_iterations=MAX_CHEAP_STEPS, iterations=MAX_CHEAP_STEPS)
    report = progress or (lambda n_done, total, what: None)
    base = cached_fit(store, "base", lambda: fit_jointly(case, iterations=settings.base_iterations))
    case, base = _refit_with_updated_errors(case, base, settings, store)
    frames = tuple(attribute(*cell_energies(case.observations, base.residuals)))
    numerics = _numerics_reason(case, base, settings)
    if numerics:
        verdict = Verdict("numerics", reason=numerics, probability=1.0)
        return Diagnosis(
            (verdict,), base, base, frames, _verify(case, base, base, None, settings), latent_force_of(case, base)
        )
    verdicts, fit, scores, alternative = [], base, (), None
    for effect in range(settings.effects):
        promising = None if is_unknown(verdicts) else {s.family for s in scores if s.gain > settings.threshold}
        scores, fit = score_candidates(case, fit, settings, report, store, effect, promising)
        base = base if effect else fit
        verdict, top_score = assess(case, fit, scores, settings)
        if effect and (
            not is_single_effect(verdict)
            or top_score.gain < _shape_error_evidence(case, verdicts[0].scores[0], top_score)
        ):
            verdicts[0] = with_residual_reason(verdicts[0], verdict)
            break
        if alternative:
            verdicts[0] = split_rivals(case, base, verdicts[0], verdict, settings)
            if not is_single_effect(verdicts[0]):
                break
        verdicts.append(verdict)
        if verdict.answer == "none" or top_score is None or top_score.gain <= settings.threshold:
            break
        continued = with_jacobian(case, top_score.fit, settings)
        if not continued.jacobian and effect:  # the simulation fails close to it: no evidence, no next effect
            verdicts.pop()
            break
        fit = continued
        if not fit.jacobian:
            break
        if is_single_effect(verdict) and not is_unknown(verdicts):  # these were compared with the errors of the base
            case, fit = _refit_with_updated_errors(case, fit, settings, store)
        if verdict.answer == "a_or_b" and not is_single_effect(verdict):  # both may be present
            alternative = case, [verdict], fit, scores
        elif not case.expensive and excess_ratio(case, fit, settings) <= 1.0:
            break
    if is_unknown(verdicts):
        verdicts, fit = retest_with_second(case, base, fit, verdicts, settings)
    else:
        verdicts, fit = drop_redundant_first(case, base, fit, verdicts, settings)
        verdicts, fit = drop_unpredictive_second(case, fit, verdicts, settings)
    if alternative and not is_accepted_pair(verdicts):
        case, verdicts, fit, scores = alternative
    verdicts = [_final_verdict(v, case, fit, settings) for v in verdicts]
    verdicts, fit = reject_if_residual_left(base, fit, verdicts, settings)
    verification = _verify(case, base, fit, _best_rival(verdicts[0]), settings)
    if len(verdicts) == 1 and verification.is_worse:
        verdicts[0] = reject_unconfirmed(verdicts[0], settings)
    leader = next((s for s in verdicts[0].scores[:1] if s.gain > settings.threshold), None)
    location = locate(case, base, leader, verdicts[0].cause) if verdicts[0].answer == "unknown" else None
    if verification.reserved_excess > MAX_RESERVED_EXCESS:
        verdicts[0] = reject_if_reserved_unexplained(verdicts[0], settings)
    return Diagnosis(tuple(verdicts), base, fit, frames, verification, latent_force_of(case, base), scores, location)


def _refit_with_updated_errors(case, fit, settings, store):
    """(case, fit) with errors of the observations as the model of ``fit`` gives them, and fitted again."""
    updated = case.with_updated_errors(fit)
    if updated is case:
        return case, fit
    key = f"renewed:{'+'.join(c.key for c in fit.candidates)}"
    try:
        return updated, cached_fit(store, key, lambda: continue_fit(updated, fit, settings), fit.candidates)
    except SimulationError:
        return case, fit


def _final_verdict(verdict, case, fit, settings):
    """A name by the last fit: graded by its residual, "a or b" if its size has no upper limit there. Others stay."""
    if verdict.answer != "named":
        return verdict
    final, grade = replace(verdict.scores[0], fit=fit), "A" if worst_excess(case, fit, settings) <= 1.0 else "B"
    return with_open_size(replace(verdict, grade=grade, scores=(final, *verdict.scores[1:])), settings)


def _shape_error_evidence(case, first, second):
    """Evidence that an error in the shape of the first effect may leave to another name. [nats]"""
    if first.candidate.exact or second.gain >= SHAPE_ERROR_SHARE * first.gain:
        return 0.0
    return SHAPE_ERROR_SHARE * first.gain * signature_overlap(case, second.fit, first.candidate, second.candidate)


def _numerics_reason(case, base, settings):
    """A sentence if the numerical error reaches a third of the mismatch, else ""."""
    errors = case.numerical_error(base)
    if errors is None:
        return ""
    own_error = mismatch = 0.0
    for o, e, r in zip(case.observations, errors, base.residuals):
        own_error += o.effective * float(np.sum(o.whiten(e) ** 2))
        mismatch += o.effective * float(np.sum(o.whiten(r) ** 2))
    n = sum(o.n_effective for o in case.observations)
    material = own_error / n > 1.0 / 9.0
    if material and own_error > settings.numerics_share**2 * mismatch:
        return f"own numerical error is {np.sqrt(own_error / mismatch):.0%} of the mismatch: refine mesh and step first"
    return ""


def _best_rival(verdict):
    named = verdict.names[:1]
    rivals = [s for s in verdict.scores if s.family not in named]
    return rivals[0] if rivals else None


def _verify(case, base, fit, rival, settings):
    if not case.reserved:
        return Verification(0, float("nan"))
    n, (before, before_percent) = len(case.reserved), reserved_fit(case, base)
    if before is None:
        return Verification(n, float("nan"))
    reserved_excess = reserved_excess_ratio(case, before, settings)
    if fit is base:
        return Verification(n, before_percent, reserved_excess=reserved_excess)
    decoy_predictions = predict_with_decoy(case.observations, base.predictions, case.reserved, before, fit.psi.size)
    rival_percent = reserved_fit(case, rival.fit)[1] if rival else None
    after, after_percent = reserved_fit(case, fit)
    error = None if after is None else gain_error(case.reserved, before, after)
    return Verification(
        n,
        before_percent,
        after_percent,
        rival_percent,
        fit_percent(case.reserved, decoy_predictions),
        error,
        reserved_excess,
    )
