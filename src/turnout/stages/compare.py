"""Compare a recorded passage with its simulation on the calibrated track: time series and spectra in two bands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
import scipy

from turnout.config import load_configuration, with_raw
from turnout.constants import KMH
from turnout.errors import REMARK_REASONS, ConfigError, ReadError, SimulationError
from turnout.passage.analysis import analyse
from turnout.passage.scores import fit_percent
from turnout.passage.train_type import UNKNOWN
from turnout.readers import read
from turnout.simulate.modal_calibration import with_section
from turnout.simulate.parameters import load_track, load_vehicle
from turnout.simulate.passage import simulate_passage
from turnout.simulate.sensor import Sensor
from turnout.stages.calibrate import calibrate_to_files, resolve_track
from turnout.stages.mismatch_trains import TrainUnknownError, speed_from_axles
from turnout.stages.parameter_ranges import improbable_in_files
from turnout.stages.passage import sensors_of
from turnout.stages.passage_context import known_patterns
from turnout.stages.requested_units import passage_file
from turnout.stages.simulated_speed import SimulatedSpeed, recorded_times, simulated_speed, speed_at_sensors
from turnout.stages.track_files import files_of_track, files_of_vehicle
from turnout.workflow.scan import scan

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from turnout.config import TurnoutConfig
    from turnout.passage.result import Passage, PassageSensor
    from turnout.records import Recording
    from turnout.simulate.turnout_track import TurnoutTrack
    from turnout.simulate.vehicle import Vehicle

BANDS = ((0.0, 40.0), (40.0, 1000.0))  # Hz, of the paper's Figs. 12 and 13
MARGIN = 0.3  # s before the first and after the last axle
SMALLEST_RATE = 10e3  # Hz, of the simulation: 1.6 % error up to 1 kHz
FILTER_ORDER = 4
MAX_DELAY, DELAY_STEP = 0.03, 0.0005  # s, between the found axles and the recording
N_SHIFTS, CHANCE_QUANTILE = 30, 0.95  # of the simulation in time, whose fits are those by chance


@dataclass(frozen=True)
class BandComparison:
    """One sensor in one band (``low``, ``high``) [Hz]: recorded and simulated.

    ``time`` (n,) [s] from the first axle, ``recorded`` and ``simulated`` (n,) [m/s²]; ``frequency`` (m,) [Hz] with the
    power spectral densities ``recorded_density`` and ``simulated_density`` (m,) [(m/s²)²/Hz]. ``fit_by_chance`` [%] is
    the 95 % quantile of the fits of the same simulation shifted in time, None in a recording
    that is too short.
    """

    sensor: str
    low: float
    high: float
    time: np.ndarray
    recorded: np.ndarray
    simulated: np.ndarray
    frequency: np.ndarray
    recorded_density: np.ndarray
    simulated_density: np.ndarray
    fit_by_chance: float | None

    @property
    def level_difference(self) -> float:
        """Power of the simulation over that of the recording. [dB]"""
        return float(10.0 * np.log10(np.mean(self.simulated**2) / np.mean(self.recorded**2)))

    @property
    def fit(self) -> float:
        """Fit of the simulated time series (equation 22). [%]"""
        return fit_percent(self.recorded, self.simulated)

    @property
    def row(self) -> dict[str, Any]:
        """The comparison as numbers."""
        (rms, peak), (simulated_rms, simulated_peak) = (
            (float(np.sqrt(np.mean(x**2))), float(np.abs(x).max())) for x in (self.recorded, self.simulated)
        )
        return {
            "sensor": self.sensor, "band_low_hz": self.low, "band_high_hz": self.high,
            "rms_recorded_ms2": rms, "rms_simulated_ms2": simulated_rms,
            "peak_recorded_ms2": peak, "peak_simulated_ms2": simulated_peak,
            "level_db": self.level_difference, "fit_pct": self.fit, "fit_by_chance_pct": self.fit_by_chance,
        }  # fmt: skip


@dataclass(frozen=True)
class PassageComparison:
    """A recorded passage beside its simulation: ``train`` and ``notes`` in words, ``bands`` per sensor and band.

    ``warnings`` are improbable values of the track and vehicle files.
    """

    train: str
    notes: tuple[str, ...]
    bands: tuple[BandComparison, ...]
    warnings: tuple[str, ...] = ()


def compare_passage(
    file: str | Path,
    turnout_id: str,
    configuration: str | Path = "config",
    raw: str | Path = "raw",
    sensors: Sequence[str] = (),
    track: str | None = None,
    vehicle: str | None = None,
    load: float = 0.5,
    calibrate: bool = True,
    seed: int = 0,
) -> PassageComparison:
    """Find the train in a recording, simulate it on the track of the turnout, and compare both.

    Parameters
    ----------
    file : path
        Recording of one passage.
    turnout_id : str
        Turnout.
    configuration, raw : path
        Folders of the configuration and of all recordings.
    sensors : sequence of str
        Names of the sensors; by default all that recorded the train.
    track : str or None
        Track file; None: that of the turnout.
    vehicle : str or None
        Vehicle file; None: that of the train's type.
    load : float
        Share of the payload. [-]
    calibrate : bool
        Fit the sections of the sensors to the latest hammer tests before the passage, where there are any.
    seed : int
        Seed of the rail's roughness and the supports' scatter.

    Returns
    -------
    PassageComparison
        The comparison.

    Raises
    ------
    ConfigError
        No train, an unknown type without ``vehicle``, an unknown sensor, or axles that are not those of the vehicle.
    """
    every = load_configuration(configuration)
    turnout = with_raw(every.turnout(turnout_id), Path(raw))
    turnout.require_passages()
    path = passage_file(file, turnout, Path(raw), {name: row.raw for name, row in every.rows.items()})
    recording, passage = _recorded_train(path, turnout)
    chosen = _chosen_sensors(sensors, passage, sensors_of(turnout), file)
    vehicle = vehicle or _vehicle_of_type(passage, file)
    place_error = turnout.settings["passage"].place_error
    train, is_reversed, speed = _vehicle(vehicle, load, passage, [s.name for s in chosen], place_error, file)
    path = resolve_track(track, turnout_id, configuration)
    model = load_track(str(path), seed, path.parent)
    notes = [f"track file {path}", speed.note, *([f"{train.name} runs the other way round"] if is_reversed else [])]
    if calibrate:
        model = _calibrate(model, path, chosen, turnout, recording, raw, configuration, notes)
    samples, axles = _simulate(model, train, speed, passage, chosen, recording.rate, seed)
    bands = tuple(
        band
        for sensor, signal in zip(chosen, samples)
        for band in _compare_sensor(sensor, recording, passage, signal, axles[sensor.name], speed)
    )
    heading = f"{passage.direction}, track {passage.track}"
    words = f"{train.name}, {passage.n_axle} axles, {KMH * speed.speed:.1f} km/h, {heading}"
    warnings = improbable_in_files([*files_of_track(path), *files_of_vehicle(vehicle)])
    return PassageComparison(words, tuple(notes), bands, tuple(warnings))


def _recorded_train(path: Path, turnout: TurnoutConfig) -> tuple[Recording, Passage]:
    settings = turnout.settings["passage"]
    result = read(path.name, path.resolve().parent, turnout.require_passages().description, settings.longest)
    for error in result.errors:
        if not (isinstance(error, ReadError) and error.reason in REMARK_REASONS):
            raise error
    if not result.recordings:
        raise ConfigError(str(path), "recording", "no passage that fits into memory", "Cut the file at the train")
    recording = result.recordings[0]
    passage = analyse(recording, sensors_of(turnout), known_patterns(settings.axle_patterns), settings)
    if not passage.n_axle:
        raise ConfigError(str(path), "recording", "no train was found", "turnout passage FILE states the reason")
    return recording, passage


def _chosen_sensors(
    names: Sequence[str], passage: Passage, sensors: Sequence[PassageSensor], file: str | Path
) -> list[PassageSensor]:
    by_name = {s.name: s for s in sensors if s.name in passage.at_sensor}
    all_names = [s.name for s in sensors]
    if unknown := [name for name in names if name not in all_names]:
        observation = f"no sensor {' and '.join(map(repr, unknown))}"
        raise ConfigError("--sensors", "sensor", observation, f"The turnout has {', '.join(all_names)}")
    if unknown := [name for name in names if name not in by_name]:
        remedy = f"Choose from {', '.join(by_name)}"
        raise ConfigError("--sensors", "sensor", f"{', '.join(unknown)}: did not record the train of {file}", remedy)
    return [by_name[name] for name in names or by_name]


def _vehicle_of_type(passage: Passage, file: str | Path) -> str:
    """Name of the vehicle file of the train's type."""
    if passage.type is None or passage.type.type == UNKNOWN:
        raise ConfigError(str(file), "train", "its type is unknown", "Name a vehicle file with --vehicle")
    return passage.type.type.lower()


