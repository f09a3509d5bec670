"""Simulate a hammer test: impacts of an instrumented hammer on the rail, as recordings like measured ones."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

import numpy as np

from turnout.errors import SimulationError
from turnout.records import MID_SPAN, Recording
from turnout.simulate.force_laws import PowerLaw
from turnout.simulate.links import terms_on_stretch
from turnout.simulate.number_checks import check_count, check_number, check_seed, check_start_time
from turnout.simulate.preparation import Prepared, prepare, time_step_of
from turnout.simulate.run import Drive, Pulse, run
from turnout.simulate.sensor import Sensor, actual_sensor, check_names, mean_of, record_signal
from turnout.simulate.track import Track
from turnout.simulate.turnout_track import TurnoutTrack, half_bay, stretch_of_track, supports_within
from turnout.simulate.vehicle import lone_wheels

if TYPE_CHECKING:
    from turnout.simulate.effect import Effect
    from turnout.simulate.run import Probe

# Stiffness of the plastic tip: it gives a contact of 1.2 to 1.5 ms on ballasted track, as the paper's band of 800 Hz
# needs; an estimate, sd 30 %.
PLASTIC_TIP = PowerLaw(1.2e9, 1.5, 0.05)


MAX_SPREADS = 2.0  # standard deviations that an impact is away from its position, at most

# A 5.5 kg sledge of 0.23 mV/N and 22.2 kN full scale (PCB 086D50, from memory, unverified); noise and step of a
# 24-bit converter of 5 V behind it are estimates.
LOAD_CELL = Sensor("hammer", 0.0, "hammer", "force", noise=2.0, limit=22.2e3, resolution=0.7)


@dataclass(frozen=True)
class Hammer:
    """A free mass with a nonlinear tip: ``mass`` [kg] and ``velocity`` [m/s] at contact.

    ``velocity_spread`` (relative) and ``position_spread`` [m] are the scatter between impacts. ``force`` is the channel
    of the load cell.
    """

    mass: float = 5.5
    velocity: float = 1.2
    velocity_spread: float = 0.12
    position_spread: float = 0.01
    tip: PowerLaw = PLASTIC_TIP
    force: Sensor = LOAD_CELL
    name: str = "086D50"

    def __post_init__(self) -> None:
        check_number("hammer: mass", self.mass, "kg", above=0.0)
        check_number("hammer: velocity", self.velocity, "m/s", above=0.0)
        check_number("hammer: velocity_spread", self.velocity_spread, least=0.0)
        check_number("hammer: position_spread", self.position_spread, "m", least=0.0)


class ImpactTruth(NamedTuple):
    """True values of one impact: its ``position`` [m], the hammer's ``speed`` [m/s], the ``peak_force`` [N]."""

    position: float
    speed: float
    peak_force: float


def hammer_sensors(location: float, spacing: float = 0.6) -> tuple[Sensor, Sensor]:
    """The two accelerometers of a test at ``location`` [m]: on the rail head at the sleeper and at mid-span.

    Parameters
    ----------
    location : float
        Position of the sleeper. [m]
    spacing : float
        Distance of two sleepers. [m]

    Returns
    -------
    (Sensor, Sensor)
        Both measure acceleration; their noise, limit and resolution are estimates.
    """
    head = Sensor("acc_1", location, "rail head at sleeper", noise=0.05, limit=5e3, resolution=0.01)
    return head, replace(head, name="acc_2", place=location + 0.5 * spacing, mounting=f"rail head {MID_SPAN}")


@overload
def simulate_hammer(
    track: Track | TurnoutTrack, location: float | str, *arguments: Any, truth: Literal[True], **options: Any
) -> tuple[tuple[Recording, ...], tuple[ImpactTruth, ...]]: ...


@overload
def simulate_hammer(
    track: Track | TurnoutTrack, location: float | str, *arguments: Any, truth: Literal[False] = False, **options: Any
) -> tuple[Recording, ...]: ...


