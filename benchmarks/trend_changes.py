"""Coverage of the intervals for date and size of a change, on simulated fleets with season and temperature.

Part of ``python -m benchmarks trend``: one bar per shape, size, spacing and autocorrelation, and their means.
"""

import numpy as np

from benchmarks.bar import Bar
from benchmarks.trend_fleet import START, Fleet, drift, modes, step
from turnout.config.settings.trend import TrendSettings
from turnout.trend import candidates, chart_status, describe_flagged, evaluate
from turnout.trend.panel import days, timestamps

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
    held = {"onset": [], "size": []}
    for number, case in enumerate(CASES):
        found = covered(*case, turnouts, 400 + number)
        kind, size, before, every, phi, missing = case
        about = f"{kind} {size:g} %{'/a' if kind == 'drift' else ''}, {before} weeks ago, a campaign every {every}, "
        about += f"phi {phi}, {missing:.0%} missing"
        for name in held:
            held[name].append(found[name])
            yield Bar(f"95 % interval of the {name}, {about}", found[name], None, "", "", f"n = {found['n']}",
                      f"median width {found[f'{name} width']}, kind right {found['kind']:.2f}")  # fmt: skip
    for name, values in held.items():
        mean = float(np.mean(values))
        yield Bar(
            f"95 % interval of the {name}, mean of the cases, at least", mean, 0.93, "", ">=", f"{len(CASES)} cases"
        )
        yield Bar(
            f"95 % interval of the {name}, mean of the cases, at most", mean, 0.97, "", "<=", f"{len(CASES)} cases"
        )


def covered(kind, percent, before, every, phi, missing, turnouts, seed):
    """Share of intervals that cover the truth among the charts in alarm of one case, and their widths."""
    fleet = Fleet(turnouts=turnouts, weeks=120, phi=phi, every=every, missing=missing)
    which = np.zeros((turnouts, fleet.sections), dtype=bool)
    which[:, 0] = True
    start = fleet.weeks - before - 0.5  # between two campaigns
    change = KINDS[kind](fleet, which, percent, start)
    charts = evaluate(modes(fleet, seed, change), None, SETTINGS)
    status = chart_status(charts, SETTINGS)
    told = describe_flagged(status, candidates(charts, status, SETTINGS), SETTINGS)
    told = told[told["section_id"].str.endswith("/S0").to_numpy() & (told["state"] == "alarm").to_numpy()]
    since = timestamps(days([START]) + 7.0 * start)[0]
    last = ((told["last_measured_at_utc"] - START) / np.timedelta64(7, "D")).to_numpy()
    truth = percent * (last - start) / 52.18 if kind == "drift" else np.full(len(told), percent)
    onset = (told["since_earliest_utc"] <= since) & (since <= told["since_latest_utc"])
    size = (told["change_low_pct"] <= truth) & (truth <= told["change_high_pct"])
    width = (told["since_latest_utc"] - told["since_earliest_utc"]).median() / np.timedelta64(1, "D")
    return {
        "n": len(told), "onset": float(onset.mean()), "size": float(size.mean()), "onset width": f"{width:.0f} d",
        "size width": f"{(told['change_high_pct'] - told['change_low_pct']).median():.2f} %",
        "kind": float((told["change_kind"] == kind).mean()),
    }  # fmt: skip
