"""The page of the fleet counts charts with a first baseline and charts that learn after maintenance separately."""

import pandas as pd
from benchmarks.trend_fleet import Fleet, modes
from tests.oracles.trend_views import connect_views

from turnout.report.source import FleetSource
from turnout.trend import candidates, chart_rows, chart_status, describe_flagged, evaluate
from turnout.trend.tables import alarm_rows, baseline_rows


def source_of(weeks, settings, tamped=None):
    """Rows of one turnout with eight sections and weekly campaigns."""
    rows = modes(Fleet(turnouts=1, weeks=weeks, phi=0.1), 3)
    rows = rows.astype({k: object for k in ("turnout_id", "section_id", "band", "source")})
    newest = rows["measured_at_utc"].max()
    events = None
    if tamped is not None:
        at = newest - pd.Timedelta(weeks=tamped)
        events = pd.DataFrame({
            "event_id": ["e"], "turnout_id": rows["turnout_id"].iloc[:1].to_numpy(), "section_id": [None],
            "event_at_utc": [at], "kind": ["tamping"], "resets_ballast": [True], "resets_railpad": [True],
        })  # fmt: skip
    charts = evaluate(rows, events, settings)
    status = chart_status(charts, settings)
    frames = {
        "modes": rows.assign(method="joint"), "charts": chart_rows(charts), "alarms": alarm_rows(charts, settings),
        "baselines": baseline_rows(charts, settings),
        "chart_status": describe_flagged(status, candidates(charts, status, settings), settings),
    } | ({} if events is None else {"events": events})  # fmt: skip
    return FleetSource(connect_views(frames, newest), newest.date().isoformat())


def test_twenty_weekly_campaigns_are_nineteen_weeks_of_a_baseline(settings):
    source = source_of(20, settings)
    learning = source.learning()
    n_charts = sum(k["n"] for k in source.chart_kinds())
    assert learning == {"n": n_charts, "n_again": 0, "n_campaigns": 20, "n_days": 133}
    kinds = {k["kind"]: k["n"] for k in source.chart_kinds()}
    assert kinds["resonance"] == 8 * kinds["whole turnout"] and set(kinds) <= {"resonance", "whole turnout", "damping"}


def test_charts_that_learn_a_level_after_tamping_are_counted_separately(settings):
    learning = source_of(80, settings, tamped=4).learning()
    assert learning["n"] == 0 and learning["n_again"] > 0 and learning["n_campaigns"] == 0
