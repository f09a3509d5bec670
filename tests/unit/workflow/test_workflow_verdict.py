"""What is new is judged once there is enough of it; what was found wrong is said until it is fixed or outlived."""

import json
import os
import shutil

import pytest
from length_fleet import Fleet

from turnout.errors import TurnoutError
from turnout.workflow.jobs import touch_after_publication
from turnout.workflow.quality_gate import check_quality, judge


def test_the_verdict_judges_what_is_new_over_the_fleet_and_each_line(tmp_path):
    fleet = Fleet(tmp_path, 10, "fleet: {quarantine_units: 5, quarantine_share: 0.3}\n")
    fleet.run()
    output = tmp_path / "work/verdict.json"
    assert check_quality([fleet.state], fleet.configuration, output).units == 10
    for i in (1, 3):  # both of line 1
        fleet.put(f"t{i}/2024-05-13/A_1.txt", "damaged")
    fleet.run()
    judged = json.loads(output.read_text())["judged"]
    found = judge([fleet.state], fleet.configuration, judged)
    assert (found.units, found.quarantined, found.complaints) == (2, 2, ())  # too few to judge
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


def test_turnouts_without_a_line_are_judged_with_the_fleet_alone(tmp_path):
    fleet = Fleet(tmp_path, 10, "fleet: {quarantine_units: 4, quarantine_share: 0.3}\n")
    table = tmp_path / "config/turnouts.tsv"
    table.write_text(table.read_text().replace("line 1", ""))
    for i in (1, 3):  # two of five without a line
        fleet.put(f"t{i}/2024-05-13/A_1.txt", "damaged")
    fleet.run()
    assert judge([fleet.state], fleet.configuration).complaints == ()  # 2 of 10


def test_small_nights_add_up_until_they_can_be_judged(tmp_path):
    fleet = Fleet(tmp_path, 1, "fleet: {quarantine_units: 5, quarantine_share: 0.3}\n")
    output = tmp_path / "work/verdict.json"
    for night in range(4):
        fleet.put(f"t0/2024-06-{night + 1:02d}/A_1.txt", "damaged")
        fleet.run()
        if night < 3:
            assert check_quality([fleet.state], fleet.configuration, output).units == night + 2
    with pytest.raises(TurnoutError, match="4 of 5 new units of the fleet have rows in quarantine"):
        check_quality([fleet.state], fleet.configuration, output)


def test_a_run_over_some_turnouts_forgets_no_verdict_on_the_others(fleet):
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
    assert len(json.loads(output.read_text())["judged"]) == 1  # of batches that are gone nothing is kept


class Nights(Fleet):
    """One turnout; of five new units and more not more than 30 % may be bad."""

    def __init__(self, folder):
        super().__init__(folder, 1, "fleet: {quarantine_units: 5, quarantine_share: 0.3}\n")
        shutil.rmtree(self.raw)
        self.n = 0

    def night(self, *texts):
        """A night with one unit for each of ``texts``; what the verdict says, "" where all is sound."""
        for text in texts:
            self.n += 1
            # no two sound ones alike: they would be copies
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


def test_what_was_found_wrong_is_said_until_as_many_newer_units_are_sound_by_themselves(nights):
    """And not for months, until the bad ones are a small share of all that came since."""
    assert "5 of 5 new units of the fleet" in nights.night(*["damaged"] * 5)
    again = nights.night()
    assert "5 of 5 new units" in again and "so far there are 0 of 5" in again  # asking again mends nothing
    assert "5 of 9 new units" in nights.night(*["good"] * 4)
    assert nights.night("good") == ""
    assert nights.night() == "" and nights.night("damaged") == ""


def test_newer_units_that_are_bad_are_said_by_themselves(nights):
    nights.night(*["damaged"] * 5)
    assert "2 of 5 new units" in nights.night("damaged", "damaged", "good", "good", "good")
    assert "2 of 6 new units" in nights.night("good")  # the first five were told and replaced
    assert nights.night(*["good"] * 4) == ""


def test_what_was_found_wrong_is_sound_once_it_is_fixed(nights):
    nights.night("damaged", "damaged", "good", "good", "good")
    nights.put("t0/2024-06-01/A_1.txt", "repaired")
    assert nights.night() == ""


def test_an_internal_error_is_said_until_it_is_fixed_or_newer_units_are_sound(nights):
    assert "1 internal errors, first in t0/hammer/A/2024-06-01" in nights.night("bug")
    assert "1 internal errors" in nights.night("good", "good", "good", "good")
    assert nights.night("good") == ""


def test_a_fault_of_the_machine_excuses_no_bad_unit(nights):
    assert "1 units wait" in nights.night("damaged", "damaged", "damaged", "bad sector")
    nights.put("t0/2024-06-04/A_1.txt", "readable")
    assert "3 of 9 new units" in nights.night(*["good"] * 5)


def test_no_output_is_older_than_a_generation_that_was_published_after_it(tmp_path, monkeypatch):
    """Nor is its benchmark, whose time counts for Snakemake: the next night would make all charts and pages again."""
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
