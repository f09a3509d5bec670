"""The commands leave raw files that the readers read and the chains use."""

import json

import numpy as np
import pytest

from turnout.cli import main
from turnout.config.settings.receptance import ReceptanceSettings
from turnout.readers import read
from turnout.receptance import find_impacts
from turnout.records import RawChannel, RawDescription


def test_a_simulated_hammer_test_is_read_back_and_has_sound_impacts(tmp_path, repository, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = str(repository / "config")
    command = ["simulate", "hammer", "--section", "A7", "--turnout", "tommerup_s1", "--config", folder, "--blows", "3"]
    assert main([*command, "--raw", "raw", "--seed", "5"]) == 0
    path = tmp_path / "raw" / "tommerup_s1" / "hammer" / "2024-05-13" / "A7_1.h5"
    channels = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
    result = read(path.name, path.parent, RawDescription(channels))
    assert len(result.recordings) == 3 and not result.errors
    impacts = find_impacts(result.recordings, "force", "rail", ReceptanceSettings())
    assert sum(i.accepted for i in impacts) >= 2


def test_a_simulated_passage_keeps_its_truth_apart(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "one.npz"
    command = [
        "simulate",
        "passage",
        "--vehicle",
        "locomotive",
        "--speed",
        "140",
        "--format",
        "npz",
        "--truth",
        "truth",
    ]
    assert main([*command, "--out", str(out)]) == 0
    assert "4 axles" in capsys.readouterr().out
    truth = json.loads((tmp_path / "truth" / "one.json").read_text())
    assert len(truth["peak_force_n"]) == 4 and min(truth["peak_force_n"]) > 90e3
    samples = np.load(out, allow_pickle=False)
    assert not any("peak" in name for name in samples.files)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["simulate", "passage", "--speed", "0"], "speed must be above 0"),
        (["simulate", "passage", "--vehicle", "tgv"], "no file config/vehicles/tgv.yaml"),
        (["simulate", "hammer", "--section", "B9"], "no location 'B9'"),
        (["simulate", "hammer", "--section", "A7", "--at", "yesterday"], "'yesterday' is not a time"),
        (["calibrate", "--section", "A7"], "either hammer tests or --modes"),
        (["calibrate", "--section", "A7", "--modes", "ballast"], "not of the form"),
    ],
)
def test_wrong_commands_say_what_is_wrong(tmp_path, monkeypatch, capsys, command, said):
    monkeypatch.chdir(tmp_path)
    assert main(command) == 2
    assert said in capsys.readouterr().err
