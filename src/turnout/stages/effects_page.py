"""Write docs/effects.md, the list of effects that a diagnosis can name, from the catalogue itself.

Run ``python -m turnout.stages.effects_page docs`` to update it; a test compares.
"""

import sys
from importlib import import_module
from pathlib import Path

from turnout.mismatch.turnout.candidates.catalogue import SMALLEST_REPORTABLE
from turnout.physics import TERMS
from turnout.stages.mismatch_rows import SITE_CHECKS
from turnout.stages.mismatch_text import number_in_words

NOT_CANDIDATES = ("lifting_sleepers", "rail_bending", "roughness_level")  # simulated only
FRAME_TEXT = {
    "place": "a place", "amplitude": "a place, and how far it moves", "frequency": "a frequency band",
    "condition": "the whole track, under a condition", "sensor": "a sensor", "clock": "a channel's clock",
    "wheel": "a wheel", "train": "a train", "wavelength": "a stretch of rail",
}  # fmt: skip
PAGE_HEAD = """# What a diagnosis can name

Every effect that `turnout diagnose` asks for, from the catalogue (`turnout.physics`, one file each). "Least": how far
the first number has to be from what it is in a sound track to get a name; for less nobody would go to the site. What is
in no row is located and called "unknown". Which of them were found where they were concealed, and how small:
[blind proof](blind.md).

| effect | name | fixed to | numbers found | least | what to check on site |
|---|---|---|---|---|---|
"""
PAGE_FOOT = """
Not asked for, but known to the simulation and to track files: {}.
"""


def page() -> str:
    """Text of the page."""
    candidates = [t for t in TERMS if t.name not in NOT_CANDIDATES]
    not_candidates = ", ".join(
        _effect_name(t)[0].lower() + _effect_name(t)[1:] for t in TERMS if t.name in NOT_CANDIDATES
    )
    return PAGE_HEAD + "".join(_row(t) for t in candidates) + PAGE_FOOT.format(not_candidates)


def _row(term) -> str:
    numbers = "; ".join(f"{p.meaning} [{p.unit}]" for p in term.parameters)
    smallest = (
        number_in_words(SMALLEST_REPORTABLE[term.name], term.parameters[0].unit)
        if term.name in SMALLEST_REPORTABLE
        else "–"
    )
    frame = FRAME_TEXT[getattr(term, "frame", "place")]
    cells = _effect_name(term), f"`{term.name}`", frame, numbers, smallest, SITE_CHECKS.get(term.name, "–")
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |\n"


def _effect_name(term) -> str:
    """First sentence of the module docstring of the term."""
    return (import_module(term.__module__).__doc__ or "").strip().splitlines()[0].split(": ")[0].removesuffix(".")


if __name__ == "__main__":
    (Path(sys.argv[1]) / "effects.md").write_text(page(), encoding="utf-8")
