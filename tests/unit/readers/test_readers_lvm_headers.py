"""Headers of LVM files: lines in any order, and one header above parts of a record instead of several impacts."""

import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE, N_SAMPLE = 20000.0, 400
SENSORS = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
IN_SI = (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²"))
LINES = {
    "Channels": "Channels\t2",
    "Samples": "Samples\t{n}\t{n}",
    "Date": "Date\t2026/05/13\t2026/05/13",
    "Time": "Time\t10:45:47.5\t10:45:47.5",
    "Y_Unit_Label": "Y_Unit_Label\tN\tm/s^2",
    "X_Dimension": "X_Dimension\tTime\tTime",
    "X0": "X0\t0.0\t0.0",
    "Delta_X": "Delta_X\t{dt:.6E}\t{dt:.6E}",
}
ORDERS = {
    "reversed": tuple(LINES)[::-1],
    "channels last": (*tuple(LINES)[1:], "Channels"),
    "step first": ("Delta_X", "Channels", "Samples", "Date", "Time", "Y_Unit_Label", "X_Dimension", "X0"),
}


def impacts(n_impact, n_sample=N_SAMPLE):
    """Noise with a pulse in each of some records, of force and response."""
    rng = np.random.default_rng(4)
    records = rng.normal(size=(n_impact, 2, n_sample)) * [[1.0], [0.1]]
    records[:, 0, 40:60] += 4000.0 * np.hanning(20)
    records[:, 1, 45:] += 60.0 * np.exp(-np.arange(n_sample - 45) / 80.0)
    return records


def text_of(records, order=tuple(LINES), gap="\n", dt=1.0 / RATE, n_stated=None):
    """An LVM text; with ``n_stated`` one header of so many samples stands above all records."""
    parts = ["LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\t\n\t\n"]
    for k, record in enumerate(records):
        if n_stated is None or k == 0:
            lines = [LINES[name].format(n=n_stated or record.shape[1], dt=dt) for name in order]
            parts.append("\n".join([*lines, "***End_of_Header***\t\t", "X_Value\tforce\trail\tComment", ""]))
        parts += [f"\t{a:.6f}\t{b:.6f}\n" for a, b in record.T]
        parts.append(gap if n_stated is None else "")
    return "".join(parts)


def result_of(tmp_path, text, sensors=SENSORS):
    (tmp_path / "a.lvm").write_text(text)
    return read("a.lvm", tmp_path, RawDescription(sensors, rate=RATE))


@pytest.mark.parametrize("gap", ["\n", ""])
@pytest.mark.parametrize("order", ORDERS)
def test_the_lines_of_a_header_may_have_any_order(order, gap, tmp_path):
    records = impacts(3)
    result = result_of(tmp_path, text_of(records, ORDERS[order], gap))
    assert result.errors == ()
    np.testing.assert_allclose([r.samples for r in result.recordings], records, atol=5.1e-7)


@pytest.mark.parametrize("order", ORDERS)
def test_a_step_above_the_number_of_channels_is_compared_with_the_layout(order, tmp_path):
    errors = result_of(tmp_path, text_of(impacts(3), ORDERS[order], dt=1.0 / 25600.0), IN_SI).errors
    assert [error.reason for error in errors] == ["wrong_rate"] * 3


@pytest.mark.parametrize("order", ORDERS)
def test_fewer_samples_than_a_line_above_the_number_of_channels_states_are_an_error(order, tmp_path):
    text = text_of(impacts(1), ORDERS[order]).replace(f"Samples\t{N_SAMPLE}\t{N_SAMPLE}", "Samples\t500\t500")
    (error,) = result_of(tmp_path, text, IN_SI).errors
    assert error.problem == "ends after 400 of 500 samples"


@pytest.mark.parametrize("n_part", [50, 100, 200])
def test_parts_of_a_record_under_one_header_are_no_records(n_part, tmp_path):
    """LabVIEW appends what it has read from the card; the header counts the samples of the first part."""
    (error,) = result_of(tmp_path, text_of(impacts(2), n_stated=n_part)).errors
    assert error.reason == "wrong_length"
    assert f"800 rows follow its header of {n_part} samples, and not each {n_part} have an impact" in error.problem


@pytest.mark.parametrize("strength", [0.25, 0.5, 3.0])
def test_writes_under_one_header_with_an_impact_each_are_records(strength, tmp_path):
    records = impacts(4)
    records[2] *= strength
    result = result_of(tmp_path, text_of(records, n_stated=N_SAMPLE))
    assert result.errors == ()
    np.testing.assert_allclose([r.samples for r in result.recordings], records, atol=5.1e-7)
