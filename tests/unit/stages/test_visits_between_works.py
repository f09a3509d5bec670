"""Passages belong to a visit on their side of recorded work: before tamping or a renewal they show another track."""

import json
from datetime import UTC, date, datetime, timedelta

import pytest

from turnout.config import load_configuration
from turnout.config.events import Event
from turnout.records import Unit
from turnout.stages.mismatch_groups import every_visit, visits
from turnout.stages.work_days import days_of_work

LAYOUT = """\
sections: {A7: {panel: CP, track: main, position: 24.6}}
hammer: {files: "{campaign}/{section}_{test}.csv", channels: {f: {source: 0, quantity: force}, a: {source: 1, quantity: acceleration}}, force: f, response: a}
passages:
  files: "{time}.csv"
  channels: {a: {source: 0, quantity: acceleration, section: A7}}
"""  # noqa: E501


def hammer_test_of(day):
    return Unit("t1", "hammer", f"A7/{day}", (), "", "A7", day)


def train_of(day):
    return Unit("t1", "passage", f"{day.replace('-', '')}T101112Z.h5", (), "")


def by_visit(tests, trains, *work):
    """Days of the trains of each visit."""
    units = [*map(hammer_test_of, tests), *map(train_of, trains)]
    found = visits(units, [date.fromisoformat(day) for day in work])
    return {visit: [u.label[:8] for u in of if u.kind == "passage"] for visit, of in found.items()}


@pytest.mark.parametrize(
    ("tests", "trains", "work", "expected"),
    [
        # before the work, after it, and on its day, which lies after it
        (
            ["2026-05-01"],
            ["2026-04-10", "2026-04-20", "2026-04-25"],
            ["2026-04-20"],
            {"2026-04": ["20260410"], "2026-05-01": ["20260420", "20260425"]},
        ),
        # the campaign before the work is farther away, and on the same side
        (
            ["2026-03-20", "2026-04-12"],
            ["2026-04-09"],
            ["2026-04-11"],
            {"2026-03-20": ["20260409"], "2026-04-12": []},
        ),
        # the middle of the month lies on the other side: the next month, and the one before
        ([], ["2026-04-19", "2026-04-30"], ["2026-04-18"], {"2026-05": ["20260419", "20260430"]}),
        ([], ["2026-01-03"], ["2026-01-05"], {"2025-12": ["20260103"]}),
        # a month that lies after a campaign of its own
        (
            ["2026-06-01"],
            ["2026-07-14"],
            ["2026-07-15"],
            {"2026-06-01": [], "2026-06": ["20260714"]},
        ),
        # two works with no day of a visit in between
        (["2026-05-01"], ["2026-04-22"], ["2026-04-20", "2026-04-24"], {"2026-05-01": []}),
        (["2026-05-01"], ["2026-04-10"], [], {"2026-05-01": ["20260410"]}),
    ],
)
def test_no_work_lies_between_a_visit_and_its_passages(tests, trains, work, expected):
    found = by_visit(tests, trains, *work)
    assert found == expected and list(found) == list(expected)


@pytest.mark.parametrize(
    ("tests", "trains", "expected"),
    [
        # a campaign or a train with a wrong year is no visit, in whatever order
        ([-40, 200], [-41], {-40: [-41]}),
        ([200, -40], [250, -39], {-40: [-39]}),
        ([0], [1], {0: [1]}),  # another time zone
        ([200, 300], [201], {200: [201], 300: []}),  # all of them: the clock of this machine is late
    ],
)
def test_recordings_of_the_future_are_no_visit(tests, trains, expected):
    """One of them would be the newest visit until its day, and the nightly run would diagnose no other."""

    def day(n):
        return f"{datetime.now(UTC) + timedelta(days=n):%Y-%m-%d}"

    visits_found = by_visit([day(n) for n in tests], [day(n) for n in trains])
    assert visits_found == {day(n): [day(t).replace("-", "") for t in of] for n, of in expected.items()}
    assert list(visits_found)[-1] == day(max(expected))


def work_at(kind, *resets, hour=0):
    return Event("t1", None, datetime(2026, 4, 20, hour, tzinfo=UTC), kind, resets)


@pytest.mark.parametrize(
    ("event", "parts"),
    [
        (work_at("tamping", "ballast"), True),
        (work_at("renewal", "ballast", "railpad"), True),
        (work_at("grinding"), True),
        (work_at("sensor_change"), True),
        (work_at("other"), False),
        (work_at("other", "railpad"), True),
        (work_at("method_change", "ballast", "railpad"), False),
    ],
)
def test_work_that_changes_neither_track_nor_sensors_parts_no_visit(event, parts):
    assert days_of_work([event]) == [date(2026, 4, 20)] * parts


def test_work_in_the_afternoon_lies_after_the_passages_of_its_day():
    assert days_of_work([work_at("tamping", "ballast", hour=20)]) == [date(2026, 4, 21)]


def test_the_visit_of_the_nightly_run_has_no_passage_from_before_the_work(tmp_path):
    files = {"turnouts.tsv": "turnout\tlayout\nt1\tmain\n", "layouts/main.yaml": LAYOUT}
    files["events.csv"] = "turnout,section,date,kind\nt1,,2026-04-20,renewal\n"
    for name, text in files.items():
        (tmp_path / "config" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "config" / name).write_text(text)
    trains = [f"202604{day}T100000Z" for day in (10, 25)]
    units = [["passage", train, None, None, "", [[f"{train}.csv", 100, 1]]] for train in trains]
    units.append(["hammer", "A7/2026-05-01", "A7", "2026-05-01", "", [["2026-05-01/A7_1.csv", 100, 1]]])
    entries = [{"turnout": "t1", "raw": "t1", "units": units, "hashes": {"passage": "h", "hammer": "h"}}]
    (tmp_path / "plan.json").write_text(json.dumps({"turnouts": entries}))
    (planned,) = every_visit(tmp_path / "plan.json", load_configuration(tmp_path / "config", leave_out=True))
    assert [f[0] for f in planned.unit.files] == ["t1/2026-05-01/A7_1.csv", "t1/20260425T100000Z.csv"]
