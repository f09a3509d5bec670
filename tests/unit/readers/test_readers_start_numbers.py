"""Start times stated as numbers, as time stamps and with time zones, in every format."""

import json
from datetime import UTC, datetime, timedelta

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from nptdms import ChannelObject, RootObject, TdmsWriter

from turnout.readers import read, read_unconverted
from turnout.records import RawChannel, RawDescription

RATE, N = 1000.0, 40
SAMPLES = dict(zip(("force", "rail"), np.random.default_rng(5).normal(size=(2, N)).round(4)))
START = datetime(2026, 5, 13, 10)
IN_UTC = START.replace(tzinfo=UTC)
UNIX = int(IN_UTC.timestamp())
DAYS = UNIX / 86400
LOCAL_1904 = UNIX + 2082844800
SENSORS = RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²")


def npz(folder, entries, columns):
    np.savez(folder / "a.npz", **SAMPLES, **columns, **{name: np.asarray(value) for name, value in entries.items()})
    return "a.npz"


def hdf5(folder, entries, columns):
    with h5py.File(folder / "a.h5", "w") as file:
        for name, values in {**SAMPLES, **columns}.items():
            file[name] = values
        file.attrs.update(entries)
    return "a.h5"


def mat(folder, entries, columns):
    scipy.io.savemat(folder / "a.mat", {**SAMPLES, **columns, **entries})
    return "a.mat"


def parquet(folder, entries, columns):
    texts = {name: value if isinstance(value, str) else json.dumps(value) for name, value in entries.items()}
    pq.write_table(pa.table({**SAMPLES, **columns}).replace_schema_metadata(texts), folder / "a.parquet")
    return "a.parquet"


def tdms(folder, entries, columns):
    channels = [ChannelObject("g", name, values) for name, values in {**SAMPLES, **columns}.items()]
    with TdmsWriter(str(folder / "a.tdms")) as writer:
        writer.write_segment([RootObject(entries), *channels])
    return "a.tdms"


def text(folder, entries, columns):
    table = {**SAMPLES, **columns}
    head = [f"# {name}: {value}" for name, value in entries.items()]
    rows = [";".join(map(str, row)) for row in zip(*(values.tolist() for values in table.values()))]
    (folder / "a.csv").write_text("\n".join([*head, ";".join(table), *rows]) + "\n", encoding="utf-8")
    return "a.csv"


FORMATS = (npz, hdf5, mat, parquet, tdms, text)
EXCEL = "days since 1899-12-30 or days since 1904-01-01?"

NUMBERS = {  # way: name, number, start or the question that is reported
    "s": ("started_at", UNIX, IN_UTC),
    "s with parts": ("started_at", UNIX + 0.25, IN_UTC + timedelta(seconds=0.25)),
    "ms": ("started_at", UNIX * 1000, IN_UTC),
    "us": ("started_at", UNIX * 10**6, IN_UTC),
    "ns": ("started_at", UNIX * 10**9, IN_UTC),
    "digits": ("started_at", str(UNIX), IN_UTC),
    "digits of ms": ("started_at", str(UNIX * 1000), IN_UTC),
    "written": ("started_at", "20260513100000", START),
    "written as a number": ("started_at", 20260513100000, START),
    "written or counted": ("started_at", "2026051310000", "a date or a count?"),
    "MATLAB": ("start_time", DAYS + 719529, START),
    "Julian": ("start_time", DAYS + 2440587.5, IN_UTC),
    "LabVIEW": ("start_time", LOCAL_1904, IN_UTC),
    "Windows": ("start_time", UNIX * 10**7 + 116444736 * 10**9, IN_UTC),
    "spreadsheet": ("start_time", DAYS + 25569, EXCEL),
    "spreadsheet of 1904": ("start_time", DAYS + 24107, EXCEL),
    "since power on": ("start_time", 45000.5, "45000.5"),
    "ms since power on": ("start_time_ms", 45000, ""),
    "named ms": ("start_time_ms", UNIX * 1000, IN_UTC),
    "named unix": ("recorded_unix", UNIX, IN_UTC),
    "named excel 1904": ("start_date_excel_1904", DAYS + 24107, START),
    "named excel 1900": ("start_date_excel_1900", DAYS + 25569, START),
    "named datenum": ("record_datenum", DAYS + 719529, START),
    "named mjd": ("record_date_mjd", DAYS + 40587, IN_UTC),
    "named GPS": ("record_date_gps", UNIX - 315964800 + 18, "record_date_gps"),
    "a duration": ("record_time_s", 45000.5, ""),
    "a number of a record": ("record_number", 45000.5, ""),
    "of another event": ("calibration_date_unix", UNIX, ""),
}


def assert_start(record, expected):
    if isinstance(expected, datetime):
        assert (record.started_at, record.unread_start) == (expected, "")
    else:
        assert record.started_at is None
        assert expected in record.unread_start and bool(record.unread_start) == bool(expected)


