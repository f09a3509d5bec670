"""Passages as observations: aligned accelerations below 112 Hz at a low sampling rate."""

from dataclasses import dataclass

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.case import Nuisance, Observation
from turnout.mismatch.turnout.campaign import LOAD_SD
from turnout.mismatch.turnout.passage_band import band_end, band_limited, clock_of, finer, limited, read_at
from turnout.mismatch.turnout.passage_model import EDGE

# m, s, s: distance, margin and least time for a channel's noise. 4.2 m before a wheel there is noise alone, 1.4 m
# before it the level is six times higher.
CLEAR, MARGIN, SHORTEST_QUIET = 5.0, 0.02, 0.1
BLURRED = 0.03  # s about a sample at the range, which is disturbed by clipping
COUPLING = 0.7  # Hz, standard deviation of the lower corner of an amplifier without a data sheet
FINE = 2500.0  # Hz, sampling rate at which cubic interpolation is right to 0.03 % at 112 Hz
SLOWEST = 3.0  # samples per shortest period of the band; its edge ends at 1.25 times that: Nyquist needs 2.5
FEWEST, AROUND = 20, 31  # least samples of a passage; samples over which its amplitude is taken
SPEED_SD, TIME_SD = 0.004, 1.5e-3  # relative, s; errors of the alignment
ASSUMED = 2.0  # bounds of an unknown load in prior standard deviations: a seventh beyond empty and full


@dataclass(frozen=True)
class Rolling:
    """One passage aligned with its simulation; its observation holds the sensors one after the other.

    ``time`` (n,) [s] counts from the start of the recording. At ``reference`` [s] the first wheel reaches the first
    sensor. ``speed`` [m/s] is that after alignment.
    """

    name: str
    passage: object
    sensors: tuple
    time: np.ndarray
    reference: float
    speed: float

    @property
    def high(self):
        """Upper end of the band [Hz]: at low speed the modelled waves of the rail end there."""
        return band_end(self.speed)

    @property
    def clock(self):
        """Samples per second of the observation [Hz]."""
        return clock_of(self.speed)

    def limited(self, samples, rate):
        """Rows of ``samples`` within the band of the passage."""
        return band_limited(samples, rate, high=self.high)

    def places(self):
        """(n_wheel, n) position of every wheel [m]."""
        sign = 1.0 if self.passage.direction == "facing" else -1.0
        first = sign * min(sign * s.place for s in self.sensors)
        way = self.speed * (self.time - self.reference)
        return first + sign * (way[None, :] - self.passage.vehicle.wheel_places[:, None])


def duration_of(passage, speed, sensors):
    """Time from the first wheel at the first sensor to the last wheel at the last sensor [s]."""
    places = [s.place for s in sensors]
    return (np.ptp(places) + float(passage.vehicle.wheel_places[-1])) / speed


def rolling_of(passage, sensors, reference, speed, tolerance):
    """(AlignedPassage, Observation) of a passage."""
    recording = passage.recording
    kept = limited(recording, sensors, band_end(speed))
    stop = reference + duration_of(passage, speed, sensors) + EDGE
    step = 1.0 / clock_of(speed)
    time = np.arange(max(0.0, reference - EDGE), min(stop, recording.duration - 0.01), step)
    if time.size < FEWEST:
        raise SimulationError("the train lies outside the recording")
    if recording.rate < SLOWEST * band_end(speed):
        raise SimulationError(f"{recording.rate:g} samples per second are too few for {band_end(speed):.0f} Hz")
    rolling = Rolling(passage.name, passage, tuple(sensors), time, reference, speed)
    fold = max(1, int(np.ceil(FINE / recording.rate)))
    kept, rate = finer(kept, fold) if fold > 1 else kept, fold * recording.rate
    data = read_at(kept, rate, time)
    noise = np.zeros(len(sensors))
    for start, end in _without_wheels(rolling):
        if end - start >= SHORTEST_QUIET:
            noise = np.std(read_at(kept, rate, np.arange(start, end, step)), axis=1)
            break
    return rolling, observed(rolling, data, noise, tolerance, _topped(recording, sensors, time))


def _without_wheels(rolling):
    """(start, end) [s] before and after the train, with no wheel within ``CLEAR_DISTANCE`` of a sensor."""
    far, passage = CLEAR / rolling.speed, rolling.passage
    behind = rolling.reference + duration_of(passage, rolling.speed, rolling.sensors) + far
    return (MARGIN, rolling.reference - far), (behind, passage.recording.duration - MARGIN)


