"""A job that did not finish is a new job for Snakemake until it finishes."""

import pytest

from turnout.workflow.retries import attempt, attempts


def test_a_failed_job_is_requested_until_it_finishes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert attempts("register") == 0
    for again in (0, 0, 1):  # Snakemake tries twice with the number from the start of the run
        with pytest.raises(OSError), attempt("register", again):
            raise OSError
        assert attempts("register") == again + 1 and attempts("trend") == 0
    with attempt("register", 2):
        assert attempts("register") == 3  # as after a kill
    assert attempts("register") == 2
