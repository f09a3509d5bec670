"""Views of the registry on the charts of given modes, for the tests of worklist and confirmation."""

from tests.oracles.trend_views import connect_views

from turnout.trend import alarm_rows, baseline_rows, candidates, chart_rows, chart_status, describe_flagged, evaluate

KEYS = ("turnout_id", "section_id", "band", "source")


def evaluated_views(rows, settings, events=None, asof=None, **more):
    """A connection with the views; ``more`` are further tables by name, ``asof`` the day of the macros."""
    rows = rows.astype({k: object for k in KEYS})
    charts = evaluate(rows, events, settings)
    status = chart_status(charts, settings)
    frames = {
        "modes": rows.assign(method="joint"), "charts": chart_rows(charts), "alarms": alarm_rows(charts, settings),
        "baselines": baseline_rows(charts, settings),
        "chart_status": describe_flagged(status, candidates(charts, status, settings), settings), **more,
    }  # fmt: skip
    frames |= {} if events is None else {"events": events}
    return connect_views(frames, asof or rows["measured_at_utc"].max(), rounded=False)
