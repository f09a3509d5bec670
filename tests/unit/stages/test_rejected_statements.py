"""A statement of a file against its layout gives a row of the quarantine and a line of `check --read`.

Each kind of statement is tested in several formats, as a hammer test of a section in a small project. The row and the
line state the file, the place in it, the problem and the remedy.
"""

import h5py
import nptdms
import numpy as np
import pytest

from turnout.cli.main import main
from turnout.config import load_configuration, with_raw
from turnout.stages.hammer import hammer_unit
from turnout.workflow.guard import compute_guarded
from turnout.workflow.scan import scan

RATE = 20_000.0
NAMES = ("force", "rail")
UNITS = ("N", "m/s²")
START = "2026-05-13T10:00:00"
LAYOUT = """
sections:
  A7: {panel: CP, track: main, position: 24.6}
hammer:
  files: "hammer/{campaign}/{section}_{test}.{ext}"
  time_zone: UTC
  force: force
  response: rail
  channels:
    force: {source: force, quantity: force, unit: N, mounting: hammer}
    rail: {source: rail, quantity: acceleration, unit: m/s², mounting: rail head at sleeper}
"""


def impact():
    """Force and response of one impact on a mass of 250 kg on a spring, resonance at 160 Hz; (2, 4000)."""
    t = np.arange(4000) / RATE
    force = 4000.0 * np.sin(np.pi * (t - 0.01) / 1.2e-3) ** 2 * ((t > 0.01) & (t < 0.0112))
    omega, damping = 2.0 * np.pi * 160.0, 0.08
    unit = np.exp(-damping * omega * t) * np.sin(omega * t) / (250.0 * omega)
    line = 2.0 * np.pi * np.fft.rfftfreq(8000, 1.0 / RATE)
    spectrum = -(line**2) * np.fft.rfft(force, 8000) * np.fft.rfft(unit, 8000) / RATE
    noise = np.random.default_rng(3).normal(size=(2, 4000)) * [[0.5], [0.01]]
    return np.stack([force, np.fft.irfft(spectrum, 8000)[:4000]]) + noise


def write_text(path, facts, quantities, separator=";", n_behind=0):
    """Write text with ``n_behind`` further rows behind an empty line."""
    head = [separator.join(map(str, pair)) for pair in facts.items()]
    head += [separator.join(("Quantity", *quantities))] if quantities else []
    names = separator.join(f"{name} [{unit}]" for name, unit in zip(NAMES, UNITS))
    rows = [separator.join(f"{x:.10g}" for x in row) for row in impact().T]
    behind = ["", *rows[:n_behind]] if n_behind else []
    path.write_text("\n".join([*head, names, *rows, *behind]) + "\n", encoding="utf-8")


def write_tdms(path, facts, quantities):
    """Write a file with the facts as its properties and the quantities as properties of channels."""
    channels = [
        nptdms.ChannelObject("impact", name, x, {"unit_string": unit} | ({"Quantity": q} if q else {}))
        for name, x, unit, q in zip(NAMES, impact(), UNITS, quantities or ("", ""))
    ]
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([nptdms.RootObject(facts), *channels])


def write_hdf5(path, facts, quantities):
    """Write a file with the facts as its attributes and the quantities as attributes of datasets."""
    with h5py.File(path, "w") as file:
        file.attrs.update(facts)
        for name, x, unit, quantity in zip(NAMES, impact(), UNITS, quantities or ("", "")):
            file[name] = x
            file[name].attrs.update({"unit": unit} | ({"Quantity": quantity} if quantity else {}))


WRITERS = {"csv": write_text, "tdms": write_tdms, "h5": write_hdf5}
# Facts of the file, quantities of channels, reason, and words of the message. A fact is an entry beside the start time.
KINDS = {
    "quantity": ({"Sample rate": RATE}, ("force", "displacement"), "unit_unknown", "displacement"),
    "reduction": ({"Sample rate": 2 * RATE, "Decimation": 2}, (), "wrong_rate", "reduction by 2"),
    "scale ratio": ({"Sample rate": RATE, "Gain": "1:10"}, (), "scale_unknown", "1:10"),
    "second start": ({"Sample rate": RATE, "Recorded": "2023-01-05 10:00:00"}, (), "start_unknown", "two start times"),
}  # fmt: skip


@pytest.fixture
def project(tmp_path):
    """(folder of the configuration, raw folder) of a project with one turnout."""
    folder = tmp_path / "config"
    (folder / "layouts").mkdir(parents=True)
    (folder / "layouts" / "mine.yaml").write_text(LAYOUT, encoding="utf-8")
    (folder / "turnouts.tsv").write_text("turnout\tlayout\nt1\tmine\n")
    raw = tmp_path / "raw"
    (raw / "t1" / "hammer" / "2026-05-13").mkdir(parents=True)
    campaigns = "campaign,started_at_utc,rail_temperature_c\n2026-05-13,2026-05-13T09:00,15\n"
    (raw / "t1" / "campaigns.csv").write_text(campaigns)
    return folder, raw


def rows_and_lines(project, capsys):
    """(quarantine rows of a run, exit code and lines of `turnout check --read`)."""
    folder, raw = project
    turnout = with_raw(load_configuration(folder).turnout("t1"), raw)
    (unit,) = scan(turnout, raw).units
    result = compute_guarded(hammer_unit, unit, turnout, raw, "key", "1", True)
    capsys.readouterr()
    code = main(["check", "--read", "--configuration", str(folder), "--raw", str(raw)])
    return result.tables["quarantine"], code, capsys.readouterr().out.splitlines()


def assert_row_and_line(project, capsys, path, reason, words):
    rows, code, lines = rows_and_lines(project, capsys)
    (row,) = [row for row in rows if row["reason_code"] == reason]
    assert row["path"] == path and row["place"] and words in row["found"] and row["remedy"]
    line = f"  {path}, {row['place']}: {row['found']}. {row['remedy']}."
    assert code == 1 and line in lines


@pytest.mark.parametrize("extension", WRITERS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_statement_against_the_layout_gives_a_row_and_a_line(kind, extension, project, capsys):
    facts, quantities, reason, words = KINDS[kind]
    path = f"t1/hammer/2026-05-13/A7_1.{extension}"
    WRITERS[extension](project[1] / path, {"started_at": START, **facts}, quantities)
    assert_row_and_line(project, capsys, path, reason, words)


@pytest.mark.parametrize(("extension", "separator"), [("csv", ";"), ("txt", "\t"), ("asc", ",")])
def test_rows_behind_an_empty_line_give_a_row_and_a_line(extension, separator, project, capsys):
    """Only text formats have lines."""
    path = f"t1/hammer/2026-05-13/A7_1.{extension}"
    write_text(project[1] / path, {"started_at": START, "Sample rate": RATE}, (), separator, 2)
    assert_row_and_line(project, capsys, path, "wrong_length", "an empty line stands before its last 2 rows")


@pytest.mark.parametrize("extension", WRITERS)
def test_a_file_that_agrees_with_its_layout_gives_no_row_and_no_fault(extension, project, capsys):
    path = project[1] / f"t1/hammer/2026-05-13/A7_1.{extension}"
    WRITERS[extension](path, {"started_at": START, "Sample rate": RATE}, ("force", "acceleration"))
    rows, code, lines = rows_and_lines(project, capsys)
    assert rows == [] and code == 0
    assert any(f"A7_1.{extension}: agrees: 1 record of 4000 samples at 20000 Hz" in line for line in lines)
