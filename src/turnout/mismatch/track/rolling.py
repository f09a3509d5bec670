"""Passages as observations: accelerations below 160 Hz, aligned, on a coarse clock, and their simulation."""

from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len

from turnout.errors import SimulationError
from turnout.mismatch.case import Nuisance, Observation
from turnout.mismatch.track.skeleton import matrices_of
from turnout.simulate.prepare import prepare
from turnout.simulate.run import Drive, run

SHORTEST_WAVE = 0.3  # of the rail's roughness as modelled [m]
LOW, HIGH = 5.0, 112.0  # band in which the deterministic part dominates the roughness [Hz]
RATE = 1800.0  # of the simulation: with Radau IIA 1 to 2 % of the waveform of a band, a third of the materiality floor
ELEMENTS = 2  # per bay: 0.2 to 0.5 % of the waveform below 112 Hz from four, which 1.8 kHz misses by 0.4 to 1 %
FOLDS = (9, 6, 5)  # steps of the simulation per sample of an observation, the first that holds its band
DECAY = 12.0  # of a force's effect along the rail, as exponent: 1e-5 of it is left out
BLURRED = 0.03  # s about a sample at the range
LEAD = 0.25  # s of rolling before the first wheel reaches the first sensor
COUPLING = 0.7  # an amplifier's lower corner that no data sheet mentions [Hz]
EDGE = 0.08  # s kept before the first and behind the last wheel
# The rail's deflection under the axles: with a dip of 1.5 mm the right train is 0.8 alike, a wrong one at most 0.5
ALIGNED, ALIKE = 30.0, 0.65  # [Hz], -
FINE = 2500.0  # samples per second between which a cubic reads 112 Hz to 0.03 %
SLOWEST = 3.0  # samples in the shortest period of the band, whose edge ends at 1.25 times that: Nyquist asks for 2.5
SPEED_SD, TIME_SD, LOAD_SD = 0.004, 1.5e-3, 0.05


@dataclass(frozen=True)
class Track1D:
    """Settings of the simulation used for fitting; ``elements`` per bay, None as in the track's file."""

    rate: float = RATE
    scheme: str = "radau"
    elements: int | None = ELEMENTS


@dataclass(frozen=True)
class Rolling:
    """One aligned passage: ``time`` (n,) [s] since the recording's start, ``reference`` when the first wheel reaches
    the first sensor, ``speed`` after alignment; the observation holds the sensors one behind the other."""

    name: str
    passage: object
    sensors: tuple
    time: np.ndarray
    reference: float
    speed: float

    @property
    def high(self):
        """Upper end of the band [Hz]: at low speed the waves of the rail that are modelled end there."""
        return band_end(self.speed)

    @property
    def clock(self):
        """Samples per second of the observation [Hz]."""
        return clock_of(self.speed)

    def limited(self, samples, rate):
        """Rows of ``samples`` within the passage's band."""
        return band_limited(samples, rate, high=self.high)

    def places(self):
        """(n_wheel, n) place of every wheel [m]."""
        sign = 1.0 if self.passage.direction == "facing" else -1.0
        first = sign * min(sign * s.place for s in self.sensors)
        way = self.speed * (self.time - self.reference)
        return first + sign * (way[None, :] - self.passage.vehicle.wheel_places[:, None])


def band_limited(samples, rate, low=LOW, high=HIGH):
    """Rows of ``samples`` between ``low`` and ``high`` [Hz], zero phase, cosine edges of a third."""
    n = samples.shape[-1]
    size = next_fast_len(n + round(rate * 0.75), real=True)  # the lower edge rings for half a second
    passed = gate(np.fft.rfftfreq(size, 1.0 / rate), low, high)
    return np.fft.irfft(np.fft.rfft(samples, size) * passed, size)[..., :n]


def gate(frequency, low, high):
    """What ``band_limited`` lets through at each frequency [Hz], 0 to 1."""
    f = np.asarray(frequency)
    passed = np.clip((f - 0.67 * low) / (0.33 * low), 0.0, 1.0) * np.clip((1.25 * high - f) / (0.25 * high), 0.0, 1.0)
    return 0.5 - 0.5 * np.cos(np.pi * passed)


def read_at(samples, rate, time):
    """Band-limited ``samples`` (..., n), sample k at (k + 1/2)/rate, read at ``time`` (m,), 0 outside."""
    n = samples.shape[-1]
    place = np.asarray(time) * rate - 0.5
    k = np.clip(np.floor(place).astype(int), 1, n - 3)
    s = place - k
    a, b, c, d = (samples[..., k + i] for i in (-1, 0, 1, 2))
    value = b + 0.5 * s * (c - a + s * (2.0 * a - 5.0 * b + 4.0 * c - d + s * (3.0 * (b - c) + d - a)))
    return np.where((place < 0.0) | (place > n - 1), 0.0, value)


