"""The train of a passage as the simulation knows it: vehicle file, number of units, load, speed, direction, route."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnout.errors import ConfigError, SimulationError
from turnout.mismatch.turnout.campaign import LOAD_SD
from turnout.simulate import load_vehicle
from turnout.stages.common import number

PATTERN = 0.4  # m rms between axles heard and those of the vehicle's file: half of a short bogie is 0.9
LEAST_REACH = 0.03  # share by which the vehicle's axle distances may correct the speed found
LEAST_HEARD = 0.6  # share of a noted train's axles: a flat or a dip adds axles and hides some, it does not halve them
NEWTON_PER_TONNE = 9806.65
KMH = 3.6


@dataclass(frozen=True)
class TrainFound:
    """``vehicle`` of ``turnout.simulate`` called ``name``, ``speed`` [m/s], ``doubts`` in words, and the standard
    deviation ``load_sd`` of its sprung mass, as a share of it."""

    name: str
    vehicle: object
    speed: float
    direction: str
    route: str
    doubts: tuple[str, ...] = ()
    load_sd: float = LOAD_SD


class TrainUnknownError(Exception):
    """Why a passage cannot be simulated, in words."""


def train_of(row: Mapping, said: Mapping, folder: Path) -> TrainFound:
    """Train from the passage stage's ``row`` and what the file itself notes (``said``), vehicles in ``folder``.

    The recording comes before the notes. TrainUnknownError where type or speed are not known, no vehicle has a file, or
    its axles are not those that were heard. A train that the notes name, with its speed, is believed against axles that
    do not fit, with a doubt: flats, dips and polygonal wheels sound like axles, and whoever simulates the passage sees
    whether it is that train.
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
        speed = believed  # the one heard is that of another train's axle distances, or of bangs between the axles
    speed = float(speed) / KMH
    try:
        speed, turned = _by_its_axles(name, vehicle, row, speed)
        more: tuple[str, ...] = (f"{name} runs the other way round",) if turned else ()
        if turned:  # its axles count from the other end: a train of its own
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
    """(word, doubts): what was heard, else noted, else the first of the ``known`` words, which is said."""
    for value in (row.get(name), said.get(name)):
        word = str(value or "").strip().lower()
        if word in known:
            return word, ()
    more = ": a place found may be its mirror image" if name == "direction" else ""
    return known[0], (f"{name} not known, {known[0]} assumed{more}",)


def _types(row, said) -> list[str]:
    """Types heard, listed and noted, in this order."""
    found = (row.get("train_type"), row.get("train_type_listed"), said.get("train_type"))
    return [str(name).lower().replace(" ", "_") for name in found if name and name != "unknown"]


def _with_a_file(names, folder) -> str:
    """The first type that has a vehicle file, else the first, "" without any."""
    there = [name for name in names if (Path(folder) / f"{name}.yaml").is_file()]
    return next(iter([*there, *names]), "")


def _vehicle(name, heard, row, said, folder, believed):
    """(vehicle, ``load_sd``, doubts on its load, what is wrong with the axles heard), the latter two in words."""
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
    """Number of axles of as many units as reach, at ``speed`` [m/s], as far as the axles heard: a dip is crossed with a
    bang behind every axle, which make the train no longer."""
    one, two = (load_vehicle(name, 0.0, folder, units) for units in (1, 2))
    times, n, length = row["axle_times_s"], len(one.wheels), float(one.wheel_places[-1])
    more = (speed * float(np.ptp(times)) - length) / (float(two.wheel_places[-1]) - length)
    return n * int(np.clip(1 + round(more), 1, len(times) // n))


def _load_share(name, row, said, folder, units):
    """(share of the payload that gives the measured axle load, ``load_sd``, doubts); where none is known half of it, as
    likely empty as full and as anything between."""
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
    """Mass of all but the wheelsets [kg]."""
    return sum(b.mass for k, b in enumerate(vehicle.bodies) if k not in set(vehicle.wheels))


def _by_its_axles(name, vehicle, row, speed):
    """(speed [m/s], whether it runs the other way round): the vehicle's own axle distances over the times heard tell
    the speed best.

    TrainUnknownError where the axles are not those of the vehicle at any speed near the one found.
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
    """(rms distance [m], speed [m/s]) of axles at ``times`` laid on ``places`` at a speed within ``reach``."""
    t, x = times - times.mean(), places - places.mean()
    own = float(np.clip(t @ x / (t @ t), (1.0 - reach) * speed, (1.0 + reach) * speed))
    return float(np.sqrt(np.mean((own * t - x) ** 2))), own
