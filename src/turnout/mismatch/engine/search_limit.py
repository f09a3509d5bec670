"""Bound of a search: it ends with "cannot tell" and its reason once a case has cost too many simulations."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout.errors import TurnoutError
from turnout.mismatch.engine.decision import LIMIT_RULES, first_applicable
from turnout.mismatch.engine.decision_facts import SearchLimit
from turnout.mismatch.engine.verdict import Verdict

if TYPE_CHECKING:
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.mismatch.engine.case import Case


class SearchLimitError(TurnoutError):
    """A search has cost more simulations than it may.

    Parameters
    ----------
    limit : SearchLimit
        What it has cost.
    """

    def __init__(self, limit: SearchLimit) -> None:
        super().__init__(f"the search has cost {limit.n} simulations, of at most {limit.most}.")
        self.limit = limit


def check_limit(case: Case) -> None:
    """Check the bound of a case before a further fit.

    Parameters
    ----------
    case : Case

    Raises
    ------
    SearchLimitError
        The case has a bound, and has cost more.
    """
    if case.max_simulations is not None and case.n_simulations > case.max_simulations:
        raise SearchLimitError(SearchLimit(case.n_simulations, case.max_simulations))


def unfinished_verdict(limit: SearchLimit, settings: MismatchSettings) -> Verdict:
    """The verdict of a search that was not finished.

    Parameters
    ----------
    limit : SearchLimit
        What the search has cost.
    settings : MismatchSettings

    Returns
    -------
    Verdict
        "unknown", with the reason.
    """
    rule = first_applicable(LIMIT_RULES, limit)
    return Verdict(
        rule.answer, reason=rule.reason_for(limit), probability=settings.certainty(rule.answer), trail=(rule.name,)
    )
