"""Whole numbers of audio files, tables of data loggers, and binary files with the extension of a text."""

import logging
from datetime import datetime, timedelta

import numpy as np
import pytest
import soundfile

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
X = np.random.default_rng(4).uniform(-0.9, 0.9, size=(300, 2))
NAMED = RawDescription((RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration")), rate=RATE)


def of_units(force, rail, **fields):
    channels = RawChannel("force", 0, "force", force, **fields), RawChannel("rail", 1, "acceleration", rail)
    return RawDescription(channels, rate=RATE)


@pytest.mark.parametrize("name", ["a.wav", "a.flac"])
@pytest.mark.parametrize("subtype", ["PCM_16", "PCM_24"])
def test_whole_numbers_of_audio_need_the_value_of_full_scale(tmp_path, name, subtype):
    soundfile.write(tmp_path / name, X, int(RATE), subtype)
    for units in (of_units("N", "900 m/s²"), of_units("V", "1 m/s²", sensitivity=1.0, sensitivity_unit="mV/N")):
        (error,) = read(name, tmp_path, units).errors
        assert error.reason == "scale_unknown" and "channel 'force'" in str(error)
        assert f"nothing says what full scale is in {units.channels[0].unit!r}. Set it in the layout" in str(error)
    for units in (of_units("5000 N", "900 m/s²"), of_units("5000 N", "900 m/s²!")):
        (recording,) = read(name, tmp_path, units).recordings
        np.testing.assert_allclose(recording.samples, X.T * [[5000.0], [900.0]], atol=5000.0 / 2**14)


def test_floating_point_numbers_of_audio_can_be_in_the_unit_itself(tmp_path):
    soundfile.write(tmp_path / "a.wav", X * 1e3, int(RATE), "DOUBLE")
    (recording,) = read("a.wav", tmp_path, of_units("N", "m/s²")).recordings
    np.testing.assert_array_equal(recording.samples, X.T * 1e3)


def rows(first, n=50):
    """Rows of a logger: time stamp, number of the sample, and both channels."""
    stamps = (datetime(2026, 5, 13, 8, 30) + timedelta(seconds=k / RATE) for k in range(n))
    return "".join(f'"{s:%Y-%m-%d %H:%M:%S.%f}",{first + k},{a},{b}\n' for k, (s, (a, b)) in enumerate(zip(stamps, X)))


@pytest.mark.parametrize("title", ["TIMESTAMP", "Zeitstempel", "Horodatage", "Time"])
@pytest.mark.parametrize("below", ['"","","Smp","Smp"\n', ""])
@pytest.mark.parametrize("above", ['"TOA5","X","CR1000","1"\n', "Campbell TOA5\n\n"])
def test_units_are_found_above_further_lines_of_a_table(tmp_path, title, below, above):
    head = f'{above}"{title}","RECORD","force","rail"\n"TS","RN","kN","m/s^2"\n{below}'
    (tmp_path / "a.dat").write_text(head + rows(7), encoding="utf-8")
    counted = RawDescription((*NAMED.channels, RawChannel("count", "RECORD", "ignored")), rate=RATE)
    result = read("a.dat", tmp_path, counted)
    assert result.errors == ()
    (recording,) = result.recordings
    np.testing.assert_allclose(recording.samples, X[:50].T * [[1e3], [1.0]], rtol=1e-12)


def test_a_column_that_numbers_each_row_is_not_read_as_the_number_of_a_record(tmp_path):
    """Successive rows with the same number are a record."""
    table = "".join(f"{k};{a};{b}\n" for k, (a, b) in enumerate(X))
    (tmp_path / "a.csv").write_text("record;force [N];rail [m/s²]\n" + table, encoding="utf-8")
    (recording,) = read("a.csv", tmp_path, NAMED).recordings
    assert recording.n_sample == len(X)
    table = "".join(f"{k // 100};{a};{b}\n" for k, (a, b) in enumerate(X))
    (tmp_path / "a.csv").write_text("record;force [N];rail [m/s²]\n" + table, encoding="utf-8")
    assert [r.n_sample for r in read("a.csv", tmp_path, NAMED).recordings] == [100, 100, 100]


@pytest.mark.parametrize("start", [b"DIAEXTENDED\x00\x00", b'"a",\r\x01', b"\x1b", b"note\n\x00"])
@pytest.mark.parametrize("name", ["a.csv", "a.dat"])
def test_a_binary_file_with_the_extension_of_a_text_is_rejected(tmp_path, caplog, start, name):
    (tmp_path / name).write_bytes(start + np.random.default_rng(1).bytes(5000) + b'\n"x",\r,"\n')
    with caplog.at_level(logging.WARNING), pytest.raises(ReadError) as caught:
        read(name, tmp_path, NAMED)
    assert "is no text. Copy the file again from the logger; if the logger writes binary numbers" in str(caught.value)
    assert not caplog.records  # no traceback is logged by default
