"""Write simulated hammer tests and passages as raw files, with the channels of a turnout's configuration.

A request is checked before anything is simulated.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from turnout.config import TurnoutConfig
from turnout.config.load import load_configuration
from turnout.config.settings.simulate import SimulateSettings
from turnout.constants import KMH
from turnout.errors import SimulationError
from turnout.files import output_problem, write_text
from turnout.readers.writing import write
from turnout.records import RawChannel, RawDescription, Recording
from turnout.simulate import Hammer, Sensor, load_track, load_vehicle, simulate_hammer, simulate_passage
from turnout.simulate.hammer import ImpactTruth, end_warning, hammer_sensors, resolve_location
from turnout.simulate.parameters import track_path
from turnout.simulate.track import Track
from turnout.simulate.turnout_track import TurnoutTrack, half_bay, position_by_mounting
from turnout.simulate.vehicle import Vehicle
from turnout.stages.accepted_effects import effects_of, terms_on
from turnout.stages.simulate_request import (
    check_request,
    ending_of,
    option_error,
    time_of,
    with_format,
)
from turnout.stages.track_files import files_of_track, files_of_vehicle, track_file


def section_channels(turnout: TurnoutConfig, section: float | str) -> RawDescription:
    """Description of a section's hammer files.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    section : float or str
        Label of the section.

    Returns
    -------
    RawDescription
        Channels and format of the files.

    Raises
    ------
    ConfigError
        The turnout has no tests of ``section``.
    """
    if turnout.hammer is None:
        raise option_error("turnout", f"{turnout.id} has no hammer tests in its layout", "Name another one, or none")
    descriptions = turnout.hammer.descriptions
    if not isinstance(section, str) or section not in descriptions:
        observation = f"{section!r} is no section of {turnout.id}, whose raw files are sought by section"
        remedy = f"Write one of {', '.join(descriptions)}; places in metres go without --turnout"
        raise option_error("section", observation, remedy)
    return descriptions[section]


NOISE = {"acceleration": 0.05, "force": 2.0, "velocity": 1e-6, "displacement": 1e-9}


def write_hammer(request: Mapping[str, Any]) -> Iterator[tuple[Path, str]]:
    """Simulate the tests of a request and write them.

    Parameters
    ----------
    request : mapping of str to any
        Options of `turnout simulate hammer`: track, section, tests, impacts, turnout, config, raw, out, format, at,
        temperature, truth, seed.

    Yields
    ------
    tuple of (Path, str)
        Path and summary of one test.

    Raises
    ------
    ConfigError
        An option is invalid.
    SimulationError
        A file is there already or cannot be written.
    """
    request, turnout, settings, track = _prepare(request)
    section = _label_or_position(request["section"])
    position, base = resolve_location(track, section)
    route = track.locations[section][1] if isinstance(section, str) and section in track.locations else "main"
    description = None if turnout is None else section_channels(turnout, section)
    hammer, sensors = _hammer_channels(description, position, base)
    rate = description.rate if description and description.rate else settings.rate
    day = time_of(request).date().isoformat()
    for test in range(1, request["tests"] + 1):
        path = _output_file(request, turnout, f"hammer/{day}/{section}_{test}.{ending_of(request['format'])}")
        recordings, impacts = simulate_hammer(
            track,
            section,
            hammer,
            sensors,
            request["impacts"],
            terms_on(track, base, _noted_conditions(request), route),
            seed=1000 * request["seed"] + test,
            rate=rate,
            substeps=settings.substeps,
            duration=settings.hammer_duration,
            pretrigger=settings.hammer_pretrigger,
            half_length=settings.hammer_half_length,
            scheme=settings.scheme,
            started_at=time_of(request),
            conditions=_noted_conditions(request),
            truth=True,
        )
        _write(request, path, recordings, description)
        _write_truth(
            request, path, track, route, recordings[0], {"impacts": [_impact_truth(impact) for impact in impacts]}
        )
        peak = max(float(r.samples[0].max()) for r in recordings)
        yield path, f"{len(recordings)} impacts at {position:.2f} m, highest force {peak / 1e3:.1f} kN"


def hammer_warnings(request: Mapping[str, Any]) -> list[str]:
    """What is doubtful about the hammer tests of a request, as sentences.

    Parameters
    ----------
    request : mapping of str to any
        Options of `turnout simulate hammer`.

    Returns
    -------
    list of str
        Empty where the impacts are far enough from the ends of the track.

    Raises
    ------
    ConfigError
        An option is invalid.
    SimulationError
        There is no such section or position.
    """
    request, _, settings, track = _prepare(request)
    position, base = resolve_location(track, _label_or_position(request["section"]))
    warning = end_warning(base, position, settings.hammer_half_length)
    return [warning] if warning else []


def write_passage(request: Mapping[str, Any]) -> Iterator[tuple[Path, str]]:
    """Simulate the passage of a request and write it.

    Parameters
    ----------
    request : mapping of str to any
        Options of `turnout simulate passage`.

    Yields
    ------
    tuple of (Path, str)
        Path and summary of the passage.

    Raises
    ------
    ConfigError
        An option is invalid.
    SimulationError
        The file is there already or cannot be written.
    """
    request, turnout, settings, track = _prepare(request)
    vehicle = load_vehicle(request["vehicle"], request["load"], units=request["units"])
    description = turnout.passages.description if turnout is not None and turnout.passages else None
    sensors = _passage_sensors(description, track)
    rate = description.rate if description and description.rate else settings.rate
    name = f"passages/{time_of(request):%Y%m%dT%H%M%SZ}.{ending_of(request['format'])}"
    path = _output_file(request, turnout, name)
    recording, truth = simulate_passage(
        track,
        vehicle,
        request["speed"] / KMH,
        sensors,
        request["direction"],
        request["route"],
        terms=terms_on(track, track.track_of(request["route"]), _term_conditions(vehicle, request), request["route"]),
        seed=request["seed"],
        rate=rate,
        substeps=settings.substeps,
        lead=settings.lead,
        tail=settings.tail,
        entry=settings.entry,
        scheme=settings.scheme,
        started_at=time_of(request),
        conditions=_noted_conditions(request),
        truth=True,
    )
    _write(request, path, [recording], description)
    forces = {
        "peak_force_n": truth.force.max(axis=1).round(1).tolist(),
        "contact_lost": bool(np.any(truth.force <= 0.0)),
    }
    _write_truth(request, path, track, request["route"], recording, forces)
    peak = truth.force.max()
    yield path, f"{len(vehicle.wheels)} axles, {recording.duration:.2f} s, highest wheel force {peak / 1e3:.0f} kN"


def _prepare(
    request: Mapping[str, Any],
) -> tuple[Mapping[str, Any], TurnoutConfig | None, SimulateSettings, TurnoutTrack]:
    """The checked request with its file format, its turnout, the settings and the track."""
    request = with_format(request)
    check_request(request)
    turnout, settings = _turnout(request)
    return request, turnout, settings, _track(request, turnout)


def _turnout(request: Mapping[str, Any]) -> tuple[TurnoutConfig | None, SimulateSettings]:
    if not request.get("turnout"):
        return None, SimulateSettings()
    turnout = load_configuration(request["config"]).turnout(request["turnout"])
    return turnout, turnout.settings.get("simulate", SimulateSettings())


def _track(request: Mapping[str, Any], turnout: TurnoutConfig | None) -> TurnoutTrack:
    """The track of the request, else the turnout's own, else that of Tommerup."""
    if request["track"] is None and turnout is not None:
        path = track_file(turnout)
        return load_track(str(path), request["seed"], path.parent)
    return load_track(request["track"] or "tommerup", request["seed"])


