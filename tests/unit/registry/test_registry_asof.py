"""A day asked about is one in UTC: another zone is rejected, not taken for UTC."""

import pytest

from turnout.cli.main import main
from turnout.registry.job import register


@pytest.mark.parametrize("asof", ["2026-03-01T09:00+02:00", "2026-03-01T09:00+00:00"])
def test_a_worklist_of_a_day_in_another_zone_is_rejected(tmp_path, capsys, asof):
    register([], tmp_path / "registry", read=iter)
    assert main(["worklist", "--registry", str(tmp_path / "registry"), "--asof", asof]) == 2
    assert f"--asof, date: {asof!r}, with a time zone. Write the time in UTC" in capsys.readouterr().err