def simulate_hammer(  # type: ignore[misc]  # the overloads stand for any of the options
    track: Track | TurnoutTrack,
    location: float | str,
    hammer: Hammer | None = None,
    sensors: Sequence[Sensor] | None = None,
    n_impacts: int = 10,
    terms: Sequence[Effect] = (),
    seed: int | Sequence[int] = 0,
    rate: float = 20e3,
    duration: float = 0.5,
    pretrigger: float = 0.05,
    substeps: int = 1,
    half_length: float = 30.0,
    pulse: Pulse | None = None,
    started_at: datetime | None = None,
    conditions: Mapping[str, Any] | None = None,
    prepared: Prepared | None = None,
    scheme: str = "radau",
    truth: bool = False,
    n_blows: int | None = None,
) -> tuple[Recording, ...] | tuple[tuple[Recording, ...], tuple[ImpactTruth, ...]]:
    """Recordings of a hammer test, one per impact; channel 0 is the force [N], down positive like the accelerations.

    Parameters
    ----------
    track : Track or TurnoutTrack
        Only ``half_length`` [m] on both sides of the impact is simulated, with the absorbing ends of the track.
    location : float or str
        Position of the impacts [m], or the name of a location of the turnout.
    hammer : Hammer
        Mass, tip and speed; by default 5.5 kg with a plastic tip.
    sensors : sequence of Sensor
        By default ``hammer_sensors`` at the location and half a bay of the track behind it.
    n_impacts : int
        Number of impacts, each with its own speed and position.
    terms : sequence of Effect
        Effects added to the base model; their support numbers are those of the whole track.
    seed : int
        Seed of the scatter of the impacts and of the noise.
    rate, duration, pretrigger : float
        Sampling rate [Hz], duration [s] and time before the impact [s] of each recording.
    substeps : int
        Time steps per sample.
    half_length : float
        Length of track on both sides of the impact. [m]
    pulse : callable or None
        A given force [N] of time [s] instead of the hammer's mass and tip.
    started_at : datetime or None
        Start time that the recordings state.
    conditions : mapping or None
        Further conditions that the recordings state.
    prepared : Prepared
        Result of ``prepare_hammer`` with this rate, to share one factorisation; its terms and scheme are used.
    scheme : str
        Name of the integration scheme: "radau", "gauss" or "midpoint".
    truth : bool
        Return (recordings, tuple of ``ImpactTruth``), one of each per impact.
    n_blows : int or None
        Former name of ``n_impacts``; kept for one release.

    Returns
    -------
    tuple of Recording
        Of kind "hammer". Force and acceleration are means over the same step, so their ratio has no delay.

    Raises
    ------
    SimulationError
        For a position outside the track, a track prepared for another rate, and numbers that are none of a test.

    Examples
    --------
    The impulse is between one and two times mass times speed, as the hammer bounces:

    >>> from turnout.simulate.track import uniform_track
    >>> impact = simulate_hammer(uniform_track(30.0), 15.0, Hammer(velocity_spread=0.0), n_impacts=1)[0]
    >>> bool(1.0 < impact.signal("hammer").sum() / impact.rate / (5.5 * 1.2) < 2.0)
    True
    """
    if n_blows is not None:
        warnings.warn("simulate_hammer(n_blows=...) is now n_impacts=...", DeprecationWarning, stacklevel=2)
        n_impacts = n_blows
    check_count("n_impacts", n_impacts)
    check_number("pretrigger", pretrigger, "s", least=0.0)
    check_number("duration", duration, "s", above=pretrigger)
    check_seed("seed", seed)
    check_start_time(started_at)
    hammer, impacts = hammer or Hammer(), []
    position, base = resolve_location(track, location)
    sensors = hammer_sensors(position, 2.0 * half_bay(base, position)) if sensors is None else tuple(sensors)
    prepared = prepared or prepare_hammer(track, location, terms, rate, substeps, half_length, scheme)
    prepared.check_step(rate, substeps)
    _check_impact_positions(position, hammer, prepared.track)
    rng = np.random.default_rng(seed)
    probes = [actual_sensor(sensor, prepared.terms).probe(prepared.track) for sensor in sensors]
    channels = (replace(hammer.force, place=position), *sensors)
    check_names(channels)
    channel_terms = [t for t in prepared.terms if t.effect_type == "channel" and "hammer" in t.recording_types]
    recordings = []
    for record in range(n_impacts):
        velocity = hammer.velocity * np.exp(hammer.velocity_spread * rng.normal())
        impact_position = position + hammer.position_spread * float(np.clip(rng.normal(), -MAX_SPREADS, MAX_SPREADS))
        clean = _simulate_impact(prepared, hammer, velocity, impact_position, probes, duration - pretrigger, pulse)
        impacts.append(ImpactTruth(impact_position, float(velocity), float(mean_of(clean[0], substeps).max())))
        pretrigger_zeros = np.zeros((len(channels), round(pretrigger * rate) * substeps))
        clean = np.concatenate([pretrigger_zeros, clean], axis=1)
        samples = [
            record_signal(c, row, rate, rng, channel_terms if c.quantity != "force" else (), substeps)
            for c, row in zip(channels, clean)
        ]
        metadata = {"hammer_id": hammer.name, "tip": "plastic", "location": position, **(conditions or {})}
        recordings.append(
            Recording(
                np.array(samples),
                rate,
                tuple(c.channel() for c in channels),
                "hammer",
                "",
                record,
                started_at,
                metadata,
            )
        )
    return (tuple(recordings), tuple(impacts)) if truth else tuple(recordings)


