"""Draw small charts in SVG: axes with ticks, lines, bands, and points with error bars. They need no script.

Long curves are reduced to the points that are visible. ``data-`` attributes hold the ends of the axes and the names of
the series, from which templates/chart.js offers zoom, values and toggles.
"""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from turnout.report.formatting import escape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def linear_ticks(low: float, high: float, n_target: int = 5) -> list[float]:
    """Round numbers between ``low`` and ``high``, steps of 1, 2 or 5 times a power of ten.

    Parameters
    ----------
    low : float
        Lowest value.
    high : float
        Highest value.
    n_target : int
        Number of ticks that is aimed at.

    Returns
    -------
    list of float
        Values.

    Examples
    --------
    >>> linear_ticks(0.0, 1.0)
    [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    >>> linear_ticks(98.2, 103.9)
    [99.0, 100.0, 101.0, 102.0, 103.0]
    """
    if not high > low:
        return [low]
    raw = (high - low) / n_target
    magnitude = 10.0 ** math.floor(math.log10(raw))
    step = min((s * magnitude for s in (1, 2, 5, 10)), key=lambda s: abs(s - raw))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    decimals = max(12, 3 - math.floor(math.log10(step)))
    return [round(k * step, decimals) for k in range(first, last + 1)]


def log_ticks(low: float, high: float) -> list[float]:
    """Powers of ten between ``low`` and ``high``, with 2 and 5 where there are few.

    Parameters
    ----------
    low : float
        Lowest value, above 0.
    high : float
        Highest value.

    Returns
    -------
    list of float
        Values.

    Examples
    --------
    >>> log_ticks(30.0, 2000.0)
    [50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0]
    """
    exponents = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    decades = [10.0**k for k in exponents if low <= 10.0**k <= high]
    if len(decades) >= 3:
        return decades
    return [m * 10.0**k for k in exponents for m in (1, 2, 5) if low <= m * 10.0**k <= high]


def time_ticks(low: float, high: float, n_target: int = 6) -> list[float]:
    """Starts of months or years between two POSIX times.

    Parameters
    ----------
    low : float
        Earliest time. [s]
    high : float
        Latest time. [s]
    n_target : int
        Number of ticks that is aimed at.

    Returns
    -------
    list of float
        POSIX times. [s]

    Examples
    --------
    >>> from datetime import UTC
    >>> start = datetime(2024, 1, 10, tzinfo=UTC).timestamp()
    >>> [format_day(t) for t in time_ticks(start, start + 3 * 365.25 * 86400)]
    ['Jul 2024', 'Jan 2025', 'Jul 2025', 'Jan 2026', 'Jul 2026', 'Jan 2027']
    """
    months = (high - low) / (30.44 * 86400)
    step = next((s for s in (1, 2, 3, 6, 12, 24, 60, 120) if months / s <= n_target + 1), 120)
    epoch = datetime(1970, 1, 1)
    day = (epoch + timedelta(seconds=low)).replace(day=1, hour=0, minute=0, second=0, microsecond=0)
    ticks = []
    while (seconds := (day - epoch).total_seconds()) <= high:
        if seconds >= low and (day.year * 12 + day.month - 1) % step == 0:
            ticks.append(seconds)
        day = (day + timedelta(days=32)).replace(day=1)
    return ticks


def format_number(value: float, step: float | None = None) -> str:
    """Short text of a tick's number, with enough digits to differ from the next tick.

    Parameters
    ----------
    value : float
        The number.
    step : float or None
        Distance to the next tick.

    Returns
    -------
    str
        Text.

    Examples
    --------
    >>> format_number(0.2), format_number(1500.0), format_number(1e-9), format_number(0.0)
    ('0.2', '1500', '10⁻⁹', '0')
    >>> format_number(530.00002, step=1e-5)
    '530.00002'
    """
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(value)) + 1e-12)
    n_digits = exponent - math.floor(math.log10(step) + 1e-12) + 1 if step else 0
    if -4 <= exponent <= 4:
        return f"{value:.{max(6, n_digits)}g}"
    mantissa = value / 10.0**exponent
    power = "10" + str(exponent).translate(SUPERSCRIPTS)
    return power if abs(mantissa - 1) < 1e-9 and n_digits <= 3 else f"{mantissa:.{max(3, n_digits)}g}·{power}"


