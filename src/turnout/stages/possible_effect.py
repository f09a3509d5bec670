"""What the answer "none" states beside it: the likeliest effect, and that values are not those of the files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.stages.accepted_effects import describe_term
from turnout.stages.mismatch_text import effect_in_words

if TYPE_CHECKING:
    from turnout.mismatch.engine.verdict import Verdict
    from turnout.mismatch.turnout.case import TrackCase

WITHOUT_EVIDENCE = "no_candidate_passes"  # rule of the decision: no effect has the evidence that a name needs


def sentence_on_possible_effect(verdict: Verdict, case: TrackCase, finding: Mapping[str, Any]) -> str:
    """A sentence on the likeliest effect if it has half of the evidence of a name, "" otherwise.

    How often it is right: docs/decisions/price-of-a-name.md.

    Parameters
    ----------
    verdict : Verdict
        The first one of a diagnosis.
    case : TrackCase
        The case that was diagnosed.
    finding : mapping
        Its row of ``mismatch_findings``.

    Returns
    -------
    str
    """
    score = next((s for s in verdict.scores if s.is_reportable), None)
    threshold = case.settings.threshold
    if WITHOUT_EVIDENCE not in verdict.trail or score is None:
        return ""
    if score.gain < THRESHOLDS.min_leader_gain * threshold:  # below, its fit is not continued to convergence
        return ""
    sizes, errors = score.estimates
    term = describe_term(score.candidate.term(sizes), score.candidate, errors, case.predictor.track())
    evidence = f"{np.floor(10.0 * score.gain) / 10.0:.1f} of the {threshold:.0f} nats of evidence"
    return f"Possible, with {evidence} that a name needs: “{effect_in_words(term, finding)}.”"


def agreement_sentence(sentence: str, has_other_values: bool) -> str:
    """The sentence of the answer "none", if other values than those of the files were needed for it.

    Parameters
    ----------
    sentence : str
        Of a diagnosis without a finding.
    has_other_values : bool
        Whether sentences on values that are not those of the files follow.

    Returns
    -------
    str

    Examples
    --------
    >>> agreement_sentence("Both agree.", True), agreement_sentence("Both agree.", False)
    ('Both agree, but only with other values than the files have.', 'Both agree.')
    """
    if not has_other_values:
        return sentence
    return f"{sentence.removesuffix('.')}, but only with other values than the files have."
