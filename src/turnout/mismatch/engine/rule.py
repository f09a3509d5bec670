"""One rule of a decision, and the first rule of a table that applies."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

Facts = TypeVar("Facts")


@dataclass(frozen=True)
class Rule(Generic[Facts]):
    """One line of a table of the decision.

    Attributes
    ----------
    name : str
        Entry of ``Verdict.trail``.
    applies : callable
        Facts of the step -> whether the rule applies.
    answer : str
        Answer of the verdict, or which of two verdicts remain.
    reason : str
        Reason in words, a format string with the facts as ``e``.
    page : str
        Page below ``docs`` that gives the reason for the rule.
    cause : str
        "clock", "train" or "all trains" if the answer rests on recordings that were not fitted, else "".
    """

    name: str
    applies: Callable[[Facts], Any]
    answer: str
    reason: str
    page: str
    cause: str = ""

    def reason_for(self, evidence: Facts) -> str:
        """Reason in words for the facts of one step, with a space before each sign of per cent.

        Parameters
        ----------
        evidence : facts
            Those of the rule's table.

        Returns
        -------
        str
        """
        return re.sub(r"(?<=\d)%", " %", self.reason.format(e=evidence))


def first_applicable(rules: Sequence[Rule[Facts]], evidence: Facts) -> Rule[Facts]:
    """First of the rules that applies. The last rule of a table always does.

    Parameters
    ----------
    rules : sequence of Rule
        A table, in order.
    evidence : facts
        What its rules ask for.

    Returns
    -------
    Rule
    """
    return next(rule for rule in rules if rule.applies(evidence))