def format_day(seconds: float) -> str:
    """Month and year of a POSIX time.

    Parameters
    ----------
    seconds : float
        POSIX time. [s]

    Returns
    -------
    str
        For example "Jul 2024".
    """
    return (datetime(1970, 1, 1) + timedelta(seconds=seconds)).strftime("%b %Y")


def runs(good: np.ndarray | bool) -> list[slice]:
    """Slices of the contiguous runs of True.

    Parameters
    ----------
    good : (n,) array of bool
        Values.

    Returns
    -------
    list of slice
        One for each run.

    Examples
    --------
    >>> runs(np.array([True, True, False, True]))
    [slice(0, 2, None), slice(3, 4, None)]
    """
    good = np.atleast_1d(good)
    if good.all():  # the usual case
        return [slice(0, len(good))] if len(good) else []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(np.int8)))
    return [slice(first, last) for first, last in zip(edges[::2].tolist(), edges[1::2].tolist())]


def reduce_points(px: np.ndarray, py: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fewer points that draw the same curve: the first, last, lowest and highest of every pixel column.

    Parameters
    ----------
    px, py : (n,) array of float
        Pixels, finite, from left to right; a curve that turns back is not reduced.

    Returns
    -------
    pair of (m,) array of float
        m <= n, in the order given: at most four points for each pixel of width.

    Examples
    --------
    Two hundred points of a comb within two pixels; four draw it, as first and last of a pixel are its extremes:

    >>> px, py = reduce_points(np.linspace(0.0, 1.99, 200), np.arange(200) % 2.0)
    >>> len(px), sorted(set(py.tolist()))
    (4, [0.0, 1.0])
    """
    column = np.floor(px).astype(int)
    step = np.diff(column)
    starts = np.flatnonzero(np.concatenate([[True], step != 0]))
    if 4 * len(starts) >= len(px) or np.any(step < 0):
        return px, py
    ends = np.append(starts[1:], len(px)) - 1
    order = np.lexsort((py, column))
    indices = np.unique(np.concatenate([starts, ends, order[starts], order[ends]]))
    return px[indices], py[indices]


LEFT, RIGHT, TOP, BOTTOM = 62, 14, 26, 40  # px, margins around the plot area
LETTER, TITLE_LETTER = 6.2, 6.9  # px, mean width of a letter of a label and of a title
LINE = 13  # px, height of a further line of a title
N_AXES = 256  # axes whose ticks are remembered: those of one turnout's charts


@dataclass
class Axis:
    """Maps values to pixels; ``scale`` is "linear", "log", "time", or "names": the k-th of ``names`` at k, from 1."""

    low: float
    high: float
    label: str = ""
    scale: str = "linear"
    names: tuple = ()

    def __post_init__(self) -> None:
        if not self.high > self.low:
            pad = abs(self.low) * 0.05 or 1.0
            self.low, self.high = self.low - pad, self.high + pad

    def share(self, values: ArrayLike) -> np.ndarray:
        """Relative position of values along the axis, 0 to 1.

        Parameters
        ----------
        values : float or array
            Values.

        Returns
        -------
        array
            Position; outside 0 to 1 for values beyond the ends.
        """
        if isinstance(values, (float, int)):  # much faster than an array of one value
            if self.scale != "log":
                return np.float64((values - self.low) / (self.high - self.low))
            if values > 0.0:
                return np.float64(math.log(values / self.low) / math.log(self.high / self.low))
        values = np.asarray(values, dtype=float)
        if self.scale == "log":
            with np.errstate(divide="ignore", invalid="ignore"):
                return (np.log10(values) - np.log10(self.low)) / (np.log10(self.high) - np.log10(self.low))
        return (values - self.low) / (self.high - self.low)

    def ticks(self) -> list[tuple[float, str]]:
        """Pairs of value and text of the ticks."""
        if self.scale == "names":
            return [(k, escape(name)) for k, name in enumerate(self.names, start=1)]
        return _ticks(float(self.low), float(self.high), self.scale)


@lru_cache(maxsize=N_AXES)
def _ticks(low: float, high: float, scale: str) -> list[tuple[float, str]]:
    """Value and text of the ticks of an axis of numbers or times."""
    if scale == "time":
        middle = (low + high) / 2
        day = (datetime(1970, 1, 1) + timedelta(seconds=middle)).strftime("%Y-%m-%d")
        # an axis of a few days has no start of a month: its middle is named
        return [(t, format_day(t)) for t in time_ticks(low, high)] or [(middle, day)]
    if scale == "log":
        return [(v, format_number(v)) for v in log_ticks(low, high)]
    values = linear_ticks(low, high)
    step = values[1] - values[0] if len(values) > 1 else None
    return [(v, format_number(v, step)) for v in values]


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
        values : float or array
            Horizontal values.

        Returns
        -------
        array
            Pixels from the left.
        """
        return LEFT + self.x.share(values) * (self.width - LEFT - RIGHT)

    def py(self, values: ArrayLike) -> np.ndarray:
        """Vertical pixels of data values.

        Parameters
        ----------
        values : float or array
            Vertical values.

        Returns
        -------
        array
            Pixels from the top.
        """
        return self.height - BOTTOM - self.y.share(values) * (self.height - self.top - BOTTOM)

    def line(self, x: ArrayLike, y: ArrayLike, style: str, label: str = "") -> None:
        """Draw a polyline with gaps at missing values.

        Parameters
        ----------
        x : array of float
            Horizontal values.
        y : array of float
            Vertical values; not finite: a gap.
        style : str
            Class of the style sheet.
        label : str
            Name of the series.
        """
        px, py = self.px(x), self.py(y)
        pieces = (reduce_points(px[piece], py[piece]) for piece in runs(np.isfinite(px) & np.isfinite(py)))
        path = "".join("M" + _path_points(*piece) for piece in pieces)
        self.elements.append(f'<path class="{style}"{_series(label)} d="{path}">{_title(label)}</path>')

    def band(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, style: str, label: str = "") -> None:
        """Draw the area between two lines, with gaps at missing values.

        Parameters
        ----------
        x : array of float
            Horizontal values.
        low : array of float
            Values of the lower line.
        high : array of float
            Values of the upper line.
        style : str
            Class of the style sheet.
        label : str
            Name of the series.
        """
        px, low, high = self.px(x), self.py(low), self.py(high)
        for piece in runs(np.isfinite(px) & np.isfinite(low) & np.isfinite(high)):
            forward, (x_back, y_back) = reduce_points(px[piece], high[piece]), reduce_points(px[piece], low[piece])
            path = f"M{_path_points(*forward)}L{_path_points(x_back[::-1], y_back[::-1])}Z"
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
        x : array of float
            Horizontal values.
        y : array of float
            Vertical values; not finite: a gap.
        style : str
            Class of the style sheet.
        radius : float
            Radius of the dots. [px]
        low : array of float or None
            Lower ends of the bars.
        high : array of float or None
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
            numbers = np.column_stack([px[barred], bottom[barred], top[barred]]).ravel()
            if barred.size:
                path = "M%.2f %.2fV%.2f" * barred.size % tuple(numbers.tolist())
                self.elements.append(f'<path class="{style} bar"{_series(series)} d="{path}"/>')
        texts = [""] * len(px) if labels is None else [_title(label) for label in labels]
        dot = f'<circle class="{style}"{_series(series)} r="{radius:g}" cx="%.2f" cy="%.2f">%s</circle>'
        dots = zip(px.tolist(), py.tolist(), texts, is_finite.tolist())
        self.elements += [dot % (x, y, text) for x, y, text, is_drawn in dots if is_drawn]

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

    def span(self, x_low: float, x_high: float, style: str, label: str = "") -> None:
        """Shade an interval of the horizontal axis.

        Parameters
        ----------
        x_low : float
            Start of the interval.
        x_high : float
            End of the interval.
        style : str
            Class of the style sheet.
        label : str
            Text on hovering.
        """
        x_left, x_right = (min(max(float(self.px(v)), LEFT), self.width - RIGHT) for v in (x_low, x_high))
        if x_right > x_left:
            self.elements.append(
                f'<rect class="{style}" data-span="" x="{x_left:.1f}" y="{self.top}" width="{x_right - x_left:.1f}" '
                f'height="{self.height - self.top - BOTTOM}">{_title(label)}</rect>'
            )

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
            *[f'<text x="{x:.1f}" y="{bottom + 14}">{text}</text>' for x, (_, text) in zip(px, x_ticks)],
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


MIN_TOGETHER = 50  # points from which it is faster to write all numbers of a path together than one by one
MAX_PIXEL = 1000  # px, numbers written together are below it
TIE = 1e-6  # distance from the middle of two hundredths, within which the error of a product could turn the rounding
# Text of a number with two decimals: whole part and point, filled with null bytes in front; decimals; what follows.
NUMBER = np.dtype([("whole", "S4"), ("decimals", "S2"), ("end", "S1")])
WHOLE = np.array([f"{k}.".rjust(4, "\0") for k in range(MAX_PIXEL)], dtype="S4")
DECIMALS = np.array([f"{k:02d}" for k in range(100)], dtype="S2")
ENDS = np.array([b" ", b"L"], dtype="S1")


def _path_points(px: np.ndarray, py: np.ndarray) -> str:
    """Path data of the points: ``x y`` of each, with the letter L of a straight line between them."""
    numbers = np.empty((len(px), 2))
    numbers[:, 0], numbers[:, 1] = px, py
    text = _format_together(numbers) if len(px) >= MIN_TOGETHER else None
    return (text or "%.2f %.2fL" * len(px) % tuple(numbers.ravel().tolist()))[:-1]


def _format_together(numbers: np.ndarray) -> str | None:
    """``x yL`` of each row with two decimals; None where a number is no pixel, or so near to a tie that it may differ
    from the correctly rounded one."""
    hundredths = 100.0 * numbers
    nearest = np.rint(hundredths)
    inside = numbers.min() > 0.0 and nearest.max() < 100 * MAX_PIXEL
    if not (inside and np.abs(hundredths - nearest).max() < 0.5 - TIE):
        return None
    whole, decimals = np.divmod(nearest.astype(np.int32), 100)
    texts = np.empty(numbers.shape, NUMBER)
    texts["whole"], texts["decimals"], texts["end"] = WHOLE[whole], DECIMALS[decimals], ENDS
    return texts.tobytes().translate(None, b"\0").decode("ascii")


def _wrap_title(title: str, n_letters: int) -> list[str]:
    """Lines of a title of at most ``n_letters`` each, at least one."""
    if len(title) <= n_letters and title.isprintable() and title == title.strip():  # the usual case
        return [title]
    return textwrap.wrap(title, n_letters) or [""]


def _title(words: str) -> str:
    return f"<title>{escape(words)}</title>" if words else ""


def _series(name: str) -> str:
    return f' data-series="{escape(name, quote=True)}"' if name else ""


def _ends(axis: Axis) -> str:
    """Lowest and highest value of an axis, its scale and its label, for the script."""
    return escape(f"{float(axis.low):.10g} {float(axis.high):.10g} {axis.scale} {axis.label}", quote=True)
