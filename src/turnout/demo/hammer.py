"""One hammer test of the demonstration fleet: ten blows, the section's response, the instruments, the mishaps."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime, time, timedelta

import numpy as np

from turnout.demo import faults
from turnout.records import Channel, Recording

RATE = 20_000.0
N_SAMPLE = 3_000
TRIGGER = 100
FORCE_LIMIT, ACCELERATION_LIMIT = 22_000.0, 2_000.0
DOUBLE_HIT_SHARE, OVERLOAD_SHARE = 0.02, 0.01
FORCE = Channel("force", "force", mounting="hammer", limit=FORCE_LIMIT)
RAIL = Channel("rail", "acceleration", mounting="rail head at sleeper", limit=ACCELERATION_LIMIT)


@dataclass(frozen=True)
class Blow:
    """Truth of one blow: what befell it, "" for nothing."""

    test: int
    record: int
    peak: float
    fault: str = ""


def pulse(peak, contact, start):
    """Half-sine force of a soft tip [N], (N_SAMPLE,); ``contact`` and ``start`` in s, any sub-sample start."""
    t = np.arange(N_SAMPLE) / RATE - start
    return np.where((t > 0) & (t < contact), peak * np.sin(np.pi * t / contact), 0.0)


def response_to(force, impulse_response):
    """Acceleration [m/s²], (N_SAMPLE,), of a ``force`` [N] by a response of ``N_SAMPLE`` samples [m/s² per N s].

    Around the circle of one record: a response with a highest frequency also answers a little before the blow, and
    holds that at its end. Without it the mass-like jump at the blow is halved, and all receptance below it is wrong.
    """
    return np.fft.irfft(np.fft.rfft(force) * np.fft.rfft(impulse_response, N_SAMPLE), N_SAMPLE) / RATE


def hammer_test(impulse_response, temperature, day, test, rng, n_blow=10):
    """Recordings of one test and the truth of each blow.

    Parameters
    ----------
    impulse_response : callable
        ``impulse_response(rng)`` gives (n,) acceleration per unit impulse [m/s² per N s] at ``RATE``; called
        once per blow, since no blow meets quite the same track.
    temperature : float or None
        Rail temperature written into the recording. [°C]
    """
    recordings, truth = [], []
    conditions = {} if temperature is None else {"rail_temperature": round(temperature, 1)}
    started = datetime.combine(day, time(9, 0), UTC).replace(tzinfo=None) + timedelta(minutes=12 * test)
    for record in range(n_blow):
        fault = rng.choice(["double_hit", "overload", ""], p=[DOUBLE_HIT_SHARE, OVERLOAD_SHARE, 0.97])
        peak = 8_000.0 * rng.normal(1.0, 0.10)
        contact, start = 1.5e-3 * rng.normal(1.0, 0.08), (TRIGGER + rng.uniform()) / RATE
        force = pulse(peak, contact, start)
        if fault == "double_hit":
            force += pulse(peak * rng.uniform(0.08, 0.3), contact, start + rng.uniform(0.008, 0.030))
        acceleration = response_to(force, impulse_response(rng))
        samples = np.stack([force, acceleration]) + _noise(peak, acceleration, rng)
        recording = Recording(
            samples, RATE, (FORCE, RAIL), "hammer", record=record, conditions=conditions,
            started_at=started + timedelta(seconds=20 * record),
        )  # fmt: skip
        recordings.append(_convert(faults.overload(recording) if fault == "overload" else recording))
        truth.append(Blow(test, record, peak, str(fault)))
    return recordings, truth


def _noise(peak, acceleration, rng):
    levels = [[1e-3 * peak], [1e-2 * np.max(np.abs(acceleration))]]
    return rng.normal(size=(2, N_SAMPLE)) * np.array(levels)


def _convert(recording):
    """A 16-bit converter: quantised, and cut at the range."""
    limits = np.array([[c.limit] for c in recording.channels])
    step = limits / 2**15
    return replace(recording, samples=np.clip(np.round(recording.samples / step) * step, -limits, limits))
