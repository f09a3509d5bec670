"""Recursive estimate of the parameters of one turnout from all of its visits, in the order of time.

The estimate is computed from the information that is stored per visit. It therefore does not depend on the order in
which recordings arrived, and a withdrawn visit leaves no trace.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from turnout.mismatch.calibrated.belief import Belief, Innovation, StateParameter
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.information import VisitInformation, repeated_error_weights, with_visit_deviations

BEFORE_ALL = -np.inf  # time of an event before all visits


@dataclass(frozen=True)
class Event:
    """Maintenance or a change of the measurement at ``time`` [years], which makes these parameters uncertain again.

    ``opened``: parameter -> standard deviation of the change. Tamping opens the ballast of its stretch, for example.
    ``direction``: parameter -> change per unit of one common size, whose standard deviation is ``sd``. An event at
    ``BEFORE_ALL`` makes the file itself uncertain.
    """

    time: float
    opened: Mapping[str, float]
    direction: Mapping[str, float] = field(default_factory=dict)
    sd: float = 0.0


@dataclass(frozen=True)
class Step:
    """One visit in the history: information (``matrix``, ``vector``), belief before and after, and its test.

    ``is_used`` is False if the innovation was too large; the belief after the visit is then that before it.
    """

    visit: str
    time: float
    matrix: np.ndarray
    vector: np.ndarray
    predicted: Belief
    belief: Belief
    innovation: Innovation
    is_used: bool
    n_recordings: int


@dataclass(frozen=True)
class History:
    """The ``steps`` of all visits in the order of time, the ``parameters``, and the belief ``prior`` to all visits."""

    parameters: tuple[StateParameter, ...]
    steps: tuple[Step, ...]
    prior: Belief

    @property
    def belief(self) -> Belief:
        """Belief after the last visit; that of the file without any."""
        return self.steps[-1].belief if self.steps else self.prior

    @property
    def gained(self) -> np.ndarray:
        """(n, n) covariance that values have gained since the first visit, by their random walk and recorded work."""
        noise = np.zeros_like(self.prior.covariance)
        for before, step in pairwise(self.steps):
            noise = noise + step.predicted.covariance - before.belief.covariance
        return noise

    @property
    def used_steps(self) -> tuple[Step, ...]:
        """Steps of the visits that were used."""
        return tuple(s for s in self.steps if s.is_used)


def estimate_history(
    parameters: Sequence[StateParameter],
    visits: Iterable[VisitInformation],
    events: Sequence[Event] = (),
    repeated_share: float = CALIBRATION.repeated_error_share,
    repeats_between_visits: bool = True,
    accepted: Collection[str] | None = (),
    levels: Mapping[str, float] | None = None,
    constant_errors: bool = False,
) -> History:
    """Belief after each visit, from the belief of the file.

    Parameters
    ----------
    parameters : sequence of StateParameter
        All parameters that the visits inform on, and others.
    visits : iterable of VisitInformation
        In any order.
    events : sequence of Event
        In any order.
    repeated_share : float
        Share of the error variance that repeats in the recordings of a group, see ``repeated_error_weights``.
    repeats_between_visits : bool
        Whether the error of a group is the same in all visits. It then limits what all visits together say of the
        values, as is right for a comparison with the file. False: it counts within each visit alone. That is right
        for changes, in which a constant error cancels.
    accepted : collection of str or None
        Visits that are used whatever their innovation. None: all.
    levels : mapping or None
        Group -> variance of what its errors do not repeat from visit to visit, over the variance of its errors, as
        ``error_levels``. None: 1. For changes alone.
    constant_errors : bool
        Whether the values before all visits have the error of the model that all visits share, see
        ``Belief.with_constant_error``. Then the first visit tells it, and it cancels in a change. Otherwise each visit
        has it again in all directions of which it knows less than the file. For changes alone.

    Returns
    -------
    History

    Raises
    ------
    ValueError
        If two visits have the same name, or a visit or an event has a parameter that is not among ``parameters``.
    """
    ordered = _in_order(visits)
    weights, tested = None, {}
    if repeats_between_visits:  # whether a visit is used depends on what has changed, not on the error of the model
        alone = estimate_history(parameters, ordered, events, repeated_share, False, accepted)
        tested = {s.visit: s for s in alone.steps}
        weights = repeated_error_weights([v for v in ordered if tested[v.visit].is_used], repeated_share)
    names = tuple(p.name for p in parameters)
    noise, steps = _ProcessNoise(parameters, events), list[Step]()
    prior = Belief.of_file(parameters).with_noise(noise.before_all())
    if constant_errors and ordered:
        of_first = ordered[0].total(names, repeated_error_weights(ordered[:1], repeated_share))
        prior = prior.with_constant_error(with_visit_deviations(*of_first, _own_sds(ordered[0], parameters))[0])
    belief, time = prior, ordered[0].time if ordered else 0.0
    for visit in ordered:
        predicted = belief.with_noise(noise.covariance(time, visit.time)) if steps else belief
        own_weights = repeated_error_weights([visit], repeated_share)
        repeated = {g.group: own_weights[g.group] / (levels or {}).get(g.group, 1.0) for g in visit.groups}
        total = visit.total(names, {**repeated, **(weights or {})})
        matrix, vector = with_visit_deviations(*total, _own_sds(visit, parameters))
        test = tested.get(visit.visit)
        innovation = test.innovation if test else predicted.innovation(matrix, vector)
        is_used = test.is_used if test else accepted is None or visit.visit in accepted or innovation.is_expected
        belief, time = predicted.update(matrix, vector) if is_used else predicted, visit.time
        n = visit.n_recordings
        steps.append(Step(visit.visit, time, matrix, vector, predicted, belief, innovation, is_used, n))
    return History(tuple(parameters), tuple(steps), prior)


def _own_sds(visit: VisitInformation, parameters: Sequence[StateParameter]) -> np.ndarray:
    """(n_parameter,) standard deviations of what a visit adds of its own."""
    return np.array([visit.own_sds.get(p.name, p.visit_sd) for p in parameters])


def _in_order(visits: Iterable[VisitInformation]) -> list[VisitInformation]:
    ordered = sorted(visits, key=lambda v: (v.time, v.visit))
    names = [v.visit for v in ordered]
    if len(set(names)) < len(names):
        raise ValueError(f"visit {next(n for n in names if names.count(n) > 1)} is given twice")
    return ordered


class _ProcessNoise:
    """Covariance that the parameters gain from one time to another: its random walk and the events between them."""

    def __init__(self, parameters: Sequence[StateParameter], events: Sequence[Event]):
        self.rate = np.array([p.walk_sd**2 for p in parameters])
        number = {p.name: k for k, p in enumerate(parameters)}
        self.events = []
        for event in sorted(events, key=lambda e: e.time):
            if unknown := [name for name in (*event.opened, *event.direction) if name not in number]:
                raise ValueError(f"event at {event.time:g} years: {unknown[0]!r} is no parameter of this model")
            variance, direction = np.zeros((2, len(parameters)))
            for name, sd in event.opened.items():
                variance[number[name]] = sd**2
            for name, change in event.direction.items():
                direction[number[name]] = event.sd * change
            self.events.append((event.time, np.diag(variance) + np.outer(direction, direction)))

    def before_all(self) -> np.ndarray:
        """(n, n) covariance that the file has beside the standard deviations of its parameters."""
        return sum((c for time, c in self.events if time == BEFORE_ALL), np.zeros((self.rate.size,) * 2))

    def covariance(self, start: float, end: float) -> np.ndarray:
        """(n, n) covariance gained after ``start`` up to ``end`` [years]."""
        gained = np.diag((end - start) * self.rate)
        for time, covariance in self.events:
            if start < time <= end:
                gained = gained + covariance
        return gained
