"""Simulate a hammer test of the demonstration fleet: ten impacts, the section's response, instruments and faults.

The impulse response of a section is that of the simulated track as it is on that day, with all of its changes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime, time, timedelta
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from turnout.demo import scenario
from turnout.demo.track_state import with_stiffness
from turnout.records import Channel, Recording
from turnout.simulate.frequency_response import receptance
from turnout.simulate.hammer import resolve_location
from turnout.simulate.matrices import assemble
from turnout.simulate.parameters import load_track
from turnout.simulate.turnout_track import stretch_of_track

if TYPE_CHECKING:
    from collections.abc import Callable
    from datetime import date

    from turnout.simulate.turnout_track import TurnoutTrack

RATE = 20_000.0  # Hz
N_SAMPLES = 3_000  # of a record
TRIGGER_SAMPLE = 100  # sample of the impact
FORCE_LIMIT, ACCELERATION_LIMIT = 22_000.0, 2_000.0  # N and m/s²: ranges of the channels
DOUBLE_IMPACT_SHARE, OVERLOAD_SHARE = 0.02, 0.01  # of the impacts
FORCE_CHANNEL = Channel("force", "force", mounting="hammer", limit=FORCE_LIMIT)
RAIL_CHANNEL = Channel("rail", "acceleration", mounting="rail head at sleeper", limit=ACCELERATION_LIMIT)


@dataclass(frozen=True)
class ImpactTruth:
    """Truth of one impact: ``peak`` force [N], and its ``fault``, "" for none."""

    test: int
    record: int
    peak: float
    fault: str = ""


def pulse(peak: float, contact: float, start: float) -> np.ndarray:
    """Half-sine force of a soft tip.

    Parameters
    ----------
    peak : float
        Largest force. [N]
    contact, start : float
        Duration and beginning, which may lie between two samples. [s]

    Returns
    -------
    (N_SAMPLES,) array of float
        Force at ``RATE``. [N]
    """
    t = np.arange(N_SAMPLES) / RATE - start
    return np.where((t > 0) & (t < contact), peak * np.sin(np.pi * t / contact), 0.0)


def response_to(force: np.ndarray, impulse_response: np.ndarray) -> np.ndarray:
    """Acceleration that a force excites.

    The convolution is circular over one record: a band-limited response begins a little before the impact, and that
    part is at the end of the record. Without it the mass-like jump at the impact is halved, and the receptance at all
    lower frequencies is wrong.

    Parameters
    ----------
    force : (N_SAMPLES,) array of float
        Force of the hammer. [N]
    impulse_response : (N_SAMPLES,) array of float
        Acceleration after a unit impulse. [m/s² per N s]

    Returns
    -------
    (N_SAMPLES,) array of float
        Acceleration. [m/s²]
    """
    return np.fft.irfft(np.fft.rfft(force) * np.fft.rfft(impulse_response, N_SAMPLES), N_SAMPLES) / RATE


def hammer_test(
    impulse_response: Callable[[np.random.Generator], np.ndarray],
    temperature: float | None,
    day: date,
    test: int,
    rng: np.random.Generator,
    n_impacts: int = 10,
) -> tuple[list[Recording], list[ImpactTruth]]:
    """Recordings of one test and the truth of each impact.

    Parameters
    ----------
    impulse_response : callable
        ``impulse_response(rng)`` gives (n,) acceleration per unit impulse [m/s² per N s] at ``RATE``. It is called
        once per impact, since no two impacts meet quite the same track.
    temperature : float or None
        Rail temperature written into the recording. [°C]
    day : date
        Day of the campaign.
    test : int
        Number of the test, from 1.
    rng : numpy.random.Generator
        Source of faults, scatter and noise.
    n_impacts : int
        Number of impacts.

    Returns
    -------
    list of Recording, list of ImpactTruth
        One of each per impact.
    """
    recordings, truth = [], []
    conditions = {} if temperature is None else {"rail_temperature": round(temperature, 1)}
    started = datetime.combine(day, time(9, 0), UTC).replace(tzinfo=None) + timedelta(minutes=12 * test)
    for record in range(n_impacts):
        fault = rng.choice(["double_hit", "overload", ""], p=[DOUBLE_IMPACT_SHARE, OVERLOAD_SHARE, 0.97])
        peak = 8_000.0 * rng.normal(1.0, 0.10)
        contact, start = 1.5e-3 * rng.normal(1.0, 0.08), (TRIGGER_SAMPLE + rng.uniform()) / RATE
        force = pulse(peak, contact, start)
        if fault == "double_hit":
            force += pulse(peak * rng.uniform(0.08, 0.3), contact, start + rng.uniform(0.008, 0.030))
        acceleration = response_to(force, impulse_response(rng))
        samples = np.stack([force, acceleration]) + _noise(peak, acceleration, rng)
        recording = Recording(
            samples, RATE, (FORCE_CHANNEL, RAIL_CHANNEL), "hammer", record=record, conditions=conditions,
            started_at=started + timedelta(seconds=20 * record),
        )  # fmt: skip
        recordings.append(_convert(scenario.overload(recording) if fault == "overload" else recording))
        truth.append(ImpactTruth(test, record, peak, str(fault)))
    return recordings, truth


def _noise(peak: float, acceleration: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    levels = [[1e-3 * peak], [1e-2 * np.max(np.abs(acceleration))]]
    return rng.normal(size=(2, N_SAMPLES)) * np.array(levels)


def _convert(recording: Recording) -> Recording:
    """The recording after a 16-bit converter: quantised, and clipped at the range."""
    limits = np.array([[c.limit] for c in recording.channels])
    step = limits / 2**15
    return replace(recording, samples=np.clip(np.round(recording.samples / step) * step, -limits, limits))


FREQUENCY_SPREAD = 0.006  # relative sd of the track's frequencies between impacts: hammer and sensor move a little
HALF_LENGTH = 18.0  # m of track on each side of the impact
# Hz: taper of the accelerance. The hammer's pulse has no power above; a smooth end keeps the impulse response short.
PASS_FREQUENCY, STOP_FREQUENCY = 2_500.0, 4_000.0


def simulated_response(section: str, ballast: float, railpad: float) -> Callable[[np.random.Generator], np.ndarray]:
    """Response of the rail at a section, if all ballast and all pads of the track have changed alike.

    Parameters
    ----------
    section : str
        Location of the track of config/tracks/tommerup.yaml.
    ballast, railpad : float
        Stiffness of ballast and pads over that of the track file. [-]

    Returns
    -------
    callable
        As ``response_at``.
    """
    return _with_scatter(*_response_of_changed_track(section, round(ballast, 6), round(railpad, 6)))


def response_at(section: str, turnout: TurnoutTrack) -> Callable[[np.random.Generator], np.ndarray]:
    """Response of the rail at a section to an impact there, which scatters from impact to impact.

    Impact and response are on the rail head. From impact to impact the frequencies scatter by 0.6 %: hammer and sensor
    are never in quite the same position.

    Parameters
    ----------
    section : str
        Location of the turnout.
    turnout : TurnoutTrack
        The unloaded track as it is on that day.

    Returns
    -------
    callable
        From a random generator to (N_SAMPLES,) acceleration per unit impulse [m/s² per N s].
    """
    return _with_scatter(*_accelerance(section, turnout))


def _with_scatter(frequency: np.ndarray, accelerance: np.ndarray) -> Callable[[np.random.Generator], np.ndarray]:
    def response(rng: np.random.Generator) -> np.ndarray:
        scaled = np.interp(frequency * (1.0 + FREQUENCY_SPREAD * rng.standard_normal()), frequency, accelerance)
        return np.fft.irfft(scaled, N_SAMPLES) * RATE

    return response


@lru_cache(maxsize=8)
def _response_of_changed_track(section: str, ballast: float, railpad: float) -> tuple[np.ndarray, np.ndarray]:
    return _accelerance(section, with_stiffness(load_track("tommerup"), lambda _: (ballast, railpad)))


def _accelerance(section: str, turnout: TurnoutTrack) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and accelerance [m/s²/N] up to the Nyquist frequency."""
    position, track = resolve_location(turnout, section)
    stretch = stretch_of_track(track, position, HALF_LENGTH)
    position = float(stretch.support[stretch.nearest_support(position)])
    frequency = np.fft.rfftfreq(N_SAMPLES, 1.0 / RATE)
    in_band = (frequency > 0) & (frequency < STOP_FREQUENCY)
    receptances = receptance(assemble(stretch), frequency[in_band], position, position)
    taper = 0.5 * (
        1.0
        + np.cos(np.pi * np.clip((frequency[in_band] - PASS_FREQUENCY) / (STOP_FREQUENCY - PASS_FREQUENCY), 0.0, 1.0))
    )
    accelerance = np.zeros(frequency.size, complex)
    accelerance[in_band] = -((2 * np.pi * frequency[in_band]) ** 2) * receptances * taper
    return frequency, accelerance
