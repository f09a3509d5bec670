"""Positions of turnouts in turnouts.tsv that others contradict: swapped coordinates, kilometres in metres."""

from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from statistics import median
from zoneinfo import ZoneInfo

from turnout.config.turnouts_table import Row

MAX_SPREAD = 10.0  # degrees between turnouts of one network
MAX_ZONE_DISTANCE = 30.0  # degrees of longitude between a place and the middle of its time zone
DEGREES_PER_HOUR = 15.0
METRES = 1000.0
# A kilometre that is larger, and larger than that of the middle of its line by this ratio, may be in metres.
MIN_METRES, MIN_KM_RATIO = 500.0, 100.0


def position_remarks(rows: Mapping[str, Row], zone_of: Callable[[str], str]) -> Iterator[str]:
    """Remarks on coordinates that fit the others or the time zone only if they are swapped, and on kilometres.

    Parameters
    ----------
    rows : mapping of str to Row
        Rows of turnouts.tsv by id.
    zone_of : callable
        Time zone of the recordings of a turnout, an IANA name; "" if it is not known. UTC says nothing of the place.

    Yields
    ------
    str
        One sentence with what to do.
    """
    for row in rows.values():
        neighbours = [neighbour for neighbour in rows.values() if neighbour is not row]
        if _is_swapped(row, neighbours, zone_of(row.id)):
            latitude, longitude = row.values["lat_deg"], row.values["lon_deg"]
            yield (
                f"{row.path}, {row.place('lat_deg')}: lat_deg {latitude:g} and lon_deg {longitude:g} of {row.id} "
                "seem to be swapped. Compare them with a map"
            )
        line = row.values.get("line")
        of_line = [n.values["km"] for n in neighbours if n.values.get("line") == line and "km" in n.values]
        if of_line and row.values.get("km", 0.0) > max(MIN_KM_RATIO * median(of_line), MIN_METRES):
            yield (
                f"{row.path}, {row.place('km')}: km {row.values['km']:g} of {row.id} seems to be in metres, "
                f"others of its line are near km {median(of_line):g}. Write km, such as {row.values['km'] / METRES:g}"
            )


def _is_swapped(row: Row, neighbours: list[Row], time_zone: str) -> bool:
    """Whether the coordinates fit the other turnouts, or without any the time zone, only if they are swapped."""
    if not {"lat_deg", "lon_deg"} <= set(row.values):
        return False
    written = row.values["lat_deg"], row.values["lon_deg"]
    located = [n.values for n in neighbours if {"lat_deg", "lon_deg"} <= set(n.values)]
    if located:
        centre = tuple(median(values[column] for values in located) for column in ("lat_deg", "lon_deg"))
        distances = [max(abs(a - b) for a, b in zip(pair, centre)) for pair in (written, written[::-1])]
        if distances[0] > MAX_SPREAD >= distances[1]:
            return True
    if not time_zone or "/" not in time_zone or time_zone.startswith("Etc/"):
        return False
    offset = datetime(2026, 1, 1, tzinfo=ZoneInfo(time_zone)).utcoffset()
    middle = DEGREES_PER_HOUR * offset.total_seconds() / 3600.0 if offset else 0.0
    return abs(written[1] - middle) > MAX_ZONE_DISTANCE >= abs(written[0] - middle)
