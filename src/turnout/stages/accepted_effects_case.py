"""A diagnosis case that simulates accepted effects, reports its progress and stops when its time is spent."""

import time
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass

import numpy as np

from turnout.errors import SimulationError, TurnoutError
from turnout.mismatch.engine.case import Nuisance
from turnout.mismatch.engine.map_fit import CHEAP_STEPS, fit_jointly

WIDE = 0.5  # prior sd of an accepted value, as a share of its distance from neutral: it may grow
NO_LIMIT = 100.0  # a neutral value above this multiple of the accepted one means "no limit"
LEAST_ERRORS = 3.0  # least prior sd, in standard errors of the accepted value
STEP = 0.02  # step of a difference quotient, as a share of the prior sd


class BudgetSpentError(TurnoutError):
    """The time of a diagnosis is spent; ``rows`` are those of the ``n_done`` finished groups, by table."""

    def __init__(self, done=0, count=1, rows=None):
        super().__init__(f"the time given is up, {done} of {count} groups done; the same command goes on from there.")
        self.done, self.rows = done, rows or {}


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


class GuidedCase:
    """``case`` with ``accepted`` effects in its simulation; their parameters are nuisance parameters.

    An accepted effect is not reported again. Its parameters are estimated at every visit. Their prior is centred on
    the accepted values and wide enough for growth. ``replay``, a mapping or None, stores every prediction: an
    interrupted diagnosis repeats the same requests and continues within a fit.
    """

    def __init__(self, case, accepted=(), watch=None, replay=None, track=None):
        self.case, self.watch, self.replay = case, watch or Watch(), replay
        self.base_track = (track or case.track()) if accepted else None
        self.accepted = tuple(a for a in accepted if a.term(self.base_track) is not None and a.values)
        self.own = tuple(n for a in self.accepted for n in _nuisances(a))
        self.nuisances = (*case.nuisances, *self.own)
        self.candidates = self._new(case.candidates)
        self.start_values = self._started() if self.own else case.start_values

    def _started(self):
        """Start values of fits that include the accepted effects, from a fit of the hammer tests.

    The case's own start values would explain the accepted effects by its supports.
    """
        cheap = self.cheap_part()
        if cheap is None:
            return self.case.start_values
        means = {n.name: n.mean for n in cheap.nuisances}
        roughly = fit_jointly(cheap.roughened(), values=means, iterations=CHEAP_STEPS)
        told = fit_jointly(cheap, values=roughly.values, iterations=CHEAP_STEPS).values
        self.case.recentre(told)
        return {**self.case.start_values, **told}

    def __getattr__(self, name):
        if "case" not in self.__dict__:  # while it is being copied
            raise AttributeError(name)
        return getattr(self.case, name)

    def _new(self, candidates):
        """Candidates that are not accepted already."""
        return tuple(c for c in candidates if not any(a.is_of(c.family, c.where) for a in self.accepted))

    def _around(self, case):
        """``case``, a cheap version of this one, with the same accepted effects and without a deadline."""
        watch = Watch(None, self.watch.tell)
        return None if case is None else GuidedCase(case, self.accepted, watch, None, self.base_track)

    def standing(self, values):
        """Terms of the accepted effects at these values of their nuisance parameters."""
        made = []
        for a in self.accepted:
            chosen = {p.name: float(values[_name(a, p)]) for p in a.parameters}
            made.append(a.term(self.base_track, chosen))
        return tuple(made)

    def predict(self, values, terms, observations):
        """Predictions that include the accepted effects."""
        all_terms = (*self.standing(values), *terms)
        return self._once("p", values, all_terms, observations, self.case.predict)

    def moved(self, values, terms, new, observations, predictions):
        """Predictions a small step away that include the accepted effects."""
        standing = self.standing(values)

        def beside(values, terms, observations):
            return self.case.moved(values, (*standing, *terms), (*standing, *new), observations, predictions)

        return self._once(f"m:{new!r}", values, terms, observations, beside)

    def nuisance_jacobian(self, values, terms, observations, base):
        """Columns of the case, and a difference quotient for each accepted parameter."""
        all_terms = (*self.standing(values), *terms)

        def differentiate(*arguments):
            return self.case.nuisance_jacobian(*arguments, base)

        inner = self._once("j", values, all_terms, observations, differentiate)
        columns = [self._column(values, terms, observations, base, n) for n in self.own]
        if not columns:
            return inner
        return [np.column_stack([j, *(c[k] for c in columns)]) for k, j in enumerate(inner)]

    def _once(self, kind, values, terms, observations, compute):
        """Result from the replay, computed if it is not there."""
        if self.replay is None:
            self.watch.tick()
            return compute(values, terms, observations)
        key = f"{kind}:{sorted(values.items())!r}:{terms!r}:{[o.name for o in observations]!r}"
        try:
            return self.replay[key]
        except KeyError:
            self.watch.tick()
        self.replay[key] = found = compute(values, terms, observations)
        return found

    def _column(self, values, terms, observations, base, nuisance):
        step = STEP * nuisance.sd
        if values[nuisance.name] + step > nuisance.bounds[1]:
            step = -step
        try:
            moved = self.predict({**values, nuisance.name: values[nuisance.name] + step}, terms, observations)
        except SimulationError:  # step to the other side
            step = -step
            moved = self.predict({**values, nuisance.name: values[nuisance.name] + step}, terms, observations)
        return [(new - old) / step for new, old in zip(moved, base)]

    def own_jacobian(self, values, terms, observation, predicted, names):
        """Derivatives of an observation by its own nuisance parameters, with the accepted effects."""
        return self.case.own_jacobian(values, (*self.standing(values), *terms), observation, predicted, names)

    def cheap_part(self):
        """The case's cheap part, with the accepted effects."""
        return self._around(self.case.cheap_part())

    def roughened(self):
        """The case with broad errors, with the accepted effects."""
        return self._around(self.case.roughened())

    def renewed(self, fit):
        """The case with the errors of its observations updated from ``fit``."""
        inner = self.case.renewed(self._seen(fit))
        if inner is self.case:
            return self
        found = copy(self)
        found.case = inner
        return found

    def further(self, fit):
        """Further candidates suggested by the residual, without the accepted effects."""
        return self._new(self.case.further(self._seen(fit)))

    def screen(self, fit):
        """Linear columns of the candidates, with the accepted effects in the fit."""
        return self.case.screen(self._seen(fit))

    def spaces(self, fit):
        """Spaces that the residual may be locked to, with the accepted effects in the fit."""
        return self.case.spaces(self._seen(fit))

    def latent(self, fit):
        """Latent force that remains missing beside the accepted effects."""
        return self.case.latent(self._seen(fit))

    def numerical_error(self, fit):
        """Numerical error of the simulation with the accepted effects."""
        return self.case.numerical_error(self._seen(fit))

    def _seen(self, fit):
        return _Seen(fit, self.standing(fit.values), len(self.case.nuisances), len(self.own)) if self.accepted else fit


