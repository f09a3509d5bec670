"""Simulated passages over the turnout of the demonstration, with the truth about each train."""

from dataclasses import dataclass

import numpy as np

from turnout.passage.result import PassageSensor
from turnout.records import Channel, Recording
from turnout.simulate import Sensor, car, load_track, load_vehicle, prepare_passage, simulate_passage
from turnout.simulate.train import couple

RATE = 20000.0
# Positions of twelve sensors on the track of the train [m].
SENSOR_POSITIONS = (-20.0, -12.0, -6.0, 3.6, 8.4, 13.8, 19.2, 24.6, 26.4, 31.2, 36.0, 40.2)
CROSSTALK = 0.05  # share of the vibration that sensors on the other track see


@dataclass
class Run:
    """One simulated train: ``samples`` (12, n) without noise, and the truth about it."""

    samples: np.ndarray
    type: str
    speed: float
    direction: str
    route: str
    offsets: np.ndarray
    axle_load: float


def vehicles(load):
    """{type: vehicle} of four types with a template."""
    return {
        "IC3": load_vehicle("ic3", load),
        "IC3 double": load_vehicle("ic3", load, units=2),
        "intercity": load_vehicle("intercity", load),
        "freight": load_vehicle("freight", load),
    }


def unlisted_trains():
    """Trains without a template."""
    short = car("stranger", half_base=1.05, half_pivot=6.4, length=17.6, overhang=1.35)
    long = car("stranger", half_base=1.40, half_pivot=9.9, length=27.1, overhang=2.25)
    mixed = [short, long, short]
    return [couple("stranger", [short] * 4), couple("stranger", [long] * 3), couple("stranger", mixed)]


def simulate(vehicle, name, speed_kmh, direction, route, prepared, track, seed=1):
    """Simulate one train without noise."""
    sensors = [Sensor(f"m{i}", x) for i, x in enumerate(SENSOR_POSITIONS)]
    recording = simulate_passage(
        track,
        vehicle,
        speed_kmh / 3.6,
        sensors,
        direction,
        route,
        seed=seed,
        rate=RATE,
        prepared=prepared,
        lead=1.2,
        tail=1.2,
    )
    load = float(np.mean(2.0 * vehicle.static_loads)) / 9806.65
    return Run(
        recording.samples.astype(np.float32), name, speed_kmh / 3.6, direction, route, vehicle.wheel_positions, load
    )


def fleet(speeds, loads=(0.0, 1.0)):
    """Runs of the four types; ``speeds`` maps a type to speeds [km/h]. Direction and route alternate."""
    track = load_track("tommerup", seed=1)
    prepared = prepare_passage(track, rate=RATE)
    k = 0
    for load in loads:
        for name, vehicle in vehicles(load).items():
            for speed in speeds[name]:
                direction, route = ("facing", "trailing")[k % 2], ("main", "diverging")[k % 4 == 3]
                k += 1
                yield simulate(vehicle, name, speed, direction, route, prepared, track)


def unlisted_runs(speeds=(60.0, 110.0)):
    """Runs of the trains without a template."""
    track = load_track("tommerup", seed=1)
    prepared = prepare_passage(track, rate=RATE)
    for vehicle in unlisted_trains():
        for speed in speeds:
            yield simulate(vehicle, "unknown", speed, "facing", "main", prepared, track)


def sensor_recording(run: Run, rows, noise, rng, with_other_track=True):
    """(Recording, sensors): the sensors ``rows`` with white noise [m/s²], and two sensors of the other track.

    A sensor before the toe records every train. One behind it records the trains of its track, and others faintly.
    """
    samples = run.samples[list(rows)].astype(float)
    names = [f"m{i}" for i in rows]
    positions = [SENSOR_POSITIONS[i] for i in rows]
    own_track, other_track = run.route, "diverging" if run.route == "main" else "main"
    tracks = ["both" if x < 4.0 else own_track for x in positions]
    if with_other_track:
        crosstalk = CROSSTALK * run.samples[[9, 10]].astype(float)
        samples, names, positions = (
            np.vstack([samples, crosstalk]),
            [*names, "o1", "o2"],
            [*positions, SENSOR_POSITIONS[9], SENSOR_POSITIONS[10]],
        )
        tracks = [*tracks, other_track, other_track]
    samples = samples + noise * rng.standard_normal(samples.shape)
    channels = tuple(Channel(n, "acceleration", x) for n, x in zip(names, positions))
    sensors = [PassageSensor(n, n, x, t) for n, x, t in zip(names, positions, tracks)]
    return Recording(samples, RATE, channels, "passage"), sensors
