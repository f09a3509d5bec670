"""`turnout hammer` on files of averaged frequency responses: modes with errors, and no test of single impacts."""

import re
from datetime import date

import numpy as np
import pytest

from turnout.cli.main import main
from turnout.config import load_configuration, with_raw
from turnout.registry.intake import Arrival, gather
from turnout.stages.hammer import hammer_unit
from turnout.stages.hammer_responses import NO_IMPACTS
from turnout.workflow.scan import scan

DAY = date(2024, 5, 13)
F = np.arange(1, 2001) * 0.5
BALLAST, RAILPAD = (155.0, 0.06), (610.0, 0.04)
SHIFTS = (-0.4, -0.1, 0.2, 0.3)  # Hz, of the ballast resonance between the responses


@pytest.fixture(autouse=True)
def in_repository(repository, monkeypatch):
    monkeypatch.chdir(repository)


def receptances():
    """Four receptances [m/N] of two modes; the lower one differs by ``SHIFTS``."""
    modes = ((BALLAST, 1e-8), (RAILPAD, 4e-9))
    return np.array([
        sum(
            w * 2 * z * (f + shift * (f < 200)) ** 2
            / ((f + shift * (f < 200)) ** 2 - F**2 + 2j * z * (f + shift * (f < 200)) * F)
            for (f, z), w in modes
        )
        for shift in SHIFTS
    ])  # fmt: skip


def hammer(capsys, tmp_path, *files, more=()):
    (tmp_path / "raw").mkdir(exist_ok=True)
    command = ["hammer", *map(str, files), "--turnout", "tommerup_s1", "--raw", str(tmp_path / "raw"), *more]
    code = main(command)
    return code, *capsys.readouterr()


def write_filed(tmp_path):
    folder = tmp_path / "raw" / "tommerup_s1" / "hammer" / str(DAY)
    folder.mkdir(parents=True)
    np.savez(folder / "A7_1.npz", frequency=F, frf=receptances(), units="m/N")
    notes = "campaign,started_at_utc,rail_temperature_c\n2024-05-13,2024-05-13T09:00:00,11.5\n"
    (tmp_path / "raw" / "tommerup_s1" / "campaigns.csv").write_text(notes)
    return folder / "A7_1.npz"


def test_the_errors_of_both_resonances_follow_from_the_spread_of_the_responses(tmp_path, capsys):
    code, text, _ = hammer(capsys, tmp_path, write_filed(tmp_path))
    assert code == 0 and "none could be judged: the files hold averaged frequency responses" in text
    found = re.findall(r"  (ballast|railpad) +(\S+) ± (\S+) Hz, damping (\S+) ± \S+, n = 4", text)
    values = {band: tuple(map(float, numbers)) for band, *numbers in found}
    assert values["ballast"][0] == pytest.approx(BALLAST[0] + np.mean(SHIFTS), abs=0.3)
    assert values["railpad"][0] == pytest.approx(RAILPAD[0], abs=1.0)
    half = 3.182 * np.std(SHIFTS, ddof=1) / 2.0  # Student's t of four responses
    assert values["ballast"][1] == pytest.approx(half, rel=0.1)
    assert values["ballast"][2] == pytest.approx(BALLAST[1], rel=0.05)
    assert NO_IMPACTS in text


def test_the_registry_contains_the_modes_and_states_that_no_impact_was_tested(tmp_path):
    write_filed(tmp_path)
    turnout = with_raw(load_configuration("config").turnout("tommerup_s1"), tmp_path / "raw")
    (unit,) = scan(turnout, tmp_path / "raw").units
    rows = hammer_unit(unit, turnout, tmp_path / "raw", algo="1")
    arrival = Arrival(0, "tommerup_s1/hammer/A7/2024-05-13", "tommerup_s1", "hammer", "key", "1", rows)
    registered = {table: gather(table, [arrival])[0].to_pylist() for table in ("recordings", "modes", "models")}
    (model,), (recording,) = registered["models"], registered["recordings"]
    assert (model["method"], model["status"], model["n_impacts_used"]) == ("frf", "accepted", 0)
    assert model["detail"].startswith(NO_IMPACTS) and model["sampling_rate_hz"] is None
    assert {m["band"] for m in registered["modes"]} == {"ballast", "railpad"} and rows["quarantine"] == []
    assert {m["rail_temperature_c"] for m in registered["modes"]} == {11.5}
    assert (recording["n_channels"], recording["n_samples"]) == (4, len(F))


def test_the_error_asks_for_a_day_that_the_file_does_not_state(tmp_path, capsys):
    np.savez(tmp_path / "x.npz", frequency=F, frf=receptances())
    code, _, errors = hammer(capsys, tmp_path, tmp_path / "x.npz", more=("--section", "A7"))
    assert code == 2 and "Write --campaign YYYY-MM-DD" in errors


def test_responses_that_cannot_be_evaluated_are_quarantined_with_the_reason(tmp_path, capsys):
    np.savez(tmp_path / "x.npz", frequency=F**1.1, frf=receptances())
    code, text, _ = hammer(capsys, tmp_path, tmp_path / "x.npz", more=("--section", "A7", "--campaign", "2024-05-13"))
    assert code == 1 and "not evenly spaced" in text and "nothing could be used" in text
