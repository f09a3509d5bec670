"""Pads that soften with temperature, in campaigns at one temperature: they cannot be distinguished from soft pads."""

from __future__ import annotations

from turnout_blind.effect import Effect
from turnout_blind.effects.pad_temperature import act, draw

EFFECT = Effect(
    "one_temperature", "condition", (0.004, 0.007, 0.01, 0.013), draw, act, "unidentifiable", {"same_temperature": True}
)
