"""The day of a hammer test whose name states none is the local day in the time zone of the layout."""

import numpy as np
import pytest

from turnout.errors import ConfigError
from turnout.records import RawChannel, RawDescription
from turnout.stages.requested_files import _noted_day

CHANNELS = (RawChannel("force", "force", "force", "N"),)


def day_of(tmp_path, start, time_zone):
    path = tmp_path / "log.npz"
    np.savez(path, force=np.random.default_rng(1).normal(size=400), started_at=start)
    return _noted_day([path], RawDescription(CHANNELS, rate=20000.0, time_zone=time_zone))


@pytest.mark.parametrize(
    "start, time_zone, day",
    [
        ("2026-05-13T00:30:00", "Europe/Copenhagen", "2026-05-13"),
        ("2026-05-12T22:30:00Z", "Europe/Copenhagen", "2026-05-13"),
        ("2026-05-12T22:30:00Z", "UTC", "2026-05-12"),
        ("2026-05-13T20:00:00", "America/New_York", "2026-05-13"),
        ("2026-05-13T08:00:00", "Asia/Tokyo", "2026-05-13"),
    ],
)
def test_the_day_is_that_of_the_time_zone_of_the_layout(start, time_zone, day, tmp_path, monkeypatch):
    monkeypatch.setenv("TZ", "Pacific/Kiritimati")
    assert day_of(tmp_path, start, time_zone) == day


@pytest.mark.parametrize("start", ["05/06/2026 10:00", "2026-02-30 10:00:00", "13.05.26 10:00:00"])
def test_the_error_about_an_unknown_day_quotes_an_unreadable_start_time(start, tmp_path):
    with pytest.raises(ConfigError) as raised:
        day_of(tmp_path, start, "UTC")
    assert f"neither its name nor the file says on which day it was recorded (the start time {start!r}" in str(
        raised.value
    )
