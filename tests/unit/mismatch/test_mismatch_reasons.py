"""Reasons of a diagnosis are for readers who do not know the engine: words of the field, and every unit explained."""

import re

import pytest

from turnout.mismatch.engine.decision import RULES

PRIVATE = ("excess", "control level", "nats", "threshold", "candidate explains", "likeness", "loud", "its file:")


@pytest.mark.parametrize("rule", [r for r in RULES if r.reason], ids=lambda r: r.name)
def test_a_reason_uses_words_of_the_field(rule):
    """A reason states evidence by ``evidence_in_words``, which adds the odds."""
    words = re.sub(r"{[^}]*}", "0", rule.reason)
    assert not [p for p in PRIVATE if p in words.replace("in excess of the intact state", "")]
