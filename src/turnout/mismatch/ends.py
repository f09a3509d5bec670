"""Fits continued to where nothing is gained any more, and kept by their key."""

from turnout.errors import SimulationError
from turnout.mismatch.joint import FINE, STALL, fit_jointly

ROUNDS = 3  # of steps for a leader; one that still gains afterwards is far from any law


def ended(case, fit, settings):
    """Continued until a round of steps gains less than a name needs; each begins with new derivatives."""
    for _ in range(ROUNDS):
        try:
            before, fit = fit, to_the_end(case, fit, settings, FINE)
        except SimulationError:
            break
        if fit.evidence - before.evidence < settings.threshold:
            break
    return fit


def to_the_end(case, fit, settings, stall=STALL):
    """The fit continued from where it is, with derivatives of its own."""
    return fit_jointly(case, fit.candidates, fit.psi, fit.values, iterations=settings.iterations, stall=stall)


def with_derivatives(case, fit, settings):
    """The fit, continued if it has no derivatives; as it is where the simulation fails beside it."""
    try:
        return fit if fit.jacobian else to_the_end(case, fit, settings)
    except SimulationError:
        return fit


def kept(store, key, compute, candidates=()):
    """A fit by its key, computed where the store lacks it; stores hold fits without their candidates' functions."""
    if key not in store:
        fit = compute()
        store[key] = fit.with_candidates(()) if fit is not None else None
    fit = store[key]
    return None if fit is None else fit.with_candidates(candidates)
