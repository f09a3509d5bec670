"""Written recordings are read again in every format, as physical values and as volts."""

import time
from dataclasses import replace
from hashlib import sha256

import numpy as np
import pytest

from turnout.readers import names_and_units, read
from turnout.readers.writing import WRITERS, write
from turnout.simulate.parameters import load_vehicle

# Numbers that go through text with fewer digits than a double has: UFF58's E20.12 keeps 13.
PRINTED = {"uff58": 1e-12}
# The seconds in ID line 3 of UFF are whole numbers.
WHOLE_SECONDS = {"uff58", "uff58b"}


def as_written(format, recordings, description):
    """The recordings that the format can contain: a WAV file contains only one record."""
    if format != "wav":
        return recordings, description
    return recordings[:1], replace(description, n_records=description.n_records and 1)


@pytest.mark.parametrize("format", WRITERS)
def test_si_values_are_read_exactly_as_written(format, hammer_test, in_si, name_of, tmp_path):
    recordings, description = as_written(format, hammer_test, in_si)
    path = write(recordings, tmp_path / name_of(format), format)
    result = read(path.name, tmp_path, description)
    assert result.errors == ()
    assert len(result.recordings) == len(recordings)
    assert result.sha256 == sha256(path.read_bytes()).hexdigest()
    for k, (got, put) in enumerate(zip(result.recordings, recordings)):
        np.testing.assert_allclose(got.samples, put.samples, rtol=PRINTED.get(format, 0.0), atol=0.0)
        assert got.rate == put.rate
        assert [c.name for c in got.channels] == ["force", "rail"]
        assert (got.source, got.record, got.kind) == (path.name, k, "hammer")
        assert got.conditions["rail_temperature"] == 12.5
        seconds = put.started_at.replace(microsecond=0) if format in WHOLE_SECONDS else put.started_at
        assert got.started_at == seconds


def test_equal_recordings_are_equal_files_at_any_time(hammer_test, in_si, name_of, tmp_path):
    """A file is known by its checksum: one that is simulated again with the same seed is no other file."""

    def contents():
        for format in WRITERS:
            recordings, _ = as_written(format, hammer_test, in_si)
            yield format, write(recordings, tmp_path / name_of(format), format).read_bytes()

    first = dict(contents())
    time.sleep(1.1)  # the clocks of formats count seconds
    assert [format for format, content in contents() if content != first[format]] == []


@pytest.mark.parametrize("format", WRITERS)
def test_volts_are_read_with_sensitivity_sign_and_order(format, hammer_test, in_volts, name_of, tmp_path):
    recordings, description = as_written(format, hammer_test, in_volts)
    path = write(recordings, tmp_path / name_of(format), format, description)
    result = read(path.name, tmp_path, description)
    assert result.errors == ()
    for got, put in zip(result.recordings, recordings, strict=True):
        assert [c.name for c in got.channels] == ["rail", "force"]
        for name in ("rail", "force"):  # one division and one multiplication round
            tolerance = PRINTED.get(format, 4 * np.finfo(float).eps)
            np.testing.assert_allclose(got.signal(name), put.signal(name), rtol=tolerance, atol=0.0)
        seconds = put.started_at.replace(microsecond=0) if format in WHOLE_SECONDS else put.started_at
        assert got.started_at == seconds  # written in Copenhagen's time, read back as UTC


@pytest.mark.parametrize("format", [f for f in WRITERS if f != "uff58"])
def test_single_precision_keeps_every_bit_of_a_float32(format, hammer_test, in_si, name_of, tmp_path):
    recordings, description = as_written(format, hammer_test, in_si)
    path = write(recordings, tmp_path / name_of(format), format, single=True)
    for got, put in zip(read(path.name, tmp_path, description).recordings, recordings, strict=True):
        np.testing.assert_array_equal(got.samples.astype("float32"), put.samples.astype("float32"))


