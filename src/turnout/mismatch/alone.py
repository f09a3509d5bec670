"""Whether a name hangs on one recording alone, though others should show the same as plainly."""

import numpy as np

from turnout.errors import SimulationError

CONFIRMED = 0.5  # of what the others should gain by their share of the energy of the effect


def hangs_on(case, fit, candidate, by_condition, settings):
    r"""The condition whose gain alone passes for a name where all others' together does not, "" elsewhere.

    What is there shows wherever it acts, as plainly as its energy E there: all others together should gain
    :math:`g E_{others} / E`. A gain of one hammer test that its repetition does not share is that test's. Nobody is
    refused where the others' should be less than the margin, since they could not confirm it, nor for a train, which
    comes at another speed and with another roughness each time.

    Parameters
    ----------
    case, fit : Case, Fit
        The fit has ``candidate`` in it.
    candidate : Candidate
    by_condition : dict
        Condition -> gain when it is left out. [nats]
    settings : MismatchSettings
    """
    top = max(by_condition, key=by_condition.get, default="")
    if not top or by_condition[top] <= settings.threshold or "train" in candidate.where:
        return ""
    others = sum(by_condition.values()) - by_condition[top]
    if others >= settings.threshold:
        return ""
    shown = plainness(case, fit, candidate)
    mine = shown.pop(top, np.inf)
    due = by_condition[top] * sum(shown.values()) / mine if mine > 0.0 else 0.0
    return top if due > settings.margin and others < CONFIRMED * due else ""


def plainness(case, fit, candidate):
    """Condition -> weighted energy of what ``candidate`` changes in it at the nuisances of ``fit``; {} where the
    simulation cannot go without it."""
    others = tuple(t for c, t in zip(fit.candidates, fit.terms) if c.key != candidate.key)
    try:
        without = case.predict(fit.values, others, case.observations)
    except SimulationError:
        return {}
    found = {}
    for o, p, q in zip(case.observations, fit.predictions, without):
        energy = o.effective * float(np.sum(o.whitened(p - q) ** 2))
        found[o.condition] = found.get(o.condition, 0.0) + energy
    return found
