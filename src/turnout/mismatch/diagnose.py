"""The ten steps, from a case to a verdict with everything it rests on."""

from dataclasses import dataclass, field, replace

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.held_out import held_out_score, mean_square_out
from turnout.mismatch.joint import cost_at, fit_jointly
from turnout.mismatch.latent import Latent, latent_law
from turnout.mismatch.locate import attribute, cell_energies
from turnout.mismatch.shortlist import shortlist
from turnout.mismatch.verdict import Score, Verdict, judge
from turnout.mismatch.verify import decoy, falls, fit_percent, predict_reserved
from turnout.mismatch.whereabouts import Whereabouts, whereabouts


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
    """Outcome of ``diagnose``: one verdict per effect found, the fits, the frames, the latent force, and ``where`` that
    acts which got no name."""

    verdicts: tuple[Verdict, ...]
    base: object
    fit: object
    frames: tuple
    verification: Verification
    latent: Latent | None = None
    preflight: dict = field(default_factory=dict)
    scored: tuple = ()
    where: Whereabouts | None = None

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
        if verdict.answer == "a_or_b" or (not case.frozen_jacobian and _over(case, fit, settings) <= 1.0):
            break
    rival, refused = _rival(verdicts[0]), verdicts[0].scores[0] if verdicts[0].scores else None
    where = whereabouts(case, base, refused) if verdicts[0].answer == "unknown" else None
    return Diagnosis(
        tuple(verdicts), base, fit, frames, _verified(case, base, fit, rival), _latent_of(case, base), {},
        tuple(scored), where,
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
    scores = {}
    for done, (candidate, start, back) in enumerate(plan):
        key = f"{effect}:{'+'.join(c.key for c in fit.candidates)}:{candidate.key}:{tuple(np.round(start, 12))}"
        both = (*fit.candidates, candidate)
        refit = _kept(store, key, lambda c=candidate, s=start, b=back: _refit(case, fit, c, s, b, settings), both)
        tell(done + 1, len(plan), candidate.key)
        if refit is None:
            continue
        score = _score(case, fit, refit, candidate, settings)
        known = scores.get(candidate.family)
        if known is None or score.gain > known.gain:
            scores[candidate.family] = score
    ranked = sorted(scores.values(), key=lambda s: -s.gain)
    if case.frozen_jacobian and ranked:
        leaders = [s for s in ranked[:2] if s.gain > max(settings.threshold, ranked[0].gain - settings.margin)]
        polished = [_polished(case, fit, s, settings, store, effect) for s in leaders]
        ranked = sorted([*polished, *ranked[len(leaders) :]], key=lambda s: -s.gain)
    return tuple([_checked(case, fit, s) for s in ranked[:1]] + ranked[1:])


def _polished(case, fit, score, settings, store, effect):
    """A leader refitted to the end, with derivatives of its own: the verdict rests on these."""
    key = f"{effect}:polished:{score.candidate.key}:{len(fit.candidates)}"
    refit = _kept(store, key, lambda: _to_the_end(case, score.fit, settings), score.fit.candidates)
    new = _score(case, fit, refit, score.candidate, settings)
    return new if new.gain > score.gain else score


def _checked(case, fit, score):
    """The leader of a dear case with its gain condition by condition, each left out in turn."""
    if not case.frozen_jacobian:
        return score
    mine, reference = held_out_score(case, score.fit), held_out_score(case, fit)
    by_condition = {c: mine[c] - reference[c] for c in reference}
    return replace(score, worst=min(by_condition.values(), default=0.0), by_condition=by_condition)


def _to_the_end(case, fit, settings):
    return fit_jointly(case, fit.candidates, fit.psi, fit.values, iterations=settings.iterations)


def _refit(case, fit, candidate, start, back, settings):
    """Joint refit from this start; None where the simulation cannot go there."""
    keep = fit.jacobian if case.frozen_jacobian else None
    psi = np.concatenate([fit.psi, start])
    candidates = (*fit.candidates, candidate)
    values = {**fit.values, **back}
    if not candidate.start_from_base and not back:  # what the base may have bent goes back to its prior
        values |= {n.name: n.mean for n in case.nuisances if n.owner is None and n.trust < 1.0}
    try:
        psi = _best_start(case, candidates, psi, values) if back or candidate.even else psi
        return fit_jointly(case, candidates, psi, values, keep, iterations=settings.iterations)
    except SimulationError:
        return None


def _best_start(case, candidates, psi, values):
    """``psi`` or the last candidate's own starts: what the cheap observations cannot see is asked of the dear ones."""
    candidate = candidates[-1]
    if candidate.start_from_base and not candidate.even:
        return psi
    n, found = psi.size - len(candidate.parameters), []
    others = (candidate.mirrored(psi[n:]),) if candidate.even else candidate.starts
    for start in (psi[n:], *others):
        tried = np.concatenate([psi[:n], np.asarray(start, dtype=float)])
        try:
            found.append((cost_at(case, candidates, tried, values), tuple(tried)))
        except SimulationError:
            continue
    return np.array(min(found)[1]) if found else psi


def _control(case, fit, settings):
    """Weighted mean square by kind that controls reach."""
    return {kind: case.control_level.get(kind, settings.control_level) for kind in fit.level}


def _excess(level, control):
    return sum(max(0.0, level[kind] - control[kind]) for kind in level)


def _score(case, fit, refit, candidate, settings):
    """Gain less the logarithm of the places scanned: held out condition by condition, or, where nuisances are many and
    predictions dear, in evidence, in which the first condition is predicted from the priors."""
    gain, by_condition = refit.evidence - fit.evidence, {}
    if not case.frozen_jacobian:
        mine, reference = held_out_score(case, refit), held_out_score(case, fit)
        by_condition = {c: mine[c] - reference[c] for c in reference}
        gain = sum(by_condition.values()) if by_condition else gain
    control = _control(case, fit, settings)
    before = _excess(fit.level, control)
    explained = 1.0 - _excess(refit.level, control) / before if before > 0.0 else 1.0
    worst = min(by_condition.values(), default=0.0)
    return Score(candidate, gain - np.log(candidate.scanned), worst, explained, refit, by_condition)


def _over(case, fit, settings):
    """Weighted mean square over the level of controls, the largest of the kinds."""
    control = _control(case, fit, settings)
    return max(fit.level[kind] / control[kind] for kind in fit.level)


def _loudest(case, fit):
    """Largest mean square of one channel in one recording over what it is in controls, of the kinds that tell."""
    found = [0.0]
    for o, white in zip(case.observations, fit.white):
        if o.kind not in case.cell_level or o.cells is None or "sensor" not in o.labels:
            continue
        inside = o.cells >= 0
        level, code = np.unique(o.labels["sensor"].astype(str), return_inverse=True)
        channel = code[o.cells[inside]]
        count = np.maximum(np.bincount(channel, minlength=level.size), 1)
        square = np.bincount(channel, np.asarray(white)[inside] ** 2, minlength=level.size)
        found.append(float(np.max(square / count)) / case.cell_level[o.kind])
    return max(found)


def _judged(case, fit, scored, settings):
    best = max((s for s in scored if s.material), key=lambda s: s.gain, default=None)
    excess = max(_over(case, fit, settings), _loudest(case, fit))
    scored = tuple(s for s in scored if s.material)
    if best is None:
        return judge([], excess, settings, disturbed=bool(case.disturbed)), None
    consistent, structure = True, 0.0
    if best.gain > settings.threshold:
        consistent = _consistent(case, fit, best.fit, settings)
        left = _latent_of(case, best.fit)
        structure = max(left.r2.values(), default=0.0) if left else 0.0
    left = _over(case, best.fit, settings)
    return judge(scored, excess, settings, consistent, structure, left, bool(case.disturbed)), best


def _consistent(case, base, fit, settings):
    """Reserved conditions are predicted no worse than without the effect."""
    if not case.reserved:
        return True
    before, after = (predict_reserved(case, f, case.reserved) for f in (base, fit))
    squares = [mean_square_out(case, f, case.reserved, p) for f, p in ((base, before), (fit, after))]
    fell = falls(case.reserved, before, after, settings.fall)
    return squares[1] <= settings.withdrawn_ratio * squares[0] and not fell


def _own_numerics(case, base, settings):
    """A sentence where our own error reaches a third of the mismatch, "" otherwise."""
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