def _vehicle(
    name: str, load: float, passage: Passage, sensors: Sequence[str], place_error: float, file: str | Path
) -> tuple[Vehicle, bool, SimulatedSpeed]:
    """(vehicle in as many units and in the order that the axles of the train say, whether it is reversed, its speed).

    ``place_error`` [m] is the least standard deviation of a recorded axle.
    """
    one = load_vehicle(name, load)
    units, rest = divmod(passage.n_axle, len(one.wheels))
    if rest or not units:
        observation = f"{passage.n_axle} axles were recorded, the vehicle {name} has {len(one.wheels)}"
        raise ConfigError(str(file), "train", observation, "Name the right vehicle file with --vehicle")
    vehicle = one if units == 1 else load_vehicle(name, load, units=units)
    recorded = speed_at_sensors(passage, sensors)
    speed_se = None if passage.speed is None else KMH * passage.speed.se
    row = {"axle_times_s": passage.offsets / recorded, "speed_se_kmh": speed_se}
    try:
        speed, is_reversed = speed_from_axles(name, vehicle, row, recorded)
    except TrainUnknownError as error:
        raise ConfigError(str(file), "train", str(error), "Name the right vehicle file with --vehicle") from None
    vehicle = vehicle.reverse() if is_reversed else vehicle
    return vehicle, is_reversed, simulated_speed(passage, vehicle, speed, recorded, place_error)


