"""Passages with known truth: wheel impacts on the models of the paper, and noise bursts that follow the wheels.

They are computed in closed form from poles and residues, not with the code under test.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.published import published_model
from turnout.modal.poles import continuous_pole
from turnout.passage.axle_patterns import read_patterns
from turnout.passage.result import PassageSensor
from turnout.records import Channel, ModalModel, Recording

RATE = 20000.0
IC3 = np.array([0.0, 2.7, 16.35, 19.05, 34.05, 36.75, 50.4, 53.1])
PATTERN_FILE = {
    "vehicles": {
        "unit": {"length": 58.8, "axles": [2.85, 5.55, 19.2, 21.9, 36.9, 39.6, 53.25, 55.95]},
        "coach": {"length": 26.4, "pivots": 19.0, "wheelbase": 2.5},
        "loco": {"length": 18.98, "pivots": 9.5, "wheelbase": 3.0},
    },
    "trains": {
        "IC3": {"units": ["unit"], "coupled": 3},
        "intercity": {"units": ["loco", {"any": ["coach"], "count": [1, 12]}]},
    },
}
PATTERNS = read_patterns(PATTERN_FILE)


def paper_model(location) -> ModalModel:
    """The paper's model of a location, as the identification would give it."""
    printed = published_model(location)
    return ModalModel(printed.a, printed.b, printed.c, printed.rate, ())


@dataclass
class ImpactRecord:
    """``samples`` (n,) with ``times`` [samples] and ``amplitudes`` of the impacts; ``clean`` is without ``noise``."""

    samples: np.ndarray
    times: np.ndarray
    amplitudes: np.ndarray
    noise: float
    clean: np.ndarray


def decay(location, elapsed) -> np.ndarray:
    """Response at times ``elapsed`` after an impact [s]: Re sum R exp(s t), zero before it."""
    model = published_model(location)
    pole = continuous_pole(model.frequency, model.damping)
    positive = np.clip(elapsed, 0.0, None)[..., None]
    return np.where(elapsed >= 0, np.real(np.sum(model.residue * np.exp(pole * positive), axis=-1)), 0.0)


def impacts(location, n, times, amplitudes) -> np.ndarray:
    """(n,) sum of the decays of all impacts at ``times`` [samples]."""
    out, length = np.zeros(n), int(0.6 * RATE)
    for t, g in zip(times, amplitudes):
        first = max(int(np.ceil(t - 1e-9)), 0)
        index = np.arange(first, min(first + length, n))
        out[index] += g * decay(location, np.maximum(index - t, 0.0) / RATE)
    return out


def impact_record(rng, location="CP A7", offsets=IC3, speed=44.4, snr_db=40.0, start=0.6, tail=0.5) -> ImpactRecord:
    """Record of one sensor: impacts of a train on a model of the paper, white noise ``snr_db`` below the peak."""
    times = (start + np.asarray(offsets) / speed) * RATE + rng.uniform(0.0, 1.0, len(offsets))
    amplitudes = 1.0 + 0.2 * rng.standard_normal(len(offsets))
    clean = impacts(location, int(times[-1] + tail * RATE), times, amplitudes)
    noise = np.abs(clean).max() * 10 ** (-snr_db / 20)
    return ImpactRecord(clean + noise * rng.standard_normal(clean.size), times, amplitudes, noise, clean)


def passing_times(offsets, positions, speed, acceleration, direction, lead):
    """(n_sensor, n_axle) times [s]; the first axle reaches the first sensor ``lead`` after the start."""
    along = direction * np.asarray(positions, float)
    distance = np.asarray(offsets, float) + (along - along.min())[:, None]
    root = np.sqrt(speed**2 + 2 * acceleration * distance)
    return lead + 2 * distance / (speed + root)


def impact_train(
    rng, locations, positions, offsets=IC3, speed=44.4, acceleration=0.0, direction=1, snr_db=40.0, lead=1.0
):
    """(recording of several sensors, each with the model of its location, true times (n_sensor, n_axle) [s])."""
    times = passing_times(offsets, positions, speed, acceleration, direction, lead)
    n = int((times.max() + 1.0) * RATE)
    rows = []
    for location, row in zip(locations, times):
        clean = impacts(location, n, row * RATE, 1.0 + 0.2 * rng.standard_normal(len(row)))
        rows.append(clean + np.abs(clean).max() * 10 ** (-snr_db / 20) * rng.standard_normal(n))
    return recording_of(np.array(rows), positions), times


def rolling_noise(
    rng,
    offsets=IC3,
    speed=40.0,
    positions=(0.0, 4.0),
    direction=1,
    noise=0.02,
    acceleration=0.0,
    lead=1.0,
    amplitudes=None,
):
    """Recording of noise bursts that follow the wheels along the rail. Power decays by 1/e in 0.4 m; no modal model.

    ``amplitudes`` (n_axle,) are those of the wheels, 1 without them.
    """
    amplitudes = np.ones(len(offsets)) if amplitudes is None else amplitudes
    times = passing_times(offsets, positions, speed, acceleration, direction, lead)
    n = int((times.max() + 1.0) * RATE)
    time = np.arange(n) / RATE
    rows = []
    for row in times:
        power = np.zeros(n)
        for t, amplitude in zip(row, amplitudes):
            at_wheel = speed + acceleration * (t - lead)
            near = slice(*np.searchsorted(time, t + np.array([-40.0, 40.0]) / at_wheel))  # beyond: exp(-100)
            power[near] += amplitude**2 * np.exp(-np.abs(time[near] - t) * at_wheel / 0.4)
        rows.append(np.sqrt(power) * rng.standard_normal(n) + noise * rng.standard_normal(n))
    return recording_of(np.array(rows), positions)


def recording_of(samples, positions) -> Recording:
    """Channels c0, c1 ... at ``positions``."""
    channels = tuple(Channel(f"c{i}", "acceleration", float(x)) for i, x in enumerate(positions))
    return Recording(samples, RATE, channels, "passage")


def sensors_for(recording, tracks=None) -> list[PassageSensor]:
    """A PassageSensor per channel."""
    tracks = tracks or ["both"] * len(recording.channels)
    return [PassageSensor(c.name, f"S{i}", c.position, t) for i, (c, t) in enumerate(zip(recording.channels, tracks))]
