"""Draw small charts in SVG: axes with ticks, lines, bands, and points with error bars. They need no script.

``data-`` attributes hold the ends of the axes and the names of
the series, from which templates/chart.js offers zoom, values and toggles.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass, field
from itertools import compress
from typing import TYPE_CHECKING

import numpy as np

from turnout.report.axis import Axis
from turnout.report.formatting import escape
from turnout.report.path_data import HUNDREDTHS, format_pixels, path_bars, path_points, reduce_points, runs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

LEFT, RIGHT, TOP, BOTTOM = 62, 14, 26, 40  # px, margins around the plot area
LETTER, TITLE_LETTER = 6.2, 6.9  # px, mean width of a letter of a label and of a title
LINE = 13  # px, height of a further line of a title


@dataclass
class VerticalLabel:
    """Words beside a vertical line at ``px``, wanted in line ``row`` of the text, counted from the top."""

    px: float
    words: str
    style: str
    row: int

    def box(self, row: int, side: int) -> tuple[int, float, float]:
        """Row, left and right end [px] of the words to the right (``side`` 1) or left (-1) of the line.

        Parameters
        ----------
        row : int
            Line of the text.
        side : int
            1 or -1.

        Returns
        -------
        (int, float, float)
            Row and ends.
        """
        ends = sorted((self.px + 3.0 * side, self.px + side * (3.0 + LETTER * len(self.words))))
        return row, ends[0], ends[1]


@dataclass
class Chart:
    """One panel. Add elements in drawing order, then call ``svg()``; styles are classes of the style sheet.

    A title that is wider than the panel gets a second line, and the panel grows by it.
    """

    x: Axis
    y: Axis
    title: str = ""
    width: int = 462
    height: int = 240
    elements: list = field(default_factory=list)
    outside: list = field(default_factory=list)
    top: int = TOP

    def __post_init__(self) -> None:
        self.title_lines = _wrap_title(self.title, max(8, int((self.width - LEFT) / TITLE_LETTER)))
        self.grow_top(LINE * (len(self.title_lines) - 1))
        self._labels: list[VerticalLabel] = []

    def grow_top(self, pixels: int) -> None:
        """Make room above the plot area, for lines of a title or a legend in ``outside``.

        Parameters
        ----------
        pixels : int
            Height. [px]
        """
        self.top, self.height = self.top + pixels, self.height + pixels

    def px(self, values: ArrayLike) -> np.ndarray:
        """Horizontal pixels of data values.

        Parameters
        ----------
        values : float or (...) array
            Horizontal values.

        Returns
        -------
        (...) array
            Pixels from the left.
        """
        return LEFT + self.x.share(values) * (self.width - LEFT - RIGHT)

    def py(self, values: ArrayLike) -> np.ndarray:
        """Vertical pixels of data values.

        Parameters
        ----------
        values : float or (...) array
            Vertical values.

        Returns
        -------
        (...) array
            Pixels from the top.
        """
        return self.height - BOTTOM - self.y.share(values) * (self.height - self.top - BOTTOM)

    def line(self, x: ArrayLike, y: ArrayLike, style: str, label: str = "") -> None:
        """Draw a polyline with gaps at missing values; nothing, also no name in the legend, if all are single.

        Parameters
        ----------
        x : (n,) array of float
            Horizontal values.
        y : (n,) array of float
            Vertical values; not finite: a gap.
        style : str
            Class of the style sheet.
        label : str
            Name of the series.
        """
        px, py = self.px(x), self.py(y)
        slices = _visible(np.isfinite(px) & np.isfinite(py))
        if not slices:
            return
        pieces = (reduce_points(px[piece], py[piece]) for piece in slices)
        path = "".join("M" + path_points(*piece) for piece in pieces)
        self.elements.append(f'<path class="{style}"{_series(label)} d="{path}">{_title(label)}</path>')

    def band(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, style: str, label: str = "") -> None:
        """Draw the area between two lines, with gaps at missing values; nothing if all are single.

        Parameters
        ----------
        x : (n,) array of float
            Horizontal values.
        low : (n,) array of float
            Values of the lower line.
        high : (n,) array of float
            Values of the upper line.
        style : str
            Class of the style sheet.
        label : str
            Name of the series.
        """
        px, low, high = self.px(x), self.py(low), self.py(high)
        for piece in _visible(np.isfinite(px) & np.isfinite(low) & np.isfinite(high)):
            forward, (x_back, y_back) = reduce_points(px[piece], high[piece]), reduce_points(px[piece], low[piece])
            path = f"M{path_points(*(np.append(a, b[::-1]) for a, b in zip(forward, (x_back, y_back))))}Z"
            self.elements.append(f'<path class="{style}"{_series(label)} d="{path}">{_title(label)}</path>')

    def points(
        self,
        x: ArrayLike,
        y: ArrayLike,
        style: str,
        radius: float = 3.0,
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
        labels: Sequence[str] | None = None,
        series: str = "",
    ) -> None:
        """Draw dots, with bars if their ends are given.

        Parameters
        ----------
        x : (n,) array of float
            Horizontal values.
        y : (n,) array of float
            Vertical values; not finite: a gap.
        style : str
            Class of the style sheet.
        radius : float
            Radius of the dots. [px]
        low : (n,) array of float or None
            Lower ends of the bars.
        high : (n,) array of float or None
            Upper ends of the bars.
        labels : sequence of str or None
            Text of each dot on hovering.
        series : str
            Name of the series.
        """
        if np.size(x) == 0:
            return
        px, py = np.atleast_1d(self.px(x)), np.atleast_1d(self.py(y))
        is_finite = np.isfinite(px) & np.isfinite(py)
        if low is not None and high is not None:
            bottom, top = self.py(low), self.py(high)
            barred = np.flatnonzero(is_finite & np.isfinite(bottom) & np.isfinite(top))
            if barred.size:
                path = path_bars(px[barred], bottom[barred], top[barred])
                self.elements.append(f'<path class="{style} bar"{_series(series)} d="{path}"/>')
        texts = [""] * len(px) if labels is None else [_title(label) for label in labels]
        dot = f'<circle class="{style}" r="{radius:g}" cx="%s" cy="%s">%s</circle>'
        places = ((format_pixels(round(HUNDREDTHS * v)) for v in values[is_finite].tolist()) for values in (px, py))
        dots = [dot % (*place, text) for place, text in zip(zip(*places), compress(texts, is_finite.tolist()))]
        if dots:
            self.elements.append(f"<g{_series(series)}>{''.join(dots)}</g>" if series else "".join(dots))

    def vertical(self, x: float, style: str, label: str = "", row: int = 0) -> None:
        """Draw a vertical line with a label at its top, or along the line where it would lie on another line or label.

        Parameters
        ----------
        x : float
            Horizontal value.
        style : str
            Class of the style sheet.
        label : str
            Text beside the line.
        row : int
            Number of the first line of text to try, counted from the top.
        """
        px = float(self.px(x))
        if LEFT - 1 <= px <= self.width - RIGHT + 1:
            self.elements.append(f'<path class="{style}" d="M{px:.2f} {self.top}V{self.height - BOTTOM}"/>')
            self._labels.append(VerticalLabel(px, label, style, row))

    def _placed_labels(self) -> str:
        """Labels of the vertical lines, none on another one or across a line."""
        occupied: list[tuple[int, float, float]] = []
        texts = []
        for label in (one for one in self._labels if one.words):
            boxes = ((side, label.box(row, side)) for row in range(label.row, label.row + 3) for side in (1, -1))
            side, box = next(((s, b) for s, b in boxes if self._is_free(b, label.px, occupied)), (0, (0, 0.0, 0.0)))
            if side:
                occupied.append(box)
                anchor = "start" if side > 0 else "end"
                where = f'x="{3 * side}" y="{self.top + 9 + 11 * box[0]}" text-anchor="{anchor}"'
            else:
                where = f'transform="translate(-3 {self.height - BOTTOM - 6}) rotate(-90)"'
            words = f'<text class="{label.style}" {where}>{escape(label.words)}</text>'
            texts.append(f'<g data-px="{label.px:.2f}" transform="translate({label.px:.2f} 0)">{words}</g>')
        return "".join(texts)

    def _is_free(self, box: tuple[int, float, float], own: float, occupied: Sequence[tuple[int, float, float]]) -> bool:
        row, low, high = box
        inside = low >= LEFT and high <= self.width - RIGHT
        crossed = any(low < other.px < high for other in self._labels if other.px != own)
        return inside and not crossed and not any(r == row and low < b and a < high for r, a, b in occupied)

    def span(self, x_low: ArrayLike, x_high: ArrayLike, style: str, label: str = "") -> None:
        """Shade intervals of the horizontal axis.

        Parameters
        ----------
        x_low : float or (...) array
            Start of each interval.
        x_high : float or (...) array
            End of each interval.
        style : str
            Class of the style sheet.
        label : str
            Text on hovering.
        """
        left, right = (np.clip(np.atleast_1d(self.px(v)), LEFT, self.width - RIGHT) for v in (x_low, x_high))
        ends = np.rint(HUNDREDTHS * np.column_stack([left, right])).astype(np.int64)
        height = self.height - self.top - BOTTOM
        path = "".join(
            f"M{format_pixels(start)} {self.top}h{format_pixels(end - start)}v{height}h{format_pixels(start - end)}z"
            for start, end in ends.tolist()
            if end > start
        )
        if path:
            self.elements.append(f'<path class="{style}" data-span="" d="{path}">{_title(label)}</path>')

    def text(self, x_share: float, y_share: float, words: str, style: str = "note", anchor: str = "start") -> None:
        """Draw words in the panel.

        Parameters
        ----------
        x_share : float
            Position as a share of the width of the plot area.
        y_share : float
            Position as a share of its height, from the top.
        words : str
            The text.
        style : str
            Class of the style sheet.
        anchor : str
            End of the text that is at the position: "start", "middle" or "end".
        """
        px = LEFT + x_share * (self.width - LEFT - RIGHT)
        py = self.top + y_share * (self.height - self.top - BOTTOM)
        self.elements.append(
            f'<text class="{style}" x="{px:.1f}" y="{py:.1f}" text-anchor="{anchor}">{escape(words)}</text>'
        )

    def svg(self) -> str:
        """Text of the complete SVG element."""
        frame = (
            f'<svg class="chart" viewBox="0 0 {self.width} {self.height}" width="{self.width}" '
            f'height="{self.height}" role="img" aria-label="{escape(self.title, quote=True)}">'
        )
        title = "".join(
            f'<text class="title" x="{LEFT}" y="{16 + LINE * k}">{escape(line)}</text>'
            for k, line in enumerate(self.title_lines)
        )
        width, height = self.width - LEFT - RIGHT, self.height - self.top - BOTTOM
        window = (
            f'x="{LEFT}" y="{self.top}" width="{width}" height="{height}" '
            f'viewBox="{LEFT} {self.top} {width} {height}" data-x="{_ends(self.x)}" data-y="{_ends(self.y)}"'
        )
        body = f"<svg {window}>" + "".join(self.elements) + self._placed_labels() + "</svg>"
        return frame + title + self._axes() + body + "".join(self.outside) + "</svg>"

    def _axes(self) -> str:
        bottom, right = self.height - BOTTOM, self.width - RIGHT
        x_ticks, y_ticks = self.x.ticks(), self.y.ticks()
        px, py = self.px([v for v, _ in x_ticks]).tolist(), self.py([v for v, _ in y_ticks]).tolist()
        grid = [f"M{x:.1f} {self.top}V{bottom}" for x in px] + [f"M{LEFT} {y:.1f}H{right}" for y in py]
        elements = [
            f'<path class="frame" d="M{LEFT} {self.top}V{bottom}H{right}"/><path class="grid" d="{"".join(grid)}"/>',
            '<g class="tick x" text-anchor="middle">',
            *[
                f'<text x="{min(x, self.width - 1 - 0.5 * LETTER * len(text)):.1f}" y="{bottom + 14}">{text}</text>'
                for x, (_, text) in zip(px, x_ticks)
            ],
            '</g><g class="tick y" text-anchor="end">',
            *[f'<text x="{LEFT - 5}" y="{y + 3.5:.1f}">{text}</text>' for y, (_, text) in zip(py, y_ticks)],
            "</g>",
        ]
        middle_x, middle_y = (LEFT + right) / 2, (self.top + bottom) / 2
        elements.append(
            f'<text class="label" x="{middle_x:.0f}" y="{self.height - 6}" text-anchor="middle">'
            f"{escape(self.x.label)}</text>"
            f'<text class="label" transform="translate(13 {middle_y:.0f}) rotate(-90)" text-anchor="middle">'
            f"{escape(self.y.label)}</text>"
        )
        return "".join(elements)


def _wrap_title(title: str, n_letters: int) -> list[str]:
    """Lines of a title of at most ``n_letters`` each, at least one."""
    if len(title) <= n_letters and title.isprintable() and title == title.strip():  # the usual case
        return [title]
    return textwrap.wrap(title, n_letters) or [""]


def _visible(good: np.ndarray | bool) -> list[slice]:
    """The contiguous runs of values; none if each is a single value, of which no line can be seen."""
    pieces = runs(good)
    return pieces if any(piece.stop - piece.start > 1 for piece in pieces) else []


def _title(words: str) -> str:
    return f"<title>{escape(words)}</title>" if words else ""


def _series(name: str) -> str:
    return f' data-series="{escape(name, quote=True)}"' if name else ""


def _ends(axis: Axis) -> str:
    """Lowest and highest value of an axis, its scale and its label, for the script."""
    return escape(f"{float(axis.low):.10g} {float(axis.high):.10g} {axis.scale} {axis.label}", quote=True)
