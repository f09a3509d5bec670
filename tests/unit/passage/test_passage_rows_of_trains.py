"""A row of trains.csv belongs to one passage at most."""

from dataclasses import replace
from datetime import datetime, timedelta
from itertools import permutations

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, PATTERNS, rolling_noise

from turnout.config import load_configuration, with_raw
from turnout.passage.timetable import ListedTrain, OtherPassage, listed_for, listed_trains
from turnout.readers.writing import write
from turnout.records import Channel
from turnout.stages.mismatch_trains import train_notes
from turnout.stages.neighbouring_files import passages_beside
from turnout.stages.passage import PassageContext, passage_unit
from turnout.workflow.notes import notes_of
from turnout.workflow.scan import scan

NOON = datetime(2024, 5, 13, 12)
PLACES = {"OT": -12.0, "SP": 3.6, "CLP": 13.8, "A7": 24.6, "A8": 26.4, "A9": 28.2, "ASM": 36.0, "ASD": 36.0}


def at(seconds):
    return NOON + timedelta(seconds=seconds)


def assigned(passages, rows):
    """Index of the row of each passage, None without one; ``passages`` and ``rows`` are (seconds, axles)."""
    trains = [ListedTrain(at(s), train_type=str(k), n_axles=n) for k, (s, n) in enumerate(rows)]
    found = []
    for k, (seconds, n) in enumerate(passages):
        others = [OtherPassage(at(s), m) for i, (s, m) in enumerate(passages) if i != k]
        row = listed_for(at(seconds), n, trains, 90.0, others)
        found.append(None if row is None else trains.index(row))
    return found


@pytest.mark.parametrize(
    ("passages", "rows", "expected"),
    [
        ([(0, 8), (40, 8)], [(2, None)], [0, None]),
        ([(0, 8), (40, 8)], [(38, None)], [None, 0]),
        ([(0, 8), (40, 8)], [(20, None)], [None, None]),  # exactly between
        ([(0, 8), (40, 8)], [(16, None)], [None, None]),  # nearly as near to the other
        ([(0, 8), (40, 4)], [(20, 8)], [0, None]),  # the number of axles decides
        ([(0, 8), (40, 8)], [(1, None), (42, None)], [0, 1]),
        ([(0, 8), (40, 8)], [(42, None), (1, None)], [1, 0]),  # not in order
        ([(0, 8), (40, 8), (80, 8)], [(41, None)], [None, 0, None]),
        ([(0, 8), (40, 4)], [(20, None), (38, 4)], [0, 1]),
        ([(0, 8)], [(3, None), (3, None)], [None]),  # two rows of one time
        ([(0, 8)], [(3, 8), (3, 4)], [0]),
        ([(0, 8), (200, 8)], [(15, None), (215, None)], [0, 1]),  # all rows late by as much
        ([(0, 8), (200, 8)], [(60, None), (260, None)], [0, 1]),
        ([(0, 8), (40, 8)], [(15, None), (55, None)], [0, None]),  # as late, closer trains: no wrong row
    ],
)
def test_a_row_belongs_to_the_nearest_passage(passages, rows, expected):
    assert assigned(passages, rows) == expected


def test_no_row_is_given_twice_and_the_order_of_the_rows_is_of_no_consequence():
    """200 sets of passages and rows at random times, in any order of the rows."""
    rng = np.random.default_rng(3)
    for _ in range(200):
        passages = [(int(s), int(n)) for s, n in zip(rng.uniform(0, 200, 4), rng.choice([4, 8], 4))]
        rows = [(int(s), n) for s, n in zip(rng.uniform(0, 200, 3), rng.choice([4, 8, None], 3))]
        first = assigned(passages, rows)
        given = [row for row in first if row is not None]
        assert len(set(given)) == len(given)
        for order in permutations(range(3)):
            found = assigned(passages, [rows[i] for i in order])
            assert [None if k is None else order[k] for k in found] == first


def lay_out(raw, trains, *starts):
    """Files with an IC3 each at ``starts`` [s after noon], and trains.csv."""
    folder = raw / "tommerup_s1" / "passages"
    folder.mkdir(parents=True)
    for k, seconds in enumerate(starts):
        recording = rolling_noise(np.random.default_rng(k), IC3, 40.0, list(PLACES.values()), noise=0.02)
        channels = tuple(Channel(name, "acceleration", x) for name, x in PLACES.items())
        recording = replace(recording, channels=channels, started_at=at(seconds))
        write([recording], folder / f"{at(seconds):%Y%m%dT%H%M%SZ}.h5", "hdf5")
    (raw / "tommerup_s1" / "trains.csv").write_text("passed_at_utc,train_type,axle_load_t,n_axles\n" + trains)


def rows_of(raw, repository):
    turnout = with_raw(load_configuration(repository / "config").turnout("tommerup_s1"), raw)
    context = PassageContext(patterns=PATTERNS)
    units = scan(turnout, raw).units
    return turnout, units, [passage_unit(u, turnout, raw, context)["passages"][0] for u in units]


def test_of_two_files_the_nearer_one_has_the_row(tmp_path, repository):
    """40 s apart with one row. Formerly both passages had its type and load."""
    lay_out(tmp_path, "2024-05-13T12:00:42Z,IC3,12.5,\n", 0, 40)
    _, _, passages = rows_of(tmp_path, repository)
    assert [p.get("axle_load_listed_t") for p in passages] == [None, 12.5]


