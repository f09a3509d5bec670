"""Time axes that count from a known origin give start and rate by the same count."""

from datetime import UTC, datetime

import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

N_SAMPLE, RATE = 1000, 2000.0
START = datetime(2026, 5, 13, 10, tzinfo=UTC)
FORCE = np.round(np.random.default_rng(3).normal(scale=100.0, size=N_SAMPLE), 3)
PER_SECOND = {"ms": 10**3, "us": 10**6, "ns": 10**9}
DESCRIPTION = RawDescription(channels=(RawChannel("force", "force", "force", unit="N"),))


def stamps_of(unit):
    """Whole numbers, except for ms, whose half steps need a decimal."""
    steps = np.arange(N_SAMPLE) * PER_SECOND[unit] / RATE
    stamps = steps if unit == "ms" else steps.astype(np.int64)
    return int(START.timestamp()) * PER_SECOND[unit] + stamps


def write_table(path, name, stamps):
    if path.suffix == ".csv":
        rows = [f"{stamp},{force}" for stamp, force in zip(stamps.tolist(), FORCE.tolist())]
        path.write_text("\n".join([f"{name},force", *rows]) + "\n")
    else:
        pd = pytest.importorskip("pandas")
        pd.DataFrame({name: stamps, "force": FORCE}).to_parquet(path, index=False)
    return path


@pytest.mark.parametrize("form", ["csv", "parquet"])
@pytest.mark.parametrize("unit", PER_SECOND)
@pytest.mark.parametrize("name", ["time", "t", "timestamp", "Zeit", "time [{}]", "time_{}"])
def test_a_count_since_1970_gives_start_and_rate(name, unit, form, tmp_path):
    path = write_table(tmp_path / f"a.{form}", name.format(unit), stamps_of(unit))
    (recording,) = read(path.name, tmp_path, DESCRIPTION).recordings
    assert recording.rate == pytest.approx(RATE, rel=1e-6)
    assert recording.started_at == START.replace(tzinfo=None)
    np.testing.assert_allclose(recording.signal("force"), FORCE)


@pytest.mark.parametrize("form", ["csv", "parquet"])
@pytest.mark.parametrize("unit", PER_SECOND)
def test_a_counting_axis_is_checked_like_any_other(unit, form, tmp_path):
    gap, backwards, uneven = (stamps_of(unit) for _ in range(3))
    gap[500:] += PER_SECOND[unit] // 10
    backwards[500:] -= PER_SECOND[unit] // 10
    uneven = uneven[0] + ((uneven - uneven[0]) * np.linspace(1.0, 1.1, N_SAMPLE)).astype(uneven.dtype)
    for stamps, reason in ((gap, "truncated"), (backwards, "clock_backwards"), (uneven, "wrong_rate")):
        path = write_table(tmp_path / f"a.{form}", "timestamp", stamps)
        result = read(path.name, tmp_path, DESCRIPTION)
        assert not result.recordings and [e.reason for e in result.errors] == [reason]
        if reason == "truncated":
            assert "from 1778666400.2495 s to 1778666400.35 s at 2000" in str(result.errors[0])


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_another_rate_in_the_layout_is_reported(form, tmp_path):
    path = write_table(tmp_path / f"a.{form}", "timestamp", stamps_of("us"))
    description = RawDescription(channels=DESCRIPTION.channels, rate=2048.0)
    result = read(path.name, tmp_path, description)
    assert not result.recordings and [e.reason for e in result.errors] == ["wrong_rate"]


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_a_count_without_a_known_origin_has_no_unit(form, tmp_path):
    path = write_table(tmp_path / f"a.{form}", "timestamp", 5_000_000 + np.arange(N_SAMPLE) * 500)
    result = read(path.name, tmp_path, DESCRIPTION)
    assert not result.recordings and [e.reason for e in result.errors] == ["wrong_rate"]
