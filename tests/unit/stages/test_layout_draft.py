"""`turnout layout new` writes a draft that `turnout check` accepts; `check --read` compares it with the files."""

import re
from dataclasses import replace
from datetime import datetime

import h5py
import numpy as np
import pytest

from turnout.cli.main import main
from turnout.config.load import load_layout
from turnout.errors import ConfigError
from turnout.readers.writing import write
from turnout.records import Channel, RawChannel, RawDescription, Recording
from turnout.report.contents_text import contents_lines
from turnout.stages.file_contents import file_contents
from turnout.stages.layout_draft import decisions, layout_draft

RATE = 20_000.0
MASS, FREQUENCY, DAMPING = 250.0, 160.0, 0.08  # kg, Hz and damping ratio of the only mode


def hammer_test(scale=1.0, rate=RATE):
    """Four impacts of 1.2 ms on a mass on a spring; the response is multiplied by ``scale``."""
    rng = np.random.default_rng(3)
    t = np.arange(4000) / rate
    omega = 2.0 * np.pi * FREQUENCY
    damped = omega * np.sqrt(1.0 - DAMPING**2)
    unit = np.exp(-DAMPING * omega * t) * np.sin(damped * t) / (MASS * damped)
    recordings = []
    for peak in (4000.0, 4400.0, 3700.0, 4100.0):
        force = peak * np.sin(np.pi * (t - 0.01) / 1.2e-3) ** 2 * ((t > 0.01) & (t < 0.0112))
        spectrum = np.fft.rfft(force, 8000) * np.fft.rfft(unit, 8000)
        line = 2.0 * np.pi * np.fft.rfftfreq(8000, 1.0 / rate)
        rail = np.fft.irfft(-(line**2) * spectrum, 8000)[:4000] / rate
        samples = np.stack([force, scale * rail]) + rng.normal(size=(2, 4000)) * [[0.5], [0.01 * scale]]
        recordings.append(Recording(samples, rate, (Channel("force", "force"), Channel("rail", "acceleration"))))
    return recordings


def passage():
    rng = np.random.default_rng(1)
    channels = (Channel("A7 web", "acceleration"), Channel("A8 web", "acceleration"))
    return Recording(rng.normal(size=(2, 8000)) * 5.0, 2000.0, channels, "passage")


@pytest.fixture
def configuration(tmp_path):
    folder = tmp_path / "config"
    (folder / "layouts").mkdir(parents=True)
    (folder / "turnouts.tsv").write_text("turnout\tlayout\n")
    return folder


def write_files(tmp_path, scale=1.0, labels=("A7", "A8"), rate=RATE):
    folder = tmp_path / "raw" / "t1" / "hammer" / "2026-05-13"
    folder.mkdir(parents=True, exist_ok=True)
    campaigns = "campaign,started_at_utc,rail_temperature_c\n2026-05-13,2026-05-13T09:00,15\n"
    (tmp_path / "raw" / "t1" / "campaigns.csv").write_text(campaigns)
    paths = [folder / f"{label}_1.h5" for label in labels]
    for k, path in enumerate(paths):
        write(hammer_test(scale * (1.0 + 1e-6 * k), rate), path, "hdf5")  # so that no file is a copy of the first
    return paths


def make_layout(configuration, *paths, name="mine"):
    return main(["layout", "new", "--from", *map(str, paths), "--name", name, "--configuration", str(configuration)])


def check(configuration, tmp_path, *more):
    return main(["check", "--configuration", str(configuration), "--raw", str(tmp_path / "raw"), *more])


def test_the_draft_of_hammer_files_is_accepted_and_reads_them(configuration, tmp_path, capsys):
    assert make_layout(configuration, *write_files(tmp_path)) == 0
    output = capsys.readouterr().out
    assert "section" not in output or "position" in output
    layout = load_layout(configuration / "layouts" / "mine.yaml")
    assert [s.label for s in layout.sections] == ["A7", "A8"]
    description = layout.hammer.descriptions["A7"]
    assert (description.rate, description.n_records, description.n_samples) == (RATE, 4, 4000)
    assert layout.hammer.force["A7"] == "force" and layout.hammer.response["A7"] == "rail"
    assert [(c.source, c.quantity, c.unit) for c in description.channels] == [
        ("force", "force", "N"),
        ("rail", "acceleration", "m/s²"),
    ]
    (configuration / "turnouts.tsv").write_text("turnout\tlayout\nt1\tmine\n")
    assert check(configuration, tmp_path) == 0
    assert check(configuration, tmp_path, "--read") == 0
    text = capsys.readouterr().out
    assert text.count(": agrees: 4 records of 4000 samples at 20000 Hz") == 2


