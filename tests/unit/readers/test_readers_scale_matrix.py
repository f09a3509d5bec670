"""Every format with scale, unit, offset, fill value and sensitivity: right, wrong, missing or overridden.

Each file is read to within rounding or rejected; nothing is misread without a message.
"""

import json
from dataclasses import replace

import h5py
import nptdms
import numpy as np
import pytest
from tests.unit.readers.test_readers_rate_matrix import (
    FORMATS,
    SAMPLES,
    SENSORS,
    TRUE,
    UNITS,
    plain,
    write_csv,
    write_lvm,
)

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

# Name of the entry, its neutral value, and a value that changes the numbers.
SCALES = [
    ("gain", 1.0, 0.4),
    ("Scale factor", 1.0, "0.4 N/V"),
    ("Gain", "0 dB", "20 dB"),
    ("scale_factor", 1.0, 0.4),
    ("add_offset", 0.0, 5.0),
    ("Offset", "0", "2,5"),
    ("Slope", 1, 12),
    ("Verstärkung", "1,0", "10"),
    ("Facteur d'échelle", 1.0, 4.448),
    ("Skalafaktor", 1.0, 9.81),
    ("Factor de escala", 1.0, 1000.0),
    ("Fattore di scala", 1.0, 25.4),
    ("Nullpunkt", 0.0, -3.0),
]
LAYOUT = RawDescription(SENSORS, rate=TRUE)
OVERRIDDEN = RawDescription(tuple(replace(s, unit=f"{s.unit}!") for s in SENSORS), rate=TRUE)
SCALED = RawDescription(tuple(replace(s, unit=f"0.4 {s.unit}!") for s in SENSORS), rate=TRUE)


def written(format, tmp_path, entries):
    writer, name, _ = FORMATS[format]
    writer(tmp_path / name, entries)
    return name


def outcome(name, folder, layout):
    """(samples, errors) of the only record."""
    try:
        result = read(name, folder, layout)
    except ReadError as error:
        return None, (error,)
    return (result.recordings[0].samples if result.recordings else None), result.errors


def is_rejected(found, reason, *words):
    samples, errors = found
    return samples is None and errors[0].reason == reason and all(w.lower() in str(errors[0]).lower() for w in words)


