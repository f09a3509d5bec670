"""The parameter that requests the repair of a damaged registry is new for each damage and then stays."""

import pytest

from turnout.workflow import registry_damage
from turnout.workflow.registry_damage import LAST_REPAIR, note_repair, repair_request


@pytest.fixture
def request_with(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def request(damage):
        monkeypatch.setattr(registry_damage, "damage_stamp", lambda folder: damage)
        return repair_request("results/registry")

    return request


def test_a_request_is_new_for_each_damage_and_does_not_change_after_the_repair(request_with):
    note_repair(request_with(""))
    assert request_with("") == "" and not LAST_REPAIR.exists()
    requests = []
    for damage in ("modes.parquet", "registry.duckdb", "registry.duckdb"):
        requests.append(request_with(damage))
        assert request_with(damage) == requests[-1] and damage in requests[-1]  # a failed job requests it again
        note_repair(requests[-1])
        assert request_with("") == requests[-1]
    assert len({*requests, ""}) == 4


def test_an_unreadable_note_of_the_last_repair_stops_no_run(request_with):
    note_repair("cut off")
    assert request_with("") == "cut off" and request_with("modes.parquet") == "1 modes.parquet"
