"""Draw the position of a finding on a plan of its turnout."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from turnout.constants import Z95

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

WIDTH, HEIGHT = 920, 210  # px, of the plan
MAIN, SPREAD = 92.0, 58.0  # px: the main track from above, and how far the diverging track goes off
SLEEPER_SPACING = 0.6  # m, usual: the least width of a drawn position
STYLES = {
    "named": "found-named",
    "a_or_b": "found-aorb",
    "unknown": "found-unknown",
    "numerics": "found-numerics",
    "none": "found-none",
}


class TurnoutDrawing:
    """Drawing of a turnout with positions [m] mapped to pixels; the diverging track begins at the switch toe."""

    toe = 0.0  # origin of positions

    def __init__(self, sections: Sequence[Mapping[str, Any]]) -> None:
        self.branches = any(s["track"] == "diverging" for s in sections)
        positions = [s["position_m"] or 0.0 for s in sections] + [self.toe] * self.branches
        self.low, self.high = min(positions) - 4.0, max(positions) + 4.0
        self.elements: list[str] = []

    def px(self, metres: float) -> float:
        """Horizontal pixel of a position.

        Parameters
        ----------
        metres : float
            Position. [m]

        Returns
        -------
        float
            Pixel.
        """
        return 20 + (WIDTH - 40) * (metres - self.low) / (self.high - self.low)

    def py(self, metres: float, diverging: bool) -> float:
        """Vertical pixel of a position on the main or the diverging track.

        Parameters
        ----------
        metres : float
            Position. [m]
        diverging : bool
            Whether it is on the diverging track.

        Returns
        -------
        float
            Pixel.
        """
        share = max(0.0, (metres - self.toe) / (self.high - self.toe)) if diverging else 0.0
        return MAIN + SPREAD * share**1.6

    def rails(self) -> None:
        """Draw the main track, and the diverging one where it is measured."""
        steps = [self.toe + (self.high - self.toe) * k / 24 for k in range(25)]
        curve = " ".join(f"L{self.px(m):.1f} {self.py(m, True):.1f}" for m in steps)
        self.elements.append(f'<path class="rail" d="M{self.px(self.low):.1f} {MAIN}H{self.px(self.high):.1f}"/>')
        if self.branches:
            self.elements.append(f'<path class="rail" d="M{self.px(self.toe):.1f} {MAIN} {curve}"/>')

    def stretch(self, finding: Mapping[str, Any]) -> None:
        """Draw the part of the track that a group covers, in the colour of its verdict.

        Where the effect has a position, only its 95 % interval has this colour, and the rest is drawn as examined.

        Parameters
        ----------
        finding : mapping
            Row of ``mismatch_findings``.
        """
        examined = finding["place_low_m"] - 1.3, finding["place_high_m"] + 1.3
        position = finding["position_m"]
        verdict = f"{finding['sections']}: {finding['verdict'].replace('_', ' ')}"
        if position is None or finding["verdict"] == "none":
            self._band(finding, *examined, STYLES[finding["verdict"]], verdict)
            return
        half = max(Z95 * (finding["position_se_m"] or 0.0), 0.5 * SLEEPER_SPACING)
        self._band(finding, *examined, "found-examined", f"{finding['sections']}: examined")
        self._band(finding, position - half, position + half, STYLES[finding["verdict"]], verdict)

    def _band(self, finding: Mapping[str, Any], low: float, high: float, style: str, words: str) -> None:
        diverging = finding["route"] == "diverging"
        steps = [low + (high - low) * k / 12 for k in range(13)]
        path = "L".join(f"{self.px(m):.1f} {self.py(m, diverging):.1f}" for m in steps)
        self.elements.append(f'<path class="stretch {style}" d="M{path}"><title>{escape(words)}</title></path>')

    def sensor(self, section: Mapping[str, Any], row: int, unnamed: bool = False) -> None:
        """Draw a measured section with its label; labels alternate between two rows.

        Parameters
        ----------
        section : mapping
            Row of ``sections``.
        row : int
            Number of the section, which decides the row of its label.
        unnamed : bool
            Whether its label is left out.
        """
        diverging = section["track"] == "diverging"
        x, y = self.px(section["position_m"] or 0.0), self.py(section["position_m"] or 0.0, diverging)
        side = 24 + 13 * (row % 2) if diverging else -16 - 13 * (row % 2)
        label = escape(section["label"])
        self.elements.append(f'<circle class="seat" cx="{x:.1f}" cy="{y:.1f}" r="4.5"><title>{label}</title></circle>')
        if not unnamed:
            text = f'<text class="tick" x="{x:.1f}" y="{y + side:.1f}" text-anchor="middle">{label}</text>'
            self.elements.append(text)

    def mark(self, position: float, diverging: bool, words: str) -> None:
        """Draw an arrow to a position, with words at its tail.

        Parameters
        ----------
        position : float
            Position. [m]
        diverging : bool
            Whether it is on the diverging track.
        words : str
            Text at the tail.
        """
        x, y = self.px(position), self.py(position, diverging)
        anchor = "end" if x > WIDTH - 260 else "start"
        beside = x - 10 if anchor == "end" else x + 10
        self.elements.append(
            f'<path class="arrow" d="M{x:.1f} {y - 62:.1f}V{y - 12:.1f}"/>'
            f'<path class="arrowhead" d="M{x - 6:.1f} {y - 18:.1f}L{x:.1f} {y - 6:.1f}L{x + 6:.1f} {y - 18:.1f}Z"/>'
            f'<text class="mark" x="{beside:.1f}" y="{y - 56:.1f}" text-anchor="{anchor}">{escape(words)}</text>'
        )

    def svg(self) -> str:
        """The whole drawing."""
        legend = f'<text class="label" x="24" y="{HEIGHT - 6}">facing direction →, metres from the switch toe</text>'
        return (
            f'<svg class="diagram" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" role="img" '
            f'aria-label="The turnout and what was found">{"".join(self.elements)}{legend}</svg>'
        )


def position_panel(
    sections: Sequence[Mapping[str, Any]],
    findings: Sequence[Mapping[str, Any]],
    marked: Mapping[str, Any] | None = None,
) -> str:
    """SVG of the sections with the verdicts of the findings.

    Parameters
    ----------
    sections : sequence of mapping
        Rows of ``sections`` of the turnout.
    findings : sequence of mapping
        Rows of ``mismatch_findings``.
    marked : mapping or None
        Finding that gets the arrow.

    Returns
    -------
    str
        SVG.
    """
    drawing = TurnoutDrawing(sections)
    drawing.rails()
    for finding in findings:
        drawing.stretch(finding)
    position, words = marked_position(marked, sections) if marked is not None else (None, "")
    ordered = sorted(sections, key=lambda s: (s["track"] == "diverging", s["position_m"] or 0.0))
    for row, section in enumerate(ordered):
        hidden = position is not None and marked is not None and _is_under_arrow(section, position, marked["route"])
        drawing.sensor(section, row, hidden)
        words += f" ({section['label']})" if hidden and section["label"] not in words else ""
    if position is not None and marked is not None:
        drawing.mark(position, marked["route"] == "diverging", words)
    return drawing.svg()


def _is_under_arrow(section: Mapping[str, Any], position: float, route: str) -> bool:
    """Whether the arrow would lie on the section's label."""
    same = (section["track"] == "diverging") == (route == "diverging")
    return same and abs((section["position_m"] or 0.0) - position) < 0.5


def marked_position(finding: Mapping[str, Any], sections: Sequence[Mapping[str, Any]]) -> tuple[float | None, str]:
    """Position and words of the arrow: that of the effect, or of its sensor.

    Parameters
    ----------
    finding : mapping
        Row of ``mismatch_findings``.
    sections : sequence of mapping
        Rows of ``sections`` of the turnout.

    Returns
    -------
    (float or None, str)
        Position [m], None without one, and words.
    """
    if finding["position_m"] is not None:
        return finding["position_m"], f"{finding['position_m']:.1f} m"
    if finding["channel"]:
        positions = {s["label"]: s["position_m"] for s in sections}
        middle = 0.5 * (finding["place_low_m"] + finding["place_high_m"])
        return positions.get(finding["channel"], middle), f"sensor {finding['channel']}"
    return None, ""
