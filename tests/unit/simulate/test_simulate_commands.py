"""The commands write raw files that the readers read and the stages use."""

import json

import numpy as np
import pytest

from turnout.cli.main import main
from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test import find_impacts
from turnout.readers import read
from turnout.records import RawChannel, RawDescription
from turnout.simulate.calibration import Calibration


def test_a_simulated_hammer_test_is_read_again_and_has_intact_impacts(tmp_path, repository, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = str(repository / "config")
    command = [
        "simulate",
        "hammer",
        "--section",
        "A7",
        "--turnout",
        "tommerup_s1",
        "--config",
        folder,
        "--impacts",
        "3",
    ]
    assert main([*command, "--impacts", "3", "--raw", "raw", "--seed", "5"]) == 0
    path = tmp_path / "raw" / "tommerup_s1" / "hammer" / "2024-05-13" / "A7_1.h5"
    channels = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
    result = read(path.name, path.parent, RawDescription(channels))
    assert len(result.recordings) == 3 and not result.errors
    impacts = find_impacts(result.recordings, "force", "rail", ReceptanceSettings())
    assert sum(i.accepted for i in impacts) >= 2


def test_a_simulation_does_not_overwrite_a_raw_file_of_a_turnout(tmp_path, repository, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "raw" / "tommerup_s1" / "hammer" / "2024-05-13" / "A7_1.h5"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"measured")
    command = ["simulate", "hammer", "--section", "A7", "--turnout", "tommerup_s1", "--impacts", "1"]
    assert main([*command, "--config", str(repository / "config"), "--raw", "raw"]) == 2
    assert path.read_bytes() == b"measured"
    assert "A7_1.h5 is there already and may be a measurement" in capsys.readouterr().err


def test_the_truth_of_a_simulated_passage_is_in_a_separate_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "one.npz"
    command = [
        "simulate",
        "passage",
        "--vehicle",
        "locomotive",
        "--speed",
        "140",
        "--truth",
        "truth",
    ]
    assert main([*command, "--out", str(out)]) == 0
    assert "4 axles" in capsys.readouterr().out
    truth = json.loads((tmp_path / "truth" / "one.json").read_text())
    assert len(truth["peak_force_n"]) == 4 and min(truth["peak_force_n"]) > 90e3
    samples = np.load(out, allow_pickle=False)
    assert not any("peak" in name for name in samples.files)


QUANTITIES = {"hammer": "force", "acc_1": "acceleration", "acc_2": "acceleration"}
CHANNELS = tuple(RawChannel(name, name, quantity) for name, quantity in QUANTITIES.items())
SOFT = """extends: tommerup
terms:
  - {term: local_ballast, sleeper: 24.6, factor: {value: 0.3, unit: "-", source: made up}}
"""


def test_the_truth_of_a_simulated_hammer_test_is_in_a_separate_file(tmp_path, monkeypatch):
    """Impacts scatter by 1 cm and never by more than two of these. The channel's low-pass is the load cell's: a
    pulse of 1.2 ms loses less than 0.3 % of its peak, its noise is 2 N."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "soft.yaml").write_text(SOFT)
    command = ["simulate", "hammer", "--section", "A7", "--track", "soft.yaml", "--impacts", "2", "--tests", "2"]
    assert main([*command, "--truth", "truth"]) == 0
    truths = [json.loads((tmp_path / f"truth/A7_{k}.json").read_text()) for k in (1, 2)]
    assert all(t["effects"] == [{"term": "local_ballast", "sleeper": 24.6, "factor": 0.3}] for t in truths)
    places = [impact["position_m"] for t in truths for impact in t["impacts"]]
    assert len(set(places)) == 4 and np.max(np.abs(np.array(places) - 24.6)) <= 0.0201
    folder = next(tmp_path.rglob("A7_1.h5")).parent
    recordings = read("A7_1.h5", folder, RawDescription(CHANNELS)).recordings
    for recording, impact in zip(recordings, truths[0]["impacts"], strict=True):
        assert recording.samples[0].max() == pytest.approx(impact["peak_force_n"], rel=3e-3)


HAMMER = ["simulate", "hammer", "--section", "A7"]


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        (["simulate", "passage", "--vehicle", "tgv"], "no file config/vehicles/tgv.yaml"),
        (["simulate", "hammer", "--section", "B9"], "no section 'B9'"),
        ([*HAMMER, "--at", "yesterday"], "--at: 'yesterday' is not a time in UTC. Write YYYY-MM-DD"),
        ([*HAMMER, "--at", "2024-05-13T09:00:00+02:00"], "with a time zone. Write the time in UTC, without a zone"),
        ([*HAMMER, "--tests", "2", "--out", "a.h5"], "--out: one file for 2 tests. Write --tests 1, or leave out"),
        ([*HAMMER, "--format", "nix"], "--format: 'nix'. Allowed: csv, hdf5"),
        ([*HAMMER, "--out", "a.xlsx"], "--out: 'a.xlsx', whose ending is no format. Write one of .csv, .h5"),
        ([*HAMMER, "--impacts", "0"], "--impacts: 0. Write a whole number from 1 to "),
        ([*HAMMER, "--tests", "0"], "--tests: 0. Write a whole number from 1 to "),
        ([*HAMMER, "--seed", "-1"], "--seed: -1. Write a whole number from 0"),
        (
            [*HAMMER, "--format", "wav", "--impacts", "2"],
            "cannot be written as wav: a WAV file holds one record",
        ),
        (["simulate", "passage", "--units", "0"], "--units: 0. Write a whole number from 1 to "),
        (["simulate", "hammer", "--section", "nan"], "no section 'nan'"),
        (["calibrate", "--section", "A7"], "either hammer tests or --modes"),
        (["calibrate", "--section", "A7", "--modes", "ballast"], "not of the form"),
    ],
)
def test_errors_about_wrong_commands_state_what_is_wrong(tmp_path, monkeypatch, capsys, command, expected):
    monkeypatch.chdir(tmp_path)
    assert main(command) == 2
    assert expected in capsys.readouterr().err
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_position_in_metres_is_no_section_of_a_turnout(tmp_path, repository, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    folder = str(repository / "config")
    assert main(["simulate", "hammer", "--section", "3.0", "--turnout", "tommerup_s1", "--config", folder]) == 2
    assert "--section: 3.0 is no section of tommerup_s1, whose raw files" in capsys.readouterr().err
    assert not (tmp_path / "raw").exists()


def test_a_time_in_utc_is_stored_unchanged(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main([*HAMMER, "--impacts", "1", "--at", "2024-05-13T09:00:00Z", "--out", "a.h5"]) == 0
    (recording,) = read("a.h5", tmp_path, RawDescription(CHANNELS)).recordings
    assert recording.started_at.isoformat() == "2024-05-13T09:00:00"


def test_the_help_states_the_range_of_loads(capsys):
    with pytest.raises(SystemExit):
        main(["simulate", "passage", "--help"])
    assert "0 (empty) to 1 (full), overloaded up to 1.5" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(("reduced", "warned"), [(0.2, False), (241.4, True)])
def test_a_calibration_that_misses_its_test_warns_that_its_intervals_are_not_valid(reduced, warned):
    """A fit always gives five parameters with small errors, even for a test on another track."""
    band = {(40.0, 100.0): 0.6}
    found = Calibration(
        "M1", {"pad_stiffness": 3e8}, {"pad_stiffness": 0.012}, np.eye(1), {"pad_stiffness": True}, (), band, band,
        reduced, 1600, None,
    )  # fmt: skip
    assert ("neither values nor ± mean anything" in str(found)) is warned
    assert "above 4: not met" in str(found)


def calibrated(monkeypatch, capsys, command, reduced=0.9):
    """What `turnout calibrate` prints, and the file of the track it takes, where the fit ends like this."""
    taken = []

    def fit(track, section, *_):
        taken.append(track)
        band = {(40.0, 100.0): 0.6}
        values = {"pad_stiffness": 3e8, "ballast_damping": 7.1e4}
        informed = {"pad_stiffness": True, "ballast_damping": False}
        return Calibration(
            section, values, {"pad_stiffness": 0.012, "ballast_damping": 0.8}, np.eye(2), informed, (), band, band,
            reduced, 1600, None,
        )  # fmt: skip

    monkeypatch.setattr("turnout.stages.calibrate.calibrate_to_files", fit)
    assert main(["calibrate", "--section", "M1", "a.h5", *command]) == (1 if reduced > 4.0 else 0)
    return capsys.readouterr().out, taken


def test_each_value_of_a_calibration_has_its_unit_and_its_error_a_name(monkeypatch, capsys):
    """The table has the numbers and units of the lines to paste."""
    output, _ = calibrated(monkeypatch, capsys, ["--track", "tommerup"])
    lines = [line.split() for line in output.splitlines()]
    assert ["pad_stiffness", "300", "MN/m", "±", "1.2", "%"] in lines
    assert next(line for line in lines if line[:1] == ["ballast_damping"])[1:7] == ["71", "kN", "s/m", "±", "80.0", "%"]
    assert "± is one standard deviation" in output
    output, _ = calibrated(monkeypatch, capsys, ["--track", "tommerup", "--json"])
    first, second = json.loads(output)["result"]
    assert (first["parameter"], first["value"], first["unit"], first["relative_sd"]) == (
        "pad_stiffness", 300.0, "MN/m", 0.012,
    )  # fmt: skip
    assert (second["is_determined"], second["unit"], second["n"]) == (False, "kN s/m", 1600)


@pytest.mark.parametrize("own", ["aarup_n4", "tommerup"], ids=["turnout", "layout"])
def test_a_calibration_uses_the_track_of_the_turnout_and_states_it(tmp_path, repository, monkeypatch, capsys, own):
    (tmp_path / "config/tracks").mkdir(parents=True)
    for name in ("layouts", "turnouts.tsv"):
        (tmp_path / "config" / name).symlink_to(repository / "config" / name)
    for name in {own, "tommerup", "other"}:
        (tmp_path / f"config/tracks/{name}.yaml").write_text(SOFT)
    arguments, folder = ["--turnout", "aarup_n4", "--config", str(tmp_path / "config")], f"{tmp_path}/config/tracks"
    output, taken = calibrated(monkeypatch, capsys, arguments)
    assert output.startswith(f"track: {folder}/{own}.yaml\n") and [str(p) for p in taken] == [f"{folder}/{own}.yaml"]
    output, _ = calibrated(monkeypatch, capsys, [*arguments, "--track", "other"])
    assert output.startswith(f"track: {folder}/other.yaml\n")
    monkeypatch.chdir(tmp_path)
    output, _ = calibrated(monkeypatch, capsys, [])
    assert output.startswith(f"track: {folder}/tommerup.yaml (no turnout and no track was named)\n")


def test_a_calibration_states_that_the_turnout_has_no_track_file(tmp_path, repository, monkeypatch, capsys):
    (tmp_path / "config").mkdir()
    for name in ("layouts", "turnouts.tsv"):
        (tmp_path / "config" / name).symlink_to(repository / "config" / name)
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", "--section", "A7", "a.h5", "--turnout", "aarup_n4"]) == 2
    assert "aarup_n4: no file config/tracks/aarup_n4.yaml nor tommerup.yaml" in capsys.readouterr().err


def test_the_lines_for_the_track_file_hold_only_values_that_the_tests_determine(monkeypatch, capsys):
    output, _ = calibrated(monkeypatch, capsys, [])
    table, block = output.split("paste")
    assert "hardly determined by these tests: about what the track file says" in table.splitlines()[3]
    assert '\n    pad_stiffness: {value: 300, unit: MN/m, source: "estimate: fitted", prior: 0.012}\n' in block
    assert "ballast_damping" not in block


def test_a_fit_that_misses_its_test_gives_no_lines_for_the_track_file(monkeypatch, capsys):
    output, _ = calibrated(monkeypatch, capsys, [], reduced=241.4)
    block = output.split("neither values nor ±")[1]
    assert "do not paste" in block and "does not meet these tests (chi-squared per degree of freedom 241" in block
    assert not [line for line in block.splitlines()[1:] if line.strip() and not line.lstrip().startswith("#")]
