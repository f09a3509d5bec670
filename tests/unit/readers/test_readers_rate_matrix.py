"""Every format with every way to state rate, step, time axis or start time: right, wrong, missing, contradictory.

The true rate is 25600 Hz. Each file is read at the true rate or rejected; nothing is misread without a message.
"""

import json
import re
import unicodedata
from dataclasses import replace
from datetime import datetime, timedelta
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import nptdms
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
import soundfile

from turnout.errors import ReadError
from turnout.readers import read
from turnout.readers.writing import write
from turnout.records import Channel, RawChannel, RawDescription, Recording

TRUE, OTHER = 25600.0, 20000.0
N_SAMPLE = 64
SAMPLES = np.random.default_rng(37).normal(size=(2, N_SAMPLE)) * [[900.0], [30.0]]
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
UNITS = {"force": "N", "rail": "m/s²"}


def number(value, comma=False):
    text = f"{value:.10g}"
    return text.replace(".", ",") if comma else text


# Name of the entry, and its value for a rate [Hz].
WAYS = {
    "Sample rate": lambda rate: rate,
    "Sampling frequency [kHz]": lambda rate: number(rate / 1e3),
    "fs": lambda rate: float(rate),
    "Samples per second": lambda rate: int(rate),
    "Scan rate": lambda rate: f"{number(rate)} S/s",
    "XIncrement": lambda rate: 1 / rate,
    "Sampling interval [µs]": lambda rate: number(1e6 / rate),
    "dt_ms": lambda rate: 1e3 / rate,
    "sample_period": lambda rate: f"{1 / rate:.6E}",
    "Abtastrate": lambda rate: f"{number(rate / 1e3, comma=True)} kHz",
    "Abtastintervall": lambda rate: f"{number(1e6 / rate, comma=True)} µs",
    "Fréquence d'échantillonnage": lambda rate: f"{number(rate)} Hz",
    "Pas de temps": lambda rate: f"{number(1 / rate)} s",
    "Samplingsfrekvens": lambda rate: f"{number(rate / 1e3, comma=True)} kHz",
    "Frequenza di campionamento": lambda rate: f"{number(rate)} Hz",
    "Intervallo di campionamento": lambda rate: f"{number(1e6 / rate)} us",
    "Frecuencia de muestreo": lambda rate: f"{number(rate)} Hz",
    "Período de muestreo": lambda rate: f"{number(1e3 / rate)} ms",
    "Sampling rate": lambda rate: f"{number(rate / 1e3)}k",
    "Sample step": lambda rate: f"{number(1e6 / rate)} u",
    "Samplerate": lambda rate: f"{number(rate)}/s",
    "Sample frequency": lambda rate: f"{number(rate)} 1/s",
}


def described(rate, *ignored):
    return RawDescription((*SENSORS, *(RawChannel(n, n, "ignored") for n in ignored)), rate=rate)


def recording(rate=TRUE, start=None):
    return Recording(SAMPLES, rate, (Channel("force", "force"), Channel("rail", "acceleration")), started_at=start)


def plain(name):
    """A name of a MATLAB variable."""
    ascii_name = unicodedata.normalize("NFKD", name.replace("µ", "u")).encode("ascii", "ignore").decode()
    return re.sub(r"\W+", "_", ascii_name).strip("_")


def write_csv(path, entries, columns=None, start=None):
    columns = columns or {}
    head = [f"{name};{value}" for name, value in entries] + ([f"started_at;{start}"] if start else [])
    names = ";".join([*columns, "force [N]", "rail [m/s²]"])
    rows = [";".join(f"{x:.17g}" for x in row) for row in zip(*columns.values(), *SAMPLES)]
    path.write_text("\n".join([*head, names, *rows]) + "\n", encoding="utf-8")


def write_tdms(path, entries, columns=None, start=None):
    """The first entry is a property of the file, the others of the group."""
    properties = {name: value for name, value in entries}
    first = dict(list(properties.items())[:1]) | ({"started_at": start} if start else {})
    channels = [nptdms.ChannelObject("impact", n, x, {}) for n, x in (columns or {}).items()]
    channels += [nptdms.ChannelObject("impact", n, x, {"unit_string": UNITS[n]}) for n, x in zip(UNITS, SAMPLES)]
    group = nptdms.GroupObject("impact", dict(list(properties.items())[1:]))
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([nptdms.RootObject(first), group, *channels])


