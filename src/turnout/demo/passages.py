"""Simulate the train passages of the demonstration fleet: several trains, speeds and loads."""

from __future__ import annotations

import csv
from dataclasses import replace
from datetime import datetime, timedelta
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias
from zlib import crc32

import numpy as np

from turnout.constants import GRAVITY, KMH
from turnout.demo.scenario import gap_under, rail_temperature
from turnout.demo.track_state import track_on
from turnout.files import whole_file
from turnout.physics.hanging_sleeper import HangingSleeper
from turnout.readers.writing import write
from turnout.simulate.parameters import load_vehicle
from turnout.simulate.passage import simulate_passage
from turnout.simulate.sensor import Sensor

if TYPE_CHECKING:
    from datetime import date
    from typing import Any

    from turnout.config import TurnoutConfig
    from turnout.demo.scenario import TurnoutScenario
    from turnout.simulate.turnout_track import TurnoutTrack
    from turnout.simulate.vehicle import Vehicle

# (vehicle, name in the train data, lowest and highest speed [km/h], share of the traffic)
TRAFFIC = (
    ("ic3", "IC3", 100.0, 170.0, 0.5),
    ("intercity", "intercity", 110.0, 180.0, 0.25),
    ("freight", "freight", 60.0, 100.0, 0.15),
    ("locomotive", "locomotive", 60.0, 120.0, 0.10),
)
DIVERGING_SHARE, DIVERGING_SPEED = 0.2, 60.0
# Share of the vibration that reaches a sensor on the other track through the bearers.
NEIGHBOUR_GAIN = 0.02
NOISE, LIMIT = 0.3, 5_000.0

# raw folder, scenario, section -> (position [m], track), vehicle, truth, seed
PassageJob: TypeAlias = "tuple[str, TurnoutScenario, dict[str, tuple[float, str]], str, dict[str, Any], list[int]]"


def make_passages(
    raw: Path | str, scenario: TurnoutScenario, turnout: TurnoutConfig, seed: int, n_passage: int, last_day: date
) -> list[PassageJob]:
    """Choose the trains of the weeks before a day, and write trains.csv of the turnout.

    Parameters
    ----------
    raw : path
        Raw root.
    scenario : TurnoutScenario
        Changes of the turnout over time.
    turnout : TurnoutConfig
        Its sections and sensors.
    seed : int
        The same seed gives the same trains.
    n_passage : int
        Number of trains.
    last_day : date
        Day of the last train.

    Returns
    -------
    list of tuple
        A job for ``make_passage`` per train.
    """
    rng = np.random.default_rng([seed, 77, crc32(scenario.turnout.encode())])
    positions = {s.label: (s.position, s.track) for s in turnout.sections}
    jobs, listed = [], []
    start = datetime.combine(last_day, datetime.min.time()) - timedelta(days=20)
    for k in range(n_passage):
        moment = start + timedelta(days=20 * k / n_passage, hours=float(rng.uniform(6, 20)))
        moment = moment.replace(microsecond=0)
        vehicle, name, low, high, _ = TRAFFIC[rng.choice(len(TRAFFIC), p=[t[-1] for t in TRAFFIC])]
        route = "diverging" if rng.uniform() < DIVERGING_SHARE else "main"
        speed = float(rng.uniform(low, high) if route == "main" else rng.uniform(40.0, DIVERGING_SPEED))
        load, direction = float(rng.uniform(0.0, 1.0)), str(rng.choice(["facing", "trailing"]))
        temperature = rail_temperature(moment.date(), rng)
        truth = {
            "started_at_utc": moment.isoformat(), "vehicle": name, "speed_kmh": speed, "load_share": load,
            "track": route, "direction": direction, "rail_temperature_c": temperature,
        }  # fmt: skip
        jobs.append((str(raw), scenario, positions, vehicle, truth, [seed, k]))
        # the train data have most trains, and their speed to some km/h
        if rng.uniform() < 0.7:
            entry = {"passed_at_utc": (moment + timedelta(seconds=int(rng.integers(-20, 20)))).isoformat()}
            listed.append(entry | {"train_type": name, "speed_kmh": f"{speed * rng.normal(1.0, 0.02):.0f}"})
    folder = Path(raw) / scenario.turnout
    (folder / "passages").mkdir(parents=True, exist_ok=True)
    with whole_file(folder / "trains.csv") as path, open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, ["passed_at_utc", "train_type", "speed_kmh"], lineterminator="\n")
        writer.writeheader()
        writer.writerows(listed)
    return jobs


def make_passage(job: PassageJob) -> dict[str, Any]:
    """Simulate one passage and write its file.

    Parameters
    ----------
    job : tuple
        From ``make_passages``.

    Returns
    -------
    dict
        Truth of the passage: train, speed, load, route, direction, temperature, file.
    """
    raw, scenario, positions, vehicle, truth, seed = job
    moment = datetime.fromisoformat(truth["started_at_utc"])
    track = track_on(scenario, moment.date(), round(truth["rail_temperature_c"]))
    sensors = [passage_sensor(label, position, side, truth["track"]) for label, (position, side) in positions.items()]
    recording = simulate_passage(
        track,
        vehicle_of(vehicle, round(truth["load_share"], 1)),
        truth["speed_kmh"] / KMH,
        sensors,
        terms=_terms_of(scenario, track, truth["track"], moment.date()),
        direction=truth["direction"],
        route=truth["track"],
        seed=crc32(repr(seed).encode()),
        rail_seed=crc32(f"{scenario.turnout} {truth['track']}".encode()),
        started_at=moment,
        conditions={"rail_temperature": round(truth["rail_temperature_c"], 1)},
    )
    conditions = {k: v for k, v in recording.conditions.items() if k == "rail_temperature"}
    name = moment.strftime("%Y%m%dT%H%M%SZ.h5")
    write(
        [replace(recording, conditions=conditions)],
        Path(raw) / scenario.turnout / "passages" / name,
        "hdf5",
        single=True,
    )
    loads = recording.conditions["axle_loads"]
    return truth | {"file": name, "n_axles": len(loads), "axle_load_t": float(np.mean(loads)) / (1e3 * GRAVITY)}


def passage_sensor(label: str, position: float, side: str, route: str) -> Sensor:
    gain = 1.0 if side in ("both", route) else NEIGHBOUR_GAIN
    return Sensor(label, position, "rail web", gain=gain, noise=NOISE, limit=LIMIT, resolution=LIMIT / 2**15)


def _terms_of(scenario: TurnoutScenario, turnout: TurnoutTrack, route: str, day: date) -> tuple[HangingSleeper, ...]:
    """Terms of the hanging sleepers of that day on ``route``."""
    track, terms = turnout.track_of(route), []
    for section in sorted({g.section for g in scenario.gaps}):
        gap = gap_under(scenario, section, day)
        position, section_route = turnout.locations[section]
        if gap > 0.0 and section_route in (route, None):
            terms.append(HangingSleeper(track.nearest_support(position), gap))
    return tuple(terms)


@lru_cache(maxsize=32)
def vehicle_of(name: str, load: float) -> Vehicle:
    return load_vehicle(name, load)
