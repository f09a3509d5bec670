"""Distinguishability of effects in a planned campaign, and the addition that gains most for its effort."""

from dataclasses import replace
from pathlib import Path

from turnout.errors import SimulationError
from turnout.mismatch.engine.distinguishability import cheapest_addition, distinguishability
from turnout.mismatch.turnout.candidates.catalogue import library
from turnout.mismatch.turnout.planned_case import Plan, PlannedCase, Train
from turnout.simulate import Sensor, load_track, load_vehicle

# Effort of one addition, in hours of two people on site.
COST = {"a second rail temperature": 8.0, "hammer tests at the sensors": 4.0, "a second speed": 1.0}


def planned_matrix(track, sensors, blows, temperatures, trains, speeds, families=None, config=None):
    """(Distinguishability, advice) of a plan: positions [m], temperatures [°C], vehicle files, speeds [km/h].

    ``config`` is the configuration folder with tracks and vehicles, by default "config". SimulationError if nothing is
    planned, or if one of ``effects`` is not a candidate in such a plan.
    """
    if not blows and not trains:
        raise SimulationError("nothing is planned: give --blows, --trains or both.")
    tracks, cars = (_folder(config, kind) for kind in ("tracks", "vehicles"))
    turnout = load_track(track, folder=tracks)
    points = tuple((x, t) for x in blows for t in temperatures)
    vehicles = {name: load_vehicle(name, folder=cars) for name in trains}
    rolling = tuple(Train(v, n, s / 3.6, t) for n, v in vehicles.items() for s in speeds for t in temperatures)
    seats = tuple(Sensor(f"S{k + 1}", x) for k, x in enumerate(sensors))
    plan = Plan(turnout, seats, points, rolling)
    matrix = _matrix(plan, families)
    wider = {name: (COST[name], _matrix(p, families)) for name, p in _additions(plan, sensors, temperatures)}
    name, resolved, _ = cheapest_addition(matrix, wider)
    if not resolved:
        return matrix, "No single addition tells more pairs apart."
    return matrix, f"Most would be added by {name}: {resolved} more pairs told apart."


def _folder(config, kind):
    """A folder of the configuration, None if it does not exist: the program's own files are then used."""
    folder = Path(config or "config") / kind
    return folder if folder.is_dir() else None


def _matrix(plan, families):
    case = PlannedCase(plan, families=families)
    if families and (unknown := sorted({*families} - {c.family for c in case.candidates})):
        known = ", ".join(sorted({c.family for c in library(case)}))
        raise SimulationError(f"no effect {unknown[0]!r} in such a campaign; there are {known}.")
    return distinguishability(case)


def _additions(plan, sensors, temperatures):
    other = max(temperatures) + 15.0
    again = tuple((x, other) for x, t in plan.blows if t == temperatures[0])
    warm = tuple(replace(t, temperature=other) for t in plan.trains if t.temperature == temperatures[0])
    yield "a second rail temperature", replace(plan, blows=plan.blows + again, trains=plan.trains + warm)
    yield "hammer tests at the sensors", replace(plan, blows=plan.blows + tuple((x, temperatures[0]) for x in sensors))
    if plan.trains:
        slower = tuple(replace(t, speed=0.7 * t.speed) for t in plan.trains)
        yield "a second speed", replace(plan, trains=plan.trains + slower)
