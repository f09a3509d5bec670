"""Two runs in one folder: the second run ends before it changes anything that the first run needs."""

import pytest
from filelock import FileLock

from turnout.errors import TurnoutError
from turnout.workflow.launch import RUN_LOCK, launch


def test_a_second_run_changes_no_plan_of_the_first(fleet, monkeypatch):
    fleet.run()
    monkeypatch.chdir(fleet.folder)
    before = {path: path.read_bytes() for path in fleet.plan.parent.iterdir()}
    fleet.put("t1/2024-07-13/A_1.txt", "new")
    with FileLock(RUN_LOCK):
        for options in ({"shards": 3}, {"turnouts": "t1"}, {}):
            with pytest.raises(TurnoutError, match=r"another run works in this folder. Wait for it, or end it\."):
                launch(options, scan=True)
        launch({}, scan=False)  # a job of the first run
    assert {path: path.read_bytes() for path in fleet.plan.parent.iterdir()} == before
    launch({"shards": 3}, scan=True)
    assert {path: path.read_bytes() for path in fleet.plan.parent.iterdir()} != before


def test_a_run_holds_its_lock_until_its_process_ends(fleet, monkeypatch):
    fleet.run()
    monkeypatch.chdir(fleet.folder)
    launch({}, scan=True)
    with pytest.raises(TimeoutError):
        FileLock(RUN_LOCK, timeout=0).acquire()
    launch({}, scan=True)  # the same process
