"""Rates, scales and sensitivities that a head states for single channels or in words."""

from dataclasses import replace
from datetime import datetime

import h5py
import numpy as np
import pytest
import scipy.io
import soundfile

import turnout
from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
SAMPLES = np.random.default_rng(11).normal(size=(300, 2)) * [900.0, 40.0] + [5.0, -2.0]
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
IN_VOLTS = (
    RawChannel("force", "force", "force", unit="V", sensitivity=0.23, sensitivity_unit="mV/N"),
    RawChannel("rail", "rail", "acceleration", unit="V", sensitivity=10.2, sensitivity_unit="mV/(m/s²)"),
)


def outcome(folder, name, channels=SENSORS, rate=RATE):
    """Samples and remarks, or the error of the only record."""
    result = read(name, folder, RawDescription(channels, rate=rate))
    if not result.recordings:
        return result.errors[0]
    return result.recordings[0].samples.T, result.errors


def text(folder, lines, units=("N", "m/s²"), factors=(1.0, 1.0), columns=None):
    names, rows = ["force", "rail"], SAMPLES * factors
    names += [f"{name}" for name in columns or ()]
    rows = rows if not columns else np.column_stack([rows, *columns.values()])
    head = ";".join(f"{n} [{u}]" for n, u in zip(names, (*units, "°C")))
    body = [";".join(f"{x:.7f}" for x in row) for row in rows]
    (folder / "a.csv").write_text("\n".join([*lines, head, *body, ""]), "utf-8")


PAIRS = [
    ("dt_{}", 5e-5, 1e-4),
    ("{} fs", 20000.0, 10000.0),
    ("Sampling interval ({})", 5e-5, 2e-5),
    ("rate {}", 2e4, 5e4),
]


@pytest.mark.parametrize(("name", "right", "wrong"), PAIRS)
def test_rates_of_single_channels_must_agree(name, right, wrong, tmp_path):
    for of_rail in (right, wrong):
        text(tmp_path, [f"{name.format('force')};{right}", f"{name.format('rail')};{of_rail}"])
        result = outcome(tmp_path, "a.csv")
        if of_rail == wrong:
            assert result.reason == "wrong_rate" and name.format("rail") in str(result)
        else:
            np.testing.assert_allclose(result[0], SAMPLES, atol=1e-6)
            assert not result[1]
            assert outcome(tmp_path, "a.csv", rate=25600.0).reason == "wrong_rate"


def test_rates_of_single_variables_must_agree(tmp_path):
    for of_rail in (RATE, 10000.0):
        variables = {"force": SAMPLES[:, 0], "rail": SAMPLES[:, 1], "fs_force": RATE, "fs_rail": of_rail}
        scipy.io.savemat(tmp_path / f"{of_rail:.0f}.mat", variables)
    np.testing.assert_allclose(outcome(tmp_path, "20000.mat")[0], SAMPLES)
    assert outcome(tmp_path, "10000.mat").reason == "wrong_rate"
    with pytest.raises(ReadError, match="two rates"):
        turnout.read(tmp_path / "10000.mat", channels={"force": "force", "rail": "acceleration"})


def test_the_rate_of_a_channel_that_is_not_used_is_none_of_the_record(tmp_path):
    temperature = 12.0 + np.random.default_rng(2).normal(size=len(SAMPLES))
    text(tmp_path, ["Sampling rate force;20000", "Sampling rate temp;10"], columns={"temp": temperature})
    ignored = RawChannel("temp", "temp", "ignored")
    samples, errors = outcome(tmp_path, "a.csv", (*SENSORS, ignored))
    np.testing.assert_allclose(samples, SAMPLES, atol=1e-6)
    assert not errors
    used = RawChannel("temp", "temp", "temperature")
    assert outcome(tmp_path, "a.csv", (*SENSORS, used)).reason == "wrong_rate"


WORDS = [
    "Sampling: 20000 per second", "Taking 20000 values/s", "Abtastung: 20000 pro Sekunde", "20000 mesures par seconde",
    "Recorded at 20000 readings per second with a filter",
]  # fmt: skip


@pytest.mark.parametrize("line", WORDS)
def test_a_number_per_second_is_a_rate(line, tmp_path):
    text(tmp_path, [line])
    samples, errors = outcome(tmp_path, "a.csv")
    np.testing.assert_allclose(samples, SAMPLES, atol=1e-6)
    assert not errors
    result = outcome(tmp_path, "a.csv", rate=25600.0)
    assert isinstance(result, ReadError) or result[1][0].reason == "entry_unknown"


