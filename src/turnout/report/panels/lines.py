"""Draw the lines of the network with their turnouts by kilometre, coloured by state."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from turnout.report.axis import format_number, linear_ticks
from turnout.report.panels.diagram import STYLE
from turnout.report.svg import LETTER

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from typing import Any

WIDTH, LEFT, RIGHT = 960, 20, 40  # px
LANE = 22  # px between rows in which turnouts close to each other are drawn
RADIUS = 7  # px
LABEL_ROWS, LABEL_LINE = 2, 13  # rows of ids above a line, and px between them
URGENT = ("confirm now", "inspect this week", "plan")


def line_diagrams(turnouts: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One drawing for each line that has a turnout with a kilometre, the line with the most urgent turnouts first.

    Parameters
    ----------
    turnouts : sequence of mapping
        With ``turnout_id``, ``name``, ``line``, ``km`` and ``worst``, the most urgent state.

    Returns
    -------
    list of dict
        ``line``, ``n`` and ``n_urgent`` numbers of turnouts, and ``svg``.
    """
    by_line: dict[str, list[Mapping[str, Any]]] = {}
    for turnout in turnouts:
        if turnout["km"] is not None:
            by_line.setdefault(turnout["line"] or "no line given", []).append(turnout)
    drawings = [
        {
            "line": line,
            "n": len(members),
            "n_urgent": sum(t["worst"] in URGENT for t in members),
            "svg": _drawing(line, members),
        }
        for line, members in sorted(by_line.items())
    ]
    return sorted(drawings, key=lambda d: -d["n_urgent"])


def _drawing(line: str, turnouts: Sequence[Mapping[str, Any]]) -> str:
    """SVG of one line: its turnouts above the kilometres, those close to each other in lanes."""
    ordered = sorted(turnouts, key=lambda t: (t["km"], t["turnout_id"]))
    low, high = ordered[0]["km"], ordered[-1]["km"]
    margin = 0.03 * (high - low) or 0.5
    low, high = low - margin, high + margin

    def px(km: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (km - low) / (high - low)

    lanes = _lanes([px(t["km"]) for t in ordered])
    names = list(_names(ordered, px))
    rail = LANE * max(lanes) + 30 + LABEL_LINE * max(row for _, row in names)
    elements = [
        f'<svg class="diagram" viewBox="0 0 {WIDTH} {rail + 34}" width="{WIDTH}" height="{rail + 34}" role="group" '
        f'aria-label="Turnouts of {escape(line, quote=True)} by kilometre">'
        f'<path class="rail" d="M{LEFT} {rail}H{WIDTH - RIGHT}"/>'
    ]
    elements += _kilometres(low, high, px, rail)
    elements += [text for text, _ in names]
    elements += [_circle(turnout, px(turnout["km"]), rail - LANE * lane) for turnout, lane in zip(ordered, lanes)]
    return "".join(elements) + "</svg>"


def _kilometres(low: float, high: float, px: Callable[[float], float], rail: float) -> Iterator[str]:
    """Ticks of the line with their kilometres."""
    ticks = linear_ticks(low, high, 8)
    step = ticks[1] - ticks[0] if len(ticks) > 1 else None
    for tick in ticks:
        yield (
            f'<path class="frame" d="M{px(tick):.0f} {rail + 3}v5"/><text class="tick" x="{px(tick):.0f}" '
            f'y="{rail + 20}" text-anchor="middle">{format_number(tick, step)}</text>'
        )
    yield f'<text class="label" x="{WIDTH}" y="{rail + 20}" text-anchor="end">km</text>'


def _names(turnouts: Sequence[Mapping[str, Any]], px: Callable[[float], float]) -> Iterator[tuple[str, int]]:
    """Ids above the line with their rows, the most urgent first; left out are those for which no row has room."""
    occupied: list[list[tuple[float, float]]] = [[] for _ in range(LABEL_ROWS)]
    for turnout in sorted(turnouts, key=lambda t: URGENT.index(t["worst"]) if t["worst"] in URGENT else len(URGENT)):
        half = 0.5 * LETTER * len(turnout["turnout_id"])
        x = min(max(px(turnout["km"]), half), WIDTH - half)
        for row, ids in enumerate(occupied):
            if all(abs(x - centre) > half + width + 4.0 for centre, width in ids):
                position = f'x="{x:.1f}" y="{11 + LABEL_LINE * row}" text-anchor="middle"'
                yield f'<text class="place" {position}>{escape(turnout["turnout_id"])}</text>', row
                ids.append((x, half))
                break


def _circle(turnout: Mapping[str, Any], x: float, y: float) -> str:
    """A turnout as a circle with its state, a link to its page."""
    words = escape(f"{turnout['turnout_id']}, km {turnout['km']:.3f}: {turnout['worst']}")
    return (
        f'<a href="turnouts/{escape(turnout["turnout_id"], quote=True)}.html">'
        f'<circle class="{STYLE.get(turnout["worst"], "state-unknown")}" cx="{x:.1f}" '
        f'cy="{y}" r="{RADIUS}"><title>{words}</title></circle></a>'
    )


def _lanes(positions: Sequence[float]) -> list[int]:
    """Row of each turnout, 0 on the rail: the first where it lies on no other."""
    ends: list[float] = []
    lanes = []
    for x in positions:
        lane = next((k for k, end in enumerate(ends) if x - end >= 2 * RADIUS + 2), len(ends))
        ends[lane : lane + 1] = [x]
        lanes.append(lane)
    return lanes
