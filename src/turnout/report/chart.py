"""A small chart in SVG: axes, lines, bands, points with error bars. No script, prints and mails as it is."""

from dataclasses import dataclass, field
from html import escape

import numpy as np

from turnout.report.strokes import drawn, runs
from turnout.report.ticks import linear_ticks, log_ticks, say_day, say_number, time_ticks

LEFT, RIGHT, TOP, BOTTOM = 62, 14, 26, 40


@dataclass
class Axis:
    """Maps values to pixels; ``scale`` is "linear", "log", "time", or "names": the k-th of ``names`` at k, from 1."""

    low: float
    high: float
    label: str = ""
    scale: str = "linear"
    names: tuple = ()

    def __post_init__(self):
        if not self.high > self.low:
            pad = abs(self.low) * 0.05 or 1.0
            self.low, self.high = self.low - pad, self.high + pad

    def share(self, values):
        """Place of ``values`` along the axis, 0 to 1."""
        values = np.asarray(values, dtype=float)
        if self.scale == "log":
            with np.errstate(divide="ignore", invalid="ignore"):
                return (np.log10(values) - np.log10(self.low)) / (np.log10(self.high) - np.log10(self.low))
        return (values - self.low) / (self.high - self.low)

    def ticks(self):
        """Pairs of value and text."""
        if self.scale == "names":
            return [(k, escape(name)) for k, name in enumerate(self.names, start=1)]
        if self.scale == "time":
            return [(t, say_day(t)) for t in time_ticks(self.low, self.high)]
        if self.scale == "log":
            return [(v, say_number(v)) for v in log_ticks(self.low, self.high)]
        values = linear_ticks(self.low, self.high)
        step = values[1] - values[0] if len(values) > 1 else None
        return [(v, say_number(v, step)) for v in values]


