"""Value of a candidate: its gain, the share of the excess that it explains, its residual; and the verdict on
candidates.
"""

import numpy as np

from turnout.mismatch.engine.cross_validation import held_out_score, mean_square_out, told_alone
from turnout.mismatch.engine.decision import judge, leading, objected
from turnout.mismatch.engine.latent_force import latent_law
from turnout.mismatch.engine.reserved_data import falls, fit_of_reserved
from turnout.mismatch.engine.score import Score

ODD = 3.0  # spreads of similar components: one in 370 intact ones is beyond
FEWEST = 6  # similar components; fewer give no spread


def explained_of(case, fit, refit, settings):
    """Share of the excess over the control level that ``refit`` removes, 1 if there is none.

    For a first effect without excess in any data type, the excess of the worst channel counts. Beside a name that
    excess may be the residual of the name, which a second effect need not explain.
    """
    control = _control(case, fit, settings)
    before, after = _excess(fit.level, control), _excess(refit.level, control)
    if before == 0.0 and not fit.candidates:
        before, after = (max(0.0, loudest(case, f) - 1.0) for f in (fit, refit))
    return 1.0 - after / before if before > 0.0 else 1.0


def _control(case, fit, settings):
    """Control level: data type -> weighted mean square of controls."""
    return {kind: case.control_level.get(kind, settings.control_level) for kind in fit.level}


def _excess(level, control):
    return sum(max(0.0, level[kind] - control[kind]) for kind in level)


def score_of(case, fit, refit, candidate, settings):
    """Score of a candidate: gain less the logarithm of the number of sites.

    The gain is that of held-out conditions. In an expensive case with many nuisances it is the evidence, in which the
    first condition is predicted from the priors.
    """
    gain, by_condition = refit.evidence - fit.evidence, {}
    if not case.frozen_jacobian:
        mine, reference = held_out_score(case, refit), held_out_score(case, fit)
        by_condition = {c: mine[c] - reference[c] for c in reference}
        gain = sum(by_condition.values()) if by_condition else gain
    explained = explained_of(case, fit, refit, settings)
    worst = min(by_condition.values(), default=0.0)
    gain += candidate.aside
    usual = _usual(case, refit, candidate) or not _shown(case, fit, refit, candidate, settings)
    return Score(candidate, gain - np.log(candidate.scanned), worst, explained, refit, by_condition, usual)


def _shown(case, fit, refit, candidate, settings):
    """Whether the required observations, if any, fit better by a margin, and those that must not oppose do not."""
    gained = 0.5 * sum(
        o.effective * float(np.sum(np.square(a)) - np.sum(np.square(b))) / fit.scale[o.kind]
        for o, a, b in zip(case.observations, fit.white, refit.white)
        if o.kind == candidate.told_by
    )
    told = not candidate.told_by or gained > settings.margin
    return told and not _opposed(case, fit, refit, candidate)


def _opposed(case, fit, refit, candidate):
    """Whether observations that must not oppose a candidate contradict it.

    They do so if they put its masking parameter, with a prior as wide as the effect's, nearer to its value without the
    effect than to its value with it.
    """
    kinds = {o.kind for o in case.observations if o.name in candidate.unopposed}
    if not kinds or not fit.jacobian:
        return False
    size = refit.psi[refit.part(candidate).start] - candidate.neutral[0]
    mean = next(n.mean for n in case.nuisances if n.name == candidate.twin)
    return any((told_alone(case, fit, k, candidate.twin, candidate.twin_sd) - mean) / size < 0.5 for k in kinds)


def _usual(case, refit, candidate):
    r"""Whether a component differs by no more than ``MAX_ORDINARY_SPREADS`` from similar ones, the effect included.

    .. math:: |\ln \psi| < 3 s, \quad s^2 = \overline{(v_j - ar v)^2} + \overline{\sigma_j^2}

    with :math:`v_j` the fitted logarithms of the other components and :math:`\sigma_j` their standard errors.
    """
    if not candidate.twin or candidate.from_twin:
        return False
    stem = candidate.twin.rsplit("_", 1)[0]  # of pad_31; pad_stiffness is the common value
    like = [k for k, n in enumerate(case.nuisances) if n.name.removeprefix(f"{stem}_").isdigit()]
    like = [k for k in like if case.nuisances[k].name != candidate.twin]
    first = refit.psi[refit.part(candidate).start]
    if len(like) < FEWEST or first <= 0.0:
        return False
    values = np.array([refit.values[case.nuisances[k].name] for k in like])
    spread = np.sqrt(values.var() + np.mean(np.diag(refit.covariance)[like]))
    return abs(float(np.log(first))) < ODD * spread


def over(case, fit, settings):
    """Weighted mean square over the control level, the largest of the data types."""
    control = _control(case, fit, settings)
    return max(fit.level[kind] / control[kind] for kind in fit.level)


def over_reserved(case, predictions, settings):
    """The same for the reserved recordings with these ``predictions``; 0 if there are none."""
    found = [0.0]
    for kind in {o.kind for o in case.reserved}:
        mine = [(o, p) for o, p in zip(case.reserved, predictions) if o.kind == kind]
        found.append(mean_square_out(*zip(*mine)) / case.control_level.get(kind, settings.control_level))
    return max(found)


def heard(case, fit, settings):
    """Largest excess ratio of ``fit``: of a data type, or of one channel of one recording."""
    return max(over(case, fit, settings), loudest(case, fit))


def loudest(case, fit):
    """Largest mean square of one channel in one recording over that of controls, for data types with such a level."""
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


def judged(case, fit, scored, settings):
    """(Verdict on these candidates on top of ``fit``, the Score that it names or would name, or None)."""
    excess = heard(case, fit, settings)
    scored = tuple(s for s in scored if s.material)
    if not scored:
        return judge([], excess, settings, disturbed=bool(case.disturbed), foreign=case.foreign), None
    best = leading(scored, excess, settings)
    consistent, structure = True, 0.0
    if best.gain > settings.threshold:
        consistent = consistent_elsewhere(case, fit, best, settings)
        structure = structure_left(case, best.fit)
    left = over(case, best.fit, settings)
    verdict = judge(scored, excess, settings, consistent, structure, left, bool(case.disturbed), case.foreign)
    return verdict, verdict.scores[0]


def structure_left(case, fit):
    """Share of the residual of ``fit`` that a free force law of the state still explains."""
    left = latent_of(case, fit)
    return max(left.r2.values(), default=0.0) if left else 0.0


def consistent_elsewhere(case, base, best, settings):
    """Whether reserved conditions are predicted no worse than without the effect.

    Worse means: twice the mean square, or a lower fit that costs more evidence than one condition may lose
    (``decision.is_contradicted``), or no prediction at all.
    """
    if not case.reserved:
        return True
    before, after = (fit_of_reserved(case, f)[0] for f in (base, best.fit))
    if after is None or before is None:
        return before is None
    squares = [mean_square_out(case.reserved, p) for p in (before, after)]
    lost = 0.5 * sum(o.n_effective for o in case.reserved) * (squares[1] - squares[0])
    fell = falls(case.reserved, before, after, settings.fall) and objected(-lost, best.gain, settings)
    return squares[1] <= settings.withdrawn_ratio * squares[0] and not fell


def latent_of(case, fit):
    """``LatentForce`` that ``fit`` lacks. None if the case has no such view."""
    seen = case.latent(fit)
    if not seen:
        return None
    covariates = {k: v for k, v in seen.items() if k not in ("force", "unit")}
    return latent_law(seen["force"], covariates, seen.get("unit", "N"))