def write_parquet(path, entries, columns=None, start=None):
    """The first entry is in the schema, the others in JSON."""
    table = pa.table({**(columns or {}), **dict(zip(UNITS, SAMPLES))})
    names = [name for name, _ in entries]
    notes = {str(names[0]): str(entries[0][1])} if entries else {}
    notes |= {"settings": json.dumps({"logger": dict(entries[1:])})} if entries[1:] else {}
    notes |= {"started_at": start} if start else {}
    pq.write_table(table.replace_schema_metadata(notes), path)


def write_hdf5(path, entries, columns=None, start=None):
    """The first entry is an attribute of a nested group, the others of the dataset of the force."""
    with h5py.File(path, "w") as file:
        for name, x in {**(columns or {}), **dict(zip(UNITS, SAMPLES))}.items():
            file[name] = x
        if entries:
            file.create_group("about/logger").attrs[entries[0][0]] = entries[0][1]
        for name, value in entries[1:]:
            file["force"].attrs[name] = value
        if start:
            file.attrs["started_at"] = start


def write_npz(path, entries, columns=None, start=None):
    """The first entry is an array, the others are in JSON."""
    arrays = {entries[0][0]: np.array(entries[0][1])} if entries else {}
    arrays |= {"info": np.array(json.dumps(dict(entries[1:])))} if entries[1:] else {}
    arrays |= {"started_at": np.array(start)} if start else {}
    np.savez(path, **arrays, **(columns or {}), **dict(zip(UNITS, SAMPLES)))


def write_mat(path, entries, columns=None, start=None):
    """The first entry is a variable, the others are in a structure."""
    variables = {plain(entries[0][0]): entries[0][1]} if entries else {}
    variables |= {"setup": {plain(name): value for name, value in entries[1:]}} if entries[1:] else {}
    variables |= {"started_at": start} if start else {}
    scipy.io.savemat(path, variables | (columns or {}) | dict(zip(UNITS, SAMPLES)))


def write_wav(path, entries, columns=None, start=None):
    """The header states the true rate."""
    notes = {"channels": list(UNITS), "units": list(UNITS.values()), **dict(entries)}
    notes |= {"started_at": start} if start else {}
    with soundfile.SoundFile(path, "w", int(TRUE), 2, "DOUBLE") as file:
        file.comment = json.dumps(notes)
        file.write(SAMPLES.T)


@cache
def written(format):
    """Bytes of a file of the format with one record."""
    with TemporaryDirectory() as folder:
        return write([recording(start=datetime(2024, 5, 13, 10))], Path(folder) / "a", format).read_bytes()


def write_lvm(path, entries, columns=None, start=None):
    """Every segment states the true step."""
    path.write_bytes(written("lvm"))
    text = path.read_text(encoding="utf-8")
    added = "".join(f"{name}\t{value}\n" for name, value in entries)
    text = text.replace("Multi_Headings", added + "Multi_Headings", 1)
    if start:
        date, clock = start.split("T")
        text = text.replace("2024/05/13", date.replace("-", "/")).replace("10:00:00.000000", clock)
    path.write_text(text, encoding="utf-8")


def write_uff(path, entries, columns=None, start=None):
    """Every set states the true step; the entries are in ID line 2, as free text."""
    path.write_bytes(written("uff58"))
    lines = path.read_text(encoding="utf-8").splitlines()
    text = "; ".join(f"{name}: {value}" for name, value in entries)
    for i, line in enumerate(lines):
        if line.strip() == "58" and text:
            lines[i + 2] = f"{text:<80.80}"
        if line.startswith("13-May-24") and start:
            year, month, day = start[:10].split("-")
            months = "Jan Feb Mar Apr May Jun Jul Aug Sep Oct Nov Dec".split()
            lines[i] = f"{day}-{months[int(month) - 1]}-{year} {start[11:19]}"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_rcmdx(path, entries, columns=None, start=None):
    """The time stamps state the true rate; the entries are attributes of the data source's parent."""
    path.write_bytes(written("rcmdx"))
    with h5py.File(path, "r+") as file:
        for name, value in entries:
            file["RCMDX"].attrs[name] = value