def _calibrate(
    model: TurnoutTrack,
    path: Path,
    sensors: Sequence[PassageSensor],
    turnout: TurnoutConfig,
    recording: Recording,
    raw: str | Path,
    configuration: str | Path,
    notes: list[str],
) -> TurnoutTrack:
    """The track with each sensor's section fitted to its latest hammer tests before the passage."""
    by_section: dict[str, list[tuple[str, tuple]]] = {}
    for unit in scan(turnout, Path(raw)).units:
        if unit.kind == "hammer" and unit.section and unit.campaign:
            by_section.setdefault(unit.section, []).append((unit.campaign, unit.files))
    for section in dict.fromkeys(s.section for s in sensors):
        day = "9999" if recording.started_at is None else recording.started_at.isoformat()
        campaigns = sorted(c for c in by_section.get(section, []) if c[0] <= day)
        if not campaigns:
            notes.append(f"{section}: no hammer test before the passage, as in the track file")
            continue
        campaign, files = campaigns[-1]
        try:
            fit = calibrate_to_files(path, section, [Path(raw) / name for name, *_ in files], turnout.id, configuration)
        except SimulationError as error:
            notes.append(f"{section}: as in the track file ({error})")
            continue
        values = {name: value for name, value in fit.values.items() if fit.is_determined(name)}
        model = with_section(model, section, **values)
        chi = "" if fit.is_adequate else f", chi-squared per degree of freedom {fit.reduced:.0f}"
        notes.append(f"{section}: fitted to the hammer tests of {campaign}{chi}")
    return model