def _topped(recording, sensors, time):
    """(n_sensor, n) whether the channel reached its range within ``CLIPPING_BLUR`` of each time.

    The samples that were cut off disturb the whole band there.
    """
    found = np.zeros((len(sensors), time.size), dtype=bool)
    for row, sensor in zip(found, sensors):
        k = recording.index(sensor.name)
        limit = recording.channels[k].limit
        if limit is not None:
            at = np.flatnonzero(np.abs(recording.samples[k]) >= 0.999 * limit) / recording.rate
            row[:] = np.searchsorted(at, time - BLURRED) < np.searchsorted(at, time + BLURRED)
    return found


def observed(rolling, data, noise, tolerance, topped=None):
    """Observation of (n_sensor, n) samples with ``noise`` (n_sensor,) and a materiality floor.

    ``clipped`` samples have an error as large as the largest sample of their channel.
    """
    width = min(AROUND, data.shape[1])
    wide = np.array([np.convolve(row**2, np.ones(width) / width, mode="same") for row in data])
    floor = 0.02 * np.sqrt(np.mean(data**2, axis=1)) + 1e-9
    sigma = np.sqrt((noise**2 + floor**2)[:, None] + tolerance**2 * wide)
    if topped is not None and topped.any():
        sigma = np.where(topped, np.hypot(sigma, np.max(np.abs(data), axis=1, keepdims=True)), sigma)
    cells, labels = _cells(rolling)
    passage = rolling.passage
    temperature = passage.conditions.get("rail_temperature")
    said = [passage.train, f"{passage.speed * 3.6:.0f} km/h"]
    covariates = {"speed": rolling.speed, "load": float(np.mean(passage.vehicle.static_loads))}
    if temperature is not None:
        said.append(f"{temperature:.0f} °C")
        covariates["temperature"] = float(temperature)
    condition = " ".join(said)
    return Observation(
        rolling.name, condition, data.ravel(), sigma.ravel(), 0.35, "passage", covariates, cells, labels, rows=len(data)
    )


def coupling_modes(rolling, data):
    r"""(n_sensor * n_time, n_sensor) error modes of amplifiers whose lower corner frequency is uncertain.

    Well above its corner a high-pass adds :math:`-2 \pi f_c \int a\,dt`; f_c is known to ``COUPLING_CORNER_SD``.
    """
    rows = data.reshape(len(rolling.sensors), -1)
    velocity = np.cumsum(rows - rows.mean(axis=1, keepdims=True), axis=1) / rolling.clock
    found = np.zeros((rows.size, rows.shape[0]))
    for k, row in enumerate(2.0 * np.pi * COUPLING * (velocity - velocity.mean(axis=1, keepdims=True))):
        found[k * row.size : (k + 1) * row.size, k] = row
    return found


def _cells(rolling):
    """Cells of one axle within 3 m of a sensor, one sleeper bay long.

    Their labels are what a cause may be bound to: sensor, train, wheel, position, condition.
    """
    passage, place = rolling.passage, rolling.places()
    train, speed = passage.train or passage.name, f"{passage.speed * 3.6:.0f} km/h"
    index, known, n = [], {}, rolling.time.size
    for sensor in rolling.sensors:
        distance = np.abs(place - sensor.place)
        axle = np.argmin(distance, axis=0)
        near = distance[axle, np.arange(n)] < 3.0
        bay = np.round(place[axle, np.arange(n)] / 0.6).astype(int)
        for a, b, inside in zip(axle, bay, near):
            key = (sensor.name, int(a), int(b)) if inside else None
            index.append(-1 if key is None else known.setdefault(key, len(known)))
    labels = {
        "sensor": [name for name, _, _ in known],
        "train": [train for _ in known],
        "wheel": [f"{train}, axle {a + 1}" for _, a, _ in known],
        "place": [f"{0.6 * b:.1f}" for _, _, b in known],
        "condition": [speed for _ in known],
    }
    return np.array(index, dtype=np.int64), {k: np.array(v, dtype=object) for k, v in labels.items()}


def rolling_nuisances(passage):
    """Time, speed and load of one passage. They are named after the passage, since all its sensors share them."""
    reach = np.inf if passage.load_sd <= LOAD_SD else ASSUMED * passage.load_sd
    parts = (
        ("time", "s", TIME_SD, np.inf),
        ("speed", "-", SPEED_SD, np.inf),
        ("load", "-", passage.load_sd, reach),
    )
    return [Nuisance(f"{what}@{passage.name}", unit, 0.0, sd, passage.name, (-a, a)) for what, unit, sd, a in parts]