# Writer, file name, and what the format itself states of the true rate.
FORMATS = {
    "csv": (write_csv, "a.csv", False),
    "tdms": (write_tdms, "a.tdms", False),
    "parquet": (write_parquet, "a.parquet", False),
    "hdf5": (write_hdf5, "a.h5", False),
    "npz": (write_npz, "a.npz", False),
    "mat": (write_mat, "a.mat", False),
    "wav": (write_wav, "a.wav", True),
    "lvm": (write_lvm, "a.lvm", True),
    "uff": (write_uff, "a.uff", True),
    "rcmdx": (write_rcmdx, "a.rcmdx", True),
}


def outcome(path, description):
    """(rate, error) of the only record."""
    try:
        result = read(path.name, path.parent, description)
    except ReadError as error:
        return None, error
    return (result.recordings[0].rate if result.recordings else None), next(iter(result.errors), None)


def is_true(found):
    return found[0] is not None and abs(found[0] - TRUE) < 1e-4 * TRUE and found[1] is None


def is_rejected(found, *words):
    rate, error = found
    return rate is None and error is not None and error.reason == "wrong_rate" and all(w in str(error) for w in words)


@pytest.mark.parametrize("format", FORMATS)
def test_every_way_to_state_the_rate_is_understood_in_every_format(format, tmp_path):
    """Seven combinations for each way; the message about a contradiction states both rates."""
    write_file, name, states_rate = FORMATS[format]
    path, failures = tmp_path / name, []
    for i, (way, value_at) in enumerate(WAYS.items()):
        at_first = i % 2 == 0  # the place of the entry in the file
        filler = [("operator", "N. N.")]
        stated = [(way, value_at(TRUE))]
        write_file(path, stated if at_first else filler + stated)
        cases = {f"right {rate}": is_true(outcome(path, described(rate))) for rate in (TRUE, None)}
        cases["wrong layout"] = is_rejected(outcome(path, described(OTHER)), "25600")
        second = [] if states_rate else [("rate", TRUE)]
        wrong = [(way, value_at(OTHER))]
        write_file(path, wrong + second if at_first else second + wrong)
        for rate in (TRUE, OTHER, None):
            found = outcome(path, described(rate))
            cases[f"contradictory {rate}"] = is_rejected(found, "25600 Hz", "20000 Hz")
        if format != "uff":  # in free text a word without a number is no entry
            write_file(path, [(way, "fast")])
            cases["not understood"] = is_rejected(outcome(path, described(TRUE)), "is not understood")
        failures += [
            f"{way} ({'first' if at_first else 'second'} place): {case}" for case, ok in cases.items() if not ok
        ]
    assert failures == []


@pytest.mark.parametrize("format", FORMATS)
def test_without_a_statement_the_rate_of_the_layout_is_used(format, tmp_path):
    write_file, name, states_rate = FORMATS[format]
    write_file(tmp_path / name, [])
    assert is_true(outcome(tmp_path / name, described(TRUE)))
    found = outcome(tmp_path / name, described(None))
    assert is_true(found) if states_rate else is_rejected(found, "sampling rate")
    assert is_rejected(outcome(tmp_path / name, described(OTHER))) or not states_rate


AXES = {
    "time": lambda t: t, "Time (s)": lambda t: t, "Zeit_ms": lambda t: t * 1e3, "timestamp": lambda t: 1.7e9 + t,
    "temps": lambda t: t, "tiempo": lambda t: t, "Tid": lambda t: t, "relative time": lambda t: t,
    "idő": lambda t: t, "column 7": lambda t: t * 1e6, "kanal": lambda t: np.round(t, 6),
}  # fmt: skip


@pytest.mark.parametrize("format", ["csv", "tdms", "parquet", "hdf5", "npz"])
def test_a_time_axis_under_any_name_is_compared_even_if_the_layout_ignores_it(format, tmp_path):
    """Right, wrong layout, contradictory entry, a gap of eight samples."""
    write_file, name, _ = FORMATS[format]
    path, failures = tmp_path / name, []
    steps = np.arange(N_SAMPLE) / TRUE
    gap = np.where(np.arange(N_SAMPLE) < 40, steps, steps + 8 / TRUE)
    for axis, values in AXES.items():
        column = axis.partition(" (")[0] if format == "csv" else axis
        write_file(path, [], {axis: values(steps)})
        cases = {"right": is_true(outcome(path, described(TRUE, column)))}
        cases["wrong layout"] = is_rejected(outcome(path, described(OTHER, column)), "20000 Hz")
        write_file(path, [("Sample rate", OTHER)], {axis: values(steps)})
        found = outcome(path, described(OTHER, column))
        cases["contradictory"] = is_rejected(found, "20000 Hz")
        write_file(path, [], {axis: values(gap)})
        rate, error = outcome(path, described(TRUE, column))
        cases["gap"] = rate is None and error is not None and error.reason in ("truncated", "wrong_rate")
        failures += [f"{axis}: {case}" for case, ok in cases.items() if not ok]
    assert failures == []


