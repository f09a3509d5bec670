"""Diagnosis of a case: fit, localize, name, model and verify, with everything that the verdict rests on."""

from dataclasses import dataclass, replace

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.engine.cross_validation import shared
from turnout.mismatch.engine.decision import Verdict, opened
from turnout.mismatch.engine.evidence import heard, judged, latent_of, over, over_reserved
from turnout.mismatch.engine.latent_force import Latent
from turnout.mismatch.engine.localization import Whereabouts, whereabouts
from turnout.mismatch.engine.map_fit import CHEAP_STEPS, fit_jointly
from turnout.mismatch.engine.refit import kept, scored, to_the_end, with_derivatives
from turnout.mismatch.engine.reserved_data import decoy, fit_of_reserved, fit_percent, gain_error
from turnout.mismatch.engine.residual_attribution import attribute, cell_energies
from turnout.mismatch.engine.two_effects import (
    borne_out,
    both_stand,
    finished,
    needed,
    of_one_part,
    parted,
    reconsidered,
    refused,
    told_beside,
    unconfirmed,
    unforetold,
)

# Share of the first effect's evidence that an error in its shape may leave to a second one: sizes err by a fifth.
SHAPE = 0.05
# Multiple of the control level. A larger residual of reserved recordings contradicts the answer "none". Three opened
# controls reach 0.37 to 0.54, as for fitted recordings. Trains of a type that was not fitted may leave more.
UNFORETOLD = 2.0


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
    over: float = 0.0

    @property
    def fell(self):
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
    latent: Latent | None = None
    scored: tuple = ()
    where: Whereabouts | None = None

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
    if not case.frozen_jacobian:
        settings = replace(settings, base_iterations=CHEAP_STEPS, iterations=CHEAP_STEPS)
    tell = progress or (lambda done, total, what: None)
    base = kept(store, "base", lambda: fit_jointly(case, iterations=settings.base_iterations))
    case, base = _with_its_errors(case, base, settings, store)
    frames = tuple(attribute(*cell_energies(case.observations, base.residuals)))
    numerics = _own_numerics(case, base, settings)
    if numerics:
        verdict = Verdict("numerics", reason=numerics, probability=1.0)
        return Diagnosis(
            (verdict,), base, base, frames, _verified(case, base, base, None, settings), latent_of(case, base)
        )
    verdicts, fit, scores, choice = [], base, (), None
    for effect in range(settings.effects):
        promising = None if refused(verdicts) else {s.family for s in scores if s.gain > settings.threshold}
        scores, fit = scored(case, fit, settings, tell, store, effect, promising)
        base = base if effect else fit
        verdict, best = judged(case, fit, scores, settings)
        if effect and (not of_one_part(verdict) or best.gain < _shape_of(case, verdicts[0].scores[0], best)):
            verdicts[0] = told_beside(verdicts[0], verdict)
            break
        if choice:
            verdicts[0] = parted(case, base, verdicts[0], verdict, settings)
            if not of_one_part(verdicts[0]):
                break
        verdicts.append(verdict)
        if verdict.answer == "none" or best is None or best.gain <= settings.threshold:
            break
        found = with_derivatives(case, best.fit, settings)
        if not found.jacobian and effect:  # the simulation fails close to it: no evidence, no next effect
            verdicts.pop()
            break
        fit = found
        if not fit.jacobian:
            break
        if of_one_part(verdict) and not refused(verdicts):  # these were compared with the errors of the base
            case, fit = _with_its_errors(case, fit, settings, store)
        if verdict.answer == "a_or_b" and not of_one_part(verdict):  # both may be present
            choice = case, [verdict], fit, scores
        elif not case.frozen_jacobian and over(case, fit, settings) <= 1.0:
            break
    if refused(verdicts):
        verdicts, fit = reconsidered(case, base, fit, verdicts, settings)
    else:
        verdicts, fit = needed(case, base, fit, verdicts, settings)
        verdicts, fit = borne_out(case, fit, verdicts, settings)
    if choice and not both_stand(verdicts):
        case, verdicts, fit, scores = choice
    verdicts = [_as_it_ends(v, case, fit, settings) for v in verdicts]
    verdicts, fit = finished(base, fit, verdicts, settings)
    check = _verified(case, base, fit, _rival(verdicts[0]), settings)
    if len(verdicts) == 1 and check.fell:
        verdicts[0] = unconfirmed(verdicts[0], settings)
    leader = next((s for s in verdicts[0].scores[:1] if s.gain > settings.threshold), None)
    where = whereabouts(case, base, leader, verdicts[0].cause) if verdicts[0].answer == "unknown" else None
    if check.over > UNFORETOLD:
        verdicts[0] = unforetold(verdicts[0], settings)
    return Diagnosis(tuple(verdicts), base, fit, frames, check, latent_of(case, base), scores, where)


def _with_its_errors(case, fit, settings, store):
    """(case, fit) with errors of the observations as the model of ``fit`` gives them, and fitted again."""
    new = case.renewed(fit)
    if new is case:
        return case, fit
    key = f"renewed:{'+'.join(c.key for c in fit.candidates)}"
    try:
        return new, kept(store, key, lambda: to_the_end(new, fit, settings), fit.candidates)
    except SimulationError:
        return case, fit


def _as_it_ends(verdict, case, fit, settings):
    """A name by the last fit: graded by its residual, "a or b" if its size has no upper limit there. Others stay."""
    if verdict.answer != "named":
        return verdict
    own, grade = replace(verdict.scores[0], fit=fit), "A" if heard(case, fit, settings) <= 1.0 else "B"
    return opened(replace(verdict, grade=grade, scores=(own, *verdict.scores[1:])), settings)


def _shape_of(case, first, second):
    """Evidence that an error in the shape of the first effect may leave to another name. [nats]"""
    if first.candidate.exact or second.gain >= SHAPE * first.gain:
        return 0.0
    return SHAPE * first.gain * shared(case, second.fit, first.candidate, second.candidate)


def _own_numerics(case, base, settings):
    """A sentence if the numerical error reaches a third of the mismatch, else ""."""
    errors = case.numerical_error(base)
    if errors is None:
        return ""
    own = wrong = 0.0
    for o, e, r in zip(case.observations, errors, base.residuals):
        own += o.effective * float(np.sum(o.whitened(e) ** 2))
        wrong += o.effective * float(np.sum(o.whitened(r) ** 2))
    n = sum(o.n_effective for o in case.observations)
    material = own / n > 1.0 / 9.0
    if material and own > settings.numerics_share**2 * wrong:
        return f"own numerical error is {np.sqrt(own / wrong):.0%} of the mismatch: refine mesh and step first"
    return ""


def _rival(verdict):
    named = verdict.names[:1]
    others = [s for s in verdict.scores if s.family not in named]
    return others[0] if others else None


def _verified(case, base, fit, rival, settings):
    if not case.reserved:
        return Verification(0, float("nan"))
    n, (before, first) = len(case.reserved), fit_of_reserved(case, base)
    if before is None:
        return Verification(n, float("nan"))
    over_control = over_reserved(case, before, settings)
    if fit is base:
        return Verification(n, first, over=over_control)
    free = decoy(case.observations, base.predictions, case.reserved, before, fit.psi.size)
    other = fit_of_reserved(case, rival.fit)[1] if rival else None
    after, reached = fit_of_reserved(case, fit)
    error = None if after is None else gain_error(case.reserved, before, after)
    return Verification(n, first, reached, other, fit_percent(case.reserved, free), error, over_control)
