"""Visits asked for one by one, or all in one case: what depends on temperature needs more than one."""

import pytest

from turnout.errors import SimulationError
from turnout.stages.mismatch_results import ALL_VISITS, _visit

FOUND = {"2024-02-06": ["cold impacts"], "2024-07-16": ["warm impacts", "trains"]}


def test_the_newest_one_of_them_or_all_together():
    assert _visit("t", FOUND, None, "raw") == ("2024-07-16", ["warm impacts", "trains"])
    assert _visit("t", FOUND, "2024-02-06", "raw") == ("2024-02-06", ["cold impacts"])
    assert _visit("t", FOUND, ALL_VISITS, "raw") == ("2024-07-16", ["cold impacts", "warm impacts", "trains"])


def test_a_visit_that_is_not_there_is_said_with_those_that_are():
    with pytest.raises(SimulationError, match=r"no visit '2023'; there are 2024-02-06, 2024-07-16\."):
        _visit("t", FOUND, "2023", "raw")
