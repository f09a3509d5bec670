"""Identify the train of a passage for the simulation: vehicle, units, load, speed, direction and route."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import KMH, NEWTON_PER_TONNE
from turnout.errors import ConfigError, SimulationError
from turnout.mismatch.turnout.priors import TRACK
from turnout.passage.timetable import OtherPassage, listed_for, listed_trains
from turnout.simulate import load_vehicle
from turnout.simulate.vehicle import Vehicle
from turnout.stages.neighbouring_files import passages_beside
from turnout.stages.recording_notes import noted_number

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from turnout.config import TurnoutConfig
    from turnout.records import Recording

MAX_AXLE_RMS = 0.4  # m rms between measured axles and the vehicle file's: half a short bogie is 0.9
MIN_SPEED_TOLERANCE = 0.03  # least share by which the axle distances may correct the speed
MIN_AXLE_SHARE = 0.6  # share of a noted train's axles that are measured: flats and dips do not halve them


@dataclass(frozen=True)
class IdentifiedTrain:
    """Train of a passage: ``vehicle`` of ``turnout.simulate`` called ``name``, ``speed`` [m/s], ``doubts`` in words.

    ``route_doubts`` are those on its route: they do not matter on a track with one route. ``load_sd`` is the standard
    deviation of its sprung mass, as a share of it.
    """

    name: str
    vehicle: Vehicle
    speed: float
    direction: str
    route: str
    doubts: tuple[str, ...] = ()
    load_sd: float = TRACK.load_sd
    route_doubts: tuple[str, ...] = ()


class TrainUnknownError(Exception):
    """The train of a passage is not known, so it cannot be simulated; the message says why.

    ``train`` is the type whose vehicle file the recorded axles contradict, "" for other reasons.
    """

    def __init__(self, message: str, train: str = "") -> None:
        super().__init__(message)
        self.train = train


def train_of(row: Mapping, notes: Mapping, folder: Path) -> IdentifiedTrain:
    """Train of a passage, from the recording and the notes in its file.

    The recording takes precedence over the notes, unless the passage stage doubts the axles that it counted. A train
    noted with its speed is accepted even if its axles do not match, with a doubt: flats, dips and polygonal wheels look
    like axles, and the simulation shows whether it is that train.

    Parameters
    ----------
    row : mapping
        Row of the passage stage.
    notes : mapping
        Conditions noted in the file.
    folder : Path
        Folder of the vehicle files.

    Returns
    -------
    IdentifiedTrain

    Raises
    ------
    TrainUnknownError
        The type or the speed of the train is not known, or there is no file of its type.
    """
    noted_speed = KMH * (noted_number(notes, "speed") or 0.0) or row.get("speed_listed_kmh")
    recorded, min_axle_share = row, MIN_AXLE_SHARE
    is_taken_as_noted = _is_uncertain(row) and noted_speed and _type_names({**row, "train_type": None}, notes)
    if is_taken_as_noted:
        row, min_axle_share = {**row, "train_type": None, "speed_kmh": None, "axle_times_s": None}, 0.0
    speed = row.get("speed_kmh") or noted_speed
    type_names = _type_names(row, notes)
    type_name = _with_a_file(type_names, folder)
    if not speed or not type_name:
        missing_quantity = "speed" if type_name else "type"
        raise TrainUnknownError(
            f"the train's {missing_quantity} is not known ({row.get('detail') or 'no axles found'})"
        )
    trusted_speed = noted_speed if type_name in _type_names({**row, "train_type": None}, notes) else None
    n_axles, count_doubts = row.get("n_axles") or None, tuple[str, ...]()
    if is_taken_as_noted and n_axles:
        n_axles, count_doubts = _likely_axles(type_name, recorded, notes, float(speed) / KMH, folder)
    vehicle, load_sd, doubts, axle_doubts = _loaded_vehicle(
        type_name, n_axles, row, notes, folder, min_axle_share if trusted_speed else np.inf
    )
    if trusted_speed and (type_name != type_names[0] or axle_doubts):
        speed = trusted_speed  # the measured one is from axle distances of another train, or from impacts between axles
    speed = float(speed) / KMH
    try:
        speed, is_reversed = speed_from_axles(type_name, vehicle, row, speed)
        further_doubts: tuple[str, ...] = (f"{type_name} runs the other way round",) if is_reversed else ()
        if is_reversed:  # its axles count from the other end: a separate train
            type_name, vehicle = f"{type_name} reversed", vehicle.reverse()
    except TrainUnknownError as error:
        if not trusted_speed:
            raise
        speed, further_doubts = float(trusted_speed) / KMH, (f"{error}; taken as noted",)
        if len(vehicle.wheels) == row.get("n_axles"):
            n, count_doubts = _likely_axles(type_name, row, notes, speed, folder)
            vehicle, load_sd, doubts, axle_doubts = _loaded_vehicle(type_name, n, row, notes, folder, MIN_AXLE_SHARE)
    direction, direction_doubts = _heading(("facing", "trailing"), "direction", row, notes)
    route, route_doubts = _heading(("main", "diverging"), "track", row, notes)
    return IdentifiedTrain(
        type_name,
        vehicle,
        speed,
        direction,
        route,
        (*doubts, *axle_doubts, *count_doubts, *further_doubts, *direction_doubts),
        load_sd,
        route_doubts,
    )


def train_notes(
    row: Mapping[str, Any],
    rows_beside: Sequence[Mapping[str, Any]],
    recording: Recording,
    turnout: TurnoutConfig,
    path: str,
    raw_root: str | Path,
) -> Mapping[str, Any]:
    """Notes in the file, with the number of axles of the train data where the file has none and the type agrees.

    Parameters
    ----------
    row : mapping
        Row of the passage stage, {} without one.
    rows_beside : sequence of mapping
        Those of the other trains in the file.
    recording : Recording
        The train.
    turnout : TurnoutConfig
        With its rows of trains.csv.
    path : str
        Path of the file below ``raw_root``.
    raw_root : str or Path
        Folder that the path starts from.

    Returns
    -------
    mapping
        The conditions of the recording, with ``n_axles`` in addition.
    """
    notes, trains = recording.conditions, listed_trains(turnout.trains)[0]
    moment = _moment(row) or _moment({"passed_at_utc": recording.started_at})
    if moment is None or not trains:
        return notes
    tolerance = turnout.settings["passage"].train_data_tolerance
    rivals = [OtherPassage(at, n) for r in rows_beside if (n := r.get("n_axles")) and (at := _moment(r))]
    rivals += [] if rows_beside else passages_beside(path, raw_root, moment, tolerance)
    listed = listed_for(moment, None, trains, tolerance, rivals)
    if listed is None or listed.n_axles is None or notes.get("train_type") not in (None, listed.train_type):
        return notes
    return {"n_axles": listed.n_axles, **notes}


def _moment(row: Mapping[str, Any]) -> datetime | None:
    """When the train of a row passed, naive UTC."""
    value = row.get("passed_at_utc")
    return None if value is None else datetime.fromisoformat(str(value)).replace(tzinfo=None)


def _is_uncertain(row: Mapping[str, Any]) -> bool:
    """Whether the passage stage doubts the axles of this train."""
    return "axles_uncertain" in (row.get("reason_codes") or ())


def _heading(
    words: tuple[str, str], name: str, row: Mapping[str, Any], notes: Mapping[str, Any]
) -> tuple[str, tuple[str, ...]]:
    """(word, doubts): the measured word, else the noted one, else the first of ``words`` with a doubt."""
    for value in (row.get(name), notes.get(name)):
        word = str(value or "").strip().lower()
        if word in words:
            return word, ()
    consequence = ": a place found may be its mirror image" if name == "direction" else ""
    return words[0], (f"{name} not known, {words[0]} assumed{consequence}",)


def _type_names(row: Mapping[str, Any], notes: Mapping[str, Any]) -> list[str]:
    """Train types: measured, listed, noted, in this order."""
    sources = (row.get("train_type"), row.get("train_type_listed"), notes.get("train_type"))
    return [str(name).lower().replace(" ", "_") for name in sources if name and name != "unknown"]


def _with_a_file(names: Sequence[str], folder: Path) -> str:
    """The first type with a vehicle file, else the first type, "" without any."""
    available = [name for name in names if (Path(folder) / f"{name}.yaml").is_file()]
    return next(iter([*available, *names]), "")


def _loaded_vehicle(
    name: str,
    n_axles: int | None,
    row: Mapping[str, Any],
    notes: Mapping[str, Any],
    folder: Path,
    min_axle_share: float,
) -> tuple[Vehicle, float, tuple[str, ...], tuple[str, ...]]:
    """(vehicle, ``load_sd``, doubts on its load, doubts on its axles).

    TrainUnknownError if the axles are no multiple of the vehicle's, and fewer than ``min_axle_share`` of them.
    """
    try:
        single_unit = load_vehicle(name, 0.0, folder)
    except (SimulationError, ConfigError) as error:
        raise TrainUnknownError(f"type {name}: {error}") from None
    n = len(single_unit.wheels)
    units = _noted_units(notes, n) or 1
    axle_doubts: tuple[str, ...] = ()
    if n_axles and n_axles % n:
        axle_doubts = (
            f"{n_axles} axles recorded, {n} in {name}.yaml: wrong vehicle file, another train, or other sensors",
        )
        if n_axles < min_axle_share * n * units:
            raise TrainUnknownError(axle_doubts[0], name)
    elif n_axles:
        units = n_axles // n
    share, load_sd, doubts = _load_share(name, row, notes, folder, units)
    return load_vehicle(name, share, folder, units), load_sd, doubts, axle_doubts


def _noted_units(notes: Mapping[str, Any], n_axles_of_unit: int) -> int | None:
    """Number of units that is noted, by itself or by the number of axles; None if neither is, or axles do not divide.

    >>> _noted_units({"n_units": 2}, 4), _noted_units({"n_axles": 8}, 4), _noted_units({"n_axles": 6}, 4)
    (2, 2, None)
    """
    units, axles = noted_number(notes, "n_units") or noted_number(notes, "units"), noted_number(notes, "n_axles")
    if units:
        return max(1, round(units))
    return round(axles / n_axles_of_unit) if axles and axles % n_axles_of_unit == 0 else None


def _likely_axles(
    name: str, row: Mapping[str, Any], notes: Mapping[str, Any], speed: float, folder: Path
) -> tuple[int, tuple[str, ...]]:
    """(number of axles of a train whose recorded ones are in doubt, the doubt in words if it is another number).

    It is the noted number, else that of the train's length, else that of the recording.
    """
    recorded = row["n_axles"]
    try:
        n = len(load_vehicle(name, 0.0, folder).wheels)
    except (SimulationError, ConfigError):
        return recorded, ()
    n_axles, source = recorded, ""
    if units := _noted_units(notes, n):
        n_axles, source = units * n, "as noted"
    elif recorded % n == 0 and row.get("axle_times_s") is not None:
        n_axles, source = _axles_by_length(name, row, speed, folder), "by its length"
    return n_axles, (f"{recorded} axles recorded, {n_axles} assumed {source}",) if n_axles != recorded else ()


def _axles_by_length(name: str, row: Mapping[str, Any], speed: float, folder: Path) -> int:
    """Number of axles of as many units as are as long as the measured train at ``speed`` [m/s].

    A dip adds an impact behind every axle, but does not lengthen the train.
    """
    one, two = (load_vehicle(name, 0.0, folder, units) for units in (1, 2))
    times, n, length = row["axle_times_s"], len(one.wheels), float(one.wheel_positions[-1])
    extra_units = (speed * float(np.ptp(times)) - length) / (float(two.wheel_positions[-1]) - length)
    return n * int(np.clip(1 + round(extra_units), 1, len(times) // n))


def _load_share(
    name: str, row: Mapping[str, Any], notes: Mapping[str, Any], folder: Path, units: int
) -> tuple[float, float, tuple[str, ...]]:
    """(share of the payload that gives the measured axle load, ``load_sd``, doubts).

    Without an axle load it is half the payload, uniformly distributed between empty and full.
    """
    vehicles = [load_vehicle(name, s, folder, units) for s in (0.0, 1.0)]
    empty, full = (float(np.mean(v.static_loads)) for v in vehicles)
    if full <= empty:
        return 0.0, TRACK.load_sd, ()
    if row.get("axle_load_t") is None:
        noted_share = noted_number(notes, "load_share")
        if noted_share is not None:
            return noted_share, TRACK.load_sd, ()
        light, heavy = (_sprung_mass(v) for v in vehicles)
        return 0.5, (heavy - light) / (heavy + light) / np.sqrt(3.0), ("load not known, half of the payload assumed",)
    share = (0.5 * row["axle_load_t"] * NEWTON_PER_TONNE - empty) / (full - empty)
    is_plausible = -0.3 <= share <= 1.5
    doubts = () if is_plausible else (f"axle load {row['axle_load_t']:.1f} t lies outside the vehicle's",)
    return float(np.clip(share, 0.0, 1.5)), TRACK.load_sd, doubts


def _sprung_mass(vehicle: Vehicle) -> float:
    """Mass of all bodies but the wheelsets [kg]."""
    return sum(b.mass for k, b in enumerate(vehicle.bodies) if k not in set(vehicle.wheels))


def speed_from_axles(name: str, vehicle: Vehicle, row: Mapping[str, Any], speed: float) -> tuple[float, bool]:
    """Speed and order of the axles of a train, from the vehicle's axle distances and the axle times.

    Parameters
    ----------
    name : str
        Name of the vehicle file.
    vehicle : Vehicle
    row : mapping
        Of the passage: ``axle_times_s`` (n_axle,) [s] and ``speed_se_kmh`` [km/h], either of which may be None.
    speed : float
        Speed that was found. [m/s]

    Returns
    -------
    speed : float
        [m/s]
    is_reversed : bool
        Whether the last axle of the vehicle file comes first.

    Raises
    ------
    TrainUnknownError
        The axles do not match the vehicle at any speed near ``speed``.
    """
    times = np.asarray(row.get("axle_times_s") if row.get("axle_times_s") is not None else (), dtype=float)
    positions = np.asarray(vehicle.wheel_positions, dtype=float)
    if times.size != positions.size or times.size < 2:
        return speed, False
    tolerance = max(MIN_SPEED_TOLERANCE, 3.0 * float(row.get("speed_se_kmh") or 0.0) / (KMH * speed))
    fits = [_fit_speed(times, p, speed, tolerance) for p in (positions, positions[-1] - positions[::-1])]
    distance, fitted_speed = min(fits)
    if distance > MAX_AXLE_RMS:
        raise TrainUnknownError(
            f"its axles lie {distance:.2f} m rms off those of {name}.yaml: wrong vehicle file, or sensors elsewhere",
            name,
        )
    return fitted_speed, fits[0][0] > MAX_AXLE_RMS


def _fit_speed(times: np.ndarray, positions: np.ndarray, speed: float, tolerance: float) -> tuple[float, float]:
    """(rms distance [m], speed [m/s]) of axles at ``times`` [s] fitted to ``positions`` [m].

    The speed stays within the relative ``tolerance``.
    """
    t, x = times - times.mean(), positions - positions.mean()
    fitted_speed = float(np.clip(t @ x / (t @ t), (1.0 - tolerance) * speed, (1.0 + tolerance) * speed))
    return float(np.sqrt(np.mean((fitted_speed * t - x) ** 2))), fitted_speed
