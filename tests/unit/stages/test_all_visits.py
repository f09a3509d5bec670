"""Visits are diagnosed one by one or all in one case; effects that depend on temperature need several visits."""

import pytest

from turnout.errors import SimulationError
from turnout.stages.mismatch_results import ALL_VISITS, _visit

FOUND = {"2024-02-06": ["cold impacts"], "2024-07-16": ["warm impacts", "trains"]}


def test_the_newest_visit_a_given_visit_or_all_visits_are_selected():
    assert _visit("t", FOUND, None, "raw") == ("2024-07-16", ["warm impacts", "trains"])
    assert _visit("t", FOUND, "2024-02-06", "raw") == ("2024-02-06", ["cold impacts"])
    assert _visit("t", FOUND, ALL_VISITS, "raw") == ("2024-07-16", ["cold impacts", "warm impacts", "trains"])


def test_the_error_of_an_unknown_visit_lists_the_known_visits():
    with pytest.raises(
        SimulationError, match=r"no visit '2023'; its visits are, newest first, 2024-07-16, 2024-02-06\."
    ):
        _visit("t", FOUND, "2023", "raw")


def test_an_unknown_visit_is_answered_by_the_newest_visits_and_the_number_of_the_others():
    visits = {f"2024-{month:02d}-01": [] for month in range(1, 13)} | {"2025-01-01": [], "2025-02-01": []}
    with pytest.raises(SimulationError) as error:
        _visit("t", visits, "2025-03-01", "raw")
    assert "newest first, 2025-02-01, 2025-01-01, 2024-12-01" in str(error.value)
    assert str(error.value).endswith("2024-03-01 and 2 earlier ones.")
