"""A copy of a record or a channel in other units, or of raw beside scaled values, is no second measurement."""

from dataclasses import replace

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from turnout.readers import read
from turnout.readers.scaled_copies import scaled_copies
from turnout.records import RawChannel, RawDescription

CHANNELS = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
GRAVITY = 9.80665
RNG = np.random.default_rng(1)
FORCE, RAIL = (RNG.normal(size=(2, 800)) * [[20.0], [3.0]]).round(4)


def reasons(tmp_path, name, channels=CHANNELS, **options):
    result = read(name, tmp_path, RawDescription(channels, rate=5000.0, **options))
    return [r.record for r in result.recordings], [(error.reason, error.record) for error in result.errors]


def write_tdms(tmp_path, *records):
    with TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        for k, (force, force_unit, rail, rail_unit) in enumerate(records, start=1):
            units = {"force": force_unit, "rail": rail_unit}
            writer.write_segment(
                ChannelObject(f"impact {k}", name, x, {"wf_increment": 2e-4, "unit_string": units[name]})
                for name, x in (("force", force), ("rail", rail))
            )


@pytest.mark.parametrize("n_digit", [9, 5])
@pytest.mark.parametrize("kind", ["hammer", "passage"])
def test_a_record_again_in_other_units_counts_once(kind, n_digit, tmp_path):
    copy = (FORCE / 4.4482216152605).round(n_digit), "lbf", (RAIL / GRAVITY).round(n_digit), "g"
    write_tdms(tmp_path, (FORCE, "N", RAIL, "m/s²"), copy)
    expected = {("duplicate", 1)} if kind == "hammer" else {("duplicate", 1), ("wrong_time", 0)}
    recordings, errors = reasons(tmp_path, "a.tdms", kind=kind)
    assert recordings == ([0] if kind == "hammer" else []) and set(errors) == expected


def test_nothing_says_which_of_raw_and_scaled_values_under_one_unit_is_right(tmp_path):
    rows = np.c_[np.repeat([1, 2], 800), np.r_[FORCE, FORCE * 2.3e-4], np.r_[RAIL, -RAIL * 0.0102]]
    text = "".join(f"{k:.0f};{f:.7f};{r:.7f}\n" for k, f, r in rows)
    (tmp_path / "a.csv").write_text(f"record;force [N];rail [m/s²]\n{text}", "utf-8")
    assert reasons(tmp_path, "a.csv") == ([], [("duplicate", 0), ("duplicate", 1)])


@pytest.mark.parametrize("kind", ["hammer", "passage"])
@pytest.mark.parametrize(
    ("copy", "unit"), [(RAIL, "m/s²"), (-RAIL, "m/s²"), ((RAIL / GRAVITY).round(4), "g"), (RAIL + 9.8, "m/s²")]
)
def test_a_channel_that_is_another_one_in_other_units_is_left_out(copy, unit, kind, tmp_path):
    np.savez(tmp_path / "a.npz", force=FORCE, rail=RAIL, sleeper=copy, fs=5000.0)
    channels = (
        RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"),
        RawChannel("sleeper", "sleeper", "acceleration", unit),
    )  # fmt: skip
    result = read("a.npz", tmp_path, RawDescription(channels, rate=5000.0, kind=kind))
    assert [channel.name for channel in result.recordings[0].channels] == ["force", "rail"]
    assert [(error.reason, error.where.rpartition(" ")[2]) for error in result.errors] == [("duplicate", "'sleeper'")]


def test_two_measurements_are_no_copies(tmp_path):
    """Other noise, a weaker impact with noise of its own, whole numbers, and computed ones of other strengths."""
    noise = RNG.normal(size=(2, 800))
    write_tdms(
        tmp_path,
        (FORCE, "N", RAIL, "m/s²"),
        (FORCE * 0.2 + 0.1 * noise[0], "N", RAIL * 0.2 + 0.1 * noise[1], "m/s²"),
        (noise[0].round(), "N", noise[1].round(), "m/s²"),
        (FORCE * 1.4, "N", RAIL * 1.41, "m/s²"),
    )
    assert reasons(tmp_path, "a.tdms") == ([0, 1, 2, 3], [])


@pytest.mark.parametrize(("rail_factor", "are_used"), [(5.0, True), (5.1, False)])
def test_one_factor_of_all_channels_is_the_strength_of_a_computed_impact(rail_factor, are_used, tmp_path):
    write_tdms(tmp_path, (FORCE, "N", RAIL, "m/s²"), (FORCE * 5.0, "N", RAIL * rail_factor, "m/s²"))
    recordings, errors = reasons(tmp_path, "a.tdms")
    assert recordings == ([0, 1] if are_used else []) and bool(errors) is not are_used


