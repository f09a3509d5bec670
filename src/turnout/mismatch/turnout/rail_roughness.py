"""Roughness of the rail as nuisances: waves with free amplitudes, whose prior is the spectrum of ISO 3095.

All trains roll over the same waves. They enter the simulation as a path. The derivatives are the response of a free
track to the contact force of a wave, see ``wave_response``.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout.surface_priors import ROUGHNESS
from turnout.mismatch.turnout.wave_response import WaveTransfer
from turnout.simulate.roughness import level
from turnout.simulate.wheel_path import Sampled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.mismatch.turnout.passage_observation import AlignedPassage
    from turnout.mismatch.turnout.prediction import Predictor
    from turnout.mismatch.turnout.predictions import Terms, Values


class Waves:
    """Cosines and sines over the range of the sensors; ``names`` of their amplitudes."""

    def __init__(self, positions: Sequence[float], offset: float):
        self.start, self.end = min(positions) - ROUGHNESS.rolling_reach, max(positions) + ROUGHNESS.rolling_reach
        self.length = ROUGHNESS.period_ratio * (self.end - self.start)
        orders = np.arange(
            int(np.ceil(self.length / ROUGHNESS.longest_wave)), int(self.length / ROUGHNESS.shortest_wave) + 1
        )
        self.lengths = self.length / orders
        self.wavelength = np.repeat(self.lengths, 2)
        self.phase_offset = np.tile([0.0, 0.5 * np.pi], orders.size)
        self.names = tuple(
            f"{'cos' if q == 0.0 else 'sin'}_wave_{o}" for o, q in zip(np.repeat(orders, 2), self.phase_offset)
        )
        # the limit curve is an upper limit for intact rails: with more, waves hide dips of half a millimetre
        self.sd = amplitude_sd(self.wavelength, self.length, offset)

    def nuisances(self) -> list[Nuisance]:
        """One amplitude per wave [m]."""
        return [Nuisance(n, "m", 0.0, float(sd), can_mask=False, group="wave") for n, sd in zip(self.names, self.sd)]

    def fade(self, x: np.ndarray) -> np.ndarray:
        """Envelope that fades the waves at both ends.

        Parameters
        ----------
        x : (n,) array of float
            Positions along the rail. [m]

        Returns
        -------
        (n,) array of float
            0 to 1.
        """
        edge = np.clip(np.minimum(x - self.start, self.end - x) / ROUGHNESS.fade_length, 0.0, 1.0)
        return edge * edge * (3.0 - 2.0 * edge)

    def shapes(self, x: np.ndarray | Sequence[float]) -> np.ndarray:
        """Waves at some positions, faded at both ends.

        Parameters
        ----------
        x : (n,) array or sequence of float
            Positions along the rail. [m]

        Returns
        -------
        (n_wave, n) array of float
            Of unit amplitude.
        """
        x = np.asarray(x, dtype=float)
        return self.fade(x) * np.cos(2.0 * np.pi * x / self.wavelength[:, None] - self.phase_offset[:, None])

    def amplitudes(self, values: Values) -> np.ndarray:
        """Amplitudes of the waves.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.

        Returns
        -------
        (n_wave,) array of float
            Amplitude. [m]
        """
        return np.array([values[n] for n in self.names])

    def path(self, values: Values) -> tuple[Sampled, ...]:
        """The waves as a component of a wheel's path; () where all are 0.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.

        Returns
        -------
        tuple[Sampled, ...]
        """
        amplitude = self.amplitudes(values)
        if not amplitude.any():
            return ()
        return (Sampled(self.start, ROUGHNESS.path_step, amplitude @ self._path_shapes),)

    @cached_property
    def _path_shapes(self) -> np.ndarray:
        """(n_wave, n) waves every ``ROUGHNESS.path_step``."""
        return self.shapes(np.arange(self.start, self.end + ROUGHNESS.path_step, ROUGHNESS.path_step))


def amplitude_sd(wavelength: np.ndarray, length: float, offset: float) -> np.ndarray:
    """Standard deviation [m] of cosine and sine of waves that are harmonics of ``length`` [m].

    The variance of a third octave is spread over the waves in it, half for each quarter.

    Parameters
    ----------
    wavelength : (n,) array of float
        Wavelengths. [m]
    length : float
        Period of which they are harmonics. [m]
    offset : float
        Level over the limit curve of ISO 3095. [dB]

    Returns
    -------
    (n,) array of float
        [m]
    """
    width = (2.0 ** (1 / 6) - 2.0 ** (-1 / 6)) / wavelength
    return 1e-6 * 10.0 ** (level(wavelength, offset) / 20.0) * np.sqrt(1.0 / (length * width))


def wave_columns(predictor: Predictor, values: Values, terms: Terms, aligned: AlignedPassage) -> np.ndarray:
    """Derivative of a passage by the amplitudes of the waves.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    terms : sequence of PhysicsTerm
        Effects beside the base model.
    aligned : AlignedPassage
        The passage.

    Returns
    -------
    (n_sensor * n_time, n_wave) array of float
        [m/s² per m]
    """
    transfer = WaveTransfer(predictor, values, aligned, terms)
    return transfer.signals(predictor.waves.lengths, predictor.waves.fade(transfer.node), transfer.train())
