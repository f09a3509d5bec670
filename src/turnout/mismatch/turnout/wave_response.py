r"""First-order response of sensors to wheels that roll over a wave, without a simulation.

A wave of the rail or of a tread makes a contact force F (``rolling_wheel``), which a free track carries to the sensors.
A force of frequency :math:`f_0` that moves at v past nodes with transfer :math:`G_{sn}(f)` gives

.. math:: S_s(f) = T \mathrm{sinc}^2((f - f_0) T) \sum_n F_n G_{sn}(f) e^{-2 \pi i (f - f_0) \tau_n}

with :math:`F_n` the force at node n, :math:`\tau_n` the time at the node and T the distance between nodes over v.

In a switch the force acts on the rail that the wheel presses, and a change of one top alone also moves load from one
rail to the other (``wheel_line``).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout import passage_band
from turnout.mismatch.turnout.priors import PASSAGE, SIMULATION
from turnout.mismatch.turnout.receptance_observation import channel_factor
from turnout.mismatch.turnout.rolling_wheel import force_envelopes, interpolate
from turnout.mismatch.turnout.track_parameters import vehicle_with
from turnout.mismatch.turnout.track_under_wheels import TrackUnderWheels

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from turnout.mismatch.turnout.passage_observation import AlignedPassage
    from turnout.mismatch.turnout.prediction import Predictor
    from turnout.mismatch.turnout.predictions import Terms, Values
    from turnout.simulate.vehicle import Vehicle


class WaveTransfer:
    """Transfer from waves to the sensors of one passage, on the track that ``values`` and ``terms`` give.

    ``node`` (n,) are positions of the forces, up to ``beyond`` the ends of the free waves [m]. ``load_transfer`` is the
    change of the wheels to the blade of a switch, None elsewhere.
    """

    def __init__(
        self, predictor: Predictor, values: Values, aligned: AlignedPassage, terms: Terms = (), beyond: float = 0.0
    ):
        terms = [t.under_conditions(aligned.conditions) for t in terms]
        self.aligned, waves, vehicle = aligned, predictor.waves, _vehicle(values, aligned, terms)
        track = TrackUnderWheels(predictor, values, aligned, terms, vehicle)
        self.load_transfer = track.load_transfer
        lines = passage_band.transfer_lines()
        transfer, point, pair, self.node = track.transfers(lines, beyond)
        self.speed = aligned.speed * (1.0 + values[f"speed@{aligned.name}"])
        self.sign = 1.0 if aligned.passage.direction == "facing" else -1.0
        self.first = self.sign * min(self.sign * s.place for s in aligned.sensors)
        self.wheel_delays = vehicle.wheel_positions / self.speed
        span = (waves.end - waves.start + 2.0 * beyond) / self.speed + self.wheel_delays[-1] + SIMULATION.ring_time
        self.rate, self.simulation_rate = aligned.clock, predictor.solver.rate
        size = 1 << int(
            np.ceil(np.log2(self.rate * max(span, aligned.time[-1] - aligned.time[0] + SIMULATION.ring_time)))
        )
        self.size, self.period, self.start = size, waves.length, waves.start
        grid = np.fft.rfftfreq(size, 1.0 / self.rate)
        self.inside = np.flatnonzero((grid >= lines[0]) & (grid <= min(lines[-1], 1.25 * aligned.high)))
        self.grid = grid[self.inside]
        self.node_times = self.sign * (self.node - self.first) / self.speed
        self.step = (self.node[1] - self.node[0]) / self.speed
        transfer_at_grid = interpolate(self.grid, lines, transfer)  # (f, sensor, node)
        self.node_transfer = transfer_at_grid * np.exp(-2j * np.pi * self.grid[:, None, None] * self.node_times)
        self.lines, self.compliance = lines, point + wheel_and_contact_receptance(vehicle, lines)[:, None]
        start_time = aligned.time[0] - aligned.reference - values[f"time@{aligned.name}"]
        gate = passage_band.band_window(self.grid, PASSAGE.band_low, aligned.high)
        channels = channel_responses(values, terms, aligned, self.grid)
        self.clock = (gate * self.rate * np.exp(2j * np.pi * self.grid * start_time))[:, None] * channels
        self.pair_transfer = None if pair is None else self._pair_transfer(track, interpolate(self.grid, lines, pair))

    def train(self) -> np.ndarray:
        """(f,) sum over all wheels of their delays."""
        return np.exp(-2j * np.pi * self.grid[:, None] * self.wheel_delays).sum(axis=1)

    def wheels(self) -> list[np.ndarray]:
        """Delay of each wheel, (f,)."""
        return [self.wheel(w) for w in range(self.wheel_delays.size)]

    def wheel(self, w: int) -> np.ndarray:
        """Phase factor by which a wheel follows the first one.

        Parameters
        ----------
        w : int
            Index of the wheel, from 0.

        Returns
        -------
        (f,) array of complex
        """
        return np.exp(-2j * np.pi * self.grid * self.wheel_delays[w])

    def spectra(self, lengths: np.ndarray | Sequence[float], envelope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Responses to waves exp(i 2 pi x / length), at positive and negative frequency.

        Parameters
        ----------
        lengths : (n_wave,) array or sequence of float
            Wavelengths. [m]
        envelope : (n_x,) array of float
            Weight of the wave at ``node``.

        Returns
        -------
        positive, negative : (f, n_sensor, n_wave) array of complex
        """
        f0 = self.speed / np.asarray(lengths)
        along = slice(None) if self.sign > 0.0 else slice(None, None, -1)  # nodes in the direction of the wheel
        step = self.node[1] - self.node[0]
        force = force_envelopes(self.compliance[:, along], self.lines, envelope[along], step, self.speed, f0)[along]
        rotation = np.exp(2j * np.pi * self.sign * self.first / np.asarray(lengths))
        spectra = []
        for sign, amount in ((1.0, force * rotation), (-1.0, (force * rotation).conj())):
            phase = amount * np.exp(sign * 2j * np.pi * self.node_times[:, None] * f0)
            hat = self.step * np.sinc((self.grid[:, None] - sign * f0) * self.step) ** 2
            spectra.append((self.node_transfer @ phase) * hat[:, None, :])
        plus, minus = spectra
        return plus, minus

    def signals(self, lengths: np.ndarray, envelope: np.ndarray, delay: np.ndarray) -> np.ndarray:
        """Response to cosine and sine of each length, one metre high.

        Parameters
        ----------
        lengths : (n_wave,) array of float
            Wavelengths. [m]
        envelope : (n_x,) array of float
            Weight of the wave at ``path_grid``.
        delay : (f,) array of complex
            Phase factor that delays a wheel.

        Returns
        -------
        (n_sensor * n_time, 2 n_wave) array of float
        """
        return self.signals_from(self.spectra(lengths, envelope), delay)

    def signals_from(self, spectra: tuple[np.ndarray, np.ndarray], delay: np.ndarray) -> np.ndarray:
        """Signals of ``spectra`` at the times of the observation.

        Parameters
        ----------
        spectra : (f, n_sensor, n_wave) array of complex, twice
            Responses at positive and negative frequency.
        delay : (f,) array of complex
            Phase factor that delays a wheel.

        Returns
        -------
        (n_sensor * n_time, 2 n_wave) array of float
        """
        return self._on_clock(self.cosines_and_sines(spectra) * delay[:, None, None])

    def cosines_and_sines(self, spectra: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Spectra of the responses to cosine and sine of each wave.

        Parameters
        ----------
        spectra : (f, n_sensor, n_wave) array of complex, twice
            Responses at positive and negative frequency.

        Returns
        -------
        (f, n_sensor, 2 n_wave) array of complex
        """
        plus, minus = spectra
        pairs = np.stack([plus + minus, (plus - minus) * (-1j * self.sign)], axis=-1)
        return pairs.reshape(*pairs.shape[:2], -1)

    def tops_response(self, on_stock: np.ndarray, on_blade: np.ndarray, delays: Sequence[np.ndarray]) -> np.ndarray:
        """Response when the tops of stock rail and blade are lower by some paths.

        Parameters
        ----------
        on_stock, on_blade : (n_key, n_x) array of float
            Dips at ``fine_grid``; both the same where there is no blade. [m]
        delays : sequence of (f,) array of complex
            ``train()``, or ``wheel`` of several.

        Returns
        -------
        (n_delay, n_sensor * n_time, n_key) array of float
            [m/s²]
        """
        weight = 0.0 if self.load_transfer is None else self.load_transfer.blade_weight(self.fine_grid)
        plus, minus, a = self._harmonics((1.0 - weight) * on_stock + weight * on_blade)
        spectrum = plus @ a.T + minus @ a.T.conj()
        if self.load_transfer is not None and self.pair_transfer is not None:
            x, _ = self.load_transfer.positions()
            difference = [np.interp(x, self.fine_grid, d) for d in on_stock - on_blade]
            spectrum = spectrum + self.pair_transfer @ np.array(difference).T
        return np.array([self._on_clock(spectrum * delay[:, None, None]) for delay in delays])

    def pair_response(self, differences: np.ndarray) -> np.ndarray:
        """Response to the load that goes from one rail to the other under each wheel.

        Parameters
        ----------
        differences : (n_key, n_wheel, m) array of float
            Deflection of the stock rail less that of the blade at ``load_transfer.positions()``. [m]

        Returns
        -------
        (n_sensor * n_time, n_key) array of float
            [m/s²]
        """
        assert self.pair_transfer is not None
        total: Any = 0.0
        for w in range(self.wheel_delays.size):
            total = total + (self.pair_transfer @ differences[:, w].T) * self.wheel(w)[:, None, None]
        return self._on_clock(total)

    def _pair_transfer(self, track: TrackUnderWheels, pair: np.ndarray) -> np.ndarray:
        """(f, n_sensor, m) response to the first wheel per difference of both tops at each position of the change."""
        change = track.load_transfer
        assert change is not None
        x, length = change.positions()
        node = track.matrices.node[track.pair_nodes]
        shares = np.array([np.interp(x, node, unit) for unit in np.eye(node.size)])
        times = self.sign * (x - self.first) / self.speed
        force = np.exp(-2j * np.pi * self.grid[:, None] * times) * (length / self.speed / change.flexibility)
        return (pair @ shares) * force[:, None, :]

    def _harmonics(self, paths: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Spectra of the waves of ``path_grid``, and amplitudes (..., n_wave) of paths (..., n_x) in them."""
        n_x = paths.shape[-1]
        orders = np.arange(1, min(n_x // 2, int(self.period / PASSAGE.shortest_wave)) + 1)
        amplitude = 2.0 / n_x * np.fft.rfft(paths, axis=-1)[..., orders]
        amplitude = amplitude * np.exp(-2j * np.pi * orders * self.start / self.period)  # cosines count from x = 0
        if self.sign < 0.0:
            amplitude = amplitude.conj()
        return *self.spectra(self.period / orders, np.ones(self.node.size)), amplitude

    def reactions(self, paths: np.ndarray) -> np.ndarray:
        """Response when each wheel follows a path of its own.

        So do wheels respond to motion of the rail under them.
        In single precision, right to 1e-5 of its size: the products of all waves and wheels are most of the work.

        Parameters
        ----------
        paths : (n_key, n_wheel, n_x) array of float
            Path of each wheel at ``path_grid``. [m]

        Returns
        -------
        (n_sensor * n_time, n_key) array of float
        """
        plus, minus, amplitude = (x.astype(np.complex64) for x in self._harmonics(paths))
        total: Any = 0.0
        for w in range(self.wheel_delays.size):
            a = np.ascontiguousarray(amplitude[:, w].T)  # numpy multiplies a transposed one without BLAS
            total = total + (plus @ a + minus @ a.conj()) * self.wheel(w).astype(np.complex64)[:, None, None]
        return self._on_clock(total)

    @property
    def path_grid(self) -> np.ndarray:
        """(n_x,) positions of the paths of ``reactions``: one period, so that its ends have no effect."""
        return self._period_grid(2 * int(np.ceil(self.period / PASSAGE.shortest_wave)) + 2)

    @property
    def fine_grid(self) -> np.ndarray:
        """The same for paths of ``tops_response`` with waves shorter than those modelled.

        Sampled as coarsely as ``path_grid``, a kink would alias to longer waves.
        """
        return self._period_grid(int(self.period / SIMULATION.path_step))

    def _period_grid(self, n: int) -> np.ndarray:
        return self.start + self.period * np.arange(n) / n

    def times(self, w: int, lead: float, x: np.ndarray) -> np.ndarray:
        """Time of wheel ``w`` at ``x``, in the time of the simulation.

        Parameters
        ----------
        w : int
            Index of the wheel, from 0.
        lead : float
            Time that the simulation starts before the observation [s].
        x : (n_x,) array of float
            Positions of the wheel. [m]

        Returns
        -------
        (n_x,) array of float
            Time. [s]
        """
        return lead + self.sign * (x - self.first) / self.speed + self.wheel_delays[w]

    def force_response(self, histories: np.ndarray, transfer: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Response of the free track to forces; those of one key act together.

        Parameters
        ----------
        histories : (n_force, n) array of float
            Forces at the rate of the simulation, those of a key next to each other. [N]
        transfer : (n_line, n_sensor, n_force) array of complex
            Acceleration per force on ``self.lines``. [m/s²/N]
        first : (n_key,) array of int
            Index of the first force of each key.

        Returns
        -------
        (n_sensor * n_time, n_key) array of float
        """
        fold = round(self.simulation_rate / self.rate)
        n = min(histories.shape[1] // fold, self.size)
        slow = histories[:, : n * fold].reshape(-1, n, fold).mean(axis=2)
        spectrum = np.fft.rfft(slow - slow[:, :1], self.size)[:, self.inside]
        spectrum /= np.sinc(self.grid / self.rate)  # what the mean over the block took
        start_time = 0.5 / self.rate - SIMULATION.lead_time
        spectrum = spectrum * np.exp(-2j * np.pi * self.grid * start_time) / self.rate
        response = interpolate(self.grid, self.lines, transfer) * spectrum.T[:, None, :]
        return self._on_clock(np.add.reduceat(response, first, axis=-1))

    def _on_clock(self, spectrum: np.ndarray) -> np.ndarray:
        """Signals (n_sensor * n_time, n) of spectra (f, n_sensor, n), in their precision."""
        full = np.zeros((self.size // 2 + 1, *spectrum.shape[1:]), dtype=spectrum.dtype)
        full[self.inside] = spectrum * self.clock.astype(spectrum.dtype)[:, :, None]
        n = self.aligned.time.size
        return np.fft.irfft(full, self.size, axis=0)[:n].transpose(1, 0, 2).reshape(n * len(self.aligned.sensors), -1)


def _vehicle(values: Values, aligned: AlignedPassage, terms: Terms) -> Vehicle:
    """The vehicle as ``values`` and ``terms`` have it."""
    passage = aligned.passage
    vehicle = vehicle_with(passage.vehicle, values, aligned.train, values[f"load@{aligned.name}"])
    for term in terms:
        vehicle = term.vehicle(vehicle)
    return vehicle


def channel_responses(values: Values, terms: Terms, aligned: AlignedPassage, frequency: np.ndarray) -> np.ndarray:
    """Complex factor of each channel: linear channel terms and gains.

    Parameters
    ----------
    values : mapping
        All nuisances of the site, by name.
    terms : sequence of PhysicsTerm
        Effects beside the base model.
    aligned : AlignedPassage
        The passage.
    frequency : (m,) array of float
        Lines. [Hz]

    Returns
    -------
    (m, n_sensor) array of complex
    """
    factors = [
        channel_factor(terms, s, frequency, "passage") * (1.0 + values[f"gain_{s.name}"]) for s in aligned.sensors
    ]
    return np.column_stack(factors)


def wheel_and_contact_receptance(vehicle: Vehicle, frequency: np.ndarray) -> np.ndarray:
    """Receptance of the first wheel under the vehicle, and of its contact [m/N].

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.
    frequency : (m,) array of float
        Lines. [Hz]

    Returns
    -------
    (m,) array of complex
        [m/N]
    """
    omega = 2.0 * np.pi * frequency
    contact = vehicle.wheel_values("contact")[0].tangent(float(np.mean(vehicle.static_loads)))
    mass, damping, stiffness, _ = vehicle.matrices
    row = int(vehicle.wheel_rows[0])
    unit = np.zeros(vehicle.n)
    unit[row] = 1.0
    wheel = [np.linalg.solve(stiffness + 1j * w * damping - w * w * mass, unit)[row] for w in omega]
    return np.array(wheel) + 1.0 / contact