def test_the_stiffness_of_a_mass_on_a_spring_is_printed(configuration, tmp_path, capsys):
    make_layout(configuration, *write_files(tmp_path))
    (configuration / "turnouts.tsv").write_text("turnout\tlayout\nt1\tmine\n")
    check(configuration, tmp_path, "--read", "--turnout", "t1")
    found = float(re.search(r"dynamic stiffness \(.*\) (\S+) MN/m", capsys.readouterr().out)[1])
    omega = 2.0 * np.pi * np.linspace(80.0, 300.0, 500)
    spring = MASS * (2.0 * np.pi * FREQUENCY) ** 2
    exact = np.abs(spring - MASS * omega**2 + 2j * DAMPING * np.sqrt(spring * MASS) * omega)
    assert found == pytest.approx(np.median(exact) / 1e6, rel=0.1)  # the command takes the median over other lines


@pytest.mark.parametrize("factor", [1000.0, 1e-3, 1 / 9.80665, 25.4])
def test_an_implausible_scale_of_the_response_is_reported(factor, configuration, tmp_path, capsys):
    make_layout(configuration, *write_files(tmp_path, factor))
    (configuration / "turnouts.tsv").write_text("turnout\tlayout\nt1\tmine\n")
    assert check(configuration, tmp_path, "--read") == 1
    text = capsys.readouterr().out
    assert "rails 54E1" in text and "Look at unit, sensitivity" in text and "dynamic stiffness" in text


def test_a_rate_that_contradicts_the_layout_is_reported(configuration, tmp_path, capsys):
    make_layout(configuration, *write_files(tmp_path))
    write_files(tmp_path, labels=("A8",), rate=25_600.0)
    (configuration / "turnouts.tsv").write_text("turnout\tlayout\nt1\tmine\n")
    assert check(configuration, tmp_path, "--read") == 1
    text = capsys.readouterr().out
    assert "t1, A7: t1/hammer/2026-05-13/A7_1.h5: agrees" in text
    assert "t1, A8: t1/hammer/2026-05-13/A8_1.h5: 1 fault:" in text and "25600 Hz instead of 20000 Hz" in text


def test_the_draft_asks_for_what_the_files_do_not_state(tmp_path, configuration):
    volts = RawDescription((
        RawChannel("force", "AI0", "force", "V", 1.0, "mV/N"),
        RawChannel("rail", "AI1", "acceleration", "V", 10.0, "mV/(m/s²)"),
    ))  # fmt: skip
    write(hammer_test(), tmp_path / "log 17.npz", "npz", volts)
    draft = layout_draft([file_contents(tmp_path / "log 17.npz")])
    questions = " ".join(decisions(draft))
    assert "file names, such as hammer/2026-05-13/S1_1.npz" in questions and "from the calibration sheet" in questions
    assert "zone" not in questions  # the file states no time
    path = configuration / "layouts" / "mine.yaml"
    path.write_text(draft, encoding="utf-8")
    channels = load_layout(path).hammer.descriptions["S1"].channels
    assert [(c.source, c.quantity, c.unit) for c in channels] == [
        ("AI0", "force", None),
        ("AI1", "acceleration", None),
    ]


def test_the_draft_fixes_no_length_for_a_logger_that_records_continuously(tmp_path, configuration):
    """Four impacts in one record: the next test may be longer. Four records of one impact: the number is fixed."""
    tests = hammer_test()
    samples = np.concatenate([np.pad(r.samples, ((0, 0), (0, 12_000))) for r in tests], axis=1)
    one = Recording(samples, RATE, tests[0].channels)
    one = replace(one, started_at=datetime(2026, 5, 13, 9))
    write([one], tmp_path / "A7_1.h5", "hdf5")
    draft = layout_draft([file_contents(tmp_path / "A7_1.h5")])
    assert "records: null" in draft and "samples: null" in draft
    triggered = layout_draft([file_contents(write_files(tmp_path)[0])])
    assert "records: 4" in triggered and "samples: 4000" in triggered


