"""`turnout passage` of a file without a train, and of a link to a file elsewhere."""

import json
from datetime import datetime

import numpy as np
import pytest
from benchmarks.passage_truth import PATTERNS, RATE, impact_record, paper_model, sensors_for

from turnout.cli.main import main
from turnout.cli.passage import _train_row
from turnout.config.settings.passage import PassageSettings
from turnout.passage.analysis import analyse
from turnout.passage.channel_fit import fit_channel
from turnout.readers.writing import write
from turnout.records import Channel, Recording

LAYOUT = """
sections:
  A: {panel: CP, track: main, position: 18.0}
passages:
  files: "passages/{time}.{ext}"
  rate: 5000
  channels:
    web: {source: web, quantity: acceleration, unit: m/s², mounting: rail web, section: A, limit: 500}
"""


@pytest.fixture
def folder_with_link(tmp_path, monkeypatch):
    (tmp_path / "config/layouts").mkdir(parents=True)
    (tmp_path / "config/layouts/small.yaml").write_text(LAYOUT)
    (tmp_path / "config/turnouts.tsv").write_text("turnout\tlayout\nt1\tsmall\n")
    (tmp_path / "share").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def command_result(folder_with_link, samples, capsys):
    """(exit code, what was printed) for a recording that lies behind a link."""
    recording = Recording(samples[None], 5000.0, (Channel("web", "acceleration"),), "passage", datetime(2026, 7, 25, 9))
    write([recording], folder_with_link / "share/train.npz", "npz")
    (folder_with_link / "here.npz").symlink_to(folder_with_link / "share/train.npz")
    code = main(["passage", "here.npz", "--turnout", "t1", "--no-fit"])
    return code, capsys.readouterr().out


@pytest.mark.parametrize(
    ("broken", "expected"),
    [(None, "no_train: nothing stands out of the noise"), (np.nan, "1 of 20000 samples are missing or not finite")],
)
def test_a_file_without_a_train_is_reported_with_exit_code_1(folder_with_link, capsys, broken, expected):
    samples = np.random.default_rng(7).normal(0.0, 0.1, 20000)
    if broken is not None:
        samples[7] = broken
    code, printed = command_result(folder_with_link, samples, capsys)
    assert code == 1 and expected in printed


def test_a_train_and_its_scores_are_numbers_for_other_programs():
    """``--json`` had the text alone."""
    rng = np.random.default_rng(12)
    record = impact_record(rng)
    recording = Recording(record.samples[None], RATE, (Channel("A7", "acceleration", 24.6),), "passage", source="a.h5")
    settings = PassageSettings()
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    fit = fit_channel(record.samples, RATE, record.times / RATE, 44.4, paper_model("CP A7"), settings)
    row = _train_row(recording, None, passage, {"A7": fit, "A8": "no model of its section"})
    assert json.loads(json.dumps(row)) == row
    assert (row["file"], row["n_axles"], row["train_type"]) == ("a.h5", 8, "IC3") and len(row["axles_m"]) == 8
    assert abs(row["speed_kmh"] - 3.6 * 44.4) < 3.0 * row["speed_se_kmh"] + 0.5
    first, second = row["sensors"]
    assert first["fit_pct"] > 90.0 > first["fit_null_pct"] and first["status"] == "accepted"
    assert second == {"sensor": "A8", "status": None, "detail": "no model of its section"}


def filed(folder, name):
    """A file of noise at ``name`` below the raw folder."""
    samples = np.random.default_rng(7).normal(0.0, 0.1, (1, 20000))
    path = folder / "raw" / name
    path.parent.mkdir(parents=True)
    return write([Recording(samples, 5000.0, (Channel("web", "acceleration"),), "passage")], path, "npz")


@pytest.mark.parametrize("command", [["passage", "--no-fit"], ["compare"]])
def test_a_hammer_test_and_a_file_of_another_turnout_are_named_as_such(folder_with_link, capsys, command):
    (folder_with_link / "config/turnouts.tsv").write_text("turnout\tlayout\nt1\tsmall\nt2\tsmall\n")
    layout = folder_with_link / "config/layouts/small.yaml"
    hammer = 'hammer:\n  files: "hammer/{campaign}/{section}_{test}.{ext}"\n  rate: 20000\n'
    hammer += "  force: hammer\n  response: rail\n  channels:\n"
    hammer += "    hammer: {source: hammer, quantity: force, unit: N}\n"
    hammer += "    rail: {source: rail, quantity: acceleration, unit: m/s²}\n"
    layout.write_text(LAYOUT + hammer)
    test = filed(folder_with_link, "t1/hammer/2026-07-25/A_1.npz")
    assert main([*command, str(test), "--turnout", "t1"]) == 2
    error = capsys.readouterr().err
    assert f"is that of a hammer test, not of a passage. Use turnout hammer {test} --turnout t1" in error
    passage = filed(folder_with_link, "t2/passages/20260725T090000Z.npz")
    assert main([*command, str(passage), "--turnout", "t1"]) == 2
    assert "is t1, and the file lies in the raw folder of t2. Write --turnout t2" in capsys.readouterr().err