def test_an_index_of_pandas_is_read_as_a_time_axis(tmp_path):
    """Unnamed and named, of dates, durations and numbers; a gap is found."""
    steps = np.arange(N_SAMPLE) / TRUE
    dates = pd.Timestamp("2026-05-13T08:30:12Z") + pd.to_timedelta(np.round(steps * 1e9).astype("int64"), unit="ns")
    indices = {"dates": dates, "durations": pd.to_timedelta(steps, unit="s"), "numbers": pd.Index(steps)}
    for label, index in indices.items():
        for index_name in (None, "timestamp", "moment"):
            frame = pd.DataFrame(dict(zip(UNITS, SAMPLES)), index=index.rename(index_name))
            frame.to_parquet(tmp_path / "a.parquet")
            ignored = () if index_name is None or label != "numbers" else (index_name,)
            assert is_true(outcome(tmp_path / "a.parquet", described(TRUE, *ignored))), (label, index_name)
            assert is_rejected(outcome(tmp_path / "a.parquet", described(OTHER, *ignored)), "20000"), (
                label,
                index_name,
            )
            pd.concat([frame.iloc[:30], frame.iloc[38:]]).to_parquet(tmp_path / "b.parquet")
            rate, error = outcome(tmp_path / "b.parquet", described(TRUE, *ignored))
            assert rate is None and error.reason == "truncated", (label, index_name)


# Printed step of a Universal File, rate of the layout -> rate that is read, None for a rejection.
STEPS = {
    "0.0001": {10000: 10000, 20000: None, 12800: None, None: 10000},
    "4e-05": {25000: 25000, 20000: None, 25600: None, None: 25000},
    "4.0E-05": {25000: 25000, 20000: None, None: None},
    "4.9E-05": {20408: 20408, 20000: None, None: None},
    "6.25e-05": {16000: 16000, 20000: None, None: 16000},
    "0.000020": {51200: 51200, 50000: 50000, 48000: None, None: None},
    "1.95312E-05": {51200: 51200, 51201: None, 50000: None, None: 51200},
    "3.90625E-05": {25600: 25600, 25601: None, None: 25600},
}  # fmt: skip


@pytest.mark.parametrize("text", STEPS)
def test_a_printed_step_is_known_to_half_a_unit_of_its_last_digit(text, tmp_path):
    write([recording()], tmp_path / "a.uff", "uff58")
    content = (tmp_path / "a.uff").read_text()
    (tmp_path / "a.uff").write_text(content.replace(f"{1 / TRUE:13.5e}", f"{text:>13}"))
    for layout_rate, expected in STEPS[text].items():
        rate, error = outcome(tmp_path / "a.uff", described(layout_rate))
        assert rate == expected and (error is None) == (expected is not None), layout_rate


def test_the_x_column_of_lvm_is_more_precise_than_a_step_with_six_decimals(tmp_path):
    """51.2 kHz with Delta_X printed as 0.000020: the X column gives the rate."""
    head = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n***End_of_Header***\t\n\t\n"
    for true in (51200.0, 44000.0):
        repeated = np.tile(SAMPLES, 20)
        rows = "".join(f"{k / true:.6f}\t{f:.6f}\t{a:.6f}\n" for k, (f, a) in enumerate(repeated.T))
        segment = (
            f"Channels\t2\nSamples\t{20 * N_SAMPLE}\t{20 * N_SAMPLE}\nY_Unit_Label\tN\tm/s²\nX_Dimension\tTime\tTime\n"
        )
        segment += "X0\t0.0\t0.0\nDelta_X\t0.000020\t0.000020\n***End_of_Header***\t\t\nX_Value\tforce\trail\tComment\n"
        (tmp_path / "a.lvm").write_text(head + segment + rows + "\n", encoding="utf-8")
        for layout_rate in (true, None, 25600.0, 50000.0):
            rate, error = outcome(tmp_path / "a.lvm", described(layout_rate))
            if true == 51200.0 and layout_rate in (true, None):
                assert rate == pytest.approx(true, rel=1e-4) and error is None, error
            else:
                assert rate is None and error.reason == "wrong_rate", (true, layout_rate)


