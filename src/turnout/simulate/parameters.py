"""Tracks and vehicles by name or path: ``config/tracks/<name>.yaml`` and ``config/vehicles/<name>.yaml``."""

from pathlib import Path

from turnout.config.parameters import ParameterSet, read_parameters
from turnout.errors import SimulationError
from turnout.simulate.coupled import coupled
from turnout.simulate.track_file import turnout_track
from turnout.simulate.train import train

REPOSITORY = Path(__file__).resolve().parents[3]


def load_track(name, seed=0, folder=None):
    """``TurnoutTrack`` called ``name`` or in the file of that path; ``seed`` draws its scatter along the track.

    A file with ``extends`` takes what it does not say itself from the file of that name.
    """
    return turnout_track(track_parameters(track_path(name, folder), folder), seed)


def track_path(name, folder=None):
    """File of the track called ``name``, or ``name`` where that is a file's path; SimulationError without one."""
    return _file(name, folder, "tracks")


def track_parameters(path, folder, below=()):
    """Parameters of a track's file, with those of the file that it extends where it says nothing itself."""
    own = read_parameters(path)
    if "extends" not in own:
        return own
    if path in below:
        raise SimulationError(f"{path}: extends itself by way of {', '.join(p.name for p in below)}.")
    base = track_parameters(extended(own, path, folder), folder, (*below, path))
    changed = {key: value for key, value in own.content.items() if key != "extends"}
    return ParameterSet({**base.content, **changed}, path, "")


def extended(own, path, folder=None):
    """File of the track that the parameters ``own`` of the file ``path`` extend: beside it, else in ``folder``."""
    beside = path.parent / f"{own['extends']}.yaml"
    return beside if beside.is_file() else _file(own["extends"], folder, "tracks")


def load_vehicle(name, load=0.5, folder=None, units=1):
    """``Vehicle`` called ``name``; ``load`` from 0 (empty) to 1 (full) or 1.5, ``units`` coupled one behind the other.

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
