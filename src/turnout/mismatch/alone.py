"""Whether a name hangs on one recording alone, though others should show it as plainly, or on the blows at one spot."""

import numpy as np

from turnout.mismatch.apart import changed

AS_PLAIN, WITNESSES = 0.5, 2  # of the energy that the effect has in the recording that speaks for it; so many others
HIDDEN = 0.01  # of the energy that an effect has where it shows most: there it does not show, a tenth in amplitude
TOLD = 0.5  # of the evidence; where conditions left out tell less, the rest is what nuisances pay for the effect
SPOTS = 3  # at which the hammer fell; of fewer none can be called the odd one
SPOKEN = (1.0, 0.5)  # of the threshold: what the blows at the odd spot say, and all else together does not


def hangs_on(case, fit, candidate, gain, by_condition, settings):
    """The condition whose gain alone passes for a name where all others' together does not, "" elsewhere.

    What is there shows wherever it acts: a gain of one recording that others, which show the effect at least half as
    plainly, do not share is that recording's. It takes two such others, since nuisances may take one's share; and
    trains are not asked, which come at another speed and with another roughness each time. Blows at one spot are one
    witness however often they are repeated: they share the spot's fittings, the twist of the rail and the mark on it.
    What nuisances pay in their priors to stand for an effect no condition left out can show, since the others still
    bend them: where that is most of the ``gain``, and all else speaks for the name, it hangs on no spot.

    Parameters
    ----------
    case, fit : Case, Fit
        The fit has ``candidate`` in it.
    candidate : Candidate
    gain : float
        Of all conditions together. [nats]
    by_condition : dict
        Condition -> gain when it is left out. [nats]
    settings : MismatchSettings
    """
    if spot := _one_spot(case.struck(), gain, by_condition, settings.threshold):
        return spot
    top = max(by_condition, key=by_condition.get, default="")
    if not top or by_condition[top] <= settings.threshold or "train" in candidate.where:
        return ""
    others = sum(by_condition.values()) - by_condition[top]
    if others >= settings.threshold:
        return ""
    shown = plainness(case, fit, candidate)
    least = AS_PLAIN * shown.pop(top, np.inf)
    return top if sum(energy >= least for energy in shown.values()) >= WITNESSES else ""


def _one_spot(struck, gain, by_condition, threshold):
    """The spot whose blows pass for a name, or half of one, where all else together does not, in words, "" without."""
    gains = {}
    for condition, told in by_condition.items():
        if condition in struck:
            gains[struck[condition]] = gains.get(struck[condition], 0.0) + told
    if len(gains) < SPOTS:
        return ""
    top = max(gains, key=gains.get)
    others = sum(by_condition.values()) - gains[top]
    if others > 0.0 and gains[top] + others < TOLD * gain:
        return ""
    return f"all blows at {top:g} m" if any(gains[top] > s * threshold > others for s in SPOKEN) else ""


def plainness(case, fit, candidate):
    """Condition -> weighted energy of what ``candidate`` changes in it at the nuisances of ``fit``; {} where the
    simulation cannot go without it."""
    found = {}
    for o, change in zip(case.observations, changed(case, fit, candidate)):
        energy = o.effective * float(np.sum(change**2))
        found[o.condition] = found.get(o.condition, 0.0) + energy
    return found


def told_apart(case, fit, by_condition):
    """Gain of the conditions in which none of the effects of ``fit`` shows, 0 where it has none. [nats]"""
    quiet = dict(by_condition) if fit.candidates else {}
    for candidate in fit.candidates:
        shown = plainness(case, fit, candidate)
        most = max(shown.values(), default=np.inf)
        quiet = {c: gain for c, gain in quiet.items() if shown.get(c, most) < HIDDEN * most}
    return float(sum(quiet.values()))