@pytest.mark.parametrize(
    "line", ["Stroke: 20 mm per second", "Drehzahl: 20 Umdrehungen pro Sekunde", "Hits: 2 per second"]
)
def test_a_number_of_other_things_per_second_is_none(line, tmp_path):
    text(tmp_path, [line])
    assert not outcome(tmp_path, "a.csv")[1]


@pytest.mark.parametrize("name", ["cal_a", "calB", "m_cal", "kalibrierung_k", "Calibration c"])
def test_a_coefficient_of_a_calibration_is_a_remark(name, tmp_path):
    for value in (0.2, 1.0, 0.0):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            for channel, samples, unit in zip(("force", "rail"), SAMPLES.T, ("N", "m/s²")):
                file[channel] = samples
                file[channel].attrs.update(unit=unit, fs=RATE)
            file["force"].attrs[name] = value
        errors = outcome(tmp_path, "a.h5")[1]
        assert [e.reason for e in errors] == (["entry_unknown"] if value == 0.2 else [])


@pytest.mark.parametrize("name", ["Gain (dB)", "Verstärkung [dB]", "gain_dB", "Gain dB"])
def test_a_gain_in_decibels_by_its_name(name, tmp_path):
    for values, is_neutral in (("0;0", True), ("0;20", False), ("1;1", False), ("0 dB;0 dB", True)):
        text(tmp_path, [f"{name};{values}"])
        result = outcome(tmp_path, "a.csv")
        assert isinstance(result, ReadError) is not is_neutral, values
    variables = {"force": SAMPLES[:, 0], "rail": SAMPLES[:, 1], "fs": RATE, "gain_dB": 0.0}
    scipy.io.savemat(tmp_path / "a.mat", variables)
    assert not outcome(tmp_path, "a.mat")[1]


SCALES = [
    ("Scale;4347.83 N/V;98.039 (m/s²)/V", "Scale;4347.83 N/V;980.39 (m/s²)/V"),
    ("EU per V;4347.8;98.04", "EU per V;4347.8;9.804"),
    ("mV/EU;0.23;10.2", "mV/EU;0.23;1.02"),
    ("Conversion;4.3478 kN/V;9.997 g/V", "Conversion;43.478 kN/V;9.997 g/V"),
    ("Kalibrierfaktor force: 4347,8 N/V", "Kalibrierfaktor force: 2173,9 N/V"),
    ("Scale (N/V);4347.8", "Scale (N/V);434.78"),
    ("Wandlerfaktor;0,23;10,2", "Wandlerfaktor;0,23;10,9"),
]


@pytest.mark.parametrize(("right", "wrong"), SCALES)
def test_a_scale_that_is_the_sensitivity_of_the_layout_is_explained_in_a_file_in_volts(right, wrong, tmp_path):
    volts = (0.23e-3, 10.2e-3)
    text(tmp_path, [right], ("V", "V"), volts)
    samples, errors = outcome(tmp_path, "a.csv", IN_VOLTS)
    np.testing.assert_allclose(samples, SAMPLES, atol=1e-3)
    assert not errors
    text(tmp_path, [wrong], ("V", "V"), volts)
    assert outcome(tmp_path, "a.csv", IN_VOLTS).reason == "scale_unknown"
    text(tmp_path, [right])
    assert outcome(tmp_path, "a.csv").reason == "scale_unknown"  # the numbers of a file in N may lack it


def test_a_gain_is_no_sensitivity(tmp_path):
    text(tmp_path, ["Gain;0.23;10.2"], ("V", "V"), (0.23e-3, 10.2e-3))
    assert outcome(tmp_path, "a.csv", IN_VOLTS).reason == "scale_unknown"


STARTS = [
    ("DATE = 13-MAY-2026", "TIME = 08:30:12.250"), ("DATE : 13-MAY-2026", "TIME : 08:30:12.250"),
    ("Date\t= 13.05.2026", "Time\t= 08:30:12.250"), ("START = 2026-05-13 08:30:12.250", "X = 1"),
    ("Begin: 2026-05-13 08:30:12.250", "X: 1"), ("START 2026-05-13 08:30:12.250", "Gate = 1"),
]  # fmt: skip


