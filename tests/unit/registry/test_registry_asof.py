"""The date of a worklist is in UTC: a date with another time zone is rejected, not interpreted as UTC."""

import pytest

from turnout.cli.main import main
from turnout.registry.job import register


@pytest.mark.parametrize("asof", ["2026-03-01T09:00+02:00", "2026-03-01T09:00-00:30"])
def test_the_worklist_rejects_a_date_with_another_time_zone(tmp_path, capsys, asof):
    register([], tmp_path / "registry", read=iter)
    assert main(["worklist", "--registry", str(tmp_path / "registry"), "--as-of", asof]) == 2
    assert f"--as-of, date: {asof!r}, with a time zone. Write the time in UTC" in capsys.readouterr().err


def test_the_time_zone_of_utc_is_no_other_time_zone(tmp_path, capsys):
    register([], tmp_path / "registry", read=iter)
    printed = set()
    for asof in ("2026-03-01T09:00", "2026-03-01T09:00Z", "2026-03-01T09:00+00:00"):
        assert main(["worklist", "--registry", str(tmp_path / "registry"), "--as-of", asof]) == 0
        printed.add(capsys.readouterr().out)
    assert len(printed) == 1