@pytest.mark.parametrize("way", NUMBERS)
@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.__name__)
def test_a_number_is_read_as_a_start_if_exactly_one_count_fits_and_is_reported_otherwise(tmp_path, form, way):
    name, number, expected = NUMBERS[way]
    (record,) = read_unconverted(form(tmp_path, {name: number, "rate": RATE}, {}), tmp_path)[2].records
    assert_start(record, expected)


OFFSETS = np.arange(N) / RATE
MICROSECONDS = np.arange(N) * 1000
AXES = {  # way: values, start in UTC, local start, or the question that is reported
    "s": (UNIX + OFFSETS, IN_UTC),
    "ms": (UNIX * 1000.0 + OFFSETS * 1000, IN_UTC),
    "us": (UNIX * 10**6 + MICROSECONDS, IN_UTC),
    "ns": (UNIX * 10**9 + MICROSECONDS * 1000, IN_UTC),
    "MATLAB": (DAYS + 719529 + OFFSETS / 86400, START),
    "LabVIEW": (LOCAL_1904 + OFFSETS, IN_UTC),
    "spreadsheet": (DAYS + 25569 + OFFSETS / 86400, EXCEL),
    "since the start": (OFFSETS, ""),
    "since power on": (45000.5 + OFFSETS, ""),
    "us since power on": (7e8 + MICROSECONDS, ""),
}


@pytest.mark.parametrize("way", AXES)
@pytest.mark.parametrize("name", ["time", "timestamp"])
@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.__name__)
def test_a_time_axis_states_the_start_if_its_origin_is_known(tmp_path, form, name, way):
    values, expected = AXES[way]
    (record,) = read_unconverted(form(tmp_path, {}, {name: values}), tmp_path)[2].records
    assert_start(record, expected)
    description = RawDescription(SENSORS, rate=RATE, time_zone="Europe/Zurich")
    (recording,) = read(form(tmp_path, {}, {name: values}), tmp_path, description).recordings
    local = START - timedelta(hours=2)
    assert recording.started_at == {IN_UTC: START, START: local}.get(expected)


STAMPS = np.datetime64(START, "us") + MICROSECONDS.astype("timedelta64[us]")


@pytest.mark.parametrize("form, is_utc", [(npz, False), (parquet, False), (tdms, True)])
@pytest.mark.parametrize("name", ["time", "logged"])
def test_time_stamps_are_in_utc_if_the_format_specifies_it(tmp_path, form, is_utc, name):
    (record,) = read_unconverted(form(tmp_path, {}, {name: STAMPS}), tmp_path)[2].records
    assert_start(record, IN_UTC if is_utc else START)


def test_time_stamps_with_a_zone_are_converted_from_it(tmp_path):
    column = pa.array(STAMPS).cast(pa.timestamp("us", "Europe/Zurich"))
    (record,) = read_unconverted(parquet(tmp_path, {}, {"time": column}), tmp_path)[2].records
    assert_start(record, IN_UTC)


def test_a_single_time_stamp_is_read_as_a_start(tmp_path):
    for form, expected in ((npz, START), (tdms, IN_UTC)):
        for name in ("started_at", "recorded on"):
            path = form(tmp_path, {name: np.datetime64(START, "us")}, {})
            assert_start(read_unconverted(path, tmp_path)[2].records[0], expected)


@pytest.mark.parametrize(
    "unit, first, expected",
    [
        ("seconds since 1970-01-01 00:00:00", UNIX, IN_UTC),
        ("milliseconds since 2026-05-13", 36_000_000, IN_UTC),
        ("days since 1904-01-01 00:00:00 UTC", DAYS + 24107, IN_UTC),
        ("days since 1899-12-30", DAYS + 25569, IN_UTC),
        ("seconds since 05/06/2026", 12, "05/06/2026"),
        ("s since power on", UNIX, ""),
    ],
)
def test_the_unit_of_a_dataset_states_the_origin(tmp_path, unit, first, expected):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values in SAMPLES.items():
            file[name] = values
        file["time"] = first + OFFSETS / (86400 if unit.startswith("days") else 1) * (1000 if "milli" in unit else 1)
        file["time"].attrs["units"] = unit
    assert_start(read_unconverted("a.h5", tmp_path)[2].records[0], expected)


