"""Draw the history of one resonance: campaign values with intervals, expected band and events."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.counts import count_of
from turnout.report.axis import Axis
from turnout.report.formatting import campaign_of, seconds, student_quantile, supported_decimals, with_half_width
from turnout.report.svg import Chart

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any


@dataclass(frozen=True)
class Quantity:
    """Columns of one quantity of a mode, and how it is written.

    ``value`` and ``error`` are columns of ``modes_current``; ``low``, ``high`` those of its chart; ``recursive``
    that of ``recursive_modes``; ``history`` the limits from the history of the section, and the number of steps from
    campaign to campaign behind them. ``name`` stands behind the band, ``unit`` behind a value; ``decimals`` are those
    of a title.
    """

    value: str
    error: str
    low: str
    high: str
    recursive: str
    history: tuple[str, str, str]
    name: str = ""
    unit: str = ""
    decimals: int = 1


FREQUENCY = Quantity(
    "frequency_hz", "frequency_se_hz", "expected_low_hz", "expected_high_hz", "frequency_recursive_hz",
    ("frequency_low_hz", "frequency_high_hz", "frequency_steps"), unit=" Hz",
)  # fmt: skip
DAMPING = Quantity(
    "damping_ratio", "damping_se", "expected_low_damping", "expected_high_damping", "damping_recursive",
    ("damping_low", "damping_high", "damping_steps"), " damping", decimals=4,
)  # fmt: skip
EXPECTED = "expected at this temperature"
MEAN = "weighted mean, 180 days, not corrected for temperature"  # it follows the seasons and lags behind a change
SERIES = {"point": "campaign", "confirm": "campaign to be confirmed", "alarm": "campaign in an open alarm"}


def history_panel(
    band: str,
    modes: Sequence[Mapping[str, Any]],
    charts: Sequence[Mapping[str, Any]],
    events: Sequence[Mapping[str, Any]],
    quantity: Quantity = FREQUENCY,
    recursive: Sequence[Mapping[str, Any]] = (),
) -> str:
    """Frequency or damping ratio over time.

    Parameters
    ----------
    band : str
        Band of the resonance.
    modes : sequence of mapping
        Rows of ``modes_current`` of one section and band, with ``campaign_id``.
    charts : sequence of mapping
        Rows of its control chart, may be empty.
    events : sequence of mapping
        Rows of ``events`` that affect the section.
    quantity : Quantity
        ``FREQUENCY`` or ``DAMPING``.
    recursive : sequence of mapping
        Rows of ``recursive_modes`` of the same section and band, drawn as a line.

    Returns
    -------
    str
        SVG, "" without a value.
    """
    if not modes:
        return ""
    time = np.array([seconds(m["measured_at_utc"]) for m in modes])
    value = np.array([m[quantity.value] for m in modes])
    intervals = [interval(m, quantity) for m in modes]
    low, high = np.array([[i.low, i.high] for i in intervals], dtype=float).T
    low, high = np.where(np.isnan(low), value, low), np.where(np.isnan(high), value, high)
    expected = [c for c in charts if c[quantity.low] is not None and c[quantity.high] is not None]
    lows, highs = [c[quantity.low] for c in expected], [c[quantity.high] for c in expected]
    margin = 0.03 * (time.max() - time.min()) + 86400
    chart = Chart(
        Axis(time.min() - margin, time.max() + margin, "", "time"),
        Axis(*history_limits(low, high, lows, highs), f"{band}{quantity.name} [{quantity.unit.strip() or '-'}]"),
        f"{band}{quantity.name}: {with_half_width(value[-1], intervals[-1].half_width, quantity.decimals)}"
        f"{quantity.unit} (95 %), n = {modes[-1]['n_impacts']}; " + count_of(len(modes), "campaign"),
    )
    if expected:
        when = [seconds(c["measured_at_utc"]) for c in expected]
        chart.band(when, lows, highs, "expected", EXPECTED)
    if recursive:
        means = [r[quantity.recursive] for r in recursive]
        chart.line([seconds(r["measured_at_utc"]) for r in recursive], means, "curve", MEAN)
    for row, event in enumerate(events):
        style = "event" if event[f"resets_{band}"] else "event mild"
        chart.vertical(seconds(event["event_at_utc"]), style, event["kind"].replace("_", " "), row % 3)
    labels = [
        f"{campaign_of(m)}: {_number(m, FREQUENCY, 2)} Hz{_of(i, quantity is FREQUENCY)}, damping "
        f"{_number(m, DAMPING, 4)}{_of(i, quantity is DAMPING)}, n = {m['n_impacts']}, "
        f"{_temperature(m['rail_temperature_c'])}"
        for m, i in zip(modes, intervals)
    ]
    styles = _point_styles(modes, charts)
    for style in (style for style in SERIES if style in styles):
        some, series = np.flatnonzero(np.array(styles) == style), SERIES[style]
        chart.points(time[some], value[some], style, 3.0, low[some], high[some], [labels[i] for i in some], series)
    return chart.svg()


def history_limits(
    low: np.ndarray, high: np.ndarray, lows: Sequence[float], highs: Sequence[float]
) -> tuple[float, float]:
    """Ends of the vertical axis: all campaigns with their intervals, and the usual range that was expected.

    The range that is expected of a campaign with a large error may be much wider. Beyond one span of the campaigns it
    is cut off. No frequency, damping ratio or peak acceleration is below 0.

    Parameters
    ----------
    low, high : (n,) array of float
        Limits of the intervals of the campaigns.
    lows, highs : (m,) sequence of float
        Limits of the expected ranges, may be empty.

    Returns
    -------
    (float, float)

    Examples
    --------
    >>> ends = history_limits(np.array([98.0]), np.array([102.0]), [95.0, 97.0, -200.0], [105.0, 103.0, 400.0])
    >>> [round(end, 2) for end in ends]
    [93.04, 106.96]
    """
    lowest, highest = low.min(), high.max()
    if lows:
        span = highest - lowest
        lowest, highest = (
            min(lowest, max(min(lows), lowest - span), np.median(lows)),
            max(highest, min(max(highs), highest + span), np.median(highs)),
        )
    # a single value without an error still gets an axis of 2 % with short numbers at its ticks
    pad = max(0.08 * (highest - lowest), 0.01 * highest - 0.5 * (highest - lowest))
    return float(max(lowest - pad, 0.0)), float(highest + pad)


def _point_styles(modes: Sequence[Mapping[str, Any]], charts: Sequence[Mapping[str, Any]]) -> list[str]:
    """Style of each value: in alarm, far outside its expected value, or neither.

    The campaign of a value is the last one that began before it, for one may last two days.
    """
    if not charts:
        return ["point"] * len(modes)
    rows = sorted(charts, key=lambda c: c["measured_at_utc"])
    began = np.array([seconds(c["measured_at_utc"]) for c in rows])
    of = np.searchsorted(began, [seconds(m["measured_at_utc"]) for m in modes], side="right") - 1
    return [_style(rows[k]) if k >= 0 else "point" for k in of.tolist()]


def _style(row: Mapping[str, Any]) -> str:
    if row["state"].startswith("alarm"):
        return "alarm"
    return "point" if row.get("deviation_pct") is None else "confirm"


@dataclass(frozen=True)
class Interval:
    """95 % interval of one campaign value; ``steps`` from campaign to campaign behind it, 0 where it is the campaign's.

    Without a standard error its limits are nan.
    """

    low: float
    high: float
    steps: int = 0

    @property
    def half_width(self) -> float | None:
        """Half of its width, None without limits."""
        return 0.5 * (self.high - self.low) if math.isfinite(self.high) else None


def interval(mode: Mapping[str, Any], quantity: Quantity) -> Interval:
    """The interval by which campaigns of a section are compared, where it has no history that of the campaign.

    Parameters
    ----------
    mode : mapping
        Row of ``modes`` of the page.
    quantity : Quantity
        ``FREQUENCY`` or ``DAMPING``.

    Returns
    -------
    Interval
        From the view ``mode_intervals``, else Student's t times the standard error of the campaign.
    """
    low, high, steps = (mode.get(column) for column in quantity.history)
    if low is not None and high is not None and steps is not None:
        return Interval(low, high, steps)
    value, error, n = mode[quantity.value], mode[quantity.error], mode["n_impacts"]
    half = np.nan if not error or n < 2 else student_quantile(n) * error
    return Interval(value - half, value + half)


def _number(mode: Mapping[str, Any], quantity: Quantity, decimals: int) -> str:
    """A value to the decimals that its interval leaves; ``decimals`` without one."""
    return f"{mode[quantity.value]:.{supported_decimals(interval(mode, quantity).half_width, decimals)}f}"


def _of(of_campaign: Interval, is_shown: bool) -> str:
    """The interval of the quantity that is shown, with a space before it."""
    return f" {_words(of_campaign)}" if is_shown else ""


def _words(of_campaign: Interval) -> str:
    """Half width of an interval, and where it comes from."""
    half = of_campaign.half_width
    if half is None:
        return "± unknown"
    return f"± {half:.2g} (95 %{f', from {of_campaign.steps} differences' if of_campaign.steps else ''})"


def _temperature(value: float | None) -> str:
    return "no temperature" if value is None else f"{value:.0f} °C"
