"""Every format with entries about something other than the recording, and with similar true statements.

A frequency is the sampling rate, and a scale that of the samples, only if its words concern the record or its channels.
The samples were taken at 25.6 kHz.
"""

import json
from dataclasses import replace

import nptdms
import numpy as np
import pytest
import soundfile
from tests.unit.readers.cpu_limit import ended_after
from tests.unit.readers.test_readers_rate_matrix import FORMATS, SAMPLES, SENSORS, TRUE, UNITS, described, plain

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.entries import entries_of_text
from turnout.readers.rate_vocabulary import NOT, name_meaning
from turnout.readers.scale_vocabulary import says_no_scale
from turnout.records import RawDescription

FREQUENCIES = (
    "Corner frequency", "Natural frequency", "Carrier frequency", "Bolt frequency", "Usable frequency",
    "Tuning frequency", "Modulation frequency", "Frequency response", "Pinned-pinned frequency",
    "Inverter switching frequency", "Bezugsfrequenz", "Trägerfrequenz", "Fréquence propre", "Frecuencia portadora",
    "Frequenza di risonanza", "Egenfrekvens",
)  # fmt: skip
MAX_NAME = 26  # characters: with its unit as a name of MATLAB
TRUE_FREQUENCIES = (
    "Frequency", "Board frequency", "Clock frequency", "Logger frequency", "ADC frequency", "Channel frequency",
    "Frequency of the recorder", "Taktfrequenz", "Messfrequenz", "Fréquence de la carte", "Frecuencia del sistema",
    "Frequenza dei dati", "Målefrekvens", "Vzorkovací kmitočet", "Frequência de amostragem",
    "Frecvența de eșantionare",
)  # fmt: skip
NO_SCALES = [
    ("Scale", "1:500 map"), ("Scale", "map 1:2000"), ("Scale", "1:500 (site plan)"), ("Maßstab", "1:1000 Lageplan"),
    ("Scale", "1:500"), ("Maßstab", "1 : 1000"), ("Note", "Scale: 1:500"), ("Gain", "auto"),
    ("Verstärkung", "automatisch"),
    ("Gain", "auto-range off"), ("Gain", "disabled"), ("Verstärkung", "aus"), ("Offset", "none applied"),
    ("Plan", "scale 1:500"), ("Map", "scale: 1:500"), ("Note", "Scale: 1:500 map"), ("Note", "Gain: auto-range off"),
]  # fmt: skip
TRUE_SCALES = [
    ("Scale", "1:10"), ("Gain", "1:500"), ("Scale", "0.4 map"), ("Gain", "10 (auto-range off)"), ("Gain", "ten"),
    ("Offset", "off by 10"), ("Gain", "x10, display off"), ("Note", "gain 1:10"), ("Note", "gain 10"),
    ("Note", "amplifier gain: 10"),
]  # fmt: skip


def outcome(format, folder, *entries, rate=TRUE):
    """(recording, errors) of a file with these entries, and with its rate if the format states none."""
    write_file, name, states_rate = FORMATS[format]
    entries = [(plain(name) if format == "mat" else name, value) for name, value in entries]
    write_file(folder / name, entries if states_rate or rate else [("rate", TRUE), *entries])
    try:
        result = read(name, folder, described(rate))
    except ReadError as error:
        return None, (error,)
    return (result.recordings[0] if result.recordings else None), result.errors


def can_hold(format, *texts):
    """Whether the format can store the texts: texts of Universal Files and names of MATLAB are ASCII."""
    return format not in ("uff", "mat") or all(text.isascii() for text in texts)


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("rate", [TRUE, None])
def test_a_frequency_of_something_else_is_not_read_as_the_rate(format, rate, tmp_path):
    """The layout states the rate, or only the file states it."""
    for name in FREQUENCIES:
        if can_hold(format, name) and len(name) < MAX_NAME:
            recording, errors = outcome(format, tmp_path, (name, "12 kHz"), rate=rate)
            assert recording is not None and recording.rate == pytest.approx(TRUE) and errors == (), name
            unit_in_name = outcome(format, tmp_path, (f"{name} [kHz]", "12"), rate=rate)
            assert unit_in_name[0] is not None and unit_in_name[1] == (), f"{name} [kHz]"


@pytest.mark.parametrize("format", FORMATS)
def test_a_frequency_of_the_recording_that_is_not_its_rate_is_reported(format, tmp_path):
    for name in TRUE_FREQUENCIES:
        if can_hold(format, name):
            assert outcome(format, tmp_path, (name, "25.6 kHz"))[1] == (), name
            for rate in (TRUE, None):
                _, errors = outcome(format, tmp_path, (name, "12 kHz"), rate=rate)
                assert errors and errors[0].reason in ("wrong_rate", "entry_unknown"), (name, rate)
                assert "12 kHz" in errors[0].problem, (name, rate)


