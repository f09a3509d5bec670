"""Load tracks and vehicles by name or path: ``config/tracks/<name>.yaml`` and ``config/vehicles/<name>.yaml``.

Also here: a check for entries of a track file that are outside its track.
"""

from collections.abc import Iterator
from pathlib import Path

from turnout.config.parameters import ParameterSet, read_parameters
from turnout.errors import ConfigError, SimulationError
from turnout.simulate.track_file import entries_of_routes, turnout_track
from turnout.simulate.train import couple, train

REPOSITORY = Path(__file__).resolve().parents[3]


def load_track(name, seed=0, folder=None):
    """``TurnoutTrack`` called ``name`` or in the file of that path; ``seed`` draws its scatter along the track.

    A file with ``extends`` takes the keys that it does not have from the file of that name.
    """
    return turnout_track(track_parameters(track_path(name, folder), folder), seed)


def track_path(name, folder=None):
    """File of the track called ``name``, or ``name`` where that is a file's path; SimulationError without one."""
    return _find_file(name, folder, "tracks")


def track_parameters(path, folder, visited=()):
    """Parameters of a track file; keys that it does not have come from the file that it extends."""
    parameters = read_parameters(path)
    if "extends" not in parameters:
        return parameters
    if path in visited:
        raise SimulationError(f"{path}: extends itself by way of {', '.join(p.name for p in visited)}.")
    base = track_parameters(base_track_file(parameters, path, folder), folder, (*visited, path))
    overrides = {key: value for key, value in parameters.content.items() if key != "extends"}
    return ParameterSet({**base.content, **overrides}, path, "")


def base_track_file(parameters, path, folder=None):
    """File that the track ``parameters`` of the file ``path`` extend: in its folder, else in ``folder``."""
    neighbour_file = path.parent / f"{parameters['extends']}.yaml"
    return neighbour_file if neighbour_file.is_file() else _find_file(parameters["extends"], folder, "tracks")


def load_vehicle(name, load=0.5, folder=None, units=1):
    """``Vehicle`` called ``name``; ``load`` from 0 (empty) to 1 (full) or 1.5, ``units`` coupled in a row.

    A file with ``compose`` is a train of other files' vehicles, front first; a locomotive has no payload.
    """
    path = _find_file(name, folder, "vehicles")
    parameters = read_parameters(path)
    if "compose" not in parameters:
        return train(parameters, load, units)
    parameters.allow_only("name", "title", "compose", "sources")
    vehicles = []
    for entry in parameters.mappings_at("compose"):
        vehicle = load_vehicle(entry.allow_only("vehicle", "count")["vehicle"], load, folder or path.parent)
        vehicles += [vehicle] * entry.count("count", 1)
    combined = couple(str(parameters["name"]), vehicles * units)
    return combined.with_(conditions={"load_share": float(load), "units": int(units)})


def _find_file(name, folder, subfolder):
    if str(name).endswith((".yaml", ".yml")):
        return Path(name)
    folders = [Path(folder)] if folder else [Path.cwd() / "config" / subfolder, REPOSITORY / "config" / subfolder]
    for candidate in folders:
        if (candidate / f"{name}.yaml").is_file():
            return candidate / f"{name}.yaml"
    available = sorted({p.stem for f in folders if f.is_dir() for p in f.glob("*.yaml")} - {"axle_patterns"})
    raise SimulationError(f"no file config/{subfolder}/{name}.yaml; there are {', '.join(available) or 'none'}.")


POSITION_KEYS = (
    ("place", "place"),
    ("start", "end"),
    ("from", "to"),
)  # keys of the first and last position of an entry


def off_track_errors(path: Path) -> Iterator[ConfigError]:
    """An error for each entry of a valid track file that is completely outside its track.

    Entries are locations, parts of routes, stretches of supports and of rails. Those taken from another file may be
    outside.
    """
    p = track_parameters(path, path.parent)
    extent = p.mapping_at("extent")
    start, end = extent.number("from", "m"), extent.number("to", "m")
    locations = p.optional_mapping_at("locations")
    for entry in (
        *(locations.mapping_at(name) for name in locations),
        *entries_of_routes(p.optional_mapping_at("routes")),
    ):
        yield from _entry_errors(entry, start, end, p.path, f"is off the track from {start:g} m to {end:g} m")
    for entry in (*p.mappings_at("sections"), *p.mappings_at("stretches")):
        yield from _entry_errors(entry, start, end, p.path, f"lies nothing of the track from {start:g} m to {end:g} m")


def _entry_errors(entry, start, end, path, statement):
    for first, last in POSITION_KEYS:
        if first not in entry or entry.path != path:
            continue
        low, high = entry.number(first, "m"), entry.number(last, "m")
        if high < start or low > end:
            key = first if first == last else None
            problem = f"{low:g} m {statement}" if key else f"from {low:g} m to {high:g} m {statement}"
            yield entry.error(key, problem, "Correct it, or the track's extent")
