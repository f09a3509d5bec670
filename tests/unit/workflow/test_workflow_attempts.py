"""A job that did not come to its end is another one for Snakemake, until it does."""

import pytest

from turnout.workflow.retries import attempt, attempts


def test_a_job_that_failed_is_asked_for_until_it_comes_to_its_end(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert attempts("register") == 0
    for again in (0, 0, 1):  # Snakemake tries twice with what it noted at the start of the run
        with pytest.raises(OSError), attempt("register", again):
            raise OSError
        assert attempts("register") == again + 1 and attempts("trend") == 0
    with attempt("register", 2):
        assert attempts("register") == 3  # as a kill would leave it
    assert attempts("register") == 2
