"""Find and read the track file of a turnout, and the digest of what its model rests on."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.config.parameter_files import read_parameters, read_unchanged_parameters
from turnout.config.turnout import TurnoutConfig
from turnout.content import sha256_of
from turnout.errors import SimulationError, TurnoutError
from turnout.simulate import load_track
from turnout.simulate.parameters import base_track_file, vehicle_path
from turnout.stages.accepted_effects import effects_of
from turnout.stages.parameter_ranges import improbable_in_files

if TYPE_CHECKING:
    from turnout.simulate import TurnoutTrack
    from turnout.stages.accepted_effects import AcceptedEffect


def track_file(turnout: TurnoutConfig, name: str | None = None) -> Path:
    """The turnout's own track file in the configuration, else that of its layout.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    name : str or None
        Name or file of a track; None: the turnout's own, else that of its layout.

    Returns
    -------
    Path

    Raises
    ------
    SimulationError
        There is no such file.
    """
    if name and name.endswith((".yaml", ".yml")):
        return Path(name)
    folder = Path(turnout.folder) / "tracks"
    for stem in (name,) if name else (turnout.id, turnout.layout):
        if (folder / f"{stem}.yaml").is_file():
            return folder / f"{stem}.yaml"
    names = name or f"{turnout.id}.yaml nor {turnout.layout}"
    raise SimulationError(
        f"{turnout.id}: no file {folder}/{names}.yaml; without a track nothing can be simulated. "
        f"Copy a file of {folder} or of a new project (turnout init) to one of these names, and change what differs "
        "(docs/simulation.md, 'A track of your own')."
    )


def track_of(turnout: TurnoutConfig, name: str | None = None) -> tuple[TurnoutTrack, tuple[AcceptedEffect, ...]]:
    """Track of a turnout, and the effects that its file has accepted.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    name : str or None
        Name or file of a track; None: the turnout's own, else that of its layout.

    Returns
    -------
    track : TurnoutTrack
    accepted : tuple of AcceptedEffect
    """
    path = track_file(turnout, name)
    track = load_track(str(path), folder=path.parent)
    return track, effects_of(track)


def digest_of_model(turnout: TurnoutConfig, name: str | None = None) -> str:
    """Digest of the track and vehicle files of the configuration, "" without a track.

    For a track given by ``name``, all files in its folder count, since it may extend any of them.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    name : str or None
        Name or file of a track; None: the turnout's own, else that of its layout.

    Returns
    -------
    str
    """
    folder = Path(turnout.folder)
    try:
        own_file = track_file(turnout, name)
    except SimulationError:
        return ""
    paths = [*files_of_track(own_file), *sorted((folder / "tracks").glob(f"{turnout.layout}.yaml"))]
    paths += sorted((folder / "vehicles").glob("[!.]*"))
    paths += sorted(own_file.parent.glob("[!.]*.y*ml")) if name else []
    digests = [[path.name, sha256_of(path)] for path in dict.fromkeys(paths) if path.is_file()]
    return hashlib.sha256(json.dumps(digests).encode()).hexdigest()[:16]


def improbable_entries(turnout: TurnoutConfig, name: str | None = None) -> list[str]:
    """Numbers that no track or vehicle has, in the files that a diagnosis of the turnout uses.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    name : str or None
        Name or file of a track; None: the turnout's own, else that of its layout.

    Returns
    -------
    list of str
        One sentence per number, with file, line and entry. Axle patterns are no parameters.

    Raises
    ------
    SimulationError
        There is no track file.
    """
    vehicles = sorted((Path(turnout.folder) / "vehicles").glob("[!.]*.yaml"))
    return improbable_in_files([*files_of_track(track_file(turnout, name)), *vehicles])


def files_of_vehicle(name: str, folder: str | Path | None = None) -> list[Path]:
    """A vehicle's file and those of the vehicles that it is composed of, as far as they can be read.

    Parameters
    ----------
    name : str
        Name of the vehicle, or path of its file.
    folder : str, Path or None
        Folder of the files; None: ``config`` in the working folder, then that of the program.

    Returns
    -------
    list of Path

    Raises
    ------
    SimulationError
        There is no such file.
    """
    paths = [vehicle_path(name, folder)]
    try:
        for entry in read_unchanged_parameters(paths[0]).get("compose", ()):
            paths.append(vehicle_path(str(entry["vehicle"]), folder or paths[0].parent))
    except (TurnoutError, OSError, KeyError, TypeError):
        pass  # whoever loads the vehicle reports it
    return paths


def files_of_track(path: Path) -> list[Path]:
    """A track's file and the files that it extends, as far as they can be read.

    Parameters
    ----------
    path : Path
        The track file. Whoever loads it reports errors in it.

    Returns
    -------
    list of Path
    """
    paths = [path]
    try:
        while "extends" in (parameters := read_parameters(paths[-1])):
            base = base_track_file(parameters, paths[-1], path.parent)
            if base in paths:
                break
            paths.append(base)
    except (TurnoutError, OSError):
        pass
    return paths
