"""Monitor resonances over time: control charts with a set false-alarm rate, chart states, drift and forecast."""

from turnout.trend.alarms import candidates, describe_flagged
from turnout.trend.cusum import Charts, finish
from turnout.trend.evaluation import evaluate, evaluate_panels
from turnout.trend.panel import Panel, panel_of
from turnout.trend.preparation import prepare
from turnout.trend.states import chart_status
from turnout.trend.tables import alarm_rows, baseline_rows, chart_rows

__all__ = [
    "Charts",
    "Panel",
    "alarm_rows",
    "baseline_rows",
    "candidates",
    "chart_rows",
    "chart_status",
    "describe_flagged",
    "evaluate",
    "evaluate_panels",
    "finish",
    "panel_of",
    "prepare",
]
