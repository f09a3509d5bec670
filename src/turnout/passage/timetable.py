"""Find the train of a passage in the timetable or train data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache

from turnout.config.events import parse_utc
from turnout.number_text import decimal_number

COLUMNS = ("passed_at_utc", "train_type", "speed_kmh", "axle_load_t", "track", "n_axles")
MIN_DISTANCE_RATIO, MIN_TIME_APART = 2.0, 5.0  # -, s: a second train or passage in time is farther by as much


@dataclass(frozen=True)
class ListedTrain:
    """One row of trains.csv; None for an empty field. ``speed`` [km/h], ``axle_load`` [t]."""

    passed_at: datetime
    train_type: str | None = None
    speed: float | None = None
    axle_load: float | None = None
    track: str | None = None
    n_axles: int | None = None


def listed_trains(rows: Sequence[Mapping[str, str]]) -> tuple[tuple[ListedTrain, ...], tuple[str, ...]]:
    """Valid rows in order of time, and a sentence for each row that cannot be used.

    Columns: passed_at_utc (needed), train_type, speed_kmh, axle_load_t, track, n_axles.

    Parameters
    ----------
    rows : sequence of mappings
        Rows of trains.csv as text.

    Returns
    -------
    trains : tuple of ListedTrain
        In order of time.
    errors : tuple of str
        One sentence per unusable row.

    Examples
    --------
    >>> rows = [{"passed_at_utc": "2024-05-13T10:00:00Z", "speed_kmh": "160"}, {"passed_at_utc": "noon"}]
    >>> found, wrong = listed_trains(rows)
    >>> found[0].speed, wrong
    (160.0, ("row 2: passed_at_utc 'noon' is not a time like 2024-05-13T10:00:00",))
    """
    trains, errors = [], []
    for k, row in enumerate(rows, 1):
        try:
            trains.append(_listed_train(*(row.get(column) or "" for column in COLUMNS)))
        except ValueError as error:
            errors.append(f"row {k}: {error}")
    return tuple(sorted(trains, key=lambda t: (t.passed_at, t.train_type or ""))), tuple(errors)


@lru_cache(maxsize=50_000)  # every file of a turnout needs all of its rows
def _listed_train(passed_at: str, train_type: str, speed: str, axle_load: str, track: str, n_axles: str) -> ListedTrain:
    try:
        moment = parse_utc(passed_at)
    except ValueError:
        raise ValueError(f"passed_at_utc {passed_at!r} is not a time like 2024-05-13T10:00:00") from None
    if moment.tzinfo is not None:
        raise ValueError(f"passed_at_utc {passed_at!r} has a time zone, write UTC without one")
    speed_kmh, load = _number(speed, "speed_kmh", 1, 400), _number(axle_load, "axle_load_t", 0.1, 60)
    count = _number(n_axles, "n_axles", 1, 2000)
    if track not in ("", "main", "diverging"):
        raise ValueError(f"track {track!r} is neither main nor diverging")
    return ListedTrain(
        moment, train_type or None, speed_kmh, load, track or None, None if count is None else int(count)
    )


def _number(text: str, column: str, low: float, high: float) -> float | None:
    if not text:
        return None
    try:
        value = decimal_number(text)
    except ValueError:
        raise ValueError(f"{column} {text!r} is not a number") from None
    if not low <= value <= high:
        raise ValueError(f"{column} {text!r} is not between {low} and {high}")
    return value


@dataclass(frozen=True)
class OtherPassage:
    """Another train that passed near in time: ``moment`` in naive UTC, ``n_axles`` None where they are not known."""

    moment: datetime
    n_axles: int | None = None


def listed_for(
    moment: datetime,
    n_axles: int | None,
    trains: Sequence[ListedTrain],
    tolerance: float,
    rivals: Sequence[OtherPassage] = (),
) -> ListedTrain | None:
    """The listed train nearest in time to ``moment``, within ``tolerance`` [s].

    None where a second one fits nearly as well, or where it is nearer to another train, or nearly as near.

    Parameters
    ----------
    moment : datetime
        Time of the passage, naive UTC.
    n_axles : int or None
        Axles of the passage, which those of the row must equal; None: whatever their number.
    trains : sequence of ListedTrain
        Trains to choose from.
    tolerance : float
        Largest difference in time. [s]
    rivals : sequence of OtherPassage
        Other trains. One with a row of its own nearer to it does not compete for this one.

    Returns
    -------
    ListedTrain or None
        The train, if it is certain.

    Examples
    --------
    >>> row = ListedTrain(datetime(2024, 5, 13, 10))
    >>> first, second = (datetime(2024, 5, 13, 10, 0, second) for second in (2, 42))
    >>> listed_for(first, 8, [row], 90.0, [OtherPassage(second)]) is row
    True
    >>> listed_for(second, 8, [row], 90.0, [OtherPassage(first)])
    """
    near = sorted(((_distance(t, moment), t) for t in _fitting(trains, n_axles)), key=lambda x: x[0])
    near = [x for x in near if x[0] <= tolerance]
    if not near:
        return None
    distance, row = near[0]
    limit = MIN_DISTANCE_RATIO * distance + MIN_TIME_APART
    if len(near) > 1 and near[1][0] < limit:
        return None
    as_near = (rival for rival in rivals if _distance(row, rival.moment) < limit)
    return None if any(_is_nearest(row, rival, trains) for rival in as_near) else row


def _fitting(trains: Sequence[ListedTrain], n_axles: int | None) -> list[ListedTrain]:
    """Rows that a train with this number of axles may have."""
    return [t for t in trains if n_axles is None or t.n_axles in (None, n_axles)]


def _distance(train: ListedTrain, moment: datetime) -> float:
    return abs((train.passed_at - moment).total_seconds())


def _is_nearest(row: ListedTrain, rival: OtherPassage, trains: Sequence[ListedTrain]) -> bool:
    """Whether ``row`` fits ``rival``, and no other one that does is nearer to it."""
    fitting = _fitting(trains, rival.n_axles)
    return row in fitting and _distance(row, rival.moment) <= min(_distance(t, rival.moment) for t in fitting)
