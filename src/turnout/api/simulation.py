"""Simulate hammer tests and passages."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from turnout import simulate
from turnout.config.settings.simulate import SimulateSettings
from turnout.records import Recording
from turnout.simulate import Hammer, Sensor, Track, TurnoutTrack, Vehicle
from turnout.simulate.hammer import resolve_location
from turnout.stages.accepted_effects import terms_on

if TYPE_CHECKING:
    from turnout.physics.term import PhysicsTerm

WEB_NOISE, WEB_LIMIT = 0.05, 5000.0  # m/s², noise and range of an accelerometer on the rail web


def load_track(name: str | os.PathLike, seed: int = 0, folder: str | Path | None = None) -> TurnoutTrack:
    """Load the track of a turnout: rails, supports, crossing, accepted effects.

    Parameters
    ----------
    name : str or path-like
        Name of a file in config/tracks, or the path of a file that ends in .yaml.
    seed : int
        Seed of the scatter of the supports along the track.
    folder : path-like, optional
        Folder of the track files; by default config/tracks.

    Returns
    -------
    TurnoutTrack
        For ``simulate_hammer`` and ``simulate_passage``. ``locations`` maps names to (position [m], route).

    Raises
    ------
    SimulationError
        If there is no such file.
    ConfigError
        If an entry of the file cannot be used; it names file, line and remedy.

    Examples
    --------
    >>> import turnout
    >>> turnout.load_track("tommerup").locations["A7"]
    (24.6, 'main')
    """
    return simulate.load_track(os.fspath(name), seed, folder)


def load_vehicle(
    name: str | os.PathLike, load: float = 0.5, units: int = 1, folder: str | Path | None = None
) -> Vehicle:
    """Load a vehicle or train: car bodies, bogies, wheels and suspensions.

    Parameters
    ----------
    name : str or path-like
        Name of a file in config/vehicles, or the path of a file that ends in .yaml.
    load : float
        Share of the payload, 0 (empty) to 1 (full), overloaded up to 1.5. [-]
    units : int
        Number of coupled units.
    folder : path-like, optional
        Folder of the vehicle files; by default config/vehicles.

    Returns
    -------
    Vehicle
        ``static_loads`` is the force of each wheel [N], ``wheel_positions`` their distance behind the first [m].

    Raises
    ------
    SimulationError
        If there is no such file, or the vehicle cannot stand.
    ConfigError
        If an entry of the file cannot be used.

    Examples
    --------
    >>> import turnout
    >>> ic3 = turnout.load_vehicle("ic3")
    >>> len(ic3.wheels), bool(ic3.static_loads.min() > 30e3)
    (8, True)
    """
    return simulate.load_vehicle(os.fspath(name), load, folder, units)


def simulate_hammer(
    track: TurnoutTrack | Track | str,
    location: float | str,
    *,
    impacts: int = 10,
    hammer: Hammer | None = None,
    sensors: Sequence[Sensor] | None = None,
    effects: Sequence[PhysicsTerm] = (),
    seed: int = 0,
    started_at: datetime | None = None,
    conditions: Mapping[str, Any] | None = None,
    settings: SimulateSettings | None = None,
) -> tuple[Recording, ...]:
    """Simulate a hammer test, one recording per impact, as a measuring system would record it.

    Parameters
    ----------
    track : TurnoutTrack, Track or str
        From ``load_track``, or its name. The accepted effects of its file act.
    location : float or str
        Position of the impacts [m], or the name of a location of the track.
    impacts : int
        Number of impacts, each with its own speed and position.
    hammer : Hammer, optional
        Mass, tip, speed and load cell; by default 5.5 kg with a plastic tip.
    sensors : sequence of Sensor, optional
        By default two accelerometers on the rail head: at the sleeper of the impact and at mid-span.
    effects : sequence of PhysicsTerm, optional
        Effects of ``turnout.physics`` to add; docs/effects.md.
    seed : int
        Seed of the scatter of the impacts and of the noise.
    started_at : datetime, optional
        Naive UTC time of the first sample.
    conditions : mapping, optional
        Noted with the recordings, such as ``rail_temperature`` [°C]; effects that depend on them use them.
    settings : SimulateSettings, optional
        Rate, duration, step and length of track: section ``simulate``; by default its defaults.

    Returns
    -------
    tuple of Recording
        Channel 0 is the force [N], the others the acceleration [m/s²], down positive.

    Raises
    ------
    SimulationError
        For a location that is not on the track.

    Examples
    --------
    The impulse is between one and two times mass times speed, since the hammer bounces:

    >>> import turnout
    >>> from turnout.simulate import Hammer, uniform_track
    >>> recording, = turnout.simulate_hammer(uniform_track(30.0), 15.0, impacts=1, hammer=Hammer(velocity_spread=0.0))
    >>> bool(1.0 < recording.signal("hammer").sum() / recording.rate / (5.5 * 1.2) < 2.0)
    True

    References
    ----------
    docs/simulation.md.
    """
    s = settings or SimulateSettings()
    chosen = load_track(track) if isinstance(track, str) else track
    _, base = resolve_location(chosen, location)
    if isinstance(chosen, TurnoutTrack):
        route = chosen.locations[location][1] if isinstance(location, str) else "main"
        effects = (*terms_on(chosen, base, conditions, route), *effects)
    return simulate.simulate_hammer(
        chosen, location, hammer=hammer, sensors=sensors, n_impacts=impacts, terms=effects, seed=seed, rate=s.rate,
        duration=s.hammer_duration, pretrigger=s.hammer_pretrigger, substeps=s.substeps,
        half_length=s.hammer_half_length, started_at=started_at, conditions=conditions, scheme=s.scheme,
    )  # fmt: skip


def simulate_passage(
    track: TurnoutTrack | Track | str,
    vehicle: Vehicle | str,
    speed: float,
    *,
    sensors: Sequence[Sensor] | None = None,
    direction: str = "facing",
    route: str = "main",
    effects: Sequence[PhysicsTerm] = (),
    seed: int = 0,
    started_at: datetime | None = None,
    conditions: Mapping[str, Any] | None = None,
    settings: SimulateSettings | None = None,
) -> Recording:
    """Simulate the passage of a train over a turnout, as its sensors would record it.

    Parameters
    ----------
    track : TurnoutTrack, Track or str
        From ``load_track``, or its name. The accepted effects of its file act.
    vehicle : Vehicle or str
        From ``load_vehicle``, or its name.
    speed : float
        Above 0. [m/s]
    sensors : sequence of Sensor, optional
        By default an accelerometer on the rail web at every location of the track.
    direction : "facing" or "trailing"
        Towards growing positions or against them.
    route : str
        "main" or "diverging".
    effects : sequence of PhysicsTerm, optional
        Effects of ``turnout.physics`` to add.
    seed : int
        Seed of the roughness of the rail and of the noise.
    started_at : datetime, optional
        Naive UTC time of the first sample.
    conditions : mapping, optional
        Noted with the recording, such as ``rail_temperature`` [°C].
    settings : SimulateSettings, optional
        Section ``simulate``; by default its defaults.

    Returns
    -------
    Recording
        Acceleration [m/s²], down positive, (n_sensor, n_sample). Its ``conditions`` hold type, speed and axle loads.

    Raises
    ------
    SimulationError
        For a speed of 0, an unknown route, no sensor, or a sensor outside the modelled track.

    Examples
    --------
    >>> import turnout
    >>> from turnout.simulate import Sensor, car, uniform_track
    >>> recording = turnout.simulate_passage(uniform_track(60.0), car(), 40.0, sensors=[Sensor("A", 30.0)])
    >>> recording.conditions["speed"], recording.channels[0].name
    (40.0, 'A')

    References
    ----------
    docs/simulation.md.
    """
    s = settings or SimulateSettings()
    chosen = load_track(track) if isinstance(track, str) else track
    train = load_vehicle(vehicle) if isinstance(vehicle, str) else vehicle
    if isinstance(chosen, TurnoutTrack):
        loads = tuple(2.0 * float(load) for load in train.static_loads)
        known = {"axle_loads": loads, "train": train.name.lower(), **(conditions or {})}
        effects = (*terms_on(chosen, chosen.track_of(route), known, route), *effects)
    if sensors is None:
        positions = sorted({(x, name) for name, (x, _) in getattr(chosen, "locations", {}).items()})
        sensors = [Sensor(name, x, "rail web", noise=WEB_NOISE, limit=WEB_LIMIT) for x, name in positions]
    return simulate.simulate_passage(
        chosen, train, speed, sensors, direction=direction, route=route, terms=effects, seed=seed, rate=s.rate,
        substeps=s.substeps, lead=s.lead, tail=s.tail, entry=s.entry, scheme=s.scheme, started_at=started_at,
        conditions=conditions,
    )  # fmt: skip
