"""A diagnosis case that simulates accepted effects, reports its progress and stops when its time is spent."""

import time
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass

import numpy as np

from turnout.errors import SimulationError, TurnoutError
from turnout.mismatch.engine.case import Nuisance
from turnout.mismatch.engine.map_fit import MAX_CHEAP_STEPS, fit_jointly

PRIOR_SD_SHARE = 0.5  # prior sd of an accepted value, as a share of its distance from neutral: it may grow
MAX_NEUTRAL_RATIO = 100.0  # a neutral value above this multiple of the accepted one means "no limit"
MIN_PRIOR_ERRORS = 3.0  # least prior sd, in standard errors of the accepted value
DERIVATIVE_STEP = 0.02  # step of a difference quotient, as a share of the prior sd


class BudgetSpentError(TurnoutError):
    """The time of a diagnosis is spent; ``rows`` are those of the ``n_done`` finished groups, by table."""

    def __init__(self, n_done=0, n_groups=1, rows=None):
        super().__init__(
            f"the time given is up, {n_done} of {n_groups} groups done; the same command goes on from there."
        )
        self.n_done, self.rows = n_done, rows or {}


@dataclass
class Watch:
    """Time limit and progress: ``deadline`` on the monotonic clock [s] or None, ``count`` of predictions so far.

    ``tell`` is called with that count.
    """

    deadline: float | None = None
    tell: Callable[[int], object] | None = None
    count: int = 0

    def tick(self):
        """Count one prediction; BudgetSpentError after the deadline.

        The first prediction never raises, so every run makes progress.
        """
        self.count += 1
        if self.tell is not None:
            self.tell(self.count)
        if self.deadline is not None and self.count > 1 and time.monotonic() > self.deadline:
            raise BudgetSpentError


class AcceptedEffectsCase:
    """``case`` with ``accepted`` effects in its simulation; their parameters are nuisance parameters.

    An accepted effect is not reported again. Its parameters are estimated at every visit. Their prior is centred on
    the accepted values and wide enough for growth. ``replay``, a mapping or None, stores every prediction: an
    interrupted diagnosis repeats the same requests and continues within a fit.
    """

    def __init__(self, case, accepted=(), watch=None, replay=None, track=None):
        self.case, self.watch, self.replay = case, watch or Watch(), replay
        self.base_track = (track or case.track()) if accepted else None
        self.accepted = tuple(a for a in accepted if a.term(self.base_track) is not None and a.values)
        self.own_nuisances = tuple(n for a in self.accepted for n in _nuisances(a))
        self.nuisances = (*case.nuisances, *self.own_nuisances)
        self.candidates = self._without_accepted(case.candidates)
        self.start_values = self._initial_values() if self.own_nuisances else case.start_values

    def _initial_values(self):
        """Start values of fits that include the accepted effects, from a fit of the hammer tests.

        The case's own start values would explain the accepted effects by its supports.
        """
        cheap = self.cheap_case()
        if cheap is None:
            return self.case.start_values
        means = {n.name: n.mean for n in cheap.nuisances}
        rough_fit = fit_jointly(cheap.with_broad_errors(), values=means, iterations=MAX_CHEAP_STEPS)
        values = fit_jointly(cheap, values=rough_fit.values, iterations=MAX_CHEAP_STEPS).values
        self.case.recentre(values)
        return {**self.case.start_values, **values}

    def __getattr__(self, name):
        if "case" not in self.__dict__:  # while it is being copied
            raise AttributeError(name)
        return getattr(self.case, name)

    def _without_accepted(self, candidates):
        """Candidates that are not accepted already."""
        return tuple(c for c in candidates if not any(a.is_of(c.family, c.where) for a in self.accepted))

    def _wrap(self, case):
        """``case``, a cheap version of this one, with the same accepted effects and without a deadline."""
        watch = Watch(None, self.watch.tell)
        return None if case is None else AcceptedEffectsCase(case, self.accepted, watch, None, self.base_track)

    def accepted_terms(self, values):
        """Terms of the accepted effects at these values of their nuisance parameters."""
        terms = []
        for a in self.accepted:
            chosen = {p.name: float(values[_name(a, p)]) for p in a.parameters}
            terms.append(a.term(self.base_track, chosen))
        return tuple(terms)

    def predict(self, values, terms, observations):
        """Predictions that include the accepted effects."""
        all_terms = (*self.accepted_terms(values), *terms)
        return self._compute_once("p", values, all_terms, observations, self.case.predict)

    def predict_near(self, values, terms, new, observations, predictions):
        """Predictions a small step away that include the accepted effects."""
        accepted_terms = self.accepted_terms(values)

        def predict_moved(values, terms, observations):
            return self.case.predict_near(
                values, (*accepted_terms, *terms), (*accepted_terms, *new), observations, predictions
            )

        return self._compute_once(f"m:{new!r}", values, terms, observations, predict_moved)

    def nuisance_jacobian(self, values, terms, observations, base):
        """Columns of the case, and a difference quotient for each accepted parameter."""
        all_terms = (*self.accepted_terms(values), *terms)

        def differentiate(*arguments):
            return self.case.nuisance_jacobian(*arguments, base)

        inner = self._compute_once("j", values, all_terms, observations, differentiate)
        columns = [self._difference_column(values, terms, observations, base, n) for n in self.own_nuisances]
        if not columns:
            return inner
        return [np.column_stack([j, *(c[k] for c in columns)]) for k, j in enumerate(inner)]

    def _compute_once(self, quantity, values, terms, observations, compute):
        """Result from the replay, computed if it is not there."""
        if self.replay is None:
            self.watch.tick()
            return compute(values, terms, observations)
        key = f"{quantity}:{sorted(values.items())!r}:{terms!r}:{[o.name for o in observations]!r}"
        try:
            return self.replay[key]
        except KeyError:
            self.watch.tick()
        self.replay[key] = result = compute(values, terms, observations)
        return result

    def _difference_column(self, values, terms, observations, base, nuisance):
        step = DERIVATIVE_STEP * nuisance.sd
        if values[nuisance.name] + step > nuisance.bounds[1]:
            step = -step
        try:
            shifted = self.predict({**values, nuisance.name: values[nuisance.name] + step}, terms, observations)
        except SimulationError:  # step to the other side
            step = -step
            shifted = self.predict({**values, nuisance.name: values[nuisance.name] + step}, terms, observations)
        return [(new - old) / step for new, old in zip(shifted, base)]

    def own_jacobian(self, values, terms, observation, predicted, names):
        """Derivatives of an observation by its own nuisance parameters, with the accepted effects."""
        return self.case.own_jacobian(values, (*self.accepted_terms(values), *terms), observation, predicted, names)

    def cheap_case(self):
        """The case's cheap part, with the accepted effects."""
        return self._wrap(self.case.cheap_case())

    def with_broad_errors(self):
        """The case with broad errors, with the accepted effects."""
        return self._wrap(self.case.with_broad_errors())

    def with_updated_errors(self, fit):
        """The case with the errors of its observations updated from ``fit``."""
        inner = self.case.with_updated_errors(self._inner_fit(fit))
        if inner is self.case:
            return self
        updated = copy(self)
        updated.case = inner
        return updated

    def residual_candidates(self, fit):
        """Further candidates suggested by the residual, without the accepted effects."""
        return self._without_accepted(self.case.residual_candidates(self._inner_fit(fit)))

    def screen(self, fit):
        """Linear columns of the candidates, with the accepted effects in the fit."""
        return self.case.screen(self._inner_fit(fit))

    def residual_spaces(self, fit):
        """Spaces that the residual may be locked to, with the accepted effects in the fit."""
        return self.case.residual_spaces(self._inner_fit(fit))

    def latent_covariates(self, fit):
        """Latent force that remains missing beside the accepted effects."""
        return self.case.latent_covariates(self._inner_fit(fit))

    def numerical_error(self, fit):
        """Numerical error of the simulation with the accepted effects."""
        return self.case.numerical_error(self._inner_fit(fit))

    def _inner_fit(self, fit):
        return (
            _FitWithAccepted(fit, self.accepted_terms(fit.values), len(self.case.nuisances), len(self.own_nuisances))
            if self.accepted
            else fit
        )


