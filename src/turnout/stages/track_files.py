"""Find and read the track file of a turnout, and the digest of what its model rests on."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.config.parameter_files import read_parameters
from turnout.config.turnout import TurnoutConfig
from turnout.content import sha256_of
from turnout.errors import SimulationError, TurnoutError
from turnout.simulate import load_track
from turnout.simulate.parameters import base_track_file
from turnout.stages.accepted_effects import effects_of
from turnout.stages.parameter_ranges import improbable_values

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
    paths = [*_extended_files(own_file), *sorted((folder / "tracks").glob(f"{turnout.layout}.yaml"))]
    paths += sorted((folder / "vehicles").glob("*"))
    paths += sorted(own_file.parent.glob("*.y*ml")) if name else []
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
        One sentence per number, with file, line and entry.

    Raises
    ------
    SimulationError
        There is no track file.
    """
    sentences: list[str] = []
    for path in (*_extended_files(track_file(turnout, name)), *(Path(turnout.folder) / "vehicles").glob("*.yaml")):
        try:
            sentences += map(str, improbable_values(read_parameters(path)))
        except (TurnoutError, OSError):
            continue  # whoever uses the file reports it; axle patterns are no parameters
    return sorted(sentences)


def _extended_files(path: Path) -> list[Path]:
    """A track's file and the files that it extends, as far as they can be read.

    Errors in them are reported by the diagnosis.
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