def model_files(request: Mapping[str, Any]) -> list[Path]:
    """Track and vehicle files of a request, with those that they extend or are composed of.

    Parameters
    ----------
    request : mapping of str to any
        Options of `turnout simulate hammer` or `turnout simulate passage`.

    Returns
    -------
    list of Path

    Raises
    ------
    SimulationError
        There is no such file.
    ConfigError
        The configuration of the turnout is not valid.
    """
    if request["track"] is None and request.get("turnout"):
        track = track_file(load_configuration(request["config"]).turnout(request["turnout"]))
    else:
        track = track_path(request["track"] or "tommerup")
    return [*files_of_track(track), *(files_of_vehicle(request["vehicle"]) if "vehicle" in request else ())]


def _label_or_position(section: str) -> float | str:
    try:
        position = float(section)
    except ValueError:
        return section
    return position if math.isfinite(position) else section


def _noted_conditions(request: Mapping[str, Any]) -> dict[str, Any]:
    temperature = request.get("temperature")
    return {} if temperature is None else {"rail_temperature": temperature}


def _term_conditions(vehicle: Vehicle, request: Mapping[str, Any]) -> dict[str, Any]:
    """Conditions that accepted terms depend on: temperature, axle loads, train."""
    loads = tuple(2.0 * float(load) for load in vehicle.static_loads)
    return {"axle_loads": loads, "train": vehicle.name.lower(), **_noted_conditions(request)}


