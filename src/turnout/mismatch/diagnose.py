"""The ten steps, from a case to a verdict with everything it rests on."""

from dataclasses import dataclass, field

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.held_out import held_out_score, mean_square_out
from turnout.mismatch.joint import Joint, fit_jointly
from turnout.mismatch.latent import Latent, latent_law
from turnout.mismatch.locate import attribute, cell_energies
from turnout.mismatch.shortlist import shortlist
from turnout.mismatch.verdict import Score, Verdict, judge
from turnout.mismatch.verify import decoy, fit_percent, predict_reserved


@dataclass(frozen=True)
class Verification:
    """Fit [%] on ``n`` reserved recordings ``before``, ``after`` with the named term, with ``rival`` and ``decoy``."""

    n: int
    before: float
    after: float | None = None
    rival: float | None = None
    decoy: float | None = None


@dataclass(frozen=True)
class Diagnosis:
    """Outcome of ``diagnose``: one verdict per effect found, the fits, the frames, the latent force."""

    verdicts: tuple[Verdict, ...]
    base: object
    fit: object
    frames: tuple
    verification: Verification
    latent: Latent | None = None
    preflight: dict = field(default_factory=dict)
    scored: tuple = ()

    @property
    def verdict(self):
        """The verdict on the first effect."""
        return self.verdicts[0]

    @property
    def names(self):
        """Families named, in order of discovery."""
        return tuple(v.names[0] for v in self.verdicts if v.answer == "named")


def diagnose(case, settings=None, progress=None, store=None):
    """Locate, name, model and verify what the simulator of ``case`` leaves out.

    Parameters
    ----------
    case : Case
        Observations, nuisances, simulator and candidates.
    settings : MismatchSettings or None
        Thresholds; their reasons are in the configuration.
    progress : callable or None
        Called with (done, total, what) after every joint fit.
    store : mapping or None
        Fits by key, kept from an interrupted run and filled by this one.

    Returns
    -------
    Diagnosis
    """
    settings, store = settings or MismatchSettings(), {} if store is None else store
    tell = progress or (lambda done, total, what: None)
    base = _kept(store, "base", lambda: fit_jointly(case, iterations=settings.base_iterations))
    frames = tuple(attribute(*cell_energies(case.observations, base.residuals), settings.permutations))
    numerics = _own_numerics(case, base, settings)
    if numerics:
        verdict = Verdict("numerics", reason=numerics, probability=1.0)
        return Diagnosis((verdict,), base, base, frames, _verified(case, base, base, None), _latent_of(case, base))
    verdicts, fit, scored = [], base, ()
    for effect in range(settings.effects):
        scored = _scored(case, fit, settings, tell, store, effect)
        verdict, best = _judged(case, fit, scored, settings)
        if effect and verdict.answer != "named":
            break
        verdicts.append(verdict)
        if verdict.answer not in ("named", "a_or_b"):
            break
        fit = best.fit
        if verdict.answer == "a_or_b" or max(fit.level.values()) <= settings.control_level:
            break
    rival = _rival(verdicts[0])
    return Diagnosis(
        tuple(verdicts), base, fit, frames, _verified(case, base, fit, rival), _latent_of(case, base), {},
        tuple(scored),
    )  # fmt: skip


def _kept(store, key, compute, candidates=()):
    """A fit by its key, computed where the store lacks it; stores hold fits without their candidates' functions."""
    if key not in store:
        fit = compute()
        store[key] = fit.with_candidates(()) if fit is not None else None
    fit = store[key]
    return None if fit is None else fit.with_candidates(candidates)


def _scored(case, fit, settings, tell, store, effect):
    """Best Score of each family, all refitted jointly on top of ``fit``."""
    plan = shortlist(case, fit, settings)
    reference = held_out_score(case, fit)
    control = _control(fit, settings)
    scores = {}
    for done, (candidate, start) in enumerate(plan):
        key = f"{effect}:{'+'.join(c.key for c in fit.candidates)}:{candidate.key}:{tuple(np.round(start, 12))}"
        both = (*fit.candidates, candidate)
        refit = _kept(store, key, lambda c=candidate, s=start: _refit(case, fit, c, s, settings), both)
        tell(done + 1, len(plan), candidate.key)
        if refit is None:
            continue
        score = _score(case, fit, refit, candidate, reference, control)
        known = scores.get(candidate.family)
        if known is None or score.gain > known.gain:
            scores[candidate.family] = score
    ranked = sorted(scores.values(), key=lambda s: -s.gain)
    if case.frozen_jacobian:
        ranked = [*_polished(case, fit, ranked[:2], settings, store, effect, reference), *ranked[2:]]
    return tuple(sorted(ranked, key=lambda s: -s.gain))


