"""`turnout inspect` reports the content of files of every format without a layout."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.cli.main import main
from turnout.readers.writing import write
from turnout.records import Channel, RawChannel, RawDescription, Recording
from turnout.report.contents_text import _event_times
from turnout.stages.file_contents import file_contents

RATE = 10_000.0
PEAKS = (2000.0, 3000.0, 2500.0)
EXTENSION = {"uff58": "uff", "uff58b": "uff", "hdf5": "h5", "mat73": "mat"}


def impact_recordings(names=("hammer", "rail")):
    """Three impacts with known peaks, 1 ms long, 20 ms after the start; the response decays within 30 ms."""
    rng = np.random.default_rng(4)
    t = np.arange(2000) / RATE - 0.02
    recordings = []
    for peak in PEAKS:
        force = peak * np.sin(np.pi * t / 1e-3) * ((t > 0.0) & (t < 1e-3))
        rail = 80.0 * np.exp(-100.0 * t) * np.sin(1000.0 * t) * (t > 0.0)
        samples = np.stack([force, rail]) + rng.normal(size=(2, len(t))) * [[1.0], [0.05]]
        recordings.append(Recording(samples, RATE, (Channel(names[0], "force"), Channel(names[1], "acceleration"))))
    return recordings


def in_unit(unit):
    """Description with volts at 1 mV/N and 10 mV/(m/s²), and names that state no quantity."""
    return RawDescription((
        RawChannel("hammer", "AI0", "force", unit, 1.0, "mV/N"),
        RawChannel("rail", "AI1", "acceleration", unit, 10.0, "mV/(m/s²)"),
    ))  # fmt: skip


@pytest.mark.parametrize(
    "file_format", ["uff58", "uff58b", "tdms", "hdf5", "rcmdx", "mat", "mat73", "lvm", "npz", "csv"]
)
def test_every_format_shows_channels_rate_and_impacts(file_format, tmp_path):
    path = tmp_path / f"A7_1.{EXTENSION.get(file_format, file_format)}"
    write(impact_recordings(), path, file_format)
    contents = file_contents(path)
    assert contents.format.removesuffix("b") == file_format.removesuffix("b")
    assert contents.rate.value == pytest.approx(RATE, rel=1e-6) and contents.rate.statements
    assert set(contents.channel_names) == {"hammer", "rail"}
    assert [c.name for c in contents.with_role("force")] == ["hammer"]
    assert [c.name for c in contents.with_role("response")] == ["rail"]
    assert contents.kind == "impacts" and len(contents.events) == len(PEAKS)
    assert [e.size for e in contents.events] == pytest.approx(PEAKS, rel=5e-3)
    force = next(c for c in contents.channels if c.name == "hammer")
    assert force.maximum == pytest.approx(max(PEAKS), rel=5e-3)


def test_the_time_of_an_impact_is_the_start_of_its_force(tmp_path):
    write(impact_recordings(), tmp_path / "a.npz", "npz")
    times = [event.time for event in file_contents(tmp_path / "a.npz").events]
    assert times == pytest.approx([0.02] * 3, abs=2e-4)  # a half-sine exceeds the trigger within a sample or two


def test_the_force_is_identified_by_short_pulses_if_names_and_units_state_nothing(tmp_path):
    write(impact_recordings(), tmp_path / "a.npz", "npz", in_unit("V"))
    contents = file_contents(tmp_path / "a.npz")
    (force,) = contents.with_role("force")
    assert force.name == "AI0" and "pulses are the shortest" in force.role.why
    assert [c.name for c in contents.with_role("response")] == ["AI1"]
    assert contents.events[0].size == pytest.approx(2.0, rel=5e-3)  # 2000 N at 1 mV/N


def test_no_force_is_identified_in_two_responses(tmp_path):
    rng = np.random.default_rng(2)
    np.savez(tmp_path / "a.npz", AI0=rng.normal(size=4000), AI1=rng.normal(size=4000), fs=RATE)
    contents = file_contents(tmp_path / "a.npz")
    assert contents.with_role("force") == () and contents.kind == "" and contents.events == ()


def test_a_train_is_an_interval_of_high_level(tmp_path):
    rng, rate = np.random.default_rng(2), 2000.0
    t = np.arange(int(40 * rate)) / rate
    level = 0.1 + 20.0 * np.exp(-(((t - 17.0) / 1.5) ** 8))  # about 15.5 to 18.5 s
    channels = (Channel("A7", "acceleration"), Channel("A8", "acceleration"))
    write([Recording(rng.normal(size=(2, len(t))) * level, rate, channels, "passage")], tmp_path / "p.h5", "hdf5")
    contents = file_contents(tmp_path / "p.h5")
    assert contents.kind == "trains" and len(contents.events) == 1
    (train,) = contents.events
    assert train.time < 15.5 and train.time + train.size > 18.5 and train.size < 15.0


def test_a_file_without_a_rate_is_reported_without_a_rate(tmp_path):
    (tmp_path / "a.csv").write_text("force [N];rail [m/s²]\n" + "1.5;2.5\n0.5;1.5\n" * 50, encoding="utf-8")
    contents = file_contents(tmp_path / "a.csv")
    assert contents.rate.value is None and contents.kind == ""
    assert [(c.name, c.unit) for c in contents.channels] == [("force", "N"), ("rail", "m/s²")]


def test_a_rising_column_is_identified_as_a_time_axis(tmp_path):
    np.savez(tmp_path / "a.npz", n=np.arange(500.0) * 0.1, AI1=np.random.default_rng(1).normal(size=500), fs=10.0)
    contents = file_contents(tmp_path / "a.npz")
    assert [c.name for c in contents.with_role("time")] == ["n"]


def inspect(capsys, *words):
    code = main(["inspect", *map(str, words)])
    return code, *capsys.readouterr()


def test_the_command_prints_the_content_of_the_file(tmp_path, capsys):
    write(impact_recordings(), tmp_path / "A7_1.h5", "hdf5")
    code, text, _ = inspect(capsys, tmp_path / "A7_1.h5")
    assert code == 0
    for words in ("HDF5 (hdf5)", "3 records of 2000 samples (0.2 s)", "10000 Hz", "'hammer'", "[m/s²]"):
        assert words in text
    low, high = map(float, re.search(r"impacts +3, peaks (\S+) to (\S+) N in 'hammer'", text).groups())
    assert (low, high) == pytest.approx((2000.0, 3000.0), rel=5e-3)


def test_a_folder_gives_one_line_per_file_and_unreadable_files_are_reported(tmp_path, capsys):
    write(impact_recordings(), tmp_path / "A7_1.h5", "hdf5")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "notes.docx").write_text("nothing")
    code, text, _ = inspect(capsys, tmp_path)
    lines = text.splitlines()
    assert code == 1 and len(lines) == 2
    assert "3 impacts" in lines[0] and "not read" in lines[1] and "notes.docx" in lines[1]


def test_json_output_has_the_same_content(tmp_path, capsys):
    write(impact_recordings(), tmp_path / "A7_1.npz", "npz")
    code, text, _ = inspect(capsys, tmp_path / "A7_1.npz", "--json")
    (values,) = json.loads(text)["result"]
    assert code == 0 and values["rate_hz"] == RATE and values["kind"] == "impacts" and values["records"] == 3
    assert [c["name"] for c in values["channels"]] == ["hammer", "rail"] and values["force_candidates"] == ["hammer"]
    assert len(values["impacts"]) == 3 and values["problems"] == []


def test_the_plot_shows_every_channel(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(impact_recordings(), tmp_path / "A7_1.npz", "npz")
    code, text, _ = inspect(capsys, "A7_1.npz", "--plot")
    drawing = (tmp_path / "A7_1.npz.svg").read_text()
    assert code == 0 and "A7_1.npz.svg" in text and drawing.count('<g id="axes_') == 2


def test_frequency_responses_are_identified(tmp_path, capsys):
    f = np.arange(1.0, 500.0)
    np.savez(tmp_path / "frf.npz", frequency=f, frf=1.0 / (100.0**2 - f**2 + 2j * f), units="m/N")
    code, text, _ = inspect(capsys, tmp_path / "frf.npz")
    assert code == 0 and "1 frequency responses of 499 lines" in text and "no impact can be judged" in text


def test_the_hammer_file_of_pyfrf_has_five_impacts(shared_data):
    contents = file_contents(shared_data / "hammer_pyfrf" / "impact2_response0.lvm")
    assert contents.rate.value == 51200.0 and contents.kind == "impacts" and len(contents.events) == 5
    assert {e.record for e in contents.events} == {1, 2, 3, 4, 5} and not contents.has_zone


@pytest.mark.parametrize(
    ("head", "end", "words"),
    [
        ("tip;steel", "\n", None),
        ("started_at;2024-02-30 10:00", "\n", "'2024-02-30 10:00' cannot be read"),
        ("InputGain;10", "\n", "states InputGain = 10"),
        ("NoData;3.5", "\n", "1 sample is missing"),
        ("tip;steel", "\n1;", "may be cut"),
    ],
)
def test_rejections_and_remarks_of_reading_with_a_layout_are_listed_as_problems(head, end, words, tmp_path):
    rows = "\n".join(f"{np.sin(k):.6f};{np.cos(k):.6f}" for k in range(60))
    text = f"rate;5000\n{head}\nforce [N];rail [g]\n3.500000;0.500000\n{rows}{end}"
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    problems = file_contents(tmp_path / "a.csv").problems
    assert any(words in problem for problem in problems) if words else problems == ()


@pytest.mark.parametrize(
    ("events", "words"),
    [
        ([(1, 0.005), (2, 0.005)], "one in each of 2 records, at 0.005 s"),
        ([(1, 0.005), (2, 0.006)], "record 1 at 0.005 s, record 2 at 0.006 s"),
        ([(1, 0.005), (1, 0.005)], "record 1 at 0.005 s, record 1 at 0.005 s"),
        ([(1, 0.005)], "record 1 at 0.005 s"),
    ],
)
def test_impacts_at_the_same_time_of_each_record_are_stated_once(events, words):
    contents = SimpleNamespace(events=[SimpleNamespace(record=record, time=time) for record, time in events])
    assert _event_times(contents) == words