def _sensor(channel: RawChannel, position: float) -> Sensor:
    """Sensor of a configured channel, at ``position`` if the configuration gives none."""
    return Sensor(
        channel.name,
        position if channel.position is None else channel.position,
        channel.mounting or "rail head",
        channel.quantity,
        noise=NOISE.get(channel.quantity, 0.0),
        limit=channel.limit,
        resolution=channel.resolution,
        serial=channel.serial,
    )


def _hammer_channels(
    description: RawDescription | None, position: float, track: Track
) -> tuple[Hammer, tuple[Sensor, ...]]:
    if description is None:
        return Hammer(), hammer_sensors(position, 2.0 * half_bay(track, position))
    force = next((c for c in description.channels if c.quantity == "force"), None)
    if force is None:
        raise SimulationError("the turnout's hammer channels have none of quantity 'force'.")
    responses = [c for c in description.channels if c.quantity in ("acceleration", "velocity", "displacement")]
    sensors = tuple(_sensor(c, position_by_mounting(track, position, c.mounting)) for c in responses)
    return Hammer(force=_sensor(force, position)), sensors


def _passage_sensors(description: RawDescription | None, track: TurnoutTrack) -> tuple[Sensor, ...]:
    if description is None:
        positions = sorted({(position, name) for name, (position, _) in track.locations.items()})
        return tuple(Sensor(name, position, "rail web", noise=0.05, limit=5000.0) for position, name in positions)
    return tuple(
        _sensor(c, 0.0) for c in description.channels if c.quantity != "temperature"
    )  # a force has no position


def _output_file(request: Mapping[str, Any], turnout: TurnoutConfig | None, name: str) -> Path:
    """File of a recording; SimulationError before it is simulated if the file cannot be written."""
    folder = Path(request["raw"]) / (turnout.raw if turnout is not None else "simulated")
    path = Path(request["out"]) if request.get("out") else folder / name
    if turnout is not None and not request.get("out") and path.exists():
        raise SimulationError(f"{path} is there already and may be a measurement: give another --at, or --out.")
    if problem := output_problem(path):
        raise SimulationError(f"{path}: {problem[0]}. {problem[1]}.")
    return path


def _write(
    request: Mapping[str, Any], path: Path, recordings: Iterable[Recording], description: RawDescription | None
) -> None:
    try:
        write([replace(r, source="") for r in recordings], path, request["format"], description)
    except ValueError as error:
        raise SimulationError(f"{path} cannot be written as {request['format']}: {error}.") from None


def _impact_truth(impact: ImpactTruth) -> dict[str, float]:
    return {
        "position_m": round(impact.position, 4),
        "speed_m_s": round(impact.speed, 4),
        "peak_force_n": round(impact.peak_force, 1),
    }


def _write_truth(
    request: Mapping[str, Any],
    path: Path,
    track: TurnoutTrack,
    route: str,
    recording: Recording,
    extra: Mapping[str, Any],
) -> None:
    """Write the truth of the file at ``path`` to the targets of the request, if any."""
    targets = [Path(request["truth"]) / Path(path).with_suffix(".json").name] if request.get("truth") else []
    targets += [Path(request["truth_file"])] if request.get("truth_file") else []
    content = {
        "track": track.name,
        "effects": [a.as_dict for a in effects_of(track) if a.is_on(route)],
        "conditions": dict(recording.conditions),
        **extra,
        "channels": [asdict(c) for c in recording.channels],
    }
    for target in targets:
        write_text(target, json.dumps(content, indent=1, default=str) + "\n")
