"""New units are checked when they are enough; a complaint is repeated until it is fixed or newer units are good."""

import json
import os
import shutil

import pytest
from length_fleet import Fleet

from turnout.errors import TurnoutError
from turnout.workflow.jobs import touch_after_publication
from turnout.workflow.quality_gate import check_quality, judge


def test_the_verdict_checks_new_units_of_the_fleet_and_of_each_line(tmp_path):
    fleet = Fleet(tmp_path, 10, "fleet: {quarantine_units: 5, quarantine_share: 0.3}\n")
    fleet.run()
    output = tmp_path / "work/verdict.json"
    assert check_quality([fleet.state], fleet.configuration, output).units == 10
    for i in (1, 3):  # both of line 1
        fleet.put(f"t{i}/2024-05-13/A_1.txt", "damaged")
    fleet.run()
    judged = json.loads(output.read_text())["judged"]
    found = judge([fleet.state], fleet.configuration, judged)
    assert (found.units, found.quarantined, found.complaints) == (2, 2, ())  # too few units for a verdict
    for i in (5, 7, 9):
        fleet.put(f"t{i}/2024-05-13/A_1.txt", "good again")
    fleet.run()
    with pytest.raises(TurnoutError, match="2 of 5 new units of the fleet have rows in quarantine, 40 %, above"):
        check_quality([fleet.state], fleet.configuration, output)
    everything = judge([fleet.state], fleet.configuration)
    assert everything.complaints == (
        "2 of 5 new units of line 'line 1' have rows in quarantine, 40 %, above the limit of 30 %",
    )
    fleet.put("t3/2024-05-13/A_1.txt", "repaired")
    fleet.run()
    assert check_quality([fleet.state], fleet.configuration, output).quarantined == 1


def test_turnouts_without_a_line_are_checked_only_as_part_of_the_fleet(tmp_path):
    fleet = Fleet(tmp_path, 10, "fleet: {quarantine_units: 4, quarantine_share: 0.3}\n")
    table = tmp_path / "config/turnouts.tsv"
    table.write_text(table.read_text().replace("line 1", ""))
    for i in (1, 3):  # two of five without a line
        fleet.put(f"t{i}/2024-05-13/A_1.txt", "damaged")
    fleet.run()
    assert judge([fleet.state], fleet.configuration).complaints == ()  # 2 of 10


def test_the_new_units_of_small_runs_add_up_until_there_are_enough_for_a_verdict(tmp_path):
    fleet = Fleet(tmp_path, 1, "fleet: {quarantine_units: 5, quarantine_share: 0.3}\n")
    output = tmp_path / "work/verdict.json"
    for run_night in range(4):
        fleet.put(f"t0/2024-06-{run_night + 1:02d}/A_1.txt", "damaged")
        fleet.run()
        if run_night < 3:
            assert check_quality([fleet.state], fleet.configuration, output).units == run_night + 2
    with pytest.raises(TurnoutError, match="4 of 5 new units of the fleet have rows in quarantine"):
        check_quality([fleet.state], fleet.configuration, output)


def test_a_run_over_some_turnouts_keeps_the_verdict_of_the_others(fleet):
    settings = "fleet: {quarantine_units: 1, quarantine_share: 0.3}\n"
    (fleet.folder / "config/config.yaml").write_text(settings)
    fleet.run()
    other = fleet.state.with_name("01of02.json")
    shutil.copy(fleet.state, other)
    shutil.copytree(fleet.state.with_suffix(""), other.with_suffix(""))
    output = fleet.folder / "work/verdict.json"
    assert check_quality([fleet.state, other], fleet.configuration, output).units == 3
    assert check_quality([other], fleet.configuration, output).units == 0
    assert check_quality([fleet.state, other], fleet.configuration, output).units == 0
    shutil.rmtree(other.with_suffix(""))
    check_quality([fleet.state], fleet.configuration, output)
    assert len(json.loads(output.read_text())["judged"]) == 1  # nothing is kept of batches that no longer exist


class Nights(Fleet):
    """A fleet with one turnout; of five or more new units at most 30 % may be in quarantine."""

    def __init__(self, folder):
        super().__init__(folder, 1, "fleet: {quarantine_units: 5, quarantine_share: 0.3}\n")
        shutil.rmtree(self.raw)
        self.n = 0

    def run_night(self, *texts):
        """Run with one unit for each of ``texts``; the message of the verdict, "" if there is no complaint."""
        for text in texts:
            self.n += 1
            # good units must differ: equal files would be copies
            self.put(f"t0/2024-06-{self.n:02d}/A_1.txt", f"good {self.n}" if text == "good" else text)
        self.run()
        try:
            check_quality([self.state], self.configuration, self.folder / "work/verdict.json")
        except TurnoutError as error:
            return str(error)
        return ""


@pytest.fixture
def nights(tmp_path):
    return Nights(tmp_path)


def test_a_complaint_is_repeated_until_as_many_newer_units_are_good(nights):
    """It is not repeated for months, until the faulty units are a small share of all later units."""
    assert "5 of 5 new units of the fleet" in nights.run_night(*["damaged"] * 5)
    again = nights.run_night()
    assert "5 of 5 new units" in again and "so far there are 0 of 5" in again  # another check changes nothing
    assert "5 of 9 new units" in nights.run_night(*["good"] * 4)
    assert nights.run_night("good") == ""
    assert nights.run_night() == "" and nights.run_night("damaged") == ""


def test_newer_faulty_units_give_a_separate_complaint(nights):
    nights.run_night(*["damaged"] * 5)
    assert "2 of 5 new units" in nights.run_night("damaged", "damaged", "good", "good", "good")
    assert "2 of 6 new units" in nights.run_night("good")  # the first five are no longer counted
    assert nights.run_night(*["good"] * 4) == ""


def test_a_complaint_ends_when_its_fault_is_fixed(nights):
    nights.run_night("damaged", "damaged", "good", "good", "good")
    nights.put("t0/2024-06-01/A_1.txt", "repaired")
    assert nights.run_night() == ""


def test_an_internal_error_is_reported_until_it_is_fixed_or_newer_units_are_good(nights):
    assert "1 internal errors, first in t0/hammer/A/2024-06-01" in nights.run_night("bug")
    assert "1 internal errors" in nights.run_night("good", "good", "good", "good")
    assert nights.run_night("good") == ""


def test_a_fault_of_the_machine_does_not_excuse_faulty_units(nights):
    assert "1 units wait" in nights.run_night("damaged", "damaged", "damaged", "bad sector")
    nights.put("t0/2024-06-04/A_1.txt", "readable")
    assert "3 of 9 new units" in nights.run_night(*["good"] * 5)


def test_outputs_get_the_time_of_a_generation_that_is_published_after_them(tmp_path, monkeypatch):
    """So do benchmarks, as Snakemake compares their times: otherwise the next run would repeat charts and pages."""
    monkeypatch.chdir(tmp_path)
    names = ("work/change/00of01.done", "work/trend.json", "logs/benchmarks/trend.tsv", "_generation.json")
    generation, paths = tmp_path / names[-1], [tmp_path / name for name in names]
    for k, path in enumerate(paths):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        os.utime(path, (k, k))
    with touch_after_publication(generation, [names[0]], ["work/trend.json", "work/missing.json"]):
        pass
    assert [path.stat().st_mtime for path in paths] == [0, 1, 2, 3]
    with touch_after_publication(generation, [names[0]], ["work/trend.json", "work/missing.json"]):
        generation.touch()
    assert all(path.stat().st_mtime_ns >= generation.stat().st_mtime_ns for path in paths)
    assert not (tmp_path / "work/missing.json").exists()
