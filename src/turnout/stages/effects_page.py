"""Write docs/effects.md, the list of effects that a diagnosis can name, from the catalogue itself.

Run ``python -m turnout.stages.effects_page docs`` to update it; a test compares.
"""

from __future__ import annotations

import sys
from pathlib import Path

from turnout import physics
from turnout.physics.term import FRAMES
from turnout.stages.parameter_text import number_in_words

PAGE_HEAD = """# What a diagnosis can name

This page lists every effect that `turnout diagnose` can name, and what to check on site then.

"Least" is the smallest deviation of the first parameter from its value in an intact track that gets a name.
A smaller one would cause no action. An effect that is not in the table is located and called "unknown".
The [blind proof](blind.md) states which concealed effects were named, and at which size.

| effect | name | fixed to | parameters | least | what to check on site |
|---|---|---|---|---|---|
"""
PAGE_FOOT = """
Three more effects are possible in simulations and track files, but are not tested by a diagnosis:

{}
"""


def page() -> str:
    """Text of the page."""
    effects = sorted(physics.TERMS, key=lambda effect: effect.name)
    rows = "".join(_row(effect) for effect in effects if effect.asked)
    names = [effect.title() for effect in effects if not effect.asked]
    return PAGE_HEAD + rows + PAGE_FOOT.format("\n".join(f"- {name}" for name in names))


def _row(effect: type[physics.PhysicsTerm]) -> str:
    numbers = "; ".join(f"{p.meaning} [{p.unit}]" for p in effect.parameters)
    size = effect.smallest_reportable
    smallest = number_in_words(size, effect.parameters[0].unit) if size else "–"
    cells = effect.title(), f"`{effect.name}`", FRAMES[effect.frame], numbers, smallest, effect.site_check
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |\n"


if __name__ == "__main__":
    (Path(sys.argv[1]) / "effects.md").write_text(page(), encoding="utf-8")