class _Seen:
    """A fit as the inner case needs it: its terms begin with the accepted ones.

    Its Jacobian has the ``n`` nuisance parameters of the case, without the ``n_own`` of the accepted effects that
    follow them.
    """

    def __init__(self, fit, standing, n, own):
        self._fit, self.terms = fit, (*standing, *fit.terms)
        self.jacobian = [np.delete(j, slice(n, n + own), axis=1) for j in fit.jacobian]

    def __getattr__(self, name):
        if "_fit" not in self.__dict__:
            raise AttributeError(name)
        return getattr(self._fit, name)


def _name(accepted, parameter):
    return f"{accepted.key}.{parameter.name}"


def _nuisances(accepted):
    for p in accepted.parameters:
        value, error = accepted.values[p.name]
        sd = max(_reach(p, value), LEAST_ERRORS * (error or 0.0))
        yield Nuisance(_name(accepted, p), p.unit, value, sd, bounds=p.bounds, meaning=p.meaning)


def _reach(p, value):
    """Prior sd of an accepted value: a share of its distance from neutral, or of itself if neutral means no limit."""
    if abs(p.neutral) > NO_LIMIT * abs(value):
        return WIDE * abs(value)
    return max(WIDE * abs(value - p.neutral), 1e-3 * (p.bounds[1] - p.bounds[0]))


def visit_of(case, fit) -> list[dict]:
    """Estimates of the accepted effects in a fit: dicts with accepted, name, value, se and unit."""
    found: list[dict] = []
    if not getattr(case, "accepted", ()):
        return found
    index = {n.name: k for k, n in enumerate(case.nuisances)}
    for a in case.accepted:
        for p in a.parameters:
            name = _name(a, p)
            se = float(np.sqrt(max(fit.covariance[index[name], index[name]], 0.0)))
            found.append({"accepted": a, "name": p.name, "value": fit.values[name], "se": se, "unit": p.unit})
    return found