def test_the_draft_asks_about_unexplained_metadata(tmp_path, configuration):
    """An unexplained number may be another rate; entries that agree or concern something else cause no question."""
    path = write_files(tmp_path)[0]
    with h5py.File(path, "a") as file:
        file.attrs.update({"Nube": 51.2, "Rate of sampling": RATE, "Operator": "A. Jensen"})
    contents = file_contents(path)
    assert contents.unexplained == (("Nube", "51.2"),)
    assert "unknown    Nube: 51.2 may state" in "\n".join(contents_lines(contents))
    draft = layout_draft([contents])
    (questions,) = [d for d in decisions(draft) if "Nube" in d]
    assert "Nube is 51.2" in questions
    layout = configuration / "layouts" / "mine.yaml"
    layout.write_text(draft.replace("# checked_entries", "checked_entries"), encoding="utf-8")
    assert load_layout(layout).hammer.descriptions["A7"].checked_entries == ("Nube",)


def test_the_draft_asks_for_a_time_zone_that_the_file_does_not_state(tmp_path):
    contents = file_contents(write_files(tmp_path)[0])
    at = datetime(2026, 5, 13, 9)
    without_zone = replace(contents, starts=(at, at), has_zone=False)
    assert "zone" in " ".join(decisions(layout_draft([without_zone])))
    assert "zone" not in " ".join(decisions(layout_draft([replace(without_zone, has_zone=True)])))


def test_a_file_of_passages_gives_a_layout_of_passages(tmp_path, configuration):
    write([passage()], tmp_path / "20260513T100000Z.h5", "hdf5")
    assert make_layout(configuration, tmp_path / "20260513T100000Z.h5", *write_files(tmp_path)) == 0
    layout = load_layout(configuration / "layouts" / "mine.yaml")
    assert [c.name for c in layout.passages.description.channels] == ["A7_web", "A8_web"]
    assert layout.passages.description.rate == 2000.0 and layout.hammer is not None
    text = (configuration / "layouts" / "mine.yaml").read_text()
    assert re.findall(r"section: (\w+)", text) == ["A7", "A8"]


def test_an_existing_layout_is_not_overwritten(configuration, tmp_path, capsys):
    (configuration / "layouts" / "mine.yaml").write_text("mine")
    assert make_layout(configuration, *write_files(tmp_path)) == 2
    assert "there is such a layout already" in capsys.readouterr().err
    assert (configuration / "layouts" / "mine.yaml").read_text() == "mine"


def test_files_with_different_channels_give_an_error_and_no_draft(tmp_path):
    first, second = write_files(tmp_path)
    renamed = [
        Recording(r.samples, r.rate, (Channel("hammer", "force"), Channel("rail", "acceleration")))
        for r in hammer_test()
    ]
    write(renamed, second, "hdf5")
    with pytest.raises(ConfigError, match=r"its channels are hammer, rail, those of A7_1\.h5 force, rail"):
        layout_draft([file_contents(first), file_contents(second)])


@pytest.mark.parametrize(("sign", "name"), [(1, "rail"), (-1, "rail -Z")])
def test_the_draft_has_the_signs_that_the_file_shows(sign, name, tmp_path):
    """That of the force by its impacts, that of the response by its direction; a comment mentions the other signs."""
    channels = (Channel("force", "force"), Channel(name, "acceleration"))
    turned = [replace(r, samples=r.samples * [[sign], [1.0]], channels=channels) for r in hammer_test()]
    write(turned, tmp_path / "A7_1.h5", "hdf5")
    draft = layout_draft([file_contents(tmp_path / "A7_1.h5")])
    assert len(re.findall(r"^ +# sign: -1  if", draft, re.MULTILINE)) == (2 if sign > 0 else 0)
    signs = re.findall(r"^ +sign: (.*)", draft, re.MULTILINE)
    assert [text.startswith("-1") for text in signs] == ([] if sign > 0 else [True, True])
    assert any("the file states 'rail -Z'" in text for text in decisions(draft)) == (sign < 0)
