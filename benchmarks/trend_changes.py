"""Coverage of the intervals for date and size of a change, on simulated fleets with season and temperature.

Part of ``python -m benchmarks trend``: one bar per shape, size, spacing and autocorrelation, and their means.
"""

import numpy as np

from benchmarks.bar import Bar
from benchmarks.trend_fleet import START, Fleet, drift, modes, step
from turnout.config.settings.trend import TrendSettings
from turnout.trend import candidates, chart_status, describe_flagged, evaluate
from turnout.trend.times import days, timestamps

SETTINGS = TrendSettings()
KINDS = {"step": step, "drift": drift}
# Shape, percent (a year), weeks before the end, weeks between campaigns, autocorrelation, missing share.
CASES = [
    ("drift", -10.0, 33, 5, 0.0, 0.0), ("drift", -6.0, 43, 5, 0.3, 0.0), ("drift", -3.0, 58, 5, 0.0, 0.1),
    ("drift", -3.0, 58, 5, 0.4, 0.0), ("drift", -2.0, 60, 1, 0.4, 0.15), ("step", -2.0, 33, 5, 0.0, 0.0),
    ("step", -3.0, 23, 5, 0.4, 0.1), ("step", -1.5, 40, 1, 0.4, 0.15), ("step", -3.0, 12, 1, 0.2, 0.0),
]  # fmt: skip


def bars(turnouts=250):
    """Coverage of the 95 % intervals among the charts in alarm, the only ones that report a change."""
    shares = {"onset": [], "size": []}
    for number, case in enumerate(CASES):
        coverage = interval_coverage(*case, turnouts, 400 + number)
        shape, size, before, every, phi, missing = case
        about = f"{shape} {size:g} %{'/a' if shape == 'drift' else ''}, {before} weeks ago, a campaign every {every}, "
        about += f"phi {phi}, {missing:.0%} missing"
        for name in shares:
            shares[name].append(coverage[name])
            yield Bar(f"95 % interval of the {name}, {about}", coverage[name], None, "", "", f"n = {coverage['n']}",
                      f"median width {coverage[f'{name} width']}, kind right {coverage['kind']:.2f}")  # fmt: skip
    for name, values in shares.items():
        mean = float(np.mean(values))
        yield Bar(
            f"95 % interval of the {name}, mean of the cases, at least", mean, 0.93, "", ">=", f"{len(CASES)} cases"
        )
        yield Bar(
            f"95 % interval of the {name}, mean of the cases, at most", mean, 0.97, "", "<=", f"{len(CASES)} cases"
        )


def interval_coverage(shape, percent, before, every, phi, missing, turnouts, seed):
    """Share of intervals that cover the truth among the charts in alarm of one case, and their widths."""
    fleet = Fleet(turnouts=turnouts, weeks=120, phi=phi, every=every, missing=missing)
    which = np.zeros((turnouts, fleet.sections), dtype=bool)
    which[:, 0] = True
    start = fleet.weeks - before - 0.5  # between two campaigns
    change = KINDS[shape](fleet, which, percent, start)
    charts = evaluate(modes(fleet, seed, change), None, SETTINGS)
    status = chart_status(charts, SETTINGS)
    alarms = describe_flagged(status, candidates(charts, status, SETTINGS), SETTINGS)
    alarms = alarms[alarms["section_id"].str.endswith("/S0").to_numpy() & (alarms["state"] == "alarm").to_numpy()]
    since = timestamps(days([START]) + 7.0 * start)[0]
    last = ((alarms["last_measured_at_utc"] - START) / np.timedelta64(7, "D")).to_numpy()
    truth = percent * (last - start) / 52.18 if shape == "drift" else np.full(len(alarms), percent)
    onset = (alarms["since_earliest_utc"] <= since) & (since <= alarms["since_latest_utc"])
    size = (alarms["change_low_pct"] <= truth) & (truth <= alarms["change_high_pct"])
    width = (alarms["since_latest_utc"] - alarms["since_earliest_utc"]).median() / np.timedelta64(1, "D")
    return {
        "n": len(alarms), "onset": float(onset.mean()), "size": float(size.mean()), "onset width": f"{width:.0f} d",
        "size width": f"{(alarms['change_high_pct'] - alarms['change_low_pct']).median():.2f} %",
        "kind": float((alarms["change_kind"] == shape).mean()),
    }  # fmt: skip
