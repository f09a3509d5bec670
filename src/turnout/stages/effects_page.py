"""Write docs/effects.md, the list of effects that a diagnosis can name, from the catalogue itself.

Run ``python -m turnout.stages.effects_page docs`` to update it; a test compares.
"""

import sys
from importlib import import_module
from pathlib import Path

from turnout.mismatch.turnout.candidates.catalogue import LEAST
from turnout.physics import TERMS
from turnout.stages.mismatch_rows import CHECKS
from turnout.stages.mismatch_text import number_in_words

NEVER_ASKED = ("lifting_sleepers", "rail_bending", "roughness_level")  # simulated only
FIXED_TO = {
    "place": "a place", "amplitude": "a place, and how far it moves", "frequency": "a frequency band",
    "condition": "the whole track, under a condition", "sensor": "a sensor", "clock": "a channel's clock",
    "wheel": "a wheel", "train": "a train", "wavelength": "a stretch of rail",
}  # fmt: skip
HEAD = """# What a diagnosis can name

Every effect that `turnout diagnose` asks for, from the catalogue (`turnout.physics`, one file each). "Least": how far
the first number has to be from what it is in a sound track to get a name; for less nobody would go to the site. What is
in no row is located and called "unknown". Which of them were found where they were concealed, and how small:
[blind proof](blind.md).

| effect | name | fixed to | numbers found | least | what to check on site |
|---|---|---|---|---|---|
"""
FOOT = """
Not asked for, but known to the simulation and to track files: {}.
"""


def page() -> str:
    """Text of the page."""
    asked = [t for t in TERMS if t.name not in NEVER_ASKED]
    others = ", ".join(_what(t)[0].lower() + _what(t)[1:] for t in TERMS if t.name in NEVER_ASKED)
    return HEAD + "".join(_row(t) for t in asked) + FOOT.format(others)


def _row(term) -> str:
    numbers = "; ".join(f"{p.meaning} [{p.unit}]" for p in term.parameters)
    least = number_in_words(LEAST[term.name], term.parameters[0].unit) if term.name in LEAST else "–"
    fixed = FIXED_TO[getattr(term, "frame", "place")]
    cells = _what(term), f"`{term.name}`", fixed, numbers, least, CHECKS.get(term.name, "–")
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |\n"


def _what(term) -> str:
    """First sentence of the module docstring of the term."""
    return (import_module(term.__module__).__doc__ or "").strip().splitlines()[0].split(": ")[0].removesuffix(".")


if __name__ == "__main__":
    (Path(sys.argv[1]) / "effects.md").write_text(page(), encoding="utf-8")
