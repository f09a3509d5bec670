"""Checks of what a case states and of what its simulator returns: a message here, not a wrong answer later.

A case may be a class of a user. Numbers that no fit can use would otherwise end in an error of the linear algebra,
or in an answer that looks like any other.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.errors import CaseError, SimulationError

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.observation import Observation


def check_case(case: Case) -> None:
    """Check the parts of a case against each other, before anything is simulated.

    Parameters
    ----------
    case : Case

    Raises
    ------
    CaseError
        If there is nothing to fit, a name stands for two things, a nuisance parameter belongs to no recording, or a
        candidate cannot be fitted.
    """
    if not case.observations:
        raise CaseError("the case has no observations: give it one recording or more")
    recordings = [o.name for o in (*case.observations, *case.reserved)]
    _check_distinct("recordings of the case", recordings)
    _check_distinct("nuisance parameters of the case", [n.name for n in case.nuisances])
    for n in case.nuisances:
        if n.owner is not None and n.owner not in recordings:
            raise CaseError(f"nuisance parameter {n.name!r}: its owner {n.owner!r} is none of the recordings")
    for observations, words in ((case.observations, "observations"), (case.reserved, "reserved recordings")):
        if observations and all(np.ptp(o.data) == 0.0 for o in observations):
            raise CaseError(f"all {words} of the case are constant: there is nothing to predict")
    for candidate in (*case.candidates, *case.free_laws):
        _check_candidate(candidate)


def checked_predictions(observations: Sequence[Observation], predictions: Any) -> list[np.ndarray]:
    """Predictions of a case, if they can be compared with the observations.

    Parameters
    ----------
    observations : sequence of Observation
    predictions : list of (n,) array of float
        As ``Case.predict`` returned them.

    Returns
    -------
    list of (n,) array of float
        The same list.

    Raises
    ------
    SimulationError
        If a prediction is not finite: the model cannot be simulated there.
    CaseError
        If there is not one real array for each observation, of the shape of its data.
    """
    if not isinstance(predictions, (list, tuple)) or len(predictions) != len(observations):
        count = len(predictions) if isinstance(predictions, (list, tuple)) else type(predictions).__name__
        raise CaseError(f"predict must return a list of {len(observations)} arrays, one per observation, not {count}")
    for o, p in zip(observations, predictions):
        if not isinstance(p, np.ndarray) or p.dtype.kind not in "fiu" or p.shape != o.data.shape:
            returned = f"{p.dtype} of shape {p.shape}" if isinstance(p, np.ndarray) else type(p).__name__
            expected = f"real numbers of shape {o.data.shape}"
            raise CaseError(f"the prediction of {o.name!r} must be {expected}, not {returned}")
        if not np.all(np.isfinite(p)):
            first = int(np.argmin(np.isfinite(p)))
            raise SimulationError(f"the prediction of {o.name!r} is {p[first]} at sample {first} of {p.size}")
    return list(predictions)


def _check_distinct(what: str, names: Iterable[str]) -> None:
    if repeated := [name for name, count in Counter(names).items() if count > 1]:
        raise CaseError(f"two {what} are called {repeated[0]!r}: give each its own name")


def _check_candidate(candidate: Candidate) -> None:
    for p in candidate.parameters:
        low, high = p.bounds
        if not low < high or not np.isfinite((low, high, p.neutral)).all():
            raise CaseError(
                f"candidate {candidate.key!r}: parameter {p.name!r} needs a finite neutral value {p.neutral} "
                f"and finite bounds with the lower one first, not {low} and {high}"
            )
    if not candidate.starts:
        raise CaseError(f"candidate {candidate.key!r} has no starts: no fit would try it")
    for start in candidate.starts:
        if np.shape(start) != (len(candidate.parameters),) or not np.isfinite(np.asarray(start, dtype=float)).all():
            raise CaseError(
                f"candidate {candidate.key!r}: start {start} must hold {len(candidate.parameters)} finite numbers, "
                "one per parameter"
            )
