"""Check campaigns.csv and trains.csv against the raw files, and the dates of both."""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import date, datetime, timedelta
from pathlib import Path
from statistics import median

from turnout.config import TurnoutConfig
from turnout.config.campaign_notes import COLUMNS
from turnout.config.csv_table import TableError, read_csv
from turnout.config.events import day_problem, parse_utc
from turnout.errors import ReadError
from turnout.records import Unit
from turnout.workflow.future_dates import REMEDY, future_files, is_future
from turnout.workflow.notes import start_of

CLOCK_SHIFTS = sorted((h for h in range(-14, 15) if h), key=abs)  # h, offsets of local times from UTC
MIN_SEASON = 3  # campaigns of the same and the neighbouring months
MAX_DIFFERENCE_TO_SEASON = 25.0  # °C, of a rail from the median of its season
MIN_SHIFTED_PASSAGES = 3  # passages that a shift must match to trains: fewer may match by chance


def note_contradictions(turnout: TurnoutConfig, raw_root: Path, units: Iterable[Unit]) -> Iterator[ReadError]:
    """Compare the notes of a turnout with its files.

    Without campaigns.csv no row is required. Invalid rows are reported by ``read_notes``.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout with its notes.
    raw_root : Path
        The raw root.
    units : iterable of Unit
        Its units.

    Yields
    ------
    ReadError
        An error for each row without files, for files without a row, and for each day in the future.
    """
    units = list(units)
    yield from future_files(units)
    yield from _campaigns(Path(raw_root) / turnout.raw / "campaigns.csv", f"{turnout.raw}/campaigns.csv", units)
    if turnout.passages:
        tolerance = turnout.settings["passage"].train_data_tolerance
        yield from _trains(turnout.trains, f"{turnout.raw}/trains.csv", units, timedelta(seconds=tolerance))


def _campaigns(path: Path, name: str, units: Sequence[Unit]) -> Iterator[ReadError]:
    try:
        table = read_csv(path, name, COLUMNS, 2)
    except (OSError, TableError):
        return
    n_files = Counter(unit.campaign or "" for unit in units if unit.kind == "hammer" for _ in unit.files)
    days_in_notes = set()
    for line, cells in table.rows:
        day = _day(cells["campaign"])
        if day is not None and is_future(datetime.fromisoformat(day)):
            where = str(cells.place(name, line, "campaign"))
            yield ReadError(name, where, f"the campaign {day} is in the future", REMEDY)
        days_in_notes.add(day)
        if day is not None and day not in n_files:
            remedy = "Correct its day, put its files there, or remove the row"
            where = str(cells.place(name, line, "campaign"))
            yield ReadError(name, where, f"no hammer file is of campaign {day}", remedy)
    for day in sorted(n_files.keys() - days_in_notes):
        files = f"{n_files[day]} file{'s' * (n_files[day] > 1)}"
        finding = (
            f"no row for campaign {day}, of which there {'is' if n_files[day] == 1 else 'are'} {files}: "
            "it counts as measured at noon, without a rail temperature"
        )
        remedy = f"Add a line '{table.separator.join((day, '<start in UTC>', '<rail temperature in °C>'))}'"
        yield ReadError(name, "line 1", finding, remedy)


def improbable_temperatures(turnout: TurnoutConfig) -> Iterator[str]:
    """A remark on each noted rail temperature that is far from those of its season in the other campaigns.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout with its notes.

    Yields
    ------
    str
        A sentence that names the day, both temperatures and what to do.
    """
    campaigns = [(date.fromisoformat(day), c.rail_temperature) for day, c in turnout.campaigns.items()]
    temperatures = {day: value for day, value in campaigns if value is not None}
    for day, value in temperatures.items():
        season = [t for d, t in temperatures.items() if d != day and (d.month - day.month) % 12 in (0, 1, 11)]
        if len(season) < MIN_SEASON or abs(value - (usual := median(season))) <= MAX_DIFFERENCE_TO_SEASON:
            continue
        celsius = (value - 32.0) / 1.8
        unit = f": in °F it would be {celsius:.0f} °C" if abs(celsius - usual) < abs(value - usual) / 2 else ""
        yield (
            f"{turnout.raw}/campaigns.csv: campaign {day} has a rail temperature of {value:g} °C, and the median of "
            f"the other campaigns of its season is {usual:g} °C{unit}. Correct it if it is wrong"
        )


def _day(text: str) -> str | None:
    return None if day_problem(text) else date.fromisoformat(text).isoformat()


def _trains(
    rows: Sequence[Mapping[str, str]], name: str, units: Sequence[Unit], tolerance: timedelta
) -> Iterator[ReadError]:
    """An error if no train matches a passage, but many match after a shift by whole hours."""
    for row in rows:
        if is_future(parse_utc(row["passed_at_utc"])):
            problem = f"a train at {row['passed_at_utc']}, in the future"
            yield ReadError(name, "column passed_at_utc", problem, REMEDY)
    passages = [start for unit in units if unit.kind == "passage" and (start := start_of(unit.label))]
    trains = sorted(parse_utc(row["passed_at_utc"]) for row in rows)

    def count_fitting(hours: int) -> int:
        return sum(_has_train_near(p + timedelta(hours=hours), trains, tolerance) for p in passages)

    if not passages or not trains or count_fitting(0):
        return
    count, hours = max(((count_fitting(h), h) for h in CLOCK_SHIFTS), key=lambda finding: finding[0])
    if count < max(MIN_SHIFTED_PASSAGES, min(len(passages), len(trains)) / 2):
        return
    shift = f"{abs(hours)} h {'after' if hours > 0 else 'before'}"
    seconds = f"{tolerance.total_seconds():.0f} s"
    finding = f"of {len(passages)} passages none has a train within {seconds}, and {count} have one {shift}"
    remedy = "Write passed_at_utc in UTC, not in local time"
    yield ReadError(name, "column passed_at_utc", finding, remedy)


def _has_train_near(moment: datetime, trains: list[datetime], tolerance: timedelta) -> bool:
    at = bisect_left(trains, moment - tolerance)
    return at < len(trains) and trains[at] <= moment + tolerance