def is_read(found, expected=SAMPLES):
    return found[0] is not None and not found[1] and np.allclose(found[0], expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("format", FORMATS)
def test_a_stated_scale_is_neutral_overridden_or_rejected(format, tmp_path):
    for name, neutral, value in SCALES:
        if format == "uff" and not name.isascii():
            continue
        word = plain(name) if format == "mat" else name
        word = word.removeprefix("Facteur_d")
        path = written(format, tmp_path, [(name, neutral)])
        assert is_read(outcome(path, tmp_path, LAYOUT)), (name, neutral)
        path = written(format, tmp_path, [(name, value)])
        assert is_rejected(outcome(path, tmp_path, LAYOUT), "scale_unknown", word), (name, value)
        assert is_read(outcome(path, tmp_path, OVERRIDDEN)), (name, value)
        assert is_read(outcome(path, tmp_path, SCALED), 0.4 * SAMPLES), (name, value)
        path = written(
            format, tmp_path, [("tip", "steel"), (name, value)]
        )  # in a nested entry, if the format has such entries
        found = outcome(path, tmp_path, LAYOUT)
        assert is_rejected(found, "scale_unknown", word) or (format == "hdf5" and name in CF), (name, value, "nested")


CF = ("scale_factor", "add_offset")  # on a dataset of HDF5 they are applied


def test_packing_of_netcdf_is_applied_to_its_dataset(tmp_path):
    FORMATS["hdf5"][0](tmp_path / "a.h5", [])
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["force"].attrs.update({"scale_factor": 0.4, "add_offset": 5.0})
    assert is_read(outcome("a.h5", tmp_path, LAYOUT), [0.4 * SAMPLES[0] + 5.0, SAMPLES[1]])


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("name", ["_FillValue", "missing_value", "NoData"])
def test_samples_that_equal_a_stated_fill_value_are_missing(format, name, tmp_path):
    other = written(format, tmp_path, [(name, -999.0)])
    assert is_read(outcome(other, tmp_path, LAYOUT))
    fill = float(outcome(other, tmp_path, LAYOUT)[0][0, 20])  # as it is printed in the file
    path = written(format, tmp_path, [(name, fill if format != "uff" else repr(fill))])
    assert is_rejected(outcome(path, tmp_path, LAYOUT), "not_finite")


@pytest.mark.parametrize("format", FORMATS)
def test_a_unit_of_the_file_that_differs_from_the_layout_is_rejected(format, tmp_path):
    if format in ("npz", "mat", "parquet", "hdf5"):
        pytest.skip("these files of the matrix state no unit; the layout states it")
    path = written(format, tmp_path, [])
    for unit in ("kN", "lbf", "V", "m/s²"):
        layout = RawDescription((RawChannel("force", "force", "force", unit=unit), SENSORS[1]), rate=TRUE)
        assert outcome(path, tmp_path, layout)[0] is None
    assert (
        outcome(path, tmp_path, replace(LAYOUT, channels=(replace(SENSORS[0], unit=None), SENSORS[1])))[0] is not None
    )


def test_a_unit_in_the_name_that_contradicts_the_stated_unit_is_rejected(tmp_path):
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        channels = [nptdms.ChannelObject("impact", "force [kN]", SAMPLES[0], {"unit_string": "N"})]
        channels += [nptdms.ChannelObject("impact", "rail", SAMPLES[1], {"unit_string": "m/s²"})]
        writer.write_segment(channels)
    layout = replace(LAYOUT, channels=(replace(SENSORS[0], source="force [kN]"), SENSORS[1]))
    assert is_rejected(outcome("a.tdms", tmp_path, layout), "unit_unknown", "'force [kN]' say 'kN', its unit 'N'")


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("name", ["Sensitivity", "Sensor sensitivity", "Empfindlichkeit"])
def test_a_sensitivity_of_the_file_is_compared_with_that_of_the_layout(format, name, tmp_path):
    force = RawChannel("force", "force", "force", unit="V", sensitivity=0.23, sensitivity_unit="mV/N")
    layout = RawDescription((force, RawChannel("rail", "rail", "ignored")), rate=TRUE)
    if format in ("csv", "tdms", "wav", "lvm", "uff", "rcmdx"):  # these files state N
        layout = replace(layout, channels=(replace(force, unit="V!"), layout.channels[1]))
        assert outcome(written(format, tmp_path, [(name, 1.1)]), tmp_path, layout)[0] is not None
        return
    for stated, is_right in ((0.23, True), ("0.231 mV/N", True), (1.1, False), ("2.2 mV/N", False)):
        found = outcome(written(format, tmp_path, [(name, stated)]), tmp_path, layout)
        assert is_read(found, SAMPLES[:1] / 0.23e-3) if is_right else is_rejected(found, "scale_unknown", "0.23 mV/N")


def test_a_sensitivity_in_the_header_of_text_in_volts_is_compared(tmp_path):
    write_csv(tmp_path / "a.csv", [("Empfindlichkeit", "2,2 mV/N")])
    text = (tmp_path / "a.csv").read_text(encoding="utf-8").replace("force [N]", "force [V]")
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    for sensitivity, is_right in ((2.2, True), (0.23, False)):
        force = RawChannel("force", "force", "force", unit="V", sensitivity=sensitivity, sensitivity_unit="mV/N")
        found = outcome("a.csv", tmp_path, RawDescription((force, SENSORS[1]), rate=TRUE))
        assert (found[0] is not None) == is_right


NESTED = [  # metadata of a file, and the channels whose scale is undecided
    ({"sensors": {"force": {"gain": 10}, "rail": {"gain": 1}}}, {"force"}),
    ({"sensors": {"force": {"gain": 1}, "rail": {"gain": 10}}}, {"rail"}),
    ({"sensors": [{"name": "force", "gain": 10}, {"name": "rail", "gain": 1}]}, {"force"}),
    ({"sensors": [{"name": "spare", "gain": 10}, {"name": "rail", "gain": 1}]}, {"force", "rail"}),
    ({"gain": {"force": 10, "rail": 1}}, {"force"}),
    ({"setup": {"gain": 10, "force": {"gain": 1}, "rail": {"gain": 1}}}, set()),
    ({"setup": {"gain": 1, "force": {"gain": 10}}}, {"force"}),
    ({"amplifier": {"gain": 10}, "logger": {"gain": 1}}, {"force", "rail"}),
]


@pytest.mark.parametrize("format", ["hdf5", "parquet", "npz", "wav"])
@pytest.mark.parametrize(("facts", "undecided"), NESTED)
def test_each_nested_scale_is_used_for_the_channel_of_its_entry(format, facts, undecided, tmp_path):
    path = tmp_path / FORMATS[format][1]
    FORMATS[format][0](path, [(k, v if format == "wav" else json.dumps(v)) for k, v in facts.items()][:1])
    if len(facts) > 1:
        FORMATS[format][0](path, [("about", facts if format == "wav" else json.dumps(facts))])
    if format == "hdf5":
        with h5py.File(path, "r+") as file:
            del file["about"]
            file.attrs.update({name: json.dumps(value) for name, value in facts.items()})
    for sensor in SENSORS:
        others = [replace(s, quantity="ignored") for s in SENSORS if s is not sensor]
        found = outcome(path.name, tmp_path, RawDescription((sensor, *others), rate=TRUE))
        if sensor.name in undecided:
            assert is_rejected(found, "scale_unknown", "gain of force = 10" if "gain" in facts else "gain = 10")
        else:
            assert is_read(found, SAMPLES[[SENSORS.index(sensor)]])


def test_the_scale_of_a_group_overrides_that_of_its_parent(tmp_path):
    for outer, inner in ((10.0, 1.0), (1.0, 10.0)):
        for nested in (False, True):
            with h5py.File(tmp_path / "a.h5", "w") as file:
                group = file.create_group("record_000")
                for place, gain in ((file, outer), (group, inner)):
                    place.attrs.update({"setup": json.dumps({"gain": gain})} if nested else {"gain": gain})
                group["force"], group["rail"] = SAMPLES
            found = outcome("a.h5", tmp_path, LAYOUT)
            assert is_read(found) if inner == 1.0 else is_rejected(found, "scale_unknown", "gain = 10")


NOT_UNDERSTOOD = ["10:1", "1:10", "ten", "1 of 10", "1 k", "10 per V"]


@pytest.mark.parametrize("format", FORMATS)
def test_a_stated_scale_that_is_not_understood_is_rejected_with_its_value(format, tmp_path):
    for value in NOT_UNDERSTOOD:
        if format == "uff" and value in ("ten", "10:1", "1:10", "1 of 10", "10 per V"):
            continue  # free text: only pieces of a word and a number are entries
        found = outcome(written(format, tmp_path, [("gain", value)]), tmp_path, LAYOUT)
        assert is_rejected(found, "scale_unknown", repr(value)), value
    for value, text in (("20dB", "10"), ("10x", "10"), ("1 kN/V", "1000"), ("-6.0206dB", "0.5")):
        found = outcome(written(format, tmp_path, [("gain", value)]), tmp_path, LAYOUT)
        assert is_rejected(found, "scale_unknown", f"gain = {text}"), value
    for value in ("0dB", "1x", "1 V/V", "unity", "n/a"):
        assert is_read(outcome(written(format, tmp_path, [("gain", value)]), tmp_path, LAYOUT)), value


@pytest.mark.parametrize(
    ("line", "undecided"),
    [
        ("Gain\t1\t10\t", {"rail"}),
        ("Gain\t10\t1\t", {"force"}),
        ("Gain\t1\t10", {"rail"}),
        ("Gain\t\t10\t\t", {"rail"}),
        ("Gain\t10\t\t", {"force", "rail"}),
        ("Gain\t1\t1\tchecked 10", set()),
    ],
)
def test_a_scale_per_channel_in_the_header_of_a_segment_is_used_whatever_follows_it(line, undecided, tmp_path):
    write_lvm(tmp_path / "a.lvm", [])
    text = (tmp_path / "a.lvm").read_text(encoding="utf-8").replace("\nY_Unit_Label", f"\n{line}\nY_Unit_Label")
    assert line in text
    (tmp_path / "a.lvm").write_text(text, encoding="utf-8")
    for sensor in SENSORS:
        others = [replace(s, quantity="ignored") for s in SENSORS if s is not sensor]
        found = outcome("a.lvm", tmp_path, RawDescription((sensor, *others), rate=TRUE))
        rejected = is_rejected(found, "scale_unknown", "Gain = 10")
        assert rejected if sensor.name in undecided else is_read(found, SAMPLES[[SENSORS.index(sensor)]])


HAMMER = RawChannel("force", "force", "force", unit="V", sensitivity=2.25, sensitivity_unit="mV/N")
SENSOR = RawChannel("rail", "rail", "acceleration", unit="V", sensitivity=100.0, sensitivity_unit="mV/g")


def result_with_sensitivity(facts, tmp_path, channels=(HAMMER, SENSOR)):
    """ "read", or the channel of the first error."""
    np.savez(tmp_path / "a.npz", **dict(zip(UNITS, SAMPLES)), info=np.array(json.dumps(facts)))
    samples, errors = outcome("a.npz", tmp_path, RawDescription(channels, rate=TRUE))
    if not errors:
        return "read"
    assert samples is None and errors[0].reason == "scale_unknown"
    return next(c.name for c in channels if f"channel '{c.name}'" in str(errors[0]))


@pytest.mark.parametrize(
    ("facts", "found"),
    [
        ({"hammer_sensitivity": "2.25 mV/N"}, "read"),
        ({"hammer_sensitivity": "2.25mV/N"}, "read"),
        ({"hammer_sensitivity": 2.25}, "read"),
        ({"hammer_sensitivity": 1.1}, "force"),
        ({"hammer_sensitivity": "1.1 mV/N"}, "force"),
        ({"trigger_sensitivity": 5.0}, "read"),
        ({"sensitivity frequency": "159.2 Hz", "Sensitivity tolerance": "5 %", "sensitivity_date": 2024}, "read"),
        ({"Temperature of sensitivity": "23 °C"}, "read"),
        ({"microphone sensitivity": 50.0}, "read"),
        ({"rail": {"sensitivity": "100 mV/g"}, "force": {"sensitivity": "2.25 mV/N"}}, "read"),
        ({"rail": {"sensitivity": "2.25 mV/N"}}, "rail"),  # of another quantity
        ({"rail": {"sensitivity": "10.2 mV/(m/s²)"}}, "read"),  # 100 / 9.80665
        ({"rail": {"sensitivity": 0.1}}, "read"),  # V/g
        ({"rail": {"sensitivity": 10.2}}, "rail"),  # a tenth, or the same in m/s²
        ({"rail": {"sensitivity": 1000.0}}, "rail"),
        ({"force": {"sensitivity": 2.25 * 9.81}}, "force"),
        ({"force": {"sensitivity": 2.25 / 9.81}}, "force"),
        ({"force": {"sensitivity": 22.5}}, "force"),
        ({"sensors": [{"name": "force", "sensitivity": 100}, {"name": "rail", "sensitivity": 100}]}, "force"),
    ],
)
def test_a_stated_sensitivity_is_compared_with_the_channel_to_which_it_belongs(facts, found, tmp_path):
    assert result_with_sensitivity(facts, tmp_path) == found


def test_the_sensitivity_of_each_record_is_compared(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k, stated in enumerate(("100 mV/g", "1000 mV/g", "100 mV/g")):
            group = file.create_group(f"record_{k:03d}")
            group["force"], group["rail"] = SAMPLES + k
            group.attrs["rail_sensitivity"] = stated
    result = read("a.h5", tmp_path, RawDescription((HAMMER, SENSOR), rate=TRUE))
    assert [r.record for r in result.recordings] == [0, 2]
    (error,) = result.errors
    assert "record 2 of 3, channel 'rail': the file states 'rail_sensitivity: 1000 mV/g'" in str(error)


@pytest.mark.parametrize("name", ["_FillValue", "missing_value", "NoData"])
def test_a_fill_value_that_was_applied_before_unpacking_is_not_compared_with_the_numbers(name, tmp_path):
    packed = np.random.default_rng(1).permutation(np.arange(-1000, 1000, dtype="int16"))
    packed[packed == -1] = 1
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for sensor in UNITS:
            file[sensor] = packed
            file[sensor].attrs.update({"scale_factor": 1e-3, name: -1})
    assert is_read(outcome("a.h5", tmp_path, LAYOUT), [packed * 1e-3] * 2)  # holds -1000, which is -1.0
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["rail"][5] = -1
    assert is_rejected(outcome("a.h5", tmp_path, LAYOUT), "not_finite", "channel 'rail': 1 of 2000")


def test_a_fill_value_is_used_for_the_channel_of_its_entry(tmp_path):
    samples = SAMPLES.copy()
    samples[0, 7] = 0.0
    for facts, is_rejected_now in (
        ({"missing": 0}, False),
        ({"rail": {"missing_value": 0}}, False),
        ({"missing_value": [-999, 0]}, False),
        ({"force": {"missing_value": 0}}, True),
        ({"missing_value": 0}, True),
    ):
        np.savez(tmp_path / "a.npz", **dict(zip(UNITS, samples)), info=np.array(json.dumps(facts)))
        found = outcome("a.npz", tmp_path, LAYOUT)
        if is_rejected_now:
            assert is_rejected(found, "not_finite", "channel 'force': 1 of 64 samples are 0")
        else:
            assert is_read(found, samples), facts


@pytest.mark.parametrize(
    ("name", "unit", "sensitivity", "choices"),
    [
        ("rail (50 g)", "g", None, None),
        ("rail (+-50 g)", "m/s²", None, None),
        ("rail (V)", "m/s²", None, None),
        ("rail [g]", "m/s²", None, "as 'unit: g!' or 'unit: m/s²!'."),
        ("rail [mm]", "m/s²", None, None),
        ("rail [g]", "V", 100.0, "as 'unit: g!' or 'unit: V!'."),
    ],
)
def test_only_units_of_the_quantity_in_a_name_contradict_the_stated_unit(name, unit, sensitivity, choices, tmp_path):
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        writer.write_segment([nptdms.ChannelObject("impact", name, SAMPLES[1], {"unit_string": unit})])
    rail = RawChannel("rail", name, "acceleration", sensitivity=sensitivity, sensitivity_unit="mV/g")
    found = outcome("a.tdms", tmp_path, RawDescription((rail,), rate=TRUE))
    scale = 9.80665 if unit == "g" else 1.0
    assert is_rejected(found, "unit_unknown", choices) if choices else is_read(found, scale * SAMPLES[1:])


POSSIBLE_SCALES = (  # of the numbers of a channel, by parts of the name
    "InputGain", "Vorverstärkung", "Preamp", "AmplitudeScale", "Umrechnungsfaktor", "kalibreringsfaktor",
    "fattore di calibrazione", "LSB", "volts_per_bit", "UnitsPerCount", "Divisor", "Attenuation", "DC offset", "bias",
    "Nullabgleich", "Tara", "Calibration", "Kalibrierung",
)  # fmt: skip
OTHER_SCALES = (  # of other things, or no numbers
    ("Crest factor", 3.0), ("Trigger offset", 12.0), ("UTC offset", 2.0), ("Calibration date", 20240501),
    ("Kalibrierung", 2023), ("Calibration", "certificate 17"), ("Trigger slope", "+"),
    ("Damping factor", 0.05), ("Bias voltage", 11.2), ("Gain control", "automatic"),
    ("File offset", 512), ("PPS offset [µs]", 3.0), ("Track gradient", 12.0),
)  # fmt: skip


@pytest.mark.parametrize("format", ["csv", "tdms", "hdf5", "parquet", "npz"])
def test_a_number_that_may_be_a_scale_is_rejected(format, tmp_path):
    for name in POSSIBLE_SCALES:
        words = ("0.25",) if format == "csv" else (name, "0.25")  # text is shown in plain letters
        assert is_rejected(
            outcome(written(format, tmp_path, [(name, 0.25)]), tmp_path, LAYOUT), "scale_unknown", *words
        )
        neutral = 0.0 if name in ("DC offset", "bias", "Nullabgleich", "Tara") else 1.0
        assert is_read(outcome(written(format, tmp_path, [(name, neutral)]), tmp_path, LAYOUT)), name
    for name, value in OTHER_SCALES:
        assert is_read(outcome(written(format, tmp_path, [(name, value)]), tmp_path, LAYOUT)), name


FACTORS = {
    ("force x100", "rail"): [0], ("force", "rail*10"): [1], ("force_x1000", "rail ×0.1"): [0, 1],
    ("acc x10", "acc x11"): [], ("acc x1", "acc x2"): [], ("force", "max10"): [], ("force", "rail x"): [],
    ("acc x10", "acc y10"): [], ("acc_Z10", "acc_X10"): [], ("force x10", "acc y10"): [0],
}  # fmt: skip


@pytest.mark.parametrize("names", FACTORS, ids=" and ".join)
def test_a_factor_in_the_name_of_a_channel_is_a_scale_that_may_not_have_been_applied(names, tmp_path):
    """Formerly, such numbers were read without a message, a hundred times too large or too small."""
    rows = "".join(f"{a};{b}\n" for a, b in np.random.default_rng(6).normal(size=(40, 2)).round(4))
    (tmp_path / "a.csv").write_text(f"{';'.join(names)}\n{rows}", encoding="utf-8")
    rejected = []
    for i in range(2):
        units = ["g!", "g!"]
        units[i] = "g"
        sensors = tuple(RawChannel(f"s{k}", k, "acceleration", unit=unit) for k, unit in enumerate(units))
        result = read("a.csv", tmp_path, RawDescription(sensors, rate=1e3))
        assert len(result.recordings) + len(result.errors) == 1
        rejected += [i for error in result.errors if "a factor in the name of the channel" in str(error)]
    assert rejected == FACTORS[names]


def test_a_scale_of_the_second_record_is_not_used_for_the_first(tmp_path):
    """The assignment of channels is computed once only for records with the same statements."""
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        for group, properties in (("1", {}), ("2", {"gain": 10.0})):
            samples = np.random.default_rng(6).normal(size=40)
            writer.write_segment([nptdms.ChannelObject(group, "rail", samples, properties)])
    result = read("a.tdms", tmp_path, RawDescription((RawChannel("rail", "rail", "acceleration", "g"),), rate=1e3))
    assert len(result.recordings) == 1 and "record 2 of 2" in str(*result.errors) and "gain = 10" in str(*result.errors)
