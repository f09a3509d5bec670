"""Load tracks and vehicles by name or path: ``config/tracks/<name>.yaml`` and ``config/vehicles/<name>.yaml``.

Also here: a check for entries of a track file that are outside its track.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.config.parameter_files import read_parameters, read_unchanged_parameters
from turnout.config.parameters import ParameterSet
from turnout.errors import ConfigError, SimulationError
from turnout.installation import shipped_path
from turnout.simulate.track_file import entries_of_routes, turnout_track
from turnout.simulate.train import couple, train

if TYPE_CHECKING:
    from turnout.simulate.turnout_track import TurnoutTrack
    from turnout.simulate.vehicle import Vehicle


def load_track(name: str | Path, seed: int = 0, folder: str | Path | None = None) -> TurnoutTrack:
    """``TurnoutTrack`` called ``name`` or in the file of that path; ``seed`` draws its scatter along the track.

    A file with ``extends`` takes the keys that it does not have from the file of that name.

    Parameters
    ----------
    name : str or Path
        Name of the track, or path of its file.
    seed : int
        Seed of the scatter along the track.
    folder : str, Path or None
        Folder of the files; None: ``config`` in the working folder, then that of the program.

    Returns
    -------
    TurnoutTrack
        The turnout with its routes.

    Raises
    ------
    SimulationError
        If there is no such file.
    ConfigError
        If the file is not valid.
    """
    return turnout_track(track_parameters(track_path(name, folder), folder), seed)


def track_path(name: str | Path, folder: str | Path | None = None) -> Path:
    """File of the track called ``name``, or ``name`` where that is a file's path.

    Parameters
    ----------
    name : str or Path
        Name of the track, or path of its file.
    folder : str, Path or None
        Folder of the files; None: ``config`` in the working folder, then that of the program.

    Returns
    -------
    Path
        Path of the file; one that was given as a path is not looked up.

    Raises
    ------
    SimulationError
        If no file has that name.
    """
    return _find_file(name, folder, "tracks")


def vehicle_path(name: str | Path, folder: str | Path | None = None) -> Path:
    """File of the vehicle called ``name``, or ``name`` where that is a file's path.

    Parameters
    ----------
    name : str or Path
        Name of the vehicle, or path of its file.
    folder : str, Path or None
        Folder of the files; None: ``config`` in the working folder, then that of the program.

    Returns
    -------
    Path
        Path of the file; one that was given as a path is not looked up.

    Raises
    ------
    SimulationError
        If no file has that name.
    """
    return _find_file(name, folder, "vehicles")


def track_parameters(path: Path, folder: str | Path | None, visited: tuple[Path, ...] = ()) -> ParameterSet:
    """Parameters of a track file; keys that it does not have come from the file that it extends.

    Parameters
    ----------
    path : Path
        The track file.
    folder : str, Path or None
        Folder of the files; None: ``config`` in the working folder, then that of the program.
    visited : tuple of Path
        Files that extend this one, to detect a circle.

    Returns
    -------
    ParameterSet
        Parameters with those of the extended files.

    Raises
    ------
    SimulationError
        If a file extends itself, directly or not.
    """
    parameters = read_parameters(path)
    if "extends" not in parameters:
        return parameters
    if path in visited:
        raise SimulationError(f"{path}: extends itself by way of {', '.join(p.name for p in visited)}.")
    base = track_parameters(base_track_file(parameters, path, folder), folder, (*visited, path))
    overrides = {key: value for key, value in parameters.items() if key != "extends"}
    return ParameterSet(parameters.place, {**base, **overrides}, parameters.key_places)


def base_track_file(parameters: ParameterSet, path: Path, folder: str | Path | None = None) -> Path:
    """File that the track ``parameters`` of the file ``path`` extend: in its folder, else in ``folder``.

    Parameters
    ----------
    parameters : ParameterSet
        Parameters with the key ``extends``.
    path : Path
        File of the parameters.
    folder : str, Path or None
        Folder of the files; None: ``config`` in the working folder, then that of the program.

    Returns
    -------
    Path
        Path of the extended file.
    """
    neighbour_file = path.parent / f"{parameters['extends']}.yaml"
    return neighbour_file if neighbour_file.is_file() else _find_file(parameters["extends"], folder, "tracks")


def load_vehicle(name: str | Path, load: float = 0.5, folder: str | Path | None = None, units: int = 1) -> Vehicle:
    """``Vehicle`` called ``name``; ``load`` from 0 (empty) to 1 (full) or 1.5, ``units`` coupled in a row.

    A file with ``compose`` is a train of other files' vehicles, front first; a locomotive has no payload.

    Parameters
    ----------
    name : str or Path
        Name of the vehicle, or path of its file.
    load : float
        Share of the payload. [-]
    folder : str, Path or None
        Folder of the files; None: ``config`` in the working folder, then that of the program.
    units : int
        Number of coupled units.

    Returns
    -------
    Vehicle
        The train.

    Raises
    ------
    SimulationError
        If there is no such file, or ``load`` is outside 0 to 1.5.
    ConfigError
        If the file is not valid.
    """
    path = vehicle_path(name, folder)
    parameters = read_unchanged_parameters(path)
    if "compose" not in parameters:
        return train(parameters, load, units)
    parameters.allow_only("name", "title", "compose", "sources")
    vehicles = []
    for entry in parameters.mappings_at("compose"):
        vehicle = load_vehicle(entry.allow_only("vehicle", "count")["vehicle"], load, folder or path.parent)
        vehicles += [vehicle] * entry.count("count", 1)
    combined = couple(str(parameters["name"]), vehicles * units)
    return combined.with_(conditions={"load_share": float(load), "n_units": int(units)})


def _find_file(name: str | Path, folder: str | Path | None, subfolder: str) -> Path:
    if str(name).endswith((".yaml", ".yml")):
        return Path(name)
    folders = [Path(folder)] if folder else [Path.cwd() / "config" / subfolder, shipped_path(f"config/{subfolder}")]
    for candidate in folders:
        if (candidate / f"{name}.yaml").is_file():
            return candidate / f"{name}.yaml"
    available = sorted({p.stem for f in folders if f.is_dir() for p in f.glob("[!.]*.yaml")} - {"axle_patterns"})
    raise SimulationError(f"no file config/{subfolder}/{name}.yaml. Write one of {', '.join(available) or 'none'}.")


POSITION_KEYS = (
    ("place", "place"),
    ("start", "end"),
    ("from", "to"),
)  # keys of the first and last position of an entry


def off_track_errors(path: Path) -> Iterator[ConfigError]:
    """An error for each entry of a valid track file that is completely outside its track.

    Entries are locations, parts of routes, stretches of supports and of rails. Those taken from another file may be
    outside.

    Parameters
    ----------
    path : Path
        A valid track file.

    Yields
    ------
    ConfigError
        Error with file, line and the positions.
    """
    p = track_parameters(path, path.parent)
    extent = p.mapping_at("extent")
    start, end = extent.number("from", "m"), extent.number("to", "m")
    locations = p.optional_mapping_at("locations")
    for entry in (
        *(locations.mapping_at(name) for name in locations),
        *entries_of_routes(p.optional_mapping_at("routes")),
    ):
        yield from _entry_errors(entry, start, end, p.place.path, f"is off the track from {start:g} m to {end:g} m")
    for entry in (*p.mappings_at("sections"), *p.mappings_at("stretches")):
        statement = f"lies nothing of the track from {start:g} m to {end:g} m"
        yield from _entry_errors(entry, start, end, p.place.path, statement)


def _entry_errors(
    entry: ParameterSet, start: float, end: float, path: str | Path, statement: str
) -> Iterator[ConfigError]:
    for first, last in POSITION_KEYS:
        if first not in entry or entry.place.path != path:
            continue
        low, high = entry.number(first, "m"), entry.number(last, "m")
        if high < start or low > end:
            key = first if first == last else None
            problem = f"{low:g} m {statement}" if key else f"from {low:g} m to {high:g} m {statement}"
            yield entry.error(key, problem, "Correct it, or the track's extent")
