"""Positions of turnouts in turnouts.tsv that others contradict: swapped coordinates, kilometres in metres."""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from zoneinfo import ZoneInfo

from turnout.config.turnouts_table import Row

MAX_SPREAD = 10.0  # degrees between turnouts of one network
MIN_DISTANCE_RATIO = 2.0  # of coordinates as written to swapped ones, where both are near, as in Turkey
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
    located = [row for row in rows.values() if {"lat_deg", "lon_deg"} <= set(row.values)]
    columns = [sorted(row.values[column] for row in located) for column in ("lat_deg", "lon_deg")]
    for row in located:
        latitude, longitude = row.values["lat_deg"], row.values["lon_deg"]
        centre = _median_of_others(columns[0], latitude), _median_of_others(columns[1], longitude)
        if _is_swapped((latitude, longitude), centre, _middle_of_zone(zone_of(row.id))):
            yield (
                f"{row.path}, {row.place('lat_deg')}: lat_deg {latitude:g} and lon_deg {longitude:g} of {row.id} "
                "seem to be swapped. Compare them with a map"
            )
    lines: dict[str, list[Row]] = {}
    for row in rows.values():
        if "line" in row.values and "km" in row.values:
            lines.setdefault(row.values["line"], []).append(row)
    for of_line in lines.values():
        kilometres = sorted(row.values["km"] for row in of_line)
        for row in of_line:
            km, middle = row.values["km"], _median_of_others(kilometres, row.values["km"])
            if middle is not None and km > max(MIN_KM_RATIO * middle, MIN_METRES):
                yield (
                    f"{row.path}, {row.place('km')}: km {km:g} of {row.id} seems to be in metres, "
                    f"others of its line are near km {middle:g}. Write km, such as {km / METRES:g}"
                )


def _median_of_others(ordered: Sequence[float], value: float) -> float | None:
    """Median of numbers in rising order without one of them; None if it is the only one."""
    k, n = bisect_left(ordered, value), len(ordered) - 1
    middle = [ordered[j + (j >= k)] for j in ((n - 1) // 2, n // 2)] if n else []
    return sum(middle) / 2.0 if middle else None


def _is_swapped(
    written: tuple[float, float], centre: tuple[float | None, float | None], middle_of_zone: float | None
) -> bool:
    """Whether coordinates fit the time zone, or where it tells nothing the other turnouts, only if they are swapped."""
    if middle_of_zone is not None:
        is_outside, is_outside_swapped = (
            abs(degrees - middle_of_zone) > MAX_ZONE_DISTANCE for degrees in written[::-1]
        )
        if is_outside != is_outside_swapped:
            return is_outside
    if centre[0] is None or centre[1] is None:
        return False
    distance = max(abs(written[0] - centre[0]), abs(written[1] - centre[1]))
    swapped = max(abs(written[1] - centre[0]), abs(written[0] - centre[1]))
    return distance > MAX_SPREAD >= swapped and distance > MIN_DISTANCE_RATIO * swapped


def _middle_of_zone(time_zone: str) -> float | None:
    """Longitude of the middle of a time zone; None for one without a place, such as UTC. [°]"""
    if "/" not in time_zone or time_zone.startswith("Etc/"):
        return None
    offset = datetime(2026, 1, 1, tzinfo=ZoneInfo(time_zone)).utcoffset()
    return DEGREES_PER_HOUR * offset.total_seconds() / 3600.0 if offset is not None else None