def test_each_record_of_a_table_has_its_own_start(tmp_path):
    numbers = np.repeat([1, 2], N // 2)
    times = STAMPS + (numbers - 1) * np.timedelta64(60, "s")
    records = read_unconverted(parquet(tmp_path, {}, {"record": numbers, "time": times}), tmp_path)[2].records
    assert [r.started_at.replace(microsecond=0) for r in records] == [START, START + timedelta(seconds=60)]


ZONES = {
    "UTC": 10, "UTC+2": 8, "+02:00": 8, "+0545": None, "-05:00": 15, "Europe/Zurich": 8, 2: 8, 120: 8, 7200: 8, -5: 15,
}  # fmt: skip


@pytest.mark.parametrize("zone", ZONES)
@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.__name__)
def test_the_time_zone_of_the_file_is_used_for_its_start(tmp_path, form, zone):
    path = form(tmp_path, {"started_at": "2026-05-13T10:00:00", "utc_offset": zone, "rate": RATE}, {})
    (record,) = read_unconverted(path, tmp_path)[2].records
    assert record.started_at.astimezone(UTC) == datetime(
        2026, 5, 13, ZONES[zone] or 4, 0 if ZONES[zone] else 15, tzinfo=UTC
    )
    assert not record.unread_zone


@pytest.mark.parametrize(
    "zone, is_that_of_the_layout", [("CEST", True), ("MESZ", True), ("CET", False), ("Bern", False)]
)
def test_a_zone_that_cannot_be_read_is_reported_unless_it_is_that_of_the_layout(tmp_path, zone, is_that_of_the_layout):
    path = text(tmp_path, {"started_at": "2026-05-13T10:00:00", "time zone": zone, "rate": RATE}, {})
    result = read(path, tmp_path, RawDescription(SENSORS, rate=RATE, time_zone="Europe/Zurich"))
    assert result.recordings[0].started_at == START - timedelta(hours=2)
    problems = [error.problem for error in result.errors if error.reason == "start_unknown"]
    assert problems == (
        []
        if is_that_of_the_layout
        else [f"its time zone {zone!r} cannot be read: that of the layout is used, Europe/Zurich"]
    )


NAMES_WITH_ZONE = {"start time utc": 10, "start_time_utc": 10, "StartTimeUTC": 10, "utc_start_time": 10}
NAMES_IN_BRACKETS = {
    "Start time (UTC)": 10, "Start time [GMT]": 10, "Start time (UTC+1)": 9, "Start time [+02:00]": 8,
    "Start time (Europe/Zurich)": 8, "Start time (local)": None, "Start time (1)": None,
}  # fmt: skip


@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.__name__)
def test_a_zone_in_the_name_of_the_start_is_used(tmp_path, form):
    for name, hour in (NAMES_WITH_ZONE if form is mat else NAMES_WITH_ZONE | NAMES_IN_BRACKETS).items():
        if form is mat and " " in name:
            continue
        (record,) = read_unconverted(form(tmp_path, {name: "2026-05-13T10:00:00", "rate": RATE}, {}), tmp_path)[
            2
        ].records
        expected = START if hour is None else datetime(2026, 5, 13, hour, tzinfo=UTC)
        assert (record.started_at, record.unread_zone) == (expected, ""), name


def test_a_zone_in_the_name_has_priority_over_another_entry_and_an_abbreviation_is_reported(tmp_path):
    for name, started_at in (("Start time (UTC)", START), ("Start time (CET)", START - timedelta(hours=2))):
        path = text(tmp_path, {name: "2026-05-13 10:00:00", "rate": RATE}, {})
        result = read(path, tmp_path, RawDescription(SENSORS, rate=RATE, time_zone="Europe/Zurich"))
        assert result.recordings[0].started_at == started_at
        assert ["'CET' cannot be read" in error.problem for error in result.errors] == ["CET" in name] * ("CET" in name)
    entries = {"Start time (UTC)": "2026-05-13 10:00:00", "time zone": "Europe/Zurich", "rate": RATE}
    assert read_unconverted(text(tmp_path, entries, {}), tmp_path)[2].records[0].started_at == IN_UTC


@pytest.mark.parametrize("name", ["time_utc", "Timestamp (UTC)"])
@pytest.mark.parametrize("form", [parquet, tdms], ids=lambda form: form.__name__)
def test_a_zone_in_the_name_of_a_time_axis_is_used_for_its_start(tmp_path, form, name):
    (record,) = read_unconverted(form(tmp_path, {}, {name: STAMPS}), tmp_path)[2].records
    assert record.started_at == IN_UTC


@pytest.mark.parametrize("stamp", ["2026-05-13 10:00:00 UTC", "13.05.2026 10:00:00 (UTC)", "2026-05-13T10:00 GMT"])
def test_a_zone_after_a_time_is_used(tmp_path, stamp):
    (record,) = read_unconverted(text(tmp_path, {"started_at": stamp, "rate": RATE}, {}), tmp_path)[2].records
    assert record.started_at == IN_UTC


@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.__name__)
def test_a_number_that_was_read_as_the_start_is_not_reported(tmp_path, form):
    """Days of MATLAB have a fraction, like a scale."""
    path = form(tmp_path, {"start_time": DAYS + 719529.0, "rate": RATE}, {})
    result = read(path, tmp_path, RawDescription(SENSORS, rate=RATE))
    assert (result.recordings[0].started_at, result.errors) == (START, ())