def test_computed_channels_of_one_shape_with_silence_before_the_impact_are_no_copies(tmp_path):
    t = np.arange(700)
    decay = np.r_[np.zeros(100), 50.0 * np.exp(-t / 90.0) * np.sin(2.4 * t)]
    np.savez(tmp_path / "a.npz", force=np.abs(FORCE), rail=decay, sleeper=0.5 * decay, fs=5000.0)
    channels = (
        RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"),
        RawChannel("sleeper", "sleeper", "acceleration", "m/s²"),
    )  # fmt: skip
    result = read("a.npz", tmp_path, RawDescription(channels, rate=5000.0))
    assert len(result.recordings[0].channels) == 3 and result.errors == ()


def test_coarse_channels_that_change_at_different_samples_are_no_copies():
    steps = np.repeat(RNG.normal(size=(2, 400)), 2, axis=1)
    assert list(scaled_copies([steps[0], np.roll(steps[1], 1)])) == []


CODES = "force raw [count];rail raw [count];force [V];rail [V]\n", FORCE / 1e-3, RAIL / 1e-3, FORCE, RAIL
VOLTS = {"sensitivity": 1.0, "sensitivity_unit": "V/N"}, {"sensitivity": 1.0, "sensitivity_unit": "V/(m/s²)"}


@pytest.mark.parametrize(
    ("sources", "unit", "reason"),
    [((2, 3), None, ""), ((0, 1), "1 mV", ""), ((0, 1), "V", "scale_unknown"), ((0, 1), "0.5 mV", "scale_unknown"),
     ((0, 1), "V!", "")],
)  # fmt: skip
@pytest.mark.parametrize("kind", ["hammer", "passage"])
def test_codes_beside_volts_are_compared_with_them(sources, unit, reason, kind, tmp_path):
    head, *columns = CODES
    text = "".join("{:.0f};{:.0f};{:.4f};{:.4f}\n".format(*row) for row in zip(*columns))
    (tmp_path / "a.csv").write_text(head + text)
    quantities = ("force", "acceleration")
    channels = [RawChannel(n, i, q, unit, **s) for n, i, q, s in zip(("force", "rail"), sources, quantities, VOLTS)]
    channels += [RawChannel(f"other {i}", i, "ignored") for i in {0, 1, 2, 3} - set(sources)]
    result = read("a.csv", tmp_path, RawDescription(tuple(channels), rate=5000.0, kind=kind))
    assert {error.reason for error in result.errors} == ({reason} if reason else set())
    assert len(result.recordings) == (not reason)


@pytest.mark.parametrize(
    ("factor", "reason"), [(1.0, ""), (1.02, "entry_unknown"), (0.9, "entry_unknown"), (1.3, "scale_unknown"),
                           (10.0, "scale_unknown"), (1 / 4.4482, "scale_unknown")],
)  # fmt: skip
@pytest.mark.parametrize("used", ["volts", "newtons"])
def test_two_calibrations_of_a_sensor_are_a_remark_and_another_unit_or_gain_an_error(factor, reason, used, tmp_path):
    """The program of the logger has the sensitivity of another certificate than the layout."""
    volts, newtons = 0.0023 * FORCE, factor * FORCE
    text = "".join(f"{v:.6f};{n:.4f};{r:.4f}\n" for v, n, r in zip(volts, newtons, RAIL))
    (tmp_path / "a.csv").write_text(f"hammer [V];force [N];rail [m/s²]\n{text}", "utf-8")
    sensor = RawChannel("hammer", 0 if used == "volts" else 1, "force", None, 2.3, "mV/N")
    other = RawChannel("other", 1 if used == "volts" else 0, "ignored")
    description = RawDescription((sensor, other, RawChannel("rail", 2, "acceleration")), rate=5000.0)
    if used == "newtons":
        description = replace(description, channels=(replace(sensor, sensitivity=None, sensitivity_unit=""), other,
                                                     description.channels[2]))  # fmt: skip
        reason = ""  # no sensitivity, nothing to compare
    result = read("a.csv", tmp_path, description)
    assert [error.reason for error in result.errors] == ([reason] if reason else [])
    assert len(result.recordings) == (reason != "scale_unknown")


def test_codes_have_no_calibration(tmp_path):
    """2.4 % are a converter of 10.24 V that is taken for one of 10 V."""
    text = "".join(f"{c:.0f};{f:.4f};{r:.4f}\n" for c, f, r in zip(FORCE / 1.024e-3, FORCE, RAIL))
    (tmp_path / "a.csv").write_text(f"force raw [count];force [V];rail [m/s²]\n{text}", "utf-8")
    channels = (
        RawChannel("force", 0, "force", "1 mV", 1.0, "V/N"),
        RawChannel("f", 1, "ignored"),
        RawChannel("rail", 2, "acceleration"),
    )
    result = read("a.csv", tmp_path, RawDescription(channels, rate=5000.0))
    assert [error.reason for error in result.errors] == ["scale_unknown"] and not result.recordings


def test_a_force_in_other_units_beside_the_same_response_is_one_record(tmp_path):
    daN, kgf = (FORCE / 10, "daN", RAIL, "m/s²"), ((FORCE / GRAVITY).round(6), "kgf", RAIL, "m/s²")
    write_tdms(tmp_path, daN, kgf)
    assert reasons(tmp_path, "a.tdms") == ([0], [("duplicate", 1)])
