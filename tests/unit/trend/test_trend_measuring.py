"""The detectable changes in docs/measuring.md are those of the charts."""

import re

import numpy as np
import pytest

from turnout.config.settings.trend import TrendSettings
from turnout.trend.cusum import guard_factor
from turnout.trend.detectability import detectable_shift
from turnout.trend.threshold import threshold_for


def smallest_change(spread, campaigns, settings):
    """Smallest change [%] of a chart without memory, after a baseline of a year."""
    plain = settings.target_percent >= settings.allowance_switch * spread * settings.guard_large
    allowance = settings.allowance_large if plain else settings.allowance_small
    guard = guard_factor(np.array([max(12, campaigns)]), np.array([not plain]), settings)[0]
    threshold = threshold_for(settings.run_length_loss, allowance)
    return spread * guard * detectable_shift(threshold, allowance, campaigns, max(12, campaigns), 0, round(guard, 2))


def test_the_table_states_the_detectable_changes_of_the_charts(repository):
    page = (repository / "docs" / "measuring.md").read_text(encoding="utf-8")
    head, *_ = re.findall(r"\| scatter \|(.*)\|", page)
    campaigns = [int(cell.split()[0]) for cell in head.split("|")]
    rows = re.findall(r"^\| ([\d.]+) % \|(.*)\|$", page, re.M)
    assert len(rows) == 4
    for spread, cells in rows:
        expected = [smallest_change(float(spread), n, TrendSettings()) for n in campaigns]
        assert [float(c) for c in cells.split("|")] == pytest.approx(expected, abs=0.05001)
