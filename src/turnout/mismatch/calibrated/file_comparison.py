"""First question: what of the calibrated model differs from the file of the track? Runs of supports are one answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from turnout.mismatch.calibrated.belief import Belief, StateParameter
from turnout.mismatch.calibrated.change import ChangeEffect, direction_of, information_and_score
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.history import BEFORE_ALL, Event, History


@dataclass(frozen=True)
class Deviation:
    """A parameter, or adjacent ones of one group, whose values differ from the file.

    ``size`` is the mean difference over ``names`` and ``sd`` its standard deviation. ``ordinary_sd`` is the standard
    deviation of that difference where all components scatter as the file says. ``positions`` [m] are those of the
    first and last component, None without positions.
    """

    group: str
    names: tuple[str, ...]
    size: float
    sd: float
    ordinary_sd: float
    positions: tuple[float, float] | None
    unit: str

    @property
    def deviates(self) -> float:
        """Size in standard deviations of what is ordinary."""
        return self.size / self.ordinary_sd


def model_error_sds(parameters: Sequence[StateParameter]) -> np.ndarray:
    """Standard deviations of the error of the model in each value, ``CALIBRATION.model_errors``: independent ones.

    Parameters
    ----------
    parameters : sequence of StateParameter

    Returns
    -------
    (n_parameter,) array of float
        In the units of the parameters, 0 where no error is known.
    """
    errors = dict(CALIBRATION.model_errors)
    beyond = errors | dict(CALIBRATION.model_errors_beyond_sensors)
    return np.array([(beyond if p.is_beyond_sensors else errors).get(p.group, 0.0) for p in parameters])


def model_error(parameters: Sequence[StateParameter]) -> Event:
    """The error of the model before all visits: the values that fit best differ from those of the track.

    Parameters
    ----------
    parameters : sequence of StateParameter

    Returns
    -------
    Event
    """
    sds = model_error_sds(parameters)
    return Event(BEFORE_ALL, {p.name: float(sd) for p, sd in zip(parameters, sds) if sd > 0.0})


def track_sds(belief: Belief, parameters: Sequence[StateParameter]) -> np.ndarray:
    """Standard deviations of the values of the track, of which the belief has those that the model needs.

    Parameters
    ----------
    belief : Belief
        From a history with ``model_error``.
    parameters : sequence of StateParameter
        Those of the belief, in its order.

    Returns
    -------
    (n_parameter,) array of float
        With the error of the model, and at most those of the file where there was no event.
    """
    file_sds, errors = np.array([p.sd for p in parameters]), model_error_sds(parameters)
    largest = np.maximum(file_sds, np.sqrt(np.maximum(belief.sd**2 - errors**2, 0.0)))  # events open more than the file
    return np.minimum(np.hypot(belief.sd, errors), largest)


def deviations_from_file(
    history: History,
    parameters: Sequence[StateParameter],
    least_sizes: Mapping[str, float],
    sds: float = CALIBRATION.finding_sds,
    intolerable: Mapping[str, float] | None = None,
) -> list[Deviation]:
    r"""Deviations from the file, the clearest first. Adjacent components of a group are one deviation.

    The belief is in values as the model needs them: those of the track and an error of the model with the covariance E,
    see ``model_error``. With the difference :math:`d = m - m_0` of the belief from the file, the mean over a run of
    components is tested three times. It must be as large as the least size of the group. It must be ``sds`` times its
    standard deviation, with the covariance :math:`P + E`. And it must be larger than intact components leave: there
    :math:`d` has the covariance :math:`P_0 + E + Q - P`, with the two-sided chance of ``sds`` standard deviations over
    all runs of the group. Q is what values have gained since the first visit, as tamping moves each support.

    Parameters
    ----------
    history : History
        Of all visits.
    parameters : sequence of StateParameter
        Those of the history, in its order.
    least_sizes : mapping
        Group -> least size that causes any action, in the unit of the group. Other groups are not compared.
    sds : float
        Standard deviations beyond which a difference is stated.
    intolerable : mapping or None
        Group -> size from which a difference is stated although the file allows for it. It must exceed this by ``sds``
        standard deviations. None: no group.

    Returns
    -------
    list of Deviation
        No component is in two of them.
    """
    prior, error, belief = Belief.of_file(parameters), np.diag(model_error_sds(parameters) ** 2), history.belief
    ordinary = prior.covariance + error + history.gained - belief.covariance
    difference = belief.mean - prior.mean
    deviations: list[Deviation] = []
    for group, least_size in least_sizes.items():
        runs = _runs([k for k, p in enumerate(parameters) if p.group == group and p.may_change], parameters)
        means = np.zeros((len(runs), len(parameters)))  # each row takes the mean over a run
        for row, run in zip(means, runs):
            row[run] = 1.0 / len(run)
        limit = float(scipy.stats.norm.isf(scipy.stats.norm.sf(sds) / max(len(runs), 1)))
        size = means @ difference
        sd = _sds(means, belief.covariance + error)
        floor = np.sqrt(CALIBRATION.min_prior_share) * _sds(means, prior.covariance)
        ordinary_sd = np.maximum(_sds(means, ordinary), floor)
        beyond = (abs(size) > limit * ordinary_sd) | (abs(size) - sds * sd >= (intolerable or {}).get(group, np.inf))
        is_clear = (abs(size) >= least_size) & (abs(size) >= sds * sd) & beyond
        in_a_deviation: set[int] = set()
        for r in sorted(np.flatnonzero(is_clear), key=lambda r: -abs(size[r]) / ordinary_sd[r]):
            if in_a_deviation.isdisjoint(runs[r]):
                in_a_deviation.update(runs[r])
                members = [parameters[k] for k in runs[r]]
                deviations.append(_deviation(members, float(size[r]), float(sd[r]), float(ordinary_sd[r])))
    return sorted(deviations, key=lambda d: -abs(d.deviates))


def _runs(members: Sequence[int], parameters: Sequence[StateParameter]) -> list[list[int]]:
    """All runs of adjacent components: single ones, and those of a route whose indices follow each other."""
    runs = [[k] for k in members if parameters[k].index is None]
    by_route: dict[str, list[int]] = {}
    for k in sorted((k for k in members if parameters[k].index is not None), key=lambda k: parameters[k].index or 0):
        by_route.setdefault(parameters[k].route, []).append(k)
    for indexed in by_route.values():
        for first in range(len(indexed)):
            for last in range(first, len(indexed)):
                number, before = (parameters[indexed[j]].index or 0 for j in (last, max(last - 1, first)))
                if last > first and number != before + 1:
                    break
                runs.append(indexed[first : last + 1])
    return runs


def _sds(means: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """(n_run,) standard deviations of the means over runs."""
    return np.sqrt(np.maximum(np.sum((means @ covariance) * means, axis=1), 0.0))


def _deviation(run: Sequence[StateParameter], size: float, sd: float, ordinary_sd: float) -> Deviation:
    positions = [p.position for p in run if p.position is not None]
    ends = (min(positions), max(positions)) if positions else None
    return Deviation(run[0].group, tuple(p.name for p in run), size, sd, ordinary_sd, ends, run[0].unit)


def evidence_from_first(history: History, candidates: Sequence[ChangeEffect]) -> tuple[np.ndarray, ...]:
    """Evidence of effects that were there from the first visit, over the values of the file with their scatter.

    It is that of ``compare_onsets`` with the first visit as the onset, also of a single visit.

    Parameters
    ----------
    history : History
    candidates : sequence of ChangeEffect
        Whether they grow makes no difference.

    Returns
    -------
    gains, sizes, sds : (n_candidate,) array of float
    """
    directions = np.column_stack([direction_of(history, c) for c in candidates])
    information, score = information_and_score(history.steps, directions, [1.0] * len(history.steps))
    variance = np.array([c.sd**2 for c in candidates])
    sizes, sds = score / (information + 1.0 / variance), 1.0 / np.sqrt(information + 1.0 / variance)
    return 0.5 * score * sizes - 0.5 * np.log1p(variance * information), sizes, sds
