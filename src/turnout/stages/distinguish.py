"""Distinguishability of effects in a planned campaign, and the addition that gains most for its effort."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

from turnout.constants import KMH
from turnout.errors import SimulationError
from turnout.mismatch.engine.distinguishability import Distinguishability, best_addition, distinguishability
from turnout.mismatch.turnout.candidates.catalogue import list_candidates
from turnout.mismatch.turnout.planned_case import Plan, PlannedCase, Train
from turnout.mismatch.turnout.unproven_panels import reservation
from turnout.simulate import Sensor, load_track, load_vehicle
from turnout.simulate.parameters import track_path
from turnout.stages.track_files import files_of_track, files_of_vehicle

# Effort of one addition, in hours of two people on site.
EFFORT_HOURS = {"a second rail temperature": 8.0, "hammer tests at the sensors": 4.0, "a second speed": 1.0}


def planned_matrix(
    track: str,
    sensors: Sequence[float],
    impact_positions: Sequence[float],
    temperatures: Sequence[float],
    trains: Sequence[str],
    speeds: Sequence[float],
    effects: Collection[str] | None = None,
    config: str | Path | None = None,
) -> tuple[Distinguishability, str]:
    """Which effects a planned campaign tells apart, and what to add to it.

    Parameters
    ----------
    track : str
        Name of the track, or path of its file.
    sensors : sequence of float
        Positions of the accelerometers. [m]
    impact_positions : sequence of float
        Positions of the hammer impacts. [m]
    temperatures : sequence of float
        Rail temperatures at which hammer tests and passages are recorded. [°C]
    trains : sequence of str
        Names of the vehicles that pass, or paths of their files.
    speeds : sequence of float
        Speeds of every train. [km/h]
    effects : collection of str or None
        Effects to which the comparison is restricted; None: all that the plan can concern.
    config : str, Path or None
        Folder of the configuration with tracks and vehicles; None: "config".

    Returns
    -------
    tuple of (Distinguishability, str)
        The comparison of each pair of effects, and a sentence on the addition that gains most for its effort.

    Raises
    ------
    SimulationError
        Nothing is planned, a position is outside the track, or one of ``effects`` is no candidate in such a plan.
    """
    if not impact_positions and not trains:
        raise SimulationError("nothing is planned: give --impact-positions, --vehicles or both.")
    track_folder, vehicle_folder = (_folder(config, subfolder) for subfolder in ("tracks", "vehicles"))
    turnout = load_track(track, folder=track_folder)
    first, last = turnout.track.start, turnout.track.end
    for x in (*sensors, *impact_positions):
        if not first <= x <= last:
            problem = f"the position {x:g} m of a sensor or impact is outside the track {turnout.name!r}"
            raise SimulationError(f"{problem}. Write positions from {first:g} to {last:g} m.")
    impacts = tuple((x, t) for x in impact_positions for t in temperatures)
    vehicles = {name: load_vehicle(name, folder=vehicle_folder) for name in trains}
    passages = tuple(Train(v, n, s / KMH, t) for n, v in vehicles.items() for s in speeds for t in temperatures)
    placed_sensors = tuple(Sensor(f"S{k + 1}", x) for k, x in enumerate(sensors))
    plan = Plan(turnout, placed_sensors, impacts, passages)
    matrix = _matrix(plan, effects)
    extended = {name: (EFFORT_HOURS[name], _matrix(p, effects)) for name, p in _additions(plan, sensors, temperatures)}
    name, resolved, _ = best_addition(matrix, extended)
    advice = "No single addition distinguishes more pairs."
    if resolved:
        advice = f"Most would be added by {name}: {resolved} more pairs distinguished."
    return matrix, " ".join(filter(None, [advice, reservation(turnout)]))


def planned_files(track: str, vehicles: Sequence[str], config: str | Path | None = None) -> list[Path]:
    """Track and vehicle files of a plan, with those that they extend or are composed of.

    Parameters
    ----------
    track : str
        Name of the track, or path of its file.
    vehicles : sequence of str
        Names of the vehicles, or paths of their files.
    config : str, Path or None
        Folder of the configuration; None: "config".

    Returns
    -------
    list of Path

    Raises
    ------
    SimulationError
        There is no such file.
    """
    track_folder, vehicle_folder = (_folder(config, subfolder) for subfolder in ("tracks", "vehicles"))
    files = (files_of_vehicle(vehicle, vehicle_folder) for vehicle in vehicles)
    return [*files_of_track(track_path(track, track_folder)), *chain.from_iterable(files)]


def _folder(config: str | Path | None, subfolder: str) -> Path | None:
    """A folder of the configuration, None if it does not exist: the program's own files are then used."""
    folder = Path(config or "config") / subfolder
    return folder if folder.is_dir() else None


def _matrix(plan: Plan, effects: Collection[str] | None) -> Distinguishability:
    case = PlannedCase(plan, families=effects)
    if effects and (unknown := sorted({*effects} - {c.family for c in case.candidates})):
        names = ", ".join(sorted({c.family for c in list_candidates(case.data)}))
        raise SimulationError(f"no effect {unknown[0]!r} in such a campaign; there are {names}.")
    return distinguishability(case)


def _additions(plan: Plan, sensors: Sequence[float], temperatures: Sequence[float]) -> Iterator[tuple[str, Plan]]:
    second_temperature = max(temperatures) + 15.0
    repeated_impacts = tuple((x, second_temperature) for x, t in plan.hammer_points if t == temperatures[0])
    warmer_trains = tuple(
        replace(t, temperature=second_temperature) for t in plan.trains if t.temperature == temperatures[0]
    )
    yield (
        "a second rail temperature",
        replace(plan, hammer_points=plan.hammer_points + repeated_impacts, trains=plan.trains + warmer_trains),
    )
    yield (
        "hammer tests at the sensors",
        replace(plan, hammer_points=plan.hammer_points + tuple((x, temperatures[0]) for x in sensors)),
    )
    if plan.trains:
        slower_trains = tuple(replace(t, speed=0.7 * t.speed) for t in plan.trains)
        yield "a second speed", replace(plan, trains=plan.trains + slower_trains)
