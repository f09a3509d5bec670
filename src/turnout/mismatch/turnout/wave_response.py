r"""First-order response of sensors to wheels that roll over a wave, without a simulation.

A wave p of the rail or of a tread makes the contact force :math:`F = -p / (A_{wheel} + A_{contact} + A_{rail})`, which
a free track carries to the sensors. A force of frequency :math:`f_0` that moves at v past nodes with transfer
:math:`G_{sn}(f)` gives

.. math:: S_s(f) = T \mathrm{sinc}^2((f - f_0) T) \sum_n F_n G_{sn}(f) e^{-2 \pi i (f - f_0) \tau_n}

Here :math:`\tau_n` is the time at the node and T the distance between nodes over v. :math:`F_n` is the force on the
rail about the node: its receptance is averaged over ``AVERAGING_LENGTH``, since a wheel rings on for a few bays.
"""

import numpy as np

from turnout.mismatch.turnout import passage_band, passage_model
from turnout.mismatch.turnout.receptance_model import linear
from turnout.mismatch.turnout.receptance_observation import channel_factor
from turnout.mismatch.turnout.track_parameters import track_with, vehicle_with
from turnout.simulate.frequency_response import responses

STRIDE = 2  # every second node is used; in between a force is shared linearly
FINE = 0.01  # m, step of a fine path
RING = 0.35  # s, ringing of the track after the last wheel
MET = 2.4  # m; with 0.6 and 1.2 errors near the wheel resonance are larger, with the whole rail above it


