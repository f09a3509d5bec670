"""Names of effects that a wide tolerance of the base model hides, such as a worn nose.

The base model explains them, so no evidence speaks for them. Their size is a finding all the same, as far as the effect
explains the recordings as well as the tolerance does: with it, the parameter that masks it is held at its mean.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.decision import TOLERATED_RULES
from turnout.mismatch.engine.decision_facts import ToleratedEvidence
from turnout.mismatch.engine.evidence import explained_share, worst_excess
from turnout.mismatch.engine.large_values import with_wide_priors
from turnout.mismatch.engine.rule import first_applicable
from turnout.mismatch.engine.score import Score
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.mismatch.engine.verdict import Verdict, calibrate

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.findings import Findings
    from turnout.mismatch.engine.fit import Fit


def name_tolerated(findings: Findings) -> Findings:
    """The findings, with the name of an effect that the base model hides where nothing else has one.

    The effect must be reportable and possible, and its fit at most a margin less probable than the base.

    Parameters
    ----------
    findings : Findings
        With grades.

    Returns
    -------
    Findings
        As they are if anything has a name, or if no such effect stands.
    """
    search, base = findings.search, findings.base
    if findings.verdicts[0].answer not in ("none", "unknown"):
        return findings
    for candidate in search.case.tolerated_effects(base):
        fit = _fit_with(findings, candidate)
        if fit is None:
            continue
        score = Score(candidate, fit.evidence - base.evidence, 0.0, explained_share(search, base, fit), fit)
        rule = first_applicable(TOLERATED_RULES, evidence := ToleratedEvidence(score, search.settings))
        if rule.answer == "named":
            verdict = _verdict(findings, score, rule.reason_for(evidence)).after(rule)
            return replace(findings, fit=fit, verdicts=(verdict,))
    return findings


def _fit_with(findings: Findings, candidate: Candidate) -> Fit | None:
    """Converged fit with the effect, and its masking parameter held. None if it cannot be simulated."""
    search, base = findings.search, findings.base
    held = with_wide_priors(search.case, (candidate.site.masking_parameter,), THRESHOLDS.held_share)
    search = replace(search, case=held)
    start, values = np.asarray(candidate.starts[0], dtype=float), {**base.values, **candidate.refit.nuisances}
    try:
        return search.stored_fit(
            f"tolerated:{candidate.key}",
            lambda: search.converge(search.fit((candidate,), start, values)),
            (candidate,),
        )
    except SimulationError:
        return None


def _verdict(findings: Findings, score: Score, reason: str) -> Verdict:
    settings, first = findings.search.settings, findings.verdicts[0]
    probabilities = {**first.posterior, score.family: max(first.posterior.values(), default=1.0)}
    probability = calibrate(probabilities, (score.family,), settings.certainty("named"), settings)
    grade = "A" if worst_excess(findings.search, score.fit) <= 1.0 else "B"
    return Verdict(
        "named", (score.family,), grade, probability, probabilities, (score, *first.scores), reason, "", first.trail
    )  # fmt: skip