@pytest.mark.parametrize("format", FORMATS)
def test_the_scale_of_a_drawing_and_disabled_settings_change_no_sample(format, tmp_path):
    for name, value in NO_SCALES:
        if can_hold(format, name):
            recording, errors = outcome(format, tmp_path, (name, value))
            assert recording is not None and errors == (), (name, value)
            np.testing.assert_allclose(recording.samples, SAMPLES, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("format", sorted(set(FORMATS) - {"uff"}))
def test_a_scale_of_the_samples_with_such_words_is_rejected(format, tmp_path):
    """A Universal File has free text only, in which a word without its number is no entry."""
    for name, value in TRUE_SCALES:
        recording, errors = outcome(format, tmp_path, (name, value))
        assert recording is None and errors[0].reason == "scale_unknown", (name, value)


def test_a_ratio_of_a_channel_is_not_read_as_the_scale_of_a_drawing(tmp_path):
    recording, errors = outcome("hdf5", tmp_path, ("operator", "mj"), ("Scale", "1:500"))  # of the force's dataset
    assert recording is None and errors[0].reason == "scale_unknown" and "1:500" in errors[0].problem
    channels = [nptdms.ChannelObject("impact", n, x, {"Scale": "1:500"}) for n, x in zip(UNITS, SAMPLES)]
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        writer.write_segment(channels)
    result = read("a.tdms", tmp_path, described(TRUE))
    assert result.recordings == () and "1:500" in result.errors[0].problem


@pytest.mark.parametrize("format", FORMATS)
def test_a_scale_of_the_samples_is_found_behind_the_scale_of_a_map(format, tmp_path):
    recording, errors = outcome(format, tmp_path, ("Scale", "1:500 map"), ("gain", 10))
    assert recording is None and errors[0].reason == "scale_unknown" and "10" in errors[0].problem


def test_a_name_without_a_word_of_frequency_keeps_its_meaning():
    """An unknown word with a frequency may be in another language."""
    assert name_meaning("Tastung [kHz]").certainty != NOT and name_meaning("Bolt frequency [kHz]").certainty == NOT
    assert not says_no_scale("0.4") and not says_no_scale("1:10") and not says_no_scale("inverted")


@pytest.mark.parametrize("text", [" " * 9000, " " * 4500 + ":" + " " * 4499, "a" + " " * 8995 + "1:1x9", "a: " * 3000])
def test_a_comment_with_many_blanks_is_searched_fast(text):
    """A search that tries every division of the blanks takes minutes."""
    with ended_after(60.0):
        assert len(list(entries_of_text(text, "comment"))) <= 1


COMMENTS = (
    "Channels: 2", "Channels: 2; Scale: 1:500 map", "Gain: auto-range off, natural frequency 12 kHz",
    json.dumps({"Channels": 2}), json.dumps({"channels": "2"}), json.dumps({"channels": list(UNITS)}),
)  # fmt: skip


@pytest.mark.parametrize("comment", COMMENTS)
def test_a_number_of_channels_in_the_comment_of_a_wav_file_is_not_read_as_a_name(comment, tmp_path):
    for n in (1, 2):
        with soundfile.SoundFile(tmp_path / "a.wav", "w", int(TRUE), n, "DOUBLE") as file:
            file.comment = comment.replace("2", "1") if n == 1 and "Channels" in comment else comment
            file.write(SAMPLES[:n].T)
        sensors = tuple(replace(s, source=i) for i, s in enumerate(SENSORS[:n]))
        result = read("a.wav", tmp_path, RawDescription(sensors, rate=TRUE))
        assert result.errors == ()
        np.testing.assert_array_equal(result.recordings[0].samples, SAMPLES[:n])


@pytest.mark.parametrize("count", [2, 2.0, np.int32(2), "2"])
def test_a_number_of_channels_beside_a_matrix_is_not_read_as_a_name(count, tmp_path):
    np.savez(tmp_path / "a.npz", data=SAMPLES, channels=np.array(count), fs=TRUE)
    sensors = tuple(replace(s, source=i) for i, s in enumerate(SENSORS))
    result = read("a.npz", tmp_path, RawDescription(sensors))
    assert result.errors == ()
    np.testing.assert_array_equal(result.recordings[0].samples, SAMPLES)
