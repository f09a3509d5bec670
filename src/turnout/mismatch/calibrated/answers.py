"""Answers of the calibrated model: which effect has appeared since when, and which was there from the first visit.

An answer after a visit rests on that visit and those before it, as one has it on that day.
"""

from __future__ import annotations

from collections.abc import Sequence

from turnout.mismatch.calibrated.answers_against_file import file_answer
from turnout.mismatch.calibrated.answers_of_change import change_answer
from turnout.mismatch.calibrated.belief import StateParameter
from turnout.mismatch.calibrated.change import ChangeEffect
from turnout.mismatch.calibrated.history import Event
from turnout.mismatch.calibrated.information import VisitInformation
from turnout.mismatch.calibrated.model_answer import ModelAnswer


def answers_after_visits(
    parameters: Sequence[StateParameter],
    visits: Sequence[VisitInformation],
    events: Sequence[Event],
    candidates: Sequence[ChangeEffect],
    threshold: float,
    margin: float,
    first: int = 1,
    against_file: tuple[Sequence[StateParameter], Sequence[Event], Sequence[ChangeEffect]] | None = None,
    surface: Sequence[ChangeEffect] = (),
) -> list[ModelAnswer]:
    """What the model says after each visit, of changes and against the file.

    Parameters
    ----------
    parameters : sequence of StateParameter
    visits : sequence of VisitInformation
    events : sequence of Event
    candidates : sequence of ChangeEffect
        As ``change_candidates``.
    threshold : float
        Evidence that a name needs. [nats]
    margin : float
        A rival of another name within it makes the answer "a or b", also one below the threshold. [nats]
    first : int
        Number of the first visit after which an answer is given, from 1.
    against_file : tuple or None
        Parameters, events and candidates of the comparison with the file, None: the same.
    surface : sequence of ChangeEffect
        As ``surface_changes``: they locate a change of the running surface that has no name.

    Returns
    -------
    list of ModelAnswer
        Two for each visit, in the order of time.
    """
    ordered = sorted(visits, key=lambda v: (v.time, v.visit))
    answers = []
    file_parameters, file_events, file_candidates = against_file or (parameters, events, candidates)
    for n in range(first, len(ordered) + 1):
        change = change_answer(parameters, ordered[:n], events, candidates, threshold, margin, surface=surface)
        before = _visits_before(ordered[:n], change)
        label = ordered[n - 1].visit
        answers += [
            change,
            file_answer(file_parameters, before, file_events, label, file_candidates, threshold, margin, surface),
        ]
    return answers


def _visits_before(visits: Sequence[VisitInformation], change: ModelAnswer) -> list[VisitInformation]:
    """Visits that certainly lie before the change: with it the mean of all visits deviates from the file, too."""
    if change.onset is None:
        return list(visits)
    return [v for v in visits if v.time <= change.onset[0]]