STARTS = {
    "2024-02-30T10:00:00": "cannot be read",
    "2026-03-29T02:30:00": "does not exist in Europe/Copenhagen",
    "2026-10-25T02:30:00": "comes twice in Europe/Copenhagen",
    "1904-01-01T00:00:00": "is no time of a recording",
    "1970-01-01T00:00:00": "is no time of a recording",
    f"{datetime.now() + timedelta(days=3):%Y-%m-%d}T10:00:00": "is in the future",  # workers need equal names
    "2097-05-13T10:00:00": "is in the future",
}


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("format", [f for f in FORMATS if f != "rcmdx"])
def test_an_impossible_or_ambiguous_start_time_is_reported_in_every_format(format, start, tmp_path):
    """The record is kept; a time stamp of RCM-DX is a number since 1970 in UTC."""
    write_file, name, _ = FORMATS[format]
    write_file(tmp_path / name, [("rate", TRUE)], start=start)
    description = replace(described(TRUE), time_zone="Europe/Copenhagen")
    result = read(name, tmp_path, description)
    (error,) = result.errors
    assert error.reason == "start_unknown" and STARTS[start] in error.problem
    assert len(result.recordings) == 1
    clock_change = "Europe" in STARTS[start]
    assert (result.recordings[0].started_at is not None) == clock_change
    write_file(tmp_path / name, [("rate", TRUE)], start="2026-05-13T10:00:00")
    result = read(name, tmp_path, description)
    assert result.errors == () and result.recordings[0].started_at == datetime(2026, 5, 13, 8)


@pytest.mark.parametrize("name", ["Filter rate", "calibration period", "Number of averages", "trigger frequency",
                                  "Low pass [Hz]", "Baud rate", "max. sampling rate", "FFT interval"])  # fmt: skip
@pytest.mark.parametrize("format", ["csv", "tdms", "hdf5", "npz"])
def test_other_rates_and_periods_of_a_logger_are_not_read_as_the_rate(format, name, tmp_path):
    write_file, file_name, _ = FORMATS[format]
    write_file(tmp_path / file_name, [(name, 4000.0)])
    assert is_true(outcome(tmp_path / file_name, described(TRUE)))


def test_a_column_with_a_unit_in_the_layout_is_not_read_as_a_time_axis(tmp_path):
    """A distance that increases evenly, like that of an odometer at constant speed."""
    write_csv(tmp_path / "a.csv", [("rate", TRUE)], {"odometer": np.arange(N_SAMPLE) * 0.0137})
    assert is_rejected(outcome(tmp_path / "a.csv", described(TRUE, "odometer")), "may be a time axis", "unit")
    distance = RawChannel("odometer", "odometer", "ignored", unit="m")
    assert is_true(outcome(tmp_path / "a.csv", RawDescription((*SENSORS, distance), rate=TRUE)))


HEADS = {
    "Abtastrate;25,6;kHz": TRUE, "Abtastrate;kHz;25,6": TRUE, "Sample rate;25,600": TRUE, "Sample rate;25.600 Hz": TRUE,
    "Messrate;25'600 Hz": TRUE, "# fs=25600 Hz, n=64": TRUE, "% recorded at 25.6 kHz sampling rate": None,
    "Sample rate;25.6": None, "dt;0.0390625": None, "Logger 3, 25600 Hz, 2 channels": None,
}  # fmt: skip


@pytest.mark.parametrize("head", HEADS)
def test_a_header_in_other_forms_is_compared_with_the_layout(head, tmp_path):
    """A number that may have several units gives the rate only together with a layout."""
    rows = "\n".join(";".join(f"{x:.12g}" for x in row) for row in SAMPLES.T)
    (tmp_path / "a.csv").write_text(f"{head}\nforce [N];rail [m/s²]\n{rows}\n", encoding="utf-8")
    assert is_true(outcome(tmp_path / "a.csv", described(TRUE)))
    assert is_rejected(outcome(tmp_path / "a.csv", described(OTHER)), "20000 Hz")
    found = outcome(tmp_path / "a.csv", described(None))
    assert is_true(found) if HEADS[head] else is_true(found) or is_rejected(found)


