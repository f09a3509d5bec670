"""Identify the train of a passage for the simulation: vehicle, units, load, speed, direction and route."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnout.errors import ConfigError, SimulationError
from turnout.mismatch.turnout.campaign import LOAD_SD
from turnout.simulate import load_vehicle
from turnout.stages.common import number

PATTERN = 0.4  # m rms between measured axles and the vehicle file's: half a short bogie is 0.9
LEAST_REACH = 0.03  # least share by which the axle distances may correct the speed
LEAST_HEARD = 0.6  # share of a noted train's axles that are measured: flats and dips do not halve them
NEWTON_PER_TONNE = 9806.65
KMH = 3.6


@dataclass(frozen=True)
class TrainFound:
    """Train of a passage: ``vehicle`` of ``turnout.simulate`` called ``name``, ``speed`` [m/s], ``doubts`` in words.

    ``load_sd`` is the standard deviation of its sprung mass, as a share of it.
    """

    name: str
    vehicle: object
    speed: float
    direction: str
    route: str
    doubts: tuple[str, ...] = ()
    load_sd: float = LOAD_SD


class TrainUnknownError(Exception):
    """The train of a passage is not known, so it cannot be simulated; the message says why."""


def train_of(row: Mapping, said: Mapping, folder: Path) -> TrainFound:
    """Train from the passage stage's ``row`` and the ``notes`` in the file; vehicle files are in ``folder``.

    The recording takes precedence over the notes. TrainUnknownError if type or speed are not known, there is no vehicle
    file, or its axles do not match. A train noted with its speed is accepted even if its axles do not match, with a
    doubt: flats, dips and polygonal wheels look like axles, and the simulation shows whether it is that train.
    """
    noted = KMH * (number(said, "speed") or 0.0) or row.get("speed_listed_kmh")
    speed = row.get("speed_kmh") or noted
    names = _types(row, said)
    name = _with_a_file(names, folder)
    if not speed or not name:
        missing = "speed" if name else "type"
        raise TrainUnknownError(f"the train's {missing} is not known ({row.get('detail') or 'no axles found'})")
    believed = noted if name in _types({**row, "train_type": None}, said) else None
    vehicle, load_sd, doubts, wrong = _vehicle(name, row.get("n_axles") or None, row, said, folder, bool(believed))
    if believed and (name != names[0] or wrong):
        speed = believed  # the measured one is from axle distances of another train, or from impacts between axles
    speed = float(speed) / KMH
    try:
        speed, turned = _by_its_axles(name, vehicle, row, speed)
        more: tuple[str, ...] = (f"{name} runs the other way round",) if turned else ()
        if turned:  # its axles count from the other end: a separate train
            name, vehicle = f"{name} reversed", vehicle.turned()
    except TrainUnknownError as error:
        if not believed:
            raise
        speed, more = float(believed) / KMH, (f"{error}; taken as noted",)
        if len(axles := vehicle.wheels) == row.get("n_axles"):
            n = _axles_by_length(name, row, speed, folder)
            vehicle, load_sd, doubts, wrong = _vehicle(name, n, row, said, folder, True)
            more += (f"{len(axles)} axles heard over the length of {n}",) if n < len(axles) else ()
    direction, way = _one_of(("facing", "trailing"), "direction", row, said)
    route, road = _one_of(("main", "diverging"), "track", row, said)
    return TrainFound(name, vehicle, speed, direction, route, (*doubts, *wrong, *more, *way, *road), load_sd)


def _one_of(known, name, row, said):
    """(word, doubts): the measured word, else the noted one, else the first of ``words`` with a doubt."""
    for value in (row.get(name), said.get(name)):
        word = str(value or "").strip().lower()
        if word in known:
            return word, ()
    more = ": a place found may be its mirror image" if name == "direction" else ""
    return known[0], (f"{name} not known, {known[0]} assumed{more}",)


def _types(row, said) -> list[str]:
    """Train types: measured, listed, noted, in this order."""
    found = (row.get("train_type"), row.get("train_type_listed"), said.get("train_type"))
    return [str(name).lower().replace(" ", "_") for name in found if name and name != "unknown"]


def _with_a_file(names, folder) -> str:
    """The first type with a vehicle file, else the first type, "" without any."""
    there = [name for name in names if (Path(folder) / f"{name}.yaml").is_file()]
    return next(iter([*there, *names]), "")


def _vehicle(name, heard, row, said, folder, believed):
    """(vehicle, ``load_sd``, doubts on its load, doubts on its axles)."""
    try:
        one = load_vehicle(name, 0.0, folder)
    except (SimulationError, ConfigError) as error:
        raise TrainUnknownError(f"type {name}: {error}") from None
    n, units = len(one.wheels), max(1, round(number(said, "units") or 1.0))
    wrong: tuple[str, ...] = ()
    if heard and heard % n:
        wrong = (f"{heard} axles heard, {n} in {name}.yaml: wrong vehicle file, another train, or other sensors",)
        if not believed or heard < LEAST_HEARD * n * units:
            raise TrainUnknownError(*wrong)
    elif heard:
        units = heard // n
    share, load_sd, doubts = _load_share(name, row, said, folder, units)
    return load_vehicle(name, share, folder, units), load_sd, doubts, wrong


def _axles_by_length(name, row, speed, folder):
    """Number of axles of as many units as are as long as the measured train at ``speed`` [m/s].

    A dip adds an impact behind every axle, but does not lengthen the train.
    """
    one, two = (load_vehicle(name, 0.0, folder, units) for units in (1, 2))
    times, n, length = row["axle_times_s"], len(one.wheels), float(one.wheel_places[-1])
    more = (speed * float(np.ptp(times)) - length) / (float(two.wheel_places[-1]) - length)
    return n * int(np.clip(1 + round(more), 1, len(times) // n))


def _load_share(name, row, said, folder, units):
    """(share of the payload that gives the measured axle load, ``load_sd``, doubts).

    Without an axle load it is half the payload, uniformly distributed between empty and full.
    """
    vehicles = [load_vehicle(name, s, folder, units) for s in (0.0, 1.0)]
    empty, full = (float(np.mean(v.static_loads)) for v in vehicles)
    if full <= empty:
        return 0.0, LOAD_SD, ()
    if row.get("axle_load_t") is None:
        noted = number(said, "load_share")
        if noted is not None:
            return noted, LOAD_SD, ()
        light, heavy = (_sprung(v) for v in vehicles)
        return 0.5, (heavy - light) / (heavy + light) / np.sqrt(3.0), ("load not known, half of the payload assumed",)
    share = (0.5 * row["axle_load_t"] * NEWTON_PER_TONNE - empty) / (full - empty)
    inside = -0.3 <= share <= 1.5
    doubts = () if inside else (f"axle load {row['axle_load_t']:.1f} t lies outside the vehicle's",)
    return float(np.clip(share, 0.0, 1.5)), LOAD_SD, doubts


def _sprung(vehicle):
    """Mass of all bodies but the wheelsets [kg]."""
    return sum(b.mass for k, b in enumerate(vehicle.bodies) if k not in set(vehicle.wheels))


def _by_its_axles(name, vehicle, row, speed):
    """(speed [m/s], whether the train is reversed), from the vehicle's axle distances and the axle times.

    TrainUnknownError if the axles do not match the vehicle at any speed near ``speed``.
    """
    times = np.asarray(row.get("axle_times_s") if row.get("axle_times_s") is not None else (), dtype=float)
    places = np.asarray(vehicle.wheel_places, dtype=float)
    if times.size != places.size or times.size < 2:
        return speed, False
    reach = max(LEAST_REACH, 3.0 * float(row.get("speed_se_kmh") or 0.0) / (KMH * speed))
    ways = [_fitted(times, p, speed, reach) for p in (places, places[-1] - places[::-1])]
    off, own = min(ways)
    if off > PATTERN:
        raise TrainUnknownError(
            f"its axles lie {off:.2f} m rms off those of {name}.yaml: wrong vehicle file, or sensors elsewhere"
        )
    return own, ways[0][0] > PATTERN


def _fitted(times, places, speed, reach):
    """(rms distance [m], speed [m/s]) of axles at ``times`` [s] fitted to ``positions`` [m].

    The speed stays within the relative ``tolerance``.
    """
    t, x = times - times.mean(), places - places.mean()
    own = float(np.clip(t @ x / (t @ t), (1.0 - reach) * speed, (1.0 + reach) * speed))
    return float(np.sqrt(np.mean((own * t - x) ** 2))), own