def prepare_hammer(
    track: Track | TurnoutTrack,
    location: float | str,
    terms: Sequence[Effect] = (),
    rate: float = 20e3,
    substeps: int = 1,
    half_length: float = 30.0,
    scheme: str = "radau",
) -> Prepared:
    """Factorisation for hammer tests near ``location``, a position [m] or a name.

    Parameters
    ----------
    track : Track or TurnoutTrack
        The whole track.
    location : float or str
        Position of the impacts [m], or the name of a location of the turnout.
    terms : sequence of Effect
        Effects added to the base model, with the support numbers of the whole track.
    rate : float
        Sampling rate. [Hz]
    substeps : int
        Time steps per sample.
    half_length : float
        Length of track on both sides of the impact. [m]
    scheme : str
        Name of the integration scheme.

    Returns
    -------
    Prepared
        The stretch of track around the location, factorised.

    Raises
    ------
    SimulationError
        For an unknown location, a position with less than three supports around it and a track that carries no load.
    """
    check_number("half_length", half_length, "m", above=0.0)
    dt = time_step_of(rate, substeps)
    position, base = resolve_location(track, location)
    stretch, terms = (
        stretch_of_track(base, position, half_length),
        terms_on_stretch(terms, supports_within(base, position, half_length)),
    )
    return prepare(stretch, dt, scheme, terms)


MIN_END_DISTANCE = 6.0  # m, from which the end of a track without an absorbing end changes a receptance by at most 2 %


def end_warning(track: Track, position: float, half_length: float = 30.0) -> str | None:
    """What is doubtful about a hammer test near an end of the simulated track: its waves are reflected or absorbed.

    Parameters
    ----------
    track : Track
        The whole track of the route.
    position : float
        Position of the impacts. [m]
    half_length : float
        Length of track on both sides of the impact that is simulated. [m]

    Returns
    -------
    str or None
        A sentence; None from ``MIN_END_DISTANCE`` on, and outside a longer absorbing end.

    Examples
    --------
    >>> from turnout.simulate.track import uniform_track
    >>> end_warning(uniform_track(30.0), 15.0)
    >>> print(end_warning(uniform_track(30.0), 1.2)[:68])
    the impacts at 1.2 m are 1.2 m from the end of the simulated track a
    """
    stretch = stretch_of_track(track, position, half_length)
    end = stretch.start if position - stretch.start < stretch.end - position else stretch.end
    distance, reach = abs(position - end), max(MIN_END_DISTANCE, stretch.end_length)
    if distance >= reach:
        return None
    advice = (
        "use a track file that goes on" if end in (track.start, track.end) else "increase simulate.hammer_half_length"
    )
    return (
        f"the impacts at {position:.4g} m are {distance:.2g} m from the end of the simulated track at {end:.4g} m, "
        "which changes the response by 10 to 20 % within 2 m, and by more in a strongly absorbing end; "
        f"{advice} for {reach:g} m behind them"
    )


def resolve_location(track: Track | TurnoutTrack, location: float | str) -> tuple[float, Track]:
    """Position [m] and track of a named location, or of a position on the first route.

    Parameters
    ----------
    track : Track or TurnoutTrack
        The whole track.
    location : float or str
        Position [m], or the name of a location of the turnout.

    Returns
    -------
    (float, Track)
        Position [m] and the track of its route.

    Raises
    ------
    SimulationError
        For a name that the turnout does not have, and for a position that is not a number.
    """
    base = track.track if isinstance(track, TurnoutTrack) else track
    if not isinstance(location, str):
        check_number("location", location, "m")
        return float(location), base
    if not isinstance(track, TurnoutTrack) or location not in track.locations:
        names = ", ".join(track.locations) if isinstance(track, TurnoutTrack) else ""
        title = f" of {track.name!r}" if isinstance(track, TurnoutTrack) and track.name else ""
        raise SimulationError(f"no section {location!r} in the track file{title}. Write one of {names or 'none'}.")
    position, route = track.locations[location]
    return float(position), track.track_of(route)


def _check_impact_positions(position: float, hammer: Hammer, track: Track) -> None:
    """Reject impacts of which some would miss the rail."""
    reach = MAX_SPREADS * hammer.position_spread
    if not track.start <= position - reach <= position + reach <= track.end:
        raise SimulationError(
            f"impacts at {position:.3f} m, of which some are {reach:.3f} m away, are not all on the track, which goes "
            f"from {track.start:.3f} m to {track.end:.3f} m."
        )


def _simulate_impact(
    prepared: Prepared,
    hammer: Hammer,
    velocity: float,
    position: float,
    probes: Sequence[Probe],
    duration: float,
    pulse: Pulse | None,
) -> np.ndarray:
    """(1 + n_probe, n_step) force on the rail and true signals of one impact."""
    if pulse is not None:
        outcome = run(prepared, duration, probes, pulses=[(position, pulse)])
        stages = (np.arange(outcome.time.size)[:, None] + prepared.scheme.node) * prepared.dt
        return np.vstack([pulse(stages) @ prepared.scheme.quadrature, outcome.signals])
    body = lone_wheels(hammer.mass, contact=hammer.tip, gravity=0.0)
    drive = Drive(position, 0.0, entry=0.0, free_fall=(0.0, velocity))
    outcome = run(prepared, duration, probes, body, drive)
    return np.vstack([outcome.force, outcome.signals])
