"""A run needs no writable home folder, as a service often has none."""

import os

import pytest

from turnout.workflow.project import snakemake_environment


@pytest.mark.parametrize("home", ["/proc/none", "/dev/null"])
def test_the_cache_is_in_the_project_without_a_writable_home_folder(tmp_path, monkeypatch, home):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", home)
    assert snakemake_environment() == os.environ | {"XDG_CACHE_HOME": str(tmp_path / ".snakemake/cache")}


def test_the_cache_of_the_user_is_used_if_it_is_writable(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert snakemake_environment() == dict(os.environ) and os.listdir(tmp_path / "cache/snakemake") == []


def test_a_read_only_home_folder_is_not_used(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "home/.cache").mkdir(parents=True)
    (tmp_path / "home/.cache").chmod(0o500)
    if os.access(tmp_path / "home/.cache", os.W_OK):
        pytest.skip("root can write everywhere")
    assert snakemake_environment()["XDG_CACHE_HOME"] == str(tmp_path / ".snakemake/cache")