def finer(samples, factor=4):
    """Samples at a multiple of the rate by Fourier transform; sample k stays at (k + 1/2) of its own step."""
    n = samples.shape[-1]
    size = 2 * next_fast_len((n + 65) // 2, real=True)
    spectrum = np.fft.rfft(samples, size)
    shift = np.exp(2j * np.pi * np.fft.rfftfreq(size) * (0.5 / factor - 0.5))
    padded = np.zeros((*samples.shape[:-1], size * factor // 2 + 1), dtype=complex)
    padded[..., : spectrum.shape[-1]] = spectrum * shift
    return factor * np.fft.irfft(padded, size * factor)[..., : n * factor]


def band_end(speed):
    """Upper end of the band of a passage [Hz]: its edge is 1.25 times this, where the shortest wave lies."""
    return min(HIGH, speed / SHORTEST_WAVE / 1.25)


def clock_of(speed):
    """Samples per second that hold the band of a passage at this speed, a whole part of ``RATE`` [Hz]."""
    enough = [RATE / fold for fold in FOLDS if RATE / fold > 2.4 * 1.25 * band_end(speed)]
    return enough[0] if enough else RATE / FOLDS[-1]


class Roll:
    """Simulated passages on one track with one set of terms; the factorisation is shared among them."""

    def __init__(self, turnout, track, terms, settings):
        self.turnout, self.terms, self.settings = turnout, tuple(terms), settings
        if settings.elements and not track.pad_width:  # a wide pad needs the nodes beside its support
            track = track.with_(elements_per_bay=settings.elements)
        self.track = track
        matrices = matrices_of(track, self.terms)
        self.prepared = prepare(track, 1.0 / settings.rate, settings.scheme, self.terms, DECAY, matrices)

    def __call__(self, passage, vehicle, speed, sensors, probes=(), path=(), described=None):
        """(n_sensor + n_probe, n) signals of the march; time 0: first wheel ``LEAD`` before the first sensor where it
        is ``described`` to be."""
        for term in self.terms:
            vehicle = term.vehicle(vehicle)
        sign = 1 if passage.direction == "facing" else -1
        places = sign * np.array([s.place for s in described or sensors])
        start = sign * (places.min() - speed * LEAD)
        way = np.ptp(places) + float(vehicle.wheel_places[-1]) + speed * (LEAD + 2.0 * EDGE)
        seats = [seat(s, self.terms).probe(self.track) for s in sensors]
        surfaces = tuple((*parts, *path) for parts in self.turnout.surfaces(passage.route))
        drive = Drive(start, speed, sign, surfaces, path_step=0.01)
        outcome = run(self.prepared, way / speed, [*seats, *probes], vehicle, drive, forces=False, tolerance=1e-3)
        return outcome.signals


def seat(sensor, terms):
    """The sensor where the terms say it sits."""
    for term in terms:
        sensor = term.sensor(sensor)
    return sensor


def duration_of(passage, speed, sensors):
    """Time from the first wheel at the first sensor to the last wheel at the last one [s]."""
    places = [s.place for s in sensors]
    return (np.ptp(places) + float(passage.vehicle.wheel_places[-1])) / speed


def align(passage, sensors, simulated, rate):
    """(reference time [s], speed [m/s], correlation) at which the base simulation lies best on the recording.

    Searches all lags and speeds within 1.5 % of the noted one; the simulation is stretched in time about the first
    wheel's arrival. The band ends at ``ALIGNED``, below which roughness, dips and flats have no say. Where the sensors
    together look like no such train, the one that disagrees most is not asked, if three or more are there: what is
    wrong with it is for the fit to find.
    """
    recording = passage.recording
    step = 1.0 / 800.0
    grid = np.arange(0.0, recording.duration, step)
    data = read_at(_limited(recording, sensors, ALIGNED), recording.rate, grid)
    model_time = np.arange(0.0, simulated.shape[-1] / rate, step)
    low = band_limited(simulated, rate, high=ALIGNED)
    size = 1 << int(np.ceil(np.log2(grid.size + model_time.size)))
    spectrum = np.fft.rfft(data, size)
    weight = 1.0 / np.maximum(np.sqrt(np.sum(data**2, axis=1)), 1e-12)
    all_, but_one = [], []
    for stretch in np.linspace(-0.015, 0.015, 13):
        model = read_at(low, rate, LEAD + (model_time - LEAD) * (1.0 + stretch))
        norm = np.maximum(np.sqrt(np.sum(model**2, axis=1)), 1e-12)
        product = np.fft.irfft(spectrum * np.fft.rfft(model, size).conj(), size)
        alike = (weight / norm)[:, None] * product
        total, worst = alike.sum(axis=0), alike.min(axis=0)
        all_.append(_likest(total / len(sensors), stretch))
        but_one.append(_likest((total - worst) / max(len(sensors) - 1, 1), stretch))
    best = max(all_)
    if best[0] < ALIKE and len(sensors) >= 3:
        best = max(but_one)
    likeness, k, stretch = best
    lag = (k if k < size - model_time.size else k - size) * step
    return lag + LEAD, passage.speed * (1.0 + stretch), likeness


def _likest(score, stretch):
    """(likeness, lag in steps, stretch) where the score is best."""
    k = int(np.argmax(score))
    return float(score[k]), k, float(stretch)


def _limited(recording, sensors, high):
    rows = [recording.index(s.name) for s in sensors]
    return band_limited(recording.samples[rows], recording.rate, high=high)


def rolling_of(passage, sensors, reference, speed, tolerance):
    """(Rolling, Observation) of an aligned passage."""
    recording = passage.recording
    limited = _limited(recording, sensors, band_end(speed))
    stop = reference + duration_of(passage, speed, sensors) + EDGE
    step = 1.0 / clock_of(speed)
    time = np.arange(max(0.0, reference - EDGE), min(stop, recording.duration - 0.01), step)
    if time.size < 20:
        raise SimulationError("the train lies outside the recording")
    if recording.rate < SLOWEST * band_end(speed):
        raise SimulationError(f"{recording.rate:g} samples per second are too few for {band_end(speed):.0f} Hz")
    rolling = Rolling(passage.name, passage, tuple(sensors), time, reference, speed)
    fold = max(1, int(np.ceil(FINE / recording.rate)))
    limited, rate = finer(limited, fold) if fold > 1 else limited, fold * recording.rate
    data = read_at(limited, rate, time)
    quiet = read_at(limited, rate, np.arange(0.02, max(0.1, reference - 0.15), step))
    return rolling, observed(rolling, data, np.std(quiet, axis=1), tolerance, _topped(recording, sensors, time))


def _topped(recording, sensors, time):
    """(n_sensor, n) whether the channel was at its range within ``BLURRED`` of each time: what it missed there rings in
    the whole band."""
    found = np.zeros((len(sensors), time.size), dtype=bool)
    for row, sensor in zip(found, sensors):
        k = recording.index(sensor.name)
        limit = recording.channels[k].limit
        if limit is not None:
            at = np.flatnonzero(np.abs(recording.samples[k]) >= 0.999 * limit) / recording.rate
            row[:] = np.searchsorted(at, time - BLURRED) < np.searchsorted(at, time + BLURRED)
    return found


def observed(rolling, data, noise, tolerance, topped=None):
    """Observation of (n_sensor, n) samples with ``noise`` (n_sensor,) and a materiality floor; where ``topped`` they
    say no more than their own size."""
    wide = np.array([np.convolve(row**2, np.ones(31) / 31, mode="same") for row in data])
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
    return Observation(rolling.name, condition, data.ravel(), sigma.ravel(), 0.35, "passage", covariates, cells, labels)


def coupling_modes(rolling, data):
    r"""(n_sensor * n_time, n_sensor) modes of amplifiers whose lower corner is not exactly known.

    Well above its corner a high-pass adds :math:`-2 \pi f_c \int a\,dt`; f_c is known to ``COUPLING``.
    """
    rows = data.reshape(len(rolling.sensors), -1)
    velocity = np.cumsum(rows - rows.mean(axis=1, keepdims=True), axis=1) / rolling.clock
    found = np.zeros((rows.size, rows.shape[0]))
    for k, row in enumerate(2.0 * np.pi * COUPLING * (velocity - velocity.mean(axis=1, keepdims=True))):
        found[k * row.size : (k + 1) * row.size, k] = row
    return found


def _cells(rolling):
    """Cells of one axle within 3 m of a sensor, one bay long, labelled by what a cause could be locked to."""
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
    """Time, speed and load of one passage; owned by all its sensors, so named by the passage."""
    parts = (("time", "s", TIME_SD), ("speed", "-", SPEED_SD), ("load", "-", LOAD_SD))
    return [Nuisance(f"{what}@{passage.name}", unit, 0.0, sd, passage.name) for what, unit, sd in parts]
