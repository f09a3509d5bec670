"""What a diagnosis in progress has found so far."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.rule import Rule
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.search import Search
    from turnout.mismatch.engine.verdict import Verdict


@dataclass(frozen=True)
class Findings:
    """What a diagnosis has found so far.

    Attributes
    ----------
    search : Search
    base : Fit
        Fit without any candidate effect.
    fit : Fit
        Fit with all effects that have a verdict.
    verdicts : tuple of Verdict
        One for each effect.
    scores : tuple of Score
        Candidates of the last effect that was sought.
    choice : Findings or None
        The findings with two rivals that may both be present. They stand unless a second effect decides.
    """

    search: Search
    base: Fit
    fit: Fit
    verdicts: tuple[Verdict, ...] = ()
    scores: tuple[Score, ...] = ()
    choice: Findings | None = None

    @property
    def is_unknown(self) -> bool:
        """Whether the first verdict is "unknown"."""
        return bool(self.verdicts) and self.verdicts[0].answer == "unknown"

    @property
    def is_pair(self) -> bool:
        """Whether there are two verdicts, each of which states one effect."""
        return len(self.verdicts) == 2 and all(v.is_single_effect for v in self.verdicts)

    def after(self, rule: Rule, **changes: Any) -> Findings:
        """The findings with some changes, and a rule in the trail of the first verdict.

        Parameters
        ----------
        rule : Rule
            The rule that asks for the changes.
        **changes :
            Fields of the findings.

        Returns
        -------
        Findings
        """
        changed = replace(self, **changes)
        first, *further = changed.verdicts
        return replace(changed, verdicts=(first.after(rule), *further))
