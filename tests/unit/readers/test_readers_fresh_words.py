"""Names and notations of loggers that no other test uses are read correctly, rejected or reported in every format.

The samples have a rate of 25.6 kHz. An entry of 20 kHz, a scale that may not have been applied, and a start time in an
unknown notation must be reported; entries about other things must not.
"""

from datetime import datetime

import pytest
from tests.unit.readers.test_readers_rate_matrix import FORMATS, TRUE, described, plain

from turnout.errors import ReadError
from turnout.readers import read

RATES = {
    "AcqRate": 20000, "Clock Frequency": "20 kHz", "Time/Sample": "50 us", "HORZ_INCR": 5e-5, "Te": "50 us",
    "Tempo di campionamento": 5e-5, "ODR": 20000, "Update interval": "50 us", "tick length": "50 us", "fs_force": 20000,
    "XUnitsPerSample": 5e-5, "Abtastdauer": "50 us", "settings.dt": 5e-5, "Punkte je Sekunde": 20000, "s/pt": 5e-5,
    "Conversion rate": 20000, "Clock rate (acq)": 20000, "Datenrate": "20 kS/s",
}  # fmt: skip
SCALES = {
    "Amplification": "x10", "Attenuation": "1:10",
    "Charge amp gain": "10 mV/pC", "Conversion": 9.81, "adc_to_volt": 3e-4,
    "lbf2N": 4.448, "bit_weight": 1e-3, "Kalibrierwert": 1.02,
    "Eichwert": 434, "volts_per_unit": 2, "Normalization": 0.5,
    "Polarity": -1, "Inverted": "true", "Signal polarity": "neg.", "exponent": -3, "unit prefix": "milli",
    "Level correction": "3 dB", "Mean removed": 2, "Baseline": 1.5, "Slope1": 2.0, "Comment": "amplifier gain 10",
    "data_scale": 0.5, "Voltage gain": 10,
}  # fmt: skip
STARTS = ["05/06/2024 10:00:00 AM", "2024-05-13T25:00:00", "2024-367T10:00:00", "13. Mayo 2024 14:00:00 PM"]
READ_STARTS = [
    "13. Mayo 2024 10:00:00 AM",
    "13 May 2024 10:00:00",
    "Mon May 13 10:00:00 2024",
    "2024/05/13 10:00:00",
    "20240513T100000",
    "2024-134T10:00:00",
    "2024134 10:00:00",
    "13. Mai 2024 10:00",
    "05/13/2024 10:00:00 AM",
    "13-05-2024 10:00",
    "13.05.2024 10.00.00",
    "13.05.2024 um 10:00:00 Uhr",
]
OTHERS = {
    "CPU clock": "400 MHz", "Line frequency": "50 Hz", "Rail temperature": 31.2,
    "Sleeper spacing": 0.6,
    "Slope of track": 5, "Trigger polarity": "negative", "File prefix": "k", "Bias voltage": 11.2,
    "Refresh rate": 60, "Pulse width": "50 us", "Version": 3, "Created": "2023-05-14 09:00:00",
    "Switch ratio": "1:12", "Data offset": 512, "Crossing angle": "1:9",
}  # fmt: skip


def write_entry(format, tmp_path, name, value, start=None):
    """Write a file with the entry as the first or second of the metadata; None if the format cannot store it."""
    write_file, file_name, _ = FORMATS[format]
    if format == "mat":
        if plain(name) != name.replace(" ", "_"):
            return None
        name = plain(name)
    if format in ("parquet", "csv", "lvm", "uff"):
        value = str(value)
    entries = [(name, value)] if len(name) % 2 else [("operator", "N. N."), (name, value)]
    write_file(tmp_path / file_name, entries, start=start)
    return tmp_path / file_name


def outcome(path):
    """(recording, errors) of a file whose layout is correct."""
    try:
        result = read(path.name, path.parent, described(TRUE))
    except ReadError as error:
        return None, (error,)
    return (result.recordings[0] if result.recordings else None), result.errors


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("kind", ["wrong_rate", "scale_unknown"])
def test_another_rate_or_an_unclear_scale_under_any_name_is_reported(format, kind, tmp_path):
    unreported = []
    for name, value in (RATES if kind == "wrong_rate" else SCALES).items():
        if path := write_entry(format, tmp_path, name, value):
            _, errors = outcome(path)
            unreported += [] if errors and errors[0].reason in (kind, "entry_unknown") else [name]
    assert unreported == []


@pytest.mark.parametrize("format", FORMATS)
def test_entries_about_other_things_are_not_reported(format, tmp_path):
    for name, value in OTHERS.items():
        if path := write_entry(format, tmp_path, name, value):
            recording, errors = outcome(path)
            assert recording is not None and errors == (), (name, value)


@pytest.mark.parametrize("format", ["csv", "tdms", "parquet", "hdf5", "npz", "mat", "wav"])
def test_a_start_under_any_name_is_read_or_reported(format, tmp_path):
    for text in (*STARTS, *READ_STARTS):
        recording, errors = outcome(write_entry(format, tmp_path, "Recorded", text))
        if text in READ_STARTS:
            assert recording.started_at.replace(second=0) == datetime(2024, 5, 13, 10) and errors == (), text
        else:
            assert recording.started_at is None and errors[0].reason == "start_unknown", text


@pytest.mark.parametrize("format", sorted(set(FORMATS) - {"uff"}))
def test_two_start_times_are_reported(format, tmp_path):
    path = write_entry(format, tmp_path, "Recorded", "2023-01-05 10:00:00", start="2024-05-13T10:00:00")
    recording, errors = outcome(path)
    assert recording.started_at == datetime(2024, 5, 13, 10)
    assert errors[0].reason == "start_unknown" and "two start times" in errors[0].problem
    path = write_entry(format, tmp_path, "Recorded", "2024-05-13 12:00:00", start="2024-05-13T10:00:00")  # another zone
    assert outcome(path)[1] == ()