@pytest.mark.parametrize("separator", [" ", "\t", ";", ","])
@pytest.mark.parametrize("lines", STARTS)
def test_a_mark_between_blanks_ends_the_name_of_a_start(lines, separator, tmp_path):
    rows = [separator.join(f"{x:.6f}" for x in row) for row in SAMPLES]
    head = [*lines, separator.join(("force[N]", "rail[m/s²]"))]
    (tmp_path / "a.txt").write_text("\n".join([*head, *rows, ""]), "utf-8")
    result = read("a.txt", tmp_path, RawDescription(SENSORS, rate=RATE))
    assert result.recordings[0].started_at == datetime(2026, 5, 13, 8, 30, 12, 250_000)
    assert not result.errors


@pytest.mark.parametrize("text_of_scale", ["Full scale 10 V; ch1 0.23 mV/N; ch2 10.2 mV/(m/s2)", "Full scale +/-10V"])
def test_the_full_scale_of_the_layout_is_explained(text_of_scale, tmp_path):
    fractions = SAMPLES * [0.23e-3, 10.2e-3] / 10.0
    for comment in (text_of_scale, text_of_scale.replace("10 V", "5 V").replace("10V", "5V")):
        with soundfile.SoundFile(tmp_path / "a.wav", "w", int(RATE), 2, "PCM_24") as file:
            file.comment = comment
            file.write(fractions)
        channels = tuple(replace(c, unit="10 V", source=i) for i, c in enumerate(IN_VOLTS))
        result = outcome(tmp_path, "a.wav", channels)
        if comment == text_of_scale:
            np.testing.assert_allclose(result[0], SAMPLES, atol=0.01)
            assert not result[1]
        else:
            assert result.reason == "scale_unknown"


SIGNS = [
    ("Inverteret", "nej", "ja", "scale_unknown"), ("Inverterad", "nej", "ja", "scale_unknown"),
    ("Inwersja", "nie", "tak", "scale_unknown"), ("Phase", "0°", "180°", "scale_unknown"),
    ("Orientation", "+Z", "-Z", "entry_unknown"), ("Measuring direction", "up", "down", "entry_unknown"),
    ("Richtung", "z", "-z", "entry_unknown"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "plain", "opposite", "reason"), SIGNS)
def test_the_sign_of_each_channel_in_one_line_or_list(name, plain, opposite, reason, tmp_path):
    """The direction of the force is that of the hammer, and says nothing about the acceleration."""
    for of_rail, of_force in ((plain, plain), (opposite, plain), (plain, opposite)):
        text(tmp_path, [f"{name};{of_force};{of_rail}"])
        with h5py.File(tmp_path / "a.h5", "w") as file:
            for channel, samples, unit in zip(("force", "rail"), SAMPLES.T, ("N", "m/s²")):
                file[channel] = samples
                file[channel].attrs["unit"] = unit
            file.attrs.update({"fs": RATE, name: [of_force, of_rail]})
        for file_name in ("a.csv", "a.h5"):
            result = outcome(tmp_path, file_name)
            errors = [result] if isinstance(result, ReadError) else list(result[1])
            is_reported = opposite in (of_rail, of_force) if reason == "scale_unknown" else of_rail == opposite
            assert [e.reason for e in errors] == [reason] * is_reported, (of_force, of_rail, file_name)


@pytest.mark.parametrize("line", ["Inverter: off", "Inverter frequency;5 kHz", "Wechselrichter/Inverter;ein"])
def test_an_inverter_of_the_supply_is_no_inversion(line, tmp_path):
    text(tmp_path, [line])
    assert not outcome(tmp_path, "a.csv")[1]


def test_the_scale_of_a_channel_in_the_name_of_a_variable_is_that_of_no_other(tmp_path):
    volts = {"force": SAMPLES[:, 0] * 0.23e-3, "rail": SAMPLES[:, 1] * 10.2e-3, "fs": RATE}
    for of_rail in (98.04, 9.804):
        scipy.io.savemat(tmp_path / "a.mat", {**volts, "force_scale": 4347.8, "rail_scale": of_rail})
        result = outcome(tmp_path, "a.mat", IN_VOLTS)
        if of_rail == 98.04:
            np.testing.assert_allclose(result[0], SAMPLES)
            assert not result[1]
        else:
            assert "channel 'rail'" in str(result) and "4347.8" not in str(result)


@pytest.mark.parametrize("line", ["Data logged at 10 values/s in trend file", "Tact: 5 readings per second (display)"])
def test_values_per_second_of_something_else_reject_no_file_that_states_its_rate(line, tmp_path):
    text(tmp_path, ["fs;20000", line])
    np.testing.assert_allclose(outcome(tmp_path, "a.csv")[0], SAMPLES, atol=1e-6)