def test_a_channel_of_time_stamps_in_tdms_is_read_as_a_time_axis(tmp_path):
    stamps = np.datetime64("2026-05-13T08:30:12") + np.round(np.arange(N_SAMPLE) / TRUE * 1e6).astype("timedelta64[us]")
    write_tdms(tmp_path / "a.tdms", [], {"moment": stamps})
    assert is_true(outcome(tmp_path / "a.tdms", described(TRUE, "moment")))
    assert is_rejected(outcome(tmp_path / "a.tdms", described(OTHER, "moment")), "'moment'")


# Names that may mean a rate or a step, beside the certain ones of WAYS: the layout must agree with one of them.
RATE_NAMES = (
    "Frames per second", "Ticks per second", "Punkte pro Sekunde", "Points par seconde", "Puntos por segundo",
    "Punti al secondo", "srate", "smprate", "Datenrate", "Signal sample rate", "Fe",
)  # fmt: skip
STEP_NAMES = (
    "Raster", "Time resolution", "Zeitauflösung", "Résolution temporelle", "Tidsopløsning", "HResolution",
    "Time between samples", "Abstand der Messwerte", "Taktzyklus", "T_s",
)  # fmt: skip


@pytest.mark.parametrize("format", ["csv", "tdms", "hdf5", "npz", "parquet", "mat"])
def test_entries_that_may_be_a_rate_or_a_step_are_compared_with_the_layout(format, tmp_path):
    write_file, name, _ = FORMATS[format]
    failures = []
    ways = [(n, TRUE) for n in RATE_NAMES] + [(f"{n} [µs]", 1e6 / TRUE) for n in STEP_NAMES if n != "T_s"]
    ways += [("T_s", 1 / TRUE)]
    if format == "mat":
        ways = [(n, value) for n, value in ways if n.isascii() and "[" not in n]
    for way, value in ways:
        write_file(tmp_path / name, [(way, value)])
        cases = {
            "right": is_true(outcome(tmp_path / name, described(TRUE))),
            "wrong": is_rejected(outcome(tmp_path / name, described(OTHER)), "20000 Hz"),
        }
        failures += [f"{way}: {case}" for case, ok in cases.items() if not ok]
    assert failures == []


DURATIONS = (
    "Contact time [ms]", "Pulse width [ms]", "Rise time [ms]", "Delay [ms]", "Time constant [ms]",
    "Duration of the contact [ms]", "Filter time [ms]", "Jitter [ms]", "Peak time [ms]", "Overlap [ms]", "ts",
)  # fmt: skip


@pytest.mark.parametrize("format", ["csv", "tdms", "hdf5", "npz"])
def test_other_durations_of_a_logger_are_not_read_as_the_step(format, tmp_path):
    write_file, name, _ = FORMATS[format]
    for way in DURATIONS:
        write_file(tmp_path / name, [(way, 1715587200.0 if way == "ts" else 1.5)])
        assert is_true(outcome(tmp_path / name, described(TRUE))), way


def test_a_time_in_an_unknown_unit_gives_no_implausible_rate(tmp_path):
    write_csv(tmp_path / "a.csv", [], {"Zeit": np.arange(N_SAMPLE) * 1e6 / TRUE})
    assert is_true(outcome(tmp_path / "a.csv", described(TRUE)))
    assert is_rejected(outcome(tmp_path / "a.csv", described(None)), "may mean")


def test_a_rate_in_the_comment_of_a_wav_file_contradicts_its_header(tmp_path):
    for rate, is_right in ((TRUE, True), (OTHER, False)):
        with soundfile.SoundFile(tmp_path / "a.wav", "w", int(TRUE), 2, "DOUBLE") as file:
            file.comment = f"sampled at {rate:g} Hz"
            file.write(SAMPLES.T)
        sensors = tuple(replace(s, source=i) for i, s in enumerate(SENSORS))
        found = outcome(tmp_path / "a.wav", RawDescription(sensors, rate=TRUE))
        assert is_true(found) if is_right else is_rejected(found, "20000 Hz", "25600 Hz")


START_ENTRIES = (
    "Recorded on",
    "Aufnahmezeitpunkt",
    "Trigger time",
    "Timestamp",
    "Date and time",
    "Messung vom",
    "acquired",
)
OTHER_TIMES = ("Calibration date", "End time", "Exported on", "Letzte Wartung", "Firmware date")


