"""Draw the turnout as a diagram with its measured sections, coloured by state; hatched means unknown."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Any

WIDTH, HEIGHT = 920, 200  # px
MIN_LABEL_DISTANCE, LIFT = 42, 26  # px: nearer labels stand one above the other
HATCH = (
    '<defs><pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
    '<rect width="6" height="6" class="hatch-ground"/><path d="M0 0V6" class="hatch-line"/></pattern></defs>'
)
STYLE = {
    "confirm now": "state-confirm",
    "inspect this week": "state-inspect",
    "plan": "state-plan",
    "learning": "state-learning",
    "ok": "state-ok",
    "cannot tell": "state-unknown",
    "not measured": "state-unknown",
    "suppressed": "state-unknown",
}


def diagram(
    sections: Sequence[Mapping[str, Any]],
    states: Mapping[str, str],
    train_states: Mapping[str, str] | None = None,
) -> str:
    """SVG of the turnout with its measured sections.

    Parameters
    ----------
    sections : sequence of mapping
        Rows of ``sections`` of the turnout.
    states : mapping
        Most urgent state of the charts of hammer tests by section id: the colour of its circle.
    train_states : mapping, optional
        The same of the charts of trains: the colour of a square beside it. A section without such a chart has none.

    Returns
    -------
    str
        SVG.
    """
    positions = [s["position_m"] or 0.0 for s in sections]
    toe = 0.0  # origin of positions
    low, high = min([toe, *positions]) - 4.0, max([toe, *positions]) + 4.0

    def px(metres: float) -> float:
        return 20 + (WIDTH - 40) * (metres - low) / (high - low)

    main, spread = HEIGHT * 0.36, HEIGHT * 0.30

    def py(metres: float, diverging: bool) -> float:
        share = max(0.0, (metres - toe) / (high - toe)) if diverging else 0.0
        return main + spread * share**1.6

    curve = " ".join(f"L{px(m):.1f} {py(m, True):.1f}" for m in np.linspace(toe, high, 25))
    elements = [
        f'<svg class="diagram" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        'role="group" aria-label="Measured sections of the turnout, coloured by state">'
        f'{HATCH}<path class="rail" d="M{px(low):.1f} {main}H{px(high):.1f}"/>'
        f'<path class="rail" d="M{px(toe):.1f} {main} {curve}"/>'
    ]
    for section, lift in zip(sections, _lifts(sections, px)):
        elements.append(_section_marker(section, states, train_states or {}, px, py, lift))
    elements.append(
        f'<text class="label" x="24" y="{HEIGHT - 8}">facing direction →, metres from the switch toe</text>'
    )
    return "".join(elements) + "</svg>"


def _section_marker(
    section: Mapping[str, Any],
    states: Mapping[str, str],
    train_states: Mapping[str, str],
    px: Callable[[float], float],
    py: Callable[[float, bool], float],
    lift: int,
) -> str:
    diverging = section["track"] == "diverging"
    x, y = px(section["position_m"] or 0.0), py(section["position_m"] or 0.0, diverging)
    state = states.get(section["section_id"], "not measured")
    side = 26 + lift if diverging else -24 - lift
    end = y + side + (0 if diverging else 14)
    leader = f'<path class="event mild" d="M{x:.1f} {y:.1f}V{end:.1f}"/>' if lift else ""
    return (
        f'<a href="#{escape(section["label"])}">{leader}'
        f'<circle class="{STYLE.get(state, "state-unknown")}" cx="{x:.1f}" '
        f'cy="{y:.1f}" r="11"><title>{escape(section["label"])}, {escape(section["panel"] or "?")} panel: '
        f"{'hammer tests ' * bool(train_states)}{escape(state)}</title></circle>"
        f"{_train_mark(section, train_states, x, y + (-26 if diverging else 15))}"
        f'<text class="place" x="{x:.1f}" y="{y + side:.1f}" text-anchor="middle">{escape(section["label"])}</text>'
        f'<text class="tick" x="{x:.1f}" y="{y + side + 11:.1f}" text-anchor="middle">'
        f"{_metres(section)}</text></a>"
    )


def _train_mark(section: Mapping[str, Any], states: Mapping[str, str], x: float, top: float) -> str:
    """Square of the charts of trains, "" without one."""
    state = states.get(section["section_id"])
    if state is None:
        return ""
    return (
        f'<rect class="{STYLE.get(state, "state-unknown")}" x="{x - 5.5:.1f}" y="{top:.1f}" width="11" height="11">'
        f"<title>{escape(section['label'])}: trains {escape(state)}</title></rect>"
    )


def _metres(section: Mapping[str, Any]) -> str:
    return "" if section["position_m"] is None else f"{section['position_m']:.1f} m"


def _lifts(sections: Sequence[Mapping[str, Any]], px: Callable[[float], float]) -> list[int]:
    """Vertical shift of each label [px]: where labels are close to each other, every second one is shifted."""
    lifts: list[int] = []
    last: dict[bool, tuple[float, int]] = {}
    for section in sections:
        diverging, x = section["track"] == "diverging", px(section["position_m"] or 0.0)
        before, lifted = last.get(diverging, (-1e9, 0))
        lift = LIFT if x - before < MIN_LABEL_DISTANCE and not lifted else 0
        lifts.append(lift)
        last[diverging] = (x, lift)
    return lifts