def _simulate(
    model: TurnoutTrack,
    train: Vehicle,
    speed: SimulatedSpeed,
    passage: Passage,
    sensors: Sequence[PassageSensor],
    rate: float,
    seed: int,
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Simulated samples (n_sensor, n), and when the axles pass each sensor in them (n_axle,) [s]."""
    substeps = max(1, math.ceil(SMALLEST_RATE / rate))
    lead = 0.3 + MARGIN
    direction = passage.direction if passage.direction in ("facing", "trailing") else "facing"
    route = passage.track if passage.track in model.routes else next(iter(model.routes))
    recording = simulate_passage(
        model,
        train,
        speed.speed,
        [Sensor(s.name, s.position, "rail web") for s in sensors],
        direction,
        route,
        seed=seed,
        rate=rate,
        substeps=substeps,
        lead=lead,
        tail=lead,
    )
    sign = 1.0 if direction == "facing" else -1.0
    places = sign * np.array([s.position for s in sensors])
    behind = np.sort(train.wheel_positions) - np.min(train.wheel_positions)
    axles = {s.name: lead + (place - places.min() + behind) / speed.speed for s, place in zip(sensors, places)}
    return cast("np.ndarray", recording.samples), axles


def _compare_sensor(
    sensor: PassageSensor,
    recording: Recording,
    passage: Passage,
    simulated: np.ndarray,
    simulated_axles: np.ndarray,
    speed: SimulatedSpeed,
) -> list[BandComparison]:
    axles = np.sort(passage.at_sensor[sensor.name])
    recorded, rate = recording.signal(sensor.name), recording.rate
    recorded = recorded - np.median(recorded)
    start = max(int((axles[0] - MARGIN) * rate), 0)
    stop = min(int((axles[-1] + MARGIN) * rate), recorded.size)
    time = np.arange(start, stop) / rate - axles[0]
    at = recorded_times(np.arange(simulated.size) / rate, simulated_axles, passage, sensor, speed.recorded) - axles[0]
    comparisons: list[BandComparison] = []
    for low, high in BANDS:
        high = min(high, 0.45 * rate)
        ours, theirs = (_in_band(x, low, high, rate) for x in (recorded, simulated))
        ours = ours[start:stop]
        if not comparisons:  # the first band decides the delay of all
            at = at + _delay(time, ours, at, theirs)
        theirs = np.interp(time, at, theirs)
        if not comparisons:
            shifts = _shifts_by_chance(ours, theirs, rate)
        by_chance = _fit_by_chance(ours, theirs, shifts)
        n = min(ours.size, round(rate))
        frequency, density = scipy.signal.welch(np.array([ours, theirs]), rate, "boxcar", nperseg=n, detrend=False)
        inside = (frequency >= low) & (frequency <= high)
        comparisons.append(
            BandComparison(
                sensor.name,
                low,
                high,
                time,
                ours,
                theirs,
                frequency[inside],
                density[0, inside],
                density[1, inside],
                by_chance,
            )
        )
    return comparisons


def _delay(time: np.ndarray, recorded: np.ndarray, at: np.ndarray, simulated: np.ndarray) -> float:
    """Time that the simulation is late, at most ``MAX_DELAY``: the found axles are some centimetres off. [s]"""
    delays = np.arange(-MAX_DELAY, MAX_DELAY + 1e-9, DELAY_STEP)
    products = [float(recorded @ np.interp(time, at + delay, simulated)) for delay in delays]
    return float(delays[int(np.argmax(products))])


def _shifts_by_chance(recorded: np.ndarray, simulated: np.ndarray, rate: float) -> np.ndarray:
    """(n_shift,) shifts of the simulation by which it does not belong to the recording. [samples]

    Evenly spaced, beyond ``2 MAX_DELAY``. Near each, that with the largest product is taken, as ``_delay`` does.
    """
    n, reach = recorded.size, round(MAX_DELAY * rate)
    centres = np.linspace(3 * reach, n - 3 * reach, N_SHIFTS).astype(int) if n > 6 * reach else np.zeros(0, int)
    products = np.fft.irfft(np.fft.rfft(recorded) * np.conj(np.fft.rfft(simulated)), n)
    return np.array([k - reach + np.argmax(products[k - reach : k + reach + 1]) for k in centres], dtype=int)


def _fit_by_chance(recorded: np.ndarray, simulated: np.ndarray, shifts: np.ndarray) -> float | None:
    """Fit that 95 % of the ``shifts`` of the simulation do not reach, None without a shift. [%]

    What leaves the recording at its end comes in at its beginning, so level and spectrum stay.
    """
    fits = [fit_percent(recorded, np.roll(simulated, shift)) for shift in shifts]
    return float(np.quantile(fits, CHANCE_QUANTILE)) if fits else None


def _in_band(samples: np.ndarray, low: float, high: float, rate: float) -> np.ndarray:
    """Samples in a band, without delay."""
    edges, kind = (high, "lowpass") if low == 0.0 else ((low, high), "bandpass")
    return scipy.signal.sosfiltfilt(scipy.signal.butter(FILTER_ORDER, edges, kind, fs=rate, output="sos"), samples)
