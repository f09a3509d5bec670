"""What a diagnosis of a turnout needs beside its files: its track's file, vehicles, what the passage stage found."""

import hashlib
import json
from pathlib import Path

from turnout.chains.accepted_terms import accepted_of
from turnout.config.parameters import read_parameters
from turnout.config.turnout import TurnoutConfig
from turnout.content import sha256_of
from turnout.errors import SimulationError, TurnoutError
from turnout.fleet.current import current_results
from turnout.simulate import load_track
from turnout.simulate.parameters import extended


def track_file(turnout: TurnoutConfig, name: str | None = None) -> Path:
    """The turnout's own file in the configuration's tracks, else that of its layout; SimulationError without one."""
    if name and name.endswith((".yaml", ".yml")):
        return Path(name)
    folder = Path(turnout.folder) / "tracks"
    for stem in (name,) if name else (turnout.id, turnout.layout):
        if (folder / f"{stem}.yaml").is_file():
            return folder / f"{stem}.yaml"
    said = name or f"{turnout.id}.yaml nor {turnout.layout}"
    raise SimulationError(
        f"{turnout.id}: no file {folder}/{said}.yaml; without a track nothing can be simulated "
        "(docs/simulation.md, 'A track of your own')."
    )


def track_of(turnout: TurnoutConfig, name: str | None = None):
    """(TurnoutTrack, accepted effects) of a turnout."""
    path = track_file(turnout, name)
    track = load_track(str(path), folder=path.parent)
    return track, accepted_of(track.terms)


def digest_of_model(turnout: TurnoutConfig, name: str | None = None) -> str:
    """Changes when a track's or a vehicle's file of the configuration does, "" where there are none; beside a track
    that is asked for by ``name`` all in its folder count, since it may extend any of them."""
    folder = Path(turnout.folder)
    try:
        own = track_file(turnout, name)
    except SimulationError:
        return ""
    used = [*_extended(own), *sorted((folder / "tracks").glob(f"{turnout.layout}.yaml"))]
    used += sorted((folder / "vehicles").glob("*"))
    used += sorted(own.parent.glob("*.y*ml")) if name else []
    parts = [[path.name, sha256_of(path)] for path in dict.fromkeys(used) if path.is_file()]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


def _extended(path: Path) -> list[Path]:
    """A track's file and those that it extends, one after the other, as far as they can be read: the diagnosis says
    what is wrong with the rest."""
    found = [path]
    try:
        while "extends" in (own := read_parameters(found[-1])):
            base = extended(own, found[-1], path.parent)
            if base in found:
                break
            found.append(base)
    except (TurnoutError, OSError):
        pass
    return found


def mismatch_context(turnout: str, settings=None, work="work") -> tuple[str, dict[str, dict]]:
    """(token, tables of each passage unit by its id) as the passage stage left them in ``work``."""
    found = {}
    for result in current_results(work, "passage", turnout):
        found[result.unit] = {k: result.tables.get(k, []) for k in ("passages", "quarantine")}
    ids = sorted(str(r.get("passage_id")) + str(r.get("status")) for t in found.values() for r in t["passages"])
    return hashlib.sha256(json.dumps(ids).encode()).hexdigest()[:16], found
