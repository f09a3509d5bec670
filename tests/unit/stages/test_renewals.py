"""Renewals of a turnout: the visits that remain, and how often the file of events is read."""

from types import SimpleNamespace

import pytest

from turnout.stages import work_days
from turnout.stages.renewals import renewal_note, renewal_of, since_renewal

HEAD = "turnout,section,date,kind,resets,note\n"
VISITS = {"2024-01-10": 1, "2025-06-01": 2, "2025-07": 3, "2026-01-01": 4}


@pytest.fixture
def turnout(tmp_path):
    """Function: rows of events.csv -> a turnout with this file."""

    def make(*rows):
        (tmp_path / "events.csv").write_text(HEAD + "".join(row + "\n" for row in rows))
        return SimpleNamespace(folder=str(tmp_path), id="t1")

    return make


@pytest.mark.parametrize(
    ("rows", "kept"),
    [
        ((), [1, 2, 3, 4]),
        (("t1,,2025-06-01,renewal,,",), [2, 3, 4]),
        (
            ("t1,,2025-06-01,renewal,,", "t1,,2025-07-20,renewal,,"),
            [4],
        ),  # the newest renewal counts; the day of a visit of a month is its middle
        (("t1,,2025-06-01,tamping,,",), [1, 2, 3, 4]),
        (("t2,,2025-06-01,renewal,,",), [1, 2, 3, 4]),
        (("t1,A7,2025-06-01,renewal,,",), [1, 2, 3, 4]),  # of one section
        (("t1,,2099-06-01,renewal,,",), [1, 2, 3, 4]),  # planned
    ],
)
def test_only_visits_since_the_newest_renewal_of_the_whole_turnout_remain(turnout, rows, kept):
    assert list(since_renewal(turnout(*rows), VISITS).values()) == kept


def test_without_a_file_there_is_no_renewal(tmp_path):
    assert renewal_of(SimpleNamespace(folder=str(tmp_path), id="t1")) is None


def test_the_note_states_the_day_of_the_renewal(turnout):
    assert renewal_note(turnout("t1,,2025-06-01,renewal,,")) == " since its renewal on 2025-06-01"
    assert renewal_note(turnout("t1,,2025-06-01,tamping,,,")) == ""


def test_the_file_is_read_again_only_when_it_has_changed(turnout, monkeypatch):
    n_read = 0

    def counting(*arguments):
        nonlocal n_read
        n_read += 1
        return original(*arguments)

    original = work_days.read_events
    monkeypatch.setattr(work_days, "read_events", counting)
    first = turnout("t1,,2025-06-01,renewal,,")
    assert [len(since_renewal(first, VISITS)) for _ in range(5)] == [3] * 5
    assert n_read == 1
    assert len(since_renewal(turnout("t1,,2025-06-01,renewal,,", "t1,,2025-12-01,renewal,,"), VISITS)) == 1
    assert n_read == 2