def test_two_loggers_of_one_train_both_have_its_row(tmp_path, repository):
    lay_out(tmp_path, "2024-05-13T12:00:02Z,IC3,12.5,\n", 0, 4)
    _, _, passages = rows_of(tmp_path, repository)
    assert [p.get("axle_load_listed_t") for p in passages] == [12.5, 12.5]


def test_of_two_trains_of_a_continuous_file_the_nearer_one_has_the_row(tmp_path, repository):
    lay_out(tmp_path, "2024-05-13T12:00:14Z,IC3,12.5,\n", 0)
    path = next((tmp_path / "tommerup_s1" / "passages").iterdir())
    turnout = with_raw(load_configuration(repository / "config").turnout("tommerup_s1"), tmp_path)
    one = rolling_noise(np.random.default_rng(1), IC3, 40.0, list(PLACES.values()), noise=0.02)
    gap = 0.02 * np.random.default_rng(2).standard_normal((len(PLACES), 10 * 20000))
    channels = tuple(Channel(name, "acceleration", x) for name, x in PLACES.items())
    samples = np.hstack([gap, one.samples, gap, one.samples, gap])
    write([replace(one, samples=samples, channels=channels, started_at=NOON)], path, "hdf5")
    own = replace(turnout.settings["passage"], longest=20.0)
    turnout = replace(turnout, settings={**turnout.settings, "passage": own})
    (unit,) = scan(turnout, tmp_path).units
    passages = passage_unit(unit, turnout, tmp_path, PassageContext(patterns=PATTERNS))["passages"]
    assert [p.get("axle_load_listed_t") for p in passages] == [12.5, None]


def test_the_diagnosis_takes_the_axles_of_a_row_for_one_train(tmp_path, repository):
    lay_out(tmp_path, "2024-05-13T12:00:42Z,IC3,12.5,16\n", 0, 40)
    turnout, units, passages = rows_of(tmp_path, repository)
    recording = rolling_noise(np.random.default_rng(1), IC3, 40.0, [0.0, 5.0])
    found = [train_notes(p, [], recording, turnout, u.files[0][0], tmp_path) for p, u in zip(passages, units)]
    assert [notes.get("n_axles") for notes in found] == [None, 16]


def test_a_new_file_beside_another_makes_its_result_outdated(tmp_path, repository):
    lay_out(tmp_path, "2024-05-13T12:00:42Z,IC3,12.5,\n", 0, 40, 900)
    turnout = with_raw(load_configuration(repository / "config").turnout("tommerup_s1"), tmp_path)
    units = scan(turnout, tmp_path).units
    both, alone = notes_of(turnout, units), notes_of(turnout, (units[0], units[2]))
    assert both[0] != alone[0] and both[2] == alone[1]
    path = units[0].files[0][0]
    assert [o.moment for o in passages_beside(path, tmp_path, at(1), 90.0)] == [at(41)]
    (tmp_path / path).with_name("20240513T120100Z.h5").write_bytes(b"")
    assert [o.moment for o in passages_beside(path, tmp_path, at(1), 90.0)] == [at(41), at(61)]


@pytest.mark.parametrize(
    ("name", "is_rival"),
    [
        ("20240513T120040Z.csv", True),
        ("lok_20240513T120040Z.h5", True),  # a layout may have names with a text before the time
        ("20240513T120040Z_2.h5", True),
        ("20240513T120040Z.h5.part", False),  # an upload, which may end without a file
        ("~$20240513T120040Z.csv", False),
    ],
)
def test_a_file_is_a_rival_if_it_makes_the_result_outdated(tmp_path, repository, name, is_rival):
    """The digest of a passage and its row of the train data rest on the same files."""
    path, turnout = "t/20240513T120000Z.h5", load_configuration(repository / "config").turnout("tommerup_s1")
    (tmp_path / "t").mkdir()
    turnout = replace(turnout, raw="t", trains=({"passed_at_utc": "2024-05-13T12:00:42Z"},))
    turnout = replace(turnout, hammer=None, passages=replace(turnout.passages, files="*{time}*"))
    (tmp_path / path).touch()
    (alone,) = notes_of(turnout, scan(turnout, tmp_path).units)
    (tmp_path / "t" / name).touch()
    units = scan(turnout, tmp_path).units
    notes = {unit.files[0][0]: note for unit, note in zip(units, notes_of(turnout, units))}
    assert (notes[path] != alone) == is_rival
    assert bool(passages_beside(path, tmp_path, at(1), 90.0)) == is_rival


def test_the_rows_of_a_turnout_are_read_once_for_all_of_its_files(monkeypatch):
    """Each file needs all rows. Formerly 20,000 rows took half as long as the analysis of the train."""
    rows = [{"passed_at_utc": f"2024-05-13T13:{k:02}:07Z", "n_axles": "8", "note": str(k)} for k in range(60)]
    first, times = listed_trains(rows), []
    monkeypatch.setattr("turnout.passage.timetable.parse_utc", times.append)
    assert listed_trains([dict(row) for row in rows]) == first and len(first[0]) == 60 and not times


def test_rows_are_read_in_order_of_time():
    rows = [{"passed_at_utc": f"2024-05-13T12:0{k}:00Z"} for k in (2, 0, 1)]
    assert [t.passed_at.minute for t in listed_trains(rows)[0]] == [0, 1, 2]
