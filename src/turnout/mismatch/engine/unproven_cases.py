"""Names are withheld where this kind of diagnosis is not proven on concealed data: "cannot tell" replaces them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from turnout.mismatch.engine.decision import UNPROVEN_RULES
from turnout.mismatch.engine.decision_facts import UnprovenEvidence
from turnout.mismatch.engine.rule import first_applicable

if TYPE_CHECKING:
    from turnout.mismatch.engine.findings import Findings


def withhold_names(findings: Findings) -> Findings:
    """The findings, without names where the case has a reservation and the settings do not ask for them.

    Parameters
    ----------
    findings : Findings
        With grades.

    Returns
    -------
    Findings
        As they are, or with one verdict, "unknown", and the base fit. Its reason states the names.
    """
    settings = findings.search.settings
    evidence = UnprovenEvidence(findings.verdicts, findings.search.case.reservation, settings.unproven_names)
    rule = first_applicable(UNPROVEN_RULES, evidence)
    if rule.answer != "unknown":
        return findings
    unknown = findings.verdicts[0].as_unknown(rule.reason_for(evidence), settings).after(rule)
    return replace(findings, verdicts=(unknown,), fit=findings.base)
