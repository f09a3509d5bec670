"""Damaged files, a fault of the program, a missing disk: valid recordings are registered, the others are reported."""

import re
import shutil

import duckdb
import pytest
import toy_fleet as toy

pytestmark = pytest.mark.slow
QUARANTINE = "select path, reason_code from {} where reason_code <> 'nothing_found'"


# The tests of this file use one fleet in their order, as a worker runs all tests of a file.


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    return toy.make(tmp_path_factory.mktemp("damaged"), n_turnout=10, n_section=5, n_campaign=2)


def quarantine(folder, view="quarantine"):
    """{path: reasons} of the quarantine table."""
    found = {}
    with duckdb.connect(str(folder / "results/registry/registry.duckdb"), read_only=True) as con:
        for path, reason in con.sql(QUARANTINE.format(view)).fetchall():
            found.setdefault(path, set()).add(reason)
    return found


def open_quarantine(folder):
    superseded = "(select * from quarantine where quarantine_id not in (select old_id from supersedes)) q"
    return quarantine(folder, superseded)


def test_every_damaged_file_is_in_quarantine_with_its_reason_until_it_is_repaired(fleet):
    kinds = toy.damages(fleet)
    files = sorted((fleet / "raw").glob("*/hammer/*/*.npz"))
    broken = {f: kind for f, kind in zip(files[3::9], kinds)}
    whole = {f: f.read_bytes() for f in broken}
    for path, kind in broken.items():
        path.write_bytes(kinds[kind][0])
    (fleet / "raw/T00001/hammer/2024-01-01/A9_1.npz").write_bytes(b"")
    (fleet / "raw/T00002/hammer/2024-01-01/A1_1.npz.part").write_bytes(b"")
    shutil.move(files[0], fleet / "moved.npz")

    toy.run(fleet, shards=2)
    expected = {str(f.relative_to(fleet / "raw")): {kinds[kind][1]} for f, kind in broken.items()}
    expected["T00001/hammer/2024-01-01/A9_1.npz"] = {"name_unknown"}
    assert quarantine(fleet) == expected
    n_left = sum(kinds[kind][2] for kind in broken.values())
    assert len(toy.rows(fleet)["recordings"]) == 100 - 1 - len(broken) + n_left

    for path, content in whole.items():
        path.write_bytes(content)
    (fleet / "raw/T00001/hammer/2024-01-01/A9_1.npz").unlink()
    shutil.move(fleet / "moved.npz", files[0])
    toy.run(fleet, shards=2)
    assert open_quarantine(fleet) == {}
    recordings = {r for row in toy.rows(fleet)["recordings"] for r in row if str(r).endswith(".npz")}
    assert recordings == {str(f.relative_to(fleet / "raw")) for f in files}


def test_too_many_units_in_quarantine_fail_the_run_after_the_registry_is_published(fleet):
    toy.add_raw(fleet, "T00005", n_section=5, n_campaign=5, first=2)
    new = sorted((fleet / "raw/T00005/hammer").glob("2024-0[3-7]-01/*.npz"))
    assert len(new) == 25
    for path in new[:10]:
        path.write_bytes(b"")
    done = toy.run(fleet, shards=2, check=False)
    assert done.returncode != 0, done.stdout
    # with the 11 units of the run before, which were too few for a verdict
    assert "10 of 36 new units of the fleet have rows in quarantine, 28 %, above the limit of 20 %" in done.stdout
    assert len([p for p in open_quarantine(fleet) if p.startswith("T00005")]) == 10
    for seed, path in enumerate(new[:10], 9000):
        path.write_bytes(toy.raw_bytes(seed, fleet))
    toy.run(fleet, shards=2)


def test_a_fault_of_the_program_affects_only_its_unit_is_reported_and_fails_the_run(fleet):
    bug = fleet / "raw/T00006/hammer/2024-01-01/A1_bug.npz"
    bug.write_bytes(toy.raw_bytes(1, fleet))
    done = toy.run(fleet, shards=2, check=False)
    assert done.returncode != 0
    assert "1 internal errors, first in T00006/hammer/A1/2024-01-01" in done.stdout
    path = "T00006/hammer/2024-01-01/A1_1.npz"
    assert open_quarantine(fleet) == {path: {"internal_error"}}
    strict = toy.run(fleet, "strict=true", "--forcerun", "hammer", shards=1, check=False)
    assert strict.returncode != 0 and "ZeroDivisionError: toy bug" in strict.stdout
    bug.unlink()
    toy.run(fleet, shards=2)
    assert open_quarantine(fleet) == {}


def test_a_missing_disk_stops_the_run_before_any_change(fleet):
    before = toy.data_files(fleet)
    (fleet / "raw").rename(fleet / "away")
    (fleet / "raw").mkdir()
    done = toy.run(fleet, shards=2, check=False)
    assert done.returncode != 0
    assert re.search(r"\d+ known files are gone, first T00000/hammer", done.stdout)
    assert "accept_vanished=true" in done.stdout
    (fleet / "raw").rmdir()
    (fleet / "away").rename(fleet / "raw")
    assert toy.data_files(fleet) == before
    assert "Nothing to be done" in toy.run(fleet, shards=2).stdout


def test_the_rows_of_files_that_were_removed_on_purpose_are_kept(fleet):
    before = toy.rows(fleet)["recordings"]
    shutil.rmtree(fleet / "raw/T00009/hammer/2024-01-01")
    done = toy.run(fleet, shards=2)
    assert re.search(r"0 processed, 0 quarantined, 5 vanished", done.stdout)
    assert toy.rows(fleet)["recordings"] == before
