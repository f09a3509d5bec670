"""How much of the stated errors does not repeat from visit to visit, as a turnout's own normal visits show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from turnout.mismatch.calibrated.belief import StateParameter
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.history import Event, estimate_history
from turnout.mismatch.calibrated.information import VisitInformation

IMPACTS = "impacts at"  # part of the name of a group of hammer tests
TRAINS = "trains"


def kind_of(group: str) -> str:
    """Kind of the recordings of a group: hammer tests, or trains.

    Parameters
    ----------
    group : str
        Name of the group.

    Returns
    -------
    str
        ``IMPACTS`` or ``TRAINS``.
    """
    return IMPACTS if IMPACTS in group else TRAINS


def error_levels(
    parameters: Sequence[StateParameter], visits: Sequence[VisitInformation], events: Sequence[Event] = ()
) -> dict[str, float]:
    r"""Variance of the errors that do not repeat from visit to visit, over the stated variance, by group.

    An error that is the same at all visits cancels in a change. The later visits show what is left: with the
    innovation :math:`s_v` over its number of directions :math:`n_v`, of one kind of recordings alone,

    .. math:: l = \frac{n_0 + \sum_{v > 1} s_v / n_v}{n_0 + n}

    where the stated variance counts as :math:`n_0` visits of the :math:`n` later ones, ``CALIBRATION.level_visits``.
    The first visit tells the constant error, see ``Belief.with_constant_error``. Otherwise each visit would show all of
    it in the many directions of which it knows less than the file.
    A change that ``events`` do not explain raises the level: its evidence is then understated. What first comes after
    the first visit, as another train or another hammer position, has all of its error.

    Parameters
    ----------
    parameters : sequence of StateParameter
    visits : sequence of VisitInformation
        In any order.
    events : sequence of Event

    Returns
    -------
    dict
        Group -> level, at most 1.

    References
    ----------
    Gelman et al. 2013, Bayesian data analysis, section 2.6: the scaled inverse chi-squared distribution.
    """
    ordered = sorted(visits, key=lambda v: (v.time, v.visit))
    levels: dict[str, float] = {}
    for recording_kind in (IMPACTS, TRAINS):
        alike = [replace(v, groups=tuple(g for g in v.groups if kind_of(g.group) == recording_kind)) for v in ordered]
        alike = [v for v in alike if v.groups]
        if not alike:
            continue
        history = estimate_history(
            parameters, alike, events, repeats_between_visits=False, accepted=None, constant_errors=True
        )
        later = [s.innovation for s in history.steps[1:]]
        level_sum = sum(i.statistic / max(i.n_directions, 1) for i in later)
        level = (CALIBRATION.level_visits + level_sum) / (CALIBRATION.level_visits + len(later))
        first_sources = {_source_of(g.group) for g in alike[0].groups}
        levels |= {g.group: min(level, 1.0) for v in alike for g in v.groups if _source_of(g.group) in first_sources}
    return levels


def _source_of(group: str) -> str:
    """The hammer position, or the train at any speed."""
    return group if kind_of(group) == IMPACTS else group.rpartition(", ")[0]
