"""The rail's own roughness as a nuisance: waves whose amplitudes are free under the spectrum of ISO 3095.

All trains roll over the same waves. They enter the simulation as a path; the derivatives are those of a free track
under the contact force that a wave makes, :math:`F = -p / (A_{wheel} + A_{contact} + A_{rail})`.
"""

import numpy as np

from turnout.mismatch.case import Nuisance
from turnout.mismatch.track import rolling
from turnout.mismatch.track.base_model import track_with
from turnout.simulate.frequency import responses
from turnout.simulate.matrices import assemble
from turnout.simulate.roughness import level
from turnout.simulate.wheel_path import Sampled

REACH = 3.0  # rolling before the first and behind the last sensor that still shakes them [m]
LONGEST, SHORTEST = 3.0, rolling.SHORTEST_WAVE  # [m]
CLOCK = 1000.0  # Hz
STEP = 0.02  # m


class Waves:
    """Cosines and sines over the reach of the sensors; ``names`` of their amplitudes."""

    def __init__(self, places, offset):
        self.start, self.end = min(places) - REACH, max(places) + REACH
        self.length = 1.1 * (self.end - self.start)
        orders = np.arange(int(np.ceil(self.length / LONGEST)), int(self.length / SHORTEST) + 1)
        self.wavelength = np.repeat(self.length / orders, 2)
        self.quarter = np.tile([0.0, 0.5 * np.pi], orders.size)
        self.names = tuple(
            f"{'cos' if q == 0.0 else 'sin'}_wave_{o}" for o, q in zip(np.repeat(orders, 2), self.quarter)
        )
        # variance of a third octave spread over its waves: df / width of the octave, half for each quarter
        width = (2.0 ** (1 / 6) - 2.0 ** (-1 / 6)) / self.wavelength
        self.sd = 1e-6 * 10.0 ** (level(self.wavelength, offset) / 20.0) * np.sqrt(1.0 / (self.length * width))

    def nuisances(self):
        """One amplitude per wave [m]."""
        return [Nuisance(n, "m", 0.0, float(sd), trust=3.0) for n, sd in zip(self.names, self.sd)]

    def shapes(self, x):
        """(n_wave, n) waves at x, faded at both ends."""
        x = np.asarray(x, dtype=float)
        edge = np.clip(np.minimum(x - self.start, self.end - x) / 0.8, 0.0, 1.0)
        fade = edge * edge * (3.0 - 2.0 * edge)
        return fade * np.cos(2.0 * np.pi * x / self.wavelength[:, None] - self.quarter[:, None])

    def amplitudes(self, values):
        """(n_wave,) of ``values``."""
        return np.array([values[n] for n in self.names])

    def path(self, values):
        """The waves as a part of a wheel's path; () where all are 0."""
        amplitude = self.amplitudes(values)
        if not amplitude.any():
            return ()
        x = np.arange(self.start, self.end + STEP, STEP)
        return (Sampled(self.start, STEP, amplitude @ self.shapes(x)),)


def wave_columns(case, values, made):
    """(n_sensor * n_time, n_wave) derivative of a passage by the waves' amplitudes."""
    waves, passage = case.waves, made.passage
    track = track_with(case.track(passage.route), case.zone, values)
    frequency, transfer, point, node = _transfers(case, track, made)
    omega = 2.0 * np.pi * frequency
    speed = made.speed * (1.0 + values[f"speed@{made.name}"])
    sign = 1.0 if passage.direction == "facing" else -1.0
    time = np.arange(0.0, (waves.end - waves.start) / speed, 1.0 / CLOCK)
    x = (waves.start if sign > 0 else waves.end) + sign * speed * time
    size = 1 << int(np.ceil(np.log2(CLOCK * (made.time[-1] - made.time[0] + 1.0) + time.size)))
    grid = np.fft.rfftfreq(size, 1.0 / CLOCK)
    inside = (grid >= frequency[0]) & (grid <= frequency[-1])
    compliance = (
        point
        + _wheel(passage.vehicle, omega)
        + 1.0 / passage.vehicle.contact.tangent(float(np.mean(passage.vehicle.static_loads)))
    )
    per_wave = np.zeros(grid.size, dtype=complex)
    per_wave[inside] = _at(grid[inside], frequency, -1.0 / compliance)
    force = np.fft.irfft(np.fft.rfft(waves.shapes(x), size) * per_wave, size)
    where = (waves.start if sign > 0 else waves.end) + sign * speed * np.arange(size) / CLOCK
    where[size - size // 8 :] -= sign * speed * size / CLOCK  # what rings before the start wraps round
    hats = np.clip(1.0 - np.abs(where[:, None] - node) / (node[1] - node[0]), 0.0, 1.0)
    carry = _at(grid[inside], frequency, transfer)  # (m, n_sensor, n_node)
    behind = passage.vehicle.wheel_places / speed
    train = np.exp(-2j * np.pi * grid[inside][:, None] * behind).sum(axis=1)
    # arrival of the first wheel at the waves' start, on the recording's clock
    first = sign * min(sign * s.place for s in made.sensors)
    begin = made.reference + values[f"time@{made.name}"] - sign * (first - x[0]) / speed
    out = np.empty((made.time.size * len(made.sensors), len(waves.names)))
    for k in range(len(waves.names)):
        on_nodes = np.fft.rfft(hats * force[k][:, None], axis=0)[inside]
        spectrum = np.zeros((grid.size, len(made.sensors)), dtype=complex)
        spectrum[inside] = np.einsum("fsn,fn->fs", carry, on_nodes) * train[:, None]
        signal = np.fft.irfft(spectrum.T, size)
        out[:, k] = rolling.read_at(made.limited(signal, CLOCK), CLOCK, made.time - begin + 0.5 / CLOCK).ravel()
    return out


def _transfers(case, track, made):
    """Lines, acceleration of the sensors per force on rail nodes (m, n_sensor, n_node), point receptance, nodes."""
    matrices = assemble(track)
    frequency = np.arange(4.0, 1.3 * rolling.HIGH, 2.0)
    near = (matrices.node >= case.waves.start - 0.3) & (matrices.node <= case.waves.end + 0.3)
    rows = matrices.node_index[near]
    h = responses(matrices, frequency, [s.probe(track).place for s in made.sensors], rows)
    middle = float(matrices.node[near][near.sum() // 2 + 1])
    point_rows, weights = matrices.weights(middle)
    point = responses(matrices, frequency, [middle], point_rows)[:, 0] @ weights
    return frequency, -((2.0 * np.pi * frequency) ** 2)[:, None, None] * h, point, matrices.node[near]


def _wheel(vehicle, omega):
    """Receptance of the first wheel under the vehicle [m/N]."""
    mass, damping, stiffness, _ = vehicle.matrices
    row = int(vehicle.wheel_rows[0])
    unit = np.zeros(vehicle.n)
    unit[row] = 1.0
    return np.array([np.linalg.solve(stiffness + 1j * w * damping - w * w * mass, unit)[row] for w in omega])


def _at(grid, frequency, values):
    """Linear interpolation between lines, along the first axis."""
    where = np.interp(grid, frequency, np.arange(frequency.size))
    low = np.minimum(where.astype(int), frequency.size - 2)
    part = (where - low).reshape(-1, *(1,) * (values.ndim - 1))
    return (1.0 - part) * values[low] + part * values[low + 1]
