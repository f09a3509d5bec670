"""Simulate a train passage: the train starts in equilibrium, rolls over the turnout and is recorded by its sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from turnout.errors import SimulationError
from turnout.records import Recording
from turnout.simulate.number_checks import check_number, check_seed, check_start_time
from turnout.simulate.path_checks import check_path
from turnout.simulate.preparation import Prepared, prepare, time_step_of
from turnout.simulate.run import Drive, run
from turnout.simulate.sensor import Sensor, actual_sensor, check_names, mean_of, record_signal
from turnout.simulate.track import Track
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.simulate.vehicle import Vehicle
from turnout.simulate.wheel_path import PathPart

if TYPE_CHECKING:
    from collections.abc import Iterable

    from turnout.simulate.effect import Effect
    from turnout.simulate.run import Outcome

POSITION_TOLERANCE = 1e-6  # m; positions are rounded to this
MAX_DISTANCE = 100e3  # m that a train may roll; the path of its wheels is stored every 5 mm
MAX_DURATION = 3600.0  # s


@dataclass(frozen=True)
class PassageTruth:
    """True values that no sensor measures.

    ``time`` (n,) [s] of the samples, ``force`` (n_wheel, n) [N] mean over the step, ``surface_force``
    (n_wheel, n_surface, n), ``wheel_position`` (n_wheel, n) [m], ``port_force`` of terms, ``clean`` (n_channel, n)
    signals before the sensors, ``iterations`` of Newton per step.
    """

    time: np.ndarray
    force: np.ndarray
    surface_force: np.ndarray
    wheel_position: np.ndarray
    port_force: np.ndarray
    clean: np.ndarray
    iterations: float


@overload
def simulate_passage(
    track: Track | TurnoutTrack,
    vehicle: Vehicle,
    speed: float,
    sensors: Sequence[Sensor],
    *arguments: Any,
    truth: Literal[True],
    **options: Any,
) -> tuple[Recording, PassageTruth]: ...


@overload
def simulate_passage(
    track: Track | TurnoutTrack,
    vehicle: Vehicle,
    speed: float,
    sensors: Sequence[Sensor],
    *arguments: Any,
    truth: Literal[False] = False,
    **options: Any,
) -> Recording: ...


def simulate_passage(  # type: ignore[misc]  # the overloads stand for any of the options
    track: Track | TurnoutTrack,
    vehicle: Vehicle,
    speed: float,
    sensors: Sequence[Sensor],
    direction: str = "facing",
    route: str = "main",
    roughness: float | None = None,
    terms: Sequence[Effect] = (),
    seed: int = 0,
    rail_seed: int | None = None,
    rate: float = 20e3,
    substeps: int = 1,
    lead: float = 1.0,
    tail: float = 1.0,
    irregularities: Sequence[PathPart] = (),
    entry: float = 6.0,
    scheme: str = "radau",
    prepared: Prepared | None = None,
    started_at: datetime | None = None,
    conditions: Mapping[str, Any] | None = None,
    truth: bool = False,
) -> Recording | tuple[Recording, PassageTruth]:
    """Recording of ``vehicle`` passing the turnout at ``speed`` [m/s].

    Parameters
    ----------
    track : TurnoutTrack or Track
        The track. A plain Track is smooth and has one route.
    vehicle : Vehicle
        From ``turnout.simulate.vehicle`` or read from config/vehicles.
    speed : float
        Above 0. [m/s]
    sensors : sequence of Sensor
        Channels of the recording.
    direction : str
        "facing" (towards growing x) or "trailing".
    route : str
        Route of the turnout: "main", "diverging".
    roughness : float or None
        Level above the limit curve of ISO 3095 [dB]; None: that of the turnout.
    terms : sequence of Effect
        Effects added to the base model.
    seed, rail_seed : int, int or None
        Seeds of the noise and of the rail roughness (None: ``seed``). Trains over one rail share the latter.
    rate, substeps : float, int
        Samples per second [Hz] and time steps per sample.
    lead, tail : float
        Time before the first wheel reaches the first sensor, and after the last wheel has passed the last one. [s]
    irregularities : sequence of path parts
        Further irregularities of this train: WheelFlat, OutOfRound ...
    entry : float
        Length over which wheels roll from their stand-in track onto the modelled one; 0: they must stay on the
        modelled track all the time. Sensors must be at least this and ``Drive.margin`` from the track's ends. [m]
    prepared : Prepared
        Result of ``prepare_passage`` with this rate, for any train, speed and path; its terms and scheme are used.
    scheme : str
        Name of the integration scheme: "radau", "gauss" or "midpoint".
    started_at : datetime or None
        Start time that the recording states.
    conditions : mapping or None
        Further conditions that the recording states.
    truth : bool
        Also return the PassageTruth.

    Returns
    -------
    Recording or (Recording, PassageTruth)
        Acceleration [m/s²] down positive; sample k is the mean over the time step around (k + 1/2) / rate.

    Raises
    ------
    SimulationError
        For a speed of zero, an unknown route, a sensor outside the track or where wheels are not yet on the modelled
        track, a wheel that leaves the track, a track prepared for another rate, an irregularity of a wheel that the
        train does not have, a passage of more than 100 km or an hour.

    Examples
    --------
    The rail carries the train: before and after, the mean contact force is the weight.

    >>> from turnout.simulate.track import uniform_track
    >>> from turnout.simulate.vehicle import car
    >>> from turnout.simulate.sensor import Sensor
    >>> sensors = [Sensor("A", 30.0), Sensor("B", 33.0)]
    >>> recording, truth = simulate_passage(
    ...     uniform_track(60.0), car(), 40.0, sensors, lead=0.2, tail=0.1, truth=True)
    >>> f"{truth.force.mean() / 1e3:.1f} kN on each of {truth.force.shape[0]} wheels"
    '54.0 kN on each of 4 wheels'
    """
    check_number("speed", speed, "m/s", above=0.0)
    check_number("lead", lead, "s")
    check_number("tail", tail, "s")
    check_number("entry", entry, "m", least=0.0)
    if roughness is not None:
        check_number("roughness", roughness, "dB")
    check_seed("seed", seed)
    if rail_seed is not None:
        check_seed("rail_seed", rail_seed)
    check_start_time(started_at)
    if direction not in ("facing", "trailing"):
        raise SimulationError(f"direction {direction!r} is neither 'facing' nor 'trailing'.")
    turnout = track if isinstance(track, TurnoutTrack) else TurnoutTrack(track, {route: ((),)})
    turnout.surfaces(route)
    prepared = prepared or prepare_passage(turnout, terms, rate, substeps, scheme, route)
    prepared.check_step(rate, substeps)
    for term in prepared.terms:
        vehicle = term.vehicle(vehicle)
    sensors, sign = tuple(sensors), 1 if direction == "facing" else -1
    if not sensors:
        raise SimulationError("a passage without sensors records nothing.")
    check_names(sensors)
    seats = [actual_sensor(sensor, prepared.terms) for sensor in sensors]
    probes = [seat.probe(prepared.track) for seat in seats]
    drive, duration = _drive(
        turnout, vehicle, speed, sensors, sign, route, roughness, seed if rail_seed is None else rail_seed, lead, tail,
        irregularities, entry,
    )  # fmt: skip
    _check_sensor_positions(seats, prepared.track, drive)
    outcome = run(prepared, duration, probes, vehicle, drive, forces=truth)
    rng = np.random.default_rng([seed, 1])
    channel_terms = [t for t in prepared.terms if t.effect_type == "channel" and "passage" in t.recording_types]
    samples = np.array(
        [
            record_signal(sensor, row, rate, rng, channel_terms, substeps)
            for sensor, row in zip(sensors, outcome.signals)
        ]
    )
    metadata = {
        "train_type": vehicle.name,
        "speed": float(speed),
        "axle_loads": tuple(float(2.0 * load) for load in vehicle.static_loads),
        "track": route,
        "direction": direction,
        **vehicle.conditions,
        **(conditions or {}),
    }
    channels = tuple(sensor.channel() for sensor in sensors)
    recording = Recording(samples, rate, channels, "passage", "", 0, started_at, metadata)
    if not truth:
        return recording
    return recording, _truth(outcome, drive, vehicle, rate, substeps)


def prepare_passage(
    track: Track | TurnoutTrack,
    terms: Sequence[Effect] = (),
    rate: float = 20e3,
    substeps: int = 1,
    scheme: str = "radau",
    route: str = "main",
) -> Prepared:
    """Factorisation of a turnout for passages along ``route`` at this rate, shared by trains, speeds and seeds.

    Parameters
    ----------
    track : Track or TurnoutTrack
        The track.
    terms : sequence of Effect
        Effects added to the base model.
    rate : float
        Sampling rate. [Hz]
    substeps : int
        Time steps per sample.
    scheme : str
        Name of the integration scheme.
    route : str
        Route of the turnout.

    Returns
    -------
    Prepared
        The factorised track.

    Raises
    ------
    SimulationError
        If the track carries no load.
    """
    base = track.track_of(route) if isinstance(track, TurnoutTrack) else track
    return prepare(base, time_step_of(rate, substeps), scheme, terms)


def _drive(
    turnout: TurnoutTrack,
    vehicle: Vehicle,
    speed: float,
    sensors: Sequence[Sensor],
    sign: int,
    route: str,
    level: float | None,
    seed: int,
    lead: float,
    tail: float,
    irregularities: Sequence[PathPart],
    entry: float,
) -> tuple[Drive, float]:
    positions = sign * np.array([sensor.place for sensor in sensors])
    length = float(vehicle.wheel_positions[-1])
    start = sign * (positions.min() - speed * lead)
    distance = float(np.ptp(positions)) + length + speed * (lead + tail)
    check_number(f"distance at {speed:g} m/s with lead and tail", distance, "m", above=0.0, below=MAX_DISTANCE)
    check_number("duration with lead and tail", distance / speed, "s", below=MAX_DURATION)
    for path_part in irregularities:
        wheel = getattr(path_part, "wheel", None)
        if wheel is not None and wheel not in range(len(vehicle.wheels)):
            raise SimulationError(
                f"{path_part!r} is on wheel {wheel!r}; {vehicle.name!r} has wheels 0 to {len(vehicle.wheels) - 1}."
            )
    track = turnout.track
    for surface_parts in turnout.surfaces(route):
        check_path((*surface_parts, *irregularities), track.start, track.end)
    roughness_parts = turnout.roughness_parts(track.start - 5.0, track.end + 5.0, seed, level)
    surfaces = tuple((*surface_parts, *roughness_parts, *irregularities) for surface_parts in turnout.surfaces(route))
    return Drive(start, speed, sign, surfaces, entry), distance / speed


def _check_sensor_positions(seats: Iterable[Sensor], track: Track, drive: Drive) -> None:
    """Reject sensors where wheels are partly on the stand-in track: they would record reduced loads."""
    if drive.entry == 0.0:
        return
    first, last = track.start + drive.margin + drive.entry, track.end - drive.margin - drive.entry
    for seat in seats:
        if not first - POSITION_TOLERANCE <= seat.place <= last + POSITION_TOLERANCE:
            raise SimulationError(
                f"sensor {seat.name!r} at {seat.place:.3f} m: wheels are wholly on the modelled track, which goes from "
                f"{track.start:.3f} m to {track.end:.3f} m, only between {first:.3f} m and {last:.3f} m. Lengthen the "
                f"track or shorten the entry of {drive.entry:g} m."
            )


def _truth(outcome: Outcome, drive: Drive, vehicle: Vehicle, rate: float, substeps: int) -> PassageTruth:
    clean = mean_of(outcome.signals, substeps)
    time = (np.arange(clean.shape[1]) + 0.5) / rate
    position = drive.start + drive.direction * (drive.speed * time - vehicle.wheel_positions[:, None])
    return PassageTruth(
        time,
        mean_of(outcome.force, substeps),
        mean_of(outcome.surface_force, substeps),
        position,
        mean_of(outcome.port_force, substeps),
        clean,
        outcome.iterations,
    )
