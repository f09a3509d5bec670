"""Run charts whose change is as large as the chart says it detects: the share that raises an alarm within a year."""

import numpy as np

from benchmarks.bar import Bar
from benchmarks.trend_fleet import Fleet, modes, step
from turnout.config.settings.trend import TrendSettings
from turnout.trend import chart_status, evaluate

SETTINGS = TrendSettings()
DAYS = {"weekly": 7.0, "28 d": 28.0, "46 d": 46.0}
YEAR = 365.25


def share_seen(days, campaign, phi, turnouts=100, seed=900, settings=SETTINGS, **more):
    """Share of changed charts that raise an alarm within a year, and their number.

    The first section of each turnout loses its own ``detectable_pct``, half a year after the baseline. ``phi`` is
    the autocorrelation from campaign to campaign.
    """
    every = days / 7.0
    fleet = Fleet(turnouts=turnouts, weeks=160, every=every, phi=phi ** (1.0 / every), campaign=campaign, **more)
    charts = evaluate(modes(fleet, seed), None, settings)
    shape = (turnouts, fleet.sections)
    detectable = chart_status(charts, settings)["detectable_pct"].to_numpy()[: fleet.charts].reshape(shape)
    complete = charts.prepared.baseline.inside[: fleet.charts]
    start = int(np.flatnonzero(complete.any(axis=0))[-1]) + 1 + round(182.0 / days)
    which = np.zeros(shape)
    which[:, 0] = detectable[:, 0]
    changed = evaluate(modes(fleet, seed, step(fleet, which, -1.0, start * every)), None, settings)
    opened = changed.down_open[: fleet.charts].reshape(*shape, -1)[:, 0]
    seen = opened[:, start : start + round(YEAR / days)].any(axis=1)[~opened[:, start - 1]]
    return float(seen.mean()), int(seen.size)


def bars(turnouts=300):
    """Share seen, by interval, with and without a campaign effect."""
    for name, days in DAYS.items():
        for campaign in (0.0, 0.6):
            shares = [share_seen(days, campaign, phi, turnouts) for phi in (0.0, 0.2, 0.4)]
            words = ", ".join(f"phi {phi} {share:.3f}" for phi, (share, _) in zip((0.0, 0.2, 0.4), shares))
            value, n = np.mean([s for s, _ in shares]), sum(n for _, n in shares)
            about = f"detectable change seen within a year, {name}, campaign effect {campaign} %"
            yield Bar(about, float(value), 0.88, "", ">=", f"n = {n}", words)
            yield Bar(f"{about}, not understated", float(value), 0.93, "", "<=", f"n = {n}")
        for curvature in (0.0, -0.005):  # %/°C²; sections without siblings, which fit it
            shares = [
                share_seen(days, 0.6, phi, turnouts + 100, 901, sections=2, curvature=curvature)
                for phi in (0.0, 0.2, 0.4)
            ]
            value, n = np.mean([s for s, _ in shares]), sum(n for _, n in shares)
            about = f"the same, turnouts of two sections, law curved by {curvature} %/°C², {name}"
            yield Bar(about, float(value), 0.88, "", ">=", f"n = {n}")
            yield Bar(f"{about}, not understated", float(value), 0.93, "", "<=", f"n = {n}")