class Carrier:
    """Transfer from waves to the sensors of one passage, on the track that ``values`` and ``terms`` give.

    ``node`` (n,) are positions of the forces, up to ``beyond`` the ends of the free waves [m].
    """

    def __init__(self, case, values, made, terms=(), beyond=0.0):
        terms = [t.under(case.said(made)) for t in terms]
        self.made, waves, vehicle = made, case.waves, _vehicle(values, made, terms)
        lines, transfer, point, self.node = _transfers(case, values, made, terms, beyond)
        self.speed = made.speed * (1.0 + values[f"speed@{made.name}"])
        self.sign = 1.0 if made.passage.direction == "facing" else -1.0
        self.first = self.sign * min(self.sign * s.place for s in made.sensors)
        self.behind = vehicle.wheel_places / self.speed
        span = (waves.end - waves.start + 2.0 * beyond) / self.speed + self.behind[-1] + RING
        self.rate, self.fine = made.clock, case.solver.rate
        size = 1 << int(np.ceil(np.log2(self.rate * max(span, made.time[-1] - made.time[0] + RING))))
        self.size, self.period, self.start = size, waves.length, waves.start
        grid = np.fft.rfftfreq(size, 1.0 / self.rate)
        self.inside = np.flatnonzero((grid >= lines[0]) & (grid <= min(lines[-1], 1.25 * made.high)))
        self.grid = grid[self.inside]
        self.passing = self.sign * (self.node - self.first) / self.speed
        self.step = (self.node[1] - self.node[0]) / self.speed
        carry = _at(self.grid, lines, transfer)  # (f, sensor, node)
        self.carry = carry * np.exp(-2j * np.pi * self.grid[:, None, None] * self.passing)
        self.lines, self.compliance = lines, point + wheel_and_contact(vehicle, lines)[:, None]
        begin = made.time[0] - made.reference - values[f"time@{made.name}"]
        gate = passage_band.gate(self.grid, passage_band.LOW, made.high)
        shown = shown_by(values, terms, made, self.grid)
        self.clock = (gate * self.rate * np.exp(2j * np.pi * self.grid * begin))[:, None] * shown

    def train(self):
        """(f,) sum over all wheels of their delays."""
        return np.exp(-2j * np.pi * self.grid[:, None] * self.behind).sum(axis=1)

    def wheel(self, w):
        """(f,) delay of one wheel."""
        return np.exp(-2j * np.pi * self.grid * self.behind[w])

    def spectra(self, lengths, envelope):
        """(f, sensor, wave) for cosines exp(i 2 pi x / length), positive and negative frequency."""
        f0 = self.speed / np.asarray(lengths)
        force = -0.5 / _at(np.clip(f0, self.lines[0], self.lines[-1]), self.lines, self.compliance).T
        turn = np.exp(2j * np.pi * self.sign * self.first / np.asarray(lengths))
        found = []
        for sign, amount in ((1.0, force * turn), (-1.0, (force * turn).conj())):
            phase = envelope[:, None] * amount * np.exp(sign * 2j * np.pi * self.passing[:, None] * f0)
            hat = self.step * np.sinc((self.grid[:, None] - sign * f0) * self.step) ** 2
            found.append((self.carry @ phase) * hat[:, None, :])
        return found

    def signals(self, lengths, envelope, delay):
        """(n_sensor * n_time, 2 n_wave) response to cosine and sine of each length, one metre high."""
        return self.shown(self.spectra(lengths, envelope), delay)

    def shown(self, spectra, delay):
        """(n_sensor * n_time, 2 n_wave) signals of ``spectra`` at the times of the observation."""
        plus, minus = spectra
        both = np.stack([plus + minus, (plus - minus) * (-1j * self.sign)], axis=-1)
        return self._on_clock(both.reshape(*both.shape[:2], -1) * delay[:, None, None])

    def followed(self, paths):
        """(n_sensor * n_time, n_key) response when every wheel follows paths (n_key, n_x) [m] over one period."""
        plus, minus, a = self._harmonics(paths)
        return self._on_clock((plus @ a.T + minus @ a.T.conj()) * self.train()[:, None, None])

    def alone(self, w, paths):
        """The same for wheel ``w`` alone."""
        plus, minus, a = self._harmonics(paths)
        return self._on_clock((plus @ a.T + minus @ a.T.conj()) * self.wheel(w)[:, None, None])

    def _harmonics(self, paths):
        """Spectra of the waves of ``path_grid``, and amplitudes (..., n_wave) of paths (..., n_x) in them."""
        n_x = paths.shape[-1]
        orders = np.arange(1, min(n_x // 2, int(self.period / passage_band.SHORTEST_WAVE)) + 1)
        amplitude = 2.0 / n_x * np.fft.rfft(paths, axis=-1)[..., orders]
        amplitude = amplitude * np.exp(-2j * np.pi * orders * self.start / self.period)  # cosines count from x = 0
        if self.sign < 0.0:
            amplitude = amplitude.conj()
        return *self.spectra(self.period / orders, np.ones(self.node.size)), amplitude

    def reactions(self, paths):
        """(n_sensor * n_time, n_key) response when each wheel follows a path of its own.

        ``paths`` (n_key, n_wheel, n_x) [m] are at ``path_grid``: how wheels respond to motion of the rail under them.
        """
        plus, minus, amplitude = self._harmonics(paths)
        total = 0.0
        for w in range(self.behind.size):
            a = amplitude[:, w].T
            total = total + (plus @ a + minus @ a.conj()) * self.wheel(w)[:, None, None]
        return self._on_clock(total)

    @property
    def way(self):
        """(n_x,) positions of the paths of ``reactions``: one period, so that its ends have no effect."""
        return self._places(2 * int(np.ceil(self.period / passage_band.SHORTEST_WAVE)) + 2)

    @property
    def course(self):
        """The same for paths of ``train_response`` and ``wheel_response`` with waves shorter than those modelled.

        Sampled as coarsely as ``path_grid``, a kink would alias to longer waves.
        """
        return self._places(int(self.period / FINE))

    def _places(self, n):
        return self.start + self.period * np.arange(n) / n

    def times(self, w, lead):
        """(n_x,) time of wheel ``w`` at ``path_grid``, in the time of the simulation [s]."""
        return lead + self.sign * (self.way - self.first) / self.speed + self.behind[w]

    def pressed(self, histories, transfer, first):
        """(n_sensor * n_time, n_key) response of the free track to forces (n_force, n) at the rate of the simulation.

        The forces from ``first`` (n_key,) of each key on act together. ``transfer`` (n_line, n_sensor, n_force) are
        accelerations per force on ``self.lines``.
        """
        fold = round(self.fine / self.rate)
        n = min(histories.shape[1] // fold, self.size)
        slow = histories[:, : n * fold].reshape(-1, n, fold).mean(axis=2)
        spectrum = np.fft.rfft(slow - slow[:, :1], self.size)[:, self.inside]
        spectrum /= np.sinc(self.grid / self.rate)  # what the mean over the block took
        begin = 0.5 / self.rate - passage_model.LEAD
        spectrum = spectrum * np.exp(-2j * np.pi * self.grid * begin) / self.rate
        shown = _at(self.grid, self.lines, transfer) * spectrum.T[:, None, :]
        return self._on_clock(np.add.reduceat(shown, first, axis=-1))

    def _on_clock(self, spectrum):
        full = np.zeros((self.size // 2 + 1, *spectrum.shape[1:]), dtype=complex)
        full[self.inside] = spectrum * self.clock[:, :, None]
        n = self.made.time.size
        return np.fft.irfft(full, self.size, axis=0)[:n].transpose(1, 0, 2).reshape(n * len(self.made.sensors), -1)


def _vehicle(values, made, terms):
    """The vehicle as ``values`` and ``terms`` have it."""
    passage = made.passage
    vehicle = vehicle_with(passage.vehicle, values, passage.train or passage.name, values[f"load@{made.name}"])
    for term in terms:
        vehicle = term.vehicle(vehicle)
    return vehicle


def shown_by(values, terms, made, frequency):
    """(m, n_sensor) complex factor of each channel: linear channel terms and gains."""
    factors = [channel_factor(terms, s, frequency) * (1.0 + values[f"gain_{s.name}"]) for s in made.sensors]
    return np.column_stack(factors)


def _transfers(case, values, made, terms, beyond):
    """Lines, acceleration of the sensors per force on rail nodes (m, n_sensor, n_node), receptance of the rail about
    each node (m, n_node), and nodes.
    """
    track = track_with(case.track(made.passage.route, terms), case.zone, values)
    matrices = linear(track, terms)
    frequency = np.arange(4.0, 1.3 * passage_band.HIGH, 2.0)
    beyond += 0.3
    near = np.flatnonzero((matrices.node >= case.waves.start - beyond) & (matrices.node <= case.waves.end + beyond))
    near = near[::STRIDE]
    places = [case.seat(s, values, terms).probe(track).place for s in made.sensors]
    h, met = carried(matrices, frequency, near, places)
    return frequency, -((2.0 * np.pi * frequency) ** 2)[:, None, None] * h, met, matrices.node[near]


def carried(matrices, frequency, near, places):
    """(m, n_place, n) receptances between positions and nodes ``near``, and (m, n) rail receptance at these nodes.

    The latter is averaged over ``AVERAGING_LENGTH``. [m/N]
    """
    node = matrices.node[near]
    h = responses(matrices, frequency, [*places, *node.tolist()], matrices.node_index[near])
    about = np.abs(node[:, None] - node) < 0.5 * MET
    met = np.diagonal(h[:, len(places) :], axis1=1, axis2=2) @ (about / about.sum(axis=0))
    return h[:, : len(places)], met


def wheel_and_contact(vehicle, frequency):
    """(m,) receptance of the first wheel under the vehicle, and of its contact [m/N]."""
    omega = 2.0 * np.pi * frequency
    contact = vehicle.each("contact")[0].tangent(float(np.mean(vehicle.static_loads)))
    mass, damping, stiffness, _ = vehicle.matrices
    row = int(vehicle.wheel_rows[0])
    unit = np.zeros(vehicle.n)
    unit[row] = 1.0
    wheel = [np.linalg.solve(stiffness + 1j * w * damping - w * w * mass, unit)[row] for w in omega]
    return np.array(wheel) + 1.0 / contact


def _at(grid, frequency, values):
    """Linear interpolation between lines, along the first axis."""
    where = np.interp(grid, frequency, np.arange(frequency.size))
    low = np.minimum(where.astype(int), frequency.size - 2)
    part = (where - low).reshape(-1, *(1,) * (values.ndim - 1))
    return (1.0 - part) * values[low] + part * values[low + 1]
