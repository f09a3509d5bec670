"""Sensitivities that a file states beside other words: compared with the layout, or reported, never passed over."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
FORCE, RAIL = np.random.default_rng(7).normal(size=(2, 400))
GRAVITY = 9.80665  # m/s², of one g
# One text each for a sensor of 100 mV/g. Each stands behind other words or before them.
OF_100_MV_PER_G = [
    "100 mV/g (Datenblatt)",
    "rund 100 mV/g",
    "≈100 mV/g",
    "100 mV/g @ 80 Hz",
    "100 mV/g ± 3 %",
    "100 mV/g, Kabel 3 m",
    "100 mV/g; ICP",
    "100 mV/g pk",
    "100 mV pro g",
    "mV/g 100",
    "100 [mV/g]",
    "S0=0,1 V/g (neu)",
    "0,01 g/mV",
    "10 g/V lt. Protokoll 7",
    "10,197 mV/(m/s²) bei 20 °C",
    "100.0 mV/g 12/2023",
]
NAMES = ["Sensitivity rail", "Citlivost rail", "Czułość rail", "Känslighet rail", "Sensibilité rail", "Aufnehmer rail"]


def layout(rail, unit="mV/(m/s²)"):
    return RawDescription(
        (
            RawChannel("force", "force", "force", unit="mV", sensitivity=1.0, sensitivity_unit="mV/N"),
            RawChannel("rail", "rail", "acceleration", unit="mV", sensitivity=rail, sensitivity_unit=unit),
        ),
        rate=RATE,
    )


def outcome(name, root, description):
    """(number of records, reasons of the errors)."""
    try:
        result = read(name, root, description)
    except ReadError as error:
        return 0, [error.reason]
    return len(result.recordings), [error.reason for error in result.errors]


def table(tmp_path, head):
    rows = "".join(f"{f:.5f};{r:.5f}\n" for f, r in zip(FORCE, RAIL))
    (tmp_path / "a.csv").write_text(f"{head}\nforce;rail\n{rows}", encoding="utf-8")
    return "a.csv"


@pytest.mark.parametrize("text", OF_100_MV_PER_G)
def test_a_sensitivity_among_other_words_is_compared(text, tmp_path):
    name = table(tmp_path, f"Sensitivity rail: {text}")
    assert outcome(name, tmp_path, layout(100.0 / GRAVITY)) == (1, [])
    assert outcome(name, tmp_path, layout(1.0)) == (0, ["scale_unknown"])


@pytest.mark.parametrize("name", NAMES)
def test_its_name_may_be_any(name, tmp_path):
    head = table(tmp_path, f"{name}: Typ A, 100 mV/g")
    assert outcome(head, tmp_path, layout(100.0, "mV/g")) == (1, [])
    assert outcome(head, tmp_path, layout(10.0, "mV/g")) == (0, ["scale_unknown"])


@pytest.mark.parametrize(
    "text", ["rail 100 mV/g", "Sensor rail: Wilcoxon 736, 100 mV/g", "Sensitivity: 100 mV/g (nominal)"]
)
def test_a_text_at_a_channel_may_state_it(text, tmp_path):
    assert outcome(table(tmp_path, text), tmp_path, layout(100.0, "mV/g"))[0] == 1
    assert outcome(table(tmp_path, text), tmp_path, layout(1.0)) == (0, ["scale_unknown"])


@pytest.mark.parametrize("text", ["Wilcoxon 736 S/N 4711, 100 mV/g", "neuer Sensor mit 100 mV/g", "Sensor: 100 mV/g"])
def test_a_free_text_without_a_channel_is_a_remark(text, tmp_path):
    assert outcome(table(tmp_path, text), tmp_path, layout(100.0, "mV/g")) == (1, [])
    name = table(tmp_path, text)
    assert outcome(name, tmp_path, layout(1.0)) == (1, ["entry_unknown"])
    checked = replace(layout(1.0), checked_entries=(text.partition(":")[0], "text"))
    assert outcome(name, tmp_path, checked) == (1, [])


@pytest.mark.parametrize(
    "text",
    [
        *["# Spare sensor: PCB 353B03, 10 mV/g", "# Ch4 sensitivity: 500 mV/g (not used)"],
        *["Hammer: 086D20 (nominal 2 mV/N)", "Sensitivity rail: see layout", "Sensitivity: ok", "Sensitivity: nominal"],
        *[
            "Sensitivity: 1 V/V",
            "Sensitivity: 1000 mV/EU",
            "Sensitivity check: 13.05.2024",
            "Sensitivity drift: < 0.5 %",
        ],
        *["Sensitivity calibrated: yes", "Sensitivity valid: 2025", "Sensitivity rail: high"],
    ],
)
def test_what_is_said_about_other_sensors_and_gains_is_not_reported(text, tmp_path):
    assert outcome(table(tmp_path, text), tmp_path, layout(100.0, "mV/g")) == (1, [])


def test_a_sensor_that_is_not_in_use_costs_no_file(tmp_path):
    assert outcome(table(tmp_path, "# Former sensor: 500 mV/g"), tmp_path, layout(100.0, "mV/g"))[0] == 1


@pytest.mark.parametrize(
    "rows",
    [
        "Sensitivity;1;10.197\nSensitivity unit;mV/N;mV/(m/s²)",
        "Sensitivity;1;100\nSensitivity unit;mV/N;mV/g",
        "Sensitivity unit;mV/N;mV/g\nSensitivity;1;100",
        "Empfindlichkeit;1,0;100,0\nEinheit Empfindlichkeit;mV/N;mV/g",
        "Sensitivity;1 mV/N;100 mV/g",
    ],
)
def test_rows_of_sensitivities_and_their_units_are_those_of_the_columns(rows, tmp_path):
    """Formerly, the units of the sensitivities were taken as those of the channels."""
    name = table(tmp_path, rows)
    assert outcome(name, tmp_path, layout(100.0, "mV/g")) == (1, [])
    assert outcome(name, tmp_path, layout(100.0 / GRAVITY)) == (1, [])
    assert outcome(name, tmp_path, layout(35.0, "mV/g")) == (0, ["scale_unknown"])


def test_a_unit_beside_a_condition_is_none_of_a_channel(tmp_path):
    head = '# {"temperature": {"value": 12.5, "unit": "°C"}, "speed": {"value": 80, "unit": "km/h"}}'
    assert outcome(table(tmp_path, head), tmp_path, layout(100.0, "mV/g")) == (1, [])
    of_channel = '# {"rail": {"unit": "km/h"}}'
    assert outcome(table(tmp_path, of_channel), tmp_path, layout(100.0, "mV/g")) == (0, ["unit_unknown"])


def test_the_sensitivity_of_the_channel_itself_counts_more_than_one_of_no_channel(tmp_path):
    name = table(tmp_path, "# spare sensor 9.81 mV/g in the case\n# sensitivity rail 100 mV/g (2024)")
    assert outcome(name, tmp_path, layout(1.0)) == (0, ["scale_unknown"])


@pytest.mark.parametrize("value", ["g/100 mV", "98 pC/g", "100 of the old unit"])
@pytest.mark.parametrize("name", ["Sensitivity rail", "Empfindlichkeit rail", "Citlivost rail"])
def test_one_that_cannot_be_compared_is_reported(name, value, tmp_path):
    head = table(tmp_path, f"{name}: {value}")
    assert outcome(head, tmp_path, layout(100.0, "mV/g")) == (1, ["entry_unknown"])
    in_si = RawDescription(
        (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²")),
        rate=RATE,
    )
    assert outcome(head, tmp_path, in_si) == (1, [])  # it converts nothing


@pytest.mark.parametrize(
    "line",
    ["Sensitivity rail: n/a", "Trigger sensitivity: high", "Sensitivity date: 2024-01-13", "Sensitivity unit: mV/g"],
)
def test_what_is_no_sensitivity_is_not_reported(line, tmp_path):
    assert outcome(table(tmp_path, line), tmp_path, layout(100.0, "mV/g")) == (1, [])


def test_a_line_with_the_sensitivities_of_all_channels_is_compared(tmp_path):
    name = table(tmp_path, "Citlivost [mV/EU];1;10.2")
    assert outcome(name, tmp_path, layout(10.2)) == (1, [])
    assert outcome(name, tmp_path, layout(35.0)) == (0, ["scale_unknown"])


@pytest.mark.parametrize(
    "attributes",
    [
        {"sensitivity": "100 mV/g, IEPE"},
        {"sensitivity": 100.0, "sensitivity_unit": "mV/g"},
        {"sensor": "type 8702 with 100 mV/g"},
    ],
)
def test_an_attribute_of_hdf5_is_compared(attributes, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["fs"] = RATE
        file["force"], file["rail"] = FORCE, RAIL
        file["rail"].attrs.update(attributes)
    assert outcome("a.h5", tmp_path, layout(100.0 / GRAVITY)) == (1, [])
    assert outcome("a.h5", tmp_path, layout(1.0)) == (0, ["scale_unknown"])


def test_a_property_of_tdms_is_compared(tmp_path):
    step = {"wf_increment": 1.0 / RATE}
    stated = {"Sensitivity": "100 mV/g (cal. 2024-01)"}
    with TdmsWriter(str(tmp_path / "a.tdms")) as file:
        channels = ChannelObject("g", "force", FORCE, step), ChannelObject("g", "rail", RAIL, step | stated)
        file.write_segment(list(channels))
    assert outcome("a.tdms", tmp_path, layout(100.0 / GRAVITY)) == (1, [])
    assert outcome("a.tdms", tmp_path, layout(1.0)) == (0, ["scale_unknown"])
