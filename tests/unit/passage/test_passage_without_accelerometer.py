"""Passages of a turnout without accelerometers have a row that states why they hold no train."""

from datetime import datetime

import numpy as np
import pytest

from turnout.config import load_configuration, with_raw
from turnout.readers.writing import write
from turnout.records import Channel, Recording
from turnout.stages.passage import passage_unit
from turnout.workflow.scan import scan

LAYOUT = """
sections:
  A: {panel: CP, track: main, position: 18.0}
passages:
  files: "passages/{time}.{ext}"
  rate: 5000
  channels:
    gauge: {source: gauge, quantity: strain, unit: m/m, mounting: rail foot, section: A}
    air: {source: air, quantity: temperature, unit: °C, mounting: air, section: A}
"""


@pytest.mark.parametrize("seconds", [2, 600])
def test_a_passage_of_strain_gauges_alone_has_a_row_that_states_that(seconds, tmp_path):
    """Long records, which are read in pieces, and short ones."""
    config = tmp_path / "config"
    (config / "layouts").mkdir(parents=True)
    (config / "config.yaml").write_text("passage: {longest: 300}\n")
    (config / "turnouts.tsv").write_text("turnout\tlayout\nt1\tgauges\n")
    (config / "layouts" / "gauges.yaml").write_text(LAYOUT)
    folder = tmp_path / "raw" / "t1" / "passages"
    folder.mkdir(parents=True)
    strain = 1e-6 * np.random.default_rng(1).normal(size=(2, 5000 * seconds)) + [[0.0], [12.0]]
    channels = (Channel("gauge", "strain"), Channel("air", "temperature"))
    recording = Recording(strain, 5000.0, channels, started_at=datetime(2024, 5, 13, 10))
    write([recording], folder / "20240513T100000Z.h5", "hdf5", single=True)
    turnout = with_raw(load_configuration(config).turnout("t1"), tmp_path / "raw")
    rows = passage_unit(scan(turnout, tmp_path / "raw").units[0], turnout, tmp_path / "raw")
    (row,) = rows["quarantine"]
    assert row["reason_code"] == "no_accelerometer" and "strain and temperature" in row["found"]
    assert len(rows["recordings"]) == 1 and not rows["passages"]
