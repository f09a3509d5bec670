"""Draw the calibrated model: each parameter along the track, with its prior and the interval that the visits narrow."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import Z95
from turnout.counts import count_of
from turnout.report.axis import Axis
from turnout.report.svg import Chart

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
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
# Kind -> the parameter that all its components share, by which the value of each is multiplied
COMMON = {"ballast": "ballast_stiffness", "pad": "pad_stiffness"}  # not that of masses, which has errors beyond its sd
TRACK_KINDS = ("ballast", "pad", "sleeper", "cast_bending")
HALF_BAY = 0.3  # m beyond the outer components of a visit, where no other one fits
SERIES = {"cast_bending": "casting", "gain": "sensor gain", "seat": "sensor position"}  # others by their kind
DEPTH = "ln depth of "  # begin of the name of the depth of a nose or a joint, behind its route
DAY = 86400.0  # s


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
        _kind_panel(words, is_factor, of_kind, width, _common_words(newest, kind))
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
    words = f"{count_of(n, 'visit')}"
    if n_known <= n:
        return words
    return (
        f"{words} ({n_known - n} left out: an open finding, an unexpected change, or fitted with another version of "
        "the tool, track file or settings)"
    )


def _newest(states: States) -> list[Mapping[str, Any]]:
    """The newest state of each parameter: sections are calibrated in groups, and not all at each visit.

    A component between those of a newer visit that does not have it is no longer in the track file.
    """
    newest: dict[str, Mapping[str, Any]] = {}
    covered: list[tuple[tuple[str, str], float, float]] = []  # stretches of newer visits: route and kind, ends [m]
    for _, of_visit in groupby(sorted(states, key=_order, reverse=True), _order):
        rows = list(of_visit)
        newest = {r["parameter"]: r for r in rows if not _is_within(r, covered)} | newest
        covered += _stretches(rows)
    return list(newest.values())


def _order(row: Mapping[str, Any]) -> tuple[Any, ...]:
    """Time, visit and finding of a state."""
    return row["found_at_utc"], row["visit"], row.get("finding_id") or ""


def _stretches(rows: States) -> list[tuple[tuple[str, str], float, float]]:
    """(route and kind) and ends of the stretch of the components of the track in the states after one visit."""
    positions: dict[tuple[str, str], list[float]] = {}
    for row in rows:
        route_and_kind = _route_of(row["parameter"]), _kind_of(row["parameter"])
        if row["position_m"] is not None and route_and_kind[1] in TRACK_KINDS:
            positions.setdefault(route_and_kind, []).append(row["position_m"])
    return [(of, min(at) - HALF_BAY, max(at) + HALF_BAY) for of, at in positions.items()]


def _is_within(row: Mapping[str, Any], stretches: Iterable[tuple[tuple[str, str], float, float]]) -> bool:
    of, at = (_route_of(row["parameter"]), _kind_of(row["parameter"])), row["position_m"]
    return at is not None and any(of == other and low <= at <= high for other, low, high in stretches)


def _route_of(parameter: str) -> str:
    """Route of a component, "" of the main one.

    >>> [_route_of(name) for name in ("pad@18.00", "diverging pad@18.00")]
    ['', 'diverging']
    """
    return parameter.partition("@")[0].rpartition(" ")[0]


def _common_words(newest: States, kind: str) -> str:
    """The factor that all components of a kind share, "" without one."""
    name = COMMON.get(kind)
    row = next((s for s in newest if name and s["parameter"].split(" ")[-1] == name), None)
    if row is None:
        return ""
    value, low, high = np.exp(row["value"] + Z95 * row["sd"] * np.array([0.0, -1.0, 1.0]))
    return f"; multiply by {value:.3g} ({low:.3g} to {high:.3g}, 95 %), common to all"


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


def _kind_panel(words: str, is_factor: bool, states: States, width: int, common: str = "") -> str:
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
        f"{words}; {count_of(states[-1]['n_visits'], 'visit')}, {count_of(states[-1]['n_recordings'], 'recording')}"
        + common,
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


def depth_panels(states: States, width: int = 462) -> str:
    """Depth of each nose and joint after each visit with its 95 % interval; shaded is that of the file.

    Parameters
    ----------
    states : sequence of mapping
        Rows of ``twin_states`` of one turnout, of all visits.
    width : int
        Width of a panel. [px]

    Returns
    -------
    str
        One SVG per nose or joint, "" without one.
    """
    by_name: dict[str, dict[str, Mapping[str, Any]]] = {}
    for row in sorted(states, key=lambda s: s["found_at_utc"]):
        if DEPTH in row["parameter"]:
            by_name.setdefault(row["parameter"], {})[row["visit"]] = row
    return "".join(_depth_panel(name, list(rows.values()), width) for name, rows in by_name.items())


def _depth_panel(name: str, states: States, width: int) -> str:
    time = np.array([s["found_at_utc"].timestamp() for s in states])
    mean, sd, prior = (np.array([s[key] for s in states], dtype=float) for key in ("value", "sd", "prior_sd"))
    value, low, high = np.exp(mean), np.exp(mean - Z95 * sd), np.exp(mean + Z95 * sd)
    prior_low, prior_high = np.exp(-Z95 * prior), np.exp(Z95 * prior)
    margin = 0.05 * (time[-1] - time[0]) + 30 * DAY
    ends = np.array([time[0] - margin, time[-1] + margin])
    words = f"{name.replace('ln ', '', 1)} over file"
    chart = Chart(
        Axis(float(ends[0]), float(ends[1]), "", "time"),
        Axis(0.9 * min(low.min(), prior_low.min()), 1.05 * max(high.max(), prior_high.max()), "depth over file"),
        f"{words}, after each visit",
        width=width,
    )
    chart.band(ends, prior_low[[0, -1]], prior_high[[0, -1]], "expected", "95 % of the file's tolerance")
    labels = [
        f"{words}: {v:.3g} ({a:.3g} to {b:.3g}, 95 %), visit {s['visit']}"
        for s, v, a, b in zip(states, value, low, high)
    ]
    chart.points(time, value, "point", 3.0, low, high, labels)
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
        of_kind = _of_kind(states, kind)
        by_count = [[s["sd"] / s["prior_sd"] for s in of_kind if s["n_visits"] == n] for n in visits]
        ratio = np.array([np.median(values) if values else np.nan for values in by_count])
        if np.any(np.isfinite(ratio)):
            chart.line(visits, ratio, f"curve kind-{kind}", SERIES.get(kind, kind))
            last = int(np.flatnonzero(np.isfinite(ratio))[-1])
            chart.points(
                [visits[last]], [ratio[last]], "point", 3.0, labels=[f"{SERIES.get(kind, kind)}: {ratio[last]:.2f}"]
            )
    return chart.svg()


# Each function returns SVG, "" where there is nothing to draw. The page shows them in this order.
CALIBRATED_PANELS = (along_track_panels, depth_panels, narrowing_panel)
