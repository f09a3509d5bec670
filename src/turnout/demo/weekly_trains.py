"""Recordings of a logger that keeps one train of every weekday at one turnout for more than a year.

Only a few trains are simulated, each with its whole track and all wheels. A recorded train is a mixture of four of
them, linear in its load and wheels, in the depth of a dip in the rail and in the state of the track. So hundreds of
trains cost as much as thirty. The rail temperature is recorded, but does not change the track here.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias
from zlib import crc32

import numpy as np
from scipy import ndimage

from turnout.constants import GRAVITY, KMH
from turnout.demo.passages import passage_sensor, vehicle_of
from turnout.demo.scenario import MILLIMETRE, rail_temperature
from turnout.demo.track_state import track_on
from turnout.files import whole_file
from turnout.readers.writing import write
from turnout.records import Recording
from turnout.simulate.passage import simulate_passage
from turnout.simulate.roughness import roughness
from turnout.simulate.sensor import Sensor, record_signal
from turnout.simulate.wheel_path import Kink, Sampled

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from numpy.typing import ArrayLike

    from turnout.demo.scenario import TurnoutScenario
    from turnout.simulate.vehicle import Vehicle

N_WEEK = 70  # a year that trains the charts, and the weeks in which the rail gets worse
SIMULATED_RATE, RATE = 10e3, 5e3  # Hz
LEAD, TAIL = 0.6, 0.5  # s
LIGHT, LOADED = 0.1, 0.9  # payload shares that are simulated
SPEED_SPREAD = 0.01  # trains keep the speed of the timetable within this
WHEEL_LEVEL = 0.0  # dB above the limit curve of ISO 3095, wheels with disc brakes
DIP_DEPTH = 1.0 * MILLIMETRE  # that is simulated; depths below it are interpolated
LISTED_SHARE = 0.9  # of the trains that the train data have
DIVERGING_WEEKS = 4  # one train on the diverging track every so many weeks


@dataclass(frozen=True)
class TrainKind:
    """A train of the timetable: vehicle, name in the train data, speed [km/h] and track."""

    vehicle: str
    name: str
    speed_kmh: float
    track: str = "main"


KINDS = (
    TrainKind("ic3", "IC3", 160.0),
    TrainKind("ic3", "IC3", 140.0),
    TrainKind("ic3", "IC3", 120.0),
    TrainKind("intercity", "intercity", 160.0),
    TrainKind("locomotive", "locomotive", 120.0),
    TrainKind("ic3", "IC3", 60.0, "diverging"),
)
WEEKDAYS = ((0,), (1,), (0, 3), (2, 4), (0,))  # kinds from Monday to Friday, in turn
RUNS = ("light", "loaded", "dip", "later")

# scenario, section -> (position [m], track), train, run, first day, last day
RunJob: TypeAlias = "tuple[TurnoutScenario, dict[str, tuple[float, str]], TrainKind, str, date, date]"


@dataclass(frozen=True)
class OwnRoughness:
    """Roughness of one wheel [m] as a part of its path."""

    wheel: int
    profile: Sampled

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        x = np.asarray(x, dtype=float)
        return self.profile(x) if wheel == self.wheel else np.zeros_like(x)


def weekly_jobs(
    scenario: TurnoutScenario, positions: dict[str, tuple[float, str]], last_day: date, n_week: int = N_WEEK
) -> list[RunJob]:
    """Simulations behind the trains of one turnout.

    Parameters
    ----------
    scenario : TurnoutScenario
        Changes of the turnout over time.
    positions : dict
        Position [m] and track of each section.
    last_day : date
        Day of the last train.
    n_week : int
        Number of weeks.

    Returns
    -------
    list of tuple
        A job for ``simulate_run`` per kind of train and run.
    """
    first_day = last_day - timedelta(weeks=n_week)
    return [(scenario, positions, train, run, first_day, last_day) for train in KINDS for run in RUNS]


def simulate_run(job: RunJob) -> np.ndarray:
    """Acceleration of the rail at every section while a train passes, without noise.

    Parameters
    ----------
    job : tuple
        From ``weekly_jobs``.

    Returns
    -------
    (n_section, n_sample) array of float
        At ``SIMULATED_RATE``. [m/s²]
    """
    scenario, positions, train, run, first_day, last_day = job
    turnout = track_on(scenario, last_day if run == "later" else first_day, 15)
    vehicle = vehicle_of(train.vehicle, LOADED if run == "loaded" else LIGHT)
    parts: list = _wheels(vehicle, turnout.track.start, turnout.track.end, 2 if run == "loaded" else 1)
    if run == "dip" and scenario.weld is not None and scenario.weld.track in ("both", train.track):
        parts.append(Kink(scenario.weld.position, DIP_DEPTH, scenario.weld.length))
    recording = simulate_passage(
        turnout,
        vehicle,
        train.speed_kmh / KMH,
        [_ideal_sensor(label, place, side, train.track) for label, (place, side) in positions.items()],
        route=train.track,
        rail_seed=crc32(f"{scenario.turnout} {train.track}".encode()),
        rate=SIMULATED_RATE,
        lead=LEAD,
        tail=TAIL,
        irregularities=parts,
    )
    return recording.samples.astype(np.float32)


def write_weekly_trains(
    raw: Path | str,
    scenario: TurnoutScenario,
    positions: dict[str, tuple[float, str]],
    runs: Sequence[np.ndarray],
    seed: int,
    last_day: date,
    n_week: int = N_WEEK,
) -> list[dict[str, Any]]:
    """Write the recordings of all weeks and trains.csv, and return what is true of each train.

    Parameters
    ----------
    raw : path
        Raw root.
    scenario : TurnoutScenario
        Changes of the turnout over time.
    positions : dict
        Position [m] and track of each section.
    runs : sequence of (n_section, n_sample) arrays of float
        Results of ``simulate_run`` in the order of ``weekly_jobs``. [m/s²]
    seed : int
        The same seed gives the same trains.
    last_day : date
        Day of the last train.
    n_week : int
        Number of weeks.

    Returns
    -------
    list of dict
        Train, speed, load, track, temperature, depth of the dip and file of every passage.
    """
    rng = np.random.default_rng([seed, 78, crc32(scenario.turnout.encode())])
    by_kind = {train: np.array(runs[k * len(RUNS) : (k + 1) * len(RUNS)]) for k, train in enumerate(KINDS)}
    folder = Path(raw) / scenario.turnout
    (folder / "passages").mkdir(parents=True, exist_ok=True)
    first_day = last_day - timedelta(weeks=n_week)
    truths, listed = [], []
    for day, train in timetable(first_day, n_week):
        truth = _draw_train(scenario, train, day, rng)
        progress = (day - first_day) / (last_day - first_day)
        _write_train(folder, positions, truth, by_kind[train], train, progress, rng)
        truths.append(truth)
        if rng.uniform() < LISTED_SHARE:
            moment = datetime.fromisoformat(truth["started_at_utc"]) + timedelta(seconds=int(rng.integers(-20, 20)))
            listed.append({
                "passed_at_utc": moment.isoformat(), "train_type": train.name, "track": train.track,
                "speed_kmh": f"{truth['speed_kmh'] * rng.normal(1.0, 0.01):.0f}",
                "axle_load_t": f"{truth['axle_load_t'] * rng.normal(1.0, 0.02):.1f}",
            })  # fmt: skip
    with whole_file(folder / "trains.csv") as path, open(path, "w", newline="") as file:
        columns = ["passed_at_utc", "train_type", "speed_kmh", "axle_load_t", "track"]
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(listed)
    return truths


def timetable(first_day: date, n_week: int) -> list[tuple[date, TrainKind]]:
    """Day and kind of every recorded train: one from Monday to Friday, and some Saturdays one that diverges.

    Parameters
    ----------
    first_day : date
        Weeks begin with the Monday at or after this day.
    n_week : int
        Number of weeks.

    Returns
    -------
    list of (date, TrainKind)
        In order of time.

    Examples
    --------
    >>> trains = timetable(date(2025, 3, 22), 4)
    >>> len(trains), trains[0][0].isoformat(), trains[-1][1].track
    (21, '2025-03-24', 'diverging')
    """
    monday = first_day + timedelta(days=-first_day.weekday() % 7)
    trains = []
    for week in range(n_week):
        start = monday + timedelta(weeks=week)
        for weekday, kinds in enumerate(WEEKDAYS):
            trains.append((start + timedelta(days=weekday), KINDS[kinds[week % len(kinds)]]))
        if week % DIVERGING_WEEKS == DIVERGING_WEEKS - 1:
            trains.append((start + timedelta(days=5), KINDS[-1]))
    return trains


def _draw_train(scenario: TurnoutScenario, train: TrainKind, day: date, rng: np.random.Generator) -> dict[str, Any]:
    """The truth about one train."""
    load = float(rng.uniform(0.0, 1.0))  # position between the two simulated loads
    moment = datetime(day.year, day.month, day.day) + timedelta(hours=float(rng.uniform(6, 20)))
    light, loaded = (vehicle_of(train.vehicle, share).static_loads for share in (LIGHT, LOADED))
    loads = light + load * (loaded - light)
    return {
        "started_at_utc": moment.replace(microsecond=0).isoformat(),
        "vehicle": train.name,
        "speed_kmh": train.speed_kmh * (1.0 + SPEED_SPREAD * float(rng.uniform(-1.0, 1.0))),
        "load_share": load,
        "track": train.track,
        "direction": "facing",
        "rail_temperature_c": rail_temperature(day, rng),
        "dip_m": scenario.weld.depth_on(day) if scenario.weld is not None else 0.0,
        "n_axles": len(loads),
        "axle_load_t": float(np.mean(2.0 * loads)) / (1e3 * GRAVITY),
    }


def _write_train(
    folder: Path,
    positions: dict[str, tuple[float, str]],
    truth: dict[str, Any],
    runs: np.ndarray,
    train: TrainKind,
    progress: float,
    rng: np.random.Generator,
) -> None:
    """Mix the simulated trains, stretch them to the speed of this one, and write what the sensors record."""
    light, loaded, dip, later = runs
    mixed = light + truth["load_share"] * (loaded - light) + progress * (later - light)
    mixed = mixed + truth["dip_m"] / DIP_DEPTH * (dip - light)
    ratio = truth["speed_kmh"] / train.speed_kmh
    n = int(mixed.shape[1] / ratio * RATE / SIMULATED_RATE)
    at = np.arange(n) * ratio * SIMULATED_RATE / RATE
    samples, channels = [], []
    for (label, (place, side)), row in zip(positions.items(), mixed):
        sensor = replace(passage_sensor(label, place, side, train.track), gain=1.0, cutoff=None)
        stretched = ndimage.map_coordinates(row.astype(float), [at], order=3, mode="nearest")
        samples.append(record_signal(sensor, stretched, RATE, rng))
        channels.append(sensor.channel())
    moment = datetime.fromisoformat(truth["started_at_utc"])
    truth["file"] = moment.strftime("%Y%m%dT%H%M%SZ.h5")
    conditions = {"rail_temperature": round(truth["rail_temperature_c"], 1)}
    recording = Recording(np.array(samples), RATE, tuple(channels), "passage", "", 0, moment, conditions)
    write([recording], folder / "passages" / truth["file"], "hdf5", single=True)


def _ideal_sensor(label: str, place: float, side: str, route: str) -> Sensor:
    """A sensor without noise whose filter keeps what ``RATE`` can hold."""
    gain = passage_sensor(label, place, side, route).gain
    return Sensor(label, place, "rail web", gain=gain, cutoff=0.4 * RATE / SIMULATED_RATE)


def _wheels(vehicle: Vehicle, start: float, end: float, seed: int) -> list[OwnRoughness]:
    """Roughness of every wheel of a train."""
    wheels = range(len(vehicle.wheels))
    return [OwnRoughness(k, roughness(start - 5.0, end + 5.0, [seed, k], WHEEL_LEVEL)) for k in wheels]
