"""The start of a recording in the first row of a text table: dates, times of day, and counts since 1970."""

from datetime import UTC, datetime

import numpy as np
import pytest

from turnout.readers import read_unconverted

RATE, N = 1000.0, 40
NUMBERS = np.random.default_rng(5).normal(size=(N, 2)).round(4)
START = datetime(2026, 5, 13, 10)
CLOCKS = [f"10:00:00.{k:03d}" for k in range(N)]


def record(folder, head, times, name="a.csv"):
    rows = [f"{time};{a};{b}" for time, (a, b) in zip(times, NUMBERS)]
    (folder / name).write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
    (raw,) = next(part for part in read_unconverted(name, folder) if hasattr(part, "records")).records
    np.testing.assert_allclose(np.array([np.asarray(x[:]) for x in raw.samples]), NUMBERS.T)
    return raw


DATES = {
    "2026-05-13": START, "2026/05/13": START, "13.05.2026": START, "13.5.2026": START, "13/05/2026": START,
    "05/13/2026": START, "05/05/2026": datetime(2026, 5, 5, 10), "13-05-2026": START,
    "05/06/2026": None, "05-06-2026": None, "13.05.26": None, "2026-02-30": None,
}  # fmt: skip


@pytest.mark.parametrize("date", DATES)
@pytest.mark.parametrize("columns", ["Time", "Date;Clock"])
def test_a_date_with_the_time_of_day_is_the_start_and_an_ambiguous_date_is_reported(tmp_path, date, columns):
    separator = ";" if ";" in columns else " "
    raw = record(tmp_path, [f"{columns};force [N];rail [m/s2]"], [f"{date}{separator}{clock}" for clock in CLOCKS])
    assert raw.started_at == DATES[date]
    assert raw.unread_start.startswith(date) == (DATES[date] is None)
    assert ("day or month first?" in raw.unread_start) == (date in ("05/06/2026", "05-06-2026", "13.05.26"))


ZONES = {"Z": 10, " UTC": 10, "+02:00": 8, " -0500": 15, "+05:45": None, "+02:07": None}


@pytest.mark.parametrize("zone", ZONES)
def test_a_zone_in_the_cell_is_used_for_the_start(tmp_path, zone):
    raw = record(tmp_path, ["Time;force [N];rail [m/s2]"], [f"2026-05-13 {clock}{zone}" for clock in CLOCKS])
    if zone == "+02:07":
        assert raw.started_at is None and raw.unread_start
    else:
        expected = datetime(2026, 5, 13, ZONES[zone] or 4, 0 if ZONES[zone] else 15, tzinfo=UTC)
        assert raw.started_at == expected


def test_a_time_of_day_in_the_afternoon_is_read(tmp_path):
    raw = record(tmp_path, ["Time;force [N];rail [m/s2]"], [f"05/13/2026 {clock} PM" for clock in CLOCKS])
    assert raw.started_at == datetime(2026, 5, 13, 22)


@pytest.mark.parametrize("unit, size", [("s", 1.0), ("", 1.0), ("ms", 1e-3), ("", 1e-3), ("", 1e-6), ("", 1e-9)])
def test_a_count_since_1970_is_read_as_a_start_in_utc(tmp_path, unit, size):
    first = int(START.replace(tzinfo=UTC).timestamp())
    times = [f"{first}.{k:03d}" if size == 1.0 else str(round((first * 1000 + k) * 1e-3 / size)) for k in range(N)]
    name = f"time [{unit}]" if unit else "time"
    assert record(tmp_path, [f"{name};force [N];rail [m/s2]"], times).started_at == START.replace(tzinfo=UTC)


DAYS = {  # unit of the column, first number, and the start or the reported question
    ("d", 46155.5): "days since 1899-12-30 or days since 1904-01-01?",
    ("days", 740115.5): datetime(2026, 5, 13, 12),
    ("days since 1899-12-30", 46155.5): datetime(2026, 5, 13, 12, tzinfo=UTC),
    ("hours since 1970-01-01", 494074.0): START.replace(tzinfo=UTC),
    ("h", 46155.5): None,
}


