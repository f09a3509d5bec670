"""Load tracks and vehicles by name or path: ``config/tracks/<name>.yaml`` and ``config/vehicles/<name>.yaml``.

Also here: a check for entries of a track file that are outside its track.
"""

from collections.abc import Iterator
from pathlib import Path

from turnout.config.parameters import ParameterSet, read_parameters
from turnout.errors import ConfigError, SimulationError
from turnout.simulate.track_file import entries_of_routes, turnout_track
from turnout.simulate.train import coupled, train

REPOSITORY = Path(__file__).resolve().parents[3]


def load_track(name, seed=0, folder=None):
    """``TurnoutTrack`` called ``name`` or in the file of that path; ``seed`` draws its scatter along the track.

    A file with ``extends`` takes the keys that it does not have from the file of that name.
    """
    return turnout_track(track_parameters(track_path(name, folder), folder), seed)


def track_path(name, folder=None):
    """File of the track called ``name``, or ``name`` where that is a file's path; SimulationError without one."""
    return _file(name, folder, "tracks")


def track_parameters(path, folder, below=()):
    """Parameters of a track file; keys that it does not have come from the file that it extends."""
    own = read_parameters(path)
    if "extends" not in own:
        return own
    if path in below:
        raise SimulationError(f"{path}: extends itself by way of {', '.join(p.name for p in below)}.")
    base = track_parameters(extended(own, path, folder), folder, (*below, path))
    changed = {key: value for key, value in own.content.items() if key != "extends"}
    return ParameterSet({**base.content, **changed}, path, "")


def extended(own, path, folder=None):
    """File that the track ``parameters`` of the file ``path`` extend: in its folder, else in ``folder``."""
    beside = path.parent / f"{own['extends']}.yaml"
    return beside if beside.is_file() else _file(own["extends"], folder, "tracks")


def load_vehicle(name, load=0.5, folder=None, units=1):
    """``Vehicle`` called ``name``; ``load`` from 0 (empty) to 1 (full) or 1.5, ``units`` coupled in a row.

    A file with ``compose`` is a train of other files' vehicles, front first; a locomotive has no payload.
    """
    path = _file(name, folder, "vehicles")
    parameters = read_parameters(path)
    if "compose" not in parameters:
        return train(parameters, load, units)
    parameters.only("name", "title", "compose", "sources")
    parts = []
    for entry in parameters.parts("compose"):
        part = load_vehicle(entry.only("vehicle", "count")["vehicle"], load, folder or path.parent)
        parts += [part] * entry.count("count", 1)
    made = coupled(str(parameters["name"]), parts * units)
    return made.with_(conditions={"load_share": float(load), "units": int(units)})


def _file(name, folder, kind):
    if str(name).endswith((".yaml", ".yml")):
        return Path(name)
    folders = [Path(folder)] if folder else [Path.cwd() / "config" / kind, REPOSITORY / "config" / kind]
    for candidate in folders:
        if (candidate / f"{name}.yaml").is_file():
            return candidate / f"{name}.yaml"
    there = sorted({p.stem for f in folders if f.is_dir() for p in f.glob("*.yaml")} - {"axle_patterns"})
    raise SimulationError(f"no file config/{kind}/{name}.yaml; there are {', '.join(there) or 'none'}.")


REACH = (("place", "place"), ("start", "end"), ("from", "to"))  # keys of the first and last position of an entry


def off_track(path: Path) -> Iterator[ConfigError]:
    """An error for each entry of a valid track file that is completely outside its track.

    Entries are locations, parts of routes, stretches of supports and of rails. Those taken from another file may be
    outside.
    """
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
