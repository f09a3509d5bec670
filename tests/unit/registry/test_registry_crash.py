"""A killed process, a full disk or a lock loses no row and leaves no partial state; a new run gives the same bytes."""

import errno
import os
import random
import shutil
import signal
import subprocess
import sys
import time

import pytest
from filelock import FileLock
from registry_rows import Bench, hammer_result

from turnout.errors import RegistryError
from turnout.registry import publication, registration
from turnout.registry.database import is_behind, rebuild_database
from turnout.registry.generation import load
from turnout.registry.integrity import check, vacuum
from turnout.registry.job import register
from turnout.workflow.batches import read_results

REGISTER = (
    "import sys; from turnout.registry.job import register; from turnout.workflow.batches import read_results;"
    "print('ready', flush=True); register(sys.argv[2:], sys.argv[1], read=read_results)"
)


@pytest.fixture(scope="module")
def undisturbed_run(tmp_path_factory):
    """Two batches, and the registry after the first and after both, without an interruption."""
    root = tmp_path_factory.mktemp("calm")
    (root / "work").mkdir()
    first, second = two_nights(Bench(root), hammer_result)
    register([first], root / "one", read=read_results)
    shutil.copytree(root / "one", root / "two")
    register([first, second], root / "two", read=read_results)
    return root, first, second


@pytest.fixture
def after_one(undisturbed_run, bench):
    """The registry after the first batch, for a test to interrupt."""
    shutil.copytree(undisturbed_run[0] / "one", bench.registry)
    rebuild_database(bench.registry)
    return bench


def two_nights(bench, hammer):
    first = [hammer(f"t{i}", f"A{j}", day) for i in range(4) for j in range(8) for day in ("2025-11-03", "2026-01-05")]
    second = [hammer(f"t{i}", f"A{j}", "2026-01-05", key="k2") for i in range(4) for j in range(8)]
    return bench.batch(*first), bench.batch(*second)


def start_register(registry, night):
    """Start a process that registers ``night``; return it when its imports are complete."""
    writer = subprocess.Popen([sys.executable, "-c", REGISTER, str(registry), *map(str, night)], stdout=subprocess.PIPE)
    writer.stdout.readline()
    return writer


def test_a_registration_that_is_killed_at_random_times_and_started_again_gives_the_same_bytes(
    bench, undisturbed_run, hashes
):
    undisturbed, first, second = undisturbed_run
    writer, began = start_register(bench.registry.with_name("timed"), [first]), time.monotonic()
    writer.communicate()
    lasts = time.monotonic() - began
    generator, killed = random.Random(3), 0
    for night in ([first], [first, second]):
        for _ in range(4):
            writer = start_register(bench.registry, night)
            time.sleep(generator.uniform(0.05, 0.8) * lasts)
            killed += writer.poll() is None
            writer.send_signal(signal.SIGKILL)
            writer.wait()
            writer.stdout.close()
        register(night, bench.registry, read=read_results)
    assert killed >= 3, "too few processes were killed before they ended"
    vacuum(bench.registry)
    assert hashes(bench.registry) == hashes(undisturbed / "two")
    assert check(bench.registry) == []


STEPS = ["write_sorted", "write_durably", "commit", "build_database", "delete_files"]


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("when", ["before", "after"])
def test_a_stop_at_any_step_leaves_the_old_or_the_new_state(
    after_one, undisturbed_run, hashes, monkeypatch, step, when
):
    bench, (undisturbed, first, second) = after_one, undisturbed_run
    module = registration if step == "write_sorted" else publication
    real, calls = getattr(module, step), []

    def stopped(*arguments):
        calls.append(arguments)
        if len(calls) == 3 or step != "write_sorted":
            if when == "after":
                real(*arguments)
            raise KeyboardInterrupt
        return real(*arguments)

    monkeypatch.setattr(module, step, stopped)
    with pytest.raises(KeyboardInterrupt):
        register([first, second], bench.registry, read=read_results)
    monkeypatch.undo()
    before, after = bench.ask("select count(*) from modes_current")[0][0], load(bench.registry).number
    assert (before, after) == (64, 2 if step in STEPS[3:] or (step, when) == ("commit", "after") else 1)
    register([first, second], bench.registry, read=read_results)
    assert bench.ask("select count(*), count(distinct model_id) from modes") == [(96, 96)]
    assert not is_behind(bench.registry, load(bench.registry))
    vacuum(bench.registry)
    assert hashes(bench.registry) == hashes(undisturbed / "two")


def test_a_full_disk_changes_nothing_and_its_error_states_the_remedy(after_one, undisturbed_run, hashes):
    bench, (_, first, second) = after_one, undisturbed_run
    before = hashes(bench.registry, without=())
    limited = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000)); {REGISTER}"
    arguments = [sys.executable, "-c", limited, str(bench.registry), str(first), str(second)]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("turnout.errors.RegistryError: cannot write ")
    assert last.endswith("Nothing was changed: free disk space or give write permission, then run again.")
    assert hashes(bench.registry, without=()) == before and not list(bench.registry.rglob("*.tmp"))
    register([first, second], bench.registry, read=read_results)
    assert bench.ask("select count(*) from modes") == [(96,)]


def test_a_locked_registry_is_an_error_and_is_not_changed(bench, hammer):
    bench.register(hammer())
    with (
        FileLock(bench.registry / ".lock"),
        pytest.raises(RegistryError, match=r"another run has locked the registry for more than 0.1 s"),
    ):
        bench.register(hammer(section="A2"), max_wait=0.1)
    assert bench.ask("select count(*) from modes") == [(1,)], "reading needs no lock"
    bench.register()
    assert bench.ask("select count(*) from modes") == [(2,)]


@pytest.mark.parametrize("code", [errno.EACCES, errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("part", ["generations", "_generation.json"])
def test_a_list_that_cannot_be_written_is_an_error_and_the_former_list_stays_valid(
    part, code, bench, hammer, monkeypatch
):
    bench.register(hammer())
    replace = os.replace

    def fails(source, target):
        if part in str(target):
            raise OSError(code, os.strerror(code), str(target))
        replace(source, target)

    monkeypatch.setattr(os, "replace", fails)
    with pytest.raises(RegistryError, match=f"cannot write _generation.json in .*{os.strerror(code)}"):
        bench.register(hammer(section="A2"))
    monkeypatch.undo()
    assert bench.ask("select count(*) from models") == [(1,)]
    bench.register(hammer(section="A2"))
    assert bench.ask("select count(*) from models") == [(2,)]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_registry_without_write_permission_is_an_error(bench, hammer):
    bench.register(hammer())
    bench.registry.chmod(0o500)
    try:
        with pytest.raises(RegistryError, match="cannot write"):
            bench.register(hammer(section="A2"))
    finally:
        bench.registry.chmod(0o700)