@pytest.mark.parametrize("format", [f for f in WRITERS if f != "csv"])
def test_the_format_is_identified_by_content_if_the_extension_is_wrong(format, hammer_test, in_si, tmp_path):
    recordings, description = as_written(format, hammer_test, in_si)
    write(recordings, tmp_path / "A7_1.raw", format)
    got = read("A7_1.raw", tmp_path, description).recordings[0]
    np.testing.assert_allclose(got.samples, recordings[0].samples, rtol=PRINTED.get(format, 0.0))


@pytest.mark.parametrize("format", ["csv", "lvm"])
def test_a_decimal_comma_is_read(format, hammer_test, in_si, name_of, tmp_path):
    path = write(hammer_test, tmp_path / name_of(format), format, decimal_comma=True)
    assert b"." not in path.read_bytes().splitlines()[-2]
    np.testing.assert_array_equal(read(path.name, tmp_path, in_si).recordings[3].samples, hammer_test[3].samples)


def test_a_single_channel_of_a_single_record_is_read(hammer_test, in_si, name_of, tmp_path):
    alone = [replace(hammer_test[0], samples=hammer_test[0].samples[:1], channels=hammer_test[0].channels[:1])]
    for format in WRITERS:
        path = write(alone, tmp_path / name_of(format), format)
        (got,) = read(path.name, tmp_path, replace(in_si, channels=in_si.channels[:1])).recordings
        np.testing.assert_allclose(got.samples, alone[0].samples, rtol=PRINTED.get(format, 0.0), err_msg=format)


def test_samples_of_a_24_bit_wav_are_fractions_of_full_scale(hammer_test, in_volts, tmp_path):
    """10 V full scale: one step is 10 V / 2^23, half of it the largest error."""
    description = replace(in_volts, n_records=1, channels=tuple(replace(c, unit="V") for c in in_volts.channels))
    path = write(hammer_test[:1], tmp_path / "p.wav", "wav", description, subtype="PCM_24", full_scale=10.0)
    scaled = tuple(replace(c, unit="10 V") for c in description.channels)
    (got,) = read(path.name, tmp_path, replace(description, channels=scaled)).recordings
    step = 10.0 / 2**23
    for name, volts in (("rail", 35.3e-3 / 9.80665), ("force", 0.23e-3)):
        put = hammer_test[0].signal(name) * volts
        error = np.abs(got.signal(name) * volts - put)
        assert 0.1 * step < error.max() <= 0.501 * step  # it was rounded, and no more than that


def test_a_wav_file_rejects_a_second_record(hammer_test, tmp_path):
    with pytest.raises(ValueError, match="a WAV file holds one record, not 4"):
        write(hammer_test, tmp_path / "a.wav", "wav")


def test_the_writer_reports_unknown_formats_and_missing_recordings(hammer_test, tmp_path):
    with pytest.raises(ValueError, match="no writer for the format 'xls'; there are uff58, "):
        write(hammer_test, tmp_path / "a", "xls")
    with pytest.raises(ValueError, match="there is no recording to write"):
        write([], tmp_path / "a", "npz")


@pytest.mark.parametrize("n_units", [1, 3])
@pytest.mark.parametrize("load", [0.5, 1.0])
@pytest.mark.parametrize("format", WRITERS)
def test_the_conditions_of_a_simulated_train_are_read_without_a_remark(
    format, load, n_units, hammer_test, in_si, name_of, tmp_path, repository
):
    vehicle = load_vehicle("ic3", load, repository / "config/vehicles", n_units)
    loads = {"axle_loads": tuple(2.0 * x for x in vehicle.static_loads)}
    stated = {"train_type": "ic3", "speed": 38.9, "track": "main", "direction": "facing", **vehicle.conditions}
    assert set(vehicle.conditions) == {"load_share", "n_units"}
    passage = replace(hammer_test[0], kind="passage", conditions=stated | loads)
    path = write([passage], tmp_path / name_of(format), format)
    layout = replace(in_si, kind="passage")
    result = read(path.name, tmp_path, layout)
    assert result.errors == () and len(result.recordings) == 1
    if format not in ("wav", "rcmdx"):
        assert [unit for _, unit in names_and_units(path.name, tmp_path)] == ["N", "m/s²"]