@pytest.mark.parametrize("unit, first", DAYS)
def test_a_column_of_days_is_not_read_as_seconds(tmp_path, unit, first):
    """Formerly, the start was in 2030 without a message: LabVIEW counts 46155 s then."""
    size = 24.0 if unit.startswith("h") else 1.0
    times = [f"{first + k * size / 86_400_000.0:.14f}" for k in range(N)]
    raw = record(tmp_path, [f"Time [{unit}];force [N];rail [m/s2]"], times)
    expected = DAYS[unit, first]
    if isinstance(expected, str):
        assert raw.started_at is None and expected in raw.unread_start
    else:
        assert raw.started_at == expected and not raw.unread_start


@pytest.mark.parametrize("first, step", [(0.0, 0.001), (12.5, 0.001), (7e8, 50.0), (3.0e9, 50.0)])
def test_a_count_from_another_origin_is_not_read_as_a_start(tmp_path, first, step):
    times = [f"{first + step * k:.3f}" for k in range(N)]
    raw = record(tmp_path, ["time;force [N];rail [m/s2]"], times)
    assert raw.started_at is None and not raw.unread_start


def test_the_start_in_the_header_is_used_and_another_day_in_the_column_is_reported(tmp_path):
    head = ["# started_at: 2026-05-13T10:00:00", "Time;force [N];rail [m/s2]"]
    assert record(tmp_path, head, [f"13.05.2026 {c}" for c in CLOCKS]).unread_start == ""
    raw = record(tmp_path, head, [f"19.05.2026 {c}" for c in CLOCKS], "b.csv")
    assert raw.started_at == START and raw.unread_start.startswith("2026-05-19")


def test_the_date_of_another_event_is_not_read_as_a_start(tmp_path):
    raw = record(tmp_path, ["Exported;force [N];rail [m/s2]"], [f"13.05.2026 {c}" for c in CLOCKS])
    assert raw.started_at is None


@pytest.mark.parametrize("name", ["Time (UTC)", "UTC", "Timestamp UTC", "Zeit [UTC]"])
def test_a_zone_in_the_name_of_the_column_is_used_for_the_start(tmp_path, name):
    raw = record(tmp_path, [f"{name};force [N];rail [m/s2]"], [f"2026-05-13 {clock}" for clock in CLOCKS])
    assert raw.started_at == START.replace(tzinfo=UTC)


REMARKS = ("note", "Remark", "Bemerkung", "Comment", "Kommentar zur Messung", "Recording note", "Remarque", "tamped on")


@pytest.mark.parametrize("name", REMARKS)
def test_the_date_of_a_remark_is_not_read_as_a_start(tmp_path, name):
    head = [f"{name};2026-05-12 09:00:00", "time;force [N];rail [m/s2]"]
    raw = record(tmp_path, head, [f"{k / RATE}" for k in range(N)])
    assert raw.started_at is None and not raw.unread_start
    rows = [f"{a};{b};2026-05-12 09:00:00" for a, b in NUMBERS]
    (tmp_path / "c.csv").write_text("\n".join([f"force [N];rail [m/s2];{name}", *rows]) + "\n", encoding="utf-8")
    (raw,) = next(part for part in read_unconverted("c.csv", tmp_path) if hasattr(part, "records")).records
    assert raw.started_at is None and not raw.unread_start


def test_a_time_stamp_is_not_read_as_a_remark(tmp_path):
    """The word "Timestamp" contains the letters of "tamp"."""
    head = ["Timestamp;2026-05-12 09:00:00", "time;force [N];rail [m/s2]"]
    assert record(tmp_path, head, [f"{k / RATE}" for k in range(N)]).started_at == datetime(2026, 5, 12, 9)
