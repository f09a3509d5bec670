"""Visits that seem to differ from the earlier ones, linearized again where the earlier ones predict them to be.

A visit is stored as a linear model about its own maximum, and fits that end far apart look like a change. Such a visit
is fitted again from the values that earlier visits predict. If it then agrees with them, that fit counts.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from turnout.errors import SimulationError
from turnout.mismatch.calibrated import (
    Event,
    GroupInformation,
    StateParameter,
    VisitInformation,
    estimate_history,
)
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.turnout.calibration import visit_groups
from turnout.mismatch.turnout.relinearization import fit_given_belief
from turnout.stages.checkpoint import SUFFIX, read_value, write_value

if TYPE_CHECKING:
    from turnout.mismatch.calibrated.belief import Belief
    from turnout.mismatch.calibrated.history import Step
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.case import TrackCase


@dataclass(frozen=True)
class FittedGroup:
    """Fit of one group of sections at one visit, with all passages among the observations of its ``case``.

    ``parameters``: nuisance -> parameter. ``sections`` and ``route`` are those of ``visit_groups``.
    """

    case: TrackCase
    fit: Fit
    parameters: Mapping[str, StateParameter]
    sections: str
    route: str

    def without_jacobian(self) -> FittedGroup:
        """The same without the Jacobian of its fit, by far its largest item."""
        return replace(self, fit=self.fit.without_jacobian())


class KeyedFits(MutableMapping[str, Mapping[str, Any]]):
    """Results of new fits by ``key_of``, on disk, one file for each visit: that of another belief before is replaced.

    Parameters
    ----------
    folder : Path
    versions : mapping
        Visit -> versions of its code, track file and recordings. A file of another version counts as missing.
    """

    def __init__(self, folder: Path, versions: Mapping[str, Mapping[str, str]]) -> None:
        self.folder, self.versions = folder, versions

    def _visit_and_path(self, key: str) -> tuple[str, Path]:
        visit = key.rpartition("-")[0]
        return visit, self.folder / f"{visit}{SUFFIX}"

    def __getitem__(self, key: str) -> Mapping[str, Any]:
        visit, path = self._visit_and_path(key)
        value = read_value(path)
        if value["key"] != key or value["version"] != dict(self.versions[visit]):
            raise KeyError(key)
        new_fit: Mapping[str, Any] = value["fit"]
        return new_fit

    def __setitem__(self, key: str, fit: Mapping[str, Any]) -> None:
        visit, path = self._visit_and_path(key)
        self.folder.mkdir(parents=True, exist_ok=True)
        write_value(path, {"key": key, "version": dict(self.versions[visit]), "fit": dict(fit)})

    def __delitem__(self, key: str) -> None:
        self._visit_and_path(key)[1].unlink()

    def __iter__(self) -> Iterator[str]:
        return (read_value(path)["key"] for path in sorted(self.folder.glob(f"*{SUFFIX}")))

    def __len__(self) -> int:
        return sum(1 for _ in self)


def packed_groups(information: Iterable[GroupInformation]) -> list[dict[str, Any]]:
    """Information as values that ``write_value`` writes.

    Parameters
    ----------
    information : iterable of GroupInformation

    Returns
    -------
    list of dict
    """
    return [
        {"group": g.group, "n": g.n_recordings, "names": list(g.names), "matrix": g.matrix, "vector": g.vector}
        for g in information
    ]


def unpacked_groups(values: Iterable[Mapping[str, Any]]) -> tuple[GroupInformation, ...]:
    """What ``packed_groups`` has packed.

    Parameters
    ----------
    values : iterable of mapping

    Returns
    -------
    tuple of GroupInformation
    """
    return tuple(GroupInformation(g["group"], g["n"], tuple(g["names"]), g["matrix"], g["vector"]) for g in values)


def agreeing_visits(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    fitted_groups: Callable[[str], Sequence[FittedGroup]],
    store: MutableMapping[str, Mapping[str, Any]],
    threshold: float,
) -> list[VisitInformation]:
    """The visits, those that agree with earlier ones after a new linearization with that information.

    From the first visit that differs nevertheless, all are as they were: something has changed, and the most probable
    values of each visit count.

    Parameters
    ----------
    parameters : sequence of StateParameter
    visits : sequence of VisitInformation
    events : sequence of Event
    fitted_groups : callable
        Visit -> its fits.
    store : mutable mapping
        Key of a visit and the belief before it -> "groups": its information packed, [] where the visit differs.
    threshold : float
        Evidence that a name needs. A visit whose own linear model overstates its difference by less is left as it is:
        about its own maximum, a true change is described better. [nats]

    Returns
    -------
    list of VisitInformation
        In the order of time.
    """
    current = sorted(visits, key=lambda v: (v.time, v.visit))
    n_done = 1
    while True:
        steps = estimate_history(parameters, current, events, repeats_between_visits=False, accepted=None).steps
        k = next((k for k in range(n_done, len(steps)) if not steps[k].innovation.is_expected), None)
        if k is None:
            return current
        key = key_of(current[k], steps[k].predicted)
        if (new_fit := store.get(key)) is None:
            try:
                information = _information_given(
                    parameters, current[: k + 1], events, steps[k], fitted_groups, threshold
                )
            except (SimulationError, np.linalg.LinAlgError):
                information = ()
            store[key] = new_fit = {"groups": packed_groups(information)}
        if not new_fit["groups"]:
            return current
        current[k] = replace(current[k], groups=unpacked_groups(new_fit["groups"]))
        n_done = k + 1


def key_of(visit: VisitInformation, belief: Belief) -> str:
    """Key of a visit and the belief before it.

    Parameters
    ----------
    visit : VisitInformation
    belief : Belief

    Returns
    -------
    str
        Another one where any number of either differs.
    """
    content = hashlib.sha256(belief.mean.tobytes() + belief.covariance.tobytes())
    for group in sorted(visit.groups, key=lambda g: (g.group, g.vector.tobytes())):
        content.update(group.group.encode() + group.vector.tobytes() + group.matrix.tobytes())
    return f"{visit.visit}-{content.hexdigest()[:16]}"


def _information_given(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    step: Step,
    fitted_groups: Callable[[str], Sequence[FittedGroup]],
    threshold: float,
) -> tuple[GroupInformation, ...]:
    """Information of the last visit, linearized about its most probable values given those before; () if it differs."""
    excess, linear_excess, information = 0.0, 0.0, list[GroupInformation]()
    for group in fitted_groups(step.visit):
        given = fit_given_belief(group.case, group.fit, group.parameters, step.predicted)
        excess, linear_excess = excess + given.excess, linear_excess + given.linear_excess
        information += visit_groups(group.case, given.fit, group.sections, group.route)
    again = [*visits[:-1], replace(visits[-1], groups=tuple(information))]
    innovation = estimate_history(parameters, again, events, repeats_between_visits=False, accepted=None).steps[-1]
    chance = float(scipy.stats.chi2.sf(excess, max(innovation.innovation.n_directions, 1)))
    is_linear_enough = 0.5 * (linear_excess - excess) <= threshold
    agrees = innovation.innovation.is_expected and chance >= 0.5 * CALIBRATION.max_chance and not is_linear_enough
    return tuple(information) if agrees else ()
