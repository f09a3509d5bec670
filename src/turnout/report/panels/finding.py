"""Draw the panels of a finding: measured and simulated curves, fit, and history."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import Z95_EXACT
from turnout.report.axis import Axis
from turnout.report.svg import Chart

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

TITLES = {
    "waveform": "Waveform",
    "spectrum": "Power spectral density",
    "receptance": "Receptance",
    "latent": "The missing force",
}
WIDE_WIDTH = 944  # px, width of a waveform panel


def curve_panel(row: Mapping[str, Any], changed: str = "the effect") -> str:
    """SVG of one row of ``mismatch_curves``.

    Parameters
    ----------
    row : mapping
        The row.
    changed : str
        Name of the effect added in "after", "" without one.

    Returns
    -------
    str
        SVG.
    """
    if row["curve"] == "latent":
        return _latent(row)
    x = np.asarray(row["x"], dtype=float)
    names = ["measured", "before"] + (["after"] if changed else [])
    values = {name: np.asarray(row[name], dtype=float) for name in names}
    log = row["curve"] != "waveform"
    chart = Chart(_x_axis(row, x, log), _y_axis(row, values, log), _title(row),
                  width=WIDE_WIDTH if row["curve"] == "waveform" else 462, height=250)  # fmt: skip
    words = {"measured": "measured", "before": "base model", "after": f"base model with {changed}"}
    for name in names:
        chart.line(x, values[name], f"curve-{name}", words[name])
    _key(chart, names, words)
    return chart.svg()


def residual_panel(row: Mapping[str, Any], changed: str) -> str:
    """SVG of what the simulation leaves of a waveform, before and with the effect, on one axis.

    Parameters
    ----------
    row : mapping
        Row of ``mismatch_curves`` of a waveform.
    changed : str
        Name of the effect added in "after".

    Returns
    -------
    str
        SVG, "" for another curve or without an effect.
    """
    if row["curve"] != "waveform" or not changed:
        return ""
    x, measured = np.asarray(row["x"], dtype=float), np.asarray(row["measured"], dtype=float)
    left = {name: measured - np.asarray(row[name], dtype=float) for name in ("before", "after")}
    reach = 1.25 * float(np.nanmax(np.abs(np.concatenate(list(left.values()))))) or 1.0
    share = [100.0 * float(np.nansum(e**2) / np.nansum(measured**2)) for e in left.values()]
    chart = Chart(
        Axis(float(x.min()), float(x.max()), _x_label(row)),
        Axis(-reach, reach, f"residual [{row['y_unit']}]"),
        f"Residual, measured less simulated: {share[0]:.1f} % of the energy by the base model, "
        f"{share[1]:.1f} % with {changed}",
        width=WIDE_WIDTH,
        height=190,
    )
    words = {"before": "residual of the base model", "after": f"residual with {changed}"}
    for name, values in left.items():
        chart.line(x, values, f"curve-{name}", words[name])
    _key(chart, list(left), words)
    return chart.svg()


def _title(row: Mapping[str, Any]) -> str:
    label = row["label"] if row["curve"] == "waveform" else row["label"].partition(",")[0]
    return f"{TITLES[row['curve']]}: {label}"


def _x_axis(row: Mapping[str, Any], x: np.ndarray, log: bool) -> Axis:
    return Axis(float(x.min()), float(x.max()), _x_label(row), "log" if log else "linear")


def _y_axis(row: Mapping[str, Any], values: Mapping[str, np.ndarray], log: bool) -> Axis:
    """Vertical axis that contains the measured values, and the simulated ones within a limit."""
    finite = np.concatenate([v[np.isfinite(v)] for v in values.values()])
    label = {"waveform": "acceleration", "spectrum": "PSD", "receptance": "receptance"}[row["curve"]]
    if log:
        finite = finite[finite > 0.0]
        top = float(values["measured"].max())
        low = max(float(finite.min()), 1e-5 * top)
        return Axis(low / 1.3, float(finite.max()) * 3.0, f"{label} [{row['y_unit']}]", "log")
    reach = float(np.max(np.abs(finite))) * 1.25
    return Axis(-reach, reach, f"{label} [{row['y_unit']}]")


def _key(chart: Chart, names: Sequence[str], words: Mapping[str, str]) -> None:
    """Legend of the lines at the top of the panel."""
    x = 0.01
    for name in names:
        chart.text(x, 0.06, words[name], f"key-{name}")
        x += (6.2 * len(words[name]) + 16) / (chart.width - 76)


def _x_label(row: Mapping[str, Any]) -> str:
    """Quantity and unit of the horizontal axis."""
    return f"{row['x_label']} [{row['x_unit']}]" if row["x_unit"] else row["x_label"]


def _latent(row: Mapping[str, Any]) -> str:
    """SVG of the mean missing force with its 95 % limits over the covariate that explains most."""
    x, mean = np.asarray(row["x"], dtype=float), np.asarray(row["measured"], dtype=float)
    low, high = np.asarray(row["before"], dtype=float), np.asarray(row["after"], dtype=float)
    pad = 0.1 * float(np.ptp(np.concatenate([low, high]))) or 1.0
    chart = Chart(
        Axis(float(x.min()), float(x.max()), _x_label(row)),
        Axis(float(low.min()) - pad, float(high.max()) + pad, f"force [{row['y_unit']}]"),
        row["label"][:1].upper() + row["label"][1:],
        height=250,
    )
    chart.band(x, low, high, "interval", "95 % limits")
    chart.points(x, mean, "point", 2.5, low, high)
    return chart.svg()


def fit_panel(finding: Mapping[str, Any]) -> str:
    """Bars of the fit on held-out recordings: before, with the term, best rival, decoy.

    Parameters
    ----------
    finding : mapping
        Row of ``mismatch_findings``.

    Returns
    -------
    str
        SVG, "" with less than two fits to compare.
    """
    entries = [
        ("base model", finding["fit_before_pct"], "bar-before"),
        (
            "with the effect" if finding["verdict"] in ("named", "a_or_b") else "with it",
            finding["fit_after_pct"],
            "bar-after",
        ),
        ("best rival", finding["fit_rival_pct"], "bar-rival"),
        ("decoy", finding["fit_decoy_pct"], "bar-rival"),
    ]
    entries = [e for e in entries if e[1] is not None]
    if len(entries) < 2 or not finding["n_held_out"]:
        return ""
    low = min(0.0, *(max(e[1], -100.0) for e in entries))
    chart = Chart(
        Axis(0.4, len(entries) + 0.6, "", "names", tuple(e[0] for e in entries)),
        Axis(low, 112.0, "fit [%]"),  # room for the number of a bar of 100 %
        f"Fit on held-out recordings, n = {finding['n_held_out']}{_gain(finding)}",
        height=250,
    )
    for k, (_, value, style) in enumerate(entries, start=1):
        top, zero = float(chart.py(max(value, low))), float(chart.py(0.0))
        x = float(chart.px(k))
        chart.elements.append(
            f'<rect class="{style}" x="{x - 26:.1f}" y="{min(top, zero):.1f}" width="52" '
            f'height="{abs(zero - top):.1f}"/><text class="place" x="{x:.1f}" y="{min(top, zero) - 5:.1f}" '
            f'text-anchor="middle">{value:.0f} %</text>'
        )
    return chart.svg()


def _gain(finding: Mapping[str, Any]) -> str:
    """Gain of the term with half of its 95 % interval, in words; "" if unknown."""
    before, after, error = (finding.get(k) for k in ("fit_before_pct", "fit_after_pct", "fit_gain_se_pct"))
    if before is None or after is None or error is None:
        return ""
    return f": {after - before:+z.1f} ± {Z95_EXACT * error:.1f} points"


def history_of_parameter(rows: Sequence[Mapping[str, Any]]) -> str:
    """SVG of a parameter over the visits with 95 % intervals.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of ``mismatch_parameters``, the oldest first.

    Returns
    -------
    str
        SVG, "" with less than two visits.
    """
    if len(rows) < 2:
        return ""
    seconds = [r["found_at_utc"].timestamp() for r in rows]
    values = [r["value"] for r in rows]
    low = [r["value"] if r["value_low"] is None else r["value_low"] for r in rows]
    high = [r["value"] if r["value_high"] is None else r["value_high"] for r in rows]
    span, pad = max(seconds) - min(seconds), 0.1 * (max(high) - min(low)) or 1.0
    name = f"{rows[0]['term'].replace('_', ' ')}, {rows[0]['parameter']}"
    chart = Chart(
        Axis(min(seconds) - 0.05 * span - 86400, max(seconds) + 0.05 * span + 86400, "", "time"),
        Axis(min([*low, 0.0]) - pad, max(high) + pad, f"{rows[0]['parameter']} [{rows[0]['unit']}]"),
        f"{name}: {len(rows)} visits",
    )
    chart.points(np.array(seconds), np.array(values), "point", 3.0, np.array(low), np.array(high))
    return chart.svg()