@dataclass
class Chart:
    """One panel. Draw in order, then take ``svg()``; styles are classes of the page's style sheet."""

    x: Axis
    y: Axis
    title: str = ""
    width: int = 462
    height: int = 240
    parts: list = field(default_factory=list)

    def px(self, values):
        """Horizontal pixels of data values."""
        return LEFT + self.x.share(values) * (self.width - LEFT - RIGHT)

    def py(self, values):
        """Vertical pixels of data values."""
        return self.height - BOTTOM - self.y.share(values) * (self.height - TOP - BOTTOM)

    def line(self, x, y, style, label=""):
        """A polyline, broken where a value is missing."""
        px, py = self.px(x), self.py(y)
        pieces = (drawn(px[piece], py[piece]) for piece in runs(np.isfinite(px) & np.isfinite(py)))
        path = "".join("M" + _joined(*piece) for piece in pieces)
        self.parts.append(f'<path class="{style}" d="{path}">{_title(label)}</path>')

    def band(self, x, low, high, style, label=""):
        """The area between two lines; pieces with missing values are left out."""
        px, low, high = self.px(x), self.py(low), self.py(high)
        for piece in runs(np.isfinite(px) & np.isfinite(low) & np.isfinite(high)):
            there, (x_back, y_back) = drawn(px[piece], high[piece]), drawn(px[piece], low[piece])
            path = f"M{_joined(*there)}L{_joined(x_back[::-1], y_back[::-1])}Z"
            self.parts.append(f'<path class="{style}" d="{path}">{_title(label)}</path>')

    def points(self, x, y, style, radius=3.0, low=None, high=None, labels=None):
        """Dots, with bars from ``low`` to ``high`` where given, and a text each on hovering."""
        px, py = np.atleast_1d(self.px(x)), np.atleast_1d(self.py(y))
        shown = np.isfinite(px) & np.isfinite(py)
        if low is not None and high is not None:
            bottom, top = self.py(low), self.py(high)
            barred = np.flatnonzero(shown & np.isfinite(bottom) & np.isfinite(top))
            numbers = np.column_stack([px[barred], bottom[barred], top[barred]]).ravel()
            if barred.size:
                path = "M%.1f %.1fV%.1f" * barred.size % tuple(numbers.tolist())
                self.parts.append(f'<path class="{style} bar" d="{path}"/>')
        texts = [""] * len(px) if labels is None else [_title(label) for label in labels]
        dot = f'<circle class="{style}" r="{radius:g}" cx="%.1f" cy="%.1f">%s</circle>'
        self.parts += [dot % (px[i], py[i], texts[i]) for i in np.flatnonzero(shown).tolist()]

    def vertical(self, x, style, label="", row=0):
        """A line across the panel at ``x``, with a word at its head."""
        px = float(self.px(x))
        if LEFT - 1 <= px <= self.width - RIGHT + 1:
            self.parts.append(f'<path class="{style}" d="M{px:.1f} {TOP}V{self.height - BOTTOM}"/>')
            if label:
                room = self.width - RIGHT - px > 6.2 * len(label)
                place = f'x="{px + (3 if room else -3):.1f}" y="{TOP + 9 + 11 * row}"'
                anchor = "start" if room else "end"
                self.parts.append(f'<text class="{style}" {place} text-anchor="{anchor}">{escape(label)}</text>')

    def span(self, x_low, x_high, style, label=""):
        """A shaded stretch of the horizontal axis."""
        left, right = (float(np.clip(self.px(v), LEFT, self.width - RIGHT)) for v in (x_low, x_high))
        if right > left:
            self.parts.append(
                f'<rect class="{style}" x="{left:.1f}" y="{TOP}" width="{right - left:.1f}" '
                f'height="{self.height - TOP - BOTTOM}">{_title(label)}</rect>'
            )

    def text(self, x_share, y_share, words, style="note", anchor="start"):
        """Words at a place of the panel given in shares of its width and height."""
        px = LEFT + x_share * (self.width - LEFT - RIGHT)
        py = TOP + y_share * (self.height - TOP - BOTTOM)
        self.parts.append(
            f'<text class="{style}" x="{px:.1f}" y="{py:.1f}" text-anchor="{anchor}">{escape(words)}</text>'
        )

    def svg(self):
        """The whole drawing."""
        frame = (
            f'<svg class="chart" viewBox="0 0 {self.width} {self.height}" width="{self.width}" '
            f'height="{self.height}" role="img" aria-label="{escape(self.title, quote=True)}">'
        )
        title = f'<text class="title" x="{LEFT}" y="16">{escape(self.title)}</text>'
        width, height = self.width - LEFT - RIGHT, self.height - TOP - BOTTOM
        window = f'x="{LEFT}" y="{TOP}" width="{width}" height="{height}" viewBox="{LEFT} {TOP} {width} {height}"'
        body = f"<svg {window}>" + "".join(self.parts) + "</svg>"
        return frame + title + self._axes() + body + "</svg>"

    def _axes(self):
        bottom, right = self.height - BOTTOM, self.width - RIGHT
        x_ticks, y_ticks = self.x.ticks(), self.y.ticks()
        px, py = self.px([v for v, _ in x_ticks]).tolist(), self.py([v for v, _ in y_ticks]).tolist()
        grid = [f"M{x:.1f} {TOP}V{bottom}" for x in px] + [f"M{LEFT} {y:.1f}H{right}" for y in py]
        parts = [
            f'<path class="frame" d="M{LEFT} {TOP}V{bottom}H{right}"/><path class="grid" d="{"".join(grid)}"/>',
            '<g class="tick" text-anchor="middle">',
            *[f'<text x="{x:.1f}" y="{bottom + 14}">{text}</text>' for x, (_, text) in zip(px, x_ticks)],
            '</g><g class="tick" text-anchor="end">',
            *[f'<text x="{LEFT - 5}" y="{y + 3.5:.1f}">{text}</text>' for y, (_, text) in zip(py, y_ticks)],
            "</g>",
        ]
        middle_x, middle_y = (LEFT + right) / 2, (TOP + bottom) / 2
        parts.append(
            f'<text class="label" x="{middle_x:.0f}" y="{self.height - 6}" text-anchor="middle">'
            f"{escape(self.x.label)}</text>"
            f'<text class="label" transform="translate(13 {middle_y:.0f}) rotate(-90)" text-anchor="middle">'
            f"{escape(self.y.label)}</text>"
        )
        return "".join(parts)


def _joined(px, py):
    """``x y`` of every point, with the letter of a straight line between them."""
    numbers = np.column_stack([px, py]).ravel().tolist()
    return ("%.1f %.1fL" * len(px) % tuple(numbers))[:-1]


def _title(words):
    return f"<title>{escape(words)}</title>" if words else ""
