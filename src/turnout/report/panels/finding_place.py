"""The turnout as a drawing with what was diagnosed: each group's answer, and the place that a finding points at."""

from html import escape

STYLES = {
    "named": "found-named",
    "a_or_b": "found-aorb",
    "unknown": "found-unknown",
    "numerics": "found-numerics",
    "none": "found-none",
}
WIDTH, HEIGHT = 920, 210
MAIN, SPREAD = 92.0, 58.0


class Drawing:
    """Places [m] along the turnout to pixels; the diverging track leaves the main one at the switch toe."""

    toe = 0.0  # places count from it

    def __init__(self, sections):
        self.branches = any(s["track"] == "diverging" for s in sections)
        shown = [s["position_m"] or 0.0 for s in sections] + [self.toe] * self.branches
        self.low, self.high = min(shown) - 4.0, max(shown) + 4.0
        self.parts: list[str] = []

    def px(self, metres):
        """Horizontal pixel of a place."""
        return 20 + (WIDTH - 40) * (metres - self.low) / (self.high - self.low)

    def py(self, metres, diverging):
        """Vertical pixel of a place on the main or the diverging track."""
        share = max(0.0, (metres - self.toe) / (self.high - self.toe)) if diverging else 0.0
        return MAIN + SPREAD * share**1.6

    def rails(self):
        """The main track, and the diverging one where it is measured."""
        steps = [self.toe + (self.high - self.toe) * k / 24 for k in range(25)]
        curve = " ".join(f"L{self.px(m):.1f} {self.py(m, True):.1f}" for m in steps)
        self.parts.append(f'<path class="rail" d="M{self.px(self.low):.1f} {MAIN}H{self.px(self.high):.1f}"/>')
        if self.branches:
            self.parts.append(f'<path class="rail" d="M{self.px(self.toe):.1f} {MAIN} {curve}"/>')

    def stretch(self, finding):
        """What a group covers, in the colour of its answer."""
        diverging = finding["route"] == "diverging"
        low, high = finding["place_low_m"] - 1.3, finding["place_high_m"] + 1.3
        steps = [low + (high - low) * k / 12 for k in range(13)]
        path = "L".join(f"{self.px(m):.1f} {self.py(m, diverging):.1f}" for m in steps)
        words = escape(f"{finding['sections']}: {finding['verdict'].replace('_', ' ')}")
        style = STYLES[finding["verdict"]]
        self.parts.append(f'<path class="stretch {style}" d="M{path}"><title>{words}</title></path>')

    def sensor(self, section, row, unnamed=False):
        """A measured section with its label, or ``unnamed``; crowded labels take turns."""
        diverging = section["track"] == "diverging"
        x, y = self.px(section["position_m"] or 0.0), self.py(section["position_m"] or 0.0, diverging)
        side = 24 + 13 * (row % 2) if diverging else -16 - 13 * (row % 2)
        label = escape(section["label"])
        self.parts.append(f'<circle class="seat" cx="{x:.1f}" cy="{y:.1f}" r="4.5"><title>{label}</title></circle>')
        if not unnamed:
            text = f'<text class="tick" x="{x:.1f}" y="{y + side:.1f}" text-anchor="middle">{label}</text>'
            self.parts.append(text)

    def mark(self, place, diverging, words):
        """An arrow to a place, with words at its tail."""
        x, y = self.px(place), self.py(place, diverging)
        anchor = "end" if x > WIDTH - 260 else "start"
        beside = x - 10 if anchor == "end" else x + 10
        self.parts.append(
            f'<path class="arrow" d="M{x:.1f} {y - 62:.1f}V{y - 12:.1f}"/>'
            f'<path class="arrowhead" d="M{x - 6:.1f} {y - 18:.1f}L{x:.1f} {y - 6:.1f}L{x + 6:.1f} {y - 18:.1f}Z"/>'
            f'<text class="mark" x="{beside:.1f}" y="{y - 56:.1f}" text-anchor="{anchor}">{escape(words)}</text>'
        )

    def svg(self):
        """The whole drawing."""
        legend = f'<text class="label" x="24" y="{HEIGHT - 6}">facing direction →, metres from the switch toe</text>'
        return (
            f'<svg class="diagram" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" role="img" '
            f'aria-label="The turnout and what was found">{"".join(self.parts)}{legend}</svg>'
        )


def place_panel(sections, findings, marked=None):
    """Drawing of ``sections`` (rows) with the answers of ``findings``; ``marked`` is the one that gets the arrow."""
    drawing = Drawing(sections)
    drawing.rails()
    for finding in findings:
        drawing.stretch(finding)
    place, words = marked_place(marked, sections) if marked is not None else (None, "")
    ordered = sorted(sections, key=lambda s: (s["track"] == "diverging", s["position_m"] or 0.0))
    for row, section in enumerate(ordered):
        hidden = place is not None and marked is not None and _under(section, place, marked["route"])
        drawing.sensor(section, row, hidden)
        words += f" ({section['label']})" if hidden and section["label"] not in words else ""
    if place is not None and marked is not None:
        drawing.mark(place, marked["route"] == "diverging", words)
    return drawing.svg()


def _under(section, place, route):
    """Whether the arrow would lie on the section's label."""
    same = (section["track"] == "diverging") == (route == "diverging")
    return same and abs((section["position_m"] or 0.0) - place) < 0.5


def marked_place(finding, sections):
    """(place [m] or None, words) that the arrow points at: the effect's place, or its sensor's."""
    if finding["position_m"] is not None:
        return finding["position_m"], f"{finding['position_m']:.1f} m"
    if finding["channel"]:
        seats = {s["label"]: s["position_m"] for s in sections}
        middle = 0.5 * (finding["place_low_m"] + finding["place_high_m"])
        return seats.get(finding["channel"], middle), f"sensor {finding['channel']}"
    return None, ""
