"""Draw one hammer test as an SVG file with the panels of the turnout's page."""

from __future__ import annotations

import re
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING

from turnout.reasons import REASONS
from turnout.report import panels
from turnout.report.hammer_text import heading, resonances, verdict
from turnout.report.panels.hammer import HammerTest, impacts_panel

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from turnout.config.turnout import TurnoutConfig
    from turnout.records import Unit

WIDTH, HEADER_HEIGHT, GAP = 462, 52, 12  # px: width of a panel, height of the header, space between panels
HEIGHT_PATTERN = re.compile(r' height="(\d+)"')


def hammer_figure(rows: Mapping[str, Sequence[Mapping[str, Any]]], unit: Unit, turnout: TurnoutConfig) -> str:
    """SVG with every panel of ``panels.HAMMER_PANELS``, two in a row.

    Parameters
    ----------
    rows : mapping
        Rows of ``hammer_unit`` by table.
    unit : Unit
        Section and campaign.
    turnout : TurnoutConfig
        The turnout.

    Returns
    -------
    str
        SVG, "" without an impact.
    """
    drawings = _panels(rows)
    if not drawings:
        return ""
    cells, y = [], HEADER_HEIGHT
    for row in (drawings[i : i + 2] for i in range(0, len(drawings), 2)):
        cells += [f'<g transform="translate({k * (WIDTH + GAP)} {y})">{drawing}</g>' for k, drawing in enumerate(row)]
        y += max(int(HEIGHT_PATTERN.findall(drawing)[0]) for drawing in row)
    words = heading(unit, turnout), ": ".join([verdict(rows), *_resonance_words(rows)])
    lines = "".join(
        f'<text class="{style}" x="8" y="{18 + 20 * k}">{escape(line)}</text>'
        for k, (style, line) in enumerate(zip(("title", "label"), words))
    )
    width = 2 * WIDTH + GAP
    frame = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {y}" width="{width}" height="{y}">'
    return (
        f'{frame}<style>{_style()}</style><rect width="{width}" height="{y}" fill="#fff"/>{lines}{"".join(cells)}</svg>'
    )


def _resonance_words(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[str]:
    """The resonances and the reason why the model was rejected."""
    reasons = [REASONS[model["reason"]] for model in rows.get("models", ()) if model["reason"]]
    return ["; ".join([*resonances(rows), *reasons])] if rows.get("models") else []


def _panels(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[str]:
    """All panels of the page; without a receptance only the impacts."""
    model = next(iter(rows.get("models", ())), {})
    receptance = next(iter(rows.get("receptances", ())), {})
    test = HammerTest(receptance, model, rows.get("modes", ()), rows.get("impacts", ()))
    chosen = panels.HAMMER_PANELS if receptance else (impacts_panel,)
    return [drawn for panel in chosen if (drawn := panel(test))]


def _style() -> str:
    """Style rules for drawings, with colours written out because drawing programs know no CSS variables."""
    css = (files("turnout.report") / "templates" / "page.css").read_text(encoding="utf-8")
    light = css[css.index(":root{") : css.index("@media")]  # dark colours follow in a rule of their own
    colours = dict(re.findall(r"(--[\w-]+):([^;}]+)", light))
    inside = css[css.index("svg text{") : css.index("@media print")]
    return re.sub(r"var\((--[\w-]+)\)", lambda match: colours[match[1]], inside)
