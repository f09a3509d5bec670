"""Passages as observations: aligned accelerations below 112 Hz at a low sampling rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.constants import KMH
from turnout.errors import SimulationError
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout.campaign import PassageInput
from turnout.mismatch.turnout.channel_lines import SteadyLine, mains_lines, strongest_lines
from turnout.mismatch.turnout.passage_band import band_end, band_signals, limit_band, read_at, sample_rate_of, upsample
from turnout.mismatch.turnout.priors import PASSAGE, SIMULATION, TRACK
from turnout.physics.hum import MAINS
from turnout.simulate.sensor import Sensor

if TYPE_CHECKING:
    from turnout.records import Recording


@dataclass(frozen=True)
class AlignedPassage:
    """One passage aligned with its simulation; its observation holds the sensors one after the other.

    ``time`` (n,) [s] counts from the start of the recording. At ``reference`` [s] the first wheel reaches the first
    sensor. ``speed`` [m/s] is that after alignment. ``hum_lines`` has, by channel, the frequency [Hz] of
    the mains and its phase at the start of the recording [rad], ``steady_lines`` the strongest line at any frequency,
    both as the channel shows them where no wheel is near.
    """

    name: str
    passage: PassageInput
    sensors: tuple[Sensor, ...]
    time: np.ndarray
    reference: float
    speed: float
    hum_lines: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    steady_lines: Mapping[str, SteadyLine] = field(default_factory=dict)

    @property
    def high(self) -> float:
        """Upper end of the band [Hz]: at low speed the modelled waves of the rail end there."""
        return band_end(self.speed)

    @property
    def clock(self) -> float:
        """Samples per second of the observation [Hz]."""
        return sample_rate_of(self.speed)

    def limit_band(self, samples: np.ndarray, rate: float) -> np.ndarray:
        """Rows of ``samples`` within the band of the passage.

        Parameters
        ----------
        samples : (n_channel, n) array of float
            Signals.
        rate : float
            Sampling rate. [Hz]

        Returns
        -------
        (n_channel, n) array of float
        """
        return limit_band(samples, rate, high=self.high)

    @property
    def train(self) -> str:
        """Type or number of the train, else the name of the passage."""
        return self.passage.train or self.passage.name

    @property
    def conditions(self) -> dict[str, Any]:
        """Conditions of the passage, as terms need them."""
        loads = tuple(2.0 * load for load in self.passage.vehicle.static_loads)
        return {"axle_loads": loads, "train": self.train, "name": self.name, **self.passage.conditions}

    def positions(self, time: np.ndarray | None = None) -> np.ndarray:
        """(n_wheel, n) position of every wheel [m].

        Parameters
        ----------
        time : (n,) array of float or None
            Times since the start of the recording; None: those of the observation. [s]
        """
        sign = 1.0 if self.passage.direction == "facing" else -1.0
        first = sign * min(sign * s.place for s in self.sensors)
        distance = self.speed * ((self.time if time is None else time) - self.reference)
        return first + sign * (distance[None, :] - self.passage.vehicle.wheel_positions[:, None])


def duration_of(passage: PassageInput, speed: float, sensors: Sequence[Sensor]) -> float:
    """Time from the first wheel at the first sensor to the last wheel at the last sensor [s].

    Parameters
    ----------
    passage : PassageInput
        The passage.
    speed : float
        Speed of the train. [m/s]
    sensors : sequence of Sensor
        The sensors.

    Returns
    -------
    float
        [s]
    """
    places = [s.place for s in sensors]
    return (np.ptp(places) + float(passage.vehicle.wheel_positions[-1])) / speed


def observe_passage(
    passage: PassageInput, sensors: Sequence[Sensor], reference: float, speed: float, tolerance: float
) -> tuple[AlignedPassage, Observation]:
    """The aligned passage, and its observation without error modes.

    Parameters
    ----------
    passage : PassageInput
        The passage.
    sensors : sequence of Sensor
        The sensors.
    reference : float
        Time of the first wheel at the first sensor. [s]
    speed : float
        Speed of the train. [m/s]
    tolerance : float
        Share of the local amplitude below which a difference does not matter. [-]

    Returns
    -------
    aligned : AlignedPassage
    observation : Observation

    Raises
    ------
    SimulationError
        The train lies outside the recording, or the recording has too few samples per second.
    """
    recording = passage.recording
    signals = band_signals(recording, sensors, band_end(speed))
    stop = reference + duration_of(passage, speed, sensors) + SIMULATION.edge_time
    step = 1.0 / sample_rate_of(speed)
    time = np.arange(max(0.0, reference - SIMULATION.edge_time), min(stop, recording.duration - 0.01), step)
    if time.size < PASSAGE.min_samples:
        raise SimulationError("the train lies outside the recording")
    if recording.rate < PASSAGE.min_samples_per_period * band_end(speed):
        raise SimulationError(f"{recording.rate:g} samples per second are too few for {band_end(speed):.0f} Hz")
    aligned = AlignedPassage(passage.name, passage, tuple(sensors), time, reference, speed)
    factor = max(1, int(np.ceil(PASSAGE.min_read_rate / recording.rate)))
    signals, rate = upsample(signals, factor) if factor > 1 else signals, factor * recording.rate
    data = read_at(signals, rate, time)
    quiet = [(start, end) for start, end in _wheel_free_times(aligned) if end - start >= PASSAGE.min_quiet_time]
    noise = np.zeros(len(sensors))
    if quiet:
        noise = np.std(read_at(signals, rate, np.arange(*quiet[0], step)), axis=1)
        stretches = [np.arange(*ends, step) for ends in _beside_train(quiet, reference)]
        near_times = np.concatenate(stretches)
        near = read_at(signals, rate, near_times)
        names = [sensor.name for sensor in sensors]
        ends = np.cumsum([s.size for s in stretches])[:-1]
        steady = strongest_lines(np.split(near, ends, axis=1), step, aligned.high)
        aligned = replace(
            aligned,
            hum_lines=dict(zip(names, mains_lines(near, near_times, MAINS))),
            steady_lines=dict(zip(names, steady)),
        )
    return aligned, observation_of(aligned, data, noise, tolerance, _clipped_samples(recording, sensors, time))


def _beside_train(quiet: Sequence[tuple[float, float]], reference: float) -> list[tuple[float, float]]:
    """Quiet times of one length next to the train, before and behind it: there the mains have drifted least."""
    length = min(PASSAGE.hum_time, *(end - start for start, end in quiet))
    return [(start, start + length) if start > reference else (end - length, end) for start, end in quiet]


def _wheel_free_times(aligned: AlignedPassage) -> tuple[tuple[float, float], tuple[float, float]]:
    """(start, end) [s] before and after the train, with no wheel within ``PASSAGE.clear_distance`` of a sensor."""
    clear_time, passage = PASSAGE.clear_distance / aligned.speed, aligned.passage
    end = aligned.reference + duration_of(passage, aligned.speed, aligned.sensors) + clear_time
    return (PASSAGE.record_margin, aligned.reference - clear_time), (
        end,
        passage.recording.duration - PASSAGE.record_margin,
    )


def _clipped_samples(recording: Recording, sensors: Sequence[Sensor], time: np.ndarray) -> np.ndarray:
    """(n_sensor, n) whether the channel reached its range within ``PASSAGE.clipping_blur`` of each time.

    The samples that were cut off disturb the whole band there.
    """
    clipped = np.zeros((len(sensors), time.size), dtype=bool)
    for row, sensor in zip(clipped, sensors):
        k = recording.index(sensor.name)
        limit = recording.channels[k].limit
        if limit is not None:
            clipped_times = np.flatnonzero(np.abs(recording.samples[k]) >= PASSAGE.range_share * limit) / recording.rate
            row[:] = np.searchsorted(clipped_times, time - PASSAGE.clipping_blur) < np.searchsorted(
                clipped_times, time + PASSAGE.clipping_blur
            )
    return clipped


def observation_of(
    aligned: AlignedPassage, data: np.ndarray, noise: np.ndarray, tolerance: float, clipped: np.ndarray | None = None
) -> Observation:
    """Observation of the samples of a passage; their errors are noise, a materiality floor and clipping.

    Parameters
    ----------
    aligned : AlignedPassage
        The passage.
    data : (n_sensor, n) array of float
        Samples at the times of the passage. [m/s²]
    noise : (n_sensor,) array of float
        Standard deviation of each channel's noise. [m/s²]
    tolerance : float
        Share of the local amplitude below which a difference does not matter. [-]
    clipped : (n_sensor, n) array of bool or None
        Samples whose error is as large as the largest sample of their channel.

    Returns
    -------
    Observation
    """
    width = min(PASSAGE.amplitude_window, data.shape[1])
    mean_square = np.array([np.convolve(row**2, np.ones(width) / width, mode="same") for row in data])
    floor = PASSAGE.noise_floor_share * np.sqrt(np.mean(data**2, axis=1)) + 1e-9
    sigma = np.sqrt((noise**2 + floor**2)[:, None] + tolerance**2 * mean_square)
    if clipped is not None and clipped.any():
        sigma = np.where(clipped, np.hypot(sigma, np.max(np.abs(data), axis=1, keepdims=True)), sigma)
    cells, labels = _cells(aligned)
    passage = aligned.passage
    temperature = passage.conditions.get("rail_temperature")
    condition_words = [passage.train, f"{passage.speed * KMH:.0f} km/h"]
    covariates = {"speed": aligned.speed, "load": float(np.mean(passage.vehicle.static_loads))}
    if temperature is not None:
        condition_words.append(f"{temperature:.0f} °C")
        covariates["temperature"] = float(temperature)
    condition = " ".join(condition_words)
    return Observation(
        aligned.name,
        condition,
        data.ravel(),
        sigma.ravel(),
        PASSAGE.effective_share,
        "passage",
        covariates,
        cells,
        labels,
        rows=len(data),
    )


def with_chatter(observation: Observation) -> Observation:
    """The observation of a passage in a switch: a blade that is lifted off its chairs falls back and chatters.

    When it does so depends on gaps that nobody measures.

    Parameters
    ----------
    observation : Observation
        Of a passage.

    Returns
    -------
    Observation
        With a larger error of each channel.
    """
    rows = observation.data.reshape(observation.rows, -1)
    chatter = PASSAGE.chatter_share * np.sqrt(np.mean(rows**2, axis=1, keepdims=True))
    sigma = np.hypot(observation.sigma.reshape(rows.shape), chatter)
    return replace(observation, sigma=sigma.ravel())


def coupling_modes(aligned: AlignedPassage, data: np.ndarray) -> np.ndarray:
    r"""Error modes of amplifiers whose lower corner frequency is uncertain.

    Well above its corner a high-pass adds :math:`-2 \pi f_c \int a\,dt`; f_c is known to 0.7 Hz.

    Parameters
    ----------
    aligned : AlignedPassage
        The passage.
    data : (n_sensor * n_time,) array of float
        Samples, one sensor after the other. [m/s²]

    Returns
    -------
    (n_sensor * n_time, n_sensor) array of float
        One mode per channel. [m/s²]
    """
    rows = data.reshape(len(aligned.sensors), -1)
    velocity = np.cumsum(rows - rows.mean(axis=1, keepdims=True), axis=1) / aligned.clock
    modes = np.zeros((rows.size, rows.shape[0]))
    for k, row in enumerate(
        2.0 * np.pi * PASSAGE.coupling_corner_sd * (velocity - velocity.mean(axis=1, keepdims=True))
    ):
        modes[k * row.size : (k + 1) * row.size, k] = row
    return modes


def _cells(aligned: AlignedPassage) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Cells of one axle within 3 m of a sensor, one sleeper bay long.

    Their labels are what a cause may be bound to: sensor, train, wheel, position, condition.
    """
    passage, position = aligned.passage, aligned.positions()
    train, speed = aligned.train, f"{passage.speed * KMH:.0f} km/h"
    index: list[int] = []
    cell_index: dict[tuple[str, int, int], int] = {}
    n = aligned.time.size
    for sensor in aligned.sensors:
        distance = np.abs(position - sensor.place)
        axle = np.argmin(distance, axis=0)
        near = distance[axle, np.arange(n)] < PASSAGE.cell_reach
        bay = np.round(position[axle, np.arange(n)] / PASSAGE.cell_length).astype(int)
        for a, b, inside in zip(axle, bay, near):
            key = (sensor.name, int(a), int(b)) if inside else None
            index.append(-1 if key is None else cell_index.setdefault(key, len(cell_index)))
    labels = {
        "sensor": [name for name, _, _ in cell_index],
        "train": [train for _ in cell_index],
        "wheel": [f"{train}, axle {a + 1}" for _, a, _ in cell_index],
        "place": [f"{PASSAGE.cell_length * b:.1f}" for _, _, b in cell_index],
        "condition": [speed for _ in cell_index],
    }
    return np.array(index, dtype=np.int64), {k: np.array(v, dtype=object) for k, v in labels.items()}


def passage_nuisances(passage: PassageInput) -> list[Nuisance]:
    """Time, speed and load of one passage. They are named after the passage, since all its sensors share them.

    Parameters
    ----------
    passage : PassageInput
        The passage.

    Returns
    -------
    list of Nuisance
        In this order.
    """
    reach = np.inf if passage.load_sd <= TRACK.load_sd else TRACK.load_bound_sds * passage.load_sd
    priors = (
        ("time", "s", PASSAGE.time_sd, np.inf),
        ("speed", "-", PASSAGE.speed_sd, np.inf),
        ("load", "-", passage.load_sd, reach),
    )
    return [
        Nuisance(f"{quantity}@{passage.name}", unit, 0.0, sd, passage.name, (-a, a), group=quantity)
        for quantity, unit, sd, a in priors
    ]
