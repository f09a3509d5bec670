"""Find the train of a passage in the timetable or train data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from turnout.config.events import parse_utc
from turnout.number_text import decimal_number

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
            trains.append(_listed_train(row))
        except ValueError as error:
            errors.append(f"row {k}: {error}")
    return tuple(sorted(trains, key=lambda t: (t.passed_at, t.train_type or ""))), tuple(errors)


def _listed_train(row: Mapping[str, str]) -> ListedTrain:
    text = row.get("passed_at_utc") or ""
    try:
        moment = parse_utc(text)
    except ValueError:
        raise ValueError(f"passed_at_utc {text!r} is not a time like 2024-05-13T10:00:00") from None
    if moment.tzinfo is not None:
        raise ValueError(f"passed_at_utc {text!r} has a time zone, write UTC without one")
    numbers = {}
    for column, name, low, high in (("speed_kmh", "speed", 1, 400), ("axle_load_t", "axle_load", 0.1, 60)):
        numbers[name] = _number(row.get(column), column, low, high)
    count = _number(row.get("n_axles"), "n_axles", 1, 2000)
    n_axles = None if count is None else int(count)
    track = row.get("track") or None
    if track not in (None, "main", "diverging"):
        raise ValueError(f"track {track!r} is neither main nor diverging")
    return ListedTrain(moment, row.get("train_type") or None, track=track, n_axles=n_axles, **numbers)


def _number(text: str | None, column: str, low: float, high: float) -> float | None:
    if not text:
        return None
    try:
        value = decimal_number(text)
    except ValueError:
        raise ValueError(f"{column} {text!r} is not a number") from None
    if not low <= value <= high:
        raise ValueError(f"{column} {text!r} is not between {low} and {high}")
    return value


def listed_for(moment: datetime, n_axles: int, trains: Sequence[ListedTrain], tolerance: float) -> ListedTrain | None:
    """The listed train nearest in time to ``moment``, within ``tolerance`` [s].

    None where it has another number of axles, or where a second one fits nearly as well.

    Parameters
    ----------
    moment : datetime
        Time of the passage, naive UTC.
    n_axles : int
        Axles of the passage.
    trains : sequence of ListedTrain
        Trains to choose from.
    tolerance : float
        Largest difference in time. [s]

    Returns
    -------
    ListedTrain or None
        The train, if it is certain.
    """
    return listed_at(moment, [t for t in trains if t.n_axles in (None, n_axles)], tolerance)


def is_of_one_passage(moments: Sequence[datetime], rows: Sequence[ListedTrain]) -> list[bool]:
    """Which passages keep the row of the train data that was found for them: a row describes one train.

    Where several passages have the same row, the nearest in time keeps it, unless a second is nearly as near.

    Parameters
    ----------
    moments : sequence of datetime
        Time of each passage, naive UTC.
    rows : sequence of ListedTrain
        Row of each passage.

    Returns
    -------
    list of bool
        One per passage.

    Examples
    --------
    >>> row = ListedTrain(datetime(2024, 5, 13, 10))
    >>> is_of_one_passage([datetime(2024, 5, 13, 10, 0, 2), datetime(2024, 5, 13, 10, 1)], [row, row])
    [True, False]
    """
    distances = [abs((row.passed_at - moment).total_seconds()) for moment, row in zip(moments, rows, strict=True)]
    return [
        all(
            distances[other] >= MIN_DISTANCE_RATIO * distance + MIN_TIME_APART
            for other, other_row in enumerate(rows)
            if other_row is row and other != k
        )
        for k, (distance, row) in enumerate(zip(distances, rows))
    ]


def listed_at(moment: datetime, trains: Sequence[ListedTrain], tolerance: float) -> ListedTrain | None:
    """The listed train nearest in time to ``moment``, within ``tolerance`` [s], whatever its number of axles.

    None where a second one fits nearly as well.

    Parameters
    ----------
    moment : datetime
        Time of the passage, naive UTC.
    trains : sequence of ListedTrain
        Trains to choose from.
    tolerance : float
        Largest difference in time. [s]

    Returns
    -------
    ListedTrain or None
        The train, if it is certain.
    """
    near = [(abs((t.passed_at - moment).total_seconds()), t) for t in trains]
    near = sorted((x for x in near if x[0] <= tolerance), key=lambda x: x[0])
    if not near or (len(near) > 1 and near[1][0] < MIN_DISTANCE_RATIO * near[0][0] + MIN_TIME_APART):
        return None
    return near[0][1]
