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
    evidence = f"{np.floor(10.0 * score.gain) / 10.0:.1f} of the {threshold:.0f} nats (log odds) of evidence"
    return f"Possible, with {evidence} that a name needs: “{effect_in_words(term, finding)}.”"


def scope_of_agreement(sentence: str, n_compared: int, n_recorded: int) -> str:
    """The sentence of the answer "none", limited to the recordings that could be compared with the simulation.

    A passage that resembles its simulation too little is not compared: the largest effects are among them.

    Parameters
    ----------
    sentence : str
        Of a diagnosis without a finding.
    n_compared, n_recorded : int
        Passages that the diagnosis compared, and that it was given.

    Returns
    -------
    str

    Examples
    --------
    >>> scope_of_agreement("Simulation and recordings agree.", 0, 6)  # doctest: +NORMALIZE_WHITESPACE
    'Simulation and hammer tests agree. None of 6 passages could be compared with its simulation, so this answer
    does not hold for trains and running surface: see the notes.'
    >>> scope_of_agreement("Simulation and recordings agree.", 5, 6)
    'Simulation and recordings agree. 1 of 6 passages could not be compared with its simulation: see the notes.'
    """
    n_left_out = n_recorded - n_compared
    if n_left_out <= 0:
        return sentence
    if n_compared:
        simulations = "its simulation" if n_left_out == 1 else "their simulations"
        left_out = f"{n_left_out} of {n_recorded} passages"
        return f"{sentence} {left_out} could not be compared with {simulations}: see the notes."
    passages = "The passage" if n_recorded == 1 else f"None of {n_recorded} passages"
    verb = "could not be" if n_recorded == 1 else "could be"
    sentence = sentence.replace("Simulation and recordings agree", "Simulation and hammer tests agree")
    return (
        f"{sentence} {passages} {verb} compared with its simulation, so this answer does not hold for trains and "
        "running surface: see the notes."
    )


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
