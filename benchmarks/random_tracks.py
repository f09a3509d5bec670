"""Hammer tests on random tracks in closed form, with faults of the response: late, early, wrong unit, limited.

The track is an infinite Timoshenko beam (Timoshenko 1921) on two layers: railpads, sleepers and ballast, each spread
evenly along the rail. It has no discrete supports and shares nothing with the simulator of the tool.
"""

from dataclasses import dataclass

import numpy as np
from scipy import signal

from turnout.records import Channel, Recording
from turnout.signal.filters import FAMILIES, force_pulse

RATE, DURATION, TRIGGER = 20_000.0, 0.3, 0.02  # Hz, s, s
FOLD = 4  # samples of the simulation for each that is recorded
CHANNELS = Channel("hammer", "force"), Channel("rail", "acceleration", mounting="rail head at sleeper")
FILTER = signal.butter(6, 0.9 / FOLD, output="sos")  # anti-alias filter of the logger
YOUNGS_MODULUS, SHEAR_MODULUS, DENSITY, SPACING = 210e9, 80.77e9, 7850.0, 0.6
FORCE_NOISE, RESPONSE_NOISE = 1e-3, 3e-3  # standard deviation, shares of the peak


@dataclass(frozen=True)
class RandomTrack:
    """Values of a track: of the rail [kg/m, m⁴], of a support [N/m, N s/m, kg]."""

    mass: float
    second_moment: float
    pad: tuple[float, float]
    sleeper: float
    ballast: tuple[float, float]

    @classmethod
    def draw(cls, rng):
        """Rails of 49 to 60 kg/m, pads of 80 to 800 MN/m, ballast of 20 to 200 MN/m, timber to concrete sleepers."""
        mass, pad, ballast = rng.uniform(49.0, 60.0), *np.exp(rng.uniform(np.log([8e7, 2e7]), np.log([8e8, 2e8])))
        damping = pad * rng.uniform(5e-5, 2e-4), ballast * rng.uniform(3e-4, 1e-3)
        second_moment = 3055e-8 * (mass / 60.3) ** 1.7
        return cls(mass, second_moment, (pad, damping[0]), rng.uniform(35.0, 160.0), (ballast, damping[1]))

    def receptance(self, omega, distance=0.0):
        """(n,) displacement at a distance [m] from a unit force, at angular frequencies above 0 [m/N]."""
        pad, ballast = (k + 1j * omega * c for k, c in (self.pad, self.ballast))
        support = 1.0 / (1.0 / pad + 1.0 / (ballast - self.sleeper * omega**2)) / SPACING
        bending, shear = YOUNGS_MODULUS * self.second_moment, 0.39 * SHEAR_MODULUS * self.mass / DENSITY
        turning = DENSITY * self.second_moment * omega**2
        net = support - self.mass * omega**2
        middle = net * bending - shear * turning
        squares = np.sqrt(middle**2 - 4.0 * shear * bending * net * (shear - turning))
        total = np.zeros(omega.size, complex)
        for square in ((-middle + squares) / (2.0 * shear * bending), (-middle - squares) / (2.0 * shear * bending)):
            wavenumber = np.sqrt(square)
            wavenumber = np.where(wavenumber.imag < 0.0, -wavenumber, wavenumber)
            residue = (bending * square + shear - turning) / (
                4.0 * shear * bending * wavenumber**3 + 2.0 * wavenumber * middle
            )
            total += 1j * residue * np.exp(1j * wavenumber * distance)
        return total


def hammer_test(rng, n_impact=10, delay=0.0, factor=1.0, n_limited=0):
    """Recordings of a test on a random track, and the excess of each response over the limit of its amplifier.

    ``delay`` of the response [s], ``factor`` on it. ``n_limited`` impacts exceed the limit by 5 to 30 % or more.
    """
    track, family = RandomTrack.draw(rng), list(FAMILIES)[rng.integers(len(FAMILIES))]
    time = np.arange(round(DURATION * RATE) * FOLD) / (RATE * FOLD)
    omega = 2.0 * np.pi * np.fft.rfftfreq(time.size, time[1])
    transfer = np.zeros(omega.size, complex)
    transfer[1:] = -(omega[1:] ** 2) * track.receptance(omega[1:], rng.uniform(0.0, 0.2))
    contact, forces = np.exp(rng.uniform(*np.log((6e-4, 3e-3)))), []
    for _ in range(n_impact):
        peak = np.exp(rng.uniform(*np.log((1000.0, 6000.0))))
        start = TRIGGER + rng.uniform() / RATE
        width = contact * (peak / 3000.0) ** -0.1 * rng.normal(1.0, 0.03)
        forces.append(peak * force_pulse(family, time - start, width))
    responses = np.fft.irfft(np.fft.rfft(forces) * transfer * np.exp(-1j * omega * delay), time.size)
    peaks = np.max(np.abs(responses), axis=1)
    limit = np.sort(peaks)[-n_limited] / rng.uniform(1.05, 1.3) if n_limited else np.inf
    recordings = []
    for k, (force, response) in enumerate(zip(forces, np.clip(responses, -limit, limit))):
        pair = signal.sosfiltfilt(FILTER, [force, factor * response])[:, ::FOLD]
        noise = np.array([[FORCE_NOISE], [RESPONSE_NOISE]]) * np.max(np.abs(pair), axis=1, keepdims=True)
        pair = pair + noise * rng.standard_normal(pair.shape)
        recordings.append(Recording(pair, RATE, CHANNELS, "a", record=k))
    return recordings, peaks / limit