def _polished(case, fit, scores, settings, store, effect, reference):
    """The leaders refitted to the end, with derivatives of their own: the verdict rests on these."""
    for score in scores:
        if score.gain < -settings.threshold:
            yield score
            continue
        key = f"{effect}:polished:{score.candidate.key}:{len(fit.candidates)}"
        refit = _kept(store, key, lambda f=score.fit: _to_the_end(case, f, settings), score.fit.candidates)
        yield _score(case, fit, refit, score.candidate, reference, _control(fit, settings))


def _to_the_end(case, fit, settings):
    return fit_jointly(case, fit.candidates, fit.psi, fit.values, iterations=settings.base_iterations)


def _refit(case, fit, candidate, start, settings):
    """Joint refit from this start; None where the simulation cannot go there."""
    keep = fit.jacobian if case.frozen_jacobian else None
    psi = np.concatenate([fit.psi, start])
    candidates = (*fit.candidates, candidate)
    values = dict(fit.values)
    if not candidate.start_from_base:  # what the base may have bent to hide the effect goes back to its prior
        values |= {n.name: n.mean for n in case.nuisances if n.owner is None and n.trust < 1.0}
    try:
        return fit_jointly(case, candidates, psi, values, keep, iterations=settings.iterations)
    except SimulationError:
        return None


def _control(fit, settings):
    return {kind: settings.control_level for kind in fit.level}


def _excess(level, control):
    return sum(max(0.0, level[kind] - control[kind]) for kind in level)


def _score(case, fit, refit, candidate, reference, control):
    mine = held_out_score(case, refit)
    by_condition = {c: mine[c] - reference[c] for c in reference}
    gain = sum(by_condition.values()) if by_condition else 0.5 * (fit.cost - refit.cost) - len(candidate.parameters)
    before = _excess(fit.level, control)
    explained = 1.0 - _excess(refit.level, control) / before if before > 0.0 else 1.0
    worst = min(by_condition.values(), default=0.0)
    return Score(candidate, gain - np.log(candidate.scanned), worst, explained, refit, by_condition)


def _judged(case, fit, scored, settings):
    best = max(scored, key=lambda s: s.gain, default=None)
    excess = max(fit.level.values()) / settings.control_level
    if best is None:
        return judge([], excess, settings), None
    consistent, structure = True, 0.0
    if best.gain > settings.threshold:
        consistent = _consistent(case, best.fit, settings)
        left = _latent_of(case, best.fit)
        structure = max(left.r2.values(), default=0.0) if left else 0.0
    return judge(scored, excess, settings, consistent, structure), best


def _consistent(case, fit, settings):
    """Reserved conditions are predicted about as well as those fitted, given what the parameters leave open."""
    if not case.reserved:
        return True
    predictions = predict_reserved(case, fit, case.reserved)
    inside = max(1.0, mean_square_out(case, fit, case.observations, fit.predictions))
    joint = Joint(case, fit.candidates, case.reserved)
    theta = np.concatenate([[fit.values[n.name] for n in case.nuisances], fit.psi])
    for o, p, jacobian in zip(case.reserved, predictions, joint.jacobian(theta, predictions)):
        rows = jacobian / o.sigma[:, None]
        open_ = float(np.mean(np.sum((rows @ fit.covariance) * rows, axis=1)))
        if mean_square_out(case, fit, [o], [p]) > settings.withdrawn_ratio * (inside + open_):
            return False
    return True


def _own_numerics(case, base, settings):
    """A sentence where our own error reaches a third of the mismatch, "" otherwise."""
    errors = case.numerical_error(base)
    if errors is None:
        return ""
    own = wrong = 0.0
    for o, e, r in zip(case.observations, errors, base.residuals):
        own += o.effective * float(np.sum((e / o.sigma) ** 2))
        wrong += o.effective * float(np.sum((r / o.sigma) ** 2))
    n = sum(o.n_effective for o in case.observations)
    material = own / n > 1.0 / 9.0
    if material and own > settings.numerics_share**2 * wrong:
        return f"own numerical error is {np.sqrt(own / wrong):.0%} of the mismatch: refine mesh and step first"
    return ""


def _latent_of(case, fit):
    seen = case.latent(fit)
    if not seen:
        return None
    covariates = {k: v for k, v in seen.items() if k not in ("force", "unit")}
    return latent_law(seen["force"], covariates, seen.get("unit", "N"))


def _rival(verdict):
    named = verdict.names[:1]
    others = [s for s in verdict.scores if s.family not in named]
    return others[0] if others else None


def _verified(case, base, fit, rival):
    if not case.reserved:
        return Verification(0, float("nan"))
    before = predict_reserved(case, base, case.reserved)
    first = fit_percent(case.reserved, before)
    if fit is base:
        return Verification(len(case.reserved), first)
    after = fit_percent(case.reserved, predict_reserved(case, fit, case.reserved))
    free = decoy(case.observations, base.predictions, case.reserved, before, fit.psi.size)
    other = fit_percent(case.reserved, predict_reserved(case, rival.fit, case.reserved)) if rival else None
    return Verification(len(case.reserved), first, after, other, fit_percent(case.reserved, free))
