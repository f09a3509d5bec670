"""Places of a track's file that lie off the track itself: nothing refuses them before they are simulated."""

from collections.abc import Iterator
from pathlib import Path

from turnout.errors import ConfigError
from turnout.simulate.parameters import track_parameters
from turnout.simulate.track_file import entries_of_routes

REACH = (("place", "place"), ("start", "end"), ("from", "to"))  # keys of the first and the last place of an entry


def off_track(path: Path) -> Iterator[ConfigError]:
    """An error at each entry of a sound track file that lies wholly off its track: locations, parts of routes,
    stretches of supports and rails. What was taken over from another file may lie outside."""
    p = track_parameters(path, path.parent)
    extent = p.part("extent")
    start, end = extent.number("from", "m"), extent.number("to", "m")
    locations = p.maybe("locations")
    for entry in (*(locations.part(name) for name in locations), *entries_of_routes(p.maybe("routes"))):
        yield from _beyond(entry, start, end, p.path, f"is off the track from {start:g} m to {end:g} m")
    for entry in (*p.parts("sections"), *p.parts("stretches")):
        yield from _beyond(entry, start, end, p.path, f"lies nothing of the track from {start:g} m to {end:g} m")


def _beyond(entry, start, end, path, said):
    for first, last in REACH:
        if first not in entry or entry.path != path:
            continue
        low, high = entry.number(first, "m"), entry.number(last, "m")
        if high < start or low > end:
            place = first if first == last else None
            found = f"{low:g} m {said}" if place else f"from {low:g} m to {high:g} m {said}"
            yield entry.error(place, found, "Correct it, or the track's extent")
