"""Draw the calibrated model: each parameter along the track, with its prior and the interval that the visits narrow."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import Z95
from turnout.counts import count_of
from turnout.report.axis import Axis
from turnout.report.svg import Chart

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    States = Sequence[Mapping[str, Any]]


# Beginning of the names of one kind of parameter -> words of the axis, and whether its values are logarithms of factors
KINDS = {
    "ballast": ("ballast stiffness over file", True),
    "pad": ("pad stiffness over file", True),
    "sleeper": ("sleeper mass over file", True),
    "cast_bending": ("bending stiffness of the casting over file", True),
    "gain": ("gain of the sensor less file", False),
    "seat": ("position of the sensor less file [m]", False),
}
MIN_POINTS = 2  # a kind with fewer positions is left out


def calibrated_panels(states: States) -> str:
    """SVG of each kind of parameter along the track, and of how the intervals narrow from visit to visit.

    Parameters
    ----------
    states : sequence of mapping
        Rows of ``twin_states`` of one turnout, of all visits.

    Returns
    -------
    str
        "" without a state.
    """
    return "".join(panel(states) for panel in CALIBRATED_PANELS)


def along_track_panels(states: States, width: int = 462) -> str:
    """Values of the newest visit with their 95 % intervals; shaded is that of the file.

    Parameters
    ----------
    states : sequence of mapping
        Rows of ``twin_states`` of one turnout, of all visits.
    width : int
        Width of a panel. [px]

    Returns
    -------
    str
        One SVG per kind of parameter, "" without a state.
    """
    newest = _newest(states)
    return "".join(
        _kind_panel(words, is_factor, of_kind, width)
        for kind, (words, is_factor) in KINDS.items()
        if len(of_kind := _of_kind(newest, kind)) >= MIN_POINTS
    )


def visits_in_words(states: States) -> str:
    """How many visits the newest values rest on, and how many of those with a diagnosis were left out.

    Parameters
    ----------
    states : sequence of mapping
        Rows of ``twin_states`` of one turnout, of all visits.

    Returns
    -------
    str
        "" without a state.
    """
    if not states:
        return ""
    newest = max(states, key=lambda s: s["found_at_utc"])
    n, n_known = newest["n_visits"], len({s["visit"] for s in states})
    left_out = f" ({n_known - n} left out)" if n_known > n else ""
    return f"the {count_of(n, 'visit')} without an open finding or an unexpected change{left_out}"


def _newest(states: States) -> list[Mapping[str, Any]]:
    """The newest state of each parameter: sections are calibrated in groups, and not all at each visit."""
    newest: dict[str, Mapping[str, Any]] = {}
    for row in sorted(states, key=lambda s: s["found_at_utc"]):
        newest[row["parameter"]] = row
    return list(newest.values())


def _of_kind(states: States, kind: str) -> list[Mapping[str, Any]]:
    chosen = [s for s in states if s["position_m"] is not None and _kind_of(s["parameter"]) == kind]
    return sorted(chosen, key=lambda s: s["position_m"])


def _kind_of(parameter: str) -> str:
    """Name before the position or the sensor.

    >>> [_kind_of(name) for name in ("pad@18.00", "diverging pad@18.00", "gain_A8_web", "cast_bending@3.36")]
    ['pad', 'pad', 'gain', 'cast_bending']
    """
    name = parameter.split(" ")[-1]
    return name.partition("@")[0] if "@" in name else name.partition("_")[0]


def _kind_panel(words: str, is_factor: bool, states: States, width: int) -> str:
    x, mean, sd, prior = (
        np.array([s[name] for s in states], dtype=float) for name in ("position_m", "value", "sd", "prior_sd")
    )
    scaled = np.exp if is_factor else np.asarray
    low, high = scaled(mean - Z95 * sd), scaled(mean + Z95 * sd)
    prior_low, prior_high = scaled(-Z95 * prior), scaled(Z95 * prior)
    lowest, highest = min(low.min(), prior_low.min()), max(high.max(), prior_high.max())
    pad = 0.06 * (highest - lowest)
    chart = Chart(
        Axis(x.min() - 0.6, x.max() + 0.6, "position [m]"),
        Axis(lowest - pad, highest + pad, words),
        f"{words}; {count_of(states[-1]['n_visits'], 'visit')}, {count_of(states[-1]['n_recordings'], 'recording')}",
        width=width,
    )
    chart.band(x, prior_low, prior_high, "expected", "95 % of the file's tolerance")
    labels = [
        f"{s['parameter']}: {v:.3g} ({a:.3g} to {b:.3g}, 95 %), visit {s['visit']}"
        for s, v, a, b in zip(states, scaled(mean), low, high)
    ]
    far = (low > prior_high) | (high < prior_low)
    for style, chosen in (("point", ~far), ("alarm", far)):
        some = np.flatnonzero(chosen)
        chart.points(x[some], scaled(mean)[some], style, 3.0, low[some], high[some], [labels[i] for i in some])
    return chart.svg()


def narrowing_panel(states: States, width: int = 462) -> str:
    """Standard deviation over that of the file by the number of visits, the median of each kind of parameter.

    Parameters
    ----------
    states : sequence of mapping
        Rows of ``twin_states`` of one turnout, of all visits.
    width : int
        Width. [px]

    Returns
    -------
    str
        SVG, "" with states of fewer than two numbers of visits.
    """
    visits = sorted({s["n_visits"] for s in states})
    if len(visits) < 2:
        return ""
    chart = Chart(
        Axis(visits[0] - 0.5, visits[-1] + 0.5, "visits used"),
        Axis(0.0, 1.05, "standard deviation over that of the file"),
        "how the visits narrow the calibrated model (median of each kind)",
        width=width,
    )
    for kind in KINDS:
        of_kind = [s for s in states if _kind_of(s["parameter"]) == kind]
        by_count = [[s["sd"] / s["prior_sd"] for s in of_kind if s["n_visits"] == n] for n in visits]
        ratio = np.array([np.median(values) if values else np.nan for values in by_count])
        if np.any(np.isfinite(ratio)):
            chart.line(visits, ratio, f"curve kind-{kind}", kind.replace("_", " "))
            last = int(np.flatnonzero(np.isfinite(ratio))[-1])
            chart.points([visits[last]], [ratio[last]], "point", 3.0, labels=[f"{kind}: {ratio[last]:.2f}"])
    return chart.svg()


# Each function returns SVG, "" where there is nothing to draw. The page shows them in this order.
CALIBRATED_PANELS = (along_track_panels, narrowing_panel)
