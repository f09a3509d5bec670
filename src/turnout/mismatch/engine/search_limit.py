"""End of a search before its time: a case has cost too many simulations, or one of them fails."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from turnout.errors import TurnoutError

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case


@dataclass(frozen=True)
class SearchLimit:
    """Number ``n`` of simulations that a search has cost, and the ``most`` that it may.

    ``has_verdict``: the first effect had its verdict before, and a second one was sought. ``failure``: of a simulation
    that ended the search, in words; "" if it was the limit.
    """

    n: int
    most: int
    has_verdict: bool = False
    failure: str = ""

    @property
    def words(self) -> str:
        """What ended the search, in words after "decided" or "finished"."""
        return f", since a simulation failed: {self.failure}" if self.failure else (
            f" within {self.most} simulations of a train"
        )  # fmt: skip


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


def check_limit(case: Case, n_before: int) -> None:
    """Check the bound of a case before a further fit.

    Parameters
    ----------
    case : Case
    n_before : int
        Simulations before the search, of the fit without effects. They are not part of it.

    Raises
    ------
    SearchLimitError
        The case has a bound, and has cost more.
    """
    n = case.n_simulations - n_before
    if case.max_simulations is not None and n > case.max_simulations:
        raise SearchLimitError(SearchLimit(n, case.max_simulations))