@pytest.mark.parametrize("format", ["csv", "tdms", "hdf5", "npz", "parquet", "mat"])
def test_a_start_time_under_any_name_is_read_or_reported(format, tmp_path):
    """The time of another event is not used; impossible dates and two different starts are reported."""
    write_file, name, _ = FORMATS[format]
    expected = datetime(2026, 5, 13, 10)
    for entry in (*START_ENTRIES, *OTHER_TIMES):
        for text in ("2026-05-13 10:00:00", "13.05.2026 10:00:00", "2026-02-30 10:00:00"):
            write_file(tmp_path / name, [("rate", TRUE), (entry, text)])
            result = read(name, tmp_path, described(TRUE))
            is_start, is_time = entry in START_ENTRIES, "02-30" not in text
            assert result.recordings[0].started_at == (expected if is_start and is_time else None), (entry, text)
            assert [e.reason for e in result.errors] == (["start_unknown"] if is_start and not is_time else [])
    write_file(tmp_path / name, [("rate", TRUE), ("Recorded on", "2026-05-13 10:00"), ("Start", "2026-05-14 10:00")])
    (error,) = read(name, tmp_path, described(TRUE)).errors
    assert error.reason == "start_unknown" and "2026-05-14" in error.problem


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("name", ["Decimation", "Downsampling factor", "Unterabtastung", "Facteur de décimation"])
def test_a_reduction_beside_a_rate_is_applied_or_reported(format, name, tmp_path):
    """The file states twice the true rate and a reduction by two; a true rate in the format is used."""
    write_file, file_name, states_rate = FORMATS[format]
    if format == "uff" and not name.isascii():
        pytest.skip("the text is in ASCII")
    path = tmp_path / file_name
    word = plain(name) if format == "mat" else name
    write_file(path, [("Sample rate", 2 * TRUE), (word, 2)])
    assert is_true(outcome(path, described(TRUE)))
    if states_rate:
        assert is_true(outcome(path, described(None))) and is_rejected(outcome(path, described(2 * TRUE)))
        return
    assert is_rejected(outcome(path, described(None)), "reduction by 2", "51200 or 25600 Hz")
    rate, remark = outcome(path, described(2 * TRUE))
    assert rate == 2 * TRUE and remark.reason == "rate_ambiguous" and "reduction by 2" in str(remark)
    write_file(path, [("Sample rate", TRUE), (word, 1)])
    assert is_true(outcome(path, described(None)))


def test_a_stated_reduced_rate_is_used(tmp_path):
    for entries in ([("Sample rate", 2 * TRUE), ("Decimated rate", "25600 Hz")], [("Rate", TRUE), ("dt", 1 / TRUE)]):
        write_csv(tmp_path / "a.csv", [*entries, ("Decimation", 2)])
        assert is_true(outcome(tmp_path / "a.csv", described(TRUE))) == (len(entries[0][0]) > 4)
    write_csv(tmp_path / "a.csv", [("Sample rate", 2 * TRUE), ("Decimation", 2)], {"t": np.arange(N_SAMPLE) / TRUE})
    assert is_true(outcome(tmp_path / "a.csv", described(None, "t")))


@pytest.mark.parametrize("format", ["mat", "npz"])
def test_a_variable_with_the_name_t_in_upper_case_is_read_as_a_channel_or_an_axis(format, tmp_path):
    """Formerly, it was lost: "t" is the time and "T" a temperature."""
    n = 500
    samples = {s.source: np.random.default_rng(i).normal(size=n) for i, s in enumerate(SENSORS)}
    for values, is_right in (
        (np.arange(n) / TRUE, True),
        (np.arange(n) / 20000.0, False),
        (np.sin(np.arange(n)), True),
    ):
        variables = {**samples, "T": values}
        if format == "mat":
            scipy.io.savemat(tmp_path / "a.mat", variables)
        else:
            np.savez(tmp_path / "a.npz", **variables)
        result = read(f"a.{format}", tmp_path, described(TRUE, "T"))
        assert len(result.recordings) == is_right
        assert all("column 'T', which rises evenly" in error.problem for error in result.errors)


@pytest.mark.parametrize("text", ["50 m", "0.05m", "20q", "25k6", "20 kk"])
def test_a_letter_that_is_no_prefix_of_the_unit_is_an_error(text, tmp_path):
    """A step of 0.05 m is a distance along the track."""
    write_npz(tmp_path / "a.npz", [("sampling interval", text)])
    result = read("a.npz", tmp_path, described(TRUE))
    assert [error.reason for error in result.errors] == ["wrong_rate"] and "not understood" in str(result.errors[0])