class _FitWithAccepted:
    """A fit as the inner case needs it: its terms begin with the accepted ones.

    Its Jacobian has the ``n`` nuisance parameters of the case, without the ``n_own`` of the accepted effects that
    follow them.
    """

    def __init__(self, fit, accepted_terms, n, n_own):
        self._fit, self.terms = fit, (*accepted_terms, *fit.terms)
        self.jacobian = [np.delete(j, slice(n, n + n_own), axis=1) for j in fit.jacobian]

    def __getattr__(self, name):
        if "_fit" not in self.__dict__:
            raise AttributeError(name)
        return getattr(self._fit, name)


def _name(accepted, parameter):
    return f"{accepted.key}.{parameter.name}"


def _nuisances(accepted):
    for p in accepted.parameters:
        value, error = accepted.values[p.name]
        sd = max(_prior_sd(p, value), MIN_PRIOR_ERRORS * (error or 0.0))
        yield Nuisance(_name(accepted, p), p.unit, value, sd, bounds=p.bounds, meaning=p.meaning)


def _prior_sd(p, value):
    """Prior sd of an accepted value: a share of its distance from neutral, or of itself if neutral means no limit."""
    if abs(p.neutral) > MAX_NEUTRAL_RATIO * abs(value):
        return PRIOR_SD_SHARE * abs(value)
    return max(PRIOR_SD_SHARE * abs(value - p.neutral), 1e-3 * (p.bounds[1] - p.bounds[0]))


def accepted_estimates(case, fit) -> list[dict]:
    """Estimates of the accepted effects in a fit: dicts with accepted, name, value, se and unit."""
    estimates: list[dict] = []
    if not getattr(case, "accepted", ()):
        return estimates
    index = {n.name: k for k, n in enumerate(case.nuisances)}
    for a in case.accepted:
        for p in a.parameters:
            name = _name(a, p)
            se = float(np.sqrt(max(fit.covariance[index[name], index[name]], 0.0)))
            estimates.append({"accepted": a, "name": p.name, "value": fit.values[name], "se": se, "unit": p.unit})
    return estimates
